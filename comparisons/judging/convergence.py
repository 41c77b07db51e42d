"""Convergence over several time steps: the observed order, the asymptotic error as dt → 0, and the cause of each error.

Two checks apply to every engine, in addition to the expectations of the scene: the interval of the asymptotic error must contain 0, and
the interval of the observed order must reach the claimed order. If the scene expects a fault of this engine by name, the result is
`known` as long as the asymptotic error is within the expected bounds.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.engines.base import KnownLimitation
from dropspin.comparisons.judging.error_budget import ErrorBudget, error_budget, is_sufficient, vector_budget
from dropspin.comparisons.judging.verdicts import Cause, Judgement, Verdict, judge_asymptotic_error, with_limitations
from dropspin.comparisons.measuring.metric import Average, Metric
from dropspin.comparisons.measuring.tolerances import negligible, rounding
from dropspin.scenarios import Scenario

Array = NDArray[np.float64]

STUDIES = ("order", "asymptotic_error")
"""Kinds of measurements that are computed from several time steps."""
ARTEFACTS = frozenset({"energy_error_raw"})
"""Metrics that depend on how a state is sampled and are no measure of its error."""
JUMPING = frozenset({"desync_rate"})
"""Metrics that change from flight to flight instead of with a power of the time step."""
ADDED_STEPS = (2.0, 4.0)
"""Time steps, relative to the coarsest, that are added if the requested ones do not decide whether an error vanishes; finer ones would cost
more.
"""
STANDARD_DEVIATIONS = 0.5
"""Factor on a resolution: half of the range of four means over quarters of the phases is twice the standard deviation of their mean."""
SATURATION = 0.9 * math.pi
"""An angle this near to π saturates, so that it does not measure the error of the orientation."""
DESYNCHRONISED = 0.5
"""Position error, relative to the drop height, at which a bouncing body is in another flight, so that its position error has no meaning."""


class Claim(NamedTuple):
    """The properties that an engine declares for a scene: order of accuracy or None, precision of the state, limitations it met."""

    label: str
    order: float | None
    precision: type
    limitations: tuple[KnownLimitation, ...] = ()


class SeriesPoint(NamedTuple):
    """A metric at one time step: dt [s], number of steps, averages of metric and components over start phases, tolerance."""

    dt: float
    steps: int
    average: Average
    components: Average | None
    tolerance: float


@dataclass(frozen=True)
class ConvergenceStudy:
    """The convergence of one metric: the cause of its errors, and the judgements of its order and asymptotic error, if there are any."""

    cause: Cause
    order: Judgement | None
    asymptotic_error: Judgement | None
    is_open: bool = False
    """Whether more time steps may decide the cause."""

    @property
    def fails(self) -> bool:
        """Whether the asymptotic error fails as a model error."""
        return self.cause == "model" and self.asymptotic_error is not None and self.asymptotic_error.verdict == "failed"


def study_convergence(scene: Scenario, claim: Claim, metric: Metric, series: Sequence[SeriesPoint]) -> ConvergenceStudy:
    """The observed order and the asymptotic error of one metric of an engine, judged.

    Args:
        scene: The scene.
        claim: The properties that the engine declares.
        metric: The metric.
        series: The metric at each time step.
    """
    dts, errors, resolutions, rounded = _worst_part(scene, claim, metric, series)
    if metric.name in JUMPING:  # the step changes it by chance, as far as it has changed it at all
        resolutions = np.maximum(resolutions, np.nanmax(errors, initial=-math.inf) - np.nanmin(errors, initial=math.inf))
    floor = negligible(scene, metric.unit)
    found = error_budget(dts, errors, claim.order, STANDARD_DEVIATIONS * resolutions, rounded, signed=metric.signed, negligible=floor)
    vector = _budget_of_components(scene, claim, metric, series, np.isfinite(errors), rounded)
    if vector is not None:
        found = _with_components(found, vector, finest=abs(float(errors[np.argmin(dts)])))
    order, limit = _judge_order(claim, metric, found), None
    if order is not None and found.dts:
        order = replace(order, tolerance=_order_tolerance(found, dts, errors, np.array([point.tolerance for point in series])))
    if not math.isnan(found.asymptotic_error):
        # What the steps leave open is not compared with another run's.
        tolerance = math.nan if found.cause == "unresolved" else found.upper - found.lower
        limit = Judgement(found.asymptotic_error, "measured", found.lower, found.upper, found.cause, found.reason, tolerance)
        limit = judge_asymptotic_error(scene, claim.label, float(np.min(dts)), metric, limit)
        limit = with_limitations(limit, metric.name, claim.limitations, least=max(found.lower, -found.upper))
    is_undecided = found.cause == "unresolved" or (found.cause == "discretisation" and vector is not None and vector.cause == "unresolved")
    is_open = is_undecided and not math.isnan(found.asymptotic_error) and float(np.nanmax(np.abs(errors))) > floor
    return ConvergenceStudy(found.cause, order, limit, is_open)


def _with_components(length: ErrorBudget, vector: ErrorBudget, finest: float) -> ErrorBudget:
    """The error budget of a length, corrected by that of its components; `finest` is the error at the finest time step."""
    if vector.cause == "model" and length.cause in ("discretisation", "unresolved"):
        # The length is largest at another time than that of the components, so it may be larger than they are.
        return replace(vector, upper=max(length.upper, vector.upper), reason=f"{vector.reason}, in a component")
    if length.cause == "model" and length.lower > finest and vector.cause != "model":
        # A length that passes a minimum and grows at finer steps does so in a component; an irregular one only seems to.
        reason = "the length seems to grow at finer time steps, but no component grows"
        return ErrorBudget("unresolved", reason, length.asymptotic_error, 0.0, max(length.upper, vector.upper))
    # The length is at least that of the components at their time.
    return length if length.cause == "model" else replace(length, upper=max(length.upper, vector.upper))


def attributed_to_setting(study: ConvergenceStudy, calibrated: ConvergenceStudy | None) -> ConvergenceStudy:
    """The convergence with default settings; a model error that calibrated settings exclude is a setting error."""
    if study.cause != "model" or study.asymptotic_error is None or calibrated is None or calibrated.asymptotic_error is None:
        return study
    own, other = study.asymptotic_error, calibrated.asymptotic_error
    if max(-other.lower, other.upper) >= max(own.lower, -own.upper):
        return study
    cured = ", but the calibrated profile has none or a smaller one: it is a setting" if own.verdict == "failed" else ""
    order = None if study.order is None else replace(study.order, cause="setting")
    return ConvergenceStudy("setting", order, replace(own, cause="setting", reason=own.reason + cured))


def attributed_to_accuracy(study: ConvergenceStudy, refined: ConvergenceStudy | None, options: str, path: str) -> ConvergenceStudy:
    """The convergence over time steps.

    An error that vanishes only if accuracy options are refined too is attributed to these options.

    Args:
        study: The convergence over time steps alone.
        refined: The convergence over time steps that were refined together with the options.
        options: Names of the options.
        path: The values of the options and the time steps, as text.
    """
    if study.cause not in ("model", "unresolved") or study.asymptotic_error is None:
        return study
    limit = None if refined is None else refined.asymptotic_error
    if limit is None:
        limit, cause, reason = study.asymptotic_error, "unresolved", f"too few usable time steps with finer {options}"
    elif limit.cause in ("model", "unresolved"):
        cause, reason = limit.cause, limit.reason
    else:
        cause, reason = options, f"vanishes with finer {options}"
    if cause == "model":
        return study
    verdict: Verdict = "measured" if cause == "unresolved" else "passed"
    return replace(
        study, cause=cause, order=None, asymptotic_error=replace(limit, verdict=verdict, cause=cause, reason=f"{reason} ({path})")
    )


def _worst_part(scene: Scenario, claim: Claim, metric: Metric, series: Sequence[SeriesPoint]) -> tuple[Array, Array, Array, Array]:
    """Time steps, errors, their resolution and their rounding errors, of the part that is largest at the finest time step."""
    dts, steps = np.array([point.dt for point in series]), np.array([point.steps for point in series], dtype=float)
    averages = [point.average for point in series]
    resolved = [average for average in averages if np.isfinite(average.parts).all()]
    shape = min((average.parts.shape for average in resolved), default=(1,))
    finest = averages[int(np.argmin(dts))].parts[: shape[0]]
    worst = np.unravel_index(np.argmax(np.abs(finest)), finest.shape)
    errors, resolutions = (
        np.array([values[worst] if values.shape[1:] == shape[1:] else math.nan for values in both])
        for both in zip(*(average[:2] for average in averages), strict=True)
    )
    rounded = rounding(scene, metric.unit, claim.precision, steps)
    if metric.unit == "rad":
        errors[np.abs(errors) > SATURATION] = math.nan
    if metric.name == "position_error" and scene.starts_above_floor:
        errors[np.abs(errors) > DESYNCHRONISED * scene.clearance] = math.nan
    return dts, errors, resolutions, rounded


def _budget_of_components(
    scene: Scenario, claim: Claim, metric: Metric, series: Sequence[SeriesPoint], usable: NDArray[np.bool_], rounded: Array
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
    _, finest, _ = min(kept, key=lambda one: one[0])
    longest = int(np.argmax(np.linalg.norm(finest.parts[:flights], axis=1)))
    errors, resolutions = (np.array([components[field][longest] for _, components, _ in kept]) for field in range(2))
    dts, largest = (np.array([one[field] for one in kept]) for field in (0, 2))
    return vector_budget(dts, errors, claim.order, STANDARD_DEVIATIONS * resolutions, largest, negligible(scene, metric.unit))


def _order_tolerance(found: ErrorBudget, dts: Array, errors: Array, tolerances: Array) -> float:
    """The change of the order if each error to which it is fitted changes by its tolerance."""
    used = np.isin(dts, found.dts)
    logs = np.log(dts[used]) - np.mean(np.log(dts[used]))
    shares = tolerances[used] / np.abs(errors[used])
    return float(np.sum(np.abs(logs) * shares) / np.sum(logs**2))


def _judge_order(claim: Claim, metric: Metric, found: ErrorBudget) -> Judgement | None:
    claimed = claim.order if found.cause == "discretisation" else None
    if metric.name in JUMPING or (math.isnan(found.order) and claimed != math.inf):
        return None
    verdict: Verdict = "measured" if claimed is None else "passed" if found.order_upper >= claimed else "failed"
    steps = ", ".join(f"{dt:g}" for dt in found.dts)
    claim_text = "" if claimed is None else f"; claimed {'exactness' if claimed == math.inf else f'{claimed:g}'}"
    reason = f"fitted at {steps} s{claim_text}" if steps else f"{found.reason}{claim_text}"
    return Judgement(found.order, verdict, found.order_lower, found.order_upper, found.cause, reason)
