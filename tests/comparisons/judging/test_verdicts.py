"""Bounds and who they are for."""

import math

import pytest

import scenarios
from comparisons.judging.verdicts import judge
from comparisons.measuring.metrics import METRICS


def scene_that_expects(*expectations):
    content = {"duration": 1.0, "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0}}
    return scenarios.load(content | {"expect": [{"reason": "why"} | expectation for expectation in expectations]})


def verdict(scene, value, metric="energy_error", engine="mine", dt=1e-3):
    return judge(scene, engine, dt, METRICS[metric], value).verdict


def test_below_bounds_the_size():
    """Of a signed metric on both sides; the bound itself is allowed; NaN never is."""
    scene = scene_that_expects({"metric": "energy_error", "below": 0.1})
    values = {0.1: "passed", -0.1: "passed", 0.11: "failed", -0.11: "failed", math.nan: "failed", math.inf: "failed"}
    assert {value: verdict(scene, value) for value in values} == values
    judgement = judge(scene, "mine", 1e-3, METRICS["energy_error"], 0.0)
    assert (judgement.lower, judgement.upper, judgement.reason) == (-0.1, 0.1, "why")


def test_above_and_within_bound_the_value():
    """With its sign."""
    scene = scene_that_expects({"metric": "energy_error", "above": 0.1})
    assert [verdict(scene, v) for v in (0.2, 0.05, -0.2, math.nan)] == ["passed", "failed", "failed", "failed"]
    scene = scene_that_expects({"metric": "energy_error", "within": [-0.2, -0.1]})
    assert [verdict(scene, v) for v in (-0.15, 0.15, -0.3, math.nan)] == ["passed", "failed", "failed", "failed"]


def test_nothing_expected_is_measured():
    """Another metric's bound is nobody's."""
    assert verdict(scene_that_expects({"metric": "penetration", "below": 1}), 5.0) == "measured"


@pytest.mark.parametrize(
    ("engine", "dt", "limit"),
    [("mine", 2e-3, 4), ("mine", 1e-3, 3), ("known", 2e-3, 2), ("known", 1e-3, 1), ("known[option=x]", 2e-3, 4)],
)
def test_the_narrowest_expectation_binds(engine, dt, limit):
    """Engine and step, then engine, then step, then all; an option makes another engine."""
    scene = scene_that_expects(
        {"metric": "energy_error", "below": 4},
        {"metric": "energy_error", "below": 3, "dt": 1e-3},
        {"metric": "energy_error", "below": 2, "engine": "known"},
        {"metric": "energy_error", "below": 1, "engine": "known", "dt": [1e-3, 5e-4]},
    )
    assert judge(scene, engine, dt, METRICS["energy_error"], 0.0).upper == limit


def test_two_equally_narrow_ones_both_bind():
    """The tighter end of each."""
    scene = scene_that_expects({"metric": "energy_error", "below": 4}, {"metric": "energy_error", "within": [-9, 1]})
    judgement = judge(scene, "mine", 1e-3, METRICS["energy_error"], 0.0)
    assert (judgement.lower, judgement.upper) == (-4, 1)
