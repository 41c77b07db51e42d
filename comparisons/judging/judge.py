"""Verdicts on a value, on an order and on an asymptotic error, and the expectations of a scene that they follow from.

`judge` decides the verdict on a value, and its docstring has the order of the rules. Two checks apply to every engine beside the
expectations of the scene: the interval of an asymptotic error must contain 0, and the interval of an order must reach the claimed order.
"""

import math
from collections.abc import Iterable, Sequence

import numpy as np

from dropspin.comparisons.engines.base import EngineBroken, EngineMissing
from dropspin.comparisons.engines.options import engine_name
from dropspin.comparisons.engines.registry import BUILT_IN, engine
from dropspin.comparisons.judging.convergence import JUMPING, Claim, Convergence, SeriesPoint
from dropspin.comparisons.judging.verdicts import COMBINED, WITHIN_UNCERTAINTY, Basis, Judgement, Verdict
from dropspin.comparisons.measuring.comparison import BeyondHorizon
from dropspin.comparisons.measuring.metric import Metric
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.tolerances import negligible
from dropspin.scenarios import DropspinError, Scenario, SceneError, Truth
from dropspin.scenarios.errors import did_you_mean
from dropspin.scenarios.model import Expectation
from dropspin.scenarios.validation import key_of


def judge(
    scene: Scenario, truth: Truth | None, claim: Claim, metric: Metric, point: SeriesPoint, convergence: Convergence | None = None
) -> Judgement:
    """Judge the value of a metric at a time step.

    The rules apply in this order; each changes only the verdicts that it names:

        1. expectations     passed, failed, or known for a known fault; measured without an expectation
        2. undefined        a value that is not a number fails, unless the time step or the exact solution does not resolve it; without an
                            exact solution that is long enough, measured becomes no_truth
        3. few starts       passed, failed and known become measured if the sampling noise of a quick run, or the uncertainty of a
                            recording, may decide between them
        4. limitations      failed becomes limited if a known limitation that the engine met explains an error of this size
        5. precision        failed becomes limited if rounding in single precision may cause the distance from the bound
        6. model error      passed becomes known if the bounds exclude 0 and the asymptotic error is a known fault

    In the check of a run against a baseline, failures that were accepted become known too: `regressions.checking`.

    Args:
        scene: The scene.
        truth: Its exact solution, if it is known.
        claim: The properties that the engine declares, and the limitations that it met at this time step.
        metric: The metric.
        point: The metric at this time step.
        convergence: The convergence of the metric; None if it was not measured at several time steps.
    """
    value, unresolved = point.average.value, point.unresolved
    expected = compared_with_expectations(scene, claim.label, point.dt, metric, value)
    verdict, basis, lower, upper = expected.verdict, expected.basis, expected.lower, expected.upper
    reason = joined(str(unresolved or ""), expected.reason)
    if math.isnan(value) and not unresolved:
        verdict, reason = "failed", reason or "the event that it measures did not occur"
    if isinstance(unresolved, BeyondHorizon) and verdict == "measured":
        verdict = "no_truth"
    if not unresolved:
        reason = joined(reason, remark_on_horizon(scene, truth, metric))
    if point.noise and verdict in ("passed", "failed", "known"):
        near = [bound for bound in (lower, upper) if abs(bound - value) <= point.noise]
        values = (value - point.noise, value + point.noise, *near)
        if {compared_with_expectations(scene, claim.label, point.dt, metric, other).verdict for other in values} - {verdict}:
            verdict, basis = "measured", "few_starts" if truth is None or truth.is_exact else "uncertain_recording"
            of_what = "the few starts of a quick run" if basis == "few_starts" else "the recording"
            reason = f"not decided by {of_what} (± {point.noise:.2g}): {reason}"
    if verdict == "failed" and (explained := _explained(claim, metric, abs(value))):
        verdict, reason = "limited", joined(*explained, reason)
    if verdict == "failed" and np.fmax(lower - value, value - upper) <= point.rounded:
        verdict = "limited"
        reason += f"; rounding in the single precision that the engine declares may cause {point.rounded:.2g}"
    if verdict == "passed" and (lower > 0.0 or upper < 0.0) and convergence is not None:
        asymptotic = judge_asymptotic_error(scene, claim, metric, convergence)
        verdict = "known" if asymptotic is not None and asymptotic.verdict == "known" else verdict
    cause = "unresolved" if unresolved else "" if convergence is None else convergence.budget.cause
    return Judgement(value, verdict, lower, upper, cause, reason, point.tolerance, basis)


