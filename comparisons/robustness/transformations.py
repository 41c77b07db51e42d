"""Transformations of a scene, one per axis: each changes one quantity and keeps the others."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparisons.robustness.operating_point import OperatingPoint, fall_time, spin
from scenarios import Scenario, load
from scenarios.mechanics import is_diagonal
from scenarios.state import POSITION, SPIN, VELOCITY

Array = NDArray[np.float64]

LEAST_STEPS = 8
"""Smallest number of steps of a run."""


def _changed(scene: Scenario, duration: float | None = None, **tables: Mapping[str, Any]) -> Scenario:
    """The scene with some keys of some tables, or its duration, replaced, and without expectations and ensemble."""
    content = scene.model_dump(exclude={"expect", "ensemble"}, exclude_none=True)
    for table, keys in tables.items():
        content[table] = {**content[table], **keys}
    return load({**content, "duration": scene.duration if duration is None else duration})


def with_step(nominal: OperatingPoint, dt: float) -> OperatingPoint:
    """Another time step [s]; the scene lasts at least `LEAST_STEPS` steps."""
    return OperatingPoint(_changed(nominal.scene, max(nominal.scene.duration, LEAST_STEPS * dt)), dt)


def with_spin(nominal: OperatingPoint, speed: float) -> OperatingPoint:
    """Another initial angular velocity [rad/s], for the same number of turns in free flight, and for the same duration with a floor."""
    scene, factor = nominal.scene, speed / spin(nominal.scene)
    duration = scene.duration if scene.floor is not None else max(scene.duration / factor, LEAST_STEPS * nominal.dt)
    faster = tuple(factor * rate for rate in scene.start.angular_velocity)
    return OperatingPoint(_changed(scene, duration, start={"angular_velocity": faster}), nominal.dt)


def with_height(nominal: OperatingPoint, height: float) -> OperatingPoint:
    """Another height above the floor [m]; the duration is the same multiple of the time of the fall."""
    scene = nominal.scene
    x, y, z = scene.start.position
    higher = _changed(scene, start={"position": (x, y + height - scene.clearance, z)})
    duration = scene.duration * fall_time(higher) / fall_time(scene)
    return OperatingPoint(_changed(higher, max(duration, LEAST_STEPS * nominal.dt)), nominal.dt)


def with_inertia_ratio(nominal: OperatingPoint, ratio: float) -> OperatingPoint:
    """Another ratio of the largest to the least moment of inertia.

    The shape, the largest moment and its axis are kept, and the relative position of the middle moment between its smallest and largest
    possible value.
    """
    scene = nominal.scene
    least, middle, largest = np.sort(np.diag(scene.body.inertia_tensor))
    lowest = max(least, largest - least)  # the triangle inequality of moments of inertia
    share = (middle - lowest) / (largest - lowest) if largest > lowest else 0.5
    new_least = largest / ratio
    new_lowest = max(new_least, largest - new_least)
    new = np.array([new_least, min(new_lowest + share * (largest - new_lowest), largest), largest])
    order = np.argsort(np.argsort(np.diag(scene.body.inertia_tensor), kind="stable"), kind="stable")
    return OperatingPoint(_changed(scene, body={"inertia": tuple(float(moment) for moment in new[order])}), nominal.dt)


def with_mass(nominal: OperatingPoint, mass: float) -> OperatingPoint:
    """Another mass [kg], and moments of inertia in proportion."""
    scene = nominal.scene
    return OperatingPoint(_changed(scene, body=_body_times(scene, 1.0, mass / scene.body.mass)), nominal.dt)


def with_restitution(nominal: OperatingPoint, restitution: float) -> OperatingPoint:
    """Another restitution of the floor."""
    return OperatingPoint(_changed(nominal.scene, floor={"restitution": restitution}), nominal.dt)


def with_duration(nominal: OperatingPoint, duration: float) -> OperatingPoint:
    """Another duration [s]."""
    return OperatingPoint(_changed(nominal.scene, duration), nominal.dt)


def with_size(nominal: OperatingPoint, size: float) -> OperatingPoint:
    """Another size of the body [m], at the same height above the floor."""
    scene = nominal.scene
    factor = size / scene.body.size
    x, y, z = scene.start.position
    content = {"position": (x, y - scene.clearance + factor * (scene.clearance + scene.body.size), z)}
    smaller = _changed(scene, body=_body_times(scene, factor, 1.0), start=content)
    x, y, z = smaller.start.position
    return OperatingPoint(_changed(smaller, start={"position": (x, y + scene.clearance - smaller.clearance, z)}), nominal.dt)


def with_scale(nominal: OperatingPoint, factor: float) -> OperatingPoint:
    """All lengths times a factor, and all times, including the time step, times its square root; gravity is kept."""
    scene, time = nominal.scene, math.sqrt(factor)
    start = {
        "position": tuple(factor * x for x in scene.start.position),
        "velocity": tuple(time * v for v in scene.start.velocity),
        "angular_velocity": tuple(rate / time for rate in scene.start.angular_velocity),
    }
    tables: dict[str, Mapping[str, Any]] = {"body": _body_times(scene, factor, 1.0), "start": start}
    if scene.floor is not None:
        tables["floor"] = {"rest_speed": time * scene.floor.rest_speed}
    if scene.damping is not None:
        tables["damping"] = {"linear": scene.damping.linear / time, "angular": scene.damping.angular / time}
    return OperatingPoint(_changed(scene, time * scene.duration, **tables), time * nominal.dt)


def _body_times(scene: Scenario, length: float, mass: float) -> dict[str, Any]:
    """Keys of the body table, with lengths and masses multiplied by factors."""
    given = scene.body.model_dump(exclude_none=True)
    keys: dict[str, Any] = {"mass": mass * given["mass"]}
    for name in {"radius", "half_extents", "points"} & given.keys():
        keys[name] = _times(length, given[name])
    if "masses" in given:
        keys["masses"] = _times(mass, given["masses"])
    if given["inertia"] == "note" and is_diagonal(scene.body.inertia_tensor):  # it has unit masses for a body of any mass
        given["inertia"] = tuple(float(moment) for moment in np.diag(scene.body.inertia_tensor))
    if not isinstance(given["inertia"], str):
        keys["inertia"] = _times(mass * length**2, given["inertia"])
    return keys


def _times(factor: float, values: Any) -> Any:
    return tuple(_times(factor, value) for value in values) if isinstance(values, tuple) else factor * values


def in_nominal_units(states: Array, axis: str, base: float, value: float) -> Array:
    """A motion of a scaled scene in the units of the nominal scene, shape (n, 13); of other axes, unchanged."""
    if axis != "scale":
        return states
    factor = value / base
    time = math.sqrt(factor)
    units = np.ones(13)
    units[POSITION], units[VELOCITY], units[SPIN] = factor, time, 1.0 / time
    return states / units
