"""The inertia of a body: whether its shape can have it, and that of a solid of uniform density."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from dropspin.comparisons.diagnosis.answers import NOTEWORTHY, Answer, Finding, Remedy, digits, vector_text
from dropspin.comparisons.diagnosis.loose_body import ROUNDING, LooseBody, MassProperties
from dropspin.scenarios.bodies.inertia import mean_squares
from dropspin.scenarios.bodies.possible_moments import largest_multiple
from dropspin.scenarios.bodies.shape import INERTIA_ROUNDING
from dropspin.scenarios.state import Array

MOMENT = "principal moment"
SMALL = 1e-3
"""Share of the largest moment below which products of inertia are left out."""


def inertia(body: LooseBody) -> list[Answer]:
    """The moments in force beside those of a solid; what is impossible in those of the file, or of the engine if the file has none."""
    solid, given = body.solid, body.written or MassProperties(body.mass, body.offset, body.inertia)
    # Of the mass that the file has: what the engine changes, it changes also with the remedy.
    of_file = solid if solid is None or not given.mass else solid._replace(mass=given.mass, inertia=given.mass / body.mass * solid.inertia)
    answers = list(_impossible(body, given, of_file))
    for number, axis in enumerate(body.principal[1].T):
        of_solid = math.nan if solid is None else float(axis @ solid.inertia @ axis)
        moment = float(body.principal[0][number])
        answers.append(Answer("inertia", MOMENT, "kg m²", vector_text(axis), measured=moment, physical=of_solid))
    return answers


def armature(body: LooseBody, dts: Sequence[float]) -> list[Answer]:
    """What a joint's armature makes of the least moment, with which a torque turns the body, at any time step [s]."""
    if not body.in_file("armature"):
        return []
    # It acts at the origin of the body's frame, on its velocity too, which a torque about the centre of mass changes.
    c, share = body.offset, body.mass / (body.mass + body.armature)
    with_it = body.inertia + body.armature * (np.eye(3) + share * (c @ c * np.eye(3) - np.outer(c, c)))
    factor = float(np.linalg.eigvalsh(with_it)[0] / np.linalg.eigvalsh(body.inertia)[0])
    answer = Answer("inertia", "least moment with armature / without", "1", measured=factor, in_force=factor, physical=1.0)
    return [replace(answer, findings=(Finding("setting", ("armature",)),) * (factor > 1.0 + NOTEWORTHY))]


def _impossible(body: LooseBody, given: MassProperties, solid: MassProperties | None) -> Iterator[Answer]:
    """Why no body has an inertia, or no body of this shape, mass and centre of mass."""
    points = body.points + body.offset - given.centre if body.parts else np.zeros((0, 3))
    off = np.zeros(3) if solid is None else solid.centre - given.centre
    displaced = f"displaced by ({digits(np.where(np.abs(off) > ROUNDING * np.abs(off).max(), off, 0.0))}) m along the body's axes"
    least, middle, largest = np.linalg.eigvalsh(given.inertia).tolist()
    quantity, possible = "largest moment / sum of others", "at most 1 for any body"
    if least <= 0.0:
        excess, quantity, possible = least / largest if largest else 0.0, "least moment / largest", "more than 0 for any body"
    elif largest > INERTIA_ROUNDING * (least + middle):
        excess = largest / (least + middle)
    else:
        if not (body.parts and body.is_bounded):
            return
        squares = mean_squares(given.inertia, given.mass)
        excess = _excess(points, squares)
        if excess <= INERTIA_ROUNDING:
            return
        if off.any() and _excess(points - off, squares) <= INERTIA_ROUNDING:
            remedy = Remedy(f"the centre of mass of a uniform solid, which is {displaced}")
            finding = Finding("impossible", ("centre",), (remedy,), "less for these moments, this mass and shape")
            yield Answer(
                "inertia", "distance of the centre of mass from a solid's", "m", measured=float(np.linalg.norm(off)), findings=(finding,)
            )
            return
        quantity, possible = "second moments / largest possible", "at most 1 for this mass and shape"
        unturned, turn = body.in_own_frame, body.in_file("turn")
        is_turned = bool(turn) and unturned is not None and not np.allclose(unturned, given.inertia, atol=SMALL * largest)
        if is_turned and unturned is not None and _excess(points, mean_squares(unturned, given.mass)) <= INERTIA_ROUNDING:
            remedy = Remedy(f"a frame that is not turned: the file's moments are then {_components(unturned)}")
            yield Answer(
                "inertia", quantity, "1", measured=excess, physical=1.0, findings=(Finding("impossible", turn, (remedy,), possible),)
            )
            return
        if (factor := largest / largest_possible(given, points)) > INERTIA_ROUNDING:
            quantity, excess = "largest moment / largest possible", factor
    remedies: tuple[Remedy, ...] = ()
    if solid is not None:
        also = f", and its centre of mass, {displaced}" * (_excess(points, mean_squares(solid.inertia, solid.mass)) > INERTIA_ROUNDING)
        remedies = (Remedy(f"the inertia of a uniform solid, {_components(solid.inertia)}{also}"),)
    finding = Finding("impossible", ("inertia",), remedies, possible)
    yield Answer("inertia", quantity, "1", measured=excess, physical=float(least > 0.0), findings=(finding,))


def _excess(points: Array, squares: Array) -> float:
    """The factor by which second moments [m²], shape (3, 3), exceed what is possible inside the hull of points; infinite if none are."""
    multiple = largest_multiple(points, squares, 1.0 / INERTIA_ROUNDING)
    return 1.0 / multiple if multiple > 0.0 else math.inf


def _components(tensor: Array) -> str:
    """A tensor [kg m²], shape (3, 3), about the body's axes; without its products where they are small."""
    found = f"ixx, iyy, izz = {digits(np.diag(tensor))}"
    products = tensor[[0, 0, 1], [1, 2, 2]]
    if np.abs(products).max() > SMALL * tensor.max():
        found += f", ixy, ixz, iyz = {digits(products)}"
    return f"{found} kg m² about the body's axes"


def largest_possible(given: MassProperties, points: Array) -> float:
    """The largest moment of inertia about a principal axis of a tensor if no mass is outside of the hull of points [kg m²]."""
    axes = np.linalg.eigh(given.inertia)[1].T
    squares = np.sum(points**2, axis=1)
    return given.mass * max(float(np.max(squares - (points @ axis) ** 2)) for axis in axes)
