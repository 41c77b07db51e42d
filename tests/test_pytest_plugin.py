"""The pytest plugin in a user's repository: marked tests, fixtures, options, messages.

The sessions run in this process, and so does the command that they start: it takes a third of the time.
"""

import re
import shlex
import shutil
from pathlib import Path

import pytest
from support.cli import dropspin
from support.repositories import ENGINES, SCENE_TEST, fill, options

from dropspin import pytest_plugin, pytest_runs, scenarios

pytest_plugins = ["pytester"]

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module", autouse=True)
def _imported(tmp_path_factory):
    """Import what the command needs before the first session in this process, which forgets the modules that it has imported."""
    folder = tmp_path_factory.mktemp("imported")
    (folder / "engines.py").write_text(ENGINES)
    assert dropspin("run", "spin-principal", "-e", "engines:Mine", "--dt", "0.004", cwd=folder).returncode == 0


@pytest.fixture
def repository(pytester, monkeypatch):
    """A user's repository with engines and a scene; the plugin's command runs in this process."""
    monkeypatch.setattr(pytest_plugin.Runs, "dropspin", lambda runs, *arguments: dropspin(*arguments, cwd=runs.root))
    return fill(pytester)


@pytest.mark.extended
def test_marked_test_is_called_for_each_engine(repository):
    """It passes, fails, or is skipped by the verdicts; the messages, the commands and the summary say which."""
    repository.makepyfile(absent="import no_such_engine", unfit="Engine = 1 / 0", test_own=SCENE_TEST)
    engines = [*options("Mine", "Faulty", "Dying", "Shy"), "--dropspin-engine", "absent:Engine", "--dropspin-engine", "unfit:Engine"]
    done = repository.runpytest_inprocess("-rs", "-v", *engines)
    reasons = {one.metric: one.reason for one in scenarios.load("spin-principal").expect}
    done.stdout.fnmatch_lines(
        [
            "test_own.py::test_scene[[]spin-principal-engines:Mine] PASSED*",
            "test_own.py::test_scene[[]spin-principal-engines:Faulty] FAILED*",
            "test_own.py::test_scene[[]spin-principal-engines:Dying] ERROR*",
            "test_own.py::test_scene[[]spin-principal-engines:Shy] SKIPPED*",
            "test_own.py::test_scene[[]spin-principal-absent:Engine] ERROR*",
            "test_own.py::test_scene[[]spin-principal-unfit:Engine] ERROR*",
            "spin-principal, dying: crashed: its process was ended by SIGABRT",
            "Reproduce: dropspin run spin-principal -e engines:Dying --dt 0.004 -o out/again",
            "spin-principal, absent:Engine: missing: *no_such_engine, which is not installed.",
            "spin-principal, unfit:Engine: broken: *division by zero*",
            "E * spin-principal, faulty: energy_error at 0.004 s is 0.002, expected -1e-06 … 1e-06",
            f"E *    reason of the bound: {reasons['energy_error']}",
            "E *    Reproduce: dropspin run spin-principal -e engines:Faulty --dt 0.004 -o out/again",
            "E *    If this change is intended: dropspin accept .pytest_cache/d/dropspin/spin-principal-* "
            '--baseline dropspin-baseline.toml --known-failures --reason "…"; then use --dropspin-baseline dropspin-baseline.toml',
            "engine * scene * passed  failed  known  message",
            "mine * spin-principal * 2 * 0 * 0  energy_error at 0.004 s is 0, expected -1e-06 … 1e-06",
            "faulty * spin-principal * 0 * 2 * 0  energy_error at 0.004 s is 0.002, *",
            "dying * spin-principal * 0 * 1 * 0  crashed: *",
            "absent:Engine * spin-principal * 0 * 1 * 0  missing: *",
            "shy * spin-principal * 0 * 0 * 0  declined: I do not spin",
            "Reports: .pytest_cache/d/dropspin/[*]",
            "SKIPPED * shy declined: I do not spin",
        ],
    )
    done.assert_outcomes(passed=1, failed=1, errors=3, skipped=1)
    assert "Traceback" not in done.stdout.str()
    folders = list(repository.path.glob(".pytest_cache/d/dropspin/spin-principal-*/"))
    assert len(folders) == 6
    assert all((folder / "report.html").is_file() for folder in folders)
    [accept] = re.findall(r"intended: dropspin (accept .*); then use", done.stdout.str())
    assert dropspin(*shlex.split(accept), cwd=repository.path).returncode == 0
    assert "faulty" in (repository.path / "dropspin-baseline.toml").read_text(encoding="utf-8")


