"""Error budget: the asymptotic error, the order and the cause of an error that was measured at three or more time steps.

An error that vanishes as dt → 0 is a discretisation error; one that does not is a model error. The asymptotic error has a 95 %
interval; docs/coverage.md counts how often the interval contains the true value. A cause is stated if its opposite is improbable:

    model            it is improbable that the asymptotic error is negligible or has the other sign, and the interval excludes 0
    discretisation   it is improbable that the asymptotic error is larger than allowed, likely that it is at most half of that, and very
                     improbable that it is larger than half of the error at the coarsest of the three finest time steps. The allowed size
                     is the error at the finest time step, or 1/64 of that at the coarsest, but more than the noise
    rounding         no error is larger than rounding
    unresolved       all other cases: the time steps do not determine the cause

The interval contains 0 if the cause is not `model`. It is computed as if the asymptotic error were not 0. That of a discretisation error
with a sign ends at the allowed error, or at half of it if the probability of more is below 1 %. That an error vanishes is said only if its
interval ends before half of the error at the finest time step.
"""

from __future__ import annotations  # help() then shows ArrayLike, not all that it stands for

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from dropspin.comparisons.judging.extrapolation import CREDIBLE, ORDERS, Posterior, extrapolate
from dropspin.comparisons.judging.series import (
    ABOVE_NOISE,
    FEWEST_TIME_STEPS,
    SMALLEST_RATIO,
    falls_ever_faster,
    fitted_order,
    grows_ever_faster,
    is_clear_power,
    most_informative,
    start_of_finest,
    verified,
    verify_options,
)
from dropspin.comparisons.judging.verdicts import Cause
from dropspin.scenarios.state import Array
from dropspin.scenarios.text import counted

SHARE_OF_COARSEST = 1.0 / 64.0
"""Factor by which an error of third order falls over three halved time steps."""
LARGEST_SHARE_OF_COARSEST = 0.5
MODEL_RISK = 0.03
"""A model error is stated if the probability of 0 and of the other sign is below this. Far fewer of the series that vanish come near it."""
DISCRETISATION_RISK = 0.05
"""A discretisation error is stated only if the probability of an asymptotic error larger than allowed is below this."""
LARGE_RISK = 0.01
"""Largest probability, for a discretisation error, of an asymptotic error above half of the error at the coarsest of the three finest
steps.
"""
LARGER_THAN_HALF = 0.25
"""Largest probability of an asymptotic error larger than half of the allowed one, if a discretisation error is stated."""
FAR = 1e100
"""Larger than every asymptotic error in units of the largest error, noise or rounding."""
WIDEST_ORDER = 2.0
"""An order with a wider interval is not stated: the interval would contain three whole numbers."""

SLOW = f"changes more slowly than dt^{ORDERS[0]:g}, too slowly to be extrapolated; much finer time steps are needed"
EARLY = "falls faster at each finer time step, as an error near its largest possible value does; finer time steps are needed"
DIVERGES = "grows faster at each finer time step, and may approach no value"


@dataclass(frozen=True)
class ErrorBudget:
    """The dependence of an error on the time step.

    Attributes:
        cause: The cause to which the error is attributed.
        reason: The reason for the cause.
        asymptotic_error: The estimated error as dt → 0, in the metric's unit; NaN if the time steps do not determine it.
        lower: Lower end of the 95 % interval of the asymptotic error.
        upper: Upper end of the 95 % interval of the asymptotic error.
        order: Observed order of accuracy, fitted to the errors minus the asymptotic error; NaN if it cannot be fitted.
        order_lower: Lower end of the order's 95 % interval.
        order_upper: Upper end of the order's 95 % interval. If the interval is wider than 2, the time steps do not determine the order.
        dts: The time steps to which the order was fitted [s], coarsest first.
    """

    cause: Cause
    reason: str
    asymptotic_error: float = math.nan
    lower: float = math.nan
    upper: float = math.nan
    order: float = math.nan
    order_lower: float = math.nan
    order_upper: float = math.nan
    dts: tuple[float, ...] = ()

    def __repr__(self) -> str:
        cause = f"{self.cause.capitalize()} error: "
        if math.isnan(self.asymptotic_error):
            return f"{cause}{self.reason}."
        why = f"{self.reason}; " if self.cause == "unresolved" else ""
        value = f"the asymptotic error is {self.asymptotic_error:.3g} (95 % interval {self.lower:.3g} to {self.upper:.3g})"
        interval = f"{self.order_lower:.2f} to {self.order_upper:.2f}"
        if math.isnan(self.order):
            return f"{cause}{why}{value}."
        if not is_determined(self.order_lower, self.order_upper):
            return f"{cause}{why}{value}; the order, {interval}, is not determined."
        return f"{cause}{why}{value}, the order {self.order:.2f} ({interval})."


