"""Expectations: which of them bind an engine at a step, and the bounds they give."""

import math

import numpy as np
import pytest

from dropspin import scenarios
from dropspin.comparisons.engines.base import KnownLimitation
from dropspin.comparisons.judging.convergence import Claim, Convergence, SeriesPoint
from dropspin.comparisons.judging.error_budget import ErrorBudget
from dropspin.comparisons.judging.expectations import compared_with_expectations, verify_expectations
from dropspin.comparisons.judging.judge import judge, judge_asymptotic_error
from dropspin.comparisons.judging.verdicts import with_reason
from dropspin.comparisons.measuring.metric import Average
from dropspin.comparisons.measuring.metrics import METRICS


def scene_that_expects(*expectations):
    content = {"duration": 1.0, "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0}}
    return scenarios.load(content | {"expect": [{"reason": "why"} | expectation for expectation in expectations]})


def verdict(scene, value, metric="energy_error", engine="mine", dt=1e-3):
    return compared_with_expectations(scene, engine, dt, METRICS[metric], value).verdict


def test_below_bounds_a_signed_metric_on_both_sides():
    """The bound itself is allowed; NaN is not."""
    scene = scene_that_expects({"metric": "energy_error", "below": 0.1})
    values = {0.1: "passed", -0.1: "passed", 0.11: "failed", -0.11: "failed", math.nan: "failed", math.inf: "failed"}
    assert {value: verdict(scene, value) for value in values} == values
    judgement = compared_with_expectations(scene, "mine", 1e-3, METRICS["energy_error"], 0.0)
    assert (judgement.lower, judgement.upper, judgement.reason) == (-0.1, 0.1, "why")


def test_above_and_within_bound_the_value():
    """`above` and `within` apply to the signed value."""
    scene = scene_that_expects({"metric": "energy_error", "above": 0.1})
    assert [verdict(scene, v) for v in (0.2, 0.05, -0.2, math.nan)] == ["passed", "failed", "failed", "failed"]
    scene = scene_that_expects({"metric": "energy_error", "within": [-0.2, -0.1]})
    assert [verdict(scene, v) for v in (-0.15, 0.15, -0.3, math.nan)] == ["passed", "failed", "failed", "failed"]


def test_metric_without_expectation_is_measured():
    """An expectation on another metric does not apply."""
    assert verdict(scene_that_expects({"metric": "penetration", "below": 1}), 5.0) == "measured"


@pytest.mark.parametrize(
    ("engine", "dt", "limit"),
    [("mine", 2e-3, 4), ("mine", 1e-3, 3), ("known", 2e-3, 2), ("known", 1e-3, 1), ("known[option=x]", 2e-3, 4)],
)
def test_narrowest_expectation_binds(engine, dt, limit):
    """Engine and step come first, then engine, then step, then all; an engine with an option is another engine."""
    scene = scene_that_expects(
        {"metric": "energy_error", "below": 4},
        {"metric": "energy_error", "below": 3, "dt": 1e-3},
        {"metric": "energy_error", "below": 2, "engine": "known"},
        {"metric": "energy_error", "below": 1, "engine": "known", "dt": [1e-3, 5e-4]},
    )
    assert compared_with_expectations(scene, engine, dt, METRICS["energy_error"], 0.0).upper == limit


FAULT = {"metric": "energy_error", "within": [0.2, 0.3], "engine": "faulty"}
FOR_ALL = {"metric": "energy_error", "below": 0.01}


@pytest.mark.parametrize(
    ("value", "engine", "expected"),
    [
        (0.25, "faulty", "known"),
        (0.25, "mine", "failed"),
        (0.31, "faulty", "failed"),
        (0.1, "faulty", "failed"),
        (0.001, "faulty", "passed"),
        (-0.25, "faulty", "failed"),
        (math.nan, "faulty", "failed"),
    ],
)
def test_fault_that_is_expected_by_name_is_known_and_never_passes(value, engine, expected):
    """It loosens nothing for other engines; a value that meets what all must meet passes, as the fault is gone."""
    assert verdict(scene_that_expects(FAULT, FOR_ALL), value, engine=engine) == expected


def test_known_fault_that_does_not_show_is_reported():
    judgement = compared_with_expectations(scene_that_expects(FAULT, FOR_ALL), "faulty", 1e-3, METRICS["energy_error"], 0.001)
    assert judgement.basis == "fault_absent"
    assert judgement.reason == "the known fault does not occur; its expectation can be removed: why"
    alone = compared_with_expectations(scene_that_expects(FAULT), "faulty", 1e-3, METRICS["energy_error"], 1e-9)
    assert (alone.verdict, alone.basis) == ("passed", "fault_absent")


@pytest.mark.parametrize("named", [{"below": 1e-6}, {"within": [0.001, 0.002]}])
def test_stricter_expectation_of_one_engine_is_a_check_and_no_fault(named):
    scene = scene_that_expects({"metric": "energy_error", "engine": "exact"} | named, FOR_ALL)
    assert verdict(scene, 0.005, engine="exact") == "failed"
    inside = 1e-7 if "below" in named else 0.0015
    assert verdict(scene, inside, engine="exact") == "passed"


@pytest.mark.parametrize(
    ("cause", "interval", "expected"),
    [
        ("model", (0.29, 0.35), "known"),
        ("model", (0.31, 0.35), "failed"),
        ("model", (-0.3, -0.2), "failed"),
        ("unresolved", (-0.1, 0.3), "measured"),
        ("discretisation", (-0.001, 0.001), "passed"),
    ],
)
def test_model_error_is_known_if_its_interval_meets_the_expected_one(cause, interval, expected):
    limit = Convergence(ErrorBudget(cause, "extrapolated", sum(interval) / 2, *interval), 1e-3)

    def judged(scene, engine):
        return judge_asymptotic_error(scene, Claim(engine, None, np.float64), METRICS["energy_error"], limit)

    found = judged(scene_that_expects(FAULT, FOR_ALL), "faulty")
    assert found.verdict == expected
    assert found.basis == ""  # a discretisation error that is a known fault occurs at every time step
    assert judged(scene_that_expects(FAULT), "mine").verdict != "known"


@pytest.mark.parametrize(("sign", "smallest", "expected"), [(1.0, 0.1, "known"), (-1.0, 0.1, "known"), (1.0, -0.1, "passed")])
def test_value_within_bounds_that_exclude_0_is_known_if_the_asymptotic_error_is(sign, smallest, expected):
    """The fault is expected by name at the finest time step alone; at the coarser one the bounds of all engines apply."""

    def within(least, most, **other):
        return {"metric": "energy_error", "within": sorted([sign * least, sign * most])} | other

    scene = scene_that_expects(within(smallest, 0.4), within(0.2, 0.45, engine="faulty", dt=1e-3))
    point = SeriesPoint(2e-3, 500, Average(*np.full((3, 1), 0.25 * sign)), None, 0.0)
    interval = sorted([0.24 * sign, 0.26 * sign])
    claim, limit = Claim("faulty", None, np.float64), Convergence(ErrorBudget("model", "extrapolated", 0.25 * sign, *interval), 1e-3)
    assert judge(scene, None, claim, METRICS["energy_error"], point, limit).verdict == expected
    assert judge(scene, None, claim, METRICS["energy_error"], point).verdict == "passed"


@pytest.mark.parametrize(("value", "expected"), [(0.05, "passed"), (0.095, "measured"), (0.105, "measured"), (0.15, "failed")])
@pytest.mark.parametrize("bound", [{"within": [-0.1, 0.1]}, {"within": [-9.0, 0.1]}, {"below": 0.1}])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_sampling_noise_that_may_decide_between_verdicts_leaves_none(value, expected, bound, sign):
    """On both sides of a bound."""
    if sign < 0.0:
        bound = {"within": sorted(-limit for limit in bound["within"])} if "within" in bound else bound
    point = SeriesPoint(1e-3, 1000, Average(*np.full((3, 1), sign * value)), None, 0.0, noise=0.01)
    scene = scene_that_expects({"metric": "energy_error"} | bound)
    found = judge(scene, None, Claim("mine", None, np.float64), METRICS["energy_error"], point)
    assert (found.verdict, found.basis) == (expected, "few_starts" if expected == "measured" else "")


@pytest.mark.parametrize(("cause", "said"), [("setting", True), ("model", False)])
def test_failure_by_a_setting_is_called_a_setting_error(cause, said):
    limit = Convergence(ErrorBudget(cause, "extrapolated", 0.2, 0.1, 0.3), 1e-3)
    found = judge_asymptotic_error(scene_that_expects(), Claim("mine", None, np.float64), METRICS["energy_error"], limit)
    assert (found.verdict, found.reason.endswith("it is a setting error")) == ("failed", said)


def test_outcome_has_its_reason_in_brackets():
    assert (with_reason("failed", "diverged"), with_reason("failed", "")) == ("failed (diverged)", "failed")


def test_equally_narrow_expectations_both_bind():
    """The tighter bound of each side counts."""
    scene = scene_that_expects({"metric": "energy_error", "below": 4}, {"metric": "energy_error", "within": [-9, 1]})
    judgement = compared_with_expectations(scene, "mine", 1e-3, METRICS["energy_error"], 0.0)
    assert (judgement.lower, judgement.upper) == (-4, 1)


def test_known_limitation_excuses_failures_of_its_metric_and_size_only():
    """A failed value within the explained error is limited; a larger one, another metric and NaN stay failed."""
    claim = Claim("mine", None, np.float64, (KnownLimitation("contacts slip", {"energy_error": 0.02}),))
    bounds = [{"metric": name, "below": 1e-3, "reason": "too large"} for name in ("energy_error", "penetration")]
    scene = scene_that_expects(*bounds)

    def excused(value, metric="energy_error"):
        return judge(scene, None, claim, METRICS[metric], SeriesPoint(1e-3, 1000, Average(*np.full((3, 1), value)), None, 0.0))

    assert (excused(-0.02).verdict, excused(0.02).reason) == ("limited", "contacts slip; reason of the bound: too large")
    assert [excused(0.021).verdict, excused(math.nan).verdict, excused(0.01, "penetration").verdict] == ["failed"] * 3
    assert (excused(1e-4).verdict, excused(1e-4).reason) == ("passed", "too large")
    uncertain = Convergence(ErrorBudget("model", "extrapolated", 0.021, 0.0195, 0.0225), 1e-3)
    assert judge_asymptotic_error(scene, claim, METRICS["energy_error"], uncertain).verdict == "limited"
    wide = Convergence(ErrorBudget("model", "", -0.0198, -0.0253, -0.0001), 1e-3, finest_error=-0.0188, largest_error=0.0188)
    smaller = Claim("mine", None, np.float64, (KnownLimitation("contacts slip", {"energy_error": 0.001}),))
    assert judge_asymptotic_error(scene, smaller, METRICS["energy_error"], wide).verdict == "failed"
    # Of an error that grows with finer time steps, and of one that changes its sign near the finest.
    for finest_error, largest_error, verdict in ((-0.019, 0.019, "limited"), (-0.024, 0.024, "failed"), (0.001, 0.05, "failed")):
        grown = Convergence(ErrorBudget("model", "", -0.03, -0.035, -0.025), 1e-3, finest_error=finest_error, largest_error=largest_error)
        assert judge_asymptotic_error(scene, claim, METRICS["energy_error"], grown).verdict == verdict


@pytest.mark.parametrize(
    ("expectation", "message"),
    [
        ({"metric": "energy_eror"}, r"^scene\['expect'\]\[0\]\['metric'\]: got 'energy_eror'; no such metric\..*energy_error"),
        (
            {"metric": "restitution_error"},
            r"restitution_error'; it needs an exact impact with Newton's restitution, which this scene does not have",
        ),
        ({"metric": "energy_error", "engine": "mujocco"}, r"^scene\['expect'\]\[0\]\['engine'\]: got 'mujocco'; no such engine\..*mujoco"),
        ({"metric": "energy_error", "engine": "mujoco[integrator=euler]"}, r"write it as 'mujoco', as the results do"),
        ({"metric": "energy_error", "engine": "wang[law=nune]"}, r"wang\[law=nune\]'; .*nune"),
    ],
)
def test_expectation_that_cannot_be_judged_is_refused(expectation, message):
    """The message names the key, the value and what is allowed."""
    scene = scene_that_expects(expectation | {"below": 1.0})
    with pytest.raises(scenarios.SceneError, match=message):
        verify_expectations(scene, scenarios.truth_for(scene), [])
