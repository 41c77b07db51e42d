"""Friction and restitution that an engine needs to continue the tosses of a recording, from the frames after the first contact.

Each toss has a loss, by what remains of its frames beside the errors of its start:

    loss = log(1 + q),    q = rᵀ (J Jᵀ + N + δ² 1)⁻¹ r / d

r are the d differences of poses in these frames [m], rotations times the size of the body; J are their derivatives by the start, each times
a standard deviation, by differences of that size, so that a toss that is sensitive to its start counts little; N is the white noise of the
recording. δ is the discrepancy of the engine: the least for which 90 % of the tosses have q ≤ 2, so that tosses that no value fits, often
those of several impacts, keep their weight beside those that one value fits well. The logarithm bounds the influence of a toss. The grid of
the two parameters is refined around the estimates of all resamples.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import combinations, pairwise
from pathlib import Path

import numpy as np
from scipy.interpolate import make_interp_spline

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.logs.flights import Flights
from dropspin.comparisons.logs.intervals import expanded, resamples
from dropspin.comparisons.logs.log import Header, Log
from dropspin.comparisons.logs.replay import (
    Launches,
    flights_in,
    launches,
    of_each_engine,
    poses,
    recorded,
    scene_of,
    time_step,
    tracked,
    usable,
)
from dropspin.comparisons.running.entries import engine_entries
from dropspin.comparisons.running.inputs import EngineEntry
from dropspin.comparisons.running.processes import EngineProcesses, ResourceLimits
from dropspin.comparisons.running.recording import Breakdown
from dropspin.scenarios import Scenario
from dropspin.scenarios.rotations import rotation_vector
from dropspin.scenarios.state import ORIENTATION, POSITION, Array
from dropspin.scenarios.variations import with_values

ENGINES = ("mujoco", "wang[contact=sequential,law=coulomb]")
FRAMES = 8
"""Frames after the last one of the flight."""
FIRST_GRID = {"friction": np.linspace(0.0, 1.0, 9) ** 1.5, "restitution": np.linspace(0.0, 1.0, 9)}
GRID, FINER = 7, 8
"""Values of a parameter in a refined grid, and of values between two of them at which the losses are interpolated."""
MOST_GRIDS = 8
MARGIN = 0.75
"""Of a finer grid beside the estimates of the resamples, as a share of the distance of two values of the coarser one."""
FINE_ENOUGH = 0.3
"""Distance of two values of a grid over the width of the estimates of 99 % of the resamples."""
SHARE, LIMIT = 0.9, 2.0
"""The share of the tosses whose q is at most the limit, by the choice of δ; the engine that made the tosses leaves q near 1."""
ROUNDS = 3
"""Rounds in which the parameters and the discrepancy are found, each by the other."""
DISCREPANCIES = np.concatenate([[0.0], np.geomspace(1e-6, 1.0, 121)])
"""Discrepancies to choose from [m]."""
TIE = 1e-3
"""Of sums of losses: parameters with which a sum is larger by no more are as good."""


@dataclass(frozen=True)
class Estimate:
    """A parameter of the floor for an engine, with its 95 % interval.

    Attributes:
        engine: The engine's label.
        parameter: `friction` or `restitution`.
        value: The estimate.
        lower: Lower end of the interval.
        upper: Upper end of the interval.
        has_lower: Whether the tosses bound it from below; if not, `lower` is that of the values tried.
        has_upper: Whether the tosses bound it from above.
    """

    engine: str
    parameter: str
    value: float
    lower: float
    upper: float
    has_lower: bool
    has_upper: bool


@dataclass(frozen=True)
class Disagreement:
    """A parameter of which two engines need different values for the same tosses: first - second, with its 95 % interval."""

    parameter: str
    first: str
    second: str
    difference: float
    lower: float
    upper: float


@dataclass(frozen=True)
class LogFit:
    """Friction and restitution by engine.

    Attributes:
        tosses: Number of tosses.
        frames: Number of frames of each after its flight.
        estimates: The parameters of each engine.
        disagreements: The parameters on which two engines disagree.
        discrepancies: By engine, what it leaves of these frames beside noise and errors of the start [m].
        left_out: By engine, why it has no estimate.
    """

    tosses: int
    frames: int
    estimates: tuple[Estimate, ...]
    disagreements: tuple[Disagreement, ...]
    discrepancies: Mapping[str, float]
    left_out: Mapping[str, str]


@dataclass(frozen=True, eq=False)
class _Problem:
    """What all engines are given: the tosses, and those from starts that differ by a standard deviation in each of 12 directions."""

    scene: Scenario
    dt: float
    measured: Array
    launched: Launches
    perturbed: Launches
    header: Header
    variances: Array


@dataclass(frozen=True, eq=False)
class _Profile:
    """The estimates of an engine in resamples of the tosses.

    Attributes:
        lower: The least values that are as good as the best, by resample and parameter, shape (RESAMPLES, 2).
        upper: The largest ones.
        value: The estimate from the tosses themselves, shape (2,).
        discrepancy: δ [m].
    """

    lower: Array
    upper: Array
    value: Array
    discrepancy: float


def log_fit(
    recording: Flights | Log | str | Path,
    engines: Engine | str | Iterable[Engine | str] = (),
    frames: int = FRAMES,
    *,
    on_progress: Callable[[str, float], None] | None = None,
    resources: ResourceLimits = ResourceLimits(),  # noqa: B008 - it is immutable
    jobs: int | None = None,
) -> LogFit:
    """Estimate the friction and the restitution of the floor that engines need to continue the tosses of a recording.

    Args:
        recording: A recording, the path of its header, or the flights found in it.
        engines: One engine or several: engines, or names with options.
        frames: Number of frames of each toss to use after its flight.
        on_progress: Called with a description of the current work and the fraction of the engines that are done.
        resources: The processor time [s] and memory [bytes] that each piece of work may use.
        jobs: Number of engines at a time; by default, the number of processors that this process may use. It changes no result.

    Returns:
        Friction and restitution for each engine, with 95 % intervals.

    Raises:
        DropspinError: The recording has no floor, or too few tosses with frames after a flight.
    """
    entries, problem = engine_entries(engines, ENGINES), _problem(flights_in(recording), frames)
    profiles, left_out = of_each_engine(entries, partial(_profile, problem), on_progress, resources, jobs)
    size = len(problem.measured)
    estimates = [_estimate(label, one, column, size) for label, one in profiles.items() for column in range(len(FIRST_GRID))]
    pairs = [
        _disagreement(first, second, profiles[first], profiles[second], column, size)
        for first, second in combinations(profiles, 2)
        for column in range(len(FIRST_GRID))
    ]
    disagreements = tuple(pair for pair in pairs if pair.lower > 0.0 or pair.upper < 0.0)
    discrepancies = {label: one.discrepancy for label, one in profiles.items()}
    return LogFit(size, frames, tuple(estimates), disagreements, discrepancies, left_out)


def _problem(flights: Flights, frames: int) -> _Problem:
    """What all engines are given."""
    header, starts = flights.log.header, usable(flights, frames)
    scene, dt = scene_of(header), time_step(starts)
    launched = launches(scene, starts, np.array([start.state for start in starts]), dt, frames)
    steps = [np.linalg.eigh(start.covariance) for start in starts]
    moved = np.concatenate(
        [start.moved((vectors * np.sqrt(np.maximum(values, 0.0))).T) for start, (values, vectors) in zip(starts, steps, strict=True)]
    )
    perturbed = launches(scene, [start for start in starts for _ in range(12)], moved, dt, frames)
    noise = np.repeat([flights.moving.noise.white, header.body.size * flights.turning.noise.white], 3)
    return _Problem(scene, dt, recorded(starts, frames)[:, 1:], launched, perturbed, header, np.tile(noise**2, frames))


def _profile(problem: _Problem, entry: EngineEntry, processes: EngineProcesses, report: Callable[[str], None]) -> _Profile | Breakdown:
    """The estimates of an engine in resamples of the tosses, on grids that are refined around them."""
    axes, counts = tuple(FIRST_GRID.values()), resamples(len(problem.measured))
    for number in range(1, MOST_GRIDS + 1):
        report(f"{entry.label}, grid {number}")
        scenes = [with_values(problem.scene, "floor", friction=f, restitution=e) for f in axes[0].tolist() for e in axes[1].tolist()]
        found = processes.call(entry, poses, scenes, problem.launched, problem.dt)
        if isinstance(found, Breakdown):
            return found
        residuals = _differences(problem, problem.measured, found)
        best = int(np.argmin(np.median(np.mean(residuals**2, axis=2), axis=1)))
        around = processes.call(entry, poses, [scenes[best]], problem.perturbed, problem.dt)
        if isinstance(around, Breakdown):
            return around
        nominal = tracked(problem.header, found[best])[:, 1:]
        derivatives = _differences(problem, np.repeat(nominal, 12, axis=0), around)[0].reshape(*nominal.shape[:1], 12, -1)
        losses, discrepancy = _losses(residuals, derivatives, problem.variances)
        profile = _Profile(*_best(losses, axes, counts), discrepancy)
        each = zip(axes, FIRST_GRID.values(), profile.lower.T, profile.upper.T, strict=True)
        refined = [_refined(*of_axis) for of_axis in each]
        if all(new is None for new in refined):
            break
        axes = tuple(axis if new is None else new for axis, new in zip(axes, refined, strict=True))
    return profile


def _differences(problem: _Problem, reference: Array, found: Array) -> Array:
    """Poses minus those of a reference, shape (m, frames, 7), without the first frame, in metres, shape (scenes, m, 6 frames)."""
    seen = tracked(problem.header, found)[:, :, 1:]
    turned = problem.header.body.size * rotation_vector(reference[..., ORIENTATION], seen[..., ORIENTATION])
    return np.concatenate([seen[..., POSITION] - reference[..., POSITION], turned], axis=-1).reshape(*seen.shape[:2], -1)


def _losses(residuals: Array, derivatives: Array, variances: Array) -> tuple[Array, float]:
    """The losses of tosses by scene, shape (scenes, m), and the discrepancy [m]."""
    covariance = np.einsum("mki,mkj->mij", derivatives, derivatives) + np.diag(variances)
    values, vectors = np.linalg.eigh(covariance)
    squares = np.einsum("tmi,mij->tmj", residuals, vectors, optimize=True) ** 2
    discrepancy = 0.0
    for _ in range(ROUNDS):
        q = np.mean(squares / (values + discrepancy**2), axis=2)
        best = squares[np.argmin(np.log1p(q).sum(axis=1))]
        tried = np.mean(best / (values + DISCREPANCIES[:, np.newaxis, np.newaxis] ** 2), axis=2)
        fits = np.quantile(tried, SHARE, axis=1) <= LIMIT
        discrepancy = float(DISCREPANCIES[np.argmax(fits)])
    return np.log1p(np.mean(squares / (values + discrepancy**2), axis=2)), discrepancy


def _best(losses: Array, axes: tuple[Array, ...], counts: Array) -> tuple[Array, Array, Array]:
    """The least and the largest of the best parameters in resamples, shapes (RESAMPLES, 2), and those from the tosses themselves, (2,)."""
    fine = [_interpolation(axis) for axis in axes]
    table = losses.reshape(len(axes[0]), len(axes[1]), -1)
    table = np.einsum("ai,bj,ijm->abm", fine[0][1], fine[1][1], table, optimize=True)
    lower, upper = np.empty((2, len(counts) + 1, 2))
    sums = np.tensordot(np.vstack([counts, np.ones(counts.shape[1])]), table, axes=(1, 2))
    for column, (values, _) in enumerate(fine):
        least = sums.min(axis=2 - column)
        good = least <= least.min(axis=1, keepdims=True) + TIE
        lower[:, column] = values[np.argmax(good, axis=1)]
        upper[:, column] = values[len(values) - 1 - np.argmax(good[:, ::-1], axis=1)]
    return lower[:-1], upper[:-1], 0.5 * (lower[-1] + upper[-1])


def _interpolation(axis: Array) -> tuple[Array, Array]:
    """Values between those of a grid, and the matrix that interpolates to them."""
    between = np.concatenate([np.linspace(low, high, FINER, endpoint=False) for low, high in pairwise(axis)] + [axis[-1:]])
    return between, make_interp_spline(axis, np.eye(len(axis)))(between)


def _refined(axis: Array, tried: Array, lower: Array, upper: Array) -> Array | None:
    """A grid around the estimates of almost all resamples, finer unless these are at its ends; None if the grid is fine enough.

    `tried` is the first grid, beyond which no value is.
    """
    first, last, distance = float(np.quantile(lower, 0.005)), float(np.quantile(upper, 0.995)), float(np.diff(axis).max())
    encloses = (axis[0] < first or axis[0] == tried[0]) and (last < axis[-1] or axis[-1] == tried[-1])
    if encloses and distance <= FINE_ENOUGH * (last - first):
        return None
    return np.linspace(max(tried[0], first - MARGIN * distance), min(tried[-1], last + MARGIN * distance), GRID)


def _estimate(label: str, profile: _Profile, column: int, size: int) -> Estimate:
    """A parameter of an engine, from the tosses and their resamples."""
    lower, upper = expanded(profile.lower[:, column], profile.upper[:, column], size)
    name, tried = list(FIRST_GRID.items())[column]
    return Estimate(label, name, float(profile.value[column]), lower, upper, bool(lower > tried[0]), bool(upper < tried[-1]))


def _disagreement(first: str, second: str, one: _Profile, other: _Profile, column: int, size: int) -> Disagreement:
    """The difference of a parameter between two engines, resample by resample."""
    lower, upper = expanded(one.lower[:, column] - other.upper[:, column], one.upper[:, column] - other.lower[:, column], size)
    difference = float(one.value[column] - other.value[column])
    return Disagreement(list(FIRST_GRID)[column], first, second, difference, lower, upper)