def is_sufficient(dts: Sequence[float]) -> bool:
    """Whether time steps suffice for extrapolation, which needs three that span a factor of four."""
    return len(dts) >= FEWEST_TIME_STEPS and max(dts) / min(dts) >= SMALLEST_RATIO


def is_determined(order_lower: float, order_upper: float) -> bool:
    """Whether the interval of an order is so narrow that the order is worth stating."""
    return order_upper - order_lower <= WIDEST_ORDER


def error_budget(
    dts: ArrayLike,
    errors: ArrayLike,
    claimed_order: float | None = None,
    resolution: ArrayLike | None = None,
    rounding: ArrayLike = 0.0,
    *,
    signed: bool = True,
    negligible: float = 0.0,
    judged_together: int = 1,
) -> ErrorBudget:
    """Estimate the asymptotic value, the order and the cause of one error.

    Args:
        dts: Time steps [s], shape (n,), in any order. If more than five are usable, the five smallest are used; if these span less than a
            factor of 16, the five that are spaced most evenly.
        errors: The error at each time step, shape (n,), in any unit, with its sign if it has one; NaN if the time step is too large to
            resolve it. If the finest one is not finite, the cause is unresolved.
        claimed_order: The order of accuracy that is claimed for the method; None or inf if no order is claimed.
        resolution: Standard deviation of the sampling noise of each error, shape (n,), or one for all, in the unit of the errors. Use 0 if
            the error does not depend on when within a time step an impact occurs. Use None if each error comes from a single initial state;
            a part of the error may then depend on the time of the impact within a time step.
        rounding: The largest error that rounding alone may cause at each time step, shape (n,), or one for all, in the unit of the errors.
        signed: Whether the error can be negative; if not, it is treated as the norm of a signed error.
        negligible: An asymptotic error up to this size does not count as a model error; in the unit of the errors.
        judged_together: The number of errors that are judged together; the error probability of each test is divided by this number
            (C. E. Bonferroni, 1936).

    Returns:
        The cause, and the asymptotic error and the order with their 95 % intervals.

    Raises:
        DropspinError: An argument is invalid.
    """
    h, e, noise, floor = verified(dts, errors, 0.0 if resolution is None else resolution, rounding)
    verify_options(e, claimed_order, signed, negligible, judged_together)
    coarsest_first = np.argsort(-h)
    usable = coarsest_first[np.isfinite(e[coarsest_first])]
    if len(usable) and usable[-1] != coarsest_first[-1]:  # what coarser steps tell of dt → 0, the finest one contradicts
        return ErrorBudget("unresolved", "the error at the finest time step is not usable, but those at coarser ones are")
    if not is_sufficient(list(h[usable])):
        return ErrorBudget("unresolved", _why_insufficient(h[usable], len(h)))
    used = usable[most_informative(h[usable])]
    h, e, noise, floor = h[used], e[used], noise[used], floor[used]
    if (np.abs(e) <= floor).all():
        if not is_clear_power(h, e):
            value, reach = float(e[-1]), float(floor[-1])
            return ErrorBudget("rounding", "within rounding at every time step", value, value - reach, value + reach)
        floor = np.zeros_like(floor)
    # In a unit that is a power of two no digit changes, and the squares of all numbers are finite.
    unit = 2.0 ** (math.frexp(float(np.max(np.abs([e, noise, floor]))))[1] - 1)
    e, noise, floor, negligible = e / unit, noise / unit, floor / unit, min(max(negligible, float(floor[-1])) / unit, FAR)
    small = np.hypot(noise, floor)
    posterior = extrapolate(h, e, small, claimed_order, signed=signed, one_start=resolution is None)
    cause, limit = _attributed(h, e, posterior, negligible, float(noise[-1]), judged_together)
    order, fitted = fitted_order(h, e if cause == "discretisation" else e - limit[0], small)
    is_slow = cause == "model" and order < ORDERS[0] and max(limit[1], -limit[2]) < abs(float(e[-1]) - limit[0])
    is_early = cause == "model" and abs(limit[0]) <= abs(float(e[-1])) and falls_ever_faster(h, e, small)
    if is_slow or is_early:
        cause, limit = "unresolved", (limit[0], min(limit[1], 0.0), max(limit[2], 0.0))
    in_units = unit * limit[0], unit * limit[1], unit * limit[2]
    if cause == "unresolved":
        return ErrorBudget(cause, EARLY if is_early else SLOW if is_slow else _why_unresolved(e, noise, floor), *in_units)
    has_order = not math.isnan(order)
    orders = (min(posterior.order_lower, order), max(posterior.order_upper, order)) if has_order else (math.nan, math.nan)
    found = ErrorBudget(cause, "approaches a value other than 0", *in_units, order, *orders, fitted)
    if cause == "model":
        return replace(found, reason=DIVERGES if grows_ever_faster(h, e, small) else found.reason + _power(found))
    return widened(found, found.upper, unit * abs(float(e[-1])), unit * negligible)


