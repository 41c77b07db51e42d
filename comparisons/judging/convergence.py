"""Convergence over several time steps: the error budget of a metric, corrected by that of its components.

The error at each step is the average over start phases of one flight; steps that do not resolve this flight have none. The flight in which
the error is largest at the finest step counts, or a worse one; of a metric with two signs, both do: one may vanish where the other remains.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from dropspin.comparisons.engines.base import KnownLimitation
from dropspin.comparisons.judging.error_budget import ErrorBudget, error_budget, growing, is_sufficient, vector_budget, widened
from dropspin.comparisons.judging.series import grows_without_limit, noise_of_missed
from dropspin.comparisons.judging.verdicts import COMBINED, WITHIN_UNCERTAINTY, Cause
from dropspin.comparisons.measuring.comparison import Unresolved
from dropspin.comparisons.measuring.contact_runs import Mask
from dropspin.comparisons.measuring.metric import Average, Metric
from dropspin.comparisons.measuring.tolerances import negligible, rounding, scale
from dropspin.scenarios import Scenario
from dropspin.scenarios.state import Array

STUDIES = ("order", "asymptotic_error")
"""Kinds of measurements that are computed from several time steps."""
ARTEFACTS = frozenset({"energy_error_raw"})
"""Metrics that depend on how a state is sampled and are no measure of its error."""
JUMPING = frozenset({"desync_rate"})
"""Metrics that change from flight to flight instead of with a power of the time step."""
ADDED_STEPS = (2.0, 4.0)
"""Time steps, relative to the coarsest, that are added if the requested ones leave open whether an error vanishes; finer ones cost more."""
STANDARD_DEVIATIONS = 0.5
"""Factor on a resolution: half of the range of four means over quarters of the phases is twice the standard deviation of their mean."""
SATURATION = 0.9 * math.pi
"""An angle this near to π saturates, so that it does not measure the error of the orientation."""
WORSE = {"discretisation": 1, "unresolved": 2, "model": 3}
"""Causes that are worse than those of an error that vanishes."""
LARGE_SHARE = 0.5
"""Share of the largest error of all flights above which that of the flights that enough time steps resolve stands for all."""
LARGE = 0.01
"""A ratio, such as an error of restitution, that may let a body leave the flights of the exact solution."""
DESYNCHRONISED = 0.5
"""Position error, relative to the drop height, at which a bouncing body is in another flight, so that its position error has no meaning."""
SIDEWAYS = 0.9
"""Share of a position error from which, if it is horizontal, the error is that of a body beside its place, not in another flight."""

Part = tuple[int, ...]
"""A flight, and of a metric with two signs the largest or the smallest value in it."""
Judged = tuple[ErrorBudget, Array]
"""The budget of a part, and its error at each time step."""


class Claim(NamedTuple):
    """The properties that an engine declares for a scene: order of accuracy or None, precision of the state, limitations it met."""

    label: str
    order: float | None = None
    precision: type = np.float64
    limitations: tuple[KnownLimitation, ...] = ()


class SeriesPoint(NamedTuple):
    """A metric at one time step.

    Attributes:
        dt: The time step [s].
        steps: Number of steps.
        average: Averages of the metric over start phases; NaN if it is unresolved.
        components: Averages of its components; None for a metric that is not the length of a vector, or is unresolved.
        tolerance: The largest difference between two runs that does not count as a change; NaN in a quick run.
        noise: How far the few starts of a quick run may move the value; 0 otherwise.
        rounded: The distance from a bound that rounding in single precision may cause; 0 in double precision.
        unresolved: Why the time step does not resolve the metric.
    """

    dt: float
    steps: int
    average: Average
    components: Average | None
    tolerance: float
    noise: float = 0.0
    rounded: float = 0.0
    unresolved: Unresolved | None = None


@dataclass(frozen=True)
class Convergence:
    """The error budget of a metric over several time steps.

    Attributes:
        budget: The cause, the order and the asymptotic error.
        finest: The finest time step [s].
        order_tolerance: The change of the order if each error to which it is fitted changes by its tolerance.
        is_open: Whether more time steps may decide the cause.
        remark: Which time steps or options were added to the requested ones.
        finest_error: The error at the finest time step; NaN if it is not resolved, or if there are too few time steps.
        largest_error: The size of the largest error at these time steps; NaN if there are too few.
    """

    budget: ErrorBudget
    finest: float
    order_tolerance: float = math.nan
    is_open: bool = False
    remark: str = ""
    finest_error: float = math.nan
    largest_error: float = math.nan


def convergence(scene: Scenario, claim: Claim, metric: Metric, series: Sequence[SeriesPoint], remark: str = "") -> Convergence:
    """The error budget of one metric of an engine.

    Args:
        scene: The scene.
        claim: The properties that the engine declares.
        metric: The metric.
        series: The metric at each time step.
        remark: Which time steps were added.
    """
    dts, floor = np.array([point.dt for point in series]), negligible(scene, metric.unit)
    at = int(np.argmin(dts))
    rounded = rounding(scene, metric.unit, claim.precision, np.array([point.steps for point in series], dtype=float))

    def judged(part: Part) -> Judged:
        errors, resolutions, missed = _errors_of(scene, metric, series, part)
        chance = 0.0
        if metric.name in JUMPING:  # the step changes it by chance, as far as it has changed it at all
            chance = float(np.nanmax(errors, initial=-math.inf) - np.nanmin(errors, initial=math.inf))
        noise = STANDARD_DEVIATIONS * np.maximum(resolutions, chance)
        budget = error_budget(dts, errors, claim.order, noise, rounded, signed=metric.signed, negligible=floor)
        if (missed > noise).any() and not (budget.cause == "model" and _goes_on(budget, errors, missed, at)):
            noise = np.maximum(noise, missed)
            budget = error_budget(dts, errors, claim.order, noise, rounded, signed=metric.signed, negligible=floor)
        if budget.cause == "unresolved" and grows_without_limit(dts, errors, noise, LARGE * scale(scene, metric.unit)):
            budget = growing(budget, float(errors[at]), float(noise[at]))
        return budget, errors

    length, errors = _worst(series, judged, floor)
    has_value = not math.isnan(length.asymptotic_error)
    vector = _budget_of_components(scene, claim, metric, series, np.isfinite(errors), rounded) if has_value else None
    budget = length if vector is None else _corrected(length, vector, abs(float(errors[at])), max(floor, float(rounded[at])))
    order_tolerance = math.nan
    if budget.dts and metric.name not in JUMPING:
        used, limit = np.isin(dts, budget.dts), 0.0 if length.cause == "discretisation" else length.asymptotic_error
        logs = np.log(dts[used]) - np.mean(np.log(dts[used]))
        shares = np.array([point.tolerance for point in series])[used] / np.abs(errors[used] - limit)
        order_tolerance = float(np.sum(np.abs(logs) * shares) / np.sum(logs**2))
    deciding = budget if vector is None or budget.cause != "discretisation" else vector
    is_open = deciding.cause == "unresolved" and has_value and float(np.nanmax(np.abs(errors))) > floor
    largest = max((abs(point.average.value) for point in series if math.isfinite(point.average.value)), default=math.nan)
    sizes = (series[at].average.value, largest) if is_sufficient(list(dts)) else ()
    return Convergence(budget, series[at].dt, order_tolerance, is_open, remark, *sizes)


def beside_recording(result: Convergence, uncertainty: float) -> Convergence:
    """The convergence of the difference from a recording, which leaves an uncertainty: what remains as dt → 0 is not the engine's alone.

    Its interval is widened by the uncertainty. A difference that is not larger is no error; of a larger one, the recording does not tell
    what is due to the model, to the settings and to the start. It has no order.
    """
    budget = result.budget
    lower, upper = max(budget.lower - uncertainty, 0.0), budget.upper + uncertainty
    cause, reason = "unresolved", f"finer time steps are needed to tell it from the uncertainty of the recording, {uncertainty:.2g}"
    if lower > 0.0:
        cause, reason = COMBINED, f"remains as dt → 0; the uncertainty of the recording is {uncertainty:.2g}"
    elif (budget.upper if budget.cause == "unresolved" else budget.asymptotic_error) <= uncertainty:
        cause, reason = WITHIN_UNCERTAINTY, f"within the uncertainty of the recording, {uncertainty:.2g}"
    elif math.isnan(budget.asymptotic_error) or budget.cause == "unresolved":
        reason = budget.reason
    return replace(result, budget=ErrorBudget(cause, reason, budget.asymptotic_error, lower, upper))


def of_jump(found: Convergence, others: Sequence[tuple[Metric, Cause, Sequence[SeriesPoint]]]) -> Convergence:
    """The convergence of a metric that jumps, and may stay at a value at all time steps while the error that causes it falls.

    Its model error is unresolved if no other metric has one, and another one has a large error that may vanish.

    Args:
        found: The convergence, with a model error.
        others: The other metrics, the causes of their errors, and the errors at each time step.
    """
    causes = {cause for _, cause, _ in others}
    falling = [points for metric, cause, points in others if metric.unit == "1" and cause in ("discretisation", "unresolved")]
    may_vanish = any(abs(_finest(points).average.value) > LARGE for points in falling)
    if {"model", "setting"} & causes or not may_vanish:
        return found
    reason = "stays at its value at these time steps, from which it may jump: no other error is one of the model, and a large one falls"
    return replace(found, budget=replace(found.budget, cause="unresolved", reason=reason, lower=min(found.budget.lower, 0.0)))


def is_refuted(found: Convergence, finer: Convergence) -> bool:
    """Whether a finer time step shows that a model error is none.

    The error vanishes; or it is undecided, and nearer to 0 than the estimate, by more than the error at the step before differs from that.
    """
    estimate = abs(found.budget.asymptotic_error)
    is_nearer = estimate - abs(finer.finest_error) > abs(estimate - abs(found.finest_error))
    return finer.budget.cause not in ("model", "unresolved") or (finer.budget.cause == "unresolved" and is_nearer)


def _corrected(length: ErrorBudget, vector: ErrorBudget, finest: float, floor: float) -> ErrorBudget:
    """The budget of a length, corrected by that of its components, from the error at the finest time step and a negligible one."""
    if vector.cause == "model" and length.cause in ("discretisation", "unresolved"):
        # The length is largest at another time than that of the components, so it may be larger than they are.
        return replace(vector, upper=max(length.upper, vector.upper), reason=f"{vector.reason}, in a component")
    if length.cause == "model" and length.lower > finest and vector.cause != "model":
        # A length that passes a minimum and grows at finer steps does so in a component; an irregular one only seems to.
        reason = "the length seems to grow at finer time steps, but no component grows"
        return ErrorBudget("unresolved", reason, length.asymptotic_error, 0.0, max(length.upper, vector.upper))
    # The length is at least that of the components at their time.
    return length if length.cause == "model" or vector.upper <= length.upper else widened(length, vector.upper, finest, floor)


def _worst(series: Sequence[SeriesPoint], judged: Callable[[Part], Judged], floor: float) -> Judged:
    """The worst of the flights in which the error is largest at a time step, or one whose smaller error remains where theirs vanish."""
    (largest, others), at = _worst_parts(series), int(np.argmin([point.dt for point in series]))
    worst = judged(largest[0])
    for part in [*largest[1:], *others]:
        if worst[0].cause == "model":
            return worst
        if part not in others:
            worst = _worse(worst, judged(part), floor, at)
        elif others[part] > max(_reach(worst[0]), floor) and (other := judged(part))[0].cause == "model":
            worst = _worse(worst, other, floor, at)
    return worst


def _worse(largest: Judged, other: Judged, floor: float, at: int) -> Judged:
    """The budget of the part that is largest at the finest step, or that of another one if it is worse and more of it may remain.

    Without a model error its interval contains that of the other part, because either may be the larger one as dt → 0; `at`
    is the place of the finest step.
    """
    may_remain = _reach(other[0]) > max(_reach(largest[0]), floor)
    if may_remain and WORSE.get(other[0].cause, 0) > WORSE.get(largest[0].cause, 0):
        largest, other = other, largest
    (worse, errors), (second, _) = largest, other
    if worse.cause != "model" and (second.lower < worse.lower or second.upper > worse.upper):
        worse = widened(replace(worse, lower=min(worse.lower, second.lower)), second.upper, abs(float(errors[at])), floor)
    return worse, errors


def _reach(budget: ErrorBudget) -> float:
    """The largest error that may remain; 0 if it is not known, so that what is known of other parts counts."""
    return 0.0 if math.isnan(budget.asymptotic_error) else max(-budget.lower, budget.upper)


def _worst_parts(series: Sequence[SeriesPoint]) -> tuple[list[Part], dict[Part, float]]:
    """The parts in which errors are largest: at the finest time step first, then at others; and the sizes there of all other parts.

    Flights that too few of the steps resolve count only if their error is far larger than that of the others.
    """
    resolved = sorted((point for point in series if np.isfinite(point.average.parts).all()), key=lambda point: point.dt)
    finest = _finest(resolved or series).average.parts
    sizes, dts = np.abs(finest), [[point.dt for point in resolved if len(point.average.parts) > flight] for flight in range(len(finest))]
    of_enough = sizes[: sum(map(is_sufficient, dts))]
    if not of_enough.size or of_enough.max() < LARGE_SHARE * sizes.max():
        return _with_other_sign(_largest(sizes), finest), {}
    at_each = [np.abs(point.average.parts[: len(of_enough)]) for point in resolved if point.average.parts.ndim == finest.ndim]
    largest = list(dict.fromkeys(part for sizes_there in at_each for part in _with_other_sign(_largest(sizes_there), finest)))
    return largest, {part: float(of_enough[part]) for part in np.ndindex(of_enough.shape) if part not in largest}


def _finest(series: Sequence[SeriesPoint]) -> SeriesPoint:
    return min(series, key=lambda point: point.dt)


def _largest(sizes: Array) -> Part:
    return tuple(map(int, np.unravel_index(np.argmax(sizes), sizes.shape)))


def _with_other_sign(part: Part, parts: Array) -> list[Part]:
    return [part, *((part[0], side) for side in range(parts.shape[1]) if side != part[1])] if parts.ndim > 1 else [part]


def _goes_on(budget: ErrorBudget, errors: Array, missed: Array, at: int) -> bool:
    """Whether events that finer steps may have missed can only add to a model error: they have its sign, by the errors where they occur."""
    added = errors[missed < missed[at]] - errors[at]
    return bool(np.all(added[np.isfinite(added)] * budget.asymptotic_error > 0.0))


def _errors_of(scene: Scenario, metric: Metric, series: Sequence[SeriesPoint], part: Part) -> tuple[Array, Array, Array]:
    """Errors, their resolution, and the noise of events that the step may have missed, in one flight, with one sign.

    NaN where a time step does not resolve the flight, or the error saturates.
    """
    errors, resolutions, jumps = (
        np.array([values[part] if values.ndim == len(part) and len(values) > part[0] else math.nan for values in all_steps])
        for all_steps in zip(*(point.average for point in series), strict=True)
    )
    missed = noise_of_missed(np.array([point.dt for point in series]), jumps)
    if metric.unit == "rad":
        errors[np.abs(errors) > SATURATION] = math.nan
    if metric.name == "position_error" and scene.starts_above_floor and scene.recording is None:
        is_sideways = np.array(list(map(_is_sideways, series)))
        errors[(np.abs(errors) > DESYNCHRONISED * scene.clearance) & ~is_sideways] = math.nan
    return errors, resolutions, missed


def _is_sideways(point: SeriesPoint) -> bool:
    """Whether the mean position error at the end of the middle half of a flight, where it is longest, is horizontal; False if unknown."""
    errors = [] if point.components is None else list(point.components.parts)
    error = max(errors, key=np.linalg.norm, default=np.zeros(3))
    return bool(np.hypot(error[0], error[2]) >= SIDEWAYS * np.linalg.norm(error) > 0.0)


def _budget_of_components(
    scene: Scenario, claim: Claim, metric: Metric, series: Sequence[SeriesPoint], usable: Mask, rounded: Array
) -> ErrorBudget | None:
    """The error budget of the components in the flight in which they are largest; None if there are too few time steps."""
    kept = [
        (point.dt, point.components, most)
        for point, is_usable, most in zip(series, usable, rounded, strict=True)
        if is_usable and point.components is not None
    ]
    if not is_sufficient([dt for dt, _, _ in kept]):
        return None
    flights = min(len(components.parts) for _, components, _ in kept)
    _, finest, _ = min(kept, key=lambda row: row[0])
    longest = int(np.argmax(np.linalg.norm(finest.parts[:flights], axis=1)))
    errors, resolutions = (np.array([components[field][longest] for _, components, _ in kept]) for field in range(2))
    dts, largest = (np.array([row[field] for row in kept]) for field in (0, 2))
    return vector_budget(dts, errors, claim.order, STANDARD_DEVIATIONS * resolutions, largest, negligible(scene, metric.unit))