@pytest.mark.extended
def test_collecting_runs_no_scene(repository):
    """The engines of the configuration file; tests are selected by path, by -k and by -m."""
    repository.makeini("[pytest]\ndropspin_engines = engines:Mine\n    engines:Shy")
    repository.makepyfile(test_scenes=SCENE_TEST.replace('"spin-principal"', '"spin-principal", "needle.toml"'))

    def collected(*arguments):
        return [line for line in repository.runpytest_inprocess("--collect-only", "-q", *arguments).outlines if "::" in line]

    ids = [f"test_scenes.py::test_scene[{scene}-engines:{one}]" for scene in ("spin-principal", "needle") for one in ("Mine", "Shy")]
    assert collected() == ["test_own.py::test_own", *ids]
    assert collected("-m", "dropspin") == ids
    assert collected("-m", "not dropspin") == ["test_own.py::test_own"]
    assert collected("-k", "needle and Mine") == [ids[2]]
    assert collected("-m", "dropspin", *options("Faulty")) == [one.replace("Mine", "Faulty") for one in ids[::2]]
    assert not list(repository.path.glob(".pytest_cache/d/dropspin/*"))


@pytest.mark.extended
def test_documentation(repository):
    """The page's tests in a repository with its configuration file."""
    page = (DOCS / "pytest.md").read_text(encoding="utf-8")
    adapter = (DOCS / "bring-your-engine.md").read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]
    (repository.path / "pyproject.toml").write_text(page.split("```toml\n")[1].split("```")[0])
    first, second = (block.split("```")[0] for block in page.split("```python\n")[1:])
    repository.makepyfile(my_module=adapter, test_first=first, test_second=second)
    done = repository.runpytest_inprocess("-v", "test_first.py", "test_second.py", "--dropspin-dt", "0.004")
    done.stdout.fnmatch_lines(
        [
            "test_first.py::test_scene[[]spin-principal-my_module:Flyer] PASSED*",
            "test_first.py::test_scene[[]fall-spin-my_module:Flyer] PASSED*",
            "test_second.py::test_expectations_hold PASSED*",
            "test_second.py::test_energy_error PASSED*",
            "test_second.py::test_each[[]spin-principal-my_module:Flyer] PASSED*",
            "test_second.py::test_each[[]spin-principal-50-my_module:Flyer] PASSED*",
            "test_second.py::test_mapping PASSED*",
        ]
    )
    done.assert_outcomes(passed=7)


@pytest.mark.parametrize(
    ("kind", "truth", "message"),
    [
        ("truth", "exact", "energy_error is -0.09, expected -0.0925 … -0.0868"),
        ("asymptotic_error", "exact", "asymptotic energy_error is -0.09, 95 % interval -0.0925 … -0.0868"),
        ("baseline", "accepted asymptotic error", "accepted asymptotic energy_error is -0.09, expected -0.0925 … -0.0868"),
    ],
)
def test_only_bounds_are_called_expected(kind, truth, message):
    """An extrapolated value is always inside its interval, also if it fails."""
    row = {"metric": "energy_error", "kind": kind, "truth": truth, "dt": None, "unit": "1", "value": -0.09}
    assert pytest_runs.message_of(row | {"lower": -0.0925, "upper": -0.0868}) == message


