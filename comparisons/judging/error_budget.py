"""Error budget: the asymptotic error, the order and the cause of an error that was measured at three or more time steps.

An error that vanishes as dt → 0 is a discretisation error; one that does not is a model error. The asymptotic error has a 95 %
interval; docs/coverage.md counts how often the interval contains the true value. A cause is stated if its opposite is improbable:

    model            it is improbable that the asymptotic error is 0 or has the other sign
    discretisation   it is improbable that the asymptotic error is larger than allowed, likely that it is at most half of that, and very
                     improbable that it is larger than half of the error at the coarsest of the three finest time steps. The allowed size
                     is the error at the finest time step, or 1/64 of that at the coarsest, but more than the noise
    rounding         no error is larger than rounding
    unresolved       all other cases: the time steps do not determine the cause

The interval excludes 0 if the cause is `model`, and contains 0 otherwise. It is computed as if the asymptotic error were not 0; so if the
cause is `discretisation`, it may extend beyond the allowed error.
"""

from __future__ import annotations  # help() then shows ArrayLike, not all that it stands for

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from comparisons.judging.extrapolation import ORDERS, Posterior, extrapolate
from comparisons.judging.verdicts import Cause
from scenarios import DropspinError
from scenarios.text import counted

Array = NDArray[np.float64]

FEWEST_TIME_STEPS = 3
MOST_TIME_STEPS = 5
"""Largest number of time steps used; coarser ones contain little information about dt → 0."""
SMALLEST_RATIO = 3.99
"""Extrapolation needs three time steps that span a factor of four."""
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
ABOVE_NOISE = 3.0
"""An order is fitted to errors larger than this multiple of their noise."""
SAME_SLOPE = 0.5
"""Slopes between neighbouring time steps that differ by less than this count as one power of the time step."""


