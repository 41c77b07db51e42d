"""Transformations of a scene to another with the same motion, seen from elsewhere or in other units; and other changes of its tables."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from dropspin.scenarios.bodies.shape import times
from dropspin.scenarios.loading import from_mapping
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.rotations import conjugate, multiply, rotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY, Array

AWAY = np.array([0.8, 0.0, 0.6])
"""A horizontal direction that is no axis."""
NEXT_AXES = np.array([0.5, 0.5, 0.5, 0.5])
"""The rotation that takes the x axis to the y axis, y to z, and z to x."""
REFLECTED = np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0, 1.0, 1.0, -1.0, -1.0])
"""The signs of a state that is mirrored at the plane x = 0; rotations and angular velocities are axial."""


def changed(scene: Scenario, duration: float | None = None, **tables: Mapping[str, Any]) -> Scenario:
    """The scene with some keys of some tables, or its duration, replaced, and without expectations and ensemble."""
    content = scene.model_dump(exclude={"expect", "ensemble"}, exclude_none=True)
    for table, keys in tables.items():
        content[table] = {**content[table], **keys}
    return from_mapping({**content, "duration": scene.duration if duration is None else duration})


def in_units(scene: Scenario, length: float = 1.0, time: float = 1.0, mass: float = 1.0) -> Scenario:
    """The scene in other units; the arguments are a metre, a second and a kilogram in these units."""
    start, speed = scene.start, length / time
    tables: dict[str, Mapping[str, Any]] = {
        "body": scene.body.scaled(length, mass),
        "start": {
            "position": times(length, start.position),
            "velocity": times(speed, start.velocity),
            "angular_velocity": times(1.0 / time, start.angular_velocity),
        },
    }
    if scene.gravity is not None:
        tables["gravity"] = {"acceleration": times(length / time**2, scene.gravity.acceleration)}
    if scene.floor is not None:
        tables["floor"] = {"rest_speed": speed * scene.floor.rest_speed}
    if scene.damping is not None:
        tables["damping"] = {"linear": scene.damping.linear / time, "angular": scene.damping.angular / time}
    return changed(scene, time * scene.duration, **tables)


def with_other_numbers(scene: Scenario, share: float) -> Scenario:
    """A scene of the same structure: a smaller body, and the other numbers of all tables but the start multiplied by a factor above 1."""
    tables: dict[str, Mapping[str, Any]] = {"body": scene.body.scaled(1.0 / share, share)}
    if scene.gravity is not None:
        tables["gravity"] = {"acceleration": times(share, scene.gravity.acceleration)}
    if scene.floor is not None:
        friction = scene.floor.friction
        tables["floor"] = {
            "restitution": scene.floor.restitution / share,
            "friction": friction if isinstance(friction, str) else share * friction,
            "rest_speed": share * scene.floor.rest_speed,
        }
    if scene.damping is not None:
        tables["damping"] = {"linear": share * scene.damping.linear, "angular": share * scene.damping.angular}
    return changed(scene, scene.duration, **tables)


def units_of_states(length: float = 1.0, time: float = 1.0) -> Array:
    """The numbers of a state with 1 for each, in other units, shape (13,): states in these units over it are in SI units."""
    units = np.ones(13)
    units[POSITION], units[VELOCITY], units[SPIN] = length, length / time, 1.0 / time
    return units


def turned_states(states: Array, rotation: Array) -> Array:
    """States, shape (..., 13), turned by a rotation, a unit quaternion."""
    parts = [rotate(rotation, states[..., part]) for part in (POSITION, VELOCITY, SPIN)]
    return np.concatenate([parts[0], multiply(rotation, states[..., ORIENTATION]), *parts[1:]], axis=-1)


def turned(scene: Scenario, rotation: Array) -> Scenario:
    """The scene, gravity included, turned about the vertical by a rotation."""
    found = scene.starting_at(turned_states(scene.initial_state, rotation))
    if scene.gravity is None:
        return found
    return changed(found, gravity={"acceleration": tuple(map(float, rotate(rotation, scene.acceleration)))})


def mirrored(scene: Scenario) -> Scenario:
    """The scene, body and gravity included, mirrored at the plane x = 0."""
    tables: dict[str, Mapping[str, Any]] = {"body": scene.body.mirrored()}
    if scene.gravity is not None:
        x, y, z = scene.gravity.acceleration
        tables["gravity"] = {"acceleration": (-x, y, z)}
    return changed(scene.starting_at(REFLECTED * scene.initial_state), scene.duration, **tables)


def with_next_axes(scene: Scenario) -> Scenario:
    """The same motion with other names of the body's axes: its x axis becomes y, y becomes z, and z becomes x."""
    state = scene.initial_state
    state[ORIENTATION] = multiply(state[ORIENTATION], conjugate(NEXT_AXES))
    return changed(scene.starting_at(state), body=scene.body.with_axes((2, 0, 1)))


def with_previous_axes(states: Array) -> Array:
    """States of `with_next_axes`, shape (n, 13), by the original names of the axes."""
    found = states.copy()
    found[:, ORIENTATION] = multiply(states[:, ORIENTATION], NEXT_AXES)
    return found


def moving(scene: Scenario, offset: Array, velocity: Array) -> Scenario:
    """The scene from a frame of reference: moved by an offset [m], and with an additional velocity [m/s]."""
    state = scene.initial_state
    state[POSITION] += offset
    state[VELOCITY] += velocity
    return scene.starting_at(state)


def heavy_neighbour(scene: Scenario) -> Scenario:
    """The scene with a body of 1,000 times the mass that starts alike, 100 times the body's size away, on the floor if there is one."""
    height = scene.clearance if scene.starts_above_floor else 0.0
    return moving(in_units(scene, mass=1e3), 1e2 * scene.body.size * AWAY - [0.0, height, 0.0], np.zeros(3))


def is_sliding_free(scene: Scenario) -> bool:
    """Whether a horizontal velocity has no effect on the motion: no friction and no damping."""
    return scene.damping is None and (scene.floor is None or scene.floor.coefficient == 0.0)


def whole_steps(scene: Scenario, dt: float, steps: int) -> Scenario:
    """The scene for a number of time steps of dt [s]."""
    return changed(scene, math.nextafter(steps * dt, math.inf))
