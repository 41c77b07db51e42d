"""The option --engine: the engine whose adapter is tested, in an environment that has it."""

import pytest

from dropspin.comparisons.results.provenance import versions


def pytest_addoption(parser):
    parser.addoption("--engine", required=True, help="the engine's name, as in `dropspin list engines`")


def pytest_ignore_collect(collection_path, config):
    """The file test_ENGINE.py is for the environment of this engine alone."""
    from support.heavy_engines import CASES

    name = collection_path.stem.removeprefix("test_")
    return True if name in CASES and name != config.getoption("engine") else None


def pytest_report_header():
    """The versions that are tested."""
    return ", ".join(f"{package} {version}" for package, version in versions().items() if version)


def pytest_generate_tests(metafunc):
    """Each label of the engine is a case, and each command of docs/engines.md that runs it is a finding."""
    if "case" in metafunc.fixturenames:
        from support.heavy_engines import CASES

        cases = CASES[metafunc.config.getoption("engine")]
        metafunc.parametrize("case", cases, ids=[case.label for case in cases])
    if "finding" in metafunc.fixturenames:
        from support.findings import findings, heavy_engine

        commands = [command for command in findings() if heavy_engine(command) == metafunc.config.getoption("engine")]
        metafunc.parametrize("finding", commands)


@pytest.fixture(autouse=True)
def _isolated(engine_processes, all_start_phases):
    """Engines of this folder load libraries of hundreds of MB, which disturb one another."""
