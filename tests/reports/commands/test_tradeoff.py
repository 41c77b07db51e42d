"""`dropspin tradeoff`."""

import json

import pytest
from support.cli import dropspin

from dropspin.comparisons.tradeoff.ladder import BUDGET
from dropspin.reports.commands.tradeoff import tradeoff_command
from dropspin.reports.stories.study import exit_code
from dropspin.reports.study_files import read_study

pytestmark = pytest.mark.usefixtures("two_rounds")
SCENE = """
duration = 0.5
[body]
shape = "box"
half_extents = [0.1, 0.2, 0.3]
mass = 2.0
[start]
angular_velocity = [1.0, 5.0, 0.5]
"""


@pytest.mark.usefixtures("two_rounds")
def test_pareto_front_recommendations_and_files(tmp_path):
    (tmp_path / "short.toml").write_text(SCENE)
    asked = ("tradeoff", "short.toml", "-e", "wang[rotation=rk4]", "-e", "wang[rotation=exact]", "-e", "wang")
    done = dropspin(*asked, "--within", "1e-9", "--within", "1e-30", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    output = " ".join(done.stdout.split())
    assert "orientation error within 1e-09 rad: wang[rotation=" in output
    assert "within 1e-30 rad: no tested configuration reaches this tolerance; the most accurate is wang[rotation=" in output
    assert "Left out: wang, no convergence observed: orientation error is" in output
    why = "at the last 2 time steps the error fell by less than a fifth each"
    assert f"No smaller time steps than these were tried, because {why}: wang[" in output
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "section.json",
        "short.svg",
        "tradeoff.csv",
        "tradeoff.json",
        "tradeoff.md",
    ]
    rows = json.loads((tmp_path / "out" / "tradeoff.json").read_text())
    assert {row["engine"] for row in rows} == {"wang[rotation=rk4]", "wang[rotation=exact]", "wang"}
    assert {row["engine"] for row in rows if row["left_out"]} == {"wang"}
    compared = [row for row in rows if not row["left_out"]]
    assert all(row["cost_best"] <= row["cost"] for row in compared)
    assert any(row["on_pareto_front"] for row in compared)
    assert all(row["cost_per_world_256"] > 0.0 for row in compared)