@pytest.mark.extended
def test_messages_of_failing_tests(repository):
    """What failed, where the test called; a metric that was not measured; an unknown scene; a fixture without a scene."""
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
    done = repository.runpytest_inprocess("-p", "no:cacheprovider", "--dropspin-dt", "0.004", *options("Faulty"))
    done.stdout.fnmatch_lines(
        [
            "dropspin_result needs a marker with a scene, such as @pytest.mark.dropspin('drop-ball')",
            '>*dropspin_check("spin-principal")',
            "E * spin-principal, faulty: energy_error at 0.004 s is 0.002, *",
            "E * LookupError: penetration of spin-principal at any time step was not measured; available: energy_error, *",
            "dropspin: *spin-prinzipal* Did you mean 'spin-principal'?*",
            "faulty * spin-principal * 0 * 2 *",
            "Reports: */dropspin-*",
        ]
    )
    done.assert_outcomes(failed=3, errors=1)
    [kept] = re.findall(r"Reports: (\S+)/\*", done.stdout.str())
    shutil.rmtree(repository.path / kept)


def test_value_of_a_metric():
    """The finest time step by default; NaN if undefined; ambiguous and absent metrics are errors that say what there is."""
    row = {"kind": "truth", "metric": "energy_error", "verdict": "measured", "reason": ""}
    rows = [row | {"engine": "mine", "dt": 0.002, "value": None}, row | {"engine": "mine", "dt": 0.004, "value": 0.5}]
    rows += [row | {"engine": "other", "dt": 0.004, "value": 0.25}, {"engine": "shy", "kind": "", "metric": "", "dt": 0.004}]
    rows[-1] |= {"verdict": "declined", "reason": "I do not spin"}
    rows += [row | {"engine": "weak", "dt": 0.002, "value": 0.0}]
    rows += [{"engine": "weak", "kind": "", "metric": "", "dt": 0.001, "verdict": "crashed", "reason": "too fine"}]
    result = pytest_plugin.Result("spin", rows, Path("out"), "spin", {"mine": "my_module:Mine"}, ())
    assert result.value("energy_error", engine="mine", dt=0.004) == 0.5
    assert result.value("energy_error", engine="my_module:Mine", dt=0.004) == 0.5
    assert result.value("energy_error", engine="other") == 0.25
    assert str(result.value("energy_error", engine="mine")) == "nan"
    with pytest.raises(LookupError, match=r"^energy_error was measured for several engines, mine, other, weak; choose one with engine=$"):
        result.value("energy_error")
    with pytest.raises(
        LookupError, match=r"^energy_error of shy at 0\.004 s was not measured; available: no metric; shy declined: I do not spin$"
    ):
        result.value("energy_error", engine="shy", dt=0.004)
    with pytest.raises(LookupError, match=r"^energy_error of weak at 0\.001 s was not measured; .*; weak crashed: too fine$"):
        result.value("energy_error", engine="weak")


def test_scene_file_that_is_written_again_is_run_again(repository):
    repository.makepyfile(
        """
        SCENE = 'duration = {}\\nbody = {{shape = "sphere", radius = 0.1, mass = 1.0}}'

        def test_both(dropspin_run, pytestconfig):
            folders = []
            for duration in (0.1, 0.2):
                (pytestconfig.rootpath / "again.toml").write_text(SCENE.format(duration))
                folders.append(dropspin_run("again.toml", engine="engines:Mine", dt=[0.004]).folder)
            assert len(set(folders)) == 2
        """
    )
    repository.runpytest_inprocess("-k", "test_both").assert_outcomes(passed=1)


BASELINE = """
format = 3
accepted.a0b1c2d = {{date = 2026-01-31, reason = "first measured", versions = {{}}}}
scenes.spin-principal = "{digest}"
results.spin-principal.mine."0.004".angular_momentum_error = {{value = 1e-4, tolerance = 1e-9, by = "a0b1c2d"}}
results.spin-principal.faulty."0.004".angular_momentum_error = {{value = 1e-4, tolerance = 1e-6, by = "a0b1c2d"}}
"""


@pytest.fixture
def baseline(repository):
    (repository.path / "base.toml").write_text(BASELINE.format(digest=scenarios.load("spin-principal").digest))


