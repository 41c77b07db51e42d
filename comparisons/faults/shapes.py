"""Faults of shapes: a body that is built as another one, of other lengths, along another axis or about another point.

They show at an impact. The inertia may be the scene's, or that of the shape that is built instead.
"""

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import TypeAdapter

from dropspin.comparisons.faults.fault_model import FaultModel, Reported, changed_part, changed_start
from dropspin.scenarios import DropspinError, Scenario
from dropspin.scenarios.bodies import Body, Box, Capsule, Cylinder, Ellipsoid, Mesh, OnAxis, Shape
from dropspin.scenarios.bodies.inertia import in_numbers
from dropspin.scenarios.rotations import about, conjugate, multiply
from dropspin.scenarios.state import ORIENTATION, Array
from dropspin.scenarios.variations import with_values

BODY: TypeAdapter[Any] = TypeAdapter(Body)
Instead = Callable[[Any], Mapping[str, Any]]
"""From a body to the keys of the one that is built instead."""


def _built_as(kind: type[Shape], instead: Instead, inertia: str, scene: Scenario) -> Scenario:
    """The scene with a body of a kind built otherwise; with its own inertia, or with a distribution of the mass of what is built."""
    body = scene.body
    if not isinstance(body, kind):
        return scene
    content = {"mass": body.mass, "inertia": inertia or body.inertia_tensor.tolist(), "center_of_mass": body.centre.tolist()}
    return scene.model_copy(update={"body": BODY.validate_python(content | dict(instead(body)))})


def _lengths(half_length: Callable[[float, float], float], shape: str = "") -> Instead:
    """The same or another shape along an axis, with a half length that is a function of the body's own and of its radius [m]."""
    return lambda body: {"shape": shape or body.shape, "radius": body.radius, "half_length": half_length(body.half_length, body.radius)}


def _about_origin(body: Mesh) -> Mapping[str, Any]:
    return {"shape": "mesh", "points": body.points, "faces": body.faces, "center_of_mass": [0.0, 0.0, 0.0]}


def _about(share: float) -> Instead:
    """A box whose centre of mass is displaced by another share of the distance from its centre."""

    def instead(body: Box) -> Mapping[str, Any]:
        if not body.centre.any():
            raise DropspinError("the centre of mass of a box is at its centre")
        return {"shape": "box", "half_extents": body.half_extents, "center_of_mass": (share * body.centre).tolist()}

    return instead


WRONG: dict[type[Any], dict[str, Instead]] = {
    Box: {
        "the shape appears to be built about the centre of mass; it is about -centre": _about(0.0),
        "the shape appears to be built about +centre; it is about -centre": _about(-1.0),
    },
    Cylinder: {
        "a cylinder appears to be built as a box": lambda body: {
            "shape": "box",
            "half_extents": [body.radius, body.half_length, body.radius],
        }
    },
    Capsule: {
        "a capsule appears to be built as a cylinder, without the half balls at its ends": _lengths(lambda half, _: half, "cylinder"),
        "a capsule appears to be too short by its half balls; half_length is without them": _lengths(lambda half, ball: abs(half - ball)),
    },
    OnAxis: {
        "the body appears to be half as long as it should be: is half_length read as a length?": _lengths(lambda half, _: 0.5 * half),
        "the body appears to be twice as long as it should be: is a length read as half_length?": _lengths(lambda half, _: 2.0 * half),
    },
    Ellipsoid: {"an ellipsoid appears to be built as a box": lambda body: {"shape": "box", "half_extents": body.half_extents}},
    Mesh: {"a mesh appears to be about the origin of its file; a state has the centre of mass": _about_origin},
}
"""By the kind of body: the message of each fault, and what is built instead."""


def _turned(turn: Array) -> Reported:
    return changed_part(ORIENTATION, lambda orientation, _: multiply(orientation, turn))


def _along(number: int) -> Iterator[FaultModel]:
    """A body whose axis is x or z, with its own moments along y, or with those of a body along that axis."""
    turn = about(np.eye(3)[2 - number], np.array(0.5 * np.pi * (number - 1)))  # to a frame in which the axis is y again
    order = np.arange(3)
    order[[1, number]] = [number, 1]

    def simulated(scene: Scenario, order: NDArray[np.intp]) -> Scenario:
        if not isinstance(scene.body, OnAxis):
            raise DropspinError(f"a {scene.body.shape} has no axis of its own")
        inertia = in_numbers(scene.body.inertia_tensor[np.ix_(order, order)])
        return changed_start(_turned(turn))(with_values(scene, "body", inertia=inertia))

    message = f"the axis of a capsule or a cylinder appears to be {'xyz'[number]}; it is y"
    for moments in (order, np.arange(3)):
        yield FaultModel(message, partial(simulated, order=moments), _turned(conjugate(turn)))


def _otherwise() -> Iterator[FaultModel]:
    for kind, faults in WRONG.items():
        for (message, instead), inertia in product(faults.items(), ("", "solid")):
            yield FaultModel(message, partial(_built_as, kind, instead, inertia), about="shape")


SHAPE_FAULTS = (*_otherwise(), *_along(2), *_along(0))
"""All of them; where two give the same motion the earlier is preferred."""
