"""The inertia of a body: whether its shape can have it, and that of a solid of uniform density."""

from dataclasses import replace

import numpy as np

from dropspin.comparisons.diagnosis.loose_body import Facts
from dropspin.comparisons.diagnosis.questions import Answer, Finding, Remedy
from dropspin.scenarios.state import Array

ROUNDING = 1.001  # moments are often given with three or four digits


def inertia(facts: Facts) -> list[Answer]:
    """The moments in force beside those of a solid; what is impossible in those of the file, or of the engine if the file has none."""
    given = facts.inertia if facts.written is None else facts.written
    moments = np.linalg.eigvalsh(given)
    answers = []
    if moments[0] + moments[1] < moments[2] / ROUNDING or moments[0] <= 0.0:
        ratio = float(moments[2] / (moments[0] + moments[1]))
        answers.append(Answer("inertia", "largest moment / sum of others", "1", ratio, physical=1.0, finding="impossible"))
    possible, solid = largest_possible(facts, given), facts.solid
    if possible is not None:
        factor = float(moments[2] / possible)
        finding: Finding = "impossible" if factor > ROUNDING else ""
        answers.append(Answer("inertia", "largest moment / possible", "1", factor, physical=1.0, finding=finding))
    if solid is not None and any(answer.finding for answer in answers):
        text = f"the inertia of a solid, {', '.join(f'{value:.3g}' for value in np.linalg.eigvalsh(solid))} kg m²"
        answers = [replace(answer, remedies=(Remedy(text),), settings=("inertia",)) for answer in answers]
    for number, axis in enumerate(facts.principal[1].T):
        of_solid = np.nan if solid is None else float(axis @ solid @ axis)
        answers.append(Answer("inertia", f"moment {number + 1}", "kg m²", facts.principal[0][number], physical=of_solid))
    return answers


def largest_possible(facts: Facts, tensor: Array) -> float | None:
    """The largest moment of inertia about a principal axis of a tensor if no mass is outside of the body [kg m²]; None without a shape."""
    if not facts.parts:
        return None
    axes = np.linalg.eigh(tensor)[1].T
    squares = np.sum(facts.points**2, axis=1)
    return facts.mass * max(float(np.max(squares - (facts.points @ axis) ** 2)) for axis in axes)
