"""The friction and restitution with which engines best match a recording, from the frames after the first contact of each toss."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import combinations
from pathlib import Path

import numpy as np
from scipy.special import stdtrit

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.logs.continued_tosses import flights_in, of_each_engine
from dropspin.comparisons.logs.errors import body_length
from dropspin.comparisons.logs.flights import NEAR_FLOOR, Flights, heights
from dropspin.comparisons.logs.grids import FIRST_GRID, Problem, Profile, problem_of, profile_of
from dropspin.comparisons.logs.intervals import LEVEL, expanded
from dropspin.comparisons.logs.log import Log
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.engine_entries import engine_entries
from dropspin.comparisons.running.process_limits import FIVE_MINUTES, ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.scenarios.state import ORIENTATION, POSITION, Array

ANY_ENGINE = "any engine"
ENGINES = ("mujoco", "wang[contact=sequential,law=coulomb]")
FRAMES = 8
"""Frames after the last one of the flight."""
FINE_STEPS = 32, 64
"""Time steps of the engines in a frame: an impact is up to a step late, so that restitution is fitted too large by a part that is
proportional to the step. Estimates at both are extrapolated to a step of 0.
"""
REMAINDER = 0.25
"""Of the difference between the two steps, what the extrapolation may leave: with 200 synthetic tosses of a box, 0.0002 of 0.0008. However
many the tosses, their resamples do not show it.
"""
LARGE = 0.1
"""Discrepancy, over the largest extent of the body, that no error of a model has: those of the shipped tosses of a cube are about 0.02."""
EQUAL = 0.02
"""Difference of a parameter between engines that may be neglected: in a restitution of 0.4, it changes a rebound's height by a tenth."""


@dataclass(frozen=True)
class Estimate:
    """A parameter of the floor for an engine, with its 95 % interval.

    Attributes:
        engine: The engine's label.
        parameter: `friction` or `restitution`.
        value: The estimate.
        lower: Lower end of the interval.
        upper: Upper end of the interval.
        has_lower: Whether the tosses bound the parameter from below; if not, `lower` is the smallest tested value.
        has_upper: Whether the tosses bound the parameter from above; if not, `upper` is the largest tested value.
    """

    engine: str
    parameter: str
    value: float
    lower: float
    upper: float
    has_lower: bool
    has_upper: bool


@dataclass(frozen=True)
class Transfer:
    """The difference of a parameter between two engines for the same tosses, first - second, with its 95 % interval.

    Attributes:
        parameter: `friction` or `restitution`.
        first: Label of the first engine.
        second: Label of the second engine.
        difference: The estimate of the first engine minus that of the second.
        lower: Lower end of the interval of the difference; infinite if the tosses show no difference, and one bound of an estimate alone.
        upper: Upper end of the interval of the difference; infinite in the same case.
        verdict: `equal` if the interval is within `EQUAL` of 0, `different` if it is on one side of 0, else `undecided`.
    """

    parameter: str
    first: str
    second: str
    difference: float
    lower: float
    upper: float
    verdict: str


@dataclass(frozen=True)
class LogFit:
    """The friction and restitution that each engine needs to continue the tosses of a recording.

    Attributes:
        tosses: Number of tosses.
        frames: Number of frames of each toss after its flight that were used.
        estimates: The parameters of each engine.
        transfers: The differences between two engines in a parameter, if the tosses determine the parameter with both engines.
        friction: The coefficient of friction for any engine, with an interval that includes the differences between engines; None if the
            tosses determine it with fewer than two engines.
        discrepancies: For each engine, the standard deviation [m] of differences from the recorded poses that neither noise nor errors of
            the initial state explain; with it, 90 % of the tosses are consistent.
        left_out: The engines that have no estimate, with the reason.
        touches: Whether a body is near the floor of the header in any of these frames, or its bounce shows that it was between two.
        unlike: The engines whose discrepancy is large for the size of the body: their motions are not those of the tosses.
    """

    tosses: int
    frames: int
    estimates: tuple[Estimate, ...]
    transfers: tuple[Transfer, ...]
    friction: Estimate | None
    discrepancies: Mapping[str, float]
    left_out: Mapping[str, str]
    touches: bool = True
    unlike: tuple[str, ...] = ()


