"""The pytest plugin: comparisons of engines with exact solutions, as tests. docs/pytest.md documents its use."""

import json
import os
import shlex
from collections.abc import Callable, Generator, Iterable, Sequence
from itertools import product
from operator import itemgetter
from pathlib import Path
from typing import Any

import pytest

from dropspin.pytest_runs import FAILING, JUDGED, NAME, STOPPED, Result, Row, Runs, Scene, error_of, title_of

MARKER = "dropspin(*scenes, engine=None, dt=None): call the test once for each scene and engine, with the run as dropspin_result."
QUESTIONS = ("inertia", "fall", "spin", "tumble", "impact", "rest", "slide", "roll", "friction", "file")
"""The first words of rows of `dropspin diagnose`."""

RUNS = pytest.StashKey[Runs]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options, and the keys of the configuration file."""
    group = parser.getgroup(NAME, "rigid-body engines compared with exact solutions")
    several: dict[str, Any] = {"action": "append", "default": []}
    group.addoption("--dropspin-engine", metavar="ENGINE", **several, help="Engine under test, such as my_module:MyEngine; repeatable.")
    group.addoption("--dropspin-dt", metavar="SECONDS", type=float, **several, help="Time step; repeatable.")
    group.addoption("--dropspin-baseline", metavar="FILE", help="Baseline of accepted results, as dropspin accept wrote it.")
    parser.addini("dropspin_engines", "Engines under test.", type="linelist")
    parser.addini("dropspin_baseline", "Baseline of accepted results, a path relative to the root directory.")


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker, and check the options; invalid ones end the session with one line."""
    config.addinivalue_line("markers", MARKER)
    config.stash[RUNS] = Runs(config)


@pytest.hookimpl(optionalhook=True)
def pytest_configure_node(node: Any) -> None:
    """Send the session's id to a worker of pytest-xdist, so that all workers share their runs."""
    node.workerinput[NAME] = node.config.stash[RUNS].session


def _arguments(*scenes: Scene, engine: str | Sequence[str] | None = None, dt: float | Sequence[float] | None = None) -> tuple[Any, ...]:
    """The arguments of the marker; Python refuses other arguments."""
    return scenes, engine, dt


def _several(value: Any) -> Any:
    """The engines or time steps that were asked for, as a list; None if they are those of the session."""
    asked = [value] if isinstance(value, str | float | int) else None if value is None else list(value)
    if asked == []:
        pytest.fail("got an empty list of engines or time steps; give one, or leave it out for those of the session", pytrace=False)
    return asked


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Call a marked test once for each scene and engine."""
    if "dropspin_result" not in metafunc.fixturenames:
        if any(mark.name == NAME and (mark.args or mark.kwargs) for mark in metafunc.definition.own_markers):
            pytest.fail(f"{metafunc.function.__name__} is marked with dropspin, but does not take dropspin_result", pytrace=False)
        return
    ids, cases = [], []
    for mark in metafunc.definition.iter_markers(NAME):
        scenes, engine, dt = _arguments(*mark.args, **mark.kwargs)
        dts = _several(dt)
        if not scenes and mark.kwargs:
            pytest.fail(f"{metafunc.function.__name__} is marked with an engine or a time step, but without scenes", pytrace=False)
        for scene, name in product(scenes, _several(engine) or metafunc.config.stash[RUNS].engines or [None]):
            ids.append("-".join(filter(None, [title_of(scene), name])))
            cases.append((scene, _several(name), dts))
    if cases:
        metafunc.parametrize("dropspin_result", cases, ids=ids, indirect=True)


@pytest.fixture(scope="session")
def dropspin_run(pytestconfig: pytest.Config) -> Callable[..., Result]:
    """Call with a scene, and with engine= and dt= if they differ from the session's; returns the run: .rows, .value(metric), .folder."""

    def run(scene: Scene, engine: str | Sequence[str] | None = None, dt: float | Sequence[float] | None = None) -> Result:
        __tracebackhide__ = True
        return pytestconfig.stash[RUNS].run(scene, _several(engine), _several(dt))

    return run


@pytest.fixture
def dropspin_check(request: pytest.FixtureRequest, dropspin_run: Callable[..., Result]) -> Callable[..., Result]:
    """Call like dropspin_run, or with a run; fails the test if a row of the run fails."""

    def check(scene: Scene | Result, engine: str | Sequence[str] | None = None, dt: float | Sequence[float] | None = None) -> Result:
        __tracebackhide__ = True
        result = scene if isinstance(scene, Result) else dropspin_run(scene, engine, dt)
        request.config.stash[RUNS].judge(request.node, result, result.rows, pytrace=True)
        return result

    return check