@dataclass(frozen=True)
class ErrorBudget:
    """The dependence of an error on the time step.

    Attributes:
        cause: The cause to which the error is attributed.
        reason: The reason for the cause.
        asymptotic_error: The error that does not vanish as dt → 0, in the metric's unit; NaN where it is undefined.
        lower: Lower end of the 95 % interval of the asymptotic error.
        upper: Upper end of the 95 % interval of the asymptotic error.
        order: Observed order of convergence, fitted to the errors without the asymptotic error; NaN where there is none.
        order_lower: Lower end of the order's 95 % interval.
        order_upper: Upper end of the order's 95 % interval.
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
        has_no_order = math.isnan(self.order)
        order = "" if has_no_order else f", the order {self.order:.2f} ({self.order_lower:.2f} to {self.order_upper:.2f})"
        return f"{cause}{why}{value}{order}."


def is_sufficient(dts: Sequence[float]) -> bool:
    """Whether time steps suffice for extrapolation, which needs three that span a factor of four."""
    return len(dts) >= FEWEST_TIME_STEPS and max(dts) / min(dts) >= SMALLEST_RATIO


def error_budget(
    dts: ArrayLike,
    errors: ArrayLike,
    claimed_order: float | None = None,
    resolution: ArrayLike = 0.0,
    rounding: ArrayLike = 0.0,
    *,
    signed: bool = True,
    negligible: float = 0.0,
    judged_together: int = 1,
) -> ErrorBudget:
    """Estimate the asymptotic value, the order and the cause of one error.

    Args:
        dts: Time steps [s], shape (n,), in any order. The five finest usable ones are used.
        errors: The error at each time step, shape (n,), in any unit, with its sign if it has one; NaN if the time step was too coarse to
            resolve it.
        claimed_order: The order of accuracy claimed for the method; None or inf if there is none.
        resolution: Standard deviation of the sampling noise of each error, shape (n,), or one for all; in the unit of the errors.
        rounding: The largest error that rounding alone may cause at each time step, shape (n,), or at all of them; in the unit of the
            errors.
        signed: Whether the error can be negative; an error that cannot is treated as the norm of a signed error.
        negligible: An asymptotic error up to this size is no model error; in the unit of the errors.
        judged_together: The number n of errors that are judged together; the error probability of each is 1/n (C. E. Bonferroni, 1936).

    Returns:
        The cause, the asymptotic error and the order, each with its 95 % interval.

    Raises:
        DropspinError: The time steps or the errors are invalid.
    """
    h, e = (np.atleast_1d(np.asarray(values, dtype=float)) for values in (dts, errors))
    _verify(h, e, signed)
    noise, floor = (np.broadcast_to(np.asarray(values, dtype=float), h.shape) for values in (resolution, rounding))
    coarsest_first = np.argsort(-h)
    usable = coarsest_first[np.isfinite(e[coarsest_first])][-MOST_TIME_STEPS:]
    h, e, noise, floor = h[usable], e[usable], noise[usable], floor[usable]
    if not is_sufficient(list(h)):
        span = f" span a factor of {h.max() / h.min():.3g}" if len(h) > 2 else ""
        usable_steps = f"{'' if span else 'only '}{len(usable)} of {counted(len(coarsest_first), 'time step is', 'time steps are')} usable"
        needed = "extrapolation needs three that span a factor of four"
        return ErrorBudget("unresolved", f"{usable_steps}{' and' if span else ''}{span}; {needed}")
    if (np.abs(e) <= floor).all():
        value, reach = float(e[-1]), float(floor[-1])
        return ErrorBudget("rounding", "within rounding at every time step", value, value - reach, value + reach)
    small = np.hypot(noise, floor)
    found = extrapolate(h, e, small, claimed_order, signed=signed)
    cause, median, lower, upper = _attributed(e, found, max(negligible, float(floor[-1])), float(noise[-1]), judged_together)
    order, fitted = _fitted_order(h, e, 0.0 if cause == "discretisation" else median, small)
    if cause == "unresolved" or math.isnan(order):
        return ErrorBudget(cause, _reason(cause, e, small, float(floor[-1]), order), median, lower, upper)
    orders = min(found.order_lower, order), max(found.order_upper, order)
    return ErrorBudget(cause, _reason(cause, e, small, float(floor[-1]), order), median, lower, upper, order, *orders, fitted)


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
    found = [
        error_budget(dts, errors, claimed_order, noise, rounding, negligible=negligible, judged_together=components.shape[1])
        for errors, noise in zip(components.T, resolution.T, strict=True)
    ]
    causes = {one.cause for one in found}
    if np.isfinite(components).all(axis=1).sum() <= FEWEST_TIME_STEPS and "model" in causes:
        causes = {"unresolved"}
    cause = next(cause for cause in ("model", "unresolved", "discretisation", "rounding") if cause in causes)
    most = max(found, key=lambda one: (one.cause == cause, abs(one.asymptotic_error)))
    nearest = math.hypot(*(max(one.lower, -one.upper, 0.0) for one in found)) if cause == "model" else 0.0
    farthest = math.hypot(*(max(-one.lower, one.upper) for one in found))
    length = math.hypot(*(one.asymptotic_error for one in found))
    return replace(most, cause=cause, asymptotic_error=length, lower=nearest, upper=farthest)


def _verify(h: Array, e: Array, signed: bool) -> None:
    if h.ndim != 1 or h.shape != e.shape:
        raise DropspinError(f"an error budget takes one error for each time step; got {h.shape} time steps and {e.shape} errors.")
    if not ((h > 0.0) & np.isfinite(h)).all() or len(np.unique(h)) < len(h):
        raise DropspinError(f"time steps must be positive and different; got {', '.join(f'{step:g}' for step in h)}.")
    if not signed and (e < 0.0).any():
        raise DropspinError(f"an error without a sign cannot be negative; got {float(np.nanmin(e)):g}. Pass signed=True if it has a sign.")


def _attributed(e: Array, found: Posterior, floor: float, noise: float, judged_together: int) -> tuple[Cause, float, float, float]:
    """The cause that the posterior of the asymptotic error implies, with the median and the interval; errors coarsest first."""
    coarsest, finest = float(np.min(np.abs(e[[0, -FEWEST_TIME_STEPS]]))), abs(float(e[-1]))
    large = max(LARGEST_SHARE_OF_COARSEST * coarsest, floor)
    allowed = min(max(finest, SHARE_OF_COARSEST * coarsest, floor), large)
    above, below = found.beyond(floor)
    median, lower, upper = found.interval(judged_together)
    if not found.has_sign:  # one part that is smaller than another does not show
        upper = max(upper, finest)
    if max(above, below) > 1.0 - MODEL_RISK / judged_together:
        lower, upper = (lower, min(upper, -floor)) if found.has_sign and below > above else (max(lower, floor), upper)
        return "model", median, lower, upper
    lower, upper = min(lower, 0.0), max(upper, 0.0)
    risks = ((allowed, DISCRETISATION_RISK), (0.5 * allowed, LARGER_THAN_HALF), (large, LARGE_RISK))
    is_small = all(sum(found.beyond(reach)) < risk for reach, risk in risks)
    if not is_small or allowed < noise:
        return "unresolved", median, lower, upper
    return "discretisation", median, lower, upper


def _fitted_order(h: Array, e: Array, limit: float, small: Array) -> tuple[float, tuple[float, ...]]:
    """The slope of the error without the asymptotic error, over the three finest steps above the noise, and these steps.

    Errors that noise or rounding could have caused do not count as noise if they follow a power of the time step.
    """
    rest = e - limit
    clear = np.flatnonzero(np.abs(rest) > ABOVE_NOISE * small)[-FEWEST_TIME_STEPS:]
    if len(clear) < 2 and (rest != 0.0).all():
        slopes = np.diff(np.log(np.abs(rest))) / np.diff(np.log(h))
        clear = np.arange(len(h) - FEWEST_TIME_STEPS, len(h)) if np.ptp(slopes) < SAME_SLOPE and np.min(slopes) > 0.0 else clear
    if len(clear) < 2 or abs(np.sign(rest[clear]).sum()) < len(clear):
        return math.nan, ()
    slope = float(np.polyfit(np.log(h[clear]), np.log(np.abs(rest[clear])), 1)[0])
    return (slope, tuple(float(step) for step in h[clear])) if slope > 0.5 * ORDERS[0] else (math.nan, ())


def _reason(cause: Cause, e: Array, small: Array, floor: float, order: float) -> str:
    if cause == "model":
        return "approaches a value other than 0" + ("" if math.isnan(order) else f" as dt^{order:.2f}")
    if cause == "discretisation":
        return "vanishes as dt → 0" if math.isnan(order) else f"vanishes as dt^{order:.2f}"
    if (np.abs(e) <= ABOVE_NOISE * small).all():
        return "within the sampling noise at every time step; more start phases would reduce the noise"
    if (np.diff(np.abs(e)) > small[1:]).all():
        return "grows as dt decreases; finer time steps are needed"
    if np.abs(e[-1]) <= floor:
        return "within rounding at the finest time step, but not at coarser ones; finer time steps are needed"
    if np.abs(e[-1]) <= small[-1]:
        return "within the sampling noise at the finest time step, but not at coarser ones; more start phases would reduce the noise"
    return "the time steps do not decide whether it vanishes as dt → 0; finer ones are needed"
