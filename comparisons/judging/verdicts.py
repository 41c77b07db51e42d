"""From a value and a scene's expectations to bounds and a verdict."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal, get_args

from comparisons.engines.base import EngineMissing, KnownLimitation
from comparisons.engines.registry import BUILT_IN, engine
from comparisons.measuring.metric import Metric
from comparisons.measuring.metrics import METRICS
from scenarios import DropspinError, Scenario, SceneError, Truth
from scenarios.errors import did_you_mean
from scenarios.model import Expectation

Verdict = Literal["passed", "failed", "measured", "limited", "diverged", "crashed", "timed_out", "declined", "missing", "no_truth"]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
FAILURES = frozenset({"failed"})
BREAKDOWNS = frozenset({"diverged", "crashed", "timed_out"})
Cause = str
"""What an error is attributed to: discretisation, model, setting, rounding, chaotic, unresolved, or an option of the engine that sets its
accuracy; empty where nothing was attributed."""


@dataclass(frozen=True)
class Judgement:
    """A value and what was judged of it.

    Attributes:
        value: The value; NaN where there is none.
        verdict: The verdict.
        lower: Least value allowed, or the lower end of the 95 % interval of an order or an asymptotic error; NaN where there is none.
        upper: Largest value allowed, or the upper end of that interval; NaN where there is none.
        cause: What the error is attributed to.
        reason: Why, in words.
        tolerance: How far the value may move between two runs before it counts as changed; NaN where it is not compared.
    """

    value: float
    verdict: Verdict
    lower: float = math.nan
    upper: float = math.nan
    cause: Cause = ""
    reason: str = ""
    tolerance: float = math.nan


def judge(scene: Scenario, label: str, dt: float, metric: Metric, value: float) -> Judgement:
    """Compare one value with what the scene expects of this engine at this time step.

    The most narrowly named expectations count: for an engine at a step, else for an engine, else for a step, else for all.
    So a known fault of one engine never loosens what others must satisfy.
    """
    matching = [
        expectation
        for expectation in scene.expect
        if expectation.metric == metric.name
        and expectation.engine in (None, label)
        and (expectation.dt is None or any(math.isclose(step, dt, rel_tol=1e-9) for step in expectation.dt))
    ]
    if not matching:
        return Judgement(value, "measured")
    narrowest = max(_narrowness(expectation) for expectation in matching)
    binding = [expectation for expectation in matching if _narrowness(expectation) == narrowest]
    bounds = [_bounds(expectation, metric) for expectation in binding]
    lower, upper = max(low for low, _ in bounds), min(high for _, high in bounds)
    verdict: Verdict = "passed" if lower <= value <= upper else "failed"
    reason = "; ".join(expectation.reason for expectation in binding)
    return Judgement(value, verdict, _finite_or_nan(lower), _finite_or_nan(upper), reason=reason)


def known_fault(scene: Scenario, label: str, dt: float, metric: Metric, error: float, uncertainty: float) -> str | None:
    """The reason of an expectation that names this engine and that its asymptotic error meets; None if there is none."""
    judgement = judge(scene, label, dt, metric, error)
    named = any(expectation.metric == metric.name and expectation.engine == label for expectation in scene.expect)
    lower, upper = (
        bound if math.isfinite(bound) else other for bound, other in ((judgement.lower, -math.inf), (judgement.upper, math.inf))
    )
    return judgement.reason if named and lower - uncertainty <= error <= upper + uncertainty else None


def with_limitations(judgement: Judgement, metric: str, limitations: Iterable[KnownLimitation]) -> Judgement:
    """A failure as `limited`, where a known limitation that the engine met explains an error of that size; others unchanged."""
    if judgement.verdict != "failed":
        return judgement
    reasons = [one.message for one in limitations if abs(judgement.value) <= one.explained_errors.get(metric, -1.0)]
    if not reasons:
        return judgement
    return replace(judgement, verdict="limited", reason="; ".join(filter(None, [*reasons, judgement.reason])))


def verify_expectations(scene: Scenario, truth: Truth | None, engines: Iterable[str]) -> None:
    """Raise `SceneError` if an expectation would never be judged: no such metric, not for this scene, no such engine."""
    known_engines = {*BUILT_IN, *(label.split("[")[0] for label in engines)}
    for number, expectation in enumerate(scene.expect):
        where = f"{scene.origin or scene.name}: expect[{number}]"
        if expectation.metric not in METRICS:
            raise SceneError(
                f"{where}.metric: got {expectation.metric!r}; no such metric."
                f"{did_you_mean(expectation.metric, METRICS)} Known: {', '.join(METRICS)}."
            )
        metric = METRICS[expectation.metric]
        if not metric.applies(scene, truth):
            raise SceneError(f"{where}.metric: got {metric.name!r}; it needs {metric.needs}, which this scene does not have.")
        if expectation.engine is not None:
            _verify_engine(f"{where}.engine: got {expectation.engine!r}", expectation.engine, known_engines)


def _verify_engine(where: str, name: str, known: set[str]) -> None:
    base = name.partition("[")[0]
    if base not in known and ":" not in base:
        raise SceneError(f"{where}; no such engine.{did_you_mean(base, known)} Known: {', '.join(sorted(known))}.")
    if base not in BUILT_IN or name == base:  # only options can be wrong, and an adapter need not be imported for a bare name
        return
    try:
        canonical = engine(name).label
    except EngineMissing:
        return  # its options cannot be checked here
    except DropspinError as error:
        raise SceneError(f"{where}; {error}") from None
    if canonical != name:
        raise SceneError(f"{where}; write it as {canonical!r}, as the results do.")


def _finite_or_nan(bound: float) -> float:
    return bound if math.isfinite(bound) else math.nan


def _narrowness(expectation: Expectation) -> int:
    return 2 * (expectation.engine is not None) + (expectation.dt is not None)


def _bounds(expectation: Expectation, metric: Metric) -> tuple[float, float]:
    if expectation.within is not None:
        return expectation.within[0], expectation.within[1]
    if expectation.above is not None:
        return expectation.above, math.inf
    assert expectation.below is not None
    return (-expectation.below if metric.signed else -math.inf), expectation.below
