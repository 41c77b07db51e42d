"""Symmetries: for each, the scene that has the same motion, and the way back from its motion; and the names of repeated runs."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from dropspin.scenarios import Scenario
from dropspin.scenarios.rotations import about, conjugate, turned_states
from dropspin.scenarios.state import POSITION, UP, VELOCITY, Array
from dropspin.scenarios.variations import (
    AWAY,
    REFLECTED,
    in_units,
    is_sliding_free,
    mirrored,
    moving,
    turned,
    units_of_states,
    with_next_axes,
    with_previous_axes,
)


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


def _has_no_edges(scene: Scenario) -> bool:
    """Whether the floor is everywhere, so that it is the same for a body elsewhere."""
    return scene.floor is None or scene.floor.half_extents is None


def _turned_by(name: str, angle: float, axis: Array = UP, applies: Callable[[Scenario], bool] = _has_no_edges) -> Symmetry:
    rotation = about(axis, np.array(angle))
    return Symmetry(name, lambda scene: turned(scene, rotation), lambda t, states: turned_states(states, conjugate(rotation)), applies)


def _seen_from(name: str, distance: float, speed: float = 0.0) -> Symmetry:
    def back(t: Array, states: Array) -> Array:
        moved = states.copy()
        moved[:, POSITION] -= (distance + speed * t[:, np.newaxis]) * AWAY
        moved[:, VELOCITY] -= speed * AWAY
        return moved

    applies = is_sliding_free if speed else _has_no_edges
    return Symmetry(name, lambda scene: moving(scene, distance * AWAY, speed * AWAY), back, applies)


def _in(name: str, length: float = 1.0, time: float = 1.0, mass: float = 1.0) -> Symmetry:
    units = units_of_states(length, time)
    return Symmetry(name, lambda scene: in_units(scene, length, time, mass), lambda t, states: states / units, time=time)


SYMMETRIES = {
    symmetry.name: symmetry
    for symmetry in (
        _turned_by("turned by 90°", 0.5 * math.pi),
        _turned_by("turned by 1 rad", 1.0),
        _turned_by("tilted by 1 rad", 1.0, AWAY, lambda scene: scene.floor is None),
        Symmetry("mirrored", mirrored, lambda t, states: REFLECTED * states),
        Symmetry(
            "other body axes", with_next_axes, lambda t, states: with_previous_axes(states), lambda scene: not scene.body.has_own_axis
        ),
        _seen_from("10 m away", 10.0),
        _seen_from("1 km away", 1e3),
        _seen_from("1000 km away", 1e6),
        _seen_from("moving at 10 m/s", 0.0, speed=10.0),
        _in("in millimetres", length=1e3),
        _in("in grams", mass=1e3),
        _in("in milliseconds", time=1e3),
    )
}

AGAIN, BATCH, HALVES, NEW_PROCESS, ONE_CORE = "again", "in a batch", "in two halves", "in a new process", "on one core"
REPEATS = (AGAIN, BATCH, NEW_PROCESS, ONE_CORE, HALVES)
"""Runs of the same scene: after others in the same process, together with two others, in a new process, in a batch on one processor, and
stopped and continued.
"""
BITWISE = (AGAIN, BATCH, NEW_PROCESS, ONE_CORE)
"""Those that must give the same bits; a new simulation may continue from a state with other rounding errors."""
NAMES = (*SYMMETRIES, *REPEATS)
REPRESENTED = "with "
"""How the name of another representation of body or floor begins, such as `with body=mesh`."""
OTHER_REPRESENTATION = re.compile(rf"{REPRESENTED}[\w-]+=[\w-]+")


def kind_of(name: str) -> Literal["symmetry", "determinism"] | None:
    """The kind of the results of a symmetry or of a repeated run; None for any other name."""
    if name in REPEATS:
        return "determinism"
    return "symmetry" if name in SYMMETRIES or OTHER_REPRESENTATION.fullmatch(name) else None
