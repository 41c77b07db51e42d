"""Engines compared with measured tosses, each from the state at the end of its flight: errors, what they come from, and which differ.

An error is a mean over tosses with a 95 % interval, beside its noise floor: the difference between the engine's motion from that state,
with the noise of the frames added, and those from states drawn from its covariance. The parts of an error are found by improving one thing
after another, so that they sum up to it: the centre of mass if the flights contradict the header's, friction and restitution, the time
step; then the noise floor, and what remains.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain, combinations, pairwise, starmap
from pathlib import Path

import numpy as np

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.logs.check import centre_of_mass
from dropspin.comparisons.logs.continued_tosses import (
    Launches,
    flights_in,
    launches,
    of_each_engine,
    poses,
    recorded,
    time_step,
    usable,
)
from dropspin.comparisons.logs.errors import KINDS, Kind, body_length, errors
from dropspin.comparisons.logs.fit import LogFit
from dropspin.comparisons.logs.flights import Flights, Start
from dropspin.comparisons.logs.header import Header
from dropspin.comparisons.logs.intervals import groups, interval_of_share, intervals_of_means
from dropspin.comparisons.logs.log import Log
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.engine_entries import engine_entries
from dropspin.comparisons.running.process_limits import FIVE_MINUTES, ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.scenarios.rotations import about, length, multiply
from dropspin.scenarios.state import ORIENTATION, POSITION, Array
from dropspin.scenarios.variations import with_values

ENGINES = ("mujoco", "mujoco[profile=default]", "pybullet[profile=default]", "wang[contact=sequential,law=coulomb]")
DRAWS = 4
"""States drawn for the noise floor of each toss."""
SEED = 48
COMPARED = tuple(kind for kind in KINDS if kind.at == "mean" and kind.quantity in ("position", "orientation"))
"""The errors that are compared between engines and split."""


@dataclass(frozen=True)
class Error:
    """A mean error of an engine over the tosses, with its 95 % interval and its noise floor."""

    engine: str
    quantity: str
    at: str
    unit: str
    value: float
    noise_floor: float
    lower: float
    upper: float
    tosses: int


@dataclass(frozen=True)
class Pair:
    """The difference of the mean errors of two engines, first - second, with an interval that holds for all pairs at once."""

    quantity: str
    first: str
    second: str
    difference: float
    lower: float
    upper: float

    @property
    def differs(self) -> bool:
        """Whether the interval of the difference excludes 0."""
        return self.lower > 0.0 or self.upper < 0.0


@dataclass(frozen=True)
class Share:
    """A part of the mean error of an engine, with its 95 % interval."""

    engine: str
    quantity: str
    part: str
    value: float
    lower: float
    upper: float


@dataclass(frozen=True)
class LogComparison:
    """Engines compared with a recording.

    Attributes:
        tosses: Number of tosses.
        length: The largest extent of the body along an axis of its frame [m]. Position errors are given in units of this length.
        dt: Time step of the engines [s].
        errors: The errors of each engine.
        pairs: The differences between engines.
        groups: For each quantity, the largest groups of engines without significant differences; an engine may be in several groups.
        parts: The parts into which the errors are decomposed.
        left_out: The engines that have no errors, with the reason.
    """

    tosses: int
    length: float
    dt: float
    errors: tuple[Error, ...]
    pairs: tuple[Pair, ...]
    groups: Mapping[str, tuple[tuple[str, ...], ...]]
    parts: tuple[Share, ...]
    left_out: Mapping[str, str]


def log_compare(
    recording: Flights | Log | str | Path,
    engines: Engine | str | Iterable[Engine | str] = (),
    fit: LogFit | None = None,
    *,
    on_progress: Callable[[str, float], None] | None = None,
    resources: ResourceLimits = FIVE_MINUTES,
    jobs: int | None = None,
) -> LogComparison:
    """Compare engines with the tosses of a recording.

    Args:
        recording: A recording, the path of its header, or the flights found in it.
        engines: One engine or several: engines, or names with options.
        fit: The result of `log_fit`, with which the part of the error that friction and restitution cause is computed.
        on_progress: Called with a description of the current work and the fraction of the engines that are done.
        resources: The processor time [s] and memory [bytes] that each piece of work may use.
        jobs: Number of engines at a time; by default, the number of processors that this process may use. It changes no result.

    Returns:
        The errors of each engine and their parts, the differences between engines, and the groups of engines that do not differ
        significantly.

    Raises:
        DropspinError: The recording has no floor, or too few tosses with frames after a flight.
    """
    entries, flights = engine_entries(engines, ENGINES), flights_in(recording)
    header = flights.log.header
    starts = usable(flights)
    measured, white, dt = recorded(starts), np.array([start.white for start in starts]), time_step(starts)
    given = {entry.label: _given(flights, starts, dt, fit, entry.label) for entry in entries}
    found, left_out = of_each_engine(entries, partial(_errors, header, given, measured, white), on_progress, resources, jobs)
    rows, shares = chain.from_iterable(starmap(_rows, found.items())), chain.from_iterable(starmap(_shares, found.items()))
    pairs = {kind.quantity: _pairs(kind, found) for kind in COMPARED}
    apart = {quantity: {frozenset((one.first, one.second)) for one in some if one.differs} for quantity, some in pairs.items()}
    alike = {quantity: groups(list(found), some) for quantity, some in apart.items()}
    every = tuple(chain(*pairs.values()))
    return LogComparison(len(starts), body_length(header.body), dt, tuple(rows), every, alike, tuple(shares), left_out)


def _given(flights: Flights, starts: Sequence[Start], dt: float, fit: LogFit | None, label: str) -> dict[str, Launches]:
    """What an engine continues: as given, from drawn starts, and with one thing after another improved."""
    header, random = flights.log.header, np.random.default_rng(SEED)
    states = np.array([start.state for start in starts])
    improved = launches(header, starts, states, dt)
    found = {"as given": improved}
    drawn = np.concatenate([start.drawn(random, DRAWS) for start in starts])
    found["drawn starts"] = launches(header, [start for start in starts for _ in range(DRAWS)], drawn, dt)
    centre = header.body.centre.tolist()
    for axis, shown in enumerate(centre_of_mass(flights)):
        if shown.is_identifiable and not shown.low <= centre[axis] <= shown.high:
            centre[axis] = shown.value
    if centre != header.body.centre.tolist():
        header = header.corrected({"body.center_of_mass": centre, "body.inertia": header.body.inertia_tensor.tolist()})
        states = np.array([start.state for start in usable(replace(flights, log=replace(flights.log, header=header)))])
        found["centre of mass"] = improved = launches(header, starts, states, dt)
    fitted = {one.parameter: one.value for one in fit.estimates if one.engine == label} if fit is not None else {}
    if fitted:
        improved = improved._replace(scene=with_values(improved.scene, "floor", **fitted))
        found["friction and restitution"] = improved
    found["time step"] = launches(header, starts, states, 0.5 * dt)._replace(scene=improved.scene)
    return found


def _errors(
    header: Header,
    given: Mapping[str, Mapping[str, Launches]],
    measured: Array,
    white: Array,
    entry: EngineEntry,
    processes: EngineProcesses,
    report: Callable[[str], None],
) -> dict[str, Array] | Breakdown:
    """The errors of each toss by what was given, shape (m, kinds); those of drawn starts are from the motion as given with noise."""
    found: dict[str, Array] = {}
    nominal = measured
    for what, launched in given[entry.label].items():
        report(f"{entry.label}, {what}")
        seen = processes.call(entry, poses, launched)
        if isinstance(seen, Breakdown):
            if what == "as given":
                return seen
            found[what] = np.full((len(measured), len(KINDS)), np.nan)
            continue
        t = launched.frames - launched.frames[:, :1]
        noise = np.repeat(white, len(t) // len(white), axis=0)
        reference = _noisy(np.repeat(nominal, DRAWS, axis=0), noise) if what == "drawn starts" else measured
        of_each = errors(header.body, header.gravity, header.tracked_from_centre, noise, t, reference, seen[0])
        if what == "as given":
            nominal = seen[0]
        found[what] = of_each.reshape(len(measured), -1, len(KINDS)).mean(axis=1)
    return found


def _noisy(poses: Array, white: Array) -> Array:
    """Poses as they would be recorded, shape (m, n, 7), with white noise of standard deviations of shape (m, 6)."""
    noise = np.random.default_rng([SEED, 1]).standard_normal((*poses.shape[:2], 6)) * white[:, np.newaxis]
    angles, position = length(noise[..., 3:]), poses[..., POSITION] + noise[..., :3]
    turn = about(noise[..., 3:] / angles[..., np.newaxis], angles)
    return np.concatenate([position, multiply(turn, poses[..., ORIENTATION])], axis=-1)


def _rows(label: str, found: Mapping[str, Array]) -> Iterator[Error]:
    """The errors of an engine as given."""
    values, floor = found["as given"], found["drawn starts"]
    lower, upper = intervals_of_means(values)
    for kind, of_kind, drawn, *ends in zip(KINDS, values.T, floor.T, lower, upper, strict=True):
        low, high = interval_of_share(of_kind) if kind.quantity == "same resting face" else ends
        tosses = int(np.isfinite(of_kind).sum())
        yield Error(label, *kind, _mean(of_kind), _mean(drawn), float(np.maximum(low, 0.0)), float(high), tosses)


def _mean(values: Array) -> float:
    """The mean of the finite values; NaN without one."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if len(known) else math.nan


