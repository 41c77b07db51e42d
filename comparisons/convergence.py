"""Errors taken apart: from an error at three or more steps to its order, its limit as the step goes to 0, and its cause.

    e(h) = m + C hᵖ      m the limit, p the observed order

An error whose limit is 0 is the step's; one whose limit is not 0 is the model's. The limit is Richardson's, from the three finest steps and
the order, among those that methods have, that is nearest to the one observed. It is found again from the observed order itself and from
each pair of powers that might look like it; how far these limits are apart is what neglected powers of the step may amount to, and three
times that (Roache's factor for an order that is not known beforehand) is the uncertainty.

Source: L. F. Richardson & J. A. Gaunt, Phil. Trans. R. Soc. A 226 (1927); P. J. Roache, J. Fluids Engineering 116 (1994).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]
Cause = Literal["discretisation", "model", "setting", "rounding", "chaotic", "unresolved"]

LEAST_STEPS = 3
SMALLEST_RANGE = 3.99
"""Fewer steps than three, or a range of less than four, say nothing about how errors shrink."""
MIXED_WITH = {
    1.0: [(1.0, 2.0)],
    2.0: [(1.0, 2.0), (2.0, 3.0), (2.0, 4.0)],
    3.0: [(2.0, 3.0), (3.0, 4.0)],
    4.0: [(3.0, 4.0), (4.0, 5.0), (4.0, 6.0)],
}
"""The orders that methods have, and the pairs of powers of the step that three steps may show as about that order."""
NEAR_AN_ORDER = 0.15
PLAIN_SERIES = 2.0
"""A sum of powers of the step whose terms add up to more than this many times their sum explains an error by cancellation only."""
SAFETY = 3.0
LOWEST_ORDER, HIGHEST_ORDER = 0.5, 8.0
HIGHEST_WITHOUT_CLAIM = 2.0
SAME_SLOPE = 0.3
"""Slopes between neighbouring steps that differ by less belong to one power of the step."""
SAME_ORDER = 0.05
"""Slopes that differ by less are those of the finest steps to come."""
TOO_FAR_FOR_CHANCE = 10.0
"""Errors no larger than rounding may still follow a power of the step, if they fall by so much."""
GROWTH = 1.25
"""An error that is larger by this factor at the finest step, than at any coarser one or at the end of a rise, grows as the step shrinks."""
PLATEAU = 0.1
"""An error that changes by a smaller share over the steps, and less from step to step, does not depend on them."""
STILL = 0.01
"""Nor does one that changes by less than this, however it does."""


@dataclass(frozen=True)
class Convergence:
    """How an error depends on the step.

    Attributes:
        cause: What the error is due to.
        order: Observed order p; NaN where there is none to observe.
        window: The steps that the order was fitted in [s], coarsest first.
        left_out: The other steps, each with the reason.
        limit: The error that stays as the step goes to 0, in the metric's unit; NaN where it cannot be told.
        uncertainty: Of the limit.
        reason: A sentence.
        is_asymptotic: Whether the order does not change from step to step, so that finer steps would show it too.
    """

    cause: Cause
    order: float
    window: tuple[float, ...]
    left_out: tuple[tuple[float, str], ...]
    limit: float
    uncertainty: float
    reason: str
    is_asymptotic: bool = True


def says_something(dts: Sequence[float]) -> bool:
    """Whether so many steps, so far apart, tell how errors shrink."""
    return len(dts) >= LEAST_STEPS and max(dts) / min(dts) >= SMALLEST_RANGE


def take_apart(
    dts: Array, errors: Array, resolution: Array, rounding: Array, claimed: float | None = None, *, signed: bool = True, jumps: bool = False
) -> Convergence:
    """The order, limit and cause of one error.

    Args:
        dts: Steps [s], shape (n,), in any order.
        errors: The error at each, with its sign if it has one; NaN where the step was too coarse to tell.
        resolution: How finely each was measured (start phases are a sample), in the same unit.
        rounding: What rounding alone may have brought about.
        claimed: The order that the method is known to have, if it is; else lower powers of the step may hide behind a higher one.
        signed: Whether the error can be negative; one that cannot has no negative limit either, however it looks from three steps.
        jumps: Whether the error is a count or the like, which no power of the step describes.
    """
    coarsest_first = np.argsort(-dts)
    h, e, noise, floor = (values[coarsest_first] for values in (dts, errors, resolution, rounding))
    known = np.isfinite(e)
    untold = tuple((float(step), "too coarse to tell") for step in h[~known])
    h, e, noise, floor = h[known], e[known], noise[known], floor[known]
    if not says_something(list(h)):
        told = f"told by {len(h)} of {len(dts)} steps; it takes three, a factor of four apart"
        return Convergence("unresolved", math.nan, (), untold, math.nan, math.nan, told)
    if jumps and (np.abs(e) > floor).any():
        return _without_a_power(h, e, noise + floor, untold)
    window = _window(h, e, floor)
    steps = tuple(float(step) for step in h[window])
    left_out = untold + tuple((float(h[n]), "rounding" if n >= window.stop else "too coarse") for n in _outside(window, len(h)))
    order = float(np.polyfit(np.log(h[window]), np.log(np.abs(e[window])), 1)[0]) if steps else math.nan
    if len(steps) == 2:
        return Convergence("discretisation", order, steps, left_out, float(e[-1]), float(floor[-1]), "shrinks until rounding is left")
    if not steps and (np.abs(e) <= floor).all():
        return Convergence("rounding", math.nan, (), untold, float(e[-1]), float(floor[-1]), "as small as rounding at every step")
    if not steps and (np.abs(e) <= noise + floor).all():
        told = "smaller at every step than the start phases resolve"
        return Convergence("discretisation", math.nan, (), untold, float(e[-1]), float(noise[-1] + floor[-1]), told)
    finest = slice(window.stop - 3, window.stop) if steps else slice(len(h) - 3, len(h))
    observed, limit, uncertainty = _limit(h[finest], e[finest], noise[finest], claimed)
    uncertainty = max(uncertainty + float(floor[-1]), 0.0 if signed else -limit)
    if math.isnan(observed) and steps:
        told = f"shrinks as step^{order:.2f}; its limit cannot be told"
        most = float(abs(e[-1]) + noise[-1] + floor[-1])
        return Convergence("discretisation", order, steps, left_out, float(e[-1]), most, told, _is_asymptotic(h[window], e[window]))
    if math.isnan(observed):
        return _without_a_power(h, e, noise + floor, untold)
    if abs(limit) <= uncertainty:
        fitted, within = (order, steps) if steps else (observed, tuple(float(step) for step in h[finest]))
        told = f"shrinks as step^{fitted:.2f}"
        return Convergence("discretisation", fitted, within, left_out, limit, uncertainty, told, _is_asymptotic(h[finest], e[finest]))
    told = f"approaches a wrong limit as step^{observed:.2f}"
    return Convergence("model", observed, tuple(float(step) for step in h[finest]), untold, limit, uncertainty, told)


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


def _limit(h: Array, e: Array, noise: Array, claimed: float | None) -> tuple[float, float, float]:
    """Observed order, limit and its uncertainty from three steps, coarsest first; NaN where they follow no power of the step."""
    first, second = e[0] - e[1], e[1] - e[2]
    if abs(second) <= noise[1] + noise[2] or second == 0.0:
        return math.nan, math.nan, math.nan

    def excess(p: float) -> float:
        return float((h[0] ** p - h[1] ** p) / (h[1] ** p - h[2] ** p) - first / second)

    if excess(LOWEST_ORDER) * excess(HIGHEST_ORDER) > 0.0:
        return math.nan, math.nan, math.nan
    observed = float(brentq(excess, LOWEST_ORDER, HIGHEST_ORDER))
    nearest = min(MIXED_WITH, key=lambda p: abs(p - observed))
    # A high order that nobody claims is more likely a coarsest step in trouble of its own.
    could_hide_lower_powers = nearest != claimed and (nearest > HIGHEST_WITHOUT_CLAIM or (nearest > 1.0 and _is_a_plain_series(h, e)))
    if abs(nearest - observed) > NEAR_AN_ORDER or could_hide_lower_powers:
        return math.nan, math.nan, math.nan

    def without(*powers: float) -> float:
        """The limit if these powers of the step, and no others, make up the error."""
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


def _without_a_power(h: Array, e: Array, small: Array, untold: tuple[tuple[float, str], ...]) -> Convergence:
    """What can be said of an error that follows no power of the step."""
    limit, spread = float(e[-1]), float(np.ptp(e[-3:]) + small[-1])
    settles = abs(e[-2] - e[-1]) <= abs(e[-3] - e[-2]) + small[-2] + small[-1]
    if settles and spread <= PLATEAU * abs(limit) + small[-1] and abs(limit) > spread:
        return Convergence("model", math.nan, (), untold, limit, spread, "does not depend on the step")
    if spread <= STILL * abs(limit):
        return Convergence("model", math.nan, (), untold, limit, SAFETY * spread, "does not depend on the step")
    coarser = float(np.max(np.abs(e[:-1])))
    grows = bool((np.diff(np.abs(e[-3:])) > small[-1]).all()) and abs(limit) > GROWTH * abs(e[-3]) + small[-1]
    if grows or abs(limit) > GROWTH * coarser + small[-1]:
        return Convergence("model", math.nan, (), untold, limit, 0.0, "grows as the step shrinks")
    if abs(limit) <= coarser * math.sqrt(h[-1] / h[0]) + small[-1]:
        return Convergence("discretisation", math.nan, (), untold, limit, abs(limit) + small[-1], "shrinks, but as no power of the step")
    return Convergence("unresolved", math.nan, (), untold, limit, spread, "follows no power of the step; take finer steps")
