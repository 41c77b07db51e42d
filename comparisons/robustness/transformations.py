"""Transformations of a scene, one per axis: each changes one quantity and keeps the others."""

import math

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.robustness.operating_point import OperatingPoint, fall_time, spin
from dropspin.scenarios import variations
from dropspin.scenarios.variations import changed, in_units, units_of_states

Array = NDArray[np.float64]

LEAST_STEPS = 8
"""Smallest number of steps of a run."""


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


def with_inertia_ratio(nominal: OperatingPoint, ratio: float) -> OperatingPoint:
    """Another ratio of the largest to the least moment of inertia, for the same shape and largest moment."""
    return OperatingPoint(variations.with_inertia_ratio(nominal.scene, ratio), nominal.dt)


def with_mass(nominal: OperatingPoint, mass: float) -> OperatingPoint:
    """Another mass [kg], and moments of inertia in proportion."""
    return OperatingPoint(in_units(nominal.scene, mass=mass / nominal.scene.body.mass), nominal.dt)


def with_restitution(nominal: OperatingPoint, restitution: float) -> OperatingPoint:
    """Another restitution of the floor."""
    return OperatingPoint(changed(nominal.scene, floor={"restitution": restitution}), nominal.dt)


def with_duration(nominal: OperatingPoint, duration: float) -> OperatingPoint:
    """Another duration [s]."""
    return OperatingPoint(changed(nominal.scene, duration), nominal.dt)


def with_size(nominal: OperatingPoint, size: float) -> OperatingPoint:
    """Another size of the body [m], at the same height above the floor."""
    return OperatingPoint(variations.with_size(nominal.scene, size), nominal.dt)


def with_scale(nominal: OperatingPoint, factor: float) -> OperatingPoint:
    """All lengths times a factor, and all times, including the time step, times its square root; gravity is kept."""
    time = math.sqrt(factor)
    return OperatingPoint(in_units(nominal.scene, factor, time), time * nominal.dt)


def in_nominal_units(states: Array, axis: str, base: float, value: float) -> Array:
    """A motion of a scaled scene in the units of the nominal scene, shape (n, 13); of other axes, unchanged."""
    factor = value / base
    return states / units_of_states(factor, math.sqrt(factor)) if axis == "scale" else states
