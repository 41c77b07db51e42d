"""The difference of two motions at each time, relative to the sizes and speeds of the first."""

import math

import numpy as np

from dropspin.scenarios import Scenario
from dropspin.scenarios.rotations import angle_between_orientations
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY, Array


def differences(scene: Scenario, first: Array, second: Array) -> Array:
    """The largest difference of two motions of a scene at each time: of angles [rad], and of lengths and speeds over their scales.

    Args:
        scene: The scene, whose body and gravity give the scales.
        first: States, shape (n, 13).
        second: The same.

    Returns:
        Shape (n,); infinite where a state is not finite.
    """
    size, g = scene.body.size, float(np.linalg.norm(scene.acceleration))
    finite = np.isfinite(first).all(axis=1) & np.isfinite(second).all(axis=1)
    largest, first, second = np.full(len(first), math.inf), first[finite], second[finite]
    if not finite.any():
        return largest
    # Relative to the speeds that the body or gravity gives: a speed of rounding errors is not a scale.
    speed = max(float(np.abs(first[:, VELOCITY]).max()), size * float(np.abs(first[:, SPIN]).max()), math.sqrt(g * size))
    scales = ((POSITION, size), (VELOCITY, speed), (SPIN, speed / size))
    ratios = [np.abs(first[:, part] - second[:, part]).max(axis=1) / scale for part, scale in scales if scale > 0.0]
    largest[finite] = np.max([angle_between_orientations(first[:, ORIENTATION], second[:, ORIENTATION]), *ratios], axis=0)
    return largest