def _pairs(kind: Kind, found: Mapping[str, Mapping[str, Array]]) -> list[Pair]:
    """The differences of all pairs of engines, on the tosses that all have."""
    number, names = KINDS.index(kind), list(combinations(found, 2))
    if not names:
        return []
    differences = np.stack([found[one]["as given"][:, number] - found[other]["as given"][:, number] for one, other in names], axis=1)
    lower, upper = intervals_of_means(differences, simultaneous=True)
    each = zip(names, differences.T, lower.tolist(), upper.tolist(), strict=True)
    return [Pair(kind.quantity, *pair, float(of_pair.mean()), low, high) for pair, of_pair, low, high in each]


def _shares(label: str, found: Mapping[str, Array]) -> Iterator[Share]:
    """The parts of an engine's errors over the motion."""
    for kind in COMPARED:
        number = KINDS.index(kind)
        improved = [(what, of_each[:, number]) for what, of_each in found.items() if what != "drawn starts"]
        parts = [(what, before - after) for (_, before), (what, after) in pairwise(improved)]
        floor = found["drawn starts"][:, number]
        parts += [("noise floor", floor), ("remaining", improved[-1][1] - floor)]
        lower, upper = intervals_of_means(np.stack([values for _, values in parts], axis=1))
        for (what, values), low, high in zip(parts, lower.tolist(), upper.tolist(), strict=True):
            yield Share(label, kind.quantity, what, float(values.mean()), low, high)
