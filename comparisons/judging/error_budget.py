"""Error budget: from an error at three or more time steps to its order, its asymptotic value as dt → 0, and its cause.

    e(h) = m + C hᵖ      m the asymptotic error, p the observed order

An error that vanishes as h → 0 is a discretisation error; one that does not is a model error. m is Richardson's extrapolation from the
three finest steps, with the order, among those that methods have, that is nearest to the one observed. It is found again with the observed
order and with each pair of powers that might look like it. The spread of these values estimates the effect of neglected powers of the step;
three times that (Roache's factor for an order that is not known beforehand) is the uncertainty.

Source: L. F. Richardson & J. A. Gaunt, Phil. Trans. R. Soc. A 226 (1927); P. J. Roache, J. Fluids Engineering 116 (1994).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from comparisons.judging.verdicts import Cause

Array = NDArray[np.float64]

FEWEST_TIME_STEPS = 3
SMALLEST_RATIO = 3.99
"""Extrapolation needs three time steps that span a factor of four."""
MIXED_WITH = {
    1.0: [(1.0, 2.0)],
    2.0: [(1.0, 2.0), (2.0, 3.0), (2.0, 4.0)],
    3.0: [(2.0, 3.0), (3.0, 4.0)],
    4.0: [(3.0, 4.0), (4.0, 5.0), (4.0, 6.0)],
}
"""The orders that methods have, and the pairs of powers of the step that look like that order at three time steps."""
NEAR_AN_ORDER = 0.15
PLAIN_SERIES = 2.0
"""A sum of powers whose terms add up to more than this many times their sum explains an error by cancellation only."""
SAFETY = 3.0
LOWEST_ORDER, HIGHEST_ORDER = 0.5, 8.0
HIGHEST_WITHOUT_CLAIM = 2.0
SAME_SLOPE = 0.3
"""Slopes between neighbouring steps that differ by less belong to one power of the step."""
SAME_ORDER = 0.05
"""Slopes that differ by less are asymptotic: finer steps would show the same."""
TOO_FAR_FOR_CHANCE = 10.0
"""Errors no larger than rounding may still follow a power of the step if they fall by this factor."""
GROWTH = 1.25
"""An error that is larger by this factor at the finest step, than at any coarser one or at the end of a rise, grows as the step shrinks."""
PLATEAU = 0.1
"""An error that changes by a smaller share over the steps, and less from step to step, does not depend on them."""
CONSTANT = 0.01
"""Nor does one that changes by a smaller share than this in any way."""


@dataclass(frozen=True)
class ErrorBudget:
    """How an error depends on the time step.

    Attributes:
        cause: What the error is attributed to.
        order: Observed order p; NaN where there is none.
        window: The steps that the order was fitted in [s], coarsest first.
        left_out: The other steps, each with the reason it was left out.
        asymptotic_error: The error that does not vanish as dt → 0, in the metric's unit; NaN where it is undefined.
        uncertainty: Of the asymptotic error.
        reason: Why, in a sentence.
        is_asymptotic: Whether the order is the same from step to step, so that finer steps would show it too.
    """

    cause: Cause
    order: float
    window: tuple[float, ...]
    left_out: tuple[tuple[float, str], ...]
    asymptotic_error: float
    uncertainty: float
    reason: str
    is_asymptotic: bool = True


def is_sufficient(dts: Sequence[float]) -> bool:
    """Whether time steps are enough for extrapolation: three that span a factor of four."""
    return len(dts) >= FEWEST_TIME_STEPS and max(dts) / min(dts) >= SMALLEST_RATIO


def error_budget(
    dts: Array, errors: Array, resolution: Array, rounding: Array, claimed: float | None = None, *, signed: bool = True, jumps: bool = False
) -> ErrorBudget:
    """The order, the asymptotic value and the cause of one error.

    Args:
        dts: Time steps [s], shape (n,), in any order.
        errors: The error at each, with its sign if it has one; NaN where the step was too coarse to resolve it.
        resolution: The sampling noise of each (start phases are a sample), in the same unit.
        rounding: The largest error that rounding alone may cause.
        claimed: The order that the method is known to have, if it is; else lower powers of the step may hide behind a higher one.
        signed: Whether the error can be negative; one that cannot has no negative asymptotic value either.
        jumps: Whether the error is a count or similar, which no power of the step describes.
    """
    coarsest_first = np.argsort(-dts)
    h, e, noise, floor = (values[coarsest_first] for values in (dts, errors, resolution, rounding))
    known = np.isfinite(e)
    unresolved = tuple((float(step), "too coarse to resolve") for step in h[~known])
    h, e, noise, floor = h[known], e[known], noise[known], floor[known]
    if not is_sufficient(list(h)):
        reason = f"only {len(h)} of {len(dts)} time steps are usable; extrapolation needs three that span a factor of four"
        return ErrorBudget("unresolved", math.nan, (), unresolved, math.nan, math.nan, reason)
    if jumps and (np.abs(e) > floor).any():
        return _without_a_power(h, e, noise + floor, unresolved)
    window = _window(h, e, floor)
    steps = tuple(float(step) for step in h[window])
    left_out = unresolved + tuple((float(h[n]), "rounding" if n >= window.stop else "too coarse") for n in _outside(window, len(h)))
    order = float(np.polyfit(np.log(h[window]), np.log(np.abs(e[window])), 1)[0]) if steps else math.nan
    if len(steps) == 2:
        return ErrorBudget("discretisation", order, steps, left_out, float(e[-1]), float(floor[-1]), "shrinks down to rounding")
    if not steps and (np.abs(e) <= floor).all():
        return ErrorBudget("rounding", math.nan, (), unresolved, float(e[-1]), float(floor[-1]), "as small as rounding at every step")
    if not steps and (np.abs(e) <= noise + floor).all():
        reason = "smaller at every step than the sampling noise of the start phases"
        return ErrorBudget("discretisation", math.nan, (), unresolved, float(e[-1]), float(noise[-1] + floor[-1]), reason)
    finest = slice(window.stop - 3, window.stop) if steps else slice(len(h) - 3, len(h))
    observed, limit, uncertainty = _extrapolate(h[finest], e[finest], noise[finest], claimed)
    uncertainty = max(uncertainty + float(floor[-1]), 0.0 if signed else -limit)
    if math.isnan(observed) and steps:
        reason = f"shrinks as dt^{order:.2f}; the asymptotic error is undefined"
        most = float(abs(e[-1]) + noise[-1] + floor[-1])
        return ErrorBudget("discretisation", order, steps, left_out, float(e[-1]), most, reason, _is_asymptotic(h[window], e[window]))
    if math.isnan(observed):
        return _without_a_power(h, e, noise + floor, unresolved)
    if abs(limit) <= uncertainty:
        fitted, within = (order, steps) if steps else (observed, tuple(float(step) for step in h[finest]))
        reason = f"shrinks as dt^{fitted:.2f}"
        return ErrorBudget("discretisation", fitted, within, left_out, limit, uncertainty, reason, _is_asymptotic(h[finest], e[finest]))
    reason = f"approaches a value other than 0 as dt^{observed:.2f}"
    return ErrorBudget("model", observed, tuple(float(step) for step in h[finest]), unresolved, limit, uncertainty, reason)


def _window(h: Array, e: Array, floor: Array) -> slice:
    """The longest run of steps in which the error is one power of the step; finer steps are left out only as rounding.

    Two steps do only where all finer ones are down to rounding. Empty if there is no such run.
    """
    size = np.abs(e)
    for stop in range(len(h), 1, -1):
        if stop < len(h) and size[stop] > floor[stop]:
            break
        for start in range(stop - (1 if stop < len(h) else 2)):
            run = slice(start, stop)
            if (size[run] == 0.0).any() or abs(np.sign(e[run]).sum()) < stop - start:
                continue
            slopes = np.diff(np.log(size[run])) / np.diff(np.log(h[run]))
            by_chance = size[start] <= floor[start] and size[start] < TOO_FAR_FOR_CHANCE * size[stop - 1]
            if slopes.min() >= LOWEST_ORDER and np.ptp(slopes) <= SAME_SLOPE and not by_chance:
                return run
    return slice(0, 0)


def _is_asymptotic(h: Array, e: Array) -> bool:
    return bool(np.ptp(np.diff(np.log(np.abs(e))) / np.diff(np.log(h))) <= SAME_ORDER)


def _outside(window: slice, count: int) -> list[int]:
    return [n for n in range(count) if window.stop > 0 and not window.start <= n < window.stop]


def _extrapolate(h: Array, e: Array, noise: Array, claimed: float | None) -> tuple[float, float, float]:
    """Observed order, asymptotic error and its uncertainty from three steps, coarsest first; NaN where they follow no power of the step."""
    first, second = e[0] - e[1], e[1] - e[2]
    if abs(second) <= noise[1] + noise[2] or second == 0.0:
        return math.nan, math.nan, math.nan

    from scipy.optimize import brentq

    def excess(p: float) -> float:
        return float((h[0] ** p - h[1] ** p) / (h[1] ** p - h[2] ** p) - first / second)

    if excess(LOWEST_ORDER) * excess(HIGHEST_ORDER) > 0.0:
        return math.nan, math.nan, math.nan
    observed = float(brentq(excess, LOWEST_ORDER, HIGHEST_ORDER))
    nearest = min(MIXED_WITH, key=lambda p: abs(p - observed))
    # A high order without a claim is more likely an error of the coarsest step that is not asymptotic yet.
    could_hide_lower_powers = nearest != claimed and (nearest > HIGHEST_WITHOUT_CLAIM or (nearest > 1.0 and _is_a_plain_series(h, e)))
    if abs(nearest - observed) > NEAR_AN_ORDER or could_hide_lower_powers:
        return math.nan, math.nan, math.nan

    def without(*powers: float) -> float:
        """The asymptotic error if the rest consists of these powers of the step."""
        used = len(powers) + 1
        return float(np.linalg.solve(h[-used:, None] ** np.array([0.0, *powers]), e[-used:])[0])

    limit = without(nearest)
    others = [without(observed), *(without(low, high) for low, high in MIXED_WITH[nearest])]
    shares = h[[2, 1]] ** nearest / (h[1] ** nearest - h[2] ** nearest)
    from_noise = (1.0 + shares[0]) * noise[2] + shares[0] * noise[1]
    return observed, limit, float(SAFETY * np.max(np.abs(limit - np.array(others))) + from_noise)


def _is_a_plain_series(h: Array, e: Array) -> bool:
    """Whether C₁ h + C₂ h² + C₃ h³ meets three errors without terms that cancel at the coarsest step."""
    terms = np.linalg.solve((h[:, None] / h[0]) ** np.array([1.0, 2.0, 3.0]), e)
    return bool(np.sum(np.abs(terms)) <= PLAIN_SERIES * abs(e[0]))


def _without_a_power(h: Array, e: Array, small: Array, unresolved: tuple[tuple[float, str], ...]) -> ErrorBudget:
    """The budget of an error that follows no power of the step."""
    limit, spread = float(e[-1]), float(np.ptp(e[-3:]) + small[-1])
    settles = abs(e[-2] - e[-1]) <= abs(e[-3] - e[-2]) + small[-2] + small[-1]
    if settles and spread <= PLATEAU * abs(limit) + small[-1] and abs(limit) > spread:
        return ErrorBudget("model", math.nan, (), unresolved, limit, spread, "does not depend on dt")
    if spread <= CONSTANT * abs(limit):
        return ErrorBudget("model", math.nan, (), unresolved, limit, SAFETY * spread, "does not depend on dt")
    coarser = float(np.max(np.abs(e[:-1])))
    grows = bool((np.diff(np.abs(e[-3:])) > small[-1]).all()) and abs(limit) > GROWTH * abs(e[-3]) + small[-1]
    if grows or abs(limit) > GROWTH * coarser + small[-1]:
        return ErrorBudget("model", math.nan, (), unresolved, limit, 0.0, "grows as dt shrinks")
    if abs(limit) <= coarser * math.sqrt(h[-1] / h[0]) + small[-1]:
        return ErrorBudget("discretisation", math.nan, (), unresolved, limit, abs(limit) + small[-1], "shrinks, but not as a power of dt")
    return ErrorBudget("unresolved", math.nan, (), unresolved, limit, spread, "follows no power of dt; take finer time steps")
