"""`dropspin limits` in words, files and figures."""

import csv
import json
import math
from dataclasses import replace

import pytest
from support.cli import TERMINAL

from dropspin.comparisons.limits.axes import AXES
from dropspin.comparisons.limits.failure_modes import Diagnosis
from dropspin.comparisons.limits.study import AxisScan, LimitsStudy, ScanPoint
from dropspin.reports import plots
from dropspin.reports.stories import limits
from dropspin.reports.study_files import write_study
from dropspin.reports.terminal.rows import print_rows
from dropspin.scenarios import load

SPIN = load("spin-principal")


def scan(engine, modes, axis="spin"):
    """An engine with a failure mode at 1, 10, … rad/s, of which the first is the scene's nominal value."""
    points = tuple(ScanPoint(10.0**n, Diagnosis(one, "orientation_error", 0.2, "it is off by 0.2")) for n, one in enumerate(modes))
    return AxisScan(AXES[axis], engine, 1.0, points)


def points_of(mode, message="it is off by 0.2 rad (tolerance 0.1)", dt=5e-3):
    return ScanPoint(dt, Diagnosis(mode, "orientation_error", 0.2, message if mode != "sound" else ""))


@pytest.fixture
def study():
    scans = (
        scan("a", ["sound", "sound", "diverged"]),
        scan("b", ["sound", "clamped", "clamped"]),
        scan("a", ["sound", "inaccurate"], "step"),
    )
    refinements = {"a": (points_of("sound", dt=1.0),), "b": (points_of("inaccurate"), points_of("sound", dt=2.5e-3))}
    return LimitsStudy(SPIN, 5e-3, 0.1, scans, {"c": "not installed"}, refinements)


def test_tables_of_largest_steps_and_of_sound_ranges(study):
    assert limits.step_rows([study]) == [
        {
            "scene": "spin-principal",
            "engine": "a",
            "accurate up to": "1 s (5 rad per step)",
            "stable up to": "10 s (50 rad per step), the largest tested",
        }
    ]
    ranges = limits.range_rows(study)
    assert ranges[0] == {
        "axis": "spin [rad/s]",
        "engine": "a",
        "sound from": "1",
        "to": "10",
        "beyond": "diverged at 100; no smaller value tested",
    }


def test_values_at_which_the_exact_solution_ends_early_are_said(study):
    """Of all engines, and with the times; the tables of values have the time of each."""
    parts = [replace(one, points=tuple(_until(point, 2.0 * one.base / point.value) for point in one.points)) for one in study.scans[:2]]
    found = replace(study, scans=(*parts, study.scans[2]))
    [sentence] = [text for text in limits.sentences(found) if "exact solution" in text]
    ends = "the exact solution ends before the motion, after 20 ms to 200 ms; later errors are not judged"
    assert sentence == f"Axis spin [rad/s]: at 2 values, 10 to 100, {ends}."
    rows = limits.Limits(scenes=[found]).rows()
    assert [row["compared_until"] for row in rows if row["axis"] == "spin"] == [None, 0.2, 0.02] * 2


def _until(point, time):
    return replace(point, diagnosis=point.diagnosis._replace(compared_until=time if time < 1.0 else None))


def test_data_of_a_chart_name_the_positions_along_its_axis(study):
    assert [plots.failure_modes(study, axis).x_name for axis in ("spin", "step")] == ["log of spin [rad/s]", "log of step [s]"]


def test_sound_range_around_the_nominal_value():
    """Both ways from the scene's nominal value, as far as every point is sound; none if the nominal value is not."""
    found = scan("a", ["sound", "inaccurate", "sound", "sound", "sound", "clamped", "sound"])
    masses = scan("a", ["sound"] * 4, "mass"), scan("b", ["sound"] * 4, "mass")
    changing = scan("b", ["sound", "sound", "inaccurate"], "mass")
    scans = (replace(found, base=1e3), replace(found, base=10.0), scan("a", ["sound"] * 4), *masses, changing)
    study = LimitsStudy(SPIN, 5e-3, 0.1, scans, {}, {"b": (points_of("inaccurate"),)})
    assert [(row["sound from"], row["to"], row["beyond"]) for row in limits.range_rows(study)] == [
        ("100", "1e+04", "inaccurate at 10; clamped at 1e+05"),
        ("–", "–", "inaccurate at the nominal value, 10; sound at 5 of 7 tested values"),
        ("1", "1000", "not tested; sound at all 4 tested values"),
        ("1", "1000", "not tested; the same motion at all 4 tested values"),
        ("–", "–", "inaccurate at the nominal value; the same motion at all 4 tested values"),
        ("–", "–", "inaccurate at the nominal value; the same motion from 1 to 10; inaccurate at 100"),
    ]


def test_figure_of_an_axis_that_does_not_change_the_motion_does_not_call_engines_sound():
    """An engine may have a failure mode at the nominal value, and so at each value at which its motion is the same."""
    masses = (scan("a", ["sound"] * 4, "mass"), scan("b", ["sound", "sound", "inaccurate"], "mass"))
    figure = plots.failure_modes(LimitsStudy(SPIN, 5e-3, 0.1, masses, {}, {"a": (points_of("inaccurate"),)}), "mass")
    assert [line.label for line in figure.lines] == ["same motion", "same motion", "inaccurate", "nominal value"]


def test_engine_that_is_accurate_at_no_step_has_the_smallest_one_tried():
    study = LimitsStudy(SPIN, 5e-3, 0.1, (scan("a", ["inaccurate", "inaccurate", "diverged"], "step"),), {}, {})
    [row] = limits.step_rows([study])
    assert (row["accurate up to"], row["stable up to"]) == ("inaccurate at 1 s, the smallest tested", "10 s (50 rad per step)")


