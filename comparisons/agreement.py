"""Engines held against each other: how far two are apart, and whether that they agree says anything."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from comparisons.comparison import Comparison, Unresolved
from comparisons.ensembles import difference_rows
from comparisons.metrics import METRICS
from comparisons.phases import Phase
from comparisons.simulating import Attempt
from scenarios import Trajectory, Truth

Row = dict[str, Any]

NO_EVIDENCE = "no evidence"
"""How the reason of a pair begins that agrees because both make the same errors."""


def agreement_rows(written: Phase, dt: float, first: Attempt, second: Attempt, phases: Sequence[Phase]) -> list[Row]:
    """How far two engines are apart, by the metrics that mean something between engines."""
    if first.verdict or second.verdict or any(m.first_bad_row is not None for m in first.phases + second.phases):
        return []
    scene, truth = written
    cases = [_side_by_side(phase, one, other) for phase, one, other in zip(phases, first.cases, second.cases, strict=True)]
    shared: Row = {"scene": scene.name, "engine": first.label, "dt": dt, "kind": "agreement", "truth": second.label}
    shared["steps"] = scene.steps(dt)
    if first.discretisation is not None and first.discretisation == second.discretisation:
        shared["reason"] = f"{NO_EVIDENCE}: both are {first.discretisation}"
    rows: list[Row] = []
    for metric in METRICS.values():
        if not (metric.agreement and metric.applies(scene, truth or _as_truth(second.phases[0]))):
            continue
        try:
            found: Row = {"value": metric.average(cases).value}
        except Unresolved as error:
            found = {"cause": "unresolved", "reason": "; ".join(filter(None, [shared.get("reason"), str(error)]))}
        rows.append(shared | {"metric": metric.name, "unit": metric.unit, "verdict": "measured"} | found)
    if first.outcome is not None and second.outcome is not None:
        rows += difference_rows(scene, dt, (first.label, second.label), (first.outcome, second.outcome))
    return rows


def _side_by_side(phase: Phase, one: Comparison, other: Comparison) -> Comparison:
    """Two engines' motions as far as they can be compared: to the truth's horizon, else to the first contact of either."""
    if phase.truth is not None:
        return Comparison.between(one, other, int(np.sum(phase.truth.covers(one.motion.t))))
    contacts = [case.first_contact for case in (one, other)]
    until = max(2, min([len(one.motion), *(contact[0] + 1 for contact in contacts if contact is not None)]))
    return Comparison(phase.scene, one.motion[:until], other.motion[:until])


def _as_truth(motion: Trajectory) -> Truth:
    """An engine's motion in the place of a truth, to ask which metrics have something to compare."""
    return Truth("engine", "", lambda t: motion.states[: len(t)])
