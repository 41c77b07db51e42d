"""The bounds and the verdict on a measured value, from the expectations of the scene."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

from dropspin.comparisons.engines.base import EngineBroken, EngineMissing, KnownLimitation
from dropspin.comparisons.engines.registry import BUILT_IN, engine
from dropspin.comparisons.measuring.metric import Metric
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.tolerances import negligible
from dropspin.scenarios import DropspinError, Scenario, SceneError, Truth
from dropspin.scenarios.errors import did_you_mean
from dropspin.scenarios.model import Expectation

Verdict = Literal[
    "passed", "failed", "known", "measured", "limited", "diverged", "crashed", "timed_out", "declined", "missing", "broken", "no_truth"
]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
WORDS = {"known": "known fault", "timed_out": "timed out", "no_truth": "no exact solution"}
"""Words for verdicts that differ from the verdict itself."""
MARKS = {
    "passed": "✓",
    "failed": "✗",
    "known": "†",
    "measured": "·",
    "limited": "!",
    "diverged": "∞",
    "crashed": "✗",
    "timed_out": "⏱",
    "declined": "–",
    "missing": "?",
    "broken": "✗",
    "no_truth": "·",
}
"""Verdicts as one character."""
SEVERITY = (
    "broken",
    "crashed",
    "timed_out",
    "diverged",
    "failed",
    "missing",
    "declined",
    "known",
    "limited",
    "no_truth",
    "passed",
    "measured",
)
"""Worst first: the verdict that represents a scene and an engine."""
assert set(SEVERITY) == set(VERDICTS)
FAILURES = frozenset({"failed"})
BREAKDOWNS = frozenset({"broken", "diverged", "crashed", "timed_out"})
Basis = Literal["", "fault_absent", "few_starts", "same_method", "accepted_failure", "scene_changed"]
"""What a verdict is based on, beside value and bounds: the known fault that is expected does not occur; the few starts of a quick run do
not decide it; two engines agree because they use the same discretisation; a failure was accepted; the scene is not the accepted one."""
Cause = str
"""The cause to which an error is attributed: discretisation, model, setting, rounding, chaotic, unresolved, or an option of the engine that
sets its
accuracy; empty if the error was not attributed."""


@dataclass(frozen=True)
class Judgement:
    """A value and the verdict on it.

    Attributes:
        value: The value; NaN where there is none.
        verdict: The verdict.
        lower: Smallest allowed value, or the lower end of the 95 % interval of an order or an asymptotic error; NaN if there is none.
        upper: Largest allowed value, or the upper end of that interval; NaN if there is none.
        cause: The cause to which the error is attributed.
        reason: The reason for the verdict.
        tolerance: The largest difference between two runs that does not count as a change; NaN if the value is not compared.
        basis: What the verdict is based on, beside value and bounds.
    """

    value: float
    verdict: Verdict
    lower: float = math.nan
    upper: float = math.nan
    cause: Cause = ""
    reason: str = ""
    tolerance: float = math.nan
    basis: Basis = ""


def judge(scene: Scenario, label: str, dt: float, metric: Metric, value: float) -> Judgement:
    """Compare a value with the expectations of the scene for this engine at this time step.

    The most specific expectations apply: for an engine at a time step, else for an engine, else for a time step, else for all. An
    expectation for an engine that allows more than those for all engines, or that excludes an error of 0, expects a known fault. A value
    that shows this fault is `known`; a value that meets the expectations for all engines passes.
    """
    matching = [one for one in scene.expect if one.metric == metric.name and one.engine in (None, label) and _is_at(one, dt)]
    if not matching:
        return Judgement(value, "measured")
    of_all = [one for one in matching if one.engine is None]
    binding = _narrowest(matching)
    found = _compared(binding, metric, value)
    if binding[0].engine is None or not _expect_fault(scene, binding, metric):
        return found
    if _compared(_narrowest(of_all), metric, value).verdict == "passed" if of_all else abs(value) <= negligible(scene, metric.unit):
        reason = f"the known fault does not occur; its expectation can be removed: {found.reason}"
        return found if found.verdict == "passed" else replace(found, verdict="passed", basis="fault_absent", reason=reason)
    return replace(found, verdict="known") if found.verdict == "passed" else found


def judge_asymptotic_error(scene: Scenario, label: str, dt: float, metric: Metric, limit: Judgement) -> Judgement:
    """Compare an asymptotic error with the expectations of the scene for this engine at its finest time step [s].

    A model error or a setting error is `known` if an expectation for this engine allows values of its interval, and fails otherwise. A
    vanishing error passes, also where a known fault is expected at a time step: whether that fault occurs is judged there.
    """
    named = _narrowest([one for one in scene.expect if one.metric == metric.name and one.engine == label and _is_at(one, dt)])
    if limit.cause == "model":
        lowers, uppers = zip(*(_bounds(one, metric) for one in named), strict=True) if named else ((math.inf,), (-math.inf,))
        if limit.lower <= min(uppers) and limit.upper >= max(lowers):
            return replace(limit, verdict="known", reason="; ".join(one.reason for one in named))
        return replace(limit, verdict="failed", reason=f"{limit.reason}; no time step removes it")
    if limit.cause == "unresolved":
        return replace(limit, verdict="measured")
    return replace(limit, verdict="passed")


def with_limitations(judgement: Judgement, metric: str, limitations: Iterable[KnownLimitation], least: float | None = None) -> Judgement:
    """Change a failure to `limited` if a known limitation that the engine met explains an error of its size.

    Args:
        judgement: The judgement of a value or of an asymptotic error.
        metric: Name of the metric.
        limitations: The limitations that the engine met.
        least: The smallest size of an error that has an interval; by default the size of the value.
    """
    if judgement.verdict != "failed":
        return judgement
    size = abs(judgement.value) if least is None else least
    reasons = [one.message for one in limitations if size <= one.explained_errors.get(metric, -1.0)]
    if not reasons:
        return judgement
    return replace(judgement, verdict="limited", reason="; ".join(dict.fromkeys(filter(None, [*reasons, judgement.reason]))))


def with_precision(judgement: Judgement, rounded: float) -> Judgement:
    """Change a failure to `limited` if rounding in the precision that the engine declares can cause its distance from the bound."""
    beyond = max(
        judgement.lower - judgement.value, judgement.value - judgement.upper, key=lambda part: -math.inf if math.isnan(part) else part
    )
    if judgement.verdict != "failed" or not beyond <= rounded:
        return judgement
    reason = f"{judgement.reason}; rounding in the single precision that the engine declares may cause {rounded:.2g}"
    return replace(judgement, verdict="limited", reason=reason)


def verify_expectations(scene: Scenario, truth: Truth | None, engines: Iterable[str]) -> None:
    """Raise `SceneError` if an expectation has an unknown metric or engine, or a metric that does not apply to the scene."""
    known_engines = {*BUILT_IN, *(label.split("[")[0] for label in engines)}
    for number, expectation in enumerate(scene.expect):
        metric_key, engine_key = (_key(scene, number, name) for name in ("metric", "engine"))
        if expectation.metric not in METRICS:
            raise SceneError(
                f"{metric_key}: got {expectation.metric!r}; no such metric."
                f"{did_you_mean(expectation.metric, METRICS)} Known: {', '.join(METRICS)}."
            )
        metric = METRICS[expectation.metric]
        if not metric.applies(scene, truth):
            raise SceneError(f"{metric_key}: got {metric.name!r}; it needs {metric.needs}, which this scene does not have.")
        if expectation.engine is not None:
            _verify_engine(f"{engine_key}: got {expectation.engine!r}", expectation.engine, known_engines)


def _key(scene: Scenario, number: int, name: str) -> str:
    """A key of an expectation in the scene's file or mapping."""
    return f"{scene.origin}: expect[{number}].{name}" if scene.origin else f"scene['expect'][{number}][{name!r}]"


