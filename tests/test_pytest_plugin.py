"""The pytest plugin in repositories of users', which have packages named like dropspin's."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from itertools import product
from pathlib import Path

import pytest

import scenarios

pytest_plugins = ["pytester"]

DROPSPIN = Path(sys.executable).with_name("dropspin")
DOCS = Path(__file__).parents[1] / "docs"
ENGINES = """
import os
import numpy as np
from comparisons.engines.base import Engine, Simulation
from scenarios import truth_for

print("imported", file=open("imports.log", "a"))

class Exact(Simulation):
    def __init__(self, scene, dt, fault):
        self.truth, self.start, self.dt, self.step, self.fault = truth_for(scene), scene.initial_state, dt, 0, fault
        self.settings = {"version": "1"}

    def advance(self, steps):
        self.step += steps

    def state(self):
        state = self.truth(np.array([self.step * self.dt])).states[0] if self.step else self.start.copy()
        state[10:] *= 1.0 + self.fault * (self.step > 0)
        return state

class Mine(Engine):
    name = "mine"
    order = float("inf")

    def prepare(self, scene, dt):
        return Exact(scene, dt, float(os.environ.get("FAULT", "0")))

class Faulty(Engine):
    name = "faulty"

    def prepare(self, scene, dt):
        return Exact(scene, dt, 1e-3)

class Dying(Mine):
    name = "dying"

    def prepare(self, scene, dt):
        os.abort()

class Shy(Mine):
    name = "shy"

    def declines(self, scene):
        return "I do not spin"
"""
NEEDLE = """
duration = 1.0
[body]
shape = "box"
half_extents = [0.01, 0.5, 0.01]
mass = 1.0
[start]
angular_velocity = [0.0, 3.0, 0.0]
[[expect]]
metric = "energy_error"
below = 1e-9
reason = "nothing acts on it"
"""
SCENE = ("--dropspin-scene", "spin-principal", "--dropspin-dt", "0.004")


def asked(*engines):
    return [word for engine in engines for word in ("--dropspin-engine", f"engines:{engine}")]


@pytest.fixture
def repository(pytester):
    """With an engine module and a scene; a run of ours has options that are not the user's."""
    pytester.makepyfile(engines=ENGINES, test_own="def test_own(): pass")
    (pytester.path / "needle.toml").write_text(NEEDLE)
    return pytester


def test_scenes_as_tests(repository):
    """Each metric of each engine is a test: what passes, fails, breaks down, declines, is missing, and what is said of it."""
    repository.makepyfile(absent="import no_such_engine")
    engines = [*asked("Mine", "Faulty", "Dying", "Shy"), "--dropspin-engine", "absent:Engine"]
    done = repository.runpytest_subprocess("-rs", "-v", *SCENE, *engines, "-k", "energy_error or own")
    done.stdout.fnmatch_lines(
        [
            "test_own.py::test_own PASSED*",
            "dropspin::spin-principal::energy_error[[]mine] PASSED*",
            "dropspin::spin-principal::energy_error[[]faulty] FAILED*",
            "dropspin::spin-principal::energy_error[[]dying] FAILED*",
            "dropspin::spin-principal::energy_error[[]shy] SKIPPED*",
            "dropspin::spin-principal::energy_error[[]absent:Engine] FAILED*",
            "spin-principal, faulty: energy_error at 0.004 s is 0.002, expected ± 1e-06: 2e+03 times its bound",
            "    nothing changes; measured 1.2e-13, single precision would give 1e-7",
            "Again: dropspin run spin-principal -e engines:Faulty --dt 0.004 -o out/again",
            "Accept: dropspin accept .pytest_cache/d/dropspin/spin-principal-* --baseline dropspin-baseline.toml --known-failures *",
            "spin-principal, dying: crashed: its process was ended by SIGABRT",
            "spin-principal, absent:Engine: missing: *no_such_engine, which is not installed.",
            "engine * scene * passed  failed  worst",
            "mine * spin-principal * 1 * 0  energy_error at 0.004 s is 0, *",
            "faulty * spin-principal * 0 * 1  energy_error at 0.004 s is 0.002, *",
            "dying * spin-principal * 0 * 1  crashed: *",
            "shy * spin-principal * 0 * 0  declined: I do not spin",
            "SKIPPED * shy declined: I do not spin",
        ],
        consecutive=False,
    )
    assert "Traceback" not in done.stdout.str()
    [folder] = repository.path.glob(".pytest_cache/d/dropspin/spin-principal-*/")
    assert (folder / "report.html").is_file()
    accept = re.search(r"Accept: dropspin (accept .*), and from then on", done.stdout.str())
    subprocess.run([DROPSPIN, *shlex.split(accept[1])], cwd=repository.path, check=True)
    assert "faulty" in (repository.path / "dropspin-baseline.toml").read_text(encoding="utf-8")


