"""The inertia of a body: whether its shape can have it, and that of a solid of uniform density."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from dropspin.comparisons.diagnosis.loose_body import Facts
from dropspin.comparisons.diagnosis.questions import Answer, Remedy
from dropspin.scenarios.bodies.possible_moments import largest_multiple
from dropspin.scenarios.state import Array

ROUNDING = 1.001  # moments are often given with three or four digits


def inertia(facts: Facts) -> list[Answer]:
    """The moments in force beside those of a solid; what is impossible in those of the file, or of the engine if the file has none."""
    solid, answers = facts.solid, list(_impossible(facts, facts.inertia if facts.written is None else facts.written))
    if solid is not None:
        text = f"the inertia of a solid, {', '.join(f'{value:.3g}' for value in np.linalg.eigvalsh(solid))} kg m²"
        answers = [replace(answer, remedies=(Remedy(text),)) for answer in answers]
    for number, axis in enumerate(facts.principal[1].T):
        of_solid = np.nan if solid is None else float(axis @ solid @ axis)
        answers.append(Answer("inertia", f"moment {number + 1}", "kg m²", facts.principal[0][number], physical=of_solid))
    return answers


def _impossible(facts: Facts, given: Array) -> Iterator[Answer]:
    """Why no body has an inertia [kg m²], shape (3, 3), or no body of this shape and mass."""
    least, middle, largest = np.linalg.eigvalsh(given).tolist()
    common: dict[str, Any] = {"unit": "1", "physical": 1.0, "finding": "impossible", "settings": ("inertia",)}
    if least <= 0.0 or largest > ROUNDING * (least + middle):
        yield Answer("inertia", "largest moment / sum of others", measured=largest / (least + middle), **common)
    elif facts.parts:
        squares = (0.5 * np.trace(given) * np.eye(3) - given) / facts.mass
        excess = 1.0 / largest_multiple(facts.points, squares, 1.0 / ROUNDING)
        if excess > ROUNDING:
            yield Answer("inertia", "largest moment / possible", measured=max(1.0, largest / largest_possible(facts, given)), **common)


def largest_possible(facts: Facts, tensor: Array) -> float:
    """The largest moment of inertia about a principal axis of a tensor if no mass is outside of the body [kg m²]."""
    axes = np.linalg.eigh(tensor)[1].T
    squares = np.sum(facts.points**2, axis=1)
    return facts.mass * max(float(np.max(squares - (facts.points @ axis) ** 2)) for axis in axes)
