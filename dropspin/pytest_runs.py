"""The runs that tests ask for, each made once by `dropspin` in a process of its own, and what of them fails a test.

dropspin runs in separate processes, and this file imports nothing else of it, so that pytest starts fast.
"""

import hashlib
import json
import math
import os
import re
import shlex
import subprocess
import sys
import tempfile
import uuid
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

NAME = "dropspin"
BREAKDOWNS = frozenset({"broken", "diverged", "crashed", "timed_out"})
FAILING = BREAKDOWNS | {"failed"}
STOPPED = BREAKDOWNS | {"declined", "missing"}
BASELINE = "dropspin-baseline.toml"
"""The file that `dropspin accept` writes by default."""
MOST_FAILURES = 12
"""Largest number of failures in the message of a test."""
REPRODUCE_OUTPUT = ("-o", "out/again")
"""Options of the command that reproduces a failure, which must not replace a run that the user wants to keep."""
SUBJECTS = {
    "order": "order of",
    "asymptotic_error": "asymptotic",
    "accepted order": "accepted order of",
    "accepted asymptotic error": "accepted asymptotic",
}
"""The prefix of the metric's name in a message, by the kind of a row, or, for accepted results, by the column `truth`."""

Row = dict[str, Any]
JUDGED = pytest.StashKey[list[Row]]()
Scene = str | os.PathLike[str] | Mapping[str, Any]


@dataclass(frozen=True)
class Result:
    """A run of one scene.

    Attributes:
        scene: Name of the scene.
        rows: The rows that `dropspin run --json` prints, one for each measurement, with value, bounds, verdict and reason.
        folder: The run's folder, with the report and the data; `dropspin check` and `dropspin accept` accept it as their argument.
        given: The scene's name or path, as given on the command line.
        engines: The names by which engines are run, by the label in the rows.
        dts: The requested time steps [s]; empty for the default ones.
        definition: A hash of the scene's name or mapping, and of the content of its file.
    """

    scene: str
    rows: list[Row] = field(repr=False)
    folder: Path
    given: str = field(repr=False)
    engines: Mapping[str, str] = field(repr=False)
    dts: tuple[float, ...] = field(repr=False)
    definition: str = field(default="", repr=False)

    def value(self, metric: str, dt: float | None = None, engine: str | None = None) -> float:
        """The measured value of a metric, in the metric's unit; NaN if it is undefined.

        Args:
            metric: Name of the metric, as `dropspin list metrics` prints it.
            dt: Time step [s]; the finest if None.
            engine: Label of the engine in the rows, or the name by which it was asked for; optional if only one engine ran.

        Raises:
            LookupError: The metric was not measured, or was measured for several engines.
        """
        labels = {engine, *(label for label, name in self.engines.items() if name == engine)}
        of_engine = [row for row in self.rows if engine is None or row["engine"] in labels]
        measured = [row for row in of_engine if row["kind"] in ("truth", "invariant", "ensemble")]
        rows = [row for row in measured if row["metric"] == metric and (dt is None or math.isclose(row["dt"], dt, rel_tol=1e-9))]
        engines = list(dict.fromkeys(row["engine"] for row in rows))
        if len(engines) > 1:
            raise LookupError(f"{metric} was measured for several engines, {', '.join(engines)}; choose one with engine=")
        stops = [row["dt"] for row in of_engine if row["engine"] in engines and row["verdict"] in STOPPED and row["dt"] is not None]
        if dt is None and min(stops, default=math.inf) < min((row["dt"] for row in rows), default=0.0):
            rows, dt = [], min(stops)
        if not rows:
            wanted = f"{metric} of {engine or self.scene} at {'any time step' if dt is None else f'{dt:g} s'}"
            available = ", ".join(dict.fromkeys(row["metric"] for row in measured)) or "no metric"
            stopped = "".join(f"; {row['engine']} {row['verdict']}: {row['reason']}" for row in of_engine if row["verdict"] in STOPPED)
            raise LookupError(f"{wanted} was not measured; available: {available}{stopped}")
        value = min(rows, key=lambda row: row["dt"])["value"]
        return math.nan if value is None else float(value)


