"""The geometries of a body: solid shapes, their lowest points and volumes."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from dropspin.scenarios.bodies import Shape, body_of
from dropspin.scenarios.bodies.hull import hull_corners
from dropspin.scenarios.bodies.mesh import is_closed
from dropspin.scenarios.bodies.mesh_files import Faces
from dropspin.scenarios.rotations import cross, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, UP, VELOCITY, Array

PART = 0.01
"""Share of a mesh's size from which vertices beyond its triangles are no rounding."""
AXES = np.eye(3)
TURNS = np.arange(150) * math.pi * (3.0 - math.sqrt(5.0))
HEIGHTS = 1.0 - 2.0 * (np.arange(150) + 0.5) / 150
AROUND = np.sqrt(1.0 - HEIGHTS**2)
DIRECTIONS = np.concatenate([np.stack([AROUND * np.cos(TURNS), HEIGHTS, AROUND * np.sin(TURNS)], axis=1), AXES, -AXES])
"""Directions that are spread evenly, and those of the axes, shape (156, 3)."""
VOLUMES: dict[str, Callable[[Any], float]] = {
    "sphere": lambda ball: 4.0 / 3.0 * math.pi * ball.radius**3,
    "cylinder": lambda rod: 2.0 * math.pi * rod.radius**2 * rod.half_length,
    "capsule": lambda rod: 2.0 * math.pi * rod.radius**2 * rod.half_length + 4.0 / 3.0 * math.pi * rod.radius**3,
    "box": lambda box: 8.0 * math.prod(box.half_extents),
    "ellipsoid": lambda ball: 4.0 / 3.0 * math.pi * math.prod(ball.half_extents),
    "mesh": lambda mesh: abs(mesh.content) if mesh.inertia == "solid" else math.nan,
}
"""The volume of a shape [m³], by its kind; NaN of a mesh that is not closed."""


class Part(NamedTuple):
    """A geometry of the body: a solid shape of 1 kg, where its centre is relative to the centre of mass [m], and how it is turned.

    One that does not collide bounds the body's inertia, and nothing else.
    """

    name: str
    shape: Shape
    position: Array
    turn: Array
    collides: bool = True


class Support:
    """The lowest points of geometries together: of the corners of all that have flat faces, and of the ellipsoids about other corners."""

    def __init__(self, parts: Sequence[Part]) -> None:
        corners = [part.position + rotate(part.turn, part.shape.hull) for part in parts]
        stretches = [part.shape.semi_axes[:, np.newaxis] * rotate(part.turn, AXES) for part in parts]
        points, stretched = np.concatenate(corners), np.repeat(stretches, list(map(len, corners)), axis=0)
        is_round = stretched.any(axis=(1, 2))
        flat = points[~is_round]
        self._flat = flat[hull_corners(flat)] if len(flat) else flat
        self._centres, self._stretches = points[is_round], stretched[is_round]

    def lowest(self, states: Array) -> Array:
        """Heights of the lowest point at states, shape (n,) [m]."""
        up = unrotate(states[:, ORIENTATION], np.broadcast_to(UP, (len(states), 3)))
        depths = np.linalg.norm(np.einsum("kij,nj->nki", self._stretches, up), axis=-1)
        heights = np.concatenate([up @ self._flat.T, up @ self._centres.T - depths], axis=1)
        found: Array = states[:, POSITION][:, 1] + heights.min(axis=1)
        return found


def lowest_of(parts: Sequence[Part], turn: Array) -> float:
    """The height of the lowest point of geometries above the centre of mass at an orientation, shape (4,) [m]."""
    return float(Support(parts).lowest(np.concatenate([np.zeros(3), turn, np.zeros(6)])[np.newaxis])[0])


def at_point(states: Array, arm: Array) -> Array:
    """States of another point of a body, at an arm from the point of the given ones, in the body frame [m], shapes (..., 13) and (3,)."""
    found, arms = states.copy(), rotate(states[..., ORIENTATION], arm)
    found[..., POSITION] += arms
    found[..., VELOCITY] += cross(states[..., SPIN], arms)
    return found


def solid(shape: str, **sizes: Any) -> Shape:
    """A solid of 1 kg."""
    return body_of({"shape": shape, "mass": 1.0, "inertia": "solid", **sizes})


def mesh_shape(points: Array, faces: Faces) -> Shape:
    """A mesh as a solid, or as a surface if it is not closed or has vertices beyond its triangles."""
    is_solid = is_closed(points, faces) and is_whole(points, faces)
    return solid("mesh", points=points, faces=faces, inertia="solid" if is_solid else "surface")


def is_whole(points: Array, faces: Faces) -> bool:
    """Whether the triangles of a mesh reach as far as its vertices; MuJoCo has those of the first object of an OBJ file alone."""
    size = np.ptp(points, axis=0)
    return bool(np.allclose(np.ptp(points[np.unique(faces)], axis=0), size, rtol=0.0, atol=PART * size.max()))
