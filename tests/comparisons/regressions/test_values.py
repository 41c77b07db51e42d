"""What counts as a change, and the tolerances of comparable results."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dropspin.comparisons.measuring.metric import Average
from dropspin.comparisons.measuring.tolerances import tolerance
from dropspin.comparisons.regressions.changes import KEY, changes, comparable_results, most_changed_first
from dropspin.scenarios import load


@given(
    st.floats(-1e3, 1e3),
    st.floats(-1e3, 1e3),
    st.floats(1e-12, 1.0),
    st.sampled_from(["truth", "invariant", "asymptotic_error", "order", "ensemble"]),
)
def test_kinds_of_change(old, new, tolerance, kind):
    """Beyond the tolerance: worse is farther from 0, or a lower order; moved is on the other side of 0, or another mean."""

    def one(value):
        return pd.DataFrame([dict.fromkeys(KEY, "x") | {"kind": kind, "value": value, "tolerance": tolerance, "unit": "1"}])

    [change] = changes(one(old), one(new))["change"]
    if kind == "order":
        expected = "worse" if new < old - tolerance else "better" if new > old + tolerance else "same"
    elif kind == "ensemble":
        expected = "same" if old - tolerance <= new <= old + tolerance else "moved"
    elif not min(0.0, old) - tolerance <= new <= max(0.0, old) + tolerance:
        expected = "worse" if abs(new) > abs(old) + tolerance else "moved"
    else:
        expected = "better" if abs(new) < abs(old) - tolerance else "same"
    assert change == expected


@pytest.mark.parametrize(
    ("errors", "order", "change"),
    [
        ((0.5, 0.5), 0.995, "lower"),
        ((0.5, 1.0), 0.995, "lower"),
        ((0.5, 0.5), 0.85, "worse"),
        ((1.0, 1.0), 0.995, "worse"),
        ((0.5, 1.5), 0.995, "worse"),
    ],
)
def test_order_that_is_a_little_lower_because_errors_are_better_is_not_worse(errors, order, change):
    def results(values, order):
        rows = [{"steps": steps, "kind": "truth", "value": value} for steps, value in zip(("0.002", "0.001"), values, strict=True)]
        rows.append({"steps": "0.002, 0.001", "kind": "order", "value": order})
        return pd.DataFrame([dict.fromkeys(KEY, "x") | {"tolerance": 1e-9, "unit": "1"} | row for row in rows])

    found = changes(results((1.0, 1.0), 1.0), results(errors, order))
    assert found.set_index("kind")["change"]["order"] == change


def test_tolerances_come_from_how_a_result_was_measured():
    """One start phase of four in the neighbouring step; rounding by steps and scale; no share of the value."""
    phases = np.array([[1.0, 5.0], [1.0, 5.4], [1.0, 5.4], [1.0, 5.4]])
    average = Average(phases.mean(axis=0), np.zeros(2), np.ptp(phases, axis=0) / 4)
    assert average.jump == pytest.approx(0.1)
    free, ball = load("spin-asymmetric"), load("drop-ball")
    eps = np.finfo(float).eps
    assert tolerance(free, "rad", np.float64, 900, 0.0) == pytest.approx(1e-12 + 16 * eps * 30, rel=1e-15)
    assert tolerance(free, "rad", np.float32, 900, 0.0) == pytest.approx(1e-12 + 16 * np.finfo(np.float32).eps * 30, rel=1e-15)
    assert tolerance(ball, "1", np.float64, 900, 0.25) == pytest.approx(0.25 + 3e-8 + 1e-12 + 16 * eps * 30, rel=1e-15)
    length = ball.body.size + np.linalg.norm(ball.start.position)
    assert tolerance(ball, "m", np.float64, 0, 0.0) == pytest.approx((3e-8 + 1e-12) * length, rel=1e-15)


def test_tolerance_of_a_single_start_is_its_sensitivity_to_rounding(before):
    """The tumble's tolerance is what a start some eps off leads to: far below its error, above rounding alone."""
    held = comparable_results(before)
    tumble = held[(held["scene"] == "spin-asymmetric") & (held["metric"] == "orientation_error") & (held["kind"] == "truth")]
    assert len(tumble) == 6  # two engines, three time steps
    assert (tumble["tolerance"] < 1e-9).all()  # measured 1e-11 to 1e-10
    assert (tumble["tolerance"] > 1e-12).all()


def test_fits_to_several_time_steps_are_listed_after_the_errors_that_they_follow_from():
    """A limit of 1e-14 has a tolerance of 1e-13, of which any error is very many."""
    rows = pd.DataFrame({"metric": "energy_error", "kind": ["asymptotic_error", "truth", "order"], "in_tolerances": [1e6, 30.0, 2.0]})
    assert most_changed_first(rows)["kind"].tolist() == ["truth", "asymptotic_error", "order"]
