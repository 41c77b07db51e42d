"""Verdicts on a value, on an order and on an asymptotic error.

`judge` decides the verdict on a value, and its docstring has the order of the rules. Two checks apply to every engine beside the
expectations of the scene: the interval of an asymptotic error must contain 0, and the interval of an order must reach the claimed order.
"""

import math

import numpy as np

from dropspin.comparisons.judging.convergence import JUMPING, Claim, Convergence, SeriesPoint
from dropspin.comparisons.judging.expectations import bounds_of, compared_with_expectations, matching_expectations, narrowest
from dropspin.comparisons.judging.extrapolation import ORDERS
from dropspin.comparisons.judging.verdicts import COMBINED, WITHIN_UNCERTAINTY, Judgement, Verdict
from dropspin.comparisons.measuring.comparison import BeyondHorizon
from dropspin.comparisons.measuring.metric import Metric
from dropspin.comparisons.measuring.tolerances import negligible
from dropspin.scenarios import Scenario, Truth

OF_BOUND = "reason of the bound: "
"""Before the reason of an expectation that fails: what the bound allows for, which need not be what is wrong."""
NEAR_ORDER = 0.25
"""How far a fitted order above those of the intervals may be below the claimed one: half the distance of two orders there."""


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
    prefix = OF_BOUND if expected.reason and verdict == "failed" else ""
    reason = joined(str(unresolved or ""), prefix + expected.reason)
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
    `limited` if a known limitation explains an error as small as the nearer end of a narrow interval, or as the largest at a time step, and
    fails otherwise. An unresolved one is `measured`. A vanishing error passes, also where a known fault is expected at a time step: whether
    that fault occurs is judged there.
    """
    budget = convergence.budget
    if math.isnan(budget.asymptotic_error) and not abs(convergence.finest_error) > negligible(scene, metric.unit):
        return None
    verdict: Verdict = "measured" if budget.cause in ("unresolved", WITHIN_UNCERTAINTY, COMBINED) else "passed"
    reason = budget.reason
    if budget.cause in ("model", "setting"):
        matching = matching_expectations(scene, claim.label, convergence.finest, metric)
        allowing = narrowest([expected for expected in matching if expected.engine is not None])
        bounds = [bounds_of(expected, metric) for expected in allowing]
        if bounds and all(budget.lower <= upper and budget.upper >= lower for lower, upper in bounds):
            verdict, reason = "known", "; ".join(expected.reason for expected in allowing)
        else:
            nearest, estimate = max(budget.lower, -budget.upper), abs(budget.asymptotic_error)
            least = nearest if nearest >= 0.5 * estimate else estimate  # the end of a wide interval says nothing of the size
            explained = _explained(claim, metric, np.fmin(least, convergence.largest_error))
            verdict, reason = "limited" if explained else "failed", joined(*explained, f"{reason}; no time step removes it")
    reason += f" ({convergence.remark})" if convergence.remark else ""
    if verdict == "failed" and budget.cause == "setting":
        reason += ", but calibrated settings remove more than half of it: it is a setting error"
    # The result of time steps that leave the cause open is not compared with that of another run.
    tolerance = math.nan if budget.cause == "unresolved" else budget.upper - budget.lower
    return Judgement(budget.asymptotic_error, verdict, budget.lower, budget.upper, budget.cause, reason, tolerance)


def judge_order(claim: Claim, metric: Metric, convergence: Convergence) -> Judgement | None:
    """Judge an observed order; None if the errors follow no power of dt.

    It fails if its interval does not reach the claimed order; or, above those of intervals, if the fitted order is not near it.
    """
    budget = convergence.budget
    claimed = claim.order if budget.cause == "discretisation" else None
    if metric.name in JUMPING or (math.isnan(budget.order) and claimed != math.inf):
        return None
    verdict: Verdict = "measured"
    if claimed is not None:
        is_fitted = ORDERS[-1] < claimed <= budget.order + NEAR_ORDER  # above these orders, no interval is computed
        verdict = "passed" if budget.order_upper >= claimed or is_fitted else "failed"
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
