"""Agreement: how far two engines are from each other, and whether their agreement is evidence."""

from collections.abc import Iterator, Sequence

import numpy as np

from comparisons.judging.horizon import with_horizon
from comparisons.judging.verdicts import Judgement
from comparisons.measuring.comparison import Comparison, Unresolved
from comparisons.measuring.metric import Metric
from comparisons.measuring.metrics import METRICS
from scenarios import Scenario, Trajectory, Truth

NO_EVIDENCE = "no evidence"
"""How the reason begins where two engines agree because they make the same errors."""


def judge_agreement(
    scene: Scenario,
    truth: Truth | None,
    truths: Sequence[Truth | None],
    first: Sequence[Comparison],
    second: Sequence[Comparison],
    discretisations: tuple[str | None, str | None],
) -> Iterator[tuple[Metric, Judgement]]:
    """The differences between two engines, by the metrics that are defined between engines.

    Args:
        scene: The scene.
        truth: Its exact solution, if it is known.
        truths: The same from each start phase.
        first: One engine's motion from each start phase, compared with the truth.
        second: The other engine's.
        discretisations: What discretisation each engine states.
    """
    pairs = [_paired(truth, one, other) for truth, one, other in zip(truths, first, second, strict=True)]
    shared, other = discretisations
    reason = f"{NO_EVIDENCE}: both are {shared}" if shared is not None and shared == other else ""
    for metric in METRICS.values():
        if not (metric.agreement and metric.applies(scene, truth or _as_truth(second[0].motion))):
            continue
        unresolved: Unresolved | None = None
        try:
            judgement = Judgement(metric.average(pairs).value, "measured", reason=reason)
        except Unresolved as error:
            unresolved = error
            judgement = Judgement(np.nan, "measured", cause="unresolved", reason="; ".join(filter(None, [reason, str(error)])))
        yield metric, with_horizon(judgement, scene, metric, truth, unresolved)


def _paired(truth: Truth | None, one: Comparison, other: Comparison) -> Comparison:
    """Two engines' motions as far as they can be compared: to the truth's horizon, else to the first contact of either."""
    if truth is not None:
        return Comparison.between(one, other, int(np.sum(truth.covers(one.motion.t))))
    contacts = [case.first_contact for case in (one, other)]
    until = max(2, min([len(one.motion), *(contact[0] + 1 for contact in contacts if contact is not None)]))
    return Comparison(one.scene, one.motion[:until], other.motion[:until])


def _as_truth(motion: Trajectory) -> Truth:
    """An engine's motion in the place of a truth, to ask which metrics have something to compare."""
    return Truth("engine", "", lambda t: motion.states[: len(t)])
