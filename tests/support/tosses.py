"""Recordings of tosses that are made by formula: free flights, an impact, and flight again."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dropspin.comparisons.logs.header import Header
from dropspin.comparisons.logs.log import Log, Toss
from dropspin.scenarios.rotations import about, multiply, rotate
from dropspin.scenarios.state import Array
from dropspin.scenarios.truths.free_rotor import free_rotor

BRICK = {"shape": "box", "half_extents": [0.04, 0.05, 0.07], "mass": 0.4, "inertia": [9.9e-4, 8.7e-4, 5.5e-4]}
CUBE = {"shape": "box", "half_extents": [0.05, 0.05, 0.05], "mass": 0.4, "inertia": [6.7e-4] * 3}
AFTER = 12
"""Frames after the impact."""


@dataclass(frozen=True, eq=False)
class Made:
    """A recording with the exact motions: of each toss a function of a time before its impact that gives the state (13,), and that time."""

    log: Log
    exact: Sequence[Callable[[float], Array]]
    impacts: Sequence[float]


def turned(vectors: Array, quaternions: Array) -> Array:
    """Quaternions turned by rotation vectors in the world frame [rad], shapes (n, 3) and (n, 4)."""
    angles = np.linalg.norm(vectors, axis=1)
    turns = [about(vector / (angle or 1.0), np.asarray(angle)) for vector, angle in zip(vectors, angles, strict=True)]
    return multiply(np.array(turns), quaternions)


def made(
    seed: int,
    count: int,
    white: tuple[float, float] = (0.0, 0.0),
    *,
    rate: float = 148.0,
    gravity: float = 9.81,
    offset: Sequence[float] = (0.0, 0.0, 0.0),
    durations: tuple[float, float] = (0.1, 0.25),
    spin: float = 5.0,
    header: dict[str, Any] | None = None,
) -> Made:
    """A recording of a brick that is tossed at random.

    Args:
        seed: Of the random numbers.
        count: Of tosses.
        white: Noise of position [m] and orientation [rad].
        rate: Frames in a second.
        gravity: Of the motion [m/s²]; the header has 9.81.
        offset: From the centre of mass to the tracked point in the body frame [m].
        durations: Range of the times of the impacts [s].
        spin: Standard deviation of the components of the spin [rad/s].
        header: Other keys of the header.
    """
    random = np.random.default_rng(seed)
    head = Header.model_validate({"data": "made", "rate": rate, "body": BRICK, **(header or {})})
    inertia, fall = head.body.inertia_tensor, np.array([0.0, -gravity, 0.0])
    tosses, exact, impacts = [], [], []
    for number in range(count):
        impact = random.uniform(*durations)
        t = np.arange(int(impact * rate) + 1 + AFTER) / rate
        first = _free(
            random.normal(size=3) * 0.1 + [0.0, 1.0, 0.0],
            random.normal(size=3),
            random.normal(size=4),
            random.normal(size=3) * spin,
            inertia,
            fall,
        )
        hit = first(impact)
        second = _free(
            hit[:3], hit[7:10] * [0.8, 1.0, 0.8] + [0.0, 2.0, 0.0], hit[3:7], hit[10:] + random.normal(size=3) * 5.0, inertia, fall
        )
        states = np.array([first(time) if time < impact else second(time - impact) for time in t])
        position = states[:, :3] + rotate(states[:, 3:7], np.array(offset, float)) + random.normal(size=(len(t), 3)) * white[0]
        orientation = turned(random.normal(size=(len(t), 3)) * white[1], states[:, 3:7])
        tosses.append(Toss(str(number), t, position, orientation))
        exact.append(first)
        impacts.append(impact)
    return Made(Log(head, tuple(tosses), "made", ()), exact, impacts)


def _free(position: Array, velocity: Array, orientation: Array, spin: Array, inertia: Array, fall: Array) -> Callable[[float], Array]:
    rotor = free_rotor(inertia, orientation / np.linalg.norm(orientation), spin)

    def state(t: float) -> Array:
        (turned_to,), (rates,) = rotor(np.array([t]))
        return np.concatenate([position + velocity * t + 0.5 * fall * t**2, turned_to, velocity + fall * t, rates])

    return state
