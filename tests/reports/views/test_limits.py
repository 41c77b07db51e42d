"""`dropspin limits` in words, files and figures."""

import csv
import json
import math
from dataclasses import replace

import pytest

from comparisons.robustness.axes import AXES
from comparisons.robustness.failure_modes import Diagnosis
from comparisons.robustness.scan import AxisScan, ScanPoint
from comparisons.robustness.study import RobustnessStudy
from reports import plots
from reports.study_files import write_limits
from reports.views import limits
from scenarios import load

SPIN = load("spin-principal")


def scan(engine, modes, axis="spin"):
    """An engine with a failure mode at 1, 10, … rad/s, of which the first is the scene's nominal value."""
    points = tuple(ScanPoint(10.0**n, Diagnosis(one, "orientation_error", 0.2, "it is off by 0.2")) for n, one in enumerate(modes))
    return AxisScan(SPIN, AXES[axis], engine, 1.0, points)


@pytest.fixture
def study():
    scans = (
        scan("a", ["sound", "sound", "diverged"]),
        scan("b", ["sound", "clamped", "clamped"]),
        scan("a", ["sound", "inaccurate"], "step"),
    )
    return RobustnessStudy(SPIN, 5e-3, 0.1, scans, {"c": "not installed"})


def test_tables_of_largest_steps_and_of_sound_ranges(study):
    assert limits.step_rows([study]) == [
        {"scene": "spin-principal", "engine": "a", "accurate up to": "1 s, 5 rad", "stable up to": "10 s, 50 rad"}
    ]
    ranges = limits.range_rows([study])
    assert [ranges[0][key] for key in ("axis", "sound from", "to", "beyond")] == ["spin [rad/s]", "1", "10", "diverged at 100"]


def test_sound_range_around_the_nominal_value():
    """Both ways from the scene's nominal value, as far as every point is sound; none if the nominal value is not."""
    found = scan("a", ["sound", "inaccurate", "sound", "sound", "sound", "clamped", "sound"])
    study = RobustnessStudy(SPIN, 5e-3, 0.1, (replace(found, base=1e3), replace(found, base=10.0), scan("a", ["sound"])), {})
    assert [(row["sound from"], row["to"], row["beyond"]) for row in limits.range_rows([study])] == [
        ("100", "1e+04", "inaccurate at 10; clamped at 1e+05"),
        ("–", "–", "inaccurate at the nominal value: it is off by 0.2"),
        ("1", "1", "not within the range tested"),
    ]


def test_files_hold_each_point_once(study, tmp_path):
    """Numbers as numbers; the page names its pictures, which are there."""
    write_limits([study], tmp_path)
    with (tmp_path / "limits.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 + 3 + 2
    assert [float(row["value"]) for row in rows] == [1.0, 10.0, 100.0, 1.0, 10.0, 100.0, 1.0, 10.0]
    content = json.loads((tmp_path / "limits.json").read_text(encoding="utf-8"))
    assert [row["failure_mode"] for row in content[:3]] == ["sound", "sound", "diverged"]
    page = (tmp_path / "limits.md").read_text(encoding="utf-8")
    assert "(spin-principal.svg)" in page
    assert (tmp_path / "spin-principal.svg").stat().st_size > 1000
    assert "Left out: c, not installed." in page


def test_bars_change_colour_half_way_between_two_points(study):
    """On the axis's own scale: 1 and 10 meet at √10, 10 and 100 at √1000; a failure mode that continues is one bar."""
    import matplotlib.pyplot as plt

    axes = plt.figure().gca()
    plots.plot_failure_modes(study, "spin", axes)
    bars = [(patch.get_y() + 0.5 * patch.get_height(), patch.get_x(), patch.get_x() + patch.get_width()) for patch in axes.patches]
    plt.close("all")
    expected = [(0, 0.0, 1.5), (0, 1.5, 2.0), (1, 0.0, 0.5), (1, 0.5, 2.0)]
    assert bars == [pytest.approx((row, math.log(10) * left, math.log(10) * right)) for row, left, right in expected]
    assert axes.get_legend_handles_labels()[1] == ["sound", "diverged", "clamped"]