def test_engine_that_is_not_sound_at_the_nominal_values_has_the_smaller_steps_tried(study):
    """With the error and the tolerance, at the nominal step and at the smallest, if that is not sound either; nothing of a sound engine."""
    never = (points_of("inaccurate"), points_of("gains_energy", dt=2.5e-3), points_of("inaccurate", "it is off by 0.15 rad", 1.25e-3))
    study.refinements.update(never=never, crashing=(points_of("crashed", "no such thing"),))
    assert limits.sentences(study) == [
        "b is not sound at the nominal values and dt = 5 ms: inaccurate, it is off by 0.2 rad (tolerance 0.1). "
        "Smaller time steps tried: sound at 2.5 ms. With --dt 0.0025 ranges are those around a sound run.",
        "never is not sound at the nominal values and dt = 5 ms: inaccurate, it is off by 0.2 rad (tolerance 0.1). "
        "Smaller time steps tried: gains energy at 2.5 ms; inaccurate at 1.25 ms. At 1.25 ms, the smallest tried, it is off by 0.15 rad.",
        "crashing is not sound at the nominal values and dt = 5 ms: crashed, no such thing. No smaller time step was tried.",
        "Left out: c, not installed.",
    ]


def test_message_of_a_crash_that_ends_a_sound_range_is_printed(study):
    """It may be an exception of the adapter, which is no limit of the engine."""
    crashing = replace(study, scans=(scan("a", ["sound", "crashed", "crashed"]), scan("a", ["sound", "inaccurate", "crashed"], "step")))
    assert limits.sentences(crashing)[1:-1] == ["a crashed at 10 on the axis spin [rad/s]: it is off by 0.2."]


def test_table_of_80_columns_keeps_words_and_numbers_whole(study, capsys, monkeypatch):
    for name, value in TERMINAL.items():
        monkeypatch.setenv(name, value)
    long = replace(study.scans[0], engine="pybullet[coordinates=multibody,velocity_clamp=kept]", axis=AXES["inertia-ratio"])
    print_rows(limits.range_rows(replace(study, scans=(*study.scans, long))))
    print_rows(limits.step_rows([replace(study, scans=(replace(long, axis=AXES["step"]),))]))
    output = capsys.readouterr().out
    assert max(map(len, output.splitlines())) <= 80
    for word in (
        "spin [rad/s]",
        "inertia-ratio",
        "diverged at 100",
        "clamped at 10",
        "tested",
        "pybullet[",
        "velocity_clamp=",
        "kept]",
        "multibody,",
    ):
        assert word in output


def test_axis_of_the_figure_holds_the_smaller_steps_of_every_engine():
    import matplotlib.pyplot as plt

    coarse, fine = scan("a", ["sound"] * 3, "step"), scan("b", ["inaccurate"] * 3, "step")
    fine = replace(fine, points=(points_of("sound", dt=1e-3), *fine.points))
    axes = plt.figure().gca()
    plots.plot_failure_modes(LimitsStudy(SPIN, 5e-3, 0.1, (coarse, fine), {}, {}), "step", axes)
    assert axes.get_xlim() == pytest.approx((math.log(1e-3), math.log(100.0)))
    plt.close("all")


def test_files_hold_each_point_once(study, tmp_path):
    """Numbers as numbers; the page names its pictures, which are there."""
    write_study(limits.Limits(scenes=[study]), tmp_path)
    with (tmp_path / "limits.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 3 + 3 + 2 + 2 + 1
    assert [float(row["value"]) for row in rows[:-1]] == [1.0, 10.0, 100.0, 1.0, 10.0, 100.0, 1.0, 10.0, 2.5e-3, 5e-3]
    assert [(row["engine"], row["axis"], row["failure_mode"], row["message"]) for row in rows[-3:]] == [
        ("b", "step", "sound", ""),
        ("b", "step", "inaccurate", "it is off by 0.2 rad (tolerance 0.1)"),
        ("c", "", "missing", "not installed"),
    ]
    content = json.loads((tmp_path / "limits.json").read_text(encoding="utf-8"))
    assert [row["failure_mode"] for row in content[:3]] == ["sound", "sound", "diverged"]
    page = (tmp_path / "limits.md").read_text(encoding="utf-8")
    assert "(spin-principal.svg)" in page
    assert (tmp_path / "spin-principal.svg").stat().st_size > 1000
    assert "Left out: c, not installed." in page
    assert "b is not sound at the nominal values and dt = 5 ms: inaccurate, it is off by 0.2 rad (tolerance 0.1)." in page


def test_bars_change_colour_half_way_between_two_points(study):
    """On the axis's own scale: 1 and 10 meet at √10, 10 and 100 at √1000; a failure mode that continues is one bar."""
    import matplotlib.pyplot as plt

    axes = plt.figure().gca()
    plots.plot_failure_modes(study, "spin", axes)
    plt.close("all")
    lines = [line for line in axes.get_lines() if line.get_label() != "nominal value"]
    bars = sorted((float(line.get_ydata()[0]), *map(float, line.get_xdata())) for line in lines)
    expected = [(0, 0.0, 1.5), (0, 1.5, 2.0), (1, 0.0, 0.5), (1, 0.5, 2.0)]
    assert bars == [pytest.approx((row, math.log(10) * left, math.log(10) * right)) for row, left, right in expected]
    assert axes.get_legend_handles_labels()[1] == ["sound", "clamped", "diverged", "nominal value"]