def _verify_engine(where: str, name: str, known: set[str]) -> None:
    base = name.partition("[")[0]
    if base not in known and ":" not in base:
        raise SceneError(f"{where}; no such engine.{did_you_mean(base, known)} Known: {', '.join(sorted(known))}.")
    if base not in BUILT_IN or name == base:  # only options can be wrong, and an adapter need not be imported for a bare name
        return
    try:
        canonical = engine(name).label
    except (EngineBroken, EngineMissing):
        return  # its options cannot be checked here
    except DropspinError as error:
        raise SceneError(f"{where}; {error}") from None
    if canonical != name:
        raise SceneError(f"{where}; write it as {canonical!r}, as the results do.")


def _finite_or_nan(bound: float) -> float:
    return bound if math.isfinite(bound) else math.nan


def _is_at(expectation: Expectation, dt: float) -> bool:
    """Whether an expectation applies to a time step [s]."""
    return expectation.dt is None or any(math.isclose(step, dt, rel_tol=1e-9) for step in expectation.dt)


def _narrowest(expectations: Sequence[Expectation]) -> list[Expectation]:
    """The most specific expectations: for an engine at a time step, else for an engine, else for a time step, else for all."""
    narrowness = [2 * (one.engine is not None) + (one.dt is not None) for one in expectations]
    return [one for one, narrow in zip(expectations, narrowness, strict=True) if narrow == max(narrowness)]


def _compared(binding: Sequence[Expectation], metric: Metric, value: float) -> Judgement:
    """Compare a value with expectations that must all be met."""
    bounds = [_bounds(one, metric) for one in binding]
    lower, upper = max(low for low, _ in bounds), min(high for _, high in bounds)
    verdict: Verdict = "passed" if lower <= value <= upper else "failed"
    return Judgement(value, verdict, _finite_or_nan(lower), _finite_or_nan(upper), reason="; ".join(one.reason for one in binding))


def _expect_fault(scene: Scenario, named: Sequence[Expectation], metric: Metric) -> bool:
    """Whether expectations for one engine allow more than those for all engines, or exclude an error of 0."""
    of_all = [_bounds(one, metric) for one in scene.expect if one.metric == metric.name and one.engine is None]
    bounds = [_bounds(one, metric) for one in named]
    if of_all:
        return all(low < min(least for least, _ in of_all) or high > max(most for _, most in of_all) for low, high in bounds)
    return any(low > 0.0 or high < 0.0 for low, high in bounds)


def _bounds(expectation: Expectation, metric: Metric) -> tuple[float, float]:
    if expectation.within is not None:
        return expectation.within[0], expectation.within[1]
    if expectation.above is not None:
        return expectation.above, math.inf
    assert expectation.below is not None
    return (-expectation.below if metric.signed else -math.inf), expectation.below
