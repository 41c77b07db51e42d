"""The lowest points of the ellipsoids about the vertices of a body.

With S the semi-axes and n the upward direction in the body, the lowest point of an ellipsoid is at -S² n / |S n| from its centre, |S n|
below it. A disc has a semi-axis of 0. A ball has equal semi-axes r, and its lowest point is -r n, also in floating-point numbers.
"""

import numpy as np

from dropspin.scenarios.rotations import rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, UP, Array

RIM = np.array([[1.0, 1.0, 0.0], [0.0, 1.0, 1.0], [-1.0, 1.0, 0.0], [0.0, 1.0, -1.0]])
"""Four points of a rim, in units of the semi-axes; that along y is 0."""


def depth_below_centre(orientation: Array, semi_axes: Array) -> Array:
    """Depth of the lowest point of ellipsoids below their centres [m], shape (...), from shapes (..., 4) and (..., 3)."""
    stretched = np.linalg.norm(semi_axes * unrotate(orientation, np.broadcast_to(UP, (*orientation.shape[:-1], 3))), axis=-1)
    return np.where(np.ptp(semi_axes, axis=-1) == 0.0, semi_axes[..., 0], stretched)


def clearances(states: Array, vertices: Array, semi_axes: Array) -> Array:
    """Heights of the bodies' lowest points above the plane y = 0 [m], shape (B,).

    Args:
        states: States of the bodies, shape (B, 13).
        vertices: Vertices of one body, shape (n, 3), or of each, shape (B, n, 3) [m].
        semi_axes: Semi-axes about the vertices of one body, shape (3,), or of each, shape (B, 3) [m].
    """
    heights = rotate(states[:, np.newaxis, ORIENTATION], vertices)[..., 1]
    return states[:, 1] + heights.min(axis=1) - depth_below_centre(states[:, ORIENTATION], semi_axes)


def rise_of_centre(orientation: Array, semi_axes: Array) -> Array:
    """The vector from the lowest point of an ellipsoid to its centre, in the world frame [m], shape (..., 3); of a level disc, 0.

    Args:
        orientation: Orientations of the body, shape (..., 4).
        semi_axes: Semi-axes of the ellipsoid [m], shape (3,).
    """
    up = np.broadcast_to(UP, (*orientation.shape[:-1], 3))
    if np.ptp(semi_axes) == 0.0:
        return semi_axes[0] * up
    stretched = semi_axes * unrotate(orientation, up)
    length = np.linalg.norm(stretched, axis=-1, keepdims=True)
    return rotate(orientation, semi_axes * stretched / np.where(length > 0.0, length, 1.0))
