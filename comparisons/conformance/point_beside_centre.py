"""States of a point of the body beside its centre of mass, found in a flight."""

import numpy as np

from dropspin.scenarios import Scenario, Trajectory
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.state import Array
from dropspin.scenarios.text import rounded

EXPLAINED = 1e-3
"""Share of the difference of positions that an offset may leave."""
SAME_AXIS = 1e-6
"""Relative size of singular values up to which a body turns about one axis."""
LEAST = 1e-5
"""The shortest offset that is stated, relative to the size of the body."""


def off_centre(scene: Scenario, motion: Trajectory, exact: Array) -> str:
    """A message if the positions of a flight are those of a point beside the centre of mass; empty if they are not.

    The point r of the body differs from the centre by (R(t) - R(0)) r + u t, as both positions and velocities agree at the start, or the
    positions alone. The turn R is the engine's own.

    Args:
        scene: A scene without a floor.
        motion: The engine's motion.
        exact: The exact positions at its times, shape (n, 3).
    """
    axes = np.stack([rotate(motion.orientation, axis) - rotate(motion.orientation[0], axis) for axis in np.eye(3)], axis=-1)
    drift = motion.t[:, np.newaxis, np.newaxis] * np.eye(3)
    off, columns = (motion.position - exact).ravel(), np.concatenate([axes, drift], axis=2).reshape(-1, 6)
    found, _, rank, _ = np.linalg.lstsq(columns, off, rcond=SAME_AXIS)
    without = off - columns[:, 3:] @ np.linalg.lstsq(columns[:, 3:], off, rcond=None)[0]
    distance = float(np.linalg.norm(found[:3]))
    if distance <= LEAST * scene.body.size or np.linalg.norm(off - columns @ found) > EXPLAINED * np.linalg.norm(without):
        return ""
    if rank < columns.shape[1]:  # a body that turns about one axis shows the distance from this axis
        return f"the states are those of a point beside the centre of mass, {rounded(distance, 2)} m from the axis of rotation"
    place = ", ".join(rounded(value, 2) for value in np.round(found[:3], 2 - int(np.floor(np.log10(distance)))) + 0.0)
    return f"the states are those of a point {rounded(distance, 2)} m from the centre of mass, at ({place}) m in the body frame"
