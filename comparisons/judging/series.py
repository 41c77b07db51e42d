"""The series of errors that an error budget is made from: verified numbers, the time steps that are used, and the fitted order."""

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dropspin.comparisons.judging.extrapolation import ORDERS
from dropspin.scenarios import DropspinError
from dropspin.scenarios.state import Array

FEWEST_TIME_STEPS = 3
MOST_TIME_STEPS = 5
"""Largest number of time steps used; more contain little further information about dt → 0."""
WIDEST_RATIO = 15.99
"""The ratio of five halved time steps: coarser ones are left out if more than five reach as far; else the most crowded ones are."""
SMALLEST_RATIO = 3.99
"""Extrapolation needs three time steps that span a factor of four."""
ABOVE_NOISE = 3.0
"""An order is fitted to errors larger than this multiple of their noise."""
SAME_SLOPE = 0.5
"""Slopes between neighbouring time steps that differ by less than this count as one power of the time step."""
BY_CHANCE = 1e-3
"""Errors within rounding follow a power of the time step if independent errors look like it with less than this probability."""
NOTICEABLE = 1e-3
"""Share of an error that its change from one time step to the next must exceed to tell its trend."""
DIVERGING = 0.1
"""Least power of 1/dt, from one time step to the next, with which an error grows so that it may approach no value."""
TWO_DIGITS = 0.01
"""Logarithms of errors that differ by less than this are equal, because errors near rounding have few digits."""
HIGHEST_POWER = 7
"""The effect of a start phase that falls faster than this power of the time step is that of an event which no start met at finer steps."""


def verified(dts: ArrayLike, errors: ArrayLike, resolution: ArrayLike, rounding: ArrayLike) -> tuple[Array, Array, Array, Array]:
    """The series as arrays of one shape.

    Raises:
        DropspinError: A number or a shape is invalid.
    """
    h, e = np.atleast_1d(_numbers("time steps", dts), _numbers("errors", errors))
    if h.ndim != 1 or h.shape != e.shape:
        raise DropspinError(f"an error budget takes one error for each time step; got {h.shape} time steps and {e.shape} errors.")
    if not ((h > 0.0) & np.isfinite(h)).all() or len(np.unique(h)) < len(h):
        raise DropspinError(f"time steps must be positive and different; got {_listed(h)}.")
    return h, e, _spread("resolution", resolution, e), _spread("rounding", rounding, e)


def _spread(name: str, numbers: ArrayLike, errors: Array) -> Array:
    """Numbers that are finite and not negative, one for each error, from these or from one for all."""
    values = _numbers(name, numbers)
    if values.shape not in ((), (1,), errors.shape):
        raise DropspinError(f"{name} takes one number, or one for each of {len(errors)} time steps; got the shape {values.shape}.")
    values = np.broadcast_to(values, errors.shape)
    invalid = values[np.isfinite(errors) & ~((values >= 0.0) & np.isfinite(values))]
    if len(invalid):
        raise DropspinError(f"{name} must be finite and not negative; got {_listed(np.unique(invalid))}.")
    return values


def verify_options(errors: Array, claimed_order: float | None, signed: bool, negligible: float, judged_together: int) -> None:
    """Raise `DropspinError` if an argument that is one number, or the sign of an error, is invalid."""
    if not signed and (errors < 0.0).any():
        raise DropspinError(f"an error without a sign cannot be negative; got {np.nanmin(errors):g}. Pass signed=True if it has a sign.")
    if claimed_order is not None and not claimed_order > 0.0:
        raise DropspinError(f"claimed_order must be positive, or None; got {claimed_order!r}.")
    if not (negligible >= 0.0 and math.isfinite(negligible)):
        raise DropspinError(f"negligible must be finite and not negative; got {negligible!r}.")
    if not (judged_together >= 1 and judged_together % 1 == 0):
        raise DropspinError(f"judged_together must be a whole number from 1; got {judged_together!r}.")


def _numbers(name: str, values: Any) -> Array:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise DropspinError(f"{name} must be numbers; got {values!r}.") from None


def _listed(values: Array) -> str:
    return ", ".join(f"{value:g}" for value in values)


def most_informative(h: Array) -> list[int]:
    """The indices of at most `MOST_TIME_STEPS` of these time steps, which are ordered from the coarsest to the finest."""
    kept = list(range(len(h)))
    while len(kept) > MOST_TIME_STEPS:
        gaps = [h[before] / h[after] for before, after in zip(kept, kept[2:], strict=False)]
        del kept[0 if h[kept[1]] / h[kept[-1]] >= WIDEST_RATIO else 1 + int(np.argmin(gaps))]
    return kept


def start_of_finest(h: Array) -> int:
    """The index of the first of the finest time steps that are at least three and span a factor of four; 0 if there are none."""
    coarse = np.flatnonzero(h >= SMALLEST_RATIO * h[-1])
    return int(min(coarse[-1], len(h) - FEWEST_TIME_STEPS)) if len(coarse) and len(h) > FEWEST_TIME_STEPS else 0