@pytest.fixture
def dropspin_model(pytestconfig: pytest.Config, tmp_path: Path) -> Callable[..., list[Row]]:
    """Call with a model file and options of dropspin diagnose; fails the test if the model has findings on questions not in `allowed`."""

    def diagnose(file: str | os.PathLike[str], *options: str, allowed: Iterable[str] = ()) -> list[Row]:
        __tracebackhide__ = True
        names = {allowed} if isinstance(allowed, str) else set(allowed)
        if unknown := names.difference(QUESTIONS):
            pytest.fail(f"allowed: got {', '.join(sorted(unknown))}; rows begin with {', '.join(QUESTIONS)}", pytrace=False)
        runs, command = pytestconfig.stash[RUNS], [os.fspath(file), *options]
        done = runs.dropspin("diagnose", "-o", str(tmp_path / "diagnosis"), "--json", *command)
        if not done.stdout:
            pytest.fail(error_of(done), pytrace=False)
        rows: list[Row] = json.loads(done.stdout)
        lines = [f"{row['body']}: {row['detail']}" for row in rows if done.returncode == 3 and row["question"] == "simulation"]
        findings = [row for row in rows if row["finding"] and row["question"] not in names]
        lines += [f"{row['body']}, {row['finding']}: {row['question']}, {row['quantity']}: {row['settings']}" for row in findings]
        if lines:
            pytest.fail("\n".join([*lines, f"Reproduce: {shlex.join([NAME, 'diagnose', *command])}"]), pytrace=False)
        return rows

    return diagnose


@pytest.fixture
def dropspin_result(request: pytest.FixtureRequest, dropspin_run: Callable[..., Result]) -> Result:
    """The run of the scene and engine for which a test marked with dropspin is called."""
    if not hasattr(request, "param"):
        pytest.fail("dropspin_result needs a marker with a scene, such as @pytest.mark.dropspin('drop-ball')", pytrace=False)
    result = dropspin_run(*request.param)
    if any(row["verdict"] in STOPPED for row in result.rows):
        # The test is not called, so that what else fails in the run, such as accepted results that are gone, has to fail here.
        request.config.stash[RUNS].judge(request.node, result, [row for row in result.rows if row["verdict"] in STOPPED | FAILING])
    return result


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Attach the judged rows to the report, which also transfers them from workers of pytest-xdist."""
    report = yield
    if rows := item.stash.get(JUDGED, []):
        vars(report)[NAME] = rows[:]
        rows.clear()
    return report


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Print a line for each judged engine and scene, and the folder of the runs."""
    judged: dict[tuple[str, ...], dict[tuple[Any, ...], Row]] = {}
    for report in (report for reports in terminalreporter.stats.values() for report in reports):
        for row in getattr(report, NAME, ()):
            # Several tests may judge the same row, such as that of a crash.
            key = tuple(row[name] for name in ("metric", "kind", "truth", "dt", "verdict"))
            judged.setdefault((row["engine"], row["scene"], *row["asked"]), {})[key] = row
    if not judged:
        return
    lines = [("engine", "scene", "passed", "failed", "known", "message")]
    for (engine, scene, *_), by_key in judged.items():
        rows = by_key.values()
        tally = (sum(row[key] == value for row in rows) for key, value in (("verdict", "passed"), ("fails", True), ("verdict", "known")))
        lines.append((engine, scene, *map(str, tally), max(rows, key=itemgetter("fails"))["message"]))
    layout = [f"{side}{max(map(len, column))}" for side, column in zip("<<>>>", zip(*lines, strict=True), strict=False)]
    terminalreporter.section(NAME)
    for *cells, message in lines:
        terminalreporter.write_line("  ".join([*map(format, cells, layout), message]))
    runs = config.stash[RUNS]
    every = [row for by_key in judged.values() for row in by_key.values()]
    if runs.baseline and not any(row["kind"] == "baseline" or row["verdict"] in STOPPED for row in every):
        terminalreporter.write_line(f"{runs.baseline} has no accepted results of these runs; no results were compared with it.")
    terminalreporter.write_line(f"Reports: {os.path.relpath(runs.folder, runs.root)}/*")
