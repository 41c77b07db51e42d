"""Errors taken apart: sequences whose order, limit and cause are known, because they were made up."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from comparisons.judging.error_budget import error_budget

H = np.array([4e-3, 2e-3, 1e-3])


def apart(errors, h=H, noise=0.0, floor=1e-12, claimed=None):
    return error_budget(np.asarray(h), np.asarray(errors, dtype=float), np.full(len(h), noise), np.full(len(h), floor), claimed)


@pytest.mark.parametrize("p", [1, 2, 3, 4])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_pure_power_has_its_order_and_no_limit(p, sign):
    """To rounding; all three steps are in the window."""
    found = apart(sign * 7.0 * H**p, floor=1e-30, claimed=p)
    assert found.cause == "discretisation"
    assert found.order == pytest.approx(p, abs=1e-9)
    assert abs(found.limit) <= 1e-9 * abs(7.0 * H[-1] ** p)
    assert found.window == tuple(H)


@pytest.mark.parametrize("p", [1, 2, 4])
@pytest.mark.parametrize("share", [1.0, 0.1, 1e-3])
def test_a_limit_that_is_not_zero_is_found_below_the_finest_error(p, share):
    """An error m + C hᵖ with m a thousandth of what the finest step shows: the model's, and m to rounding."""
    m = share * H[-1] ** p
    found = apart(m + H**p, floor=1e-30, claimed=p)
    assert found.cause == "model"
    assert found.order == pytest.approx(p, abs=1e-6)
    assert found.limit == pytest.approx(m, rel=1e-6)


coefficient = st.floats(-300.0, 300.0)


@given(coefficient, coefficient)
def test_powers_that_mix_are_never_called_a_model_error(second, third):
    """An error h + a h² + b h³, the higher powers up to a third of the first at the finest step: the limit is 0 within its uncertainty."""
    found = apart(H + second * H**2 + third * H**3)
    assert found.cause in ("discretisation", "unresolved")
    assert not abs(found.limit) > found.uncertainty or found.cause == "unresolved"


@given(st.floats(0.0, 2.0))
def test_a_little_first_order_in_a_second_order_error_is_no_model_error(first):
    """h² + ε h: three steps show an order between 1 and 2."""
    found = apart(H**2 + first * 1e-3 * H)
    assert found.cause == "discretisation"


@given(coefficient, st.floats(0.3, 3.0), st.sampled_from([-1.0, 1.0]))
def test_the_limit_is_within_its_uncertainty(second, share, sign):
    """An error m + h + a h² with m of the size of the finest error: wherever a limit is given with an order, it holds m."""
    m = sign * share * H[-1]
    found = apart(m + H + second * H**2)
    if found.cause == "model" and not math.isnan(found.order):
        assert abs(found.limit - m) <= found.uncertainty + 1e-15


@given(st.floats(0.1, 1.0), st.sampled_from([1.0, -1.0]))
def test_an_error_that_grows_or_saturates_within_a_step_is_no_model_error(rate, sense):
    """An error e^(±ah) - 1, as of methods that gain or lose energy, a times the coarsest step up to 2: all powers of the step."""
    found = apart(np.expm1(sense * rate * H / 2e-3))
    assert found.cause in ("discretisation", "unresolved")


def test_without_a_claim_a_higher_power_may_hide_a_lower_one():
    """An error m + h², m of the size of the finest error, may as well be h + h²: no model error unless the order is known to be 2."""
    errors = H[-1] ** 2 + H**2
    assert apart(errors, floor=1e-30).cause == "discretisation"
    assert apart(errors, floor=1e-30, claimed=2.0).cause == "model"


def test_what_is_never_negative_has_no_negative_limit():
    """Three sizes that point below 0 have not reached their power of the step."""
    errors = np.array([1.139, 0.5737, 0.2783])
    found = error_budget(H, errors, np.zeros(3), np.full(3, 1e-12), signed=False)
    assert found.cause == "discretisation"
    assert found.limit == pytest.approx(-0.017, abs=2e-3)
    assert error_budget(H, np.array([1.0, 0.9, 0.85]), np.zeros(3), np.full(3, 1e-12), signed=False).cause == "model"


def test_a_coarsest_step_in_trouble_of_its_own_is_no_high_order():
    """Two finer steps that halve and a coarse one far off fit order 4 with a limit; without a claim that is not believed."""
    errors = [4.035e-3, 4.522e-4, 2.321e-4]  # PyBullet's first contact of a box that turns
    assert apart(errors).cause == "discretisation"
    assert apart(errors, claimed=4.0).cause == "model"


