"""The error budget of series that mislead an extrapolation, and of arguments that are odd or invalid; all limits are closed forms."""

import math
import warnings

import numpy as np
import pytest
from support import interval_coverage
from support.misleading_series import CLOSE, STEPS

import dropspin as ds
from dropspin.comparisons.judging.extrapolation import remainders
from dropspin.comparisons.judging.series import is_clear_power, most_informative

H = np.array([4e-3, 2e-3, 1e-3])
FIVE = 0.5 ** np.arange(5)


@pytest.mark.parametrize("c", [1e-3, 10**-2.75, 10**-2.5, 10**-2.25])
@pytest.mark.parametrize("m", [0.3, -0.03, 0.003])
def test_interval_contains_the_limit_of_two_competing_orders(m, c):
    """The limit of m + h² + c h, although the lower order is hardly visible and moves an extrapolation of second order."""
    found = ds.error_budget(FIVE, m + FIVE**2 + c * FIVE)
    assert found.lower <= m <= found.upper
    assert found.cause == ("model" if abs(m) > FIVE[-1] ** 2 else found.cause)


@pytest.mark.extended
@pytest.mark.parametrize("family", ["order 2, a little of order 1", "order 3, a little of order 2", "order 2, a little of order 1/2"])
def test_competing_orders_are_covered_and_decided(family):
    """At five halved steps the interval contains the limit in at least 95 %, and a cause is stated in at least 95 %."""
    found = interval_coverage.outcomes(family, 60, 5)
    assert np.mean([one.is_covered for one in found]) >= 0.95
    assert np.mean([one.cause != "unresolved" for one in found]) >= 0.95
    assert not any(one.cause == "model" for one in found if one.asymptotic == 0.0)


@pytest.mark.extended
@pytest.mark.parametrize("family", ["order 1 with a remainder of a time", "order 2 with a remainder of a time"])
def test_remainder_of_a_time_is_no_model_error(family):
    """Errors that depend on T/h mod 1, at five halved steps, where all remainders follow from that of the coarsest."""
    found = interval_coverage.outcomes(family, 100, 5)
    assert not any(one.cause == "model" for one in found if one.asymptotic == 0.0)
    assert np.mean([one.is_covered for one in found]) >= 0.95


@pytest.mark.parametrize("whole", range(1, 16))
def test_remainder_that_changes_is_recognised(whole):
    """T mod h, for a time of whole + .3 finest steps: the errors have the bits of the whole number, and no asymptotic error."""
    found = ds.error_budget(FIVE, np.mod((whole + 0.3) * FIVE[-1], FIVE))
    assert found.cause != "model"
    assert found.lower <= 0.0 <= found.upper


def test_remainders_of_steps_with_a_common_divisor_are_no_model_error():
    """A ball whose impact is processed at the end of its step; its error at .5 ms is -1.6e-4 m."""
    errors = [-0.115128547, -0.054306547, -0.025367047, -0.019696867, -0.008474227]
    found = ds.error_budget([20e-3, 10e-3, 5e-3, 4e-3, 2e-3], errors)
    assert found.cause != "model"
    assert found.lower <= 0.0 <= found.upper


def test_error_of_known_noise_has_no_remainder():
    """A constant as large as the finest step may be a remainder if the error is from one start, and is none if it is a mean over many."""
    errors = FIVE + 0.5 * FIVE[-1]
    assert ds.error_budget(FIVE, errors, resolution=0.0).cause == "model"
    assert ds.error_budget(FIVE, errors).cause != "model"