def judge_asymptotic_error(scene: Scenario, claim: Claim, metric: Metric, convergence: Convergence) -> Judgement | None:
    """Judge an asymptotic error; None if the time steps give none of an error that is negligible or not resolved at the finest one.

    The difference from a recording that remains is `measured`.

    A model error or a setting error is `known` if an expectation for this engine at its finest time step allows values of its interval,
    `limited` if a known limitation explains an error as small as the nearer end of the interval, and fails otherwise. An unresolved one is
    `measured`. A vanishing error passes, also where a known fault is expected at a time step: whether that fault occurs is judged there.
    """
    budget = convergence.budget
    if math.isnan(budget.asymptotic_error) and not abs(convergence.finest_error) > negligible(scene, metric.unit):
        return None
    verdict: Verdict = "measured" if budget.cause == "unresolved" else "passed"
    reason = budget.reason
    if budget.cause in (WITHIN_UNCERTAINTY, COMBINED):
        verdict = "measured"
    elif budget.cause in ("model", "setting"):
        matching = _matching(scene, claim.label, convergence.finest, metric)
        allowing = _narrowest([expected for expected in matching if expected.engine is not None])
        bounds = [_bounds(expected, metric) for expected in allowing]
        if bounds and all(budget.lower <= upper and budget.upper >= lower for lower, upper in bounds):
            verdict, reason = "known", "; ".join(expected.reason for expected in allowing)
        else:
            explained = _explained(claim, metric, max(budget.lower, -budget.upper))
            verdict, reason = "limited" if explained else "failed", joined(*explained, f"{reason}; no time step removes it")
    reason += f" ({convergence.remark})" if convergence.remark else ""
    if verdict == "failed" and budget.cause == "setting":
        reason += ", but calibrated settings reduce or remove it: it is a setting error"
    # The result of time steps that leave the cause open is not compared with that of another run.
    tolerance = math.nan if budget.cause == "unresolved" else budget.upper - budget.lower
    return Judgement(budget.asymptotic_error, verdict, budget.lower, budget.upper, budget.cause, reason, tolerance)


def judge_order(claim: Claim, metric: Metric, convergence: Convergence) -> Judgement | None:
    """Judge an observed order: it fails if its interval does not reach the claimed order; None if the errors follow no power of dt."""
    budget = convergence.budget
    claimed = claim.order if budget.cause == "discretisation" else None
    if metric.name in JUMPING or (math.isnan(budget.order) and claimed != math.inf):
        return None
    verdict: Verdict = "measured" if claimed is None else "passed" if budget.order_upper >= claimed else "failed"
    steps = ", ".join(f"{dt:g}" for dt in budget.dts)
    claim_text = "" if claimed is None else f"; claimed {'exactness' if claimed == math.inf else f'{claimed:g}'}"
    reason = f"fitted at {steps} s{claim_text}" if steps else f"{budget.reason}{claim_text}"
    return Judgement(budget.order, verdict, budget.order_lower, budget.order_upper, budget.cause, reason, convergence.order_tolerance)


def remark_on_horizon(scene: Scenario, truth: Truth | None, metric: Metric) -> str:
    """Up to which time a value is compared with an exact solution that does not cover the whole scene; empty if it covers all of it.

    A metric of the first impact is not limited, because the exact solution contains this impact.
    """
    if truth is None or not truth.is_exact or metric.kind != "truth" or metric.first_flight or truth.covers_all(scene.duration):
        return ""
    return f"compared up to t = {truth.horizon:.3g} s, where the exact solution ends: {truth.ends}"


def _explained(claim: Claim, metric: Metric, size: float) -> list[str]:
    """The known limitations that an engine met and that explain an error of some size."""
    return [limitation.message for limitation in claim.limitations if size <= limitation.explained_errors.get(metric.name, -1.0)]


def joined(*reasons: str) -> str:
    """Reasons as one text; empty and repeated ones are left out."""
    return "; ".join(dict.fromkeys(filter(None, reasons)))


