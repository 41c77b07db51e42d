"""The error budget of synthetic sequences, whose order, asymptotic error and cause are known."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from comparisons.judging.error_budget import error_budget

H = np.array([4e-3, 2e-3, 1e-3])


def budget(errors, h=H, noise=0.0, floor=1e-12, claimed=None):
    return error_budget(np.asarray(h), np.asarray(errors, dtype=float), np.full(len(h), noise), np.full(len(h), floor), claimed)


@pytest.mark.parametrize("p", [1, 2, 3, 4])
@pytest.mark.parametrize("sign", [1, -1])
def test_pure_power_gives_its_order_and_no_asymptotic_error(p, sign):
    """The order is exact to rounding, and all three steps are in the window."""
    found = budget(sign * 7.0 * H**p, floor=1e-30, claimed=p)
    assert found.cause == "discretisation"
    assert found.order == pytest.approx(p, abs=1e-9)
    assert abs(found.asymptotic_error) <= 1e-9 * abs(7.0 * H[-1] ** p)
    assert found.window == tuple(H)


@pytest.mark.parametrize("p", [1, 2, 4])
@pytest.mark.parametrize("share", [1.0, 0.1, 1e-3])
def test_asymptotic_error_below_the_finest_error_is_found(p, share):
    """An error m + C hᵖ, with m down to a thousandth of the finest error, is a model error, and m is found to rounding."""
    m = share * H[-1] ** p
    found = budget(m + H**p, floor=1e-30, claimed=p)
    assert found.cause == "model"
    assert found.order == pytest.approx(p, abs=1e-6)
    assert found.asymptotic_error == pytest.approx(m, rel=1e-6)


coefficient = st.floats(-300.0, 300.0)


@given(coefficient, coefficient)
def test_mixed_powers_are_never_called_a_model_error(second, third):
    """An error h + a h² + b h³, the higher powers up to a third of the first at the finest step, vanishes within its uncertainty."""
    found = budget(H + second * H**2 + third * H**3)
    assert found.cause in ("discretisation", "unresolved")
    assert not abs(found.asymptotic_error) > found.uncertainty or found.cause == "unresolved"


@given(st.floats(0.0, 2.0))
def test_small_first_order_part_of_a_second_order_error_is_no_model_error(first):
    """h² + ε h: three steps show an order between 1 and 2."""
    found = budget(H**2 + first * 1e-3 * H)
    assert found.cause == "discretisation"


@given(coefficient, st.floats(0.3, 3.0), st.sampled_from([-1.0, 1.0]))
def test_asymptotic_error_is_within_its_uncertainty(second, share, sign):
    """For m + h + a h², with m of the size of the finest error, the interval contains m wherever an order is given."""
    m = sign * share * H[-1]
    found = budget(m + H + second * H**2)
    if found.cause == "model" and not math.isnan(found.order):
        assert abs(found.asymptotic_error - m) <= found.uncertainty + 1e-15


@given(st.floats(0.1, 1.0), st.sampled_from([1.0, -1.0]))
def test_exponential_growth_within_a_step_is_no_model_error(rate, sense):
    """An error e^(±ah) - 1, as of methods that gain or lose energy, has all powers of the step; a times the coarsest step is up to 2."""
    found = budget(np.expm1(sense * rate * H / 2e-3))
    assert found.cause in ("discretisation", "unresolved")


def test_without_a_claimed_order_a_higher_power_may_hide_a_lower_one():
    """An error m + h², m of the size of the finest error, may as well be h + h²: no model error unless the order is known to be 2."""
    errors = H[-1] ** 2 + H**2
    assert budget(errors, floor=1e-30).cause == "discretisation"
    assert budget(errors, floor=1e-30, claimed=2.0).cause == "model"


def test_unsigned_error_has_no_negative_asymptotic_value():
    """Three sizes that extrapolate below 0 are not asymptotic yet."""
    errors = np.array([1.139, 0.5737, 0.2783])
    found = error_budget(H, errors, np.zeros(3), np.full(3, 1e-12), signed=False)
    assert found.cause == "discretisation"
    assert found.asymptotic_error == pytest.approx(-0.017, abs=2e-3)
    assert error_budget(H, np.array([1.0, 0.9, 0.85]), np.zeros(3), np.full(3, 1e-12), signed=False).cause == "model"


def test_one_bad_coarse_step_is_not_taken_for_a_high_order():
    """Two finer steps that halve and a coarse one far off fit order 4; without a claim that order is rejected."""
    errors = [4.035e-3, 4.522e-4, 2.321e-4]  # PyBullet's first contact of a box that turns
    assert budget(errors).cause == "discretisation"
    assert budget(errors, claimed=4.0).cause == "model"


def test_order_that_changes_from_step_to_step_is_not_asymptotic():
    """Only a constant order may be compared with a claim."""
    assert budget(H).is_asymptotic
    assert not budget(H + 100.0 * H**2).is_asymptotic


def test_plateau_is_a_model_error():
    """An error that is constant or settles is a model error; one that keeps jumping is unresolved."""
    for errors in ([0.7531, 0.7530, 0.7530], [0.25, 0.26, 0.2545]):
        found = budget(errors, floor=1e-9)
        assert (found.cause, found.asymptotic_error, found.reason) == ("model", errors[-1], "does not depend on dt")
    assert found.uncertainty == pytest.approx(0.01, rel=1e-6)
    assert budget([0.2545, 0.25, 0.26]).cause == "unresolved"


def test_count_has_no_order():
    """A count may halve with the step, but no power of the step describes it."""
    found = error_budget(H, np.array([4.0, 2.0, 1.0]), np.zeros(3), np.full(3, 1e-12), jumps=True)
    assert (found.cause, found.reason) == ("discretisation", "shrinks, but not as a power of dt")
    assert math.isnan(found.order)
    assert error_budget(H, np.zeros(3), np.zeros(3), np.full(3, 1e-12), jumps=True).cause == "rounding"


def test_error_that_grows_as_dt_shrinks_is_a_model_error():
    """As when restitution vanishes with the step."""
    found = budget([0.1, 0.15, 0.25])
    assert found.cause == "model"
    assert "grows" in found.reason


def test_errors_within_rounding_have_no_order():
    """Errors within rounding at every step are rounding, even if they fall by chance."""
    assert budget([3e-14, -1e-14, 5e-14]).cause == "rounding"
    assert budget([0.0, 0.0, 0.0]).cause == "rounding"
    assert budget([9e-14, 5e-14, 3e-14]).cause == "rounding"  # falls by chance


def test_step_within_rounding_is_left_out():
    """A fourth-order error reaches rounding at the finest step, which is left out with the reason."""
    found = budget([6.3e-12, 4.0e-13, 2.0e-13])
    assert found.cause == "discretisation"
    assert found.order == pytest.approx(4.0, abs=0.1)
    assert found.left_out == ((1e-3, "rounding"),)


def test_coarse_step_outside_the_asymptotic_range_is_left_out():
    """With more than three steps, the finest ones decide."""
    h = np.array([8e-3, 4e-3, 2e-3, 1e-3, 5e-4])
    errors = 3.0 * h**2
    errors[0] *= 5.0
    found = budget(errors, h, floor=1e-30)
    assert found.order == pytest.approx(2.0, abs=1e-9)
    assert found.left_out == ((8e-3, "too coarse"),)


def test_error_below_the_sampling_noise_is_no_model_error():
    """With noise of the size of the error only a bound is given."""
    found = budget([5e-5, -2e-5, 1.5e-5], noise=1e-4)
    assert (found.cause, found.reason) == ("discretisation", "smaller at every step than the sampling noise of the start phases")
    assert math.isnan(found.order)
    assert found.uncertainty == pytest.approx(1e-4)


def test_noise_widens_the_interval():
    """The same series is a model error if measured exactly, and not if the noise exceeds its asymptotic error."""
    errors = 1e-4 + 5.0 * H
    assert budget(errors).cause == "model"
    assert budget(errors, noise=1e-3 * H[-1] * 200).cause == "discretisation"


def test_reason_says_how_many_steps_are_usable():
    """The message gives what is there and what is needed."""
    found = budget([math.nan, 0.1, 0.05])
    assert found.reason == "only 2 of 3 time steps are usable; extrapolation needs three that span a factor of four"


@pytest.mark.parametrize(
    ("errors", "h"),
    [
        ([0.1, 0.05], [2e-3, 1e-3]),
        ([0.1, 0.09, 0.08], [2e-3, 1.9e-3, 1.8e-3]),
        ([math.nan, 0.1, 0.05], H),
        ([0.1, -0.1, 0.09], H),
    ],
)
def test_unusable_series_is_unresolved(errors, h):
    """Too few steps, too narrow a range, an undefined error, an error that jumps."""
    assert budget(errors, np.asarray(h)).cause == "unresolved"


def test_error_that_hardly_changes_is_a_model_error():
    """An error that grows by 1e-4 of itself, not as a power of the step, is a model error."""
    found = budget([-0.25018, -0.25019, -0.25022], floor=1e-9)
    assert found.cause == "model"
    assert found.asymptotic_error == -0.25022
    assert found.uncertainty == pytest.approx(3 * 4e-5, rel=1e-4)


def test_steps_may_come_in_any_order():
    """The budget does not depend on the order of the steps."""
    shuffled = [1, 2, 0]
    assert budget(H[shuffled] * 3, H[shuffled]) == budget(H * 3)
