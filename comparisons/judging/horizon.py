"""The remark on a measurement whose exact solution is valid only for the first part of the scene."""

from dataclasses import replace

from dropspin.comparisons.judging.verdicts import Judgement
from dropspin.comparisons.measuring.comparison import BeyondHorizon, Unresolved
from dropspin.comparisons.measuring.metric import Metric
from dropspin.scenarios import Scenario, Truth


def with_horizon(judgement: Judgement, scene: Scenario, metric: Metric, truth: Truth | None, unresolved: Unresolved | None) -> Judgement:
    """A judgement that states how much of the scene the exact solution covers if it does not cover the whole scene.

    A value that is missing for this reason has the verdict `no_truth`, unless an expectation of it failed. A metric of the first impact is
    not limited, because the exact solution contains this impact.
    """
    if isinstance(unresolved, BeyondHorizon) and judgement.verdict == "measured":
        return replace(judgement, verdict="no_truth")
    if truth is None or metric.kind != "truth" or metric.first_flight or unresolved or truth.covers_all(scene.duration):
        return judgement
    limit = f"compared up to t = {truth.horizon:.3g} s, where the exact solution ends: {truth.ends}"
    return replace(judgement, reason="; ".join(filter(None, [judgement.reason, limit])))
