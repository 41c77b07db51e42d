"""The expectations of a scene: what they may name, which of them apply to a value, and the verdict that follows from them alone."""

import math
from collections.abc import Iterable, Sequence

from dropspin.comparisons.engines.base import EngineBroken, EngineMissing
from dropspin.comparisons.engines.options import engine_name
from dropspin.comparisons.engines.registry import BUILT_IN, engine
from dropspin.comparisons.judging.verdicts import Basis, Judgement, Verdict
from dropspin.comparisons.measuring.metric import Metric
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.tolerances import negligible
from dropspin.scenarios import DropspinError, Scenario, SceneError, Truth
from dropspin.scenarios.errors import did_you_mean
from dropspin.scenarios.model import Expectation
from dropspin.scenarios.validation import key_of


def verify_expectations(scene: Scenario, truth: Truth | None, engines: Iterable[str]) -> None:
    """Raise `SceneError` if an expectation has an unknown metric or engine, or a metric that does not apply to the scene."""
    known = {*BUILT_IN, *map(engine_name, engines)}
    for number, expectation in enumerate(scene.expect):
        of_metric, of_engine = _metric_problem(scene, truth, expectation.metric), _engine_problem(expectation.engine, known)
        if of_metric or of_engine:
            key, given = ("metric", expectation.metric) if of_metric else ("engine", expectation.engine)
            where, root = (f"{scene.origin}: ", "") if scene.origin else ("", "scene")
            raise SceneError(f"{where}{key_of(['expect', number, key], root)}: got {given!r}; {of_metric or of_engine}")


def _metric_problem(scene: Scenario, truth: Truth | None, name: str) -> str:
    """What is wrong with the metric of an expectation; empty if nothing is."""
    if name not in METRICS:
        return f"no such metric.{did_you_mean(name, METRICS)} Known: {', '.join(METRICS)}."
    return "" if METRICS[name].applies(scene, truth) else f"it needs {METRICS[name].needs}, which this scene does not have."


def _engine_problem(label: str | None, known: set[str]) -> str:
    """What is wrong with the engine of an expectation; empty if nothing is."""
    if label is None:
        return ""
    name = engine_name(label)
    if name not in known and ":" not in name:
        return f"no such engine.{did_you_mean(name, known)} Known: {', '.join(sorted(known))}."
    if name not in BUILT_IN or name == label:  # only options can be wrong, and an adapter need not be imported for a bare name
        return ""
    try:
        canonical = engine(label).label
    except (EngineBroken, EngineMissing):
        return ""  # its options cannot be checked here
    except DropspinError as error:
        return str(error)
    return "" if canonical == label else f"write it as {canonical!r}, as the results do."


def compared_with_expectations(scene: Scenario, label: str, dt: float, metric: Metric, value: float) -> Judgement:
    """Compare a value with the expectations of a scene for an engine at a time step [s].

    The most specific expectations apply: for an engine at a time step, else for an engine, else for a time step, else for all. An
    expectation for an engine that allows more than those for all engines, or that excludes an error of 0, expects a known fault. A value
    that shows this fault is `known`; a value that meets the expectations for all engines passes.
    """
    matching = matching_expectations(scene, label, dt, metric)
    if not matching:
        return Judgement(value, "measured")
    binding, of_all = narrowest(matching), [expected for expected in matching if expected.engine is None]
    lower, upper = _strictest(binding, metric)
    reason, is_met = "; ".join(expected.reason for expected in binding), lower <= value <= upper
    verdict: Verdict = "passed" if is_met else "failed"
    basis: Basis = ""
    if binding[0].engine is not None and _expect_fault(scene, binding, metric):
        if of_all:
            least, most = _strictest(narrowest(of_all), metric)
        else:
            least, most = -negligible(scene, metric.unit), negligible(scene, metric.unit)
        if not least <= value <= most:
            verdict = "known" if is_met else "failed"
        elif not is_met:
            verdict, basis = "passed", "fault_absent"
            reason = f"the known fault does not occur; its expectation can be removed: {reason}"
    lower, upper = (bound if math.isfinite(bound) else math.nan for bound in (lower, upper))
    return Judgement(value, verdict, lower, upper, reason=reason, basis=basis)


def matching_expectations(scene: Scenario, label: str, dt: float, metric: Metric) -> list[Expectation]:
    """The expectations of a metric that apply to an engine at a time step [s]."""
    return [
        expected
        for expected in scene.expect
        if expected.metric == metric.name
        and expected.engine in (None, label)
        and (expected.dt is None or any(math.isclose(step, dt, rel_tol=1e-9) for step in expected.dt))
    ]


def narrowest(expectations: Sequence[Expectation]) -> list[Expectation]:
    """The most specific expectations: for an engine at a time step, else for an engine, else for a time step, else for all."""
    narrowness = [2 * (expected.engine is not None) + (expected.dt is not None) for expected in expectations]
    return [expected for expected, narrow in zip(expectations, narrowness, strict=True) if narrow == max(narrowness)]


def _strictest(expectations: Sequence[Expectation], metric: Metric) -> tuple[float, float]:
    """The bounds of expectations that must all be met."""
    lowers, uppers = zip(*(bounds_of(expected, metric) for expected in expectations), strict=True)
    return max(lowers), min(uppers)


def _expect_fault(scene: Scenario, named: Sequence[Expectation], metric: Metric) -> bool:
    """Whether expectations for one engine allow more than those for all engines, or exclude an error of 0."""
    of_all = [bounds_of(expected, metric) for expected in scene.expect if expected.metric == metric.name and expected.engine is None]
    bounds = [bounds_of(expected, metric) for expected in named]
    if of_all:
        return all(low < min(least for least, _ in of_all) or high > max(most for _, most in of_all) for low, high in bounds)
    return any(low > 0.0 or high < 0.0 for low, high in bounds)


def bounds_of(expectation: Expectation, metric: Metric) -> tuple[float, float]:
    """The least and the largest value that an expectation allows."""
    if expectation.within is not None:
        return expectation.within[0], expectation.within[1]
    if expectation.above is not None:
        return expectation.above, math.inf
    assert expectation.below is not None
    return (-expectation.below if metric.signed else -math.inf), expectation.below
