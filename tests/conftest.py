"""Settings and fixtures that all tests share."""

import gc
import importlib.util
import os
import shutil
from collections.abc import Callable, Iterator
from functools import partial
from itertools import compress
from pathlib import Path

import pytest
from hypothesis import settings

# Numerical properties are cheap but not uniform in time; a deadline would test the machine.
settings.register_profile("default", deadline=None, max_examples=40, derandomize=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "default"))

gc.set_threshold(50_000, 20, 20)  # a full collection visits a million objects of numba and pandas
WITH_PYBULLET = {"core_run", "repository", "engine_coverage"}
"""Fixtures, and a module of tests/support, that use PyBullet."""


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark the cases beyond the samples, and leave out the tests of PyBullet, or Node.js, where it is not installed.

    PyBullet has wheels for Python 3.11 alone.
    """
    for cases in sampled(items):
        for case in cases:
            case.add_marker("extended")
    lacks_pybullet, lacks_node = importlib.util.find_spec("pybullet") is None, shutil.which("node") is None
    if lacks_pybullet or lacks_node:
        left_out = [(lacks_pybullet and uses_pybullet(item)) or (lacks_node and uses_node(item)) for item in items]
        config.hook.pytest_deselected(items=list(compress(items, left_out)))
        items[:] = [item for item, is_left_out in zip(items, left_out, strict=True) if not is_left_out]


def sampled(items: list[pytest.Item]) -> Iterator[list[pytest.Item]]:
    """The cases of each test with the marker `sample(n)` but n of them, which are spread evenly and include the first; slow ones apart."""
    tests: dict[str, list[pytest.Item]] = {}
    for item in items:
        if item.get_closest_marker("sample") and not item.get_closest_marker("slow"):
            tests.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for cases in tests.values():
        marker = cases[0].get_closest_marker("sample")
        assert marker
        kept = {number * len(cases) // marker.args[0] for number in range(marker.args[0])}
        yield [case for number, case in enumerate(cases) if number not in kept]


def uses_pybullet(item: pytest.Item) -> bool:
    """Whether a test's module names PyBullet, or the test uses one of `WITH_PYBULLET`."""
    assert isinstance(item, pytest.Function)
    names = {*item.fixturenames, *item.function.__code__.co_names}
    return bool(WITH_PYBULLET & names) or "pybullet" in item.path.read_text(encoding="utf-8").lower()


def uses_node(item: pytest.Item) -> bool:
    """Whether a test's module starts Node.js."""
    return "tiny_engine" in item.path.read_text(encoding="utf-8")


@pytest.fixture(scope="session", autouse=True)
def _timed_briefly():
    """Time a few steps of an engine once, not a whole scene three times: no test asserts on a clock. Processes, forked, inherit it."""
    from support.brief_runs import time_briefly

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dropspin.comparisons.running.timing.TIMING_REPEATS", 1)
        patch.setattr("dropspin.comparisons.running.timing.time_engine", time_briefly)
        patch.setattr("dropspin.comparisons.tradeoff.costs.BATCH_SECONDS", 1e-4)
        patch.setattr("dropspin.comparisons.tradeoff.costs.LONG_ENOUGH", 2e-4)
        yield


@pytest.fixture(scope="session", autouse=True)
def _few_start_phases():
    """Four start phases instead of 32: a test of what the mean over all of them is uses `all_start_phases`."""
    from support.brief_runs import FEW

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("dropspin.comparisons.running.start_phases.START_PHASES", FEW)
        yield


@pytest.fixture
def all_start_phases():
    """As many start phases as outside tests."""
    from support.brief_runs import all_starts

    with all_starts():
        yield


@pytest.fixture(autouse=True)
def _all_start_phases_in_slow_tests(request):
    """Slow tests are studies as users make them."""
    if request.node.get_closest_marker("slow"):
        request.getfixturevalue("all_start_phases")


@pytest.fixture(scope="session", autouse=True)
def _shared_functions(shared):
    """Compile what all kernels of Wang's method share, 5 s without numba's cache: engine processes, which are forked, have it then."""
    from dropspin.comparisons.running.driving import simulate

    def compiled(folder: Path | None = None) -> None:
        simulate("drop-box-corner", "wang", 1e-2)

    shared("kernels", compiled)  # by one of the workers of pytest-xdist, for numba's cache
    compiled()


@pytest.fixture(scope="session", autouse=True)
def _engines_in_process():
    """Engines work in the process of the tests, but for tests that use `engine_processes`."""
    from support.in_process import engines_in_process

    with engines_in_process():
        yield


@pytest.fixture
def engine_processes():
    """Each engine works in a process of its own, as it does outside tests."""
    from support.in_process import engines_in_processes

    with engines_in_processes():
        yield


@pytest.fixture
def few_start_phases(monkeypatch):
    """Two start phases instead of four, for engines made for tests: they solve each start anew, and are as exact from each."""
    monkeypatch.setattr("dropspin.comparisons.running.start_phases.START_PHASES", 2)


@pytest.fixture
def two_rounds(monkeypatch):
    """Two rounds of a trade-off's timings instead of nine, for tests that assert on no cost."""
    monkeypatch.setattr("dropspin.comparisons.tradeoff.study.ROUNDS", 2)


@pytest.fixture(scope="session")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, Callable[[Path], None]], Path]:
    """Call it with a name and a function that fills a folder: the folder is filled once a session, for all workers of pytest-xdist."""
    from filelock import FileLock

    base = tmp_path_factory.getbasetemp()
    root = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "shared"
    root.mkdir(exist_ok=True)

    def folder(name: str, make: Callable[[Path], None]) -> Path:
        path, done = root / name, root / f"{name}.done"
        with FileLock(root / f"{name}.lock"):
            if not done.exists():
                path.mkdir(exist_ok=True)
                make(path)
                done.touch()
        return path

    return folder


@pytest.fixture(scope="session")
def core_run(shared) -> Path:
    """The folder of a run of the core catalogue with the three engines at the default time steps, data only; `load_results` reads it.

    Two workers of pytest-xdist begin with different scenes, and each takes those that the other has not begun.
    """
    from support.brief_runs import few_starts, whole_timings
    from support.engines import CORE
    from support.scenes import with_few_members

    from dropspin.comparisons.results.store import load_results, save
    from dropspin.comparisons.running.run import run

    engines = ["wang", "mujoco", "pybullet"]

    def make_scene(name: str, folder: Path) -> None:
        with few_starts(), whole_timings():
            save(run(with_few_members(name), engines), folder, compress=False)

    def make(folder: Path) -> None:
        parts = [load_results(shared(f"core-{name}", partial(make_scene, name))) for name in CORE]
        save(run(map(with_few_members, CORE), engines, done=parts), folder, compress=False)

    last_first = os.environ.get("PYTEST_XDIST_WORKER", "gw0").endswith(("1", "3", "5", "7"))
    for name in reversed(CORE) if last_first else CORE:
        shared(f"core-{name}", partial(make_scene, name))
    return shared("core-run", make)