@pytest.mark.parametrize("multiples", [(4, 2, 1), (16, 8, 4, 2, 1), (10, 5, 4, 2, 1), (20, 10, 5, 4, 2), (12, 6, 4, 3)])
def test_remainders_have_the_covariance_of_franel(multiples):
    """Of {p t} and {q t}, t uniform between 0 and 1: gcd(p, q)² / (12 p q) (J. Franel, 1924)."""
    moments = sum(chance * terms.T @ terms for terms, chance in remainders(np.array(multiples) / multiples[0]))
    period = math.lcm(*multiples)
    often = [period // each for each in multiples]
    assert moments == pytest.approx(np.array([[0.25 + math.gcd(p, q) ** 2 / (12.0 * p * q) for p in often] for q in often]), abs=1e-15)


@pytest.mark.extended
@pytest.mark.parametrize("steps", [*CLOSE, "6", "7"])
def test_close_and_many_steps_are_covered(steps):
    """Ratios of 1.2 to 1.5, six and seven steps."""
    found = interval_coverage.outcomes("orders 1 to 3, close steps", 30, steps)
    assert len(found) == 30
    assert np.mean([one.is_covered for one in found]) >= 0.95
    assert not any(one.cause == "model" for one in found if one.asymptotic == 0.0)


def test_crowded_time_steps_are_thinned_and_the_span_is_kept():
    """Of 4, 2, 1.2, 1.15, 1.1, 1.05, 1 ms both ends are used; of seven halved ones, the five finest."""
    h = 1e-3 * np.array([4.0, 2.0, 1.2, 1.15, 1.1, 1.05, 1.0])
    assert h[most_informative(h)] == pytest.approx([4e-3, 2e-3, 1.2e-3, 1.1e-3, 1e-3])
    assert most_informative(0.5 ** np.arange(7.0)) == [2, 3, 4, 5, 6]
    assert most_informative(np.array([8.0, 4.0, 1.0])) == [0, 1, 2]
    found = ds.error_budget(h, 0.5 + h + h**2)
    assert found.cause == "model"
    assert found.lower <= 0.5 <= found.upper


@pytest.mark.parametrize("errors", [[4.5e-10, 2.8e-11, 1.8e-12], [-6.4e-10, -8e-11, -1e-11]])
def test_clear_order_is_not_rounding(errors):
    """Errors that fall by 16 or 8 from step to step, to their last digit, are no rounding errors, however small."""
    found = ds.error_budget(H, errors, rounding=1e-9)
    assert found.cause == "discretisation"
    assert found.order == pytest.approx(math.log2(errors[0] / errors[-1]) / 2.0, abs=1e-6)


def test_random_errors_seldom_follow_a_power():
    """Fewer than 1 % of independent ones, at three steps and at five."""
    rng = np.random.default_rng(5)
    for h in (H, FIVE):
        assert np.mean([is_clear_power(h, rng.normal(size=len(h))) for _ in range(2000)]) < 0.01


@pytest.mark.parametrize("share", [0.5, 0.8, 1.5])
@pytest.mark.parametrize("p", [1, 2])
def test_series_with_a_limit_do_not_vanish(share, p):
    """Where the limit is half of the finest error or more, it is in the interval, and no reason says that the error vanishes."""
    m = share / (1.0 - share) if share < 1.0 else -share
    found = ds.error_budget(H, m * H[-1] ** p + H**p)
    assert not found.reason.startswith("vanishes")
    assert found.lower <= m * H[-1] ** p <= found.upper


def test_interval_of_a_discretisation_error_ends_at_the_finest_error():
    """So that the cause, the reason and the interval agree; an interval that ends at half of it or more does not vanish."""
    rng = np.random.default_rng(3)
    for _ in range(60):
        errors = rng.normal() * H + rng.normal() * H**2 / H[0] + 0.3 * rng.normal() * H[-1]
        found = ds.error_budget(H, errors)
        reach, finest = max(-found.lower, found.upper), max(abs(errors[-1]), np.max(np.abs(errors)) / 64.0)
        assert found.cause != "discretisation" or reach <= finest * (1.0 + 1e-12)
        assert not found.reason.startswith("vanishes") or reach < 0.5 * abs(errors[-1])


def test_order_is_stated_with_its_interval_only_if_it_is_known():
    """cosh(60 h) - 1 has order 2, and at steps far too coarse a slope of 2.3 to 4; the reason does not state it."""
    h = np.array([0.16, 0.08, 0.04])
    coarse = ds.error_budget(h, np.cosh(60.0 * h) - 1.0)
    assert coarse.order_upper - coarse.order_lower > 2.0
    assert "dt^" not in coarse.reason
    assert "not determined" in repr(coarse) or coarse.cause == "unresolved"
    fine = ds.error_budget(FIVE, FIVE**2)
    assert fine.reason == f"vanishes as dt^2.00 ({fine.order_lower:.2f} to {fine.order_upper:.2f})"
    assert fine.order_lower <= 2.0 <= fine.order_upper


@pytest.mark.parametrize("p", [0.2, 0.3])
def test_error_that_vanishes_very_slowly_is_no_model_error(p):
    """h^p at five steps; its limit of 0 is in the interval."""
    found = ds.error_budget(FIVE, FIVE**p)
    assert found.cause != "model"
    assert found.lower <= 0.0 <= found.upper


@pytest.mark.parametrize("h", [FIVE, FIVE[:4], np.array([8.0, 6.0, 5.0, 4.0, 3.0, 2.0, 1.5])])
@pytest.mark.parametrize("p", [0.2, 0.23])
def test_error_that_grows_without_bound_approaches_no_value(p, h):
    """As h^-p; it does not vanish either."""
    found = ds.error_budget(h, h**-p)
    assert (found.cause, found.reason.split(",")[0]) in {
        ("model", "grows faster at each finer time step"),
        ("unresolved", found.reason.split(",")[0]),
    }
    assert "approaches" not in found.reason


@pytest.mark.parametrize(
    ("h", "errors"), [(H, [1.0, 1.0003, 1.0015]), (H, [-1.256e-3, -1.259e-3, -1.264e-3]), (FIVE, 1.0 + 0.003 / FIVE), (FIVE, FIVE**-0.02)]
)
def test_model_error_with_a_small_drift_that_grows_approaches_a_value(h, errors):
    found = ds.error_budget(h, errors)
    assert (found.cause, found.reason[:27]) == ("model", "approaches a value other th")


def test_errors_near_rounding_are_not_called_sampling_noise():
    """Without any sampling noise."""
    found = ds.error_budget(H, [2.5e-9, -1.5e-9, 2e-9], rounding=1e-9)
    assert found.reason == "hardly larger than rounding at every time step"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"resolution": [0.1, 0.2]}, r"resolution takes one number, or one for each of 3 time steps; got the shape \(2,\)"),
        ({"rounding": [[0.1] * 3]}, r"rounding takes one number, or one for each of 3 time steps; got the shape \(1, 3\)"),
        ({"resolution": -1.0}, "resolution must be finite and not negative; got -1"),
        ({"resolution": [0.1, math.nan, 0.1]}, "resolution must be finite and not negative; got nan"),
        ({"rounding": math.inf}, "rounding must be finite and not negative; got inf"),
        ({"negligible": math.nan}, "negligible must be finite and not negative; got nan"),
        ({"judged_together": 0}, "judged_together must be a whole number from 1; got 0"),
        ({"judged_together": 1.5}, "judged_together must be a whole number from 1; got 1.5"),
        ({"claimed_order": -2.0}, "claimed_order must be positive, or None; got -2.0"),
        ({"resolution": "none"}, "resolution must be numbers; got 'none'"),
    ],
)
def test_invalid_options_are_refused(options, message):
    """In one sentence that names the argument and what was given."""
    with pytest.raises(ds.DropspinError, match=message):
        ds.error_budget(H, [4.0, 2.0, 1.0], **options)