@pytest.mark.extended
def test_scene_in_which_no_engine_can_be_compared_leaves_the_others(tmp_path):
    (tmp_path / "short.toml").write_text(SCENE)
    asked = ("tradeoff", "-e", "wang[rotation=exact]", "--metric", "position_error", "--budget", "0.1", "-o", "out")
    declined = dropspin(*asked, "drop-ball-slipping", cwd=tmp_path)
    assert declined.returncode == 2
    done = dropspin(*asked, "drop-ball-slipping", "fall-spin", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    reason = declined.stderr.strip().splitlines()[-1].removeprefix("dropspin: ")
    assert reason.startswith("no engine can be compared in drop-ball-slipping: wang[rotation=exact]")
    assert f"left out: {reason}" in done.stderr.splitlines()
    assert {row["scene"] for row in json.loads((tmp_path / "out" / "tradeoff.json").read_text())} == {"fall-spin"}


def test_budget_is_an_option_with_the_default_of_the_study(tmp_path):
    """A budget that any run exceeds ends every ladder at its first step, and the output says so."""
    [option] = [one for one in tradeoff_command.params if one.name == "budget"]
    assert option.default == BUDGET
    (tmp_path / "short.toml").write_text(SCENE)
    done = dropspin("tradeoff", "short.toml", "-e", "mujoco", "-e", "pybullet", "--budget", "1e-9", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    output = " ".join(done.stdout.split())
    assert "because the budget of 1e-09 s of processor time was spent (option --budget): mujoco at 62.5 ms, pybullet at 62.5 ms." in output
    assert {row["dt"] for row in json.loads((tmp_path / "out/tradeoff.json").read_text())} == {0.0625}
    refused = dropspin("tradeoff", "short.toml", "--budget", "inf", cwd=tmp_path)
    assert (refused.returncode, "inf is not in the range" in refused.stderr) == (2, True)


def test_a_scene_without_an_exact_solution_is_refused(tmp_path):
    tumbling = "[start]\nposition = [0.0, 1.0, 0.0]\norientation = [0.1, 0.2, 0.3, 0.9]\nangular_velocity = [1.0, 2.0, 3.0]\n"
    floor = "[gravity]\nacceleration = [0.0, -9.81, 0.0]\n[floor]\nrestitution = 0.6\nfriction = 0.3\n[damping]\nlinear = 0.1\n"
    (tmp_path / "mine.toml").write_text(SCENE.partition("[start]")[0] + tumbling + floor)
    done = dropspin("tradeoff", "mine.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "mine has no exact solution to compare with" in done.stderr
    assert list(tmp_path.iterdir()) == [tmp_path / "mine.toml"]


@pytest.mark.parametrize("worlds", ["0", "1,-2", "1.5", "many", "1,,2", ""])
def test_worlds_that_are_no_whole_numbers_are_refused(worlds, tmp_path):
    refused = dropspin("tradeoff", "--worlds", worlds, cwd=tmp_path)
    assert refused.returncode == 2
    assert "is not a list of whole numbers above 0, such as 1,256,4096" in " ".join(refused.stderr.split())


@pytest.mark.extended
def test_each_number_of_worlds_has_a_cost_and_a_recommendation(tmp_path):
    """And there is a plot of the throughput; an engine without batches has no cost per world."""
    (tmp_path / "short.toml").write_text(SCENE)
    done = dropspin(
        *("tradeoff", "short.toml", "-e", "wang[rotation=rk4]", "-e", "pybullet", "--worlds", "2,16", "--budget", "0.5"),
        *("--within", "0.1", "-o", "out"),
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    output = " ".join(done.stdout.split())
    for worlds in (2, 16):
        assert f"In a batch of {worlds}, the cheapest is wang[rotation=rk4] at " in output
    rows = json.loads((tmp_path / "out/tradeoff.json").read_text())
    for row in rows:
        costs = [row["cost_per_world_2"], row["cost_per_world_16"]]
        assert costs == [None, None] if row["engine"] == "pybullet" else all(cost > 0.0 for cost in costs)
    [picture] = [part for part in read_study(str(tmp_path / "out")).parts if part.kind == "charts"]
    assert picture.charts[-1].x_label == "number of worlds in a batch"


BROKEN = """
import dropspin as ds

class Broken(ds.Engine):
    name = "broken"
    def prepare(self, scene, dt):
        raise RuntimeError("no licence")
"""


def test_engine_that_breaks_down_or_is_missing_costs_its_rows_and_the_exit_code(tmp_path):
    """The others are written; if there are none, the code is not that of bad usage."""
    (tmp_path / "short.toml").write_text(SCENE)
    (tmp_path / "broken_engine.py").write_text(BROKEN)
    asked = ("tradeoff", "short.toml", "--budget", "1e-9", "-e", "broken_engine:Broken", "-o", "out")
    alone = dropspin(*asked, cwd=tmp_path)
    assert (alone.returncode, "broken: RuntimeError: no licence." in alone.stderr) == (3, True)
    assert not (tmp_path / "out").exists()
    beside = dropspin(*asked, "-e", "wang[rotation=exact]", cwd=tmp_path)
    assert beside.returncode == 3
    assert "Left out: broken, RuntimeError: no licence." in " ".join(beside.stdout.split())
    rows = json.loads((tmp_path / "out" / "tradeoff.json").read_text())
    assert [(row["engine"], row["ladder_ended"]) for row in rows] == [("broken", "not_run"), ("wang[rotation=exact]", "budget")]


@pytest.mark.parametrize(
    ("verdict", "named", "code"),
    [("missing", True, 3), ("missing", False, 0), ("declined", True, 0), ("crashed", False, 3), (None, True, 0)],
)
def test_exit_code_is_that_of_the_worst_engine(verdict, named, code):
    assert exit_code([None, verdict], named=named) == code