def test_an_order_that_changes_from_step_to_step_is_not_asymptotic():
    """Only an order that stays may be held against a claim."""
    assert apart(H).is_asymptotic
    assert not apart(H + 100.0 * H**2).is_asymptotic


def test_a_plateau_is_the_model():
    """An error that no step changes, or that settles, by no power of the step; not one that goes on jumping about."""
    for errors in ([0.7531, 0.7530, 0.7530], [0.25, 0.26, 0.2545]):
        found = apart(errors, floor=1e-9)
        assert (found.cause, found.limit, found.reason) == ("model", errors[-1], "does not depend on the step")
    assert found.uncertainty == pytest.approx(0.01, rel=1e-6)
    assert apart([0.2545, 0.25, 0.26]).cause == "unresolved"


def test_a_count_is_no_power_of_the_step():
    """Though it halves with it."""
    found = error_budget(H, np.array([4.0, 2.0, 1.0]), np.zeros(3), np.full(3, 1e-12), jumps=True)
    assert (found.cause, found.reason) == ("discretisation", "shrinks, but as no power of the step")
    assert math.isnan(found.order)
    assert error_budget(H, np.zeros(3), np.zeros(3), np.full(3, 1e-12), jumps=True).cause == "rounding"


def test_an_error_that_grows_as_the_step_shrinks_is_the_model():
    """As when restitution vanishes with the step."""
    found = apart([0.1, 0.15, 0.25])
    assert found.cause == "model"
    assert "grows" in found.reason


def test_rounding():
    """At every step as small as rounding, in no order."""
    assert apart([3e-14, -1e-14, 5e-14]).cause == "rounding"
    assert apart([0.0, 0.0, 0.0]).cause == "rounding"
    assert apart([9e-14, 5e-14, 3e-14]).cause == "rounding"  # falls by chance


def test_fourth_order_down_to_rounding():
    """The finest step is left out, with the reason; errors below the rounding level count where they fall as a power."""
    found = apart([6.3e-12, 4.0e-13, 2.0e-13])
    assert found.cause == "discretisation"
    assert found.order == pytest.approx(4.0, abs=0.1)
    assert found.left_out == ((1e-3, "rounding"),)


def test_a_coarse_step_outside_the_asymptotic_range_is_left_out():
    """With more than three steps, the finest ones decide."""
    h = np.array([8e-3, 4e-3, 2e-3, 1e-3, 5e-4])
    errors = 3.0 * h**2
    errors[0] *= 5.0
    found = apart(errors, h, floor=1e-30)
    assert found.order == pytest.approx(2.0, abs=1e-9)
    assert found.left_out == ((8e-3, "too coarse"),)


def test_what_start_phases_do_not_resolve_is_no_model_error():
    """Noise of the size of the error: nothing is claimed but that it is small."""
    found = apart([5e-5, -2e-5, 1.5e-5], noise=1e-4)
    assert (found.cause, found.reason) == ("discretisation", "smaller at every step than the start phases resolve")
    assert math.isnan(found.order)
    assert found.uncertainty == pytest.approx(1e-4)


def test_noise_widens_the_limit():
    """The same series: a model error if measured exactly, not if its limit is finer than what was measured."""
    errors = 1e-4 + 5.0 * H
    assert apart(errors).cause == "model"
    assert apart(errors, noise=1e-3 * H[-1] * 200).cause == "discretisation"


@pytest.mark.parametrize(
    ("errors", "h"),
    [
        ([0.1, 0.05], [2e-3, 1e-3]),
        ([0.1, 0.09, 0.08], [2e-3, 1.9e-3, 1.8e-3]),
        ([math.nan, 0.1, 0.05], H),
        ([0.1, -0.1, 0.09], H),
    ],
)
def test_what_cannot_be_told_is_unresolved(errors, h):
    """Too few steps, too narrow a range, a step that gave no number, an error that jumps about."""
    assert apart(errors, np.asarray(h)).cause == "unresolved"


def test_an_error_that_hardly_changes_stays():
    """A quarter, and 1e-4 of it that grows from step to step, as no power of it: no step cures it."""
    found = apart([-0.25018, -0.25019, -0.25022], floor=1e-9)
    assert found.cause == "model"
    assert found.limit == -0.25022
    assert found.uncertainty == pytest.approx(3 * 4e-5, rel=1e-4)


def test_any_order_of_the_steps():
    """Runs may name their steps as they like."""
    shuffled = [1, 2, 0]
    assert apart(H[shuffled] * 3, H[shuffled]) == apart(H * 3)
