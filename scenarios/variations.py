"""A scene with a quantity changed, for all studies.

A function changes keys of a table, or one quantity and the quantities that depend on it, or describes the same motion in other units,
from another place or with other body axes. Fields by their dotted names are set in `fields`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from dropspin.scenarios.bodies.shape import times
from dropspin.scenarios.field_types import Table
from dropspin.scenarios.loading import from_mapping
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.rotations import conjugate, multiply, rotate, turned_states
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY, Array
from dropspin.scenarios.surfaces import Surface, Wall

AWAY = np.array([math.cos(0.65), 0.0, math.sin(0.65)])
"""A horizontal direction that is no axis, in which distances are no whole numbers: engines may round positions to a grid."""
NEXT_AXES = np.array([0.5, 0.5, 0.5, 0.5])
"""The rotation that takes the x axis to the y axis, y to z, and z to x."""
Tables = Mapping[str, Any] | Sequence[Any] | None
"""New values of some keys of a table, or all walls."""
REFLECTED = np.array([-1.0, 1.0, 1.0, 1.0, -1.0, -1.0, 1.0, -1.0, 1.0, 1.0, 1.0, -1.0, -1.0])
"""The signs of a state that is mirrored at the plane x = 0; rotations and angular velocities are axial."""


def changed(scene: Scenario, duration: float | None = None, **tables: Tables) -> Scenario:
    """The scene with some keys of some tables, the walls, or its duration replaced, and without expectations, ensemble and recording."""
    content = scene.model_dump(exclude={"expect", "ensemble", "recording"}, exclude_none=True)
    for table, keys in tables.items():
        content[table] = {**content[table], **keys} if isinstance(keys, Mapping) else keys
    return from_mapping({**content, "duration": scene.duration if duration is None else duration})


def with_values(scene: Scenario, table: str, **values: Any) -> Scenario:
    """The scene with some values of one table, if it has that table; a callable is applied to the old value.

    The table is validated, but not the scene: the body may start below the floor.
    """
    old = getattr(scene, table)
    if old is None:
        return scene
    new = {key: value(getattr(old, key)) if callable(value) else value for key, value in values.items()}
    return scene.model_copy(update={table: type(old).model_validate(old.model_dump() | new)})


def _walls(scene: Scenario, change: Callable[[Wall], Mapping[str, Any]]) -> list[dict[str, Any]] | None:
    """The walls with some keys of each replaced; None if there are none."""
    return None if scene.wall is None else [wall.model_dump() | dict(change(wall)) for wall in scene.wall]


def with_height(scene: Scenario, height: float) -> Scenario:
    """The scene with another height of the body's lowest point above the floor [m]."""
    x, y, z = scene.start.position
    return changed(scene, start={"position": (x, y + height - scene.clearance, z)})


def with_size(scene: Scenario, size: float) -> Scenario:
    """The scene with another size of the body [m], at the same height above the floor."""
    factor = size / scene.body.size
    x, y, z = scene.start.position
    start = {"position": (x, y - scene.clearance + factor * (scene.clearance + scene.body.size), z)}
    return with_height(changed(scene, body=scene.body.scaled(factor, 1.0), start=start), scene.clearance)


def with_inertia_ratio(scene: Scenario, ratio: float) -> Scenario:
    """The scene with another ratio of the largest to the least moment of inertia.

    The shape, the largest moment and its axis are kept, and the relative position of the middle moment between its smallest and largest
    possible value.
    """
    moments = np.array(scene.body.moments)
    least, middle, largest = np.sort(moments)
    lowest = max(least, largest - least)  # the triangle inequality of moments of inertia
    share = (middle - lowest) / (largest - lowest) if largest > lowest else 0.5
    new_least = largest / ratio
    new_lowest = max(new_least, largest - new_least)
    new = np.array([new_least, min(new_lowest + share * (largest - new_lowest), largest), largest])
    order = np.argsort(np.argsort(moments, kind="stable"), kind="stable")
    return changed(scene, body={"inertia": tuple(new[order].tolist())})


def in_units(scene: Scenario, length: float = 1.0, time: float = 1.0, mass: float = 1.0) -> Scenario:
    """The scene in other units; the arguments are a metre, a second and a kilogram in these units."""
    units = dict.fromkeys(("position", "point", "half_extents", "thickness"), length)
    units |= dict.fromkeys(("velocity", "rest_speed"), length / time)
    units |= {"angular_velocity": 1.0 / time, "acceleration": length / time**2}

    def converted(table: Table) -> dict[str, Any]:
        return {key: times(units[key], value) for key, value in table.model_dump(exclude_none=True).items() if key in units}

    tables: dict[str, Tables] = {"body": scene.body.scaled(length, mass), "wall": _walls(scene, converted)}
    tables |= {name: converted(table) for name in ("start", "gravity", "floor") if (table := getattr(scene, name)) is not None}
    if scene.damping is not None:
        step = scene.damping.factor_dt
        tables["damping"] = {name: rate / time for name, rate in scene.damping.rates.items()} | {"factor_dt": step and time * step}
    return changed(scene, time * scene.duration, **tables)