def test_selected_without_a_run(repository):
    """By node id, by the configuration file, by -k and -m; which engines are asked for is all that dropspin is started for."""
    repository.makeini("[pytest]\ndropspin_engines = engines:Mine\n    engines:Shy\ndropspin_scenes = spin-principal\n    needle.toml")
    engine = "[mine]"

    def collected(*arguments):
        lines = repository.runpytest_subprocess("--collect-only", "-q", *arguments).outlines
        return [line for line in lines if "::" in line]

    everything = collected()
    assert everything[0] == "test_own.py::test_own"
    assert f"dropspin::needle::energy_error{engine}" in everything
    assert {line.split("::")[1] for line in everything[1:]} == {"spin-principal", "needle"}
    assert collected("test_own.py") == everything[:1]
    one = f"dropspin::needle::energy_error{engine}"
    assert collected("test_own.py", one, "dropspin::spin-principal::energy_drift", "-m", "dropspin", "-k", "not shy") == [
        "dropspin::spin-principal::energy_drift[mine]",
        one,
    ]
    assert not list(repository.path.glob(".pytest_cache/d/dropspin/*"))


def test_the_documentation(repository):
    """The page's tests in a repository as it has them."""
    page = (DOCS / "pytest.md").read_text(encoding="utf-8")
    adapter = (DOCS / "bring-your-engine.md").read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    configuration = page.split("```toml\n")[1].split("```")[0]
    (repository.path / "pyproject.toml").write_text(configuration)
    repository.makepyfile(my_module=adapter, test_page=page.split("```python\n")[1].split("```")[0])
    done = repository.runpytest_subprocess("-v", "test_page.py")
    done.stdout.fnmatch_lines(
        [
            "test_page.py::test_nothing_fails PASSED*",
            "test_page.py::test_figure PASSED*",
            "test_page.py::test_each[[]spin-principal-my_module:Flyer] PASSED*",
            "test_page.py::test_each[[]needle-my_module:Flyer] PASSED*",
            "test_page.py::test_mapping PASSED*",
        ]
    )


def test_a_test_that_fails(repository):
    """It says what failed where the test called; and what it asked for that there is not."""
    repository.makepyfile(
        test_own="""
        import pytest

        def test_check(dropspin_check):
            dropspin_check("spin-principal")

        def test_absent(dropspin_run):
            dropspin_run("spin-principal").value("penetration")

        def test_typo(dropspin_run):
            dropspin_run("spin-prinzipal")

        def test_without_a_scene(dropspin_result):
            pass
        """
    )
    done = repository.runpytest_subprocess("-p", "no:cacheprovider", "--dropspin-dt", "0.004", *asked("Faulty"))
    done.stdout.fnmatch_lines(
        [
            "dropspin_result is for tests with a scene, such as @pytest.mark.dropspin('drop-ball')",
            '>*dropspin_check("spin-principal")',
            "E * spin-principal, faulty: energy_error at 0.004 s is 0.002, *",
            "E * LookupError: penetration of spin-principal at any step was not measured; measured is energy_error, *",
            "dropspin: *spin-prinzipal* Did you mean 'spin-principal'?*",
            "faulty * spin-principal * 0 * 2 *",
            "Reports and figures: */dropspin-*",
        ]
    )
    [kept] = re.findall(r"Reports and figures: (\S+)/\*", done.stdout.str())
    shutil.rmtree(repository.path / kept)


