"""Fifteen families of random scenes with exact solutions. The docstring of `dropspin.scenarios.draw` states the distributions.

A family returns the content of a scene with the longest allowed duration, and the number of the impact after which the scene ends: 0 if it
ends in the flight before the first impact, None if the scene lasts for the whole duration.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from dropspin.scenarios.draws import Draws
from dropspin.scenarios.rotations import about, multiply, rotate
from dropspin.scenarios.state import UP, Array

Table = dict[str, Any]
Drawn = tuple[Table, int | None]

MASS, LENGTH = (1e-2, 1e3), (0.1, 1.0)  # kg, m
GRAVITY = (0.5, 30.0)  # m/s²
FALL_TIME = (0.12, 0.3)  # s
FLIGHT_TIME = 0.3  # s, the longest after each impact
RESTITUTION = (0.1, 0.95)
FACES = (np.array([0.0, 0.0, 0.0, 1.0]), about(np.eye(3)[0], np.array(0.5 * math.pi)), about(np.eye(3)[2], np.array(0.5 * math.pi)))
"""Orientations in which one axis of a box is vertical, for each axis."""


def free_tensor(draws: Draws) -> Drawn:
    """A flight of points of unequal masses."""
    return _flight(draws, _points(draws)), None


def free_axes(draws: Draws) -> Drawn:
    """A flight of a ball or a box with random principal moments."""
    body = _ball(draws) if draws.happens(0.5) else _box(draws)
    sizes = body.get("half_extents", [body.get("radius")] * 3)
    return _flight(draws, body | {"inertia": _moments(draws, body["mass"], sizes)}), None


def damped(draws: Draws) -> Drawn:
    """A flight with damping."""
    body = (_ball, _box, _points)[draws.one_of(3)](draws)
    rates = {"linear": draws.uniform(0.1, 2.0), "angular": draws.uniform(0.1, 2.0)}
    return _flight(draws, body) | {"damping": rates}, None


def ball(draws: Draws) -> Drawn:
    """A ball on a frictionless floor."""
    body = _ball(draws)
    if draws.happens(0.5):
        body["inertia"] = _moments(draws, body["mass"], [body["radius"]] * 3)
    impacts = 1 + draws.one_of(3)
    scene = _fall(draws, body, draws.direction(4), draws.log_uniform(0.5, 12.0) * draws.direction(), impacts, may_tilt=True)
    return scene | _floor(draws, "none"), impacts


def rough_ball(draws: Draws) -> Drawn:
    """A solid ball with spin on a rough floor."""
    scene = _fall(draws, _ball(draws), draws.direction(4), draws.log_uniform(0.5, 12.0) * draws.direction(), may_tilt=True)
    return scene | _floor(draws, "infinite" if draws.happens(0.5) else draws.uniform(0.05, 0.6)), 1


def flat_box(draws: Draws) -> Drawn:
    """A box that lands on a face."""
    is_rough, impacts = draws.happens(0.5), 1 + draws.one_of(3)
    scene = _fall(draws, _box(draws), _flat(draws), (0.0 if is_rough else draws.uniform(-10.0, 10.0)) * UP, impacts, straight=is_rough)
    return scene | _floor(draws, "infinite" if is_rough else "none"), impacts


def corner(draws: Draws) -> Drawn:
    """A body that lands on a corner."""
    body = _points(draws) if draws.happens(1.0 / 3.0) else _box(draws)
    scene = _fall(draws, body, draws.direction(4), draws.uniform(0.0, 3.0) * draws.direction(), may_tilt=True)
    return scene | _floor(draws, "infinite" if draws.happens(0.5) else "none"), 1


def edge(draws: Draws) -> Drawn:
    """A box that lands on an edge."""
    tilt = about(np.eye(3)[0], np.array(draws.uniform(0.1, 0.5 * math.pi - 0.1)))
    attitude = multiply(about(UP, np.array(draws.uniform(0.0, 2.0 * math.pi))), multiply(tilt, FACES[draws.one_of(3)]))
    scene = _fall(draws, _box(draws), attitude, np.zeros(3))
    return scene | _floor(draws, "infinite" if draws.happens(0.5) else "none"), 1


def on_floor(draws: Draws) -> Drawn:
    """A box that slides or turns on a rough floor until it stops, and lies for a tenth of that time."""
    body, attitude, slides = _box(draws), _flat(draws), draws.happens(0.5)
    g, friction, stops = draws.log_uniform(*GRAVITY), draws.uniform(0.1, 0.6), draws.uniform(0.2, 0.6)
    start = {"position": [0.0, _height(body, attitude), 0.0], "orientation": attitude.tolist()}
    if slides:
        start["velocity"] = (friction * g * stops * draws.heading()).tolist()
    else:
        vertical = int(np.argmax(np.abs(rotate(attitude, np.eye(3))[:, 1])))
        across = np.delete(np.array(body["half_extents"]), vertical)
        body["inertia"] = "solid" if draws.happens(0.5) else "vertices"
        share = 1.0 / 3.0 if body["inertia"] == "solid" else 1.0
        spin = friction * g * stops / (share * float(np.linalg.norm(across)))
        start["angular_velocity"] = [0.0, math.copysign(spin, draws.uniform(-1.0, 1.0)), 0.0]
    floor = {"restitution": draws.uniform(*RESTITUTION), "friction": friction}
    return {"duration": 1.1 * stops, "body": body, "start": start, "gravity": {"acceleration": [0.0, -g, 0.0]}, "floor": floor}, None


def standing(draws: Draws) -> Drawn:
    """A box that falls over from an edge, at rest."""
    body = _box(draws)
    height, depth = (body["half_extents"][axis] for axis in (1, 2))
    balance = math.atan2(depth, height)  # turned by this about its own x axis, the box balances on an edge
    turned = balance + math.copysign(draws.uniform(0.05, 0.3), draws.uniform(-1.0, 1.0))
    attitude = multiply(about(UP, np.array(draws.uniform(0.0, 2.0 * math.pi))), about(np.eye(3)[0], np.array(turned)))
    start = {"position": [0.0, _height(body, attitude), 0.0], "orientation": attitude.tolist()}
    gravity = {"acceleration": [0.0, -draws.log_uniform(*GRAVITY), 0.0]}
    floor = {"restitution": 0.0, "friction": "infinite" if draws.happens(0.5) else "none"}
    return {"duration": 1.2, "body": body, "start": start, "gravity": gravity, "floor": floor}, 0


def strike(draws: Draws) -> Drawn:
    """A capsule, a cylinder or an ellipsoid of any orientation."""
    scene = _fall(draws, _round(draws), draws.direction(4), draws.uniform(0.0, 3.0) * draws.direction(), may_tilt=True)
    return scene | _floor(draws, "infinite" if draws.happens(0.5) else "none"), 1


def lying(draws: Draws) -> Drawn:
    """A capsule or a cylinder that lands on its side, or an ellipsoid that lands on its shortest axis."""
    body, impacts = _round(draws), 1 + draws.one_of(3)
    down = 2 if "radius" in body else int(np.argmin(body["half_extents"]))
    attitude = multiply(about(UP, np.array(draws.uniform(0.0, 2.0 * math.pi))), FACES[down - 1])
    scene = _fall(draws, body, attitude, draws.uniform(-10.0, 10.0) * UP, impacts)
    return scene | _floor(draws, "none"), impacts


def rolling(draws: Draws) -> Drawn:
    """A ball, or a capsule or a cylinder on its side, is thrown along a rough floor; it slides until it rolls."""
    body = _ball(draws) if draws.happens(1.0 / 3.0) else _on_axis(draws)
    g, friction, rolls = draws.log_uniform(*GRAVITY), draws.uniform(0.1, 0.6), draws.uniform(0.2, 0.6)
    turned = about(UP, np.array(draws.uniform(0.0, 2.0 * math.pi)))
    speed = friction * g * rolls * (1.0 + body["mass"] * body["radius"] ** 2 / _made(body).moments[1])
    start = {
        "position": [0.0, body["radius"], 0.0],
        "orientation": multiply(turned, FACES[1]).tolist(),
        "velocity": (speed * rotate(turned, np.eye(3)[0])).tolist(),
    }
    floor = {"restitution": draws.uniform(*RESTITUTION), "friction": friction}
    return {"duration": 1.5 * rolls, "body": body, "start": start, "gravity": {"acceleration": [0.0, -g, 0.0]}, "floor": floor}, None


def mesh(draws: Draws) -> Drawn:
    """A solid tetrahedron, given as a mesh, that lands on a corner."""
    points = 0.5 * draws.log_uniform(*LENGTH) * draws.normal(4)
    faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    body = {"shape": "mesh", "mass": draws.log_uniform(*MASS), "points": points.tolist(), "faces": faces}
    scene = _fall(draws, body, draws.direction(4), draws.uniform(0.0, 3.0) * draws.direction(), may_tilt=True)
    return scene | _floor(draws, "infinite" if draws.happens(0.5) else "none"), 1


def wall(draws: Draws) -> Drawn:
    """A ball that strikes a smooth vertical wall, and then a smooth floor."""
    body = _ball(draws)
    scene = _fall(draws, body, draws.direction(4), draws.log_uniform(0.5, 12.0) * draws.direction(), 2) | _floor(draws, "none")
    velocity = np.array(scene["start"]["velocity"]) * (1.0 - UP)
    heading = rotate(about(UP, np.array(draws.uniform(-0.5, 0.5))), velocity / np.linalg.norm(velocity))
    struck = draws.uniform(0.3, 0.7) * (scene["duration"] - 2.0 * FLIGHT_TIME)
    point = velocity * struck + body["radius"] * heading
    surface = {"point": point.tolist(), "normal": (-heading).tolist(), "restitution": draws.uniform(*RESTITUTION), "friction": "none"}
    return scene | {"wall": [surface]}, 2


FAMILIES: dict[str, tuple[str, Callable[[Draws], Drawn]]] = {
    "free-tensor": ("Points of unequal masses in free flight", free_tensor),
    "free-axes": ("A body with random principal moments in free flight", free_axes),
    "damped": ("A body in free flight with damping", damped),
    "ball": ("A ball bounces on a frictionless floor", ball),
    "rough-ball": ("A spinning ball strikes a rough floor", rough_ball),
    "flat-box": ("A box lands on a face", flat_box),
    "corner": ("A body lands on a corner", corner),
    "edge": ("A box lands on an edge", edge),
    "on-floor": ("A box slides or turns on a rough floor until it stops", on_floor),
    "standing": ("A box falls over from an edge", standing),
    "strike": ("A round body lands on a point", strike),
    "lying": ("A round body lands on its side", lying),
    "rolling": ("A round body slides until it rolls", rolling),
    "mesh": ("A mesh lands on a corner", mesh),
    "wall": ("A ball strikes a wall and the floor", wall),
}
"""The summary of each family, and the function that draws it."""


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


def _flight(draws: Draws, body: Table) -> Table:
    start = {
        "orientation": draws.direction(4).tolist(),
        "velocity": (draws.uniform(0.0, 3.0) * draws.direction()).tolist(),
        "angular_velocity": (draws.log_uniform(0.5, 12.0) * draws.direction()).tolist(),
    }
    gravity = {} if draws.happens(0.3) else {"gravity": {"acceleration": (draws.log_uniform(*GRAVITY) * draws.direction()).tolist()}}
    return {"duration": draws.uniform(0.5, 1.0), "body": body, "start": start} | gravity


def _fall(
    draws: Draws, body: Table, attitude: Array, spin: Array, impacts: int = 1, *, may_tilt: bool = False, straight: bool = False
) -> Table:
    """A fall from above the floor, by default with a horizontal velocity, that is long enough for some impacts."""
    g, time, lifted = draws.log_uniform(*GRAVITY), draws.uniform(*FALL_TIME), draws.uniform(-0.5, 0.5)
    sideways = draws.uniform(0.0, 2.0) * draws.heading()
    tilt = draws.uniform(0.0, 0.5) if may_tilt and draws.happens(0.3) else 0.0
    pull = g * math.cos(tilt)
    height = _height(body, attitude) + 0.5 * pull * time**2 * (1.0 - lifted)
    velocity = 0.5 * pull * time * lifted * UP + (0.0 if straight else sideways)
    return {
        "duration": time + impacts * FLIGHT_TIME,
        "body": body,
        "start": {
            "position": [0.0, height, 0.0],
            "orientation": attitude.tolist(),
            "velocity": velocity.tolist(),
            "angular_velocity": spin.tolist(),
        },
        "gravity": {"acceleration": (-pull * UP + (g * math.sin(tilt) * draws.heading() if tilt else 0.0)).tolist()},
    }


def _floor(draws: Draws, friction: str | float) -> Table:
    return {"floor": {"restitution": draws.uniform(*RESTITUTION), "friction": friction}}


def _flat(draws: Draws) -> Array:
    """An orientation of a box with a face down."""
    return multiply(about(UP, np.array(draws.uniform(0.0, 2.0 * math.pi))), FACES[draws.one_of(3)])


def _height(body: Table, attitude: Array) -> float:
    """Height at which a body of this orientation touches the floor [m]."""
    return -float(_made(body).lowest(attitude, 0.0)[0, 1])


def _made(body: Table) -> Any:
    from pydantic import TypeAdapter

    from dropspin.scenarios.bodies import Body

    return TypeAdapter(Body).validate_python(body)
