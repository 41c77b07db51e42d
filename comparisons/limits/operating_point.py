"""An operating point: a scene and a time step, its characteristic times, and variations that change one quantity and keep the others."""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from dropspin.scenarios import Scenario, variations
from dropspin.scenarios.state import Array
from dropspin.scenarios.variations import changed, in_units, units_of_states

LEAST_STEPS = 8
"""Smallest number of steps of a run."""


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


def of_scene(change: Callable[[Scenario, float], Scenario]) -> Callable[[OperatingPoint, float], OperatingPoint]:
    """The operating points whose scene is changed by a value, at the same time step."""
    return lambda nominal, value: nominal._replace(scene=change(nominal.scene, value))


def with_step(nominal: OperatingPoint, dt: float) -> OperatingPoint:
    """Another time step [s]; the scene lasts at least `LEAST_STEPS` steps."""
    return OperatingPoint(changed(nominal.scene, max(nominal.scene.duration, LEAST_STEPS * dt)), dt)


def with_spin(nominal: OperatingPoint, speed: float) -> OperatingPoint:
    """Another initial angular velocity [rad/s], for the same number of turns in free flight, and for the same duration with a floor."""
    scene, factor = nominal.scene, speed / spin(nominal.scene)
    duration = scene.duration if scene.floor is not None else max(scene.duration / factor, LEAST_STEPS * nominal.dt)
    faster = tuple(factor * rate for rate in scene.start.angular_velocity)
    return OperatingPoint(changed(scene, duration, start={"angular_velocity": faster}), nominal.dt)


def with_height(nominal: OperatingPoint, height: float) -> OperatingPoint:
    """Another height above the floor [m]; the duration is the same multiple of the time of the fall."""
    scene = nominal.scene
    higher = variations.with_height(scene, height)
    duration = scene.duration * fall_time(higher) / fall_time(scene)
    return OperatingPoint(changed(higher, max(duration, LEAST_STEPS * nominal.dt)), nominal.dt)


def with_scale(nominal: OperatingPoint, factor: float) -> OperatingPoint:
    """All lengths times a factor, and all times, including the time step, times its square root; gravity is kept."""
    time = math.sqrt(factor)
    return OperatingPoint(in_units(nominal.scene, factor, time), time * nominal.dt)


def in_nominal_units(states: Array, axis: str, base: float, value: float) -> Array:
    """A motion of a scaled scene in the units of the nominal scene, shape (n, 13); of other axes, unchanged."""
    factor = value / base
    return states / units_of_states(factor, math.sqrt(factor)) if axis == "scale" else states
