"""Parameters with which an engine continues tosses, in resamples of these: the least losses on grids that are refined around them.

Each toss has a loss, by what remains of its frames beside the errors of its start:

    loss = log(1 + q),    q = rᵀ (J Jᵀ + N + δ² 1)⁻¹ r / d

r are the d differences of poses in these frames [m], rotations times the size of the body; J are their derivatives by the start, each times
a standard deviation, by differences of that size, so that a toss that is sensitive to its start counts little; N is the white noise of the
recording. δ is the discrepancy of the engine: the least for which 90 % of the tosses have q ≤ 2, so that tosses that no value fits, often
those of several impacts, keep their weight beside those that one value fits well. The logarithm bounds the influence of a toss.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from dropspin.comparisons.logs.continued_tosses import Launches, launches, poses, recorded, time_step, usable
from dropspin.comparisons.logs.flights import Flights
from dropspin.comparisons.logs.intervals import resamples
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.scenarios.rotations import rotation_vector
from dropspin.scenarios.state import ORIENTATION, POSITION, Array

FIRST_GRID = {"friction": np.linspace(0.0, 1.0, 7) ** 1.5, "restitution": np.linspace(0.0, 1.0, 7)}
GRID, FINER = 7, 8
"""Values of a parameter in a refined grid, and of values between two of them to which residuals are interpolated."""
MOST_GRIDS = 8
MARGIN = 0.25
"""Of a finer grid beside the estimates of the resamples, as a share of the distance of two values of the coarser one."""
CORE = 0.2
"""Share of the resamples on either side of the dense part of a grid."""
FINE_ENOUGH, FINEST, FINEST_BOUND = 1.0, 1e-3, 1e-2
"""Distance of two values of the dense part over its width, and the distances below which no finer grid is needed: around estimates, and
around the bound of those that have one bound alone.
"""
SHARE, LIMIT = 0.9, 2.0
"""The share of the tosses whose q is at most the limit, by the choice of δ; the engine that made the tosses leaves q near 1."""
ROUNDS = 3
"""Rounds in which the parameters and the discrepancy are found, each by the other."""
DISCREPANCIES = np.concatenate([[0.0], np.geomspace(1e-6, 1.0, 121)])
"""Discrepancies to choose from [m]."""
UNCHANGED = 1e-6
"""Change of a quaternion in a toss that is none."""
TIE = 1e-3
"""Of sums of losses: parameters with which a sum is larger by no more are as good."""


class Problem(NamedTuple):
    """What all engines are given: the tosses, and those from starts that differ by a standard deviation in each of 12 directions.

    Rotations are left out if the orientation of a toss never changes: whoever records positions alone writes one quaternion in all rows.
    """

    measured: Array
    launched: Launches
    perturbed: Launches
    variances: Array


class Profile(NamedTuple):
    """The estimates of an engine in resamples of the tosses.

    Attributes:
        lower: The least values that are as good as the best, by resample and parameter, shape (RESAMPLES, 2).
        upper: The largest ones.
        best: The least and the largest from the tosses themselves, shape (2, 2).
        discrepancy: δ [m].
        remainder: What may be left of the effect of the time step on the estimates, shape (2,).
    """

    lower: Array
    upper: Array
    best: Array
    discrepancy: float
    remainder: Array = np.zeros(2)

    @property
    def value(self) -> Array:
        """The estimates from the tosses themselves, shape (2,)."""
        return np.asarray(self.best.mean(axis=0))


def problem_of(flights: Flights, frames: int, steps: int) -> Problem:
    """What all engines are given, with a number of time steps in a frame."""
    header, starts = flights.log.header, usable(flights, frames)
    dt, moved = time_step(starts, steps), np.concatenate([start.moved(start.deviations) for start in starts])
    launched = launches(header, starts, np.array([start.state for start in starts]), dt, frames)
    perturbed = launches(header, [start for start in starts for _ in range(12)], moved, dt, frames)
    noises = [flights.moving.noise.white]
    if all(np.ptp(start.toss.orientation, axis=0).max() > UNCHANGED for start in starts):
        noises.append(header.body.size * flights.turning.noise.white)
    return Problem(recorded(starts, frames)[:, 1:], launched, perturbed, np.tile(np.repeat(noises, 3) ** 2, frames))


def profile_of(problem: Problem, entry: EngineEntry, processes: EngineProcesses, report: Callable[[str], None]) -> Profile | Breakdown:
    """The estimates of an engine in resamples of the tosses, on grids that are refined around them."""
    axes, counts = tuple(FIRST_GRID.values()), resamples(len(problem.measured))
    for number in range(1, MOST_GRIDS + 1):
        report(f"{entry.label}, grid {number}")
        floors = [{"friction": f, "restitution": e} for f in axes[0].tolist() for e in axes[1].tolist()]
        found = processes.call(entry, poses, problem.launched, floors)
        if isinstance(found, Breakdown):
            return found
        residuals = _differences(problem, problem.measured, found)
        best = int(np.argmin(np.median(np.mean(residuals**2, axis=2), axis=1)))
        around = processes.call(entry, poses, problem.perturbed, [floors[best]])
        if isinstance(around, Breakdown):
            return around
        nominal = found[best, :, 1:]
        derivatives = _differences(problem, np.repeat(nominal, 12, axis=0), around)[0].reshape(*nominal.shape[:1], 12, -1)
        losses, discrepancy = _losses(residuals, derivatives, problem.variances, axes)
        profile = Profile(*_best(losses, axes, counts), discrepancy)
        each = zip(axes, FIRST_GRID.values(), profile.lower.T, profile.upper.T, strict=True)
        refined = [_refined(*of_axis) for of_axis in each]
        if all(new is None for new in refined):
            break
        axes = tuple(axis if new is None else new for axis, new in zip(axes, refined, strict=True))
    return profile


def _differences(problem: Problem, reference: Array, found: Array) -> Array:
    """Poses minus those of a reference, shape (m, frames, 7), without the first frame, in metres, shape (scenes, m, variances)."""
    seen = found[:, :, 1:]
    parts = [seen[..., POSITION] - reference[..., POSITION]]
    if len(problem.variances) > parts[0][0, 0].size:
        parts.append(problem.launched.scene.body.size * rotation_vector(reference[..., ORIENTATION], seen[..., ORIENTATION]))
    return np.concatenate(parts, axis=-1).reshape(*seen.shape[:2], -1)


def _losses(residuals: Array, derivatives: Array, variances: Array, axes: tuple[Array, ...]) -> tuple[Array, float]:
    """The losses of tosses by the values of the two parameters between those of a grid, shape (a, b, m), and the discrepancy [m].

    Residuals depend on the parameters nearly linearly, so that they are interpolated, and not the losses.
    """
    values, vectors = np.linalg.eigh(np.einsum("mki,mkj->mij", derivatives, derivatives) + np.diag(variances))
    first, second = (_interpolation(axis)[1] for axis in axes)
    turned = np.einsum("tmi,mij->mtj", residuals, vectors, optimize=True).reshape(len(values), len(axes[0]), len(axes[1]), -1)

    def losses() -> Array:
        each = zip(turned, values + discrepancy**2, strict=True)  # one after another, for a toss takes megabytes
        squares = (np.einsum("ai,bj,ijn->abn", first, second, toss, optimize=True) ** 2 @ (1.0 / variances) for toss, variances in each)
        return np.log1p(np.stack(list(squares), axis=-1) / values.shape[1])

    discrepancy = 0.0
    for _ in range(ROUNDS):
        sums = losses().sum(axis=2)
        a, b = np.unravel_index(np.argmin(sums), sums.shape)
        at_best = np.einsum("i,j,mijn->mn", first[a], second[b], turned, optimize=True) ** 2
        tried = np.mean(at_best / (values + DISCREPANCIES[:, np.newaxis, np.newaxis] ** 2), axis=2)
        discrepancy = float(DISCREPANCIES[np.argmax(np.quantile(tried, SHARE, axis=1) <= LIMIT)])
    return losses(), discrepancy


def _best(losses: Array, axes: tuple[Array, ...], counts: Array) -> tuple[Array, Array, Array]:
    """The least and the largest of the best parameters in resamples, shapes (RESAMPLES, 2), and from the tosses themselves, (2, 2)."""
    lower, upper = np.empty((2, len(counts) + 1, 2))
    sums = np.tensordot(np.vstack([counts, np.ones(counts.shape[1])]), losses, axes=(1, 2))
    for column, axis in enumerate(axes):
        values, least = _interpolation(axis)[0], sums.min(axis=2 - column)
        good = least <= least.min(axis=1, keepdims=True) + TIE
        lower[:, column] = values[np.argmax(good, axis=1)]
        upper[:, column] = values[len(values) - 1 - np.argmax(good[:, ::-1], axis=1)]
    return lower[:-1], upper[:-1], np.stack([lower[-1], upper[-1]])


def _interpolation(axis: Array) -> tuple[Array, Array]:
    """Values between those of a grid, and the matrix that interpolates to them, on chords: a curve has minima beside a kink."""
    between = np.interp(np.arange(FINER * (len(axis) - 1) + 1) / FINER, np.arange(len(axis)), axis)
    return between, np.stack([np.interp(between, axis, one) for one in np.eye(len(axis))], axis=1)


def _refined(axis: Array, tried: Array, lower: Array, upper: Array) -> Array | None:
    """A grid around the estimates of almost all resamples, dense around those of most; None if the grid is fine enough.

    `tried` is the first grid, beyond which no value is. If estimates are bounded on one side alone, it is dense around this bound, from the
    last value that is excluded.
    """
    low, core_low = (float(value) for value in np.quantile(lower, [0.005, CORE]))
    core_high, high = (float(value) for value in np.quantile(upper, [1.0 - CORE, 0.995]))
    from_below, from_above = core_low > tried[0], core_high < tried[-1]
    is_bound = from_below != from_above
    if is_bound and from_below:
        core_low, core_high = float(axis[max(0, int(np.searchsorted(axis, low)) - 1)]), float(np.quantile(lower, 1.0 - CORE))
    elif is_bound:
        core_low = float(np.quantile(upper, CORE))
        core_high = float(axis[min(len(axis) - 1, int(np.searchsorted(axis, high, side="right")))])
    step = float(np.diff(axis)[max(0, np.searchsorted(axis, core_low) - 1) : np.searchsorted(axis, core_high) + 1].max())
    encloses = (axis[0] < low or axis[0] == tried[0]) and (high < axis[-1] or axis[-1] == tried[-1])
    if encloses and step <= (FINEST_BOUND if is_bound else max(FINE_ENOUGH * (core_high - core_low), FINEST)):
        return None
    margin = (0.0 if encloses else step) if is_bound else MARGIN * step
    ends = [min(low, core_low) - margin, core_low - margin, core_high + margin, max(high, core_high) + margin]
    first, begin, end, last = np.clip(ends, tried[0], tried[-1])
    return np.unique([first, *np.linspace(begin, end, GRID - 2), last])