@pytest.mark.parametrize("size", [2.0**1000, 2.0**-1000])
def test_largest_and_smallest_numbers_are_judged_as_others(size):
    """A factor of a power of two on errors, noise and rounding changes the interval by this factor and nothing else."""
    errors, rounding = np.array([4.1, 2.0, 1.0]), 1e-3
    found, scaled = ds.error_budget(H, errors, rounding=rounding), ds.error_budget(H, size * errors, rounding=size * rounding)
    assert (scaled.cause, scaled.order) == (found.cause, found.order)
    assert (scaled.lower, scaled.upper) == (size * found.lower, size * found.upper)


@pytest.mark.parametrize("option", ["resolution", "negligible"])
def test_noise_or_negligible_errors_without_bound_give_no_warning(option):
    """1e308 is a valid number: everything is within it."""
    found = ds.error_budget(H, [4.0, 2.0, 1.0], **{option: 1e308})
    assert found.cause == ("unresolved" if option == "resolution" else "discretisation")


def test_interval_of_a_model_error_excludes_zero_also_where_a_little_is_negligible():
    """It ended at what is negligible, where the interval of the asymptotic error alone contains 0."""
    errors = [0.73605, 0.57697, 0.51268, 0.48242, 0.61987]
    assert [ds.error_budget(FIVE, errors, negligible=floor).cause for floor in (0.0, 1e-6)] == ["unresolved", "unresolved"]


@pytest.mark.parametrize("errors", [[1.0, 0.5, 0.25, 0.125, 0.0], [0.0, 0.5, 0.25, 0.125, 0.0625]])
def test_error_without_a_sign_may_be_zero_at_a_step(errors):
    """The weight of its square's series has the logarithm of the error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert ds.error_budget(FIVE, errors, signed=False).cause == "unresolved"


def test_time_step_without_an_error_needs_no_noise():
    """Where the error is NaN, the noise may be NaN too."""
    found = ds.error_budget([8e-3, *H], [math.nan, 4.0, 2.0, 1.0], resolution=[math.nan, 0.0, 0.0, 0.0])
    assert found == ds.error_budget(H, [4.0, 2.0, 1.0], resolution=0.0)


def test_families_are_judged_at_time_steps_that_suffice():
    """Each set of time steps spans a factor of four."""
    assert all(h[0] / h[-1] >= 3.99 for h in STEPS.values())
