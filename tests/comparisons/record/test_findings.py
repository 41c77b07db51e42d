"""What a record says, on series made by hand: a value for each release of an engine, and the steps that are in them."""

import math

import numpy as np
import pytest

from dropspin.comparisons.record.findings import NEGLIGIBLE, Case, Release, changes, digits, periods, profile, read, successive
from dropspin.comparisons.record.plan import load_plan
from dropspin.comparisons.record.store import Record, machine
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.scenarios import DropspinError, load

LABEL, SCENE, DT, METRIC = "mujoco", "spin-asymmetric", 0.01, "orientation_error"


def measured(value, motion=None, verdict="measured"):
    """A case whose motion has the name `motion`, by default that of its value."""
    return Case(verdict, "", f"{value if motion is None else motion}", {METRIC: value} if verdict == "measured" else {})


def series(*cases, scene=SCENE):
    """Releases 1.0, 1.1, …, the first of which has the first case; None for a release that could not be installed."""
    return [
        Release(f"1.{number}", {} if case is None else {(LABEL, scene, DT): case}, "" if case else "no wheel", frozenset(), {})
        for number, case in enumerate(cases)
    ]


def steps(releases, engine="mujoco"):
    return [(change.before, change.release, change.old, change.new) for change in changes(engine, releases)]


def test_a_step_of_one_per_cent_is_found_in_its_release():
    own = series(*map(measured, [0.0127, 0.0127, 0.0127 * 1.01, 0.0127 * 1.01]))
    assert steps(own) == [("1.1", "1.2", 0.0127, 0.0127 * 1.01)]
    assert [[one.name for one in period] for period in periods(LABEL, own, changes("mujoco", own))] == [["1.0", "1.1"], ["1.2", "1.3"]]


def test_noise_of_rounding_is_no_step():
    """0.3e-12 is within what 30 s of steps of 10 ms may round in double precision; 1e-9 is not, but is in single precision."""
    noise = 0.0127 + np.random.default_rng(0).normal(0.0, 1e-13, 30)
    assert steps(series(*map(measured, noise))) == []
    near = series(measured(0.0127), measured(0.0127 + 1e-9))
    assert len(steps(near)) == 1
    assert steps(near, "rapier") == []


def test_rounding_of_an_error_above_its_scale_is_in_proportion_to_it():
    assert steps(series(measured(6385356.819724), measured(6385356.819723))) == []
    assert len(steps(series(measured(6385356.8), measured(6385357.8)))) == 1


def test_engines_in_single_precision_are_those_whose_adapters_say_so():
    """Of those that are installed here."""
    installed = {name: entry.engine for name in load_plan().engines if (entry := engine_entry(name)).engine is not None}
    assert {"mujoco", "rapier"} <= installed.keys()
    single = {name for name, own in load_plan().engines.items() if own.single_precision}
    assert {name for name, engine in installed.items() if engine.precision is np.float32} == single & installed.keys()


def test_residuals_of_a_contact_solver_are_no_step():
    assert steps(series(measured(0.0127), measured(0.0127 + 1e-8), scene="tip-box")) == []
    assert len(steps(series(measured(0.0127), measured(0.0127 + 1e-6), scene="tip-box"))) == 1


def test_equal_motions_are_equal_whatever_their_values_are():
    assert steps(series(measured(0.0127, "same"), measured(0.02, "same"), measured(0.03, "other"))) == [("1.1", "1.2", 0.02, 0.03)]


def test_a_release_that_could_not_be_installed_is_passed_over():
    own = series(measured(0.0127), None, measured(0.0127), None, measured(0.1))
    assert steps(own) == [("1.2", "1.4", 0.0127, 0.1)]
    assert [[one.name for one in period] for period in periods(LABEL, own, changes("mujoco", own))] == [["1.0", "1.2"], ["1.4"]]


def test_a_scene_that_is_no_longer_declined_is_a_step_and_an_undefined_value_is_none():
    own = series(measured(0.0, verdict="declined"), measured(math.nan, "a"), measured(0.1, "b"))
    assert [(one.release, one.metric, one.was.verdict, one.now.verdict) for one in changes("mujoco", own)] == [
        ("1.1", "", "declined", "measured")
    ]


def test_digits():
    assert digits(1e-3) == pytest.approx(3.0)
    assert [digits(error) for error in (0.0, 1e-300, 1.0, 40.0)] == [15.0, 15.0, 0.0, 0.0]
    assert math.isnan(digits(math.nan))


def test_performance_profiles_are_those_of_dolan_and_more():
    """By hand: the ratios of the first are 1, 4, 1, those of the second 2, 1 and none, as it fails in the third scene."""
    found = profile({"one": [0.1, 0.4, 1e-12], "two": [0.2, 0.1, math.inf]})
    assert found["one"][0] == pytest.approx([1.0, 4.0])
    assert found["one"][1] == pytest.approx([2 / 3, 1.0])
    assert found["two"][0] == pytest.approx([1.0, 2.0])
    assert found["two"][1] == pytest.approx([1 / 3, 2 / 3])


def test_profile_has_equal_rounding_errors_and_only_scenes_in_which_an_engine_was_measured():
    found = profile({"one": [1e-12, math.nan], "two": [0.9 * NEGLIGIBLE, math.inf], "three": [math.nan, math.nan]})
    assert {name: (list(ratios), list(shares)) for name, (ratios, shares) in found.items()} == {
        "one": ([1.0], [1.0]),
        "two": ([1.0], [0.5]),
    }


def row(scene=SCENE, **given):
    case = {"label": LABEL, "scene": scene, "scene_digest": load(scene).digest, "dt": DT, "metric": METRIC, "unit": "rad"}
    return case | {"verdict": "measured", "reason": "", "value": 0.1, "adapter": "a"} | given


def test_record_is_read_in_the_order_of_releases_for_one_machine_with_the_scenes_of_today(tmp_path):
    record, common = Record(tmp_path), machine()
    for release, adapter in (("1.10", "b"), ("1.9", "a"), ("1.2", "a")):
        rows = [row(adapter=adapter), row("tip-box", scene_digest="another")]
        record.write("mujoco", release, rows, common | {"versions": f"mujoco {release}, numpy {2 if adapter == 'b' else 1}"})
    record.write("mujoco", "1.3", [{"verdict": "missing", "reason": "not installable: no wheel"}], common)
    record.write("mujoco", "1.9", [row(value=0.3)], common | {"processor": "another"})
    [own] = read(tmp_path).values()
    assert [(one.name, one.reason, [case.values for case in one.cases.values()]) for one in own] == [
        ("1.2", "", [{METRIC: 0.1}]),
        ("1.3", "not installable: no wheel", []),
        ("1.9", "", [{METRIC: 0.1}]),
        ("1.10", "", [{METRIC: 0.1}]),
    ]
    assert successive([one for one in own if one.cases]) == {"1.9": [], "1.10": ["adapter a", "adapter b", "numpy 1", "numpy 2"]}


def test_record_without_a_result_is_refused(tmp_path):
    with pytest.raises(DropspinError, match="no release that was measured here"):
        read(tmp_path)
    Record(tmp_path).write("mujoco", "1.0", [row(scene_digest="another")], machine())
    with pytest.raises(DropspinError, match="as the catalogue defines it today"):
        read(tmp_path)