@pytest.mark.usefixtures("baseline")
def test_result_worse_than_accepted_fails(repository):
    """With the bound of the baseline; a better one passes, and a missing engine that only the configuration file names does not fail."""
    repository.makeini("[pytest]\ndropspin_baseline = base.toml\ndropspin_engines = engines:Mine\n  engines:Faulty\n  genesis")
    repository.makepyfile(
        test_own="""
        def test_all(dropspin_check):
            dropspin_check("spin-principal", dt=0.004)
        """,
    )
    done = repository.runpytest_inprocess()
    done.assert_outcomes(failed=1)
    done.stdout.fnmatch_lines(
        [
            "E * faulty: accepted angular_momentum_error at 0.004 s is 0.001, expected -1e-06 … 0.000101",
            "E * accepted 0.0001 ± 1e-06 on 2026-01-31, first measured; worse by 0.0009, 900 times its tolerance",
            "E * Reproduce: dropspin run spin-principal -e engines:Faulty --dt 0.004 --baseline base.toml -o out/again",
            "E * If this change is intended: dropspin accept .pytest_cache/d/dropspin/spin-principal-* "
            '--baseline base.toml --known-failures --reason "…"',
            "mine * spin-principal * 3 * 0 * 0  *",
            "faulty * spin-principal * 0 * 3 * 0  *",
            "genesis * spin-principal * 0 * 0 * 0  missing: *",
        ]
    )


@pytest.mark.usefixtures("baseline")
def test_marked_test_of_an_engine_whose_accepted_results_are_gone_fails(repository):
    """Although the configuration file alone names it, and it declines the scene or is not installed."""
    repository.makeini("[pytest]\ndropspin_baseline = base.toml\ndropspin_engines = engines:Shy\n  absent:Engine")
    base = repository.path / "base.toml"
    base.write_text(base.read_text().replace(".mine.", ".shy.").replace(".faulty.", ".gone.") + 'engines.gone = "absent:Engine"\n')
    repository.makepyfile(absent="import no_such_engine", test_own=SCENE_TEST)
    done = repository.runpytest_inprocess("--dropspin-dt", "0.004")
    done.assert_outcomes(errors=2)
    done.stdout.fnmatch_lines(
        [
            "spin-principal, shy: failed: 1 accepted results are gone, declined: I do not spin",
            "spin-principal, absent:Engine: failed: 1 accepted results are gone, missing: *",
        ]
    )


def test_own_adapter_that_cannot_be_imported_fails_wherever_it_is_named(repository):
    """A test that also runs another engine would pass without it."""
    repository.makepyfile(
        absent="import no_such_engine",
        test_own="""
        def test_both(dropspin_check):
            dropspin_check("spin-principal", engine=["absent:Engine", "engines:Mine"], dt=0.004)
        """,
    )
    done = repository.runpytest_inprocess()
    done.assert_outcomes(failed=1)
    done.stdout.fnmatch_lines(["E * spin-principal, absent:Engine: missing: *no_such_engine, which is not installed."])


@pytest.mark.parametrize(
    ("arguments", "fixture", "message"),
    [
        ('"spin-principal", engine=[]', "dropspin_result", "got an empty list of engines or time steps; give one, or leave it out *"),
        ('"spin-principal", dt=[]', "dropspin_result", "got an empty list of engines or time steps; give one, or leave it out *"),
        ('engine="engines:Mine"', "dropspin_result", "test_marked is marked with an engine or a time step, but without scenes"),
        ('engine="engines:Mine"', "tmp_path", "test_marked is marked with dropspin, but does not take dropspin_result"),
    ],
)
def test_marker_that_asks_for_nothing_is_refused(repository, arguments, fixture, message):
    """A list that comes out empty would judge other engines than the test's."""
    repository.makepyfile(test_own=f"import pytest\n\n@pytest.mark.dropspin({arguments})\ndef test_marked({fixture}):\n    pass\n")
    done = repository.runpytest_inprocess()
    done.assert_outcomes(errors=1)
    done.stdout.fnmatch_lines([f"*{message}"])


