"""Convex hulls of points: their corners and their lowest face."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios.state import Array

FLAT = 1e-14
"""Largest thickness of a set of points, relative to its size, that is attributed to rounding."""
MERIDIANS = 24
"""Of the surface of a round body, as it is drawn."""


def hull_corners(points: Array) -> NDArray[np.intp]:
    """Ascending indices of the points, shape (n, 3), that are corners of their convex hull, which may be flat, a line or a point."""
    centred = points - points.mean(axis=0)
    _, extents, directions = np.linalg.svd(centred, full_matrices=False)
    spanned = directions[extents > FLAT * np.linalg.norm(points)]
    if len(spanned) == 0:
        return np.array([0])
    if len(spanned) == 1:
        along = centred @ spanned[0]
        return np.unique([np.argmin(along), np.argmax(along)])
    hull = convex_hull(points if len(spanned) == 3 else centred @ spanned.T)
    return np.arange(len(points)) if hull is None else np.sort(hull.vertices).astype(np.intp)


def lowest_face(points: Array, size: float) -> float:
    """Distance of the origin from the nearest face of the convex hull of points, shape (n, 3) [m]; plane points can lie flat: 0."""
    centred = points - points.mean(axis=0)
    if np.linalg.matrix_rank(centred, tol=1e-9 * size) < 3:
        return 0.0
    hull = convex_hull(points)
    return 0.0 if hull is None else float(np.min(np.abs(hull.equations[:, 3])))


def convex_hull(points: Array) -> Any:
    """SciPy's convex hull of points, shape (n, 2) or (n, 3); None if they are flatter than Qhull resolves."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(points)
    except QhullError:
        return None
