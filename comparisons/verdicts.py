"""From a value and a scene's expectations to a bound and a verdict."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal, get_args

from comparisons.engines.base import EngineMissing, Limit
from comparisons.engines.registry import BUILT_IN, engine
from comparisons.metrics import METRICS, Metric
from scenarios import DropspinError, Scenario, SceneError, Truth
from scenarios.errors import did_you_mean
from scenarios.model import Expectation

Verdict = Literal["passed", "failed", "measured", "limited", "diverged", "crashed", "timed_out", "declined", "missing", "no_truth"]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
FAILURES = frozenset({"failed"})
BREAKDOWNS = frozenset({"diverged", "crashed", "timed_out"})


@dataclass(frozen=True)
class Judgement:
    """A bound and what came of it; `lower` and `upper` are NaN where there is none."""

    lower: float
    upper: float
    verdict: Verdict
    reason: str


def assert_expectations_can_be_judged(scene: Scenario, truth: Truth | None, engines: Iterable[str]) -> None:
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
            raise SceneError(f"{where}.metric: got {metric.name!r}; it needs {metric.needs}, which this scene has not.")
        base = (expectation.engine or "document").split("[")[0]
        if base not in known_engines and ":" not in base:
            raise SceneError(
                f"{where}.engine: got {expectation.engine!r}; no such engine.{did_you_mean(base, known_engines)} "
                f"Known: {', '.join(sorted(known_engines))}."
            )
        if expectation.engine and base in BUILT_IN:
            try:
                canonical = _canonical(expectation.engine)
            except DropspinError as error:
                raise SceneError(f"{where}.engine: got {expectation.engine!r}; {error}") from None
            if canonical != expectation.engine:
                raise SceneError(f"{where}.engine: got {expectation.engine!r}; write it as {canonical!r}, as the results do.")


def _canonical(engine_name: str) -> str:
    try:
        return engine(engine_name).label
    except EngineMissing:
        return engine_name  # nothing to compare it with here


def judge(scene: Scenario, label: str, dt: float, metric: Metric, value: float) -> Judgement:
    """Hold one value against what the scene expects of this engine at this step.

    The most narrowly named expectations count: for an engine at a step, else for an engine, else for a step, else for all.
    So a known fault of one engine never loosens what the others are held to.
    """
    matching = [
        expectation
        for expectation in scene.expect
        if expectation.metric == metric.name
        and expectation.engine in (None, label)
        and (expectation.dt is None or any(math.isclose(step, dt, rel_tol=1e-9) for step in expectation.dt))
    ]
    if not matching:
        return Judgement(math.nan, math.nan, "measured", "")
    narrowest = max(_narrowness(expectation) for expectation in matching)
    binding = [expectation for expectation in matching if _narrowness(expectation) == narrowest]
    bounds = [_bounds(expectation, metric) for expectation in binding]
    lower, upper = max(low for low, _ in bounds), min(high for _, high in bounds)
    verdict: Verdict = "passed" if lower <= value <= upper else "failed"
    reason = "; ".join(expectation.reason for expectation in binding)
    return Judgement(_finite_or_nan(lower), _finite_or_nan(upper), verdict, reason)


def known_fault(scene: Scenario, label: str, dt: float, metric: Metric, limit: float, uncertainty: float) -> str | None:
    """The reason of an expectation, made of this engine by name, that an error whose limit is not 0 meets; None if there is none."""
    judgement = judge(scene, label, dt, metric, limit)
    named = any(expectation.metric == metric.name and expectation.engine == label for expectation in scene.expect)
    lower, upper = (
        bound if math.isfinite(bound) else other for bound, other in ((judgement.lower, -math.inf), (judgement.upper, math.inf))
    )
    return judgement.reason if named and lower - uncertainty <= limit <= upper + uncertainty else None


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


def excused(row: dict[str, Any], limits: Iterable[Limit]) -> dict[str, Any]:
    """A row of results that is `limited` rather than failed, where a limit that the engine has met explains an error of that size."""
    if row["verdict"] != "failed":
        return row
    reasons = [limit.said for limit in limits if abs(row["value"]) <= limit.sizes.get(row["metric"], -1.0)]
    return row | {"verdict": "limited", "reason": "; ".join(filter(None, [*reasons, row["reason"]]))} if reasons else row
