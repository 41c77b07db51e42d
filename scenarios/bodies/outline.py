"""The surface of a body, as the replay and the pictures draw it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dropspin.scenarios.bodies.hull import MERIDIANS, convex_hull, hull_corners
from dropspin.scenarios.state import UP, Array

IN_ONE_PLANE = 1e-9
"""Largest allowed distance of the points of a face from its plane, relative to the size of the body."""


@dataclass(frozen=True, eq=False)
class Outline:
    """The surface of a body, in its own frame.

    Attributes:
        vertices: Positions relative to the centre of mass [m], shape (n, 3); a sphere has one vertex, at its centre.
        faces: For each face, the indices of its vertices, counterclockwise as seen from outside; a sphere has no faces.
        radius: Distance of the surface from the vertices [m].
        is_flat: Whether the body is a plane polygon, visible from both sides.
    """

    vertices: Array
    faces: Sequence[Sequence[int]]
    radius: float = 0.0
    is_flat: bool = False

    def polygons(self, meridians: int) -> list[Array]:
        """The faces as polygons [m], each of shape (m, 3); of a sphere, every other field of a grid of this many meridians."""
        if not self.radius:
            return [self.vertices[list(face)] for face in self.faces]
        around, down = np.linspace(0.0, 2.0 * np.pi, meridians + 1), np.linspace(0.0, np.pi, meridians // 2 + 1)
        grid = self.radius * np.stack(
            [np.outer(np.sin(down), np.cos(around)), np.outer(np.cos(down), np.ones_like(around)), np.outer(np.sin(down), np.sin(around))],
            axis=-1,
        )
        return [grid[[i, i + 1, i + 1, i], [j, j, j + 1, j + 1]] for i in range(0, len(down) - 1, 2) for j in range(0, len(around) - 1, 4)]


def outline(points: Array, size: float) -> Outline:
    """The surface of a body: the faces of the convex hull of its vertices, shape (n, 3)."""
    centre = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(np.pad(points - centre, ((0, 1), (0, 0))), full_matrices=False)  # three, also of two points
    hull = convex_hull(points) if spread[2] >= IN_ONE_PLANE * size * np.sqrt(len(points)) else None
    if hull is None:
        corners = _around(points, hull_corners((points - centre) @ axes[:2].T).tolist(), axes[2])
        return Outline(points[corners], [list(range(len(corners)))], is_flat=True)
    # Qhull splits faces into triangles; triangles of one plane form one face.
    planes: dict[tuple[float, ...], set[int]] = {}
    for plane, corners in zip(hull.equations, hull.simplices, strict=True):
        key = tuple(np.round(plane / [1.0, 1.0, 1.0, size], 9) + 0.0)
        planes.setdefault(key, set()).update(int(corner) for corner in corners)
    used = {corner: number for number, corner in enumerate(sorted(set().union(*planes.values())))}
    faces = [[used[corner] for corner in _around(points, sorted(corners), np.array(plane[:3]))] for plane, corners in planes.items()]
    return Outline(points[list(used)], faces)


def around_axis(radii: Array, heights: Array, meridians: int = MERIDIANS) -> Array:
    """Points of a surface of revolution about the y axis, shape (n, 3): rings of given radii at given heights [m]."""
    angles = np.linspace(0.0, 2.0 * np.pi, meridians, endpoint=False)
    rings = np.multiply.outer(radii, np.stack([np.sin(angles), np.zeros(meridians), np.cos(angles)], axis=-1))
    return (rings + np.multiply.outer(heights, UP)[:, np.newaxis]).reshape(-1, 3)


def _around(points: Array, corners: list[int], normal: Array) -> list[int]:
    """The corners of a face in order, counterclockwise about its outward normal."""
    arms = points[corners] - points[corners].mean(axis=0)
    across = np.cross(normal, arms[0])
    angles = np.arctan2(arms @ across, arms @ arms[0] * np.linalg.norm(normal))
    return [corners[place] for place in np.argsort(angles)]
