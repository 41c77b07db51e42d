"""Ten families of random scenes with exact solutions. The docstring of `dropspin.scenarios.draw` states the distributions.

A family returns the content of a scene with the longest allowed duration, and the number of the impact after which the scene ends: 0 if it
ends in the flight before the first impact, None if the scene lasts for the whole duration.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

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


class Draws:
    """Random draws for one scene, all from uniform or normal variates of one generator."""

    def __init__(self, generator: np.random.Generator) -> None:
        self._generator = generator

    def uniform(self, low: float, high: float) -> float:
        """A number of U(low, high)."""
        return low + (high - low) * float(self._generator.random())

    def log_uniform(self, low: float, high: float) -> float:
        """A number of LU(low, high)."""
        return low * (high / low) ** float(self._generator.random())

    def happens(self, probability: float) -> bool:
        """Whether an event of this probability occurs."""
        return float(self._generator.random()) < probability

    def one_of(self, count: int) -> int:
        """A number below `count`."""
        return int(count * float(self._generator.random()))

    def direction(self, dimensions: int = 3) -> Array:
        """A unit vector; of four dimensions, an orientation."""
        vector = self._generator.normal(size=dimensions)
        return vector / np.linalg.norm(vector)

    def heading(self) -> Array:
        """A horizontal unit vector."""
        x, z = self.direction(2)
        return np.array([x, 0.0, z])

    def normal(self, rows: int) -> Array:
        """Standard normal variates, shape (rows, 3)."""
        return self._generator.normal(size=(rows, 3))


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
}
"""The summary of each family, and the function that draws it."""


def _ball(draws: Draws) -> Table:
    return {"shape": "sphere", "mass": draws.log_uniform(*MASS), "radius": 0.5 * draws.log_uniform(*LENGTH)}


def _box(draws: Draws) -> Table:
    half_extents = [0.5 * draws.log_uniform(*LENGTH) for _ in range(3)]
    mass = draws.log_uniform(*MASS)
    inertias = ("solid", "vertices", _moments(draws, mass, half_extents))
    return {"shape": "box", "mass": mass, "half_extents": half_extents, "inertia": inertias[draws.one_of(3)]}


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
    from pydantic import TypeAdapter

    from dropspin.scenarios.bodies import Body

    made: Any = TypeAdapter(Body).validate_python(body)
    return -float(made.lowest(attitude, 0.0)[0, 1])