class Runs:
    """The runs of this session. Each is made once, by the worker of pytest-xdist that first needs it."""

    def __init__(self, config: pytest.Config) -> None:
        self.config, self.root = config, config.rootpath
        self.session: str = getattr(config, "workerinput", {}).get(NAME) or uuid.uuid4().hex
        self.named = bool(config.getoption("dropspin_engine"))
        self.engines: tuple[str, ...] = tuple(config.getoption("dropspin_engine") or config.getini("dropspin_engines"))
        self.dts: tuple[float, ...] = tuple(config.getoption("dropspin_dt"))
        for dt in self.dts:
            if not 0.0 < dt < math.inf:
                raise pytest.UsageError(f"--dropspin-dt: got {dt:g}; a time step is a positive number of seconds.")
        baseline = config.getoption("dropspin_baseline")
        self.baseline: str | None = self._readable(baseline) if baseline else config.getini("dropspin_baseline") or None
        self._results: dict[str, Result] = {}

    def _readable(self, name: str) -> str:
        """A file given on the command line, as a path relative to the root directory, in which dropspin is started."""
        path = self.config.invocation_params.dir / name
        try:
            path.open("rb").close()
        except OSError as error:
            raise pytest.UsageError(f"--dropspin-baseline: {name}: {error.strerror}.") from None
        return os.path.relpath(path, self.root)

    @property
    def folder(self) -> Path:
        """The folder of the runs, in pytest's cache, or, without a cache, a temporary folder of this session."""
        cache = getattr(self.config, "cache", None)
        folder = Path(tempfile.gettempdir(), f"{NAME}-{self.session}") if cache is None else cache.mkdir(NAME)
        folder.mkdir(exist_ok=True)
        return folder

    def run(self, scene: Scene, engines: Sequence[str] | None = None, dts: Sequence[float] | None = None) -> Result:
        """Run a scene, or return the run if this session has already made it."""
        __tracebackhide__ = True
        from filelock import FileLock

        engines, dts = self.engines if engines is None else engines, self.dts if dts is None else dts
        options = _options(engines, dts, self.baseline)
        file = None if isinstance(scene, Mapping) else self.root / scene
        content = hashlib.sha256(file.read_bytes()).hexdigest() if file and file.is_file() else ""  # a test may write a file again
        given = scene if isinstance(scene, Mapping) else os.fspath(scene)
        definition, asked = (_hash(of) for of in ([given, content], [given, options, content]))
        name = f"{title_of(scene)}-{asked[:8]}"
        if name in self._results:
            return self._results[name]
        folder, kept = self.folder / name, self.folder / f"{name}.json"
        # The operating system releases this lock when a worker dies; a lock made of a folder would stay and block the other workers.
        with FileLock(self.folder / f"{name}.lock"):
            if isinstance(scene, Mapping):
                scene = _written(self.folder / f"{name}-scene", scene)
            target = os.path.relpath(scene, self.root) if os.path.isabs(scene) else os.fspath(scene)
            stored = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
            if stored.get("session") != self.session:
                done = self.dropspin("run", target, *options, "-o", os.path.relpath(folder, self.root), "--json")
                stored = {"session": self.session, "rows": json.loads(done.stdout or "[]"), "error": error_of(done)}
                unfinished = kept.with_suffix(".unfinished")
                unfinished.write_text(json.dumps(stored), encoding="utf-8")
                unfinished.replace(kept)
        if not stored["rows"]:
            pytest.fail(stored["error"], pytrace=False)
        names = json.loads((folder / "run.json").read_text(encoding="utf-8"))["provenance"]["names"]
        self._results[name] = Result(stored["rows"][0]["scene"], stored["rows"], folder, target, names, tuple(dts), definition)
        return self._results[name]

    def dropspin(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run the installed command in the root directory; engines are found in pytest's `pythonpath` too."""
        paths = [*map(str, self.config.getini("pythonpath")), *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = os.environ | {"PYTHONIOENCODING": "utf-8", "PYTHONPATH": os.pathsep.join(paths)}
        command = [sys.executable, "-P", "-m", "dropspin", *arguments]
        return subprocess.run(
            command, cwd=self.root, env=environment, stdin=subprocess.DEVNULL, capture_output=True, encoding="utf-8", check=False
        )

    def _fails(self, row: Row) -> bool:
        """Whether a row fails: a missing engine does if the command line names it, or if it is an adapter of the user."""
        return row["verdict"] in FAILING or (row["verdict"] == "missing" and (self.named or ":" in row["engine"].partition("[")[0]))

    def judge(self, node: pytest.Item, result: Result, rows: Sequence[Row], *, pytrace: bool = False) -> None:
        """Fail or skip a test by the verdicts of some rows of a run, and keep the rows for the summary.

        Args:
            node: The test.
            result: The run.
            rows: The rows.
            pytrace: Whether the failure shows the lines of the calling test.
        """
        __tracebackhide__ = True
        asked = {label: (result.definition, name) for label, name in result.engines.items()}
        judged = [row | {"message": message_of(row), "fails": self._fails(row), "asked": asked[row["engine"]]} for row in rows]
        node.stash.setdefault(JUDGED, []).extend(row for row in judged if row["fails"] or row["verdict"] in STOPPED | {"passed", "known"})
        failing = [row for row in judged if row["fails"]]
        if failing:
            pytest.fail(self._failure(result, failing), pytrace=pytrace)
        if not any(row["verdict"] == "passed" for row in judged):
            unjudged = [row for row in judged if row["verdict"] in STOPPED | {"known", "limited"}]
            reasons = [f"{row['engine']} {row['verdict']}: {row['reason']}" for row in unjudged]
            pytest.skip(reasons[0] if reasons else "the scene has no expectation at these time steps")

    def _failure(self, result: Result, failing: Sequence[Row]) -> str:
        """The failures, with the commands that reproduce and accept them."""
        lines = []
        for row in failing[:MOST_FAILURES]:
            reason = [f"    {row['reason']}"] if row["metric"] and row["reason"] else []
            lines += [f"{row['scene']}, {row['engine']}: {row['message']}", *reason]
        if len(failing) > MOST_FAILURES:
            lines.append(f"and {len(failing) - MOST_FAILURES} more")
        lines.append(f"Reproduce: {self._reproduce(result, failing)}")
        if any(row["verdict"] == "failed" and row["metric"] for row in failing):
            known = ["--known-failures"] if any(row["kind"] != "baseline" for row in failing) else []
            folder = os.path.relpath(result.folder, self.root)
            command = shlex.join([NAME, "accept", folder, "--baseline", self.baseline or BASELINE, *known, "--reason"]) + ' "…"'
            lines.append(f"If this change is intended: {command}" + ("" if self.baseline else f"; then use --dropspin-baseline {BASELINE}"))
        return "\n".join(lines)

    def _reproduce(self, result: Result, failing: Sequence[Row]) -> str:
        """The command that reproduces failures, from the root directory."""
        engines = dict.fromkeys(result.engines[row["engine"]] for row in failing)
        # A result of several time steps, such as an order, takes all of them again.
        dts = sorted({row["dt"] for row in failing}, reverse=True) if all(row["dt"] is not None for row in failing) else result.dts
        paths = os.pathsep.join(os.path.relpath(path, self.root) for path in self.config.getini("pythonpath"))
        command = [NAME, "run", result.given, *_options(engines, dts, self.baseline), *REPRODUCE_OUTPUT]
        return shlex.join([f"PYTHONPATH={paths}"] * bool(paths) + command)


def _options(engines: Iterable[str], dts: Iterable[float], baseline: str | None) -> list[str]:
    """Options of `dropspin run`."""
    named = [word for engine in engines for word in ("-e", engine)] + [word for dt in dts for word in ("--dt", repr(float(dt)))]
    return named + ([] if baseline is None else ["--baseline", baseline])


def _hash(asked: Any) -> str:
    return hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()


def title_of(scene: Scene) -> str:
    """The scene's name in file names and test ids."""
    name = str(scene.get("name", "scene")) if isinstance(scene, Mapping) else Path(scene).stem
    return re.sub(r"[^A-Za-z0-9-]+", "-", name)


def error_of(done: subprocess.CompletedProcess[str]) -> str:
    """The reason why a command failed: the last line for bad input and missing engines, all of stderr for an internal error."""
    error = done.stderr.strip()
    return error.splitlines()[-1] if done.returncode in (2, 3) and error else error or f"dropspin ended with exit code {done.returncode}"


def _written(folder: Path, scene: Mapping[str, Any]) -> Path:
    """A scene that was given as a mapping, written to a file."""
    import tomlkit

    folder.mkdir(exist_ok=True)
    path = folder / f"{title_of(scene)}.toml"
    path.write_text(tomlkit.dumps({key: value for key, value in scene.items() if key != "name"}), encoding="utf-8")
    return path


def message_of(row: Row) -> str:
    """A row in one line: its subject, its value, and its bounds or the interval of an extrapolated value."""
    if not row["metric"]:
        return f"{row['verdict']}: {row['reason']}"
    prefix = row["truth"] if row["kind"] == "baseline" else row["kind"] if row["kind"] in SUBJECTS else ""
    at = "" if row["dt"] is None else f" at {row['dt']:g} s"
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    value = "undefined" if row["value"] is None else f"{row['value']:.3g}{unit}"
    lower, upper = ("" if row[end] is None else f"{row[end]:.3g}" for end in ("lower", "upper"))
    bounds = f"{lower} … {upper}" if lower and upper else f"≥ {lower}" if lower else f"≤ {upper}" if upper else ""
    expected = f", {'95 % interval' if row['kind'] in SUBJECTS else 'expected'} {bounds}" if bounds else ""
    return f"{SUBJECTS.get(prefix, prefix)} {row['metric']}{at} is {value}{expected}".strip()
