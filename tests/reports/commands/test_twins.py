"""`dropspin symmetries twins`."""

import json

import pytest
from support.cli import dropspin


def test_table_and_json(tmp_path):
    """A port that rounds otherwise, another integrator, and an engine that declines the scene."""
    asked = ("drop-box-corner", "--dt", "0.002", "-e", "mujoco", "-e", "mujoco[body=child]", "-e", "mujoco[integrator=rk4]")
    done = dropspin("symmetries", "twins", *asked, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith("scene            engines")
    assert lines[1].split()[-2:] == ["–", "yes"]
    assert lines[2].endswith("not run")
    assert any(line.startswith("Not run: mujoco and mujoco[integrator=rk4] in drop-box-corner: mujoco[integrator=rk4]: ") for line in lines)
    rounded, *others = json.loads(dropspin("symmetries", "twins", *asked, "--json", cwd=tmp_path).stdout)
    assert [one["status"] for one in (rounded, *others)] == ["kept", "not run", "not run"]
    assert rounded["first"] > 0
    assert rounded["beyond"]["0.001"] is None
    assert others[0]["before_contact"] is None


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (["drop-ball"], "Missing option '-e'"),
        (["-e", "mujoco", "-e", "wang"], "Missing argument 'SCENE...'"),
        (["drop-ball", "-e", "mujoco"], "got 1 engine; name at least two"),
        (["drop-ball", "-e", "mujoco", "-e", "mujoco"], "mujoco and mujoco both have the name mujoco"),
        (["drop-bal", "-e", "mujoco", "-e", "wang"], "Did you mean 'drop-ball'"),
        (["drop-ball", "-e", "mujoco", "-e", "wang", "--dt", "7"], "dt: got 7.0 s"),
    ],
)
def test_bad_input_is_refused(asked, message, tmp_path):
    done = dropspin("symmetries", "twins", *asked, cwd=tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert message in done.stderr
