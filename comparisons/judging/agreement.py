"""Agreement: the difference between the results of two engines, and whether their agreement is evidence of accuracy."""

from collections.abc import Iterator, Sequence

import numpy as np

from dropspin.comparisons.judging.judge import joined, remark_on_horizon
from dropspin.comparisons.judging.verdicts import Basis, Judgement, Verdict
from dropspin.comparisons.measuring.comparison import BeyondHorizon, Comparison, Unresolved
from dropspin.comparisons.measuring.metric import Metric
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.scenarios import Scenario, Truth


def judge_agreement(
    scene: Scenario, truth: Truth | None, first: Sequence[Comparison], second: Sequence[Comparison], shared: str | None
) -> Iterator[tuple[Metric, Judgement]]:
    """The differences between two engines, for each metric that is defined between engines.

    Args:
        scene: The scene.
        truth: The exact solution of the scene, if it is known.
        first: The motion of one engine from each start phase, compared with the exact solution.
        second: The same of the other engine.
        shared: The discretisation that both engines declare; None if they do not.
    """
    pairs = list(map(_paired, first, second))
    basis: Basis = "same_method" if shared else ""
    reason = f"no evidence: both are {shared}" if shared else ""
    # Without an exact solution, the motion of an engine takes its place, to determine which metrics apply.
    known = truth if truth is not None and truth.is_exact else Truth("engine", "", lambda t: second[0].motion.states[: len(t)])
    for metric in METRICS.values():
        if not (metric.agreement and metric.applies(scene, known)):
            continue
        try:
            value, remark = metric.value(pairs), remark_on_horizon(scene, truth, metric)
            judgement = Judgement(value, "measured", reason=joined(reason, remark), basis=basis)
        except Unresolved as error:
            verdict: Verdict = "no_truth" if isinstance(error, BeyondHorizon) else "measured"
            judgement = Judgement(np.nan, verdict, cause="unresolved", reason=joined(reason, str(error)), basis=basis)
        yield metric, judgement


def _paired(first: Comparison, second: Comparison) -> Comparison:
    """The motions of two engines up to the horizon of the exact solution, or, without one, up to the first contact of either engine."""
    if first.reference is not None:
        return Comparison.between(first, second, len(first.reference))
    contacts = [case.first_contact for case in (first, second)]
    until = max(2, min([len(first.motion), *(contact[0] + 1 for contact in contacts if contact is not None)]))
    return Comparison(first.scene, first.motion[:until], second.motion[:until])