BASELINE = """
format = 2
accepted.a0b1c2d = {{date = 2026-01-31, reason = "as it was", versions = {{}}}}
scenes.spin-principal = "{digest}"
figures.spin-principal.mine."0.004".angular_momentum_error = {{value = 1e-4, tolerance = 1e-9, by = "a0b1c2d"}}
figures.spin-principal.faulty."0.004".angular_momentum_error = {{value = 1e-4, tolerance = 1e-6, by = "a0b1c2d"}}
"""


def test_accepted_figures(repository):
    """What is worse than accepted fails, with the bound that it has by then; what is better passes; what is missing is skipped."""
    (repository.path / "base.toml").write_text(BASELINE.format(digest=scenarios.load("spin-principal").digest))
    repository.makeini("[pytest]\ndropspin_baseline = base.toml\ndropspin_engines = engines:Mine\n  engines:Faulty\n  absent:Engine")
    repository.makepyfile(absent="import no_such_engine")
    done = repository.runpytest_subprocess("-v", *SCENE, "-k", "angular_momentum_error")
    done.stdout.fnmatch_lines(
        [
            "dropspin::spin-principal::angular_momentum_error[[]mine] PASSED*",
            "dropspin::spin-principal::angular_momentum_error[[]faulty] FAILED*",
            "dropspin::spin-principal::angular_momentum_error[[]absent:Engine] SKIPPED*",
            "spin-principal, faulty: accepted angular_momentum_error at 0.004 s is 0.001, expected -1e-06 … 0.000101: 9.9 times its bound",
            "    accepted 0.0001 ± 1e-06 on 2026-01-31, as it was; worse by 900 times its tolerance",
            "Again: dropspin run spin-principal -e engines:Faulty --dt 0.004 --baseline base.toml -o out/again",
            "Accept: dropspin accept .pytest_cache/d/dropspin/spin-principal-* --baseline base.toml --known-failures --reason *",
        ]
    )


def test_what_is_not_accepted_yet_does_not_fail(repository):
    """A scene that the baseline knows nothing of is judged by what it expects; that nothing was held against it is told."""
    (repository.path / "base.toml").write_text(BASELINE.format(digest=scenarios.load("spin-principal").digest))
    repository.makepyfile(
        test_own="""
        def test_new(dropspin_check):
            dropspin_check("needle.toml", dt=0.004)
    """
    )
    done = repository.runpytest_subprocess("--dropspin-baseline", "base.toml", *asked("Mine"))
    done.assert_outcomes(passed=1)
    done.stdout.fnmatch_lines(["No figure of these runs has been accepted in base.toml: nothing was held against it."])


def test_what_failed_last(repository):
    """By --lf, as any test's."""
    repository.runpytest_subprocess(*SCENE, *asked("Mine", "Faulty")).assert_outcomes(passed=3, failed=2, skipped=12)
    repository.runpytest_subprocess("--lf", *SCENE, *asked("Mine", "Faulty")).assert_outcomes(failed=2, deselected=15)


