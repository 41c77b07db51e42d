"""The inertia of a body: whether its shape can have it, and that of a solid of uniform density."""

import math
from collections.abc import Iterator

import numpy as np

from dropspin.comparisons.diagnosis.answers import Answer, Finding, Remedy, digits, vector_text
from dropspin.comparisons.diagnosis.loose_body import Facts
from dropspin.scenarios.bodies.possible_moments import largest_multiple
from dropspin.scenarios.state import Array

MOMENT = "principal moment"
ROUNDING = 1.001  # moments are often given with three or four digits
SMALL = 1e-3
"""Share of the largest moment below which products of inertia are left out."""


def inertia(facts: Facts) -> list[Answer]:
    """The moments in force beside those of a solid; what is impossible in those of the file, or of the engine if the file has none."""
    solid = facts.solid
    remedies = () if solid is None else (Remedy(f"the inertia of a uniform solid, {_components(solid)}"),)
    answers = list(_impossible(facts, facts.inertia if facts.written is None else facts.written, remedies))
    for number, axis in enumerate(facts.principal[1].T):
        of_solid = math.nan if solid is None else float(axis @ solid @ axis)
        moment = float(facts.principal[0][number])
        answers.append(Answer("inertia", MOMENT, "kg m²", vector_text(axis), measured=moment, physical=of_solid))
    return answers


def _impossible(facts: Facts, given: Array, remedies: tuple[Remedy, ...]) -> Iterator[Answer]:
    """Why no body has an inertia [kg m²], shape (3, 3), or no body of this shape and mass."""
    least, middle, largest = np.linalg.eigvalsh(given).tolist()
    excess, quantity, possible = largest / (least + middle), "largest moment / sum of others", "at most 1 for any body"
    if least <= 0.0:
        excess, quantity, possible = least / largest, "least moment / largest", "more than 0 for any body"
    elif largest <= ROUNDING * (least + middle):
        if not facts.parts:
            return
        squares = (0.5 * np.trace(given) * np.eye(3) - given) / facts.mass
        excess = 1.0 / largest_multiple(facts.points, squares, 1.0 / ROUNDING)
        if excess <= ROUNDING:
            return
        excess = factor if (factor := largest / largest_possible(facts, given)) > ROUNDING else excess
        quantity, possible = "largest moment / largest possible", "at most 1 for this mass and shape"
    finding = Finding("impossible", ("inertia",), remedies, possible)
    yield Answer("inertia", quantity, "1", measured=excess, physical=float(least > 0.0), findings=(finding,))


def _components(tensor: Array) -> str:
    """A tensor [kg m²], shape (3, 3), about the body's axes; without its products where they are small."""
    found = f"ixx, iyy, izz = {digits(np.diag(tensor))}"
    products = tensor[[0, 0, 1], [1, 2, 2]]
    if np.abs(products).max() > SMALL * tensor.max():
        found += f", ixy, ixz, iyz = {digits(products)}"
    return f"{found} kg m²"


def largest_possible(facts: Facts, tensor: Array) -> float:
    """The largest moment of inertia about a principal axis of a tensor if no mass is outside of the body [kg m²]."""
    axes = np.linalg.eigh(tensor)[1].T
    squares = np.sum(facts.points**2, axis=1)
    return facts.mass * max(float(np.max(squares - (facts.points @ axis) ** 2)) for axis in axes)