def with_other_numbers(scene: Scenario, share: float) -> Scenario:
    """A scene of the same structure: a smaller body, and the other numbers of all tables but the start multiplied by a factor above 1."""

    def other(surface: Surface) -> dict[str, Any]:
        friction = surface.friction if isinstance(surface.friction, str) else share * surface.friction
        return {"restitution": surface.restitution / share, "friction": friction, "rest_speed": share * surface.rest_speed}

    tables: dict[str, Tables] = {"body": scene.body.scaled(1.0 / share, share), "wall": _walls(scene, other)}
    if scene.gravity is not None:
        tables["gravity"] = {"acceleration": times(share, scene.gravity.acceleration)}
    if scene.floor is not None:
        tables["floor"] = other(scene.floor)
    if scene.damping is not None:
        tables["damping"] = {name: share * rate for name, rate in scene.damping.rates.items()}
    return changed(scene, scene.duration, **tables)


def units_of_states(length: float = 1.0, time: float = 1.0) -> Array:
    """The numbers of a state with 1 for each, in other units, shape (13,): states in these units over it are in SI units."""
    units = np.ones(13)
    units[POSITION], units[VELOCITY], units[SPIN] = length, length / time, 1.0 / time
    return units


def _seen(scene: Scenario, change: Callable[[tuple[float, ...]], tuple[float, ...]]) -> dict[str, Tables]:
    """The walls and gravity with changed vectors."""
    walls = _walls(scene, lambda wall: {"point": change(wall.point), "normal": change(wall.normal)})
    gravity = {} if scene.gravity is None else {"gravity": {"acceleration": change(scene.gravity.acceleration)}}
    return {"wall": walls, **gravity}


def turned(scene: Scenario, rotation: Array) -> Scenario:
    """The scene, gravity and walls included, turned by a rotation; it is about the vertical if there is a floor."""
    started = scene.starting_at(turned_states(scene.initial_state, rotation))
    return changed(started, scene.duration, **_seen(scene, lambda vector: tuple(map(float, rotate(rotation, np.array(vector))))))


def mirrored(scene: Scenario) -> Scenario:
    """The scene, body and gravity included, mirrored at the plane x = 0."""
    started = scene.starting_at(REFLECTED * scene.initial_state)
    return changed(started, scene.duration, body=scene.body.mirrored(), **_seen(scene, lambda vector: (-vector[0], *vector[1:])))


def with_next_axes(scene: Scenario) -> Scenario:
    """The same motion with other names of the body's axes: its x axis becomes y, y becomes z, and z becomes x."""
    state = scene.initial_state
    state[ORIENTATION] = multiply(state[ORIENTATION], conjugate(NEXT_AXES))
    return changed(scene.starting_at(state), body=scene.body.with_axes((2, 0, 1)))


def with_previous_axes(states: Array) -> Array:
    """States of `with_next_axes`, shape (n, 13), by the original names of the axes."""
    renamed = states.copy()
    renamed[:, ORIENTATION] = multiply(states[:, ORIENTATION], NEXT_AXES)
    return renamed


def moving(scene: Scenario, offset: Array, velocity: Array) -> Scenario:
    """The scene from a frame of reference: moved by an offset [m], walls included, and with an additional velocity [m/s]."""
    state = scene.initial_state
    state[POSITION] += offset
    state[VELOCITY] += velocity
    moved = scene.starting_at(state)
    if scene.wall is None:
        return moved
    return changed(moved, wall=_walls(scene, lambda wall: {"point": tuple(np.add(wall.point, offset).tolist())}))


def heavy_neighbour(scene: Scenario) -> Scenario:
    """The scene with a body of 1,000 times the mass that starts alike, 100 times the body's size away, on the floor if there is one."""
    height = scene.clearance if scene.starts_above_floor else 0.0
    return moving(in_units(scene, mass=1e3), 1e2 * scene.body.size * AWAY - [0.0, height, 0.0], np.zeros(3))


def is_sliding_free(scene: Scenario) -> bool:
    """Whether a horizontal velocity has no effect on the motion: no friction, no damping, no walls, no end of the floor."""
    return scene.damping is None and (scene.floor is None or scene.floor.coefficient == 0.0) and not scene.has_edges_or_walls


def whole_steps(scene: Scenario, dt: float, steps: int) -> Scenario:
    """The scene for a number of time steps of dt [s]."""
    return changed(scene, math.nextafter(steps * dt, math.inf))
