"""An operating point: a scene and a time step at which an engine is tested, with the characteristic times and speeds of the scene."""

import math
from typing import NamedTuple

import numpy as np

from dropspin.scenarios import Scenario


class OperatingPoint(NamedTuple):
    """A scene and a time step [s]."""

    scene: Scenario
    dt: float


def natural_time(scene: Scenario) -> float:
    """The characteristic time of the scene [s]: that of a rotation by 1 rad, of the fall, or of a fall by the size of the body."""
    speed = spin(scene)
    if scene.floor is None and speed > 0.0:
        return 1.0 / speed
    if falls(scene):
        return fall_time(scene)
    g = float(np.linalg.norm(scene.acceleration))
    return math.sqrt(scene.body.size / g) if g > 0.0 else scene.duration / 8.0


def fall_time(scene: Scenario) -> float:
    """The time at which a body that does not rotate reaches the floor [s]."""
    g, upward = -float(scene.acceleration[1]), scene.start.velocity[1]
    return (upward + math.sqrt(upward**2 + 2.0 * g * scene.clearance)) / g


def spin(scene: Scenario) -> float:
    """The initial angular velocity [rad/s]."""
    return float(np.linalg.norm(scene.start.angular_velocity))


def falls(scene: Scenario) -> bool:
    """Whether the body starts above the floor and gravity pulls it down."""
    return scene.starts_above_floor and bool(scene.acceleration[1] < 0.0)
