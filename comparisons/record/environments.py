"""Environments of releases: which releases there are, and a virtual environment that has one of them and all that dropspin runs with.

The environment has the packages of the running one on its path, after its own: only the engine is installed, and its release is the one
that is imported. pip chooses wheels only, so that no code of a source distribution runs.
"""

import json
import re
import sys
import venv
from collections.abc import Sequence
from pathlib import Path
from subprocess import PIPE, STDOUT, Popen, TimeoutExpired
from tempfile import TemporaryDirectory
from threading import Event
from typing import Any

from comparisons.record.plan import Plan
from comparisons.running.processes import Closed
from scenarios import DropspinError, UnknownName

POLL = 0.5  # s
LONGEST_REASON = 300
NOT_INSTALLABLE = "not installable"
"""The beginning of the reason why pip did not install a release; another day it may."""
HOME = Path(__file__).parents[2]


class NotMeasured(Exception):
    """A release that has no results; the text says why."""


def releases(package: str, oldest: str) -> list[str]:
    """The releases of a package in pip's index from a release on, oldest first.

    Raises:
        DropspinError: pip is not installed, cannot ask its index, or the index lacks the package or the oldest release.
    """
    code, output = run([sys.executable, "-m", "pip", "index", "versions", package], Event())
    found = re.search(r"^Available versions: (.+)$", output, re.MULTILINE)
    if code or found is None:
        raise DropspinError(f"pip cannot list the releases of {package}: {last_line(output)}; record needs pip, and access to its index.")
    listed = found[1].split(", ")
    if oldest not in listed:
        raise UnknownName(f"{package}'s oldest release", oldest, listed)
    return listed[: listed.index(oldest) + 1][::-1]


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
        NotMeasured: It cannot be installed or run.
        Closed: `stopping` was set.
    """
    own = plan.engines[engine]
    with TemporaryDirectory(prefix="dropspin-record-") as folder:
        python = _environment(Path(folder))
        pip = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-input", "--only-binary", ":all:"]
        code, output = run([*pip, *own.requirements(release)], stopping)
        if code:
            raise NotMeasured(f"{NOT_INSTALLABLE}: {without_paths(last_line(output))}")
        request, answer = Path(folder, "request.json"), Path(folder, "answer.json")
        asked = {"package": own.package, "release": release, "labels": own.labels, "time_limit": time_limit}
        request.write_text(json.dumps(asked | {"scenes": plan.scenes_of(engine), "dts": plan.dts}), encoding="utf-8")
        code, output = run([python, "-P", "-m", "comparisons.record.release", str(request), str(answer)], stopping)
        if code:
            raise NotMeasured(f"not runnable: exit code {code}: {without_paths(last_line(output))}")
        found: dict[str, Any] = json.loads(answer.read_text(encoding="utf-8"))
    for row in found["rows"]:
        row["reason"] = without_paths(row["reason"])
    return found


def _environment(folder: Path) -> str:
    """Make a virtual environment, in which the running environment's packages come last on the path; the path of its Python."""
    builder = venv.EnvBuilder(symlinks=True)
    context = builder.ensure_directories(folder)
    builder.create(folder)
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    packages = folder / ("Lib" if sys.platform == "win32" else f"lib/{version}") / "site-packages"
    (packages / "running.pth").write_text("\n".join([*filter(None, sys.path), str(HOME)]), encoding="utf-8")
    return str(context.env_exe)


def run(command: Sequence[str], stopping: Event) -> tuple[int, str]:
    """The exit code and the output of a command.

    Raises:
        Closed: `stopping` was set; the command is ended.
    """
    with Popen(command, stdout=PIPE, stderr=STDOUT, text=True, errors="replace") as process:
        while True:
            try:
                output, _ = process.communicate(timeout=POLL)
                return process.returncode, output
            except TimeoutExpired:
                if stopping.is_set():
                    process.kill()
                    raise Closed from None
            except BaseException:
                process.kill()
                raise


def last_line(output: str) -> str:
    """The last line of an output that says what went wrong: pip's first error, else the last line."""
    lines = output.strip().splitlines() or ["no output"]
    errors = [line for line in lines if line.startswith("ERROR: ")]
    return (errors or lines)[-1].removeprefix("ERROR: ")


def without_paths(text: str) -> str:
    """A text in which paths are file names alone: paths may have names of persons. The text has one line and at most 300 characters."""
    return re.sub(r"(?<![\w.])(?:[A-Za-z]:)?(?:[/\\][^/\\\s:'\"]+)+[/\\]([^/\\\s:'\"]*)", r"\1", " ".join(text.split()))[:LONGEST_REASON]