def test_markers_lose_no_scene(repository):
    """Of the same name, on top of each other; one that does nothing is an error."""
    scene = {"body": {"shape": "sphere", "radius": 0.1, "mass": 1.0}}
    repository.makepyfile(
        test_own=f"""
        import pytest

        @pytest.mark.dropspin("a/needle.toml", "b/needle.toml", dt=0.004)
        @pytest.mark.dropspin({scene | {"duration": 1.0}}, {scene | {"duration": 2.0}})
        def test_each(dropspin_result):
            pass
        """,
        test_idle="""
        import pytest

        @pytest.mark.dropspin("spin-prinzipal")
        def test_idle():
            pass
        """,
    )
    collected = repository.runpytest_subprocess("--collect-only", "-q", "test_own.py", *asked("Mine")).outlines
    assert len({line for line in collected if "::" in line}) == 4
    idle = repository.runpytest_subprocess("test_idle.py")
    assert idle.ret == pytest.ExitCode.INTERRUPTED
    idle.stdout.fnmatch_lines(["test_idle is marked with scenes, but does not take dropspin_result"])


def test_workers_share_a_run(repository):
    """Two workers: the engine's module is imported to plan and to run, not again; the summary has what both said."""
    done = repository.runpytest_subprocess("-n", "2", *SCENE, *asked("Mine", "Faulty"))
    assert done.ret == pytest.ExitCode.TESTS_FAILED
    assert len((repository.path / "imports.log").read_text().splitlines()) == 2
    done.stdout.fnmatch_lines(["mine * spin-principal * 2 * 0  *", "faulty * spin-principal * 0 * 2  *"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--dropspin-engine", "mujocco"], "dropspin: engine 'mujocco' is unknown.*"),
        (["--dropspin-scene", "drop-bal"], "dropspin: *Did you mean 'drop-ball'?*"),
        (["--dropspin-scene", "drop-ball", "--dropspin-baseline", "none.toml"], "dropspin: *none.toml: No such file or directory*"),
        ([*SCENE, "dropspin::spin-principal::energy_eror"], "not found: dropspin::spin-principal::energy_eror*"),
    ],
    ids=["engine", "scene", "baseline", "node id"],
)
def test_bad_input(repository, arguments, message):
    """One line and exit code 4, before anything runs."""
    done = repository.runpytest_subprocess(*arguments)
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines([f"ERROR: {message}"])
    assert "Traceback" not in done.stderr.str() + done.stdout.str()


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


@pytest.mark.parametrize(
    ("command", "path"),
    [pytest.param(*way, marks=[] if way in QUICK else pytest.mark.slow) for way in product(WAYS, ["", "."])],
)
def test_packages_named_like_ours(command, path, tmp_path):
    """Neither side imports the other's, whichever way they are started; what the user's tests do not import may as well raise."""
    imported = command == "pytest"
    for name in OURS:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text('WHOSE = "the user\'s"' if imported else "raise ImportError('the user's')")
    (tmp_path / "engines.py").write_text(ENGINES)
    (tmp_path / "conftest.py").write_text("import scenarios, reports\n" if imported else "")
    (tmp_path / "test_own.py").write_text(OF_THE_USER.format(own="from reports import WHOSE" if imported else 'WHOSE = "the user\'s"'))
    asked = ["run", "spin-principal", "-e", "engines:Mine", "--dt", "0.004"] if command == "dropspin" else ["-W", "error"]
    run(*WAYS[command], *asked, cwd=tmp_path, **({"PYTHONPATH": path} if path else {}))


def test_unused(repository):
    """Nothing of it is there where it is switched off; nothing is started where it is not used, nor written."""
    repository.makepyfile(
        test_own="""
        import sys

        def test_own():
            assert not {"numpy", "pandas", "click", "filelock", "tomlkit", "scenarios", "reports"} & set(sys.modules)
        """
    )
    for arguments in ([], ["-p", "no:dropspin"], ["-p", "no:cacheprovider", "-n", "1"]):
        done = repository.runpytest_subprocess("-W", "error", *arguments)
        done.assert_outcomes(passed=1)
        assert "dropspin" not in done.stdout.str().replace("plugins: ", "").partition("collected")[2]
    assert not list(repository.path.glob(".pytest_cache/d/dropspin"))
    assert not (repository.path / "imports.log").exists()