def log_fit(
    recording: Flights | Log | str | Path,
    engines: Engine | str | Iterable[Engine | str] = (),
    frames: int = FRAMES,
    *,
    on_progress: Callable[[str, float], None] | None = None,
    resources: ResourceLimits = FIVE_MINUTES,
    jobs: int | None = None,
) -> LogFit:
    """Fit the coefficients of friction and restitution with which each engine best matches the tosses of a recording after their flight.

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
    entries, flights = engine_entries(engines, ENGINES), flights_in(recording)
    problems = [problem_of(flights, frames, steps) for steps in FINE_STEPS]
    fitted, left_out = of_each_engine(entries, partial(_profile, problems), on_progress, resources, jobs)
    size, friction = len(problems[0].measured), None
    estimates: list[Estimate] = []
    transfers: list[Transfer] = []
    for parameter in FIRST_GRID:
        of_each = {label: _estimate(label, parameter, found, size) for label, found in fitted.items()}
        identified = {label: fitted[label] for label, one in of_each.items() if one.has_lower or one.has_upper}
        bounded = {label: fitted[label] for label, one in of_each.items() if one.has_lower and one.has_upper}
        estimates += of_each.values()
        transfers += [
            _transfer(parameter, *pair, identified, size, are_bounded=bounded.keys() >= {*pair}) for pair in combinations(identified, 2)
        ]
        if parameter == "friction" and len(bounded) > 1:
            friction = _of_all(parameter, bounded, size)
    discrepancies = {label: profile.discrepancy for label, profile in fitted.items()}
    unlike = tuple(label for label, left in discrepancies.items() if left > LARGE * body_length(flights.log.header.body))
    touches = _touches(flights, problems[0]) or any(one.has_lower or one.has_upper for one in estimates)
    return LogFit(size, frames, tuple(estimates), tuple(transfers), friction, discrepancies, left_out, touches, unlike)


def _profile(
    problems: Sequence[Problem], entry: EngineEntry, processes: EngineProcesses, report: Callable[[str], None]
) -> Profile | Breakdown:
    """The estimates of an engine at a time step of 0."""
    found = []
    for problem in problems:
        profile = profile_of(problem, entry, processes, report)
        if isinstance(profile, Breakdown):
            return profile
        found.append(profile)
    return _without_step(*found)


def _without_step(coarser: Profile, finer: Profile) -> Profile:
    """The estimates extrapolated to a time step of 0, resample by resample.

    How late an impact is differs from toss to toss, evenly between 0 and a step, so that what the extrapolation leaves of it has no mean,
    and is scatter of the tosses that the resamples show. An estimate at an end of the values that are tried may be any beyond it, and is
    not extrapolated from.
    """
    first, last = (np.array([tried[end] for tried in FIRST_GRID.values()]) for end in (0, -1))

    def extrapolated(coarse: Array, fine: Array) -> Array:
        return np.where((coarse == first) | (coarse == last), fine, np.clip(2.0 * fine - coarse, first, last))

    lower, upper = np.sort([extrapolated(coarser.lower, finer.lower), extrapolated(coarser.upper, finer.upper)], axis=0)
    remainder = REMAINDER * (finer.value - coarser.value)
    return Profile(lower, upper, extrapolated(coarser.best, finer.best), finer.discrepancy, remainder)


def _touches(flights: Flights, problem: Problem) -> bool:
    """Whether a body is near the floor of the header in any of the frames."""
    header, poses = flights.log.header, problem.measured.reshape(-1, 7)
    return bool(heights(header, poses[:, POSITION], poses[:, ORIENTATION]).min() < NEAR_FLOOR * header.body.size)


def _estimate(label: str, parameter: str, profile: Profile, size: int) -> Estimate:
    """A parameter of an engine, from the tosses and their resamples; its interval contains what may be left of the effect of the step."""
    tried, column = FIRST_GRID[parameter], list(FIRST_GRID).index(parameter)
    lower, upper = expanded(profile.lower[:, column], profile.upper[:, column], size)
    has_lower, has_upper = bool(lower > tried[0]), bool(upper < tried[-1])
    left = abs(float(profile.remainder[column])) if has_lower and has_upper else 0.0
    lower, upper = max(lower - left, float(tried[0])), min(upper + left, float(tried[-1]))
    return Estimate(label, parameter, float(profile.value[column]), lower, upper, has_lower, has_upper)


def _transfer(parameter: str, first: str, second: str, fitted: Mapping[str, Profile], size: int, *, are_bounded: bool) -> Transfer:
    """The difference of a parameter between two engines, resample by resample, at both ends of the values that are as good as the best.

    Estimates that are bounded on one side alone may be shown to differ, but not to be equal.
    """
    column, one, other = list(FIRST_GRID).index(parameter), fitted[first], fitted[second]
    ends = np.stack([one.lower - other.lower, one.upper - other.upper])[..., column]
    lower, upper = expanded(ends.min(axis=0), ends.max(axis=0), size)
    by_step = abs(float((one.remainder - other.remainder)[column]))
    lower, upper = lower - by_step, upper + by_step
    differs = lower > 0.0 or upper < 0.0
    if not are_bounded and not differs:  # the ends may be those of the values that were tried
        lower, upper = -math.inf, math.inf
    verdict = "equal" if max(-lower, upper) <= EQUAL and are_bounded else "different" if differs else "undecided"
    return Transfer(parameter, first, second, float(one.value[column] - other.value[column]), lower, upper, verdict)


def _of_all(parameter: str, fitted: Mapping[str, Profile], size: int) -> Estimate:
    """A parameter whichever engine continues the tosses, as the mean over engines that differ at random.

    The variance of the mean is that of resamples of the tosses and that of the engines; Student's t has the degrees of freedom of both.
    """
    column = list(FIRST_GRID).index(parameter)
    values = np.array([profile.value[column] for profile in fitted.values()])
    resampled = np.mean([0.5 * (profile.lower + profile.upper)[:, column] for profile in fitted.values()], axis=0)
    variances = np.array([resampled.var() * size / (size - 1), values.var(ddof=1) / len(values)])
    freedom = variances.sum() ** 2 / np.sum(variances**2 / [size - 1, len(values) - 1])
    half = float(stdtrit(freedom, 0.5 * (1.0 + LEVEL)) * np.sqrt(variances.sum()))
    value, tried = float(values.mean()), FIRST_GRID[parameter]
    lower, upper = max(value - half, float(tried[0])), min(value + half, float(tried[-1]))
    return Estimate(ANY_ENGINE, parameter, value, lower, upper, bool(lower > tried[0]), bool(upper < tried[-1]))