def widened(budget: ErrorBudget, upper: float, finest: float, negligible: float) -> ErrorBudget:
    """An error budget without a model error whose interval extends at least to `upper`; the reason says so.

    Args:
        budget: The error budget.
        upper: The upper end that the interval reaches at least.
        finest: The size of the error at the finest time step.
        negligible: An asymptotic error up to this size is negligible.
    """
    wider = replace(budget, upper=max(budget.upper, upper))
    if budget.cause != "discretisation":
        return wider
    reach, power = max(-wider.lower, wider.upper), _power(budget)
    if reach < 0.5 * finest:
        reason = f"vanishes{power or ' as dt → 0'}"
    elif reach <= negligible:
        reason = f"at most {reach:.2g} remains as dt → 0, which is negligible"
    else:
        reason = f"falls{power or ' with dt'}; up to {reach:.2g} may remain as dt → 0"
    return replace(wider, reason=reason)


def growing(budget: ErrorBudget, finest: float, noise: float) -> ErrorBudget:
    """The budget of an error that grows with finer time steps: at least the error at the finest of them, less its noise, remains."""
    least = finest - math.copysign(ABOVE_NOISE * noise, finest)
    lower, upper = (least, max(budget.upper, finest)) if finest > 0.0 else (min(budget.lower, finest), least)
    reason = "that of the finest time step; it grows at least as fast as 1/dt, without a limit"
    return ErrorBudget("model", reason, finest, lower, upper)


def vector_budget(
    dts: Array, components: Array, claimed_order: float | None, resolution: Array, rounding: Array, negligible: float
) -> ErrorBudget:
    """The budget of the length of an error vector, from its signed components.

    The length has a model error if a component has one at more than three time steps; with three, a kink looks like a model error too
    often. The length vanishes if all components vanish. The interval of the length contains the lengths of all vectors whose components
    are in their intervals; without a model error it also contains 0. The order is that of the component with the largest asymptotic error.

    Args:
        dts: Time steps [s], shape (n,).
        components: The components at each time step, shape (n, k); NaN if the time step was too coarse.
        claimed_order: This and the following arguments are as for `error_budget`.
        resolution: Shape (n, k).
        rounding: Shape (n,).
        negligible: The same for each component.
    """
    budgets = [
        error_budget(dts, errors, claimed_order, noise, rounding, negligible=negligible, judged_together=components.shape[1])
        for errors, noise in zip(components.T, resolution.T, strict=True)
    ]
    causes = {budget.cause for budget in budgets}
    if np.isfinite(components).all(axis=1).sum() <= FEWEST_TIME_STEPS and "model" in causes:
        causes = {"unresolved"}
    cause = next(cause for cause in ("model", "unresolved", "discretisation", "rounding") if cause in causes)
    most = max(budgets, key=lambda budget: (budget.cause == cause, abs(budget.asymptotic_error)))
    nearest = math.hypot(*(max(budget.lower, -budget.upper, 0.0) for budget in budgets)) if cause == "model" else 0.0
    farthest = math.hypot(*(max(-budget.lower, budget.upper) for budget in budgets))
    length = math.hypot(*(budget.asymptotic_error for budget in budgets))
    return replace(most, cause=cause, asymptotic_error=length, lower=nearest, upper=farthest)


