"""Fifteen families of random scenes with exact solutions. The docstring of `dropspin.scenarios.draw` states the distributions.

A family returns the content of a scene with the longest allowed duration, and the number of the impact after which the scene ends: 0 if it
ends in the flight before the first impact, None if the scene lasts for the whole duration.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from dropspin.scenarios.bodies import body_of
from dropspin.scenarios.random_variates import Draws
from dropspin.scenarios.rotations import about, multiply, rotate
from dropspin.scenarios.state import UP, Array

Table = dict[str, Any]
Drawn = tuple[Table, int | None]

DOWN = np.array([0.0, -1.0, 0.0])
MASS, LENGTH = (1e-2, 1e3), (0.1, 1.0)  # kg, m
GRAVITY = (0.5, 30.0)  # m/s²
FALL_TIME = (0.12, 0.3)  # s
FLIGHT_TIME = 0.3  # s, the longest after each impact
RESTITUTION = (0.1, 0.95)
FACES = (np.array([0.0, 0.0, 0.0, 1.0]), about(np.eye(3)[0], np.array(0.5 * math.pi)), about(np.eye(3)[2], np.array(0.5 * math.pi)))
"""Orientations in which one axis of a box is vertical, for each axis."""


def free_tensor(draws: Draws) -> Drawn:
    """Points of unequal masses in free flight."""
    return _flight(draws, _points(draws)), None


def free_axes(draws: Draws) -> Drawn:
    """A body with random principal moments in free flight."""
    body = _ball(draws) if draws.happens(0.5) else _box(draws)
    sizes = body.get("half_extents", [body.get("radius")] * 3)
    return _flight(draws, body | {"inertia": _moments(draws, body["mass"], sizes)}), None


def damped(draws: Draws) -> Drawn:
    """A body in free flight with damping."""
    body = (_ball, _box, _points)[draws.one_of(3)](draws)
    rates = {"linear": draws.uniform(0.1, 2.0), "angular": draws.uniform(0.1, 2.0)}
    return _flight(draws, body) | {"damping": rates}, None


def ball(draws: Draws) -> Drawn:
    """A ball bounces on a frictionless floor."""
    body = _ball(draws)
    if draws.happens(0.5):
        body["inertia"] = _moments(draws, body["mass"], [body["radius"]] * 3)
    impacts = 1 + draws.one_of(3)
    scene = _fall(draws, body, draws.direction(4), _spin(draws), impacts, may_tilt=True)
    return scene | _floor(draws, "none"), impacts


def rough_ball(draws: Draws) -> Drawn:
    """A spinning ball strikes a rough floor."""
    scene = _fall(draws, _ball(draws), draws.direction(4), _spin(draws), may_tilt=True)
    return scene | _floor(draws, "infinite" if draws.happens(0.5) else draws.uniform(0.05, 0.6)), 1


def flat_box(draws: Draws) -> Drawn:
    """A box lands on a face."""
    is_rough, impacts = draws.happens(0.5), 1 + draws.one_of(3)
    scene = _fall(draws, _box(draws), _flat(draws), (0.0 if is_rough else draws.uniform(-10.0, 10.0)) * UP, impacts, straight=is_rough)
    return scene | _floor(draws, "infinite" if is_rough else "none"), impacts


def corner(draws: Draws) -> Drawn:
    """A body lands on a corner."""
    return _struck(draws, _points(draws) if draws.happens(1.0 / 3.0) else _box(draws))


def edge(draws: Draws) -> Drawn:
    """A box lands on an edge."""
    tilt = about(np.eye(3)[0], np.array(draws.uniform(0.1, 0.5 * math.pi - 0.1)))
    attitude = multiply(_yaw(draws), multiply(tilt, FACES[draws.one_of(3)]))
    return _fall(draws, _box(draws), attitude, np.zeros(3)) | _floor(draws), 1


def on_floor(draws: Draws) -> Drawn:
    """A box slides or turns on a rough floor until it stops."""
    body, attitude, slides = _box(draws), _flat(draws), draws.happens(0.5)
    g, friction, stops = draws.log_uniform(*GRAVITY), draws.uniform(0.1, 0.6), draws.uniform(0.2, 0.6)
    start = {"position": _height(body, attitude) * UP, "orientation": attitude}
    if slides:
        start["velocity"] = friction * g * stops * draws.heading()
    else:
        vertical = int(np.argmax(np.abs(rotate(attitude, np.eye(3))[:, 1])))
        across = np.delete(np.array(body["half_extents"]), vertical)
        body["inertia"] = "solid" if draws.happens(0.5) else "vertices"
        share = 1.0 / 3.0 if body["inertia"] == "solid" else 1.0
        spin = friction * g * stops / (share * float(np.linalg.norm(across)))
        start["angular_velocity"] = np.array([0.0, math.copysign(spin, draws.uniform(-1.0, 1.0)), 0.0])
    return _content(1.1 * stops, body, g * DOWN, **start) | _floor(draws, friction), None


def standing(draws: Draws) -> Drawn:
    """A box falls over from an edge."""
    body = _box(draws)
    height, depth = (body["half_extents"][axis] for axis in (1, 2))
    balance = math.atan2(depth, height)  # turned by this about its own x axis, the box balances on an edge
    turned = balance + math.copysign(draws.uniform(0.05, 0.3), draws.uniform(-1.0, 1.0))
    attitude = multiply(_yaw(draws), about(np.eye(3)[0], np.array(turned)))
    scene = _content(1.2, body, draws.log_uniform(*GRAVITY) * DOWN, position=_height(body, attitude) * UP, orientation=attitude)
    return scene | {"floor": {"restitution": 0.0, "friction": "infinite" if draws.happens(0.5) else "none"}}, 0


def strike(draws: Draws) -> Drawn:
    """A round body lands on a point."""
    return _struck(draws, _round(draws))


def lying(draws: Draws) -> Drawn:
    """A round body lands on its side."""
    body, impacts = _round(draws), 1 + draws.one_of(3)
    down = 2 if "radius" in body else int(np.argmin(body["half_extents"]))
    attitude = multiply(_yaw(draws), FACES[down - 1])
    scene = _fall(draws, body, attitude, draws.uniform(-10.0, 10.0) * UP, impacts)
    return scene | _floor(draws, "none"), impacts


def rolling(draws: Draws) -> Drawn:
    """A round body slides until it rolls."""
    body = _ball(draws) if draws.happens(1.0 / 3.0) else _on_axis(draws)
    g, friction, rolls = draws.log_uniform(*GRAVITY), draws.uniform(0.1, 0.6), draws.uniform(0.2, 0.6)
    turned = _yaw(draws)
    speed = friction * g * rolls * (1.0 + body["mass"] * body["radius"] ** 2 / body_of(body).moments[1])
    attitude, velocity = multiply(turned, FACES[1]), speed * rotate(turned, np.eye(3)[0])
    scene = _content(1.5 * rolls, body, g * DOWN, position=body["radius"] * UP, orientation=attitude, velocity=velocity)
    return scene | _floor(draws, friction), None


def mesh(draws: Draws) -> Drawn:
    """A mesh lands on a corner."""
    points = 0.5 * draws.log_uniform(*LENGTH) * draws.normal(4)
    faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    return _struck(draws, {"shape": "mesh", "mass": draws.log_uniform(*MASS), "points": points.tolist(), "faces": faces})


def wall(draws: Draws) -> Drawn:
    """A ball strikes a wall and the floor."""
    body = _ball(draws)
    scene = _fall(draws, body, draws.direction(4), _spin(draws), 2) | _floor(draws, "none")
    velocity = np.array(scene["start"]["velocity"]) * (1.0 - UP)
    heading = rotate(about(UP, np.array(draws.uniform(-0.5, 0.5))), velocity / np.linalg.norm(velocity))
    struck = draws.uniform(0.3, 0.7) * (scene["duration"] - 2.0 * FLIGHT_TIME)
    point = velocity * struck + body["radius"] * heading
    surface = {"point": point.tolist(), "normal": (-heading).tolist(), "restitution": draws.uniform(*RESTITUTION), "friction": "none"}
    return scene | {"wall": [surface]}, 2


OF_PLAIN_SHAPES: tuple[Callable[[Draws], Drawn], ...] = (
    free_tensor,
    free_axes,
    damped,
    ball,
    rough_ball,
    flat_box,
    corner,
    edge,
    on_floor,
    standing,
)
"""The families of balls, boxes and points; their docstrings are the summaries of scenes."""
FAMILIES = (*OF_PLAIN_SHAPES, strike, lying, rolling, mesh, wall)


def _ball(draws: Draws) -> Table:
    return {"shape": "sphere", "mass": draws.log_uniform(*MASS), "radius": 0.5 * draws.log_uniform(*LENGTH)}


def _box(draws: Draws) -> Table:
    half_extents = [0.5 * draws.log_uniform(*LENGTH) for _ in range(3)]
    mass = draws.log_uniform(*MASS)
    inertias = ("solid", "vertices", _moments(draws, mass, half_extents))
    return {"shape": "box", "mass": mass, "half_extents": half_extents, "inertia": inertias[draws.one_of(3)]}


def _on_axis(draws: Draws) -> Table:
    lengths = {name: 0.5 * draws.log_uniform(*LENGTH) for name in ("radius", "half_length")}
    return {"shape": ("capsule", "cylinder")[draws.one_of(2)], "mass": draws.log_uniform(*MASS), **lengths}


def _round(draws: Draws) -> Table:
    if draws.happens(2.0 / 3.0):
        return _on_axis(draws)
    half_extents = [0.5 * draws.log_uniform(*LENGTH) for _ in range(3)]
    return {"shape": "ellipsoid", "mass": draws.log_uniform(*MASS), "half_extents": half_extents}


def _points(draws: Draws) -> Table:
    mass, length, count = draws.log_uniform(*MASS), 0.5 * draws.log_uniform(*LENGTH), 4 + draws.one_of(5)
    shares = np.array([draws.uniform(0.2, 1.0) for _ in range(count)])
    return {"shape": "vertices", "points": (length * draws.normal(count)).tolist(), "masses": (mass * shares / shares.sum()).tolist()}


def _moments(draws: Draws, mass: float, sizes: list[float]) -> list[float]:
    """Principal moments of a mass whose mean square along each axis is U(0.1, 1) of the size squared."""
    a, b, c = (draws.uniform(0.1, 1.0) * size**2 for size in sizes)
    return [mass * (b + c), mass * (c + a), mass * (a + b)]


def _content(duration: float, body: Table, gravity: Array | None, **start: Array) -> Table:
    """The content of a scene without a floor."""
    pull = {} if gravity is None else {"gravity": {"acceleration": gravity.tolist()}}
    return {"duration": duration, "body": body, "start": {name: part.tolist() for name, part in start.items()}} | pull


def _flight(draws: Draws, body: Table) -> Table:
    attitude, velocity = draws.direction(4), draws.uniform(0.0, 3.0) * draws.direction()
    spin = _spin(draws)
    gravity = None if draws.happens(0.3) else draws.log_uniform(*GRAVITY) * draws.direction()
    return _content(draws.uniform(0.5, 1.0), body, gravity, orientation=attitude, velocity=velocity, angular_velocity=spin)


def _fall(
    draws: Draws, body: Table, attitude: Array, spin: Array, impacts: int = 1, *, may_tilt: bool = False, straight: bool = False
) -> Table:
    """A fall from above the floor, by default with a horizontal velocity, that is long enough for some impacts."""
    g, time, lifted = draws.log_uniform(*GRAVITY), draws.uniform(*FALL_TIME), draws.uniform(-0.5, 0.5)
    sideways = draws.uniform(0.0, 2.0) * draws.heading()
    tilt = draws.uniform(0.0, 0.5) if may_tilt and draws.happens(0.3) else 0.0
    pull = g * math.cos(tilt)
    position = (_height(body, attitude) + 0.5 * pull * time**2 * (1.0 - lifted)) * UP
    velocity = 0.5 * pull * time * lifted * UP + (0.0 if straight else sideways)
    gravity = -pull * UP + (g * math.sin(tilt) * draws.heading() if tilt else 0.0)
    start = {"position": position, "orientation": attitude, "velocity": velocity, "angular_velocity": spin}
    return _content(time + impacts * FLIGHT_TIME, body, gravity, **start)


def _struck(draws: Draws, body: Table) -> Drawn:
    """A fall from any orientation, with one impact."""
    scene = _fall(draws, body, draws.direction(4), draws.uniform(0.0, 3.0) * draws.direction(), may_tilt=True)
    return scene | _floor(draws), 1


def _floor(draws: Draws, friction: str | float | None = None) -> Table:
    """A floor, by default with infinite friction or none."""
    friction = ("infinite" if draws.happens(0.5) else "none") if friction is None else friction
    return {"floor": {"restitution": draws.uniform(*RESTITUTION), "friction": friction}}


def _yaw(draws: Draws) -> Array:
    """A rotation about the vertical."""
    return about(UP, np.array(draws.uniform(0.0, 2.0 * math.pi)))


def _spin(draws: Draws) -> Array:
    return draws.log_uniform(0.5, 12.0) * draws.direction()


def _flat(draws: Draws) -> Array:
    """An orientation of a box with a face down."""
    return multiply(_yaw(draws), FACES[draws.one_of(3)])


def _height(body: Table, attitude: Array) -> float:
    """Height at which a body of this orientation touches the floor [m]."""
    return -float(body_of(body).lowest(attitude, 0.0)[0, 1])
