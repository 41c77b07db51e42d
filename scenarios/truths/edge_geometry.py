"""The geometry of a body that stands on one of its edges, common to tipping, rocking, rolling over edges and slipping.

The body moves in the plane across the edge. Its cross-section is a convex polygon; its corners are numbered in the order in which they
strike the floor as the body turns forward, from 0 for the edge on which it stands, and in each turn again: corner n is corner 0.
"""

import math
from dataclasses import dataclass

import numpy as np

from dropspin.scenarios.bodies.hull import convex_hull
from dropspin.scenarios.model import TOUCHING, Scenario
from dropspin.scenarios.rotations import rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, UP, Array

MIN_LEVEL = 1e-15
"""Smallest sin²(ψ/2) at rest; below it, rounding determines when the body falls, and to which side."""
ALIGNED = 1e-12
"""Largest part of a vector off the direction of the edge, or out of the plane across it, that is attributed to rounding."""
SHARP = 1e-9
"""Smallest angle by which two neighbouring faces differ [rad]."""


@dataclass(frozen=True, eq=False)
class Stand:
    """A body on one edge.

    Attributes:
        pivot: The point of the edge that is nearest to the centre of mass [m], shape (3,).
        outward: The direction forward, horizontal; the centre of mass is ahead of the pivot or above it.
        angle: Angle at the pivot between the floor's normal and the centre of mass, at the start [rad].
        speed: Angular velocity at the start, positive forward [rad/s].
        radii: R, the distance of each corner from the centre of mass [m], shape (n,).
        ahead: The angle at each corner when the face ahead of it lies on the floor [rad], shape (n,).
        behind: The angle when the face behind it does [rad], shape (n,).
        turns: The angle by which the body has then turned since the start, face ahead, ascending [rad], shape (n,).
        ways: Distance from corner 0 to each corner along the unrolled cross-section, and once around it [m], shape (n + 1,).
        shares: k, the moment of inertia about the direction of the edge over M R², for each corner, shape (n,).
        gravity: Magnitude of gravity [m/s²].
        slope: Angle from the floor's normal to the direction against gravity [rad]; positive if forward is downhill.
    """

    pivot: Array
    outward: Array
    angle: float
    speed: float
    radii: Array
    ahead: Array
    behind: Array
    turns: Array
    ways: Array
    shares: Array
    gravity: float
    slope: float

    @property
    def falling(self) -> Array:
        """The horizontal axis about which the body falls forward, shape (3,)."""
        return np.cross(UP, self.outward)

    @property
    def to_centre(self) -> Array:
        """The initial vector from the pivot to the centre of mass [m], shape (3,)."""
        return self.radius * (math.sin(self.angle) * self.outward + math.cos(self.angle) * UP)

    @property
    def radius(self) -> float:
        """R of the edge on which it stands [m]."""
        return float(self.radii[0])


def on_one_edge(scene: Scenario) -> Stand | None:
    """The stand of a scene's body; None if one edge does not carry it, or if it would leave the plane across this edge.

    It stays in that plane if gravity and spin are in it and along its normal, respectively, the normal is a principal axis, and the centre
    of mass is between the two ends of every edge.
    """
    body, start, g = scene.body, scene.initial_state, scene.acceleration
    if g[1] >= 0.0 or any(body.semi_axes) or not scene.starts_on_floor:
        return None
    offsets = rotate(start[ORIENTATION], body.hull)
    lowest = offsets[offsets[:, 1] <= offsets[:, 1].min() + TOUCHING * body.size] * (1.0 - UP)
    spans = lowest - lowest[0]
    edge = spans[np.argmax(np.linalg.norm(spans, axis=1))]
    if not edge.any():
        return None
    edge = edge / np.linalg.norm(edge)
    spin, inertia = start[SPIN], rotate(start[ORIENTATION], body.inertia_tensor @ unrotate(start[ORIENTATION], edge))
    moment, speed = float(inertia @ edge), float(spin @ edge)
    in_plane = (
        np.linalg.norm(np.cross(spans, edge), axis=1).max() <= TOUCHING * body.size
        and abs(g @ edge) <= ALIGNED * np.linalg.norm(g)
        and np.linalg.norm(spin - speed * edge) <= ALIGNED * abs(speed)
        and np.linalg.norm(inertia - moment * edge) <= ALIGNED * moment
    )
    if not in_plane:
        return None
    outward = np.cross(edge, UP)
    if offsets[np.argmin(offsets[:, 1])] @ outward > 0.0:
        edge, outward, speed = -edge, -outward, -speed
    corners = _corners(offsets @ np.array([outward, UP, edge]).T, TOUCHING * body.size)
    if corners is None:
        return None
    return _stand(scene, outward, speed, moment, corners)


def _corners(offsets: Array, tolerance: float) -> Array | None:
    """The corners of the cross-section, counterclockwise from the lowest, shape (n, 2); None if some edge is not on both sides.

    Args:
        offsets: The vertices relative to the centre of mass: forward, up and along the edge [m], shape (m, 3).
        tolerance: Distance of two points that count as one [m].
    """
    from scipy.spatial import cKDTree

    section = offsets[:, :2]
    hull = convex_hull(section)
    if hull is None:  # a flat body
        return None
    corners = section[hull.vertices]
    corners = np.roll(corners, -int(np.argmin(corners[:, 1])), axis=0)
    distances, nearest = cKDTree(corners).query(section)
    at_corner = distances <= tolerance
    first, last = np.full(len(corners), np.inf), np.full(len(corners), -np.inf)
    np.minimum.at(first, nearest[at_corner], offsets[at_corner, 2])
    np.maximum.at(last, nearest[at_corner], offsets[at_corner, 2])
    return corners if first.max() < -tolerance and last.min() > tolerance else None


def _stand(scene: Scenario, outward: Array, speed: float, moment: float, corners: Array) -> Stand | None:
    """The stand on the first of the corners of a cross-section, shape (n, 2); None if two faces are parallel."""
    faces = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(faces, axis=1)
    along = faces / lengths[:, None]
    before = np.roll(along, 1, axis=0)
    exterior = np.arctan2(before[:, 0] * along[:, 1] - before[:, 1] * along[:, 0], np.sum(before * along, axis=1))
    if exterior.min() < SHARP:
        return None
    feet = -np.sum(corners * along, axis=1)  # of the centre of mass on each face, from the corner behind it
    heights = along[:, 1] * corners[:, 0] - along[:, 0] * corners[:, 1]
    radii, g = np.linalg.norm(corners, axis=1), scene.acceleration
    return Stand(
        pivot=scene.initial_state[POSITION] + corners[0, 0] * outward + corners[0, 1] * UP,
        outward=outward,
        angle=math.atan2(-corners[0, 0], -corners[0, 1]),
        speed=speed,
        radii=radii,
        ahead=np.arctan2(feet, heights),
        behind=np.roll(np.arctan2(feet - lengths, heights), 1),
        turns=math.atan2(along[0, 1], along[0, 0]) + np.append(0.0, np.cumsum(exterior[1:])),
        ways=np.append(0.0, np.cumsum(lengths)),
        shares=moment / (scene.body.mass * radii**2),
        gravity=float(np.linalg.norm(g)),
        slope=math.atan2(g @ outward, -g[1]),
    )
