"""Environments of releases: which releases there are, and a virtual environment that has one of them and all that dropspin runs with.

The environment has the packages of the running one on its path, after its own: only the engine is installed, and its release is the one
that is imported. pip chooses wheels only, and npm runs no scripts, so that no code of a package runs while it is installed.
"""

import json
import os
import re
import sys
import sysconfig
import venv
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from shutil import which
from subprocess import PIPE, STDOUT, Popen, TimeoutExpired
from tempfile import TemporaryDirectory
from threading import Event
from typing import Any

from dropspin.comparisons.engines.packages import is_npm, numbers_of
from dropspin.comparisons.record.plan import Plan
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.processes import Closed
from dropspin.scenarios import DropspinError
from dropspin.scenarios.errors import verify_known

POLL = 0.5  # s
LONGEST_REASON = 300
HOME = Path(__file__).parents[3]


def releases(package: str, oldest: str) -> list[str]:
    """The releases of a package in the index of pip, or of npm, from a release on, oldest first.

    Raises:
        DropspinError: pip or npm is not installed, cannot ask its index, or the index lacks the package or the oldest release.
    """
    named = _npm_view(package, "versions") if is_npm(package) else _pip_releases(package)
    listed = [name for name in named if not is_npm(package) or re.fullmatch(r"\d+(\.\d+)*", name)]  # without npm's prereleases
    verify_known(f"{package}'s oldest release", [oldest], listed)
    return listed[listed.index(oldest) :]


def prereleases(package: str, newest: str) -> list[str]:
    """The prereleases of a package after its newest release, oldest first: on npm, those that have a dist-tag such as `next`.

    Raises:
        DropspinError: As `releases`.
    """
    if not is_npm(package):
        listed = _pip_releases(package, "--pre")
        return listed[listed.index(newest) + 1 :]
    tagged = {version for version in _npm_view(package, "dist-tags").values() if numbers_of(version) > numbers_of(newest)}
    return sorted(tagged, key=lambda version: (numbers_of(version), version))


def _pip_releases(package: str, *options: str) -> list[str]:
    code, output = run([sys.executable, "-m", "pip", "index", "versions", package, *options], Event())
    found = re.search(r"^Available versions: (.+)$", output, re.MULTILINE)
    if code or found is None:
        raise DropspinError(f"pip cannot list the releases of {package}: {last_line(output)}; record needs pip, and access to its index.")
    return found[1].split(", ")[::-1]


def _npm_view(package: str, field: str) -> Any:
    """What the index of npm has in a field of a package."""
    code, output = run([_npm(package), "view", package, field, "--json", "--loglevel=error"], Event())
    if code:
        raise DropspinError(f"npm cannot list the releases of {package}: {last_line(output)}; its releases need access to npm's index.")
    return json.loads(output)


def _npm(package: str) -> str:
    """The path of npm."""
    found = which("npm")
    if found is None:
        raise DropspinError(f"record needs npm for {package}, and there is none on PATH; install Node.js, or name other engines with -e.")
    return found


def measured(plan: Plan, engine: str, release: str, time_limit: float, stopping: Event) -> dict[str, Any]:
    """Install a release into an environment of its own and measure it there.

    Args:
        plan: The plan of the record.
        engine: The name of the engine.
        release: The release.
        time_limit: Processor time that the engine may use for one simulation [s].
        stopping: Once it is set, everything ends.

    Returns:
        `rows` and `versions`, as `release.py` writes them.

    Raises:
        Breakdown: It cannot be run, or cannot be installed here, which may be possible another day (`missing`).
        Closed: `stopping` was set.
    """
    own = plan.engines[engine]
    with TemporaryDirectory(prefix="dropspin-record-") as folder:
        python = installed(Path(folder), own.package, own.requirements(release), stopping)
        request, answer = Path(folder, "request.json"), Path(folder, "answer.json")
        asked = {"package": own.package, "release": release, "labels": own.labels, "time_limit": time_limit}
        request.write_text(json.dumps(asked | {"scenes": plan.scenes_of(engine), "dts": plan.dts}), encoding="utf-8")
        code, output = run([python, "-P", "-m", "dropspin.comparisons.record.release", str(request), str(answer)], stopping)
        if code:
            raise Breakdown("broken", f"not runnable: exit code {code}: {without_paths(last_line(output))}")
        found: dict[str, Any] = json.loads(answer.read_text(encoding="utf-8"))
    for row in found["rows"]:
        row["reason"] = without_paths(row["reason"])
    return found


def installed(folder: Path, package: str, requirements: Sequence[str], stopping: Event) -> str:
    """Make a virtual environment, and install a release of an engine into it.

    Args:
        folder: Where; it may exist, and is then empty.
        package: The name of the engine's package on PyPI or npm.
        requirements: What pip or npm installs, such as `mujoco==4.0.0`.
        stopping: Once it is set, everything ends.

    Returns:
        The path of its Python.

    Raises:
        Breakdown: It cannot be installed here, which may be possible another day (`missing`).
        Closed: `stopping` was set.
    """
    venv.create(folder, symlinks=True)
    python = python_of(folder)
    # The running environment's packages come last on the path.
    packages = Path(sysconfig.get_path("purelib", "venv", {"base": str(folder)}))
    (packages / "running.pth").write_text("\n".join([*filter(None, sys.path), str(HOME)]), encoding="utf-8")
    if is_npm(package):
        install = [_npm(package), "install", "--prefix", str(folder), "--no-save", "--ignore-scripts", "--no-audit", "--loglevel=error"]
    else:
        install = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-input", "--only-binary", ":all:"]
    code, output = run([*install, *requirements], stopping)
    if code:
        raise Breakdown("missing", f"not installable: {without_paths(last_line(output))}")
    return python


def python_of(folder: Path) -> str:
    """The path of the Python of an environment."""
    return str(venv.EnvBuilder(symlinks=True).ensure_directories(folder).env_exe)


def run(command: Sequence[str], stopping: Event) -> tuple[int, str]:
    """The exit code and the output of a command, without colours and in UTF-8, because it is parsed.

    Raises:
        Closed: `stopping` was set; the command is ended.
    """
    plain = {name: value for name, value in os.environ.items() if name != "FORCE_COLOR"}
    plain |= {"NO_COLOR": "1", "TTY_COMPATIBLE": "0", "PYTHONIOENCODING": "utf-8"}
    with Popen(command, stdout=PIPE, stderr=STDOUT, encoding="utf-8", errors="replace", env=plain) as process:
        try:
            while not stopping.is_set():
                with suppress(TimeoutExpired):
                    output, _ = process.communicate(timeout=POLL)
                    return process.returncode, output
            raise Closed
        except BaseException:
            process.kill()
            raise


def last_line(output: str) -> str:
    """The line of an output that says what went wrong: npm's first error after its code, pip's last error, else the last line."""
    if (found := re.search(r"^npm error (?!code)\S+ (.+)$", output, re.MULTILINE)) is not None:
        return found[1]
    lines = output.strip().splitlines() or ["no output"]
    errors = [line for line in lines if line.startswith("ERROR: ")]
    return (errors or lines)[-1].removeprefix("ERROR: ")


def without_paths(text: str) -> str:
    """A text in which paths are file names alone: paths may have names of persons. The text has one line and at most 300 characters."""
    return re.sub(r"(?<![\w.])(?:[A-Za-z]:)?(?:[/\\][^/\\\s:'\"]+)+[/\\]([^/\\\s:'\"]*)", r"\1", " ".join(text.split()))[:LONGEST_REASON]