def _attributed(
    h: Array, e: Array, posterior: Posterior, floor: float, noise: float, judged_together: int
) -> tuple[Cause, tuple[float, float, float]]:
    """The cause that the posterior of the asymptotic error implies, with the median and the interval; errors coarsest first."""
    coarsest, finest = float(np.min(np.abs(e[[0, start_of_finest(h)]]))), abs(float(e[-1]))
    large = max(LARGEST_SHARE_OF_COARSEST * coarsest, floor)
    allowed = min(max(finest, SHARE_OF_COARSEST * coarsest, floor), large)
    above, below = posterior.beyond(floor)
    median, lower, upper = posterior.interval(judged_together)
    if not posterior.has_sign:  # one part that is smaller than another does not show
        upper = max(upper, finest)
    cut = floor if posterior.has_sign else 0.0  # the interval of a model error begins beyond the floor; what is cut off is negligible
    if (lower > -cut or upper < cut) and max(above, below) > 1.0 - MODEL_RISK / judged_together:
        lower, upper = (lower, min(upper, -floor)) if posterior.has_sign and below > above else (max(lower, floor), upper)
        return "model", (median, lower, upper)
    lower, upper = min(lower, 0.0), max(upper, 0.0)
    risks = ((allowed, DISCRETISATION_RISK), (0.5 * allowed, LARGER_THAN_HALF), (large, LARGE_RISK))
    is_small = all(sum(posterior.beyond(reach)) < risk for reach, risk in risks)
    if not is_small or allowed < noise:
        return "unresolved", (median, lower, upper)
    if not posterior.has_sign:
        return "discretisation", (median, lower, upper)
    reach = 0.5 * allowed if sum(posterior.beyond(0.5 * allowed)) < 1.0 - CREDIBLE else allowed
    return "discretisation", (min(max(median, -reach), reach), max(lower, -reach), min(upper, reach))


def _power(budget: ErrorBudget) -> str:
    orders = budget.order_lower, budget.order_upper
    return f" as dt^{budget.order:.2f} ({orders[0]:.2f} to {orders[1]:.2f})" if is_determined(*orders) else ""


def _why_insufficient(usable: Array, of: int) -> str:
    span = f" and span a factor of {usable.max() / usable.min():.3g}" if len(usable) >= FEWEST_TIME_STEPS else ""
    steps = f"{'' if span else 'only '}{len(usable)} of {counted(of, 'time step is', 'time steps are')} usable"
    return f"{steps}{span}; extrapolation needs three that span a factor of four"


def _why_unresolved(e: Array, noise: Array, floor: Array) -> str:
    small, finest = np.hypot(noise, floor), abs(float(e[-1]))
    if (np.abs(e) <= ABOVE_NOISE * small).all():
        if (floor > noise).all():
            return "hardly larger than rounding at every time step"
        return "within the sampling noise at every time step; more start phases would reduce the noise"
    if (np.diff(np.abs(e)) > small[1:]).all():
        return "grows as dt decreases; finer time steps are needed"
    if finest <= floor[-1]:
        return "within rounding at the finest time step, but not at coarser ones; finer time steps are needed"
    if finest <= small[-1]:
        return "within the sampling noise at the finest time step, but not at coarser ones; more start phases would reduce the noise"
    return "the time steps do not decide whether it vanishes as dt → 0; finer ones are needed"