def is_clear_power(h: Array, e: Array) -> bool:
    """Whether the errors follow a power of the time step more closely than independent errors do.

    For independent errors, the probability that the logarithm of one is within r of the line through those of its neighbours is below r,
    and the probability that the last one is smaller than the first by a factor f is below 1/f.
    """
    if not _have_one_sign(e):
        return False
    x, y = np.log(h), np.log(np.abs(e))
    slopes = np.diff(y) / np.diff(x)
    off_line = y[1:-1] - y[:-2] - (y[2:] - y[:-2]) * (x[1:-1] - x[:-2]) / (x[2:] - x[:-2])
    chance = max(float(np.max(np.abs(off_line))), TWO_DIGITS) ** len(off_line) * math.exp(y[-1] - y[0])
    return bool(np.min(slopes) > 0.5 * ORDERS[0] and chance < BY_CHANCE)


def falls_ever_faster(h: Array, e: Array, small: Array) -> bool:
    """Whether errors, coarsest first, fall toward finer steps by more for each factor of the step: they have not begun to converge.

    An error with a largest possible value does so while it leaves this value, and may still vanish. The powers of a series that converges
    do the opposite. The last fall exceeds the noise and `NOTICEABLE` of the error, so that chance does not look like it.
    """
    sizes = e * np.sign(e[-1])
    falls = np.diff(sizes) / np.diff(np.log(h))
    least = max(NOTICEABLE * sizes[-1], ABOVE_NOISE * np.hypot(*small[-2:]))
    is_noticeable = sizes[-2] - sizes[-1] > least
    # Errors at the largest possible value may be equal to the last digit.
    return bool(is_noticeable and (falls >= -least).all() and (np.diff(falls) >= -least).all() and falls[-1] > falls[-2])


def grows_ever_faster(h: Array, e: Array, small: Array) -> bool:
    """Whether errors, coarsest first, grow toward finer steps by more for each factor of the step, at the end at least as dt^-0.1.

    Three errors that change little often grow so by chance, though their limit is known well.
    """
    least = abs(e[-1]) * (1.0 - (h[-1] / h[-2]) ** DIVERGING)
    return bool((e[-1] - e[-2]) * np.sign(e[-1]) > least and falls_ever_faster(h, 2.0 * e[-1] - e, small))  # mirrored at the finest


def grows_without_limit(dts: Array, errors: Array, noise: Array, large: float) -> bool:
    """Whether an error grows at least as fast as 1/dt over the three finest time steps, by more than its noise, from more than `large`.

    An error that vanishes, a dt + b dt² + c dt³ + …, does so only if three of its terms cancel at the coarser ones of these steps.
    """
    finest_first = np.argsort(dts)[:FEWEST_TIME_STEPS]
    h, sizes, by_chance = dts[finest_first], np.sign(errors[np.argmin(dts)]) * errors[finest_first], ABOVE_NOISE * noise[finest_first]
    if len(h) < FEWEST_TIME_STEPS or h[-1] / h[0] < SMALLEST_RATIO:
        return False
    if not (np.isfinite(sizes).all() and sizes[1] > large):
        return False
    return bool(sizes[0] - sizes[1] > by_chance[:2].max() and np.all(np.diff(np.abs(sizes) * h) <= 0.0))


def noise_of_missed(dts: Array, jumps: Array) -> Array:
    """The noise at each time step of an event, such as a missed contact, that one start phase of many met at a coarser step, and none here.

    Of an event at one of n starts, the mean has a standard deviation of 1/n of its effect.

    Args:
        dts: Time steps [s], shape (n,).
        jumps: The effect of a single start phase on the mean over all of them, at each time step.
    """
    effects = np.where(dts[:, None] < dts, jumps * (dts[:, None] / dts) ** HIGHEST_POWER, 0.0)
    return np.max(np.where(effects > jumps[:, None], jumps, 0.0), axis=1)


def fitted_order(h: Array, rest: Array, small: Array) -> tuple[float, tuple[float, ...]]:
    """The slope of the error without the asymptotic error, over the finest steps above the noise, and these steps.

    Errors that noise or rounding could have caused do not count as noise if they follow a power of the time step.
    """
    clear = np.flatnonzero(np.abs(rest) > ABOVE_NOISE * small)
    if len(clear) < 2 and (rest != 0.0).all():
        slopes = np.diff(np.log(np.abs(rest))) / np.diff(np.log(h))
        clear = np.arange(len(h)) if np.ptp(slopes) < SAME_SLOPE and np.min(slopes) > 0.0 else clear
    if len(clear) < 2:
        return math.nan, ()
    clear = clear[start_of_finest(h[clear]) :]
    if not _have_one_sign(rest[clear]):
        return math.nan, ()
    slope = float(np.polyfit(np.log(h[clear]), np.log(np.abs(rest[clear])), 1)[0])
    return (slope, tuple(float(step) for step in h[clear])) if slope > 0.5 * ORDERS[0] else (math.nan, ())


def _have_one_sign(e: Array) -> bool:
    return abs(float(np.sign(e).sum())) == len(e)
