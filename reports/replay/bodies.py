"""The surface of a body: the faces of the convex hull of its vertices, or a sphere."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios.body import Body, hull_corners

Array = NDArray[np.float64]

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


def outline(body: Body) -> Outline:
    """The convex hull of the vertices of a body, or its sphere."""
    if body.rounding:
        return Outline(body.vertices, [], body.rounding)
    from scipy.spatial import ConvexHull, QhullError

    points = body.vertices
    centre = points.mean(axis=0)
    _, spread, axes = np.linalg.svd(np.pad(points - centre, ((0, 1), (0, 0))), full_matrices=False)  # three, also of two points
    hull = None
    if spread[2] >= IN_ONE_PLANE * body.size * np.sqrt(len(points)):
        with suppress(QhullError):  # thinner than Qhull resolves
            hull = ConvexHull(points)
    if hull is None:
        corners = _around(points, hull_corners((points - centre) @ axes[:2].T).tolist(), axes[2])
        return Outline(points[corners], [list(range(len(corners)))], is_flat=True)
    # Qhull splits faces into triangles; triangles of one plane form one face.
    planes: dict[tuple[float, ...], set[int]] = {}
    for plane, corners in zip(hull.equations, hull.simplices, strict=True):
        key = tuple(np.round(plane / [1.0, 1.0, 1.0, body.size], 9) + 0.0)
        planes.setdefault(key, set()).update(int(corner) for corner in corners)
    used = {corner: number for number, corner in enumerate(sorted(set().union(*planes.values())))}
    faces = [[used[corner] for corner in _around(points, sorted(corners), np.array(plane[:3]))] for plane, corners in planes.items()]
    return Outline(points[list(used)], faces)


def _around(points: Array, corners: list[int], normal: Array) -> list[int]:
    """The corners of a face in order, counterclockwise about its outward normal."""
    arms = points[corners] - points[corners].mean(axis=0)
    across = np.cross(normal, arms[0])
    angles = np.arctan2(arms @ across, arms @ arms[0] * np.linalg.norm(normal))
    return [corners[place] for place in np.argsort(angles)]
