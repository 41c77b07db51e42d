"""The study of extremes as people read it: files, sentences, maps."""

import csv
import json
import math
from dataclasses import replace

import pytest
from click.testing import CliRunner

from comparisons.robustness import AXES, AxisScan, Mapped, Point, RobustnessStudy
from comparisons.robustness.failure_modes import Diagnosis
from reports import plots
from reports.commands.main import dropspin
from reports.views import limits as extremes
from scenarios import load

SPIN = load("spin-principal")


def line(engine, conditions, axis="spin"):
    """An engine with a condition at 1, 10, … rad/s, of which the first is the scene's own."""
    points = tuple(Point(10.0**n, Diagnosis(one, "orientation_error", 0.2, "it is off by 0.2")) for n, one in enumerate(conditions))
    return AxisScan(SPIN, AXES[axis], engine, 1.0, points)


@pytest.fixture
def study():
    lines = (
        line("a", ["sound", "sound", "diverged"]),
        line("b", ["sound", "clamped", "clamped"]),
        line("a", ["sound", "inaccurate"], "step"),
    )
    planes = (Mapped(SPIN, (AXES["spin"], AXES["inertia-ratio"]), "a", ((1.0, lines[0]), (10.0, lines[1]))),)
    return RobustnessStudy(SPIN, 5e-3, 0.1, lines, planes, {"c": "not installed"})


def test_sentences(study):
    """Where, what, in whom, how it shows, who is spared; an edge with as many digits as tell its two values apart."""
    told = extremes.sentences([study])
    assert (
        told[0] == "spin-principal, spin above 1 rad/s (between 0.005 and 0.05 rad a step): clamped in b; it is off by 0.2. Sound there: a."
    )
    assert "step above 1 s (between 5 and 50 rad a step): inaccurate in a" in "".join(told)


def test_tables(study):
    assert extremes.step_rows([study]) == [
        {"scene": "spin-principal", "engine": "a", "accurate up to": "1 s, 5 rad", "stable up to": "10 s, 50 rad"}
    ]
    ranges = extremes.range_rows([study])
    assert [ranges[0][key] for key in ("axis", "sound from", "to", "beyond")] == ["spin [rad/s]", "1", "10", "diverged at 100"]


def test_ranges():
    """Both ways from the scene's own value, as far as it is sound all the way; none if it is not there."""
    found = line("a", ["sound", "inaccurate", "sound", "sound", "sound", "clamped", "sound"])
    study = RobustnessStudy(SPIN, 5e-3, 0.1, (replace(found, base=1e3), replace(found, base=10.0), line("a", ["sound"])), (), {})
    told = [(row["sound from"], row["to"], row["beyond"]) for row in extremes.range_rows([study])]
    assert told == [
        ("100", "1e+04", "inaccurate at 10; clamped at 1e+05"),
        ("–", "–", "inaccurate as it is: it is off by 0.2"),
        ("1", "1", "as far as was looked"),
    ]


def test_files(study, tmp_path):
    """Each point once, numbers as numbers; the page names its pictures, which are there."""
    extremes.write([study], tmp_path)
    with (tmp_path / "limits.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 + 3 + 2 + 6
    assert {row["across_value"] for row in rows} == {"", "1.0", "10.0"}
    content = json.loads((tmp_path / "limits.json").read_text(encoding="utf-8"))
    assert [row["condition"] for row in content[:3]] == ["sound", "sound", "diverged"]
    page = (tmp_path / "limits.md").read_text(encoding="utf-8")
    for name in ("spin-principal.svg", "spin-principal-spin-inertia-ratio.svg"):
        assert f"({name})" in page
        assert (tmp_path / name).stat().st_size > 1000
    assert "Left out: c, not installed." in page


def test_a_map_changes_colour_half_way_between_two_points(study):
    """On the axis's own scale: 1 and 10 meet at √10, 10 and 100 at √1000; a condition that goes on is one bar."""
    import matplotlib.pyplot as plt

    axes = plt.size().gca()
    plots.plot_conditions(study, "spin", axes)
    bars = [(patch.get_y() + 0.5 * patch.get_height(), patch.get_x(), patch.get_x() + patch.get_width()) for patch in axes.patches]
    plt.close("all")
    expected = [(0, 0.0, 1.5), (0, 1.5, 2.0), (1, 0.0, 0.5), (1, 0.5, 2.0)]
    assert bars == [pytest.approx((row, math.log(10) * left, math.log(10) * right)) for row, left, right in expected]
    assert axes.get_legend_handles_labels()[1] == ["sound", "diverged", "clamped"]


def test_from_the_command_line(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    asked = ["limits", "spin-principal", "-e", "mujoco", "-e", "pybullet", "--axis", "step", "--pair", "spin,mass"]
    result = CliRunner().invoke(dropspin, asked)
    assert result.exit_code == 0, result.output
    first, *_ = result.stdout.splitlines()
    assert first.startswith("1. spin-principal, step above 0.158 s (between 0.79")
    assert "inaccurate, all of a sudden, in pybullet; orientation error is" in first
    assert (tmp_path / "out/limits/spin-principal-spin-mass.svg").exists()
    told = CliRunner().invoke(dropspin, [*asked[:6], "--axis", "mass", "--json"])
    assert {row["condition"] for row in json.loads(told.stdout)} == {"sound", "declined"}


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (["--axis", "spinn"], "axis 'spinn' is unknown. Did you mean 'spin'?"),
        (["--axis", "height"], "axis 'height': spin-principal has none; it has step, spin"),
        (["--pair", "spin"], "name two axes, such as spin,inertia-ratio"),
        (["-e", "mujocoo"], "engine 'mujocoo' is unknown."),
        (["--dt", "7"], "dt: got 7.0 s"),
        (["--within", "nan"], "within: got nan"),
        (["--pair", "spin,spin"], "a pair is of two different axes"),
        (["--time-limit", "nan"], "is no time in seconds"),
    ],
)
def test_bad_input(asked, said, capfd, monkeypatch):
    import sys

    from reports.commands import main as cli

    monkeypatch.setattr(sys, "argv", ["dropspin", "limits", "spin-principal", *asked])
    with pytest.raises(SystemExit) as end:
        cli.main()
    assert end.value.code == 2
    assert said in capfd.readouterr().err
