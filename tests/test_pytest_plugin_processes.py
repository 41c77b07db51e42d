"""The pytest plugin in processes of its own: workers of pytest-xdist, packages of the same names, a plugin that is not used."""

import os
import subprocess
import sys
from itertools import product

import pytest
from support.cli import DROPSPIN
from support.repositories import ENGINES, SCENE_TEST, fill, options

pytest_plugins = ["pytester"]

FAST_START = ("-p", "no:hypothesispytest")
"""Options of sessions in processes of their own: importing Hypothesis takes longer than the rest of pytest."""


@pytest.fixture
def repository(pytester):
    """A user's repository with engines and a scene."""
    return fill(pytester)


SLOW_COMMAND = """
import json, subprocess, time
from dropspin import pytest_plugin

def command(runs, *arguments):
    print(*arguments, file=open("commands.log", "a"))
    time.sleep(0.5)
    folder = runs.root / arguments[arguments.index("-o") + 1]
    folder.mkdir()
    (folder / "run.json").write_text(json.dumps({"provenance": {"names": {"faulty": "engines:Faulty"}}}))
    row = {"scene": "spin-principal", "engine": "faulty", "metric": "energy_error", "kind": "truth", "truth": "exact", "dt": 0.004}
    row |= {"value": 0.002, "lower": None, "upper": 1e-6, "unit": "1", "verdict": "failed", "reason": "nothing changes"}
    return subprocess.CompletedProcess([], 1, json.dumps([row, row | {"metric": "energy_drift", "verdict": "passed"}]), "")

pytest_plugin.Runs.dropspin = command
"""


@pytest.mark.extended
def test_workers_share_a_run(repository):
    """Two workers of pytest-xdist need a run at the same time: one makes it and the other waits; the summary has the rows of both."""
    second = SCENE_TEST.replace("test_scene", "test_again").replace("import pytest", "")
    repository.makepyfile(conftest=SLOW_COMMAND, test_own=SCENE_TEST + second)
    done = repository.runpytest_subprocess(*FAST_START, "-v", "-n", "2", *options("Faulty"))
    done.assert_outcomes(failed=2)
    done.stdout.fnmatch_lines_random(["[[]gw0[]] *FAILED*", "[[]gw1[]] *FAILED*"])
    assert len((repository.path / "commands.log").read_text().splitlines()) == 1
    done.stdout.fnmatch_lines(["faulty * spin-principal * 1 * 1 * 0  energy_error at 0.004 s is 0.002, expected ≤ 1e-06"])


OURS = ("scenarios", "reports", "comparisons", "reference_impl")
OF_THE_USER = """
import sys
{own}

def test_whose(dropspin_check):
    dropspin_check("spin-principal", engine="engines:Mine", dt=0.004)
    assert WHOSE == "the user's"
    assert not {{"numpy", "pandas", "click"}} & set(sys.modules)
"""


def run(*command, cwd, **environment):
    inherited = {key: value for key, value in os.environ.items() if key != "PYTHONPATH" and not key.startswith("PYTEST_")}
    done = subprocess.run(
        command, cwd=cwd, env=inherited | environment, capture_output=True, text=True, timeout=300, check=False, stdin=subprocess.DEVNULL
    )
    assert done.returncode == 0, done.stdout + done.stderr


WAYS = {"pytest": [DROPSPIN.with_name("pytest")], "python -m pytest": [sys.executable, "-m", "pytest"], "dropspin": [DROPSPIN]}
QUICK = {("pytest", ""), ("python -m pytest", "."), ("dropspin", ".")}


@pytest.mark.extended
@pytest.mark.parametrize(
    ("command", "path"),
    [pytest.param(*way, marks=[] if way in QUICK else pytest.mark.slow) for way in product(WAYS, ["", "."])],
)
def test_packages_of_the_same_names_are_not_mixed_up(command, path, tmp_path):
    """The user's tests never import dropspin's packages, nor dropspin the user's, whichever way they are started."""
    imported = command == "pytest"  # elsewhere an import of the user's packages raises an error
    for name in OURS:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text('WHOSE = "the user\'s"' if imported else "raise ImportError('the user's')")
    (tmp_path / "engines.py").write_text(ENGINES)
    (tmp_path / "conftest.py").write_text("import scenarios, reports\n" if imported else "")
    (tmp_path / "test_own.py").write_text(OF_THE_USER.format(own="from reports import WHOSE" if imported else 'WHOSE = "the user\'s"'))
    arguments = ["run", "spin-principal", "-e", "engines:Mine", "--dt", "0.004"] if command == "dropspin" else [*FAST_START, "-W", "error"]
    run(*WAYS[command], *arguments, cwd=tmp_path, **({"PYTHONPATH": path} if path else {}))


def test_unused_plugin_imports_and_writes_nothing(repository):
    """The same if it is switched off, and in workers of pytest-xdist."""
    repository.makepyfile(
        test_own="""
        import sys

        def test_own():
            assert not {"numpy", "pandas", "click", "filelock", "tomlkit", "dropspin.scenarios", "dropspin.reports"} & set(sys.modules)
        """
    )
    for arguments in ([], ["-p", "no:dropspin"], ["-p", "no:cacheprovider", "-n", "1"]):
        done = repository.runpytest_subprocess(*FAST_START, "-W", "error", *arguments)
        done.assert_outcomes(passed=1)
        assert "dropspin" not in done.stdout.str().replace("plugins: ", "").partition("collected")[2]
    assert not list(repository.path.glob(".pytest_cache/d/dropspin"))
    assert not (repository.path / "imports.log").exists()
