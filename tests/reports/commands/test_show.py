"""`dropspin list`, `dropspin show` and `dropspin doctor`."""

import json
import sys

import pytest
from support.cli import dropspin

from dropspin.scenarios import load, names, reference_for


@pytest.mark.parametrize("what", ["scenes", "engines", "metrics"])
def test_list_prints_the_same_as_a_table_and_as_json(what, tmp_path):
    """A table for people, JSON for programs; scenes by default."""
    table = dropspin("list", what, cwd=tmp_path)
    data = json.loads(dropspin("list", what, "--json", cwd=tmp_path).stdout)
    assert table.returncode == 0
    for row in data:
        assert next(iter(row.values())) in table.stdout
    if what == "scenes":
        assert dropspin("list", cwd=tmp_path).stdout == table.stdout


@pytest.mark.extended
def test_listed_exact_solutions_are_those_of_truth_for(tmp_path):
    """The list reads them from scenarios/problems.toml, where a new scene of the catalogue has a line."""
    truths = {name: reference_for(load(name)) for name in names()}
    listed = {row["scene"]: row["truth"] for row in json.loads(dropspin("list", "--json", cwd=tmp_path).stdout)}
    assert listed == {name: truth.name if truth else "none known" for name, truth in truths.items()}


def test_show_prints_a_scene_or_what_an_engine_builds_of_it(tmp_path):
    """What is modelled, what is left out, the exact solution; an engine's settings; a scene that it declines."""
    shown = dropspin("show", "spin-asymmetric", cwd=tmp_path).stdout
    assert "gravity, floor, damping" in shown
    assert "elliptic" in shown
    settings = dropspin("show", "drop-ball", "-e", "mujoco", "--dt", "0.002", cwd=tmp_path).stdout
    assert "0 -750" in settings
    declined = dropspin("show", "drop-ball", "-e", "mujoco[integrator=rk4]", cwd=tmp_path).stdout
    assert "declines drop-ball" in declined.replace("\n", " ")


def test_doctor_reports_that_every_installed_engine_steps(tmp_path):
    rows = {row["what"]: row["found"] for row in json.loads(dropspin("doctor", "--json", cwd=tmp_path).stdout)}
    assert rows["engine wang"].startswith("works")
    assert rows["engine mujoco"].startswith("works")
    assert rows["python"] == sys.version.split()[0]
