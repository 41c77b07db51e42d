"""The command line as its users meet it: in a process of its own."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import comparisons
import scenarios

DROPSPIN = Path(sys.executable).with_name("dropspin")
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


def dropspin(*arguments, cwd):
    return subprocess.run([DROPSPIN, *arguments], cwd=cwd, capture_output=True, text=True, timeout=300, check=False)


def test_a_scene_of_ones_own(tmp_path):
    """Any path works, and the arrays are those of the Python call, bit for bit."""
    (tmp_path / "my-scene.toml").write_text(SCENE)
    done = dropspin("run", "my-scene.toml", "-e", "document", "-e", "mujoco", "--dt", "0.002", "-o", "out/mine", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Report: out/mine/report.html" in done.stdout
    assert (tmp_path / "out/mine/report.html").is_file()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["my-scene.toml", "out"]
    for engine in ("document", "mujoco"):
        motion = comparisons.simulate(scenarios.load(tmp_path / "my-scene.toml"), engine, dt=2e-3)
        [file] = (tmp_path / "out/mine/trajectories").glob(f"*-{engine}-*.npz")
        with np.load(file, allow_pickle=False) as arrays:
            for field in ("t", "position", "orientation", "velocity", "angular_velocity"):
                np.testing.assert_array_equal(arrays[field], getattr(motion, field))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "drop-bal"], "Did you mean 'drop-ball'?"),
        (["run", "absent.toml"], "absent.toml: No such file or directory"),
        (["run", "drop-ball", "-e", "mujocco"], "Did you mean 'mujoco'?"),
        (["run", "drop-ball", "-e", "mujoco[integrator=rk5]"], "Did you mean 'rk4'?"),
        (["run", "drop-ball", "--dt", "0"], "dt: got 0.0 s"),
        (["run", "drop-ball", "--dt", "nan"], "dt: got nan s"),
        (["run", "drop-ball", "--dt", "fast"], "'fast' is not a valid float"),
        (["run", "drop-ball", "--out", "x"], "No such option"),
        (["run", "drop-ball", "-o", "."], "holds files that are no run"),
        (["frobnicate"], "No such command"),
        (["show", "drop-bal"], "Did you mean 'drop-ball'?"),
        (["show", "drop-ball", "-e", "x"], "engine 'x' is unknown"),
        (["list", "planets"], "'planets' is not one of"),
    ],
    ids=lambda case: " ".join(case) if isinstance(case, list) else "",
)
def test_bad_usage(arguments, message, tmp_path):
    """Exit code 2, the reason on the standard error, no traceback, nothing written."""
    (tmp_path / "precious").write_text("x")
    done = dropspin(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["precious"]


def test_expectation_that_fails_is_exit_code_1(tmp_path):
    """With the scene, the metric, the bound, and the command that does it again."""
    text = SCENE + '[[expect]]\nmetric = "penetration"\nbelow = 1e-9\nreason = "no engine is that stiff"\n'
    (tmp_path / "harsh.toml").write_text(text)
    done = dropspin("run", "harsh.toml", "-e", "mujoco", "--dt", "0.002", cwd=tmp_path)
    assert done.returncode == 1
    assert "penetration is" in done.stdout
    assert "no engine is that stiff" in done.stdout.replace("\n", " ")
    assert "1 of 1 expectations fail." in done.stdout


@pytest.mark.parametrize("what", ["scenes", "engines", "metrics"])
def test_list(what, tmp_path):
    """A table for people, the same in JSON for programs."""
    table = dropspin("list", what, cwd=tmp_path)
    data = json.loads(dropspin("list", what, "--json", cwd=tmp_path).stdout)
    assert table.returncode == 0
    for row in data:
        assert next(iter(row.values())) in table.stdout


def test_show(tmp_path):
    """What is modelled, what is left out, the truth; an engine's settings; a scene that it declines."""
    shown = dropspin("show", "spin-asymmetric", cwd=tmp_path).stdout
    assert "gravity, floor, damping" in shown
    assert "elliptic" in shown
    settings = dropspin("show", "drop-ball", "-e", "mujoco", "--dt", "0.002", cwd=tmp_path).stdout
    assert "[0.0, -750.0]" in settings
    declined = dropspin("show", "drop-ball", "-e", "mujoco[integrator=rk4]", cwd=tmp_path).stdout
    assert "declines drop-ball" in declined.replace("\n", " ")


def test_doctor(tmp_path):
    """Every engine installed here takes its steps."""
    rows = {row["what"]: row["found"] for row in json.loads(dropspin("doctor", "--json", cwd=tmp_path).stdout)}
    assert rows["engine document"].startswith("works")
    assert rows["engine mujoco"].startswith("works")
    assert rows["python"] == sys.version.split()[0]


def test_json_of_a_run(tmp_path):
    """The rows and nothing else on the standard output."""
    done = dropspin("run", "spin-principal", "-e", "document", "--dt", "0.004", "--json", cwd=tmp_path)
    rows = json.loads(done.stdout)
    assert {row["engine"] for row in rows} == {"document"}
    assert "running spin-principal" in done.stderr
