"""The pytest plugin: engines held against the exact answer, as tests. How to use it: docs/pytest.md.

dropspin works in processes of its own. A user's repository may have packages `scenarios`, `reports` or `comparisons`, which pytest imports
here; dropspin's packages of these names are never imported in this process, nor the user's in theirs.
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
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

import pytest

NAME = "dropspin"
BREAKDOWNS = frozenset({"diverged", "crashed", "timed_out"})
FAILING = BREAKDOWNS | {"failed"}
STOPPED = BREAKDOWNS | {"declined", "missing"}
BASELINE = "dropspin-baseline.toml"
"""Where `dropspin accept` writes to unless told."""
AT_MOST = 12
"""How many failures one test tells."""
APART = ("-o", "out/again")
"""Where the command runs to that does it again: it must not replace a run that somebody wants."""
MARKER = (
    "dropspin(*scenes, engine=None, dt=None): call the test for each scene and engine, with the run as the fixture dropspin_result; "
    "on the tests that --dropspin-scene collects too, so that -m dropspin selects all of them."
)

Row = dict[str, Any]
Scene = str | os.PathLike[str] | Mapping[str, Any]


@dataclass(frozen=True)
class Result:
    """A run of one scene.

    Attributes:
        scene: The scene's name.
        rows: The rows of `dropspin run --json`: one for each figure, with its value, bounds, verdict and reason.
        folder: With the report and the data; `dropspin check` and `dropspin accept` take it.
        given: The scene's name or path.
        engines: By their names in the rows, as they were asked for.
        dts: The steps that were asked for [s]; none for dropspin's own.
    """

    scene: str
    rows: list[Row] = field(repr=False)
    folder: Path
    given: str = field(repr=False)
    engines: Mapping[str, str] = field(repr=False)
    dts: tuple[float, ...] = field(repr=False)

    def value(self, metric: str, dt: float | None = None, engine: str | None = None) -> float:
        """What was measured, in the metric's unit; NaN if that is no number.

        Args:
            metric: Its name, as `dropspin list metrics` has it.
            dt: The step [s]; the finest if None.
            engine: Its name in the rows; may be left out where only one ran.

        Raises:
            LookupError: It was not measured, or by several engines.
        """
        measured = [row for row in self.rows if row["kind"] in ("truth", "invariant", "ensemble") and engine in (None, row["engine"])]
        found = [row for row in measured if row["metric"] == metric and (dt is None or math.isclose(row["dt"], dt, rel_tol=1e-9))]
        if not found:
            there = ", ".join(dict.fromkeys(row["metric"] for row in measured)) or "nothing"
            said = "".join(f"; {row['engine']} {row['verdict']}: {row['reason']}" for row in self.rows if row["verdict"] in STOPPED)
            raise LookupError(f"{metric} of {engine or self.scene} at {dt or 'any step'} was not measured; measured is {there}{said}")
        if len({row["engine"] for row in found}) > 1:
            raise LookupError(f"{metric} was measured of {', '.join(dict.fromkeys(row['engine'] for row in found))}; name the engine")
        value = min(found, key=lambda row: row["dt"])["value"]
        return math.nan if value is None else float(value)


class Runs:
    """What this session asks of dropspin; each run is made once, whichever worker of pytest-xdist wants it first."""

    def __init__(self, config: pytest.Config) -> None:
        of_worker = getattr(config, "workerinput", {}).get(NAME, {})
        self.config, self.root = config, config.rootpath
        self.session: str = of_worker.get("session") or uuid.uuid4().hex
        self.plan: dict[str, Any] = of_worker.get("plan", {})
        self.named = bool(config.getoption("dropspin_engine"))
        self.engines: tuple[str, ...] = tuple(config.getoption("dropspin_engine") or config.getini("dropspin_engines"))
        self.dts: tuple[float, ...] = tuple(config.getoption("dropspin_dt"))
        asked, written = config.getoption("dropspin_baseline"), config.getini("dropspin_baseline")
        self.baseline: str | None = self._from_root(asked) if asked else written or None
        self.selected = tuple(arg for arg in config.args if arg.startswith(f"{NAME}::"))
        config.args[:] = [arg for arg in config.args if arg not in self.selected]
        no_paths = bool(self.selected) or config.args_source is not pytest.Config.ArgsSource.ARGS
        given = [self._from_root(one) if one.endswith(".toml") else one for one in config.getoption("dropspin_scene")]
        self.scenes: tuple[str, ...] = tuple(given or (config.getini("dropspin_scenes") if no_paths else ()))
        self._results: dict[str, Result] = {}

    def _from_root(self, path: str) -> str:
        """A path of the command line, as seen from the root directory, where dropspin is started."""
        return os.path.relpath(self.config.invocation_params.dir / path, self.root)

    @property
    def folder(self) -> Path:
        """Where runs are kept: in pytest's cache, or for this session only if there is none."""
        cache = getattr(self.config, "cache", None)
        folder = Path(tempfile.gettempdir(), f"{NAME}-{self.session}") if cache is None else cache.mkdir(NAME)
        folder.mkdir(exist_ok=True)
        return folder

    def make_plan(self) -> None:
        """Find out which metrics the scenes have; bad input ends the session in one line."""
        named = self.named or self.dts or self.config.getoption("dropspin_baseline")
        if self.scenes or named:
            # Steps fit some scenes and others not; without scenes nothing says which they are for.
            steps = self.dts if self.scenes else ()
            done = self._dropspin("run", *self.scenes, *_options(self.engines, steps, self.baseline), "--dry-run", "--json")
            if done.returncode:
                raise pytest.UsageError(_said(done))
            self.plan = json.loads(done.stdout) if self.scenes else {}
        for one in self.selected:
            if not any(_selects(one, nodeid) for nodeid in self.node_ids()):
                raise pytest.UsageError(f"not found: {one}; the scenes are those of --dropspin-scene, or of dropspin_scenes.")

    def node_ids(self) -> Iterator[str]:
        """Of all metrics of all scenes and engines that are asked for."""
        for one in self.plan.get("scenes", ()):
            for metric, engine in product(one["metrics"], self.plan["engines"]):
                yield f"{NAME}::{one['scene']}::{metric}[{engine['engine']}]"

    def run(self, scene: Scene, engines: Sequence[str] | None = None, dts: Sequence[float] | None = None) -> Result:
        """Run a scene, unless that has been done in this session."""
        __tracebackhide__ = True
        from filelock import FileLock

        engines, dts = self.engines if engines is None else engines, self.dts if dts is None else dts
        asked = [scene if isinstance(scene, Mapping) else os.fspath(scene), _options(engines, dts, self.baseline)]
        name = f"{_title(scene)}-{hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()[:8]}"
        if name not in self._results:
            # The system itself gives the lock back when a worker dies; a folder made as a lock would stay, and all others wait for ever.
            with FileLock(self.folder / f"{name}.lock"):
                self._results[name] = self._kept_or_new(name, scene, engines, dts)
        return self._results[name]

    def _kept_or_new(self, name: str, scene: Scene, engines: Sequence[str], dts: Sequence[float]) -> Result:
        __tracebackhide__ = True
        folder, kept = self.folder / name, self.folder / f"{name}.json"
        if isinstance(scene, Mapping):
            scene = _written(self.folder / f"{name}-scene", scene)
        given = os.path.relpath(scene, self.root) if os.path.isabs(scene) else os.fspath(scene)
        found = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {}
        if found.get("session") != self.session:
            asked = _options(engines, dts, self.baseline)
            done = self._dropspin("run", given, *asked, "-o", os.path.relpath(folder, self.root), "--json")
            found = {"session": self.session, "rows": json.loads(done.stdout or "[]"), "said": _said(done)}
            unfinished = kept.with_suffix(".unfinished")
            unfinished.write_text(json.dumps(found), encoding="utf-8")
            unfinished.replace(kept)
        if not found["rows"]:
            pytest.fail(found["said"], pytrace=False)
        names = json.loads((folder / "run.json").read_text(encoding="utf-8"))["provenance"]["names"]
        return Result(found["rows"][0]["scene"], found["rows"], folder, given, names, tuple(dts))

    def _dropspin(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """The installed command, in the root directory; pytest's `pythonpath` holds for the user's engines too."""
        paths = [*map(str, self.config.getini("pythonpath")), *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = os.environ | {"PYTHONIOENCODING": "utf-8", "PYTHONPATH": os.pathsep.join(paths)}
        command = [sys.executable, "-P", "-m", "dropspin", *arguments]
        return subprocess.run(
            command, cwd=self.root, env=environment, stdin=subprocess.DEVNULL, capture_output=True, encoding="utf-8", check=False
        )

    def judge(self, node: pytest.Item, result: Result, rows: Iterable[Row], *, pytrace: bool = False) -> None:
        """Fail or skip a test by the verdicts of some rows of a run, with the lines that called if asked; keep them for the summary."""
        __tracebackhide__ = True
        fails = FAILING | {"missing"} if self.named else FAILING
        judged = [row | {"fails": row["verdict"] in fails, "told": _told(row), "share": _share(row)} for row in rows]
        said = [row for row in judged if row["fails"] or row["verdict"] in STOPPED | {"passed"}]
        node.stash.setdefault(JUDGED, []).extend(said)
        failing = [row for row in judged if row["fails"]]
        if failing:
            pytest.fail(self._failure(result, failing), pytrace=pytrace)
        if not any(row["verdict"] == "passed" for row in judged):
            reasons = [f"{row['engine']} {row['verdict']}: {row['reason']}" for row in judged if row["verdict"] in STOPPED | {"limited"}]
            pytest.skip(reasons[0] if reasons else "nothing is expected of it at these steps")

    def _failure(self, result: Result, failing: Sequence[Row]) -> str:
        """What fails, with the commands that do it again and that accept it."""
        orders = {(row["engine"], row["metric"]): row["value"] for row in result.rows if row["kind"] == "order"}
        lines = []
        for row in failing[:AT_MOST]:
            order = orders.get((row["engine"], row["metric"]))
            observed = "" if order is None or row["kind"] == "order" else f" (observed order {order:.2f})"
            reason = [f"    {row['reason']}"] if row["metric"] and row["reason"] else []
            lines += [f"{result.scene}, {row['engine']}: {row['told']}{observed}", *reason]
        more = [f"and {len(failing) - AT_MOST} more"] if len(failing) > AT_MOST else []
        engines = dict.fromkeys(result.engines[row["engine"]] for row in failing)
        # What several steps show together takes all of them to show again.
        dts = sorted({row["dt"] for row in failing}, reverse=True) if all(row["dt"] is not None for row in failing) else result.dts
        paths = os.pathsep.join(os.path.relpath(path, self.root) for path in self.config.getini("pythonpath"))
        again = shlex.join(
            [*([f"PYTHONPATH={paths}"] if paths else []), NAME, "run", result.given, *_options(engines, dts, self.baseline), *APART]
        )
        accept = []
        if any(row["verdict"] == "failed" and row["metric"] for row in failing):
            known = ["--known-failures"] if any(row["kind"] != "baseline" for row in failing) else []
            folder = os.path.relpath(result.folder, self.root)
            command = shlex.join([NAME, "accept", folder, "--baseline", self.baseline or BASELINE, *known, "--reason", "…"])
            accept = [f"Accept: {command}" + ("" if self.baseline else f", and from then on --dropspin-baseline {BASELINE}")]
        return "\n".join([*lines, *more, f"Again: {again}", *accept])


def _options(engines: Iterable[str], dts: Iterable[float], baseline: str | None) -> list[str]:
    """As `dropspin run` has them."""
    named = [word for engine in engines for word in ("-e", engine)] + [word for dt in dts for word in ("--dt", repr(float(dt)))]
    return named + ([] if baseline is None else ["--baseline", baseline])


def _title(scene: Scene) -> str:
    """What a scene is called in file names and test ids."""
    name = str(scene.get("name", "scene")) if isinstance(scene, Mapping) else Path(scene).stem
    return re.sub(r"[^A-Za-z0-9-]+", "-", name)


def _said(done: subprocess.CompletedProcess[str]) -> str:
    """Why a command came to nothing: the line that dropspin ends bad input with, or all of an error of its own."""
    said = done.stderr.strip()
    return said.splitlines()[-1] if done.returncode in (2, 3) and said else said or f"dropspin ended with exit code {done.returncode}"


def _written(folder: Path, scene: Mapping[str, Any]) -> Path:
    """A scene that was given as a mapping, as a file."""
    import tomlkit

    folder.mkdir(exist_ok=True)
    path = folder / f"{_title(scene)}.toml"
    path.write_text(tomlkit.dumps({key: value for key, value in scene.items() if key != "name"}), encoding="utf-8")
    return path


def _selects(asked: str, nodeid: str) -> bool:
    """Whether a test is the one that is asked for, or of those."""
    stem = asked.rstrip(":")
    return nodeid == asked or nodeid.startswith((f"{stem}::", f"{stem}["))


def _bound(row: Row) -> float | None:
    """The bound that a value is nearest to, or beyond."""
    value, lower, upper = row["value"], row["lower"], row["upper"]
    if value is None or lower is None or upper is None:
        return upper if lower is None else lower
    return upper if value >= 0.5 * (lower + upper) else lower


def _share(row: Row) -> float:
    """How much of what is allowed a value takes: above 1 it fails; 0 where nothing is expected."""
    value, bound = row["value"], _bound(row)
    if value is None:
        return math.inf
    if not bound:
        return 0.0
    at_least = (bound == row["lower"]) == (bound > 0.0)  # or the same below 0: what is nearer to 0 is not allowed
    return bound / value if at_least and value else value / bound


def _told(row: Row) -> str:
    """A row in a line: what it is of, its value, its bound, and the ratio of the two."""
    if not row["metric"]:
        return f"{row['verdict']}: {row['reason']}"
    of = row["truth"] if row["kind"] == "baseline" else {"order": "order", "asymptotic_error": "limit"}.get(row["kind"], "")
    at = "" if row["dt"] is None else f" at {row['dt']:g} s"
    what = f"{of}{' of' if of not in ('', 'accepted') else ''} {row['metric']}{at}".strip()
    value, lower, upper, bound = row["value"], row["lower"], row["upper"], _bound(row)
    unit = "" if row["unit"] == "1" else f" {row['unit']}"
    if value is None or bound is None:
        return f"{what} is " + ("no number" if value is None else f"{value:.3g}{unit}")
    if lower is not None and upper == -lower:
        expected = f"± {upper:.3g}"
    else:
        expected = f"≤ {upper:.3g}" if lower is None else f"≥ {lower:.3g}" if upper is None else f"{lower:.3g} … {upper:.3g}"
    return f"{what} is {value:.3g}{unit}, expected {expected}" + (f": {value / bound:.3g} times its bound" if bound else "")


class Scenes(pytest.Collector):
    """The scenes that were asked for."""

    def collect(self) -> "list[Metrics]":
        """One collector a scene."""
        return [Metrics.from_parent(self, name=one["scene"], planned=one) for one in self.config.stash[RUNS].plan["scenes"]]


class Metrics(pytest.Collector):
    """The metrics of a scene."""

    def __init__(self, planned: Mapping[str, Any], **of_node: Any) -> None:
        super().__init__(**of_node)
        self.planned = planned

    def collect(self) -> "list[Metric]":
        """One test for each metric of each engine, of those that are asked for by node id, or of all."""
        runs = self.config.stash[RUNS]
        engines = [one["engine"] for one in runs.plan["engines"]]
        ids = [(metric, engine, f"{metric}[{engine}]") for metric, engine in product(self.planned["metrics"], engines)]
        # The id is given whole: in one that pytest 9.2 puts together the brackets are a part of the name, and --lf does not find it.
        items = [
            Metric.from_parent(self, name=name, nodeid=f"{self.nodeid}::{name}", metric=metric, engine=engine)
            for metric, engine, name in ids
        ]
        return [item for item in items if not runs.selected or any(_selects(one, item.nodeid) for one in runs.selected)]


class Metric(pytest.Item):
    """What one engine does to one metric of a scene, at all steps."""

    def __init__(self, metric: str, engine: str, **of_node: Any) -> None:
        super().__init__(**of_node)
        self.metric, self.engine = metric, engine
        self.add_marker(NAME)

    def runtest(self) -> None:
        """Judge the rows of the metric, and what became of the engine as a whole."""
        assert isinstance(self.parent, Metrics)
        runs = self.config.stash[RUNS]
        result = runs.run(self.parent.planned["from"])
        rows = [row for row in result.rows if row["engine"] == self.engine and row["metric"] in (self.metric, "")]
        runs.judge(self, result, rows)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Where it is told to be: in no file."""
        return self.path, 0, self.nodeid


RUNS = pytest.StashKey[Runs]()
JUDGED = pytest.StashKey[list[Row]]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options, and the keys of the configuration file."""
    group = parser.getgroup(NAME, "rigid-body engines held against the exact answer")
    several: dict[str, Any] = {"action": "append", "default": []}
    group.addoption("--dropspin-engine", metavar="ENGINE", **several, help="Engine under test, such as my_module:MyEngine; repeatable.")
    group.addoption("--dropspin-scene", metavar="SCENE", **several, help="Collect a scene: a name, a TOML file, core; repeatable.")
    group.addoption("--dropspin-dt", metavar="SECONDS", type=float, **several, help="A time step; repeatable.")
    group.addoption("--dropspin-baseline", metavar="FILE", help="Accepted figures, as dropspin accept wrote them.")
    parser.addini("dropspin_engines", "Engines under test.", type="linelist")
    parser.addini("dropspin_scenes", "Scenes whose metrics are collected where pytest is given no paths.", type="linelist")
    parser.addini("dropspin_baseline", "Accepted figures, a path from the root directory.")


def pytest_configure(config: pytest.Config) -> None:
    """Take node ids that belong to no file out of the arguments, before pytest looks for the files."""
    config.addinivalue_line("markers", MARKER)
    config.stash[RUNS] = Runs(config)


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Tell a worker of pytest-xdist the session that it is of, and what is planned."""
    runs = node.config.stash[RUNS]
    node.workerinput[NAME] = {"session": runs.session, "plan": runs.plan}


def pytest_sessionstart(session: pytest.Session) -> None:
    """Check what is asked for; workers have been told."""
    if not hasattr(session.config, "workerinput"):
        session.config.stash[RUNS].make_plan()


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Put the scenes behind what is collected from files."""
    report = yield
    if isinstance(collector, pytest.Session) and collector.config.stash[RUNS].plan and report.outcome == "passed":
        report.result = [*report.result, Scenes.from_parent(collector, name=NAME, nodeid=NAME)]
    return report


def _dropspin(*scenes: Scene, engine: str | Sequence[str] | None = None, dt: float | Sequence[float] | None = None) -> tuple[Any, ...]:
    """The arguments of the marker."""
    return scenes, engine, dt


def _several(given: Any) -> Any:
    return [given] if isinstance(given, str | float | int) else given


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Call a marked test for each scene and engine."""
    if "dropspin_result" not in metafunc.fixturenames:
        if any(mark.name == NAME and mark.args for mark in metafunc.definition.own_markers):
            pytest.fail(f"{metafunc.function.__name__} is marked with scenes, but does not take dropspin_result", pytrace=False)
        return
    ids, cases = [], []
    for mark in metafunc.definition.iter_markers(NAME):
        scenes, engine, dt = _dropspin(*mark.args, **mark.kwargs)
        for scene, one in product(scenes, _several(engine) or metafunc.config.stash[RUNS].engines or [None]):
            ids.append("-".join(filter(None, [_title(scene), one])))
            cases.append((scene, _several(one), _several(dt)))
    if cases:
        metafunc.parametrize("dropspin_result", cases, ids=ids, indirect=True)


@pytest.fixture(scope="session")
def dropspin_run(pytestconfig: pytest.Config) -> Callable[..., Result]:
    """Call it with a scene, and engine=…, dt=… if they are not those of the session: the run, with .rows, .value(metric) and .folder."""

    def run(scene: Scene, engine: str | Sequence[str] | None = None, dt: float | Sequence[float] | None = None) -> Result:
        __tracebackhide__ = True
        return pytestconfig.stash[RUNS].run(scene, _several(engine), _several(dt))

    return run


@pytest.fixture
def dropspin_check(request: pytest.FixtureRequest, dropspin_run: Callable[..., Result]) -> Callable[..., Result]:
    """Call it like dropspin_run, or with a run: nothing of it may fail."""

    def check(scene: Scene | Result, engine: str | Sequence[str] | None = None, dt: float | Sequence[float] | None = None) -> Result:
        __tracebackhide__ = True
        result = scene if isinstance(scene, Result) else dropspin_run(scene, engine, dt)
        request.config.stash[RUNS].judge(request.node, result, result.rows, pytrace=True)
        return result

    return check


@pytest.fixture
def dropspin_result(request: pytest.FixtureRequest, dropspin_run: Callable[..., Result]) -> Result:
    """The run of the scene and engine that a test marked dropspin is called for."""
    if not hasattr(request, "param"):
        pytest.fail("dropspin_result is for tests with a scene, such as @pytest.mark.dropspin('drop-ball')", pytrace=False)
    result = dropspin_run(*request.param)
    stopped = [row for row in result.rows if row["verdict"] in STOPPED]
    if stopped:
        request.config.stash[RUNS].judge(request.node, result, stopped)
    return result


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Have the report carry what was judged, from a worker of pytest-xdist too."""
    report = yield
    if rows := item.stash.get(JUDGED, []):
        vars(report)[NAME] = rows[:]
        rows.clear()
    return report


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """A line for each engine and scene that was judged, and where the runs are."""
    judged: dict[tuple[str, str], dict[tuple[Any, ...], Row]] = {}
    for report in (report for reports in terminalreporter.stats.values() for report in reports):
        for row in getattr(report, NAME, ()):
            # Several tests may judge a row, such as that of a crash.
            key = tuple(row[name] for name in ("metric", "kind", "truth", "dt", "verdict"))
            judged.setdefault((row["engine"], row["scene"]), {})[key] = row
    if not judged:
        return
    lines = [("engine", "scene", "passed", "failed", "worst")]
    for (engine, scene), found in judged.items():
        rows = found.values()
        worst = max(rows, key=lambda row: (row["fails"], row["share"]))
        passed, failed = (sum(row[key] == value for row in rows) for key, value in (("verdict", "passed"), ("fails", True)))
        lines.append((engine, scene, str(passed), str(failed), worst["told"]))
    widths = [max(len(line[column]) for line in lines) for column in range(4)]
    terminalreporter.section(NAME)
    for engine, scene, passed, failed, told in lines:
        ends = f"{passed:>{widths[2]}}  {failed:>{widths[3]}}  {told}"
        terminalreporter.write_line(f"{engine:<{widths[0]}}  {scene:<{widths[1]}}  {ends}")
    runs = config.stash[RUNS]
    if runs.baseline and not any(row["kind"] == "baseline" for found in judged.values() for row in found.values()):
        terminalreporter.write_line(f"No figure of these runs has been accepted in {runs.baseline}: nothing was held against it.")
    terminalreporter.write_line(f"Reports and figures: {os.path.relpath(runs.folder, runs.root)}/*")
