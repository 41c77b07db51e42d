"""The geometry of a box that stands on one of its edges, common to tipping, rocking and slipping."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenarios.body import Box
from scenarios.model import TOUCHING, Scenario
from scenarios.rotations import rotate
from scenarios.state import ORIENTATION, POSITION, SPIN, UP

Array = NDArray[np.float64]

MIN_LEVEL = 1e-15
"""Smallest sin²(ψ/2) at rest; below it, rounding determines when the box falls, and to which side."""


@dataclass(frozen=True, eq=False)
class Stand:
    """A box on one edge.

    Attributes:
        pivot: Centre of the edge [m], shape (3,).
        outward: Horizontal direction from the pivot to the centre of mass, in which the box falls.
        angle: ψ at the start, between 0 and α [rad].
        speed: ψ' at the start [rad/s].
        half_width: Half width of the face on which it lands, across the edge [m].
        half_height: Half height of the box above that face [m].
        share: k, moment of inertia about the edge's direction over M R².
        gravity: Magnitude of gravity [m/s²].
    """

    pivot: Array
    outward: Array
    angle: float
    speed: float
    half_width: float
    half_height: float
    share: float
    gravity: float

    @property
    def falling(self) -> Array:
        """The horizontal axis about which the box falls, shape (3,)."""
        return np.cross(UP, self.outward)

    @property
    def to_centre(self) -> Array:
        """The initial vector from the pivot to the centre of mass [m], shape (3,)."""
        return self.radius * (math.sin(self.angle) * self.outward + math.cos(self.angle) * UP)

    @property
    def radius(self) -> float:
        """R [m]."""
        return math.hypot(self.half_width, self.half_height)

    @property
    def flat(self) -> float:
        """α, the angle ψ at which the box lies flat [rad]."""
        return math.atan2(self.half_width, self.half_height)


def on_one_edge(scene: Scenario) -> Stand | None:
    """The stand of a scene's box. None if gravity is not vertical, one edge does not carry the box, or its spin is not along the edge."""
    body, start, g = scene.body, scene.initial_state, scene.acceleration
    if not (g[1] < 0.0 and g[0] == 0.0 and g[2] == 0.0):
        return None
    if not isinstance(body, Box) or abs(scene.clearance) > TOUCHING * body.size:
        return None
    axes = rotate(start[ORIENTATION], np.eye(3))  # rows: the body's axes in the world
    corners = rotate(start[ORIENTATION], body.vertices)
    lowest = corners[corners[:, 1] <= corners[:, 1].min() + TOUCHING * body.size]
    if len(lowest) != 2:
        return None
    to_centre = -lowest.mean(axis=0)
    horizontal = np.array([to_centre[0], 0.0, to_centre[2]])
    if not horizontal.any():
        return None
    outward = horizontal / np.linalg.norm(horizontal)
    falling, spin = np.cross(UP, outward), start[SPIN]
    speed = float(spin @ falling)
    if np.abs(spin - speed * falling).max() > TOUCHING * abs(speed):
        return None
    edge = int(np.argmax(np.abs(axes @ falling)))
    one, other = (axis for axis in range(3) if axis != edge)
    # Of the two directions from the edge into the box, the one that leans back is vertical when the box lies flat.
    leans_back = (axes[one] @ to_centre) * (axes[one] @ outward) < 0.0
    height, width = (one, other) if leans_back else (other, one)
    half_width, half_height = body.half_extents[width], body.half_extents[height]
    return Stand(
        pivot=start[POSITION] - to_centre,
        outward=outward,
        angle=math.atan2(float(np.linalg.norm(horizontal)), to_centre[1]),
        speed=speed,
        half_width=half_width,
        half_height=half_height,
        share=float(body.inertia_tensor[edge, edge]) / (body.mass * (half_width**2 + half_height**2)),
        gravity=-float(g[1]),
    )