def test_scenes_of_one_name_have_lines_of_their_own(repository):
    """In the summary, which counts equal rows once."""
    repository.makepyfile(
        test_own="""
        def test_both(dropspin_check):
            bound = {"metric": "energy_error", "below": 1e-9, "reason": "no force acts on it"}
            body = {"shape": "sphere", "radius": 0.1, "mass": 1.0}
            for duration in (0.2, 0.4):
                scene = {"name": "own", "duration": duration, "body": body, "expect": [bound]}
                dropspin_check(scene | {"start": {"angular_velocity": [0.0, 1.0, 0.0]}}, engine="engines:Mine", dt=0.004)
        """
    )
    done = repository.runpytest_inprocess()
    done.stdout.fnmatch_lines(["mine * own * 1 * 0 * 0  *"] * 2)


@pytest.mark.extended
@pytest.mark.usefixtures("baseline")
def test_scene_without_accepted_results_is_judged_by_its_expectations(repository):
    """The summary says that no results were compared with the baseline."""
    repository.makepyfile(
        test_own="""
        def test_new(dropspin_check):
            dropspin_check("needle.toml", dt=0.004)
    """
    )
    done = repository.runpytest_inprocess("--dropspin-baseline", "base.toml", *options("Mine"))
    done.assert_outcomes(passed=1)
    done.stdout.fnmatch_lines(["base.toml has no accepted results of these runs; no results were compared with it."])


def test_markers_with_scenes_of_one_name_add_up(repository):
    scene = {"body": {"shape": "sphere", "radius": 0.1, "mass": 1.0}}
    repository.makepyfile(
        test_own=f"""
        import pytest

        @pytest.mark.dropspin("a/needle.toml", "b/needle.toml", dt=0.004)
        @pytest.mark.dropspin({scene | {"duration": 1.0}}, {scene | {"duration": 2.0}})
        def test_each(dropspin_result):
            pass
        """
    )
    collected = repository.runpytest_inprocess("--collect-only", "-q", "test_own.py", *options("Mine")).outlines
    assert len({line for line in collected if "::" in line}) == 4


def test_marker_without_the_fixture_is_an_error(repository):
    repository.makepyfile(
        test_idle="""
        import pytest

        @pytest.mark.dropspin("spin-prinzipal")
        def test_idle():
            pass
        """
    )
    idle = repository.runpytest_inprocess("test_idle.py")
    assert idle.ret == pytest.ExitCode.INTERRUPTED
    idle.stdout.fnmatch_lines(["test_idle is marked with dropspin, but does not take dropspin_result"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--dropspin-dt", "0"], "--dropspin-dt: got 0; a time step is a positive number of seconds."),
        (["--dropspin-dt", "0.004", "--dropspin-dt", "nan"], "--dropspin-dt: got nan; a time step is a positive number of seconds."),
        (["--dropspin-baseline", "none.toml"], "--dropspin-baseline: none.toml: No such file or directory."),
    ],
    ids=["zero", "nan", "baseline"],
)
def test_invalid_option_ends_the_session_with_one_line(repository, arguments, message):
    """And exit code 4, before any test runs."""
    done = repository.runpytest_inprocess(*arguments)
    assert done.ret == pytest.ExitCode.USAGE_ERROR
    done.stderr.fnmatch_lines([f"ERROR: {message}"])
    assert "Traceback" not in done.stderr.str() + done.stdout.str()
    assert "test_own" not in done.stdout.str()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--dropspin-engine", "mujocco"], "dropspin: engine 'mujocco' is unknown.*"),
        (["--dropspin-baseline", "engines.py"], "dropspin: engines.py: not TOML: *"),
    ],
    ids=["engine", "baseline"],
)
def test_invalid_request_fails_the_test_with_one_line(repository, arguments, message):
    repository.makepyfile(test_own=SCENE_TEST)
    done = repository.runpytest_inprocess(*arguments)
    done.assert_outcomes(errors=1)
    done.stdout.fnmatch_lines(["_* ERROR at setup of test_scene* _*", message, "*short test summary info*"], consecutive=True)
