"""From a value and a scene's expectations to a bound and a verdict."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

from comparisons.metrics import METRICS, Metric
from scenarios import Scenario, SceneError
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


def assert_metrics_exist(scene: Scenario) -> None:
    """Raise `SceneError` if an expectation names a metric that does not exist."""
    for number, expectation in enumerate(scene.expect):
        if expectation.metric not in METRICS:
            raise SceneError(
                f"{scene.name}: expect[{number}].metric: got {expectation.metric!r}; no such metric."
                f"{did_you_mean(expectation.metric, METRICS)} Known: {', '.join(METRICS)}."
            )


def judge(scene: Scenario, engine: str, dt: float, metric: Metric, value: float) -> Judgement:
    """Hold one value against what the scene expects of this engine at this step.

    The most narrowly named expectations count: for an engine at a step, else for an engine, else for a step, else for all.
    So a known fault of one engine never loosens what the others are held to.
    """
    matching = [
        expectation
        for expectation in scene.expect
        if expectation.metric == metric.name
        and expectation.engine in (None, engine)
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
