"""The symmetries: for each, the scene that has the same motion, and the way back from its motion to that of the nominal scene."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenarios import Scenario
from scenarios.rotations import about, conjugate
from scenarios.state import POSITION, UP, VELOCITY
from scenarios.transformations import (
    REFLECTED,
    in_units,
    is_sliding_free,
    mirrored,
    moving,
    turned,
    turned_states,
    units_of_states,
    with_next_axes,
    with_previous_axes,
)

Array = NDArray[np.float64]

AWAY = np.array([0.8, 0.0, 0.6])
"""A horizontal direction that is no axis."""


@dataclass(frozen=True)
class Symmetry:
    """A transformation of a scene that keeps its motion.

    Attributes:
        name: The name in the results: what the transformed scene is.
        transformed: Function of a scene that returns the transformed one.
        back: Function of times [s] and states of the transformed scene, shapes (n,) and (n, 13), to those of the nominal scene.
        applies: Whether a scene has this symmetry.
        time: Units of time of the transformed scene in a second.
    """

    name: str
    transformed: Callable[[Scenario], Scenario]
    back: Callable[[Array, Array], Array]
    applies: Callable[[Scenario], bool] = lambda scene: True
    time: float = 1.0


def _turned_by(name: str, angle: float) -> Symmetry:
    rotation = about(UP, np.array(angle))
    return Symmetry(name, lambda scene: turned(scene, rotation), lambda t, states: turned_states(states, conjugate(rotation)))


def _seen_from(name: str, distance: float, speed: float = 0.0) -> Symmetry:
    def back(t: Array, states: Array) -> Array:
        found = states.copy()
        found[:, POSITION] -= (distance + speed * t[:, np.newaxis]) * AWAY
        found[:, VELOCITY] -= speed * AWAY
        return found

    applies = is_sliding_free if speed else lambda scene: True
    return Symmetry(name, lambda scene: moving(scene, distance * AWAY, speed * AWAY), back, applies)


def _in(name: str, length: float = 1.0, time: float = 1.0, mass: float = 1.0) -> Symmetry:
    units = units_of_states(length, time)
    return Symmetry(name, lambda scene: in_units(scene, length, time, mass), lambda t, states: states / units, time=time)


SYMMETRIES = {
    one.name: one
    for one in (
        _turned_by("turned by 90°", 0.5 * math.pi),
        _turned_by("turned by 1 rad", 1.0),
        Symmetry("mirrored", mirrored, lambda t, states: REFLECTED * states),
        Symmetry("other body axes", with_next_axes, lambda t, states: with_previous_axes(states)),
        _seen_from("10 m away", 10.0),
        _seen_from("1 km away", 1e3),
        _seen_from("1000 km away", 1e6),
        _seen_from("moving at 10 m/s", 0.0, speed=10.0),
        _in("in millimetres", length=1e3),
        _in("in grams", mass=1e3),
        _in("in milliseconds", time=1e3),
    )
}