def compared_with_expectations(scene: Scenario, label: str, dt: float, metric: Metric, value: float) -> Judgement:
    """Compare a value with the expectations of a scene for an engine at a time step [s].

    The most specific expectations apply: for an engine at a time step, else for an engine, else for a time step, else for all. An
    expectation for an engine that allows more than those for all engines, or that excludes an error of 0, expects a known fault. A value
    that shows this fault is `known`; a value that meets the expectations for all engines passes.
    """
    matching = _matching(scene, label, dt, metric)
    if not matching:
        return Judgement(value, "measured")
    binding, of_all = _narrowest(matching), [expected for expected in matching if expected.engine is None]
    lower, upper = _strictest(binding, metric)
    reason, is_met = "; ".join(expected.reason for expected in binding), lower <= value <= upper
    verdict: Verdict = "passed" if is_met else "failed"
    basis: Basis = ""
    if binding[0].engine is not None and _expect_fault(scene, binding, metric):
        if of_all:
            least, most = _strictest(_narrowest(of_all), metric)
        else:
            least, most = -negligible(scene, metric.unit), negligible(scene, metric.unit)
        if not least <= value <= most:
            verdict = "known" if is_met else "failed"
        elif not is_met:
            verdict, basis = "passed", "fault_absent"
            reason = f"the known fault does not occur; its expectation can be removed: {reason}"
    lower, upper = (bound if math.isfinite(bound) else math.nan for bound in (lower, upper))
    return Judgement(value, verdict, lower, upper, reason=reason, basis=basis)


def _matching(scene: Scenario, label: str, dt: float, metric: Metric) -> list[Expectation]:
    """The expectations of a metric that apply to an engine at a time step [s]."""
    return [
        expected
        for expected in scene.expect
        if expected.metric == metric.name
        and expected.engine in (None, label)
        and (expected.dt is None or any(math.isclose(step, dt, rel_tol=1e-9) for step in expected.dt))
    ]


def _narrowest(expectations: Sequence[Expectation]) -> list[Expectation]:
    """The most specific expectations: for an engine at a time step, else for an engine, else for a time step, else for all."""
    narrowness = [2 * (expected.engine is not None) + (expected.dt is not None) for expected in expectations]
    return [expected for expected, narrow in zip(expectations, narrowness, strict=True) if narrow == max(narrowness)]


def _strictest(expectations: Sequence[Expectation], metric: Metric) -> tuple[float, float]:
    """The bounds of expectations that must all be met."""
    lowers, uppers = zip(*(_bounds(expected, metric) for expected in expectations), strict=True)
    return max(lowers), min(uppers)


def _expect_fault(scene: Scenario, named: Sequence[Expectation], metric: Metric) -> bool:
    """Whether expectations for one engine allow more than those for all engines, or exclude an error of 0."""
    of_all = [_bounds(expected, metric) for expected in scene.expect if expected.metric == metric.name and expected.engine is None]
    bounds = [_bounds(expected, metric) for expected in named]
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


def verify_expectations(scene: Scenario, truth: Truth | None, engines: Iterable[str]) -> None:
    """Raise `SceneError` if an expectation has an unknown metric or engine, or a metric that does not apply to the scene."""
    known = {*BUILT_IN, *map(engine_name, engines)}
    where, root = (f"{scene.origin}: ", "") if scene.origin else ("", "scene")
    for number, expectation in enumerate(scene.expect):
        metric_key, engine_key = (where + key_of(["expect", number, key], root) for key in ("metric", "engine"))
        name = expectation.metric
        if name not in METRICS:
            raise SceneError(f"{metric_key}: got {name!r}; no such metric.{did_you_mean(name, METRICS)} Known: {', '.join(METRICS)}.")
        if not METRICS[name].applies(scene, truth):
            raise SceneError(f"{metric_key}: got {name!r}; it needs {METRICS[name].needs}, which this scene does not have.")
        if expectation.engine is not None:
            _verify_engine(f"{engine_key}: got {expectation.engine!r}", expectation.engine, known)


def _verify_engine(where: str, label: str, known: set[str]) -> None:
    name = engine_name(label)
    if name not in known and ":" not in name:
        raise SceneError(f"{where}; no such engine.{did_you_mean(name, known)} Known: {', '.join(sorted(known))}.")
    if name not in BUILT_IN or name == label:  # only options can be wrong, and an adapter need not be imported for a bare name
        return
    try:
        canonical = engine(label).label
    except (EngineBroken, EngineMissing):
        return  # its options cannot be checked here
    except DropspinError as error:
        raise SceneError(f"{where}; {error}") from None
    if canonical != label:
        raise SceneError(f"{where}; write it as {canonical!r}, as the results do.")
