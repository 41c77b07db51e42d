"""`dropspin run`: the folder, the exit code, commands that reproduce failures, and runs that are resumed."""

import csv
import json
import re
import shlex
import signal
from unittest import mock

import numpy as np
import pytest
from support.brief_runs import all_starts
from support.cli import Started, dropspin

from dropspin.comparisons.engines.mujoco_engine import MuJoCo
from dropspin.comparisons.running import run as running
from dropspin.comparisons.running.driving import simulate
from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.reports.run_folder import MeasuredScenes
from dropspin.reports.stories.failures import failures
from dropspin.scenarios import load

SCENE = """
summary  = "Mine"
duration = 0.5
[body]
shape = "box"
half_extents = [0.1, 0.2, 0.3]
mass = 2.0
[start]
position = [0.0, 1.0, 0.0]
orientation = [0.1, 0.2, 0.3, 0.9]
angular_velocity = [1.0, 2.0, 3.0]
[gravity]
acceleration = [0.0, -9.81, 0.0]
[floor]
restitution = 0.6
friction = "infinite"
"""


@pytest.mark.extended
def test_a_scene_file_runs_and_its_arrays_are_those_of_simulate(tmp_path):
    """Any path works, and the trajectories equal those of the Python call, bit for bit."""
    (tmp_path / "my-scene.toml").write_text(SCENE)
    done = dropspin("run", "my-scene.toml", "-e", "wang", "-e", "mujoco", "--dt", "0.002", "-o", "out/mine", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Report: out/mine/report.html" in done.stdout
    assert (tmp_path / "out/mine/report.html").is_file()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["my-scene.toml", "out"]
    for engine in ("wang", "mujoco"):
        motion = simulate(load(tmp_path / "my-scene.toml"), engine, dt=2e-3)
        [file] = (tmp_path / "out/mine/trajectories").glob(f"*-{engine}-*.npz")
        with np.load(file, allow_pickle=False) as arrays:
            for field in ("t", "position", "orientation", "velocity", "angular_velocity"):
                np.testing.assert_array_equal(arrays[field], getattr(motion, field))


STIFF = '[[expect]]\nmetric = "penetration"\nbelow = 1e-9\nreason = "no engine is that stiff"\n'


@pytest.mark.extended
def test_a_failed_expectation_is_reported_with_the_command_that_reproduces_it(tmp_path):
    """Exit code 1; the command has the path as it was given, quoted, and all digits of the time step."""
    (tmp_path / "my scene.toml").write_text(SCENE + STIFF)
    command = ("run", "my scene.toml", "-e", "mujoco", "--dt", "0.00123456789")
    done = dropspin(*command, cwd=tmp_path)
    assert done.returncode == 1
    output = done.stdout.replace("\n", " ")
    assert "✗ my scene · mujoco · 0.00123457 s: penetration is " in output
    assert ", expected ≤ 1e-09; reason of the bound: no engine is that stiff. " in output
    assert f"Reproduce: dropspin {shlex.join(command)} -o out/again" in output
    assert "1 of 1 check fails." in output


def test_the_command_that_reproduces_a_failure_has_the_time_limit(tmp_path):
    """If it is not the default one."""
    (tmp_path / "mine.toml").write_text(SCENE + STIFF)
    command = ("run", "mine.toml", "-e", "mujoco", "--dt", "0.01", "--time-limit", "17")
    assert f"Reproduce: dropspin {shlex.join(command)} -o out/again" in dropspin(*command, cwd=tmp_path).stdout.replace("\n", " ")


def test_the_call_that_reproduces_a_failure_of_objects():
    """Of a scene or an engine that was given as an object, which no command can name."""
    ball = load("drop-ball")
    content = ball.model_dump(exclude_none=True, exclude={"origin", "expect"})
    given = load(content | {"expect": [{"metric": "penetration", "below": 1e-9, "reason": "stiff"}]})
    by_name = ball.model_copy(update={"expect": given.expect})
    for scene, engine, call in (
        (given, MuJoCo(), "<scene 'drop-ball'>, <engine 'mujoco'>, dt=[0.01]"),
        (given, "mujoco", "<scene 'drop-ball'>, 'mujoco', dt=[0.01]"),
        (by_name, MuJoCo(), "'drop-ball', <engine 'mujoco'>, dt=[0.01]"),
    ):
        [found] = failures(running.run(scene, engine, 1e-2))
        assert found.reproduce == f"dropspin.run({call})"


def test_json_of_a_run_is_the_table_to_the_last_digit(tmp_path):
    """The rows and nothing else on the standard output; an undefined number is null."""
    done = dropspin("run", "spin-principal", "-e", "pybullet", "--dt", "0.004", "--json", cwd=tmp_path)
    rows = json.loads(done.stdout, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    with (tmp_path / "out/run/results.csv").open(newline="") as file:
        for row, kept in zip(rows, csv.DictReader(file), strict=True):
            assert row["metric"] == kept["metric"]
            assert row["value"] == float(kept["value"])
            assert (row["upper"] is None) == (kept["upper"] == "")
    assert any(0 < abs(row["value"]) < 1e-11 for row in rows)
    timing, finished, writing = done.stderr.splitlines()
    assert (timing, writing) == ("timing the steps of each engine", "writing the report")
    assert re.fullmatch(r"finished spin-principal \(1 of 1 scene, \d+ s elapsed\)", finished)


@pytest.mark.extended
def test_expectations_for_other_steps_are_not_called_missing(tmp_path):
    done = dropspin("run", "spin-asymmetric", "-e", "mujoco[integrator=rk4]", "--dt", "0.01", cwd=tmp_path)
    assert "No expectation covers these engines at these time steps; " in " ".join(done.stdout.split())


@pytest.mark.parametrize(
    ("expectation", "message"),
    [
        ('metric = "energy_eror"\nbelow = 1', "Did you mean 'energy_error'?"),
        ('metric = "horizontal_momentum_error"\nbelow = 1', "it needs a frictionless floor"),
        ('metric = "penetration"\nbelow = 1\nengine = "wnag"', "no such engine. Did you mean 'wang'?"),
        ('metric = "penetration"\nbelow = 1\nengine = "mujoco[integrator=euler]"', "write it as 'mujoco'"),
    ],
)
def test_an_expectation_that_would_never_be_judged_is_refused(expectation, message, tmp_path):
    """A gate with a typo must not pass: refused by run and by show, with the file's name."""
    (tmp_path / "gate.toml").write_text(SCENE + f'[[expect]]\n{expectation}\nreason = "why"\n')
    for verb in (["run", "gate.toml", "--dt", "0.01"], ["show", "gate.toml"]):
        done = dropspin(*verb, cwd=tmp_path)
        assert done.returncode == 2
        assert message in done.stderr
        assert "gate.toml: expect[0]" in done.stderr


INTERRUPTED = (
    "run",
    "-j",
    "1",
    "spin-principal",
    "fall-spin",
    "drop-ball",
    "-e",
    "mujoco",
    "--dt",
    "0.008",
    "--dt",
    "0.004",
)


def rows_of(folder):
    with (folder / "results.csv").open(newline="") as file:
        return [{key: value for key, value in row.items() if key != "time_per_step"} for row in csv.DictReader(file)]


@pytest.fixture(scope="module")
def whole(shared):
    """The folder of the run that is interrupted below, uninterrupted."""

    def make(folder):
        with all_starts():
            assert dropspin(*INTERRUPTED, "-o", "whole", cwd=folder).returncode == 0

    return shared("whole-run", make) / "whole"


@pytest.mark.sample(1)
@pytest.mark.usefixtures("engine_processes", "all_start_phases")
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_an_interrupted_run_is_resumed(how, whole, tmp_path):
    """Measured scenes are kept; with --resume only the others are run, and the table is that of an uninterrupted run."""
    process = Started(*INTERRUPTED, "-o", "part", cwd=tmp_path)
    assert any("(2 of 3 scenes" in line for line in process.stderr)
    code, errors = process.end(how)
    if how == signal.SIGINT:
        assert code == 130
        assert errors.lstrip() == "dropspin: interrupted; 2 of 3 scenes are kept; --resume continues the run.\n"
    kept = tmp_path / ".part-measured"
    assert len(list(kept.glob("[0-9]*"))) == 2
    with mock.patch.object(running, "run_scene", wraps=running.run_scene) as run_scene:
        resumed = dropspin(*INTERRUPTED, "-o", "part", "--resume", cwd=tmp_path)
    assert [call.args[0].scene.name for call in run_scene.call_args_list] == ["drop-ball"]
    assert resumed.returncode == 0, resumed.stderr
    assert "checks pass" in resumed.stdout
    assert rows_of(tmp_path / "part") == rows_of(whole)
    assert not kept.exists()


def test_resume_runs_a_different_request_again(tmp_path):
    """Other time steps, another scene of the same name: no results of an earlier run are taken for these."""
    scene = load("spin-principal")
    MeasuredScenes(tmp_path / "run").keep(running.run(scene, "mujoco", 1e-2))
    [part] = MeasuredScenes(tmp_path / "run").parts()

    def runs_again(scene, engine, dt, **limits):
        kept = []
        running.run(scene, engine, dt, keep=kept.append, done=[part], **limits)
        return len(kept) == 1

    assert not runs_again(scene, "mujoco", 1e-2)
    assert runs_again(scene, "mujoco", 5e-3)
    assert runs_again(scene, "mujoco[integrator=rk4]", 1e-2)
    assert runs_again(scene.model_copy(update={"duration": 0.5}), "mujoco", 1e-2)
    assert runs_again(scene, "mujoco", 1e-2, resources=ResourceLimits(processor_time=600.0))


DRAWN = ("run", "drop-ball", "--draw", "2", "-e", "mujoco", "--dt", "0.01", "--dt", "0.005", "--time-limit", "100")


@pytest.mark.extended
def test_drawn_scenes_are_run_and_reproduced(tmp_path):
    """Besides those named; the seed and the command are on the terminal, in run.json and in the reports, and give the same scenes again."""
    with mock.patch("secrets.randbits", return_value=5):
        first = dropspin(*DRAWN, "-o", "first", cwd=tmp_path)
    assert first.returncode == 0, first.stderr
    asked = json.loads((tmp_path / "first/run.json").read_text())["provenance"]["asked"]
    assert asked["scenes"] == ["drop-ball", "draw-5-001", "draw-5-002"]
    assert (asked["draw"], asked["seed"]) == (2, 5)
    assert first.stdout.startswith("Drawn with --seed 5\n")
    [command] = [line for line in (tmp_path / "first/report.md").read_text().splitlines() if "--seed" in line]
    command = command.partition("Reproduce: ")[2]
    assert command == "dropspin run drop-ball --draw 2 --seed 5 -e mujoco --dt 0.01 --dt 0.005 --time-limit 100 -o out/again"
    assert command in first.stdout.replace("\n", " ")
    assert command in (tmp_path / "first/report.html").read_text()
    again = dropspin(*shlex.split(command)[1:], cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert rows_of(tmp_path / "out/again") == rows_of(tmp_path / "first")
    one = dropspin("run", asked["scenes"][2], *DRAWN[4:], "-o", "one", cwd=tmp_path)
    assert one.returncode == 0, one.stderr
    assert [row for row in rows_of(tmp_path / "first") if row["scene"] == asked["scenes"][2]] == rows_of(tmp_path / "one")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--seed", "3"), "--seed has an effect only with random scenes; add --draw N."),
        (("--draw", "0"), "count: got 0; give a whole number from 1 to 1000."),
        (("--draw", "1001"), "count: got 1001; give a whole number from 1 to 1000."),
        (("--draw", "two"), "Invalid value for '--draw': 'two' is not a valid integer."),
        (("--draw", "1", "--seed", "-1"), "seed: got -1; give a whole number from 0 to 18446744073709551615."),
        (("draw-3-000",), "scene 'draw-3-000': scenes are drawn with seeds up to 18446744073709551615 and numbers from 1 to 2000."),
    ],
)
def test_impossible_draws_are_refused_in_one_line(options, message, tmp_path):
    done = dropspin("run", *options, cwd=tmp_path)
    assert done.returncode == 2
    assert [line for line in done.stderr.splitlines() if message in line], done.stderr
    assert done.stdout == ""
    assert not list(tmp_path.iterdir())
