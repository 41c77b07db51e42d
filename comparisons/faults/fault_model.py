"""A fault that an adapter may have: the scene that it simulates instead, the states that it reports instead, and the message."""

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from dropspin.scenarios import DropspinError, Scenario, truth_for
from dropspin.scenarios.state import ORIENTATION, Array
from dropspin.scenarios.variations import with_values

Simulated = Callable[[Scenario], Scenario]
"""From the scene given to an adapter to the one that it simulates."""
Reported = Callable[[Array], Array]
"""From states to those that an adapter reports, shape (n, 13)."""
Change = Callable[[Array, Array], Array]
"""From the orientations of states and a part of them to the changed part."""


def unchanged(given: Any) -> Any:
    """The scene, or the states, as given."""
    return given


class FaultModel(NamedTuple):
    """One fault.

    Attributes:
        message: The fault, and what is expected.
        simulated: The scene that is simulated instead.
        reported: The states that are reported instead, shape (n, 13).
        is_peculiarity: Whether it is a peculiarity of the engine, not a fault of its adapter.
        about: What it is a fault of; two faults of the same thing are not combined.
    """

    message: str
    simulated: Simulated = unchanged
    reported: Reported = unchanged
    is_peculiarity: bool = False
    about: str = ""

    def motion(self, scene: Scenario, times: Array) -> Array | None:
        """The states of a scene with this fault at some times [s], shape (n, 13); None without an exact solution."""
        try:
            states = _exact_states(self.simulated(scene), tuple(times.tolist()))
        except (DropspinError, ValueError):  # the body is impossible, or starts below the floor
            return None
        return None if states is None else self.reported(states)

    def start(self, scene: Scenario) -> Array:
        """The state at the start with this fault, shape (13,)."""
        return self.reported(self.simulated(scene).initial_state[None])[0]

    def and_also(self, other: "FaultModel") -> "FaultModel":
        """Both faults together."""
        return FaultModel(
            f"{self.message}; and {other.message}",
            lambda scene: other.simulated(self.simulated(scene)),
            lambda states: self.reported(other.reported(states)),  # the reverse order
            is_peculiarity=self.is_peculiarity and other.is_peculiarity,
        )


@lru_cache(maxsize=4096)  # many faults simulate the same scene
def _exact_states(scene: Scenario, times: tuple[float, ...]) -> Array | None:
    truth, t = truth_for(scene), np.array(times)
    return None if truth is None or not truth.covers(t).all() else truth(t).states


def changed_table(table: str, **values: Any) -> Simulated:
    """The scene with some values of a table changed, if it has that table; a callable is applied to the old value."""
    return lambda scene: with_values(scene, table, **values)


def changed_start(change: Reported) -> Simulated:
    """The scene with its start changed like a state."""
    return lambda scene: scene.starting_at(change(scene.initial_state[None])[0])


def changed_part(part: slice, change: Change) -> Reported:
    """States with a part changed, by a function of the orientations and of the part."""

    def changed(states: Array) -> Array:
        states = states.copy()
        states[:, part] = change(states[:, ORIENTATION], states[:, part])
        return states

    return changed
