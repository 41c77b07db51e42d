"""What a truth is: the exact motion, the impacts in it, and until when it holds."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scenarios.trajectory import Trajectory

Array = NDArray[np.float64]
States = Callable[[Array], Array]
"""Times [s], shape (n,), to states, shape (n, 13)."""


@dataclass(frozen=True, eq=False)
class Impact:
    """One collision with the floor.

    Attributes:
        time: When [s].
        before: State just before, shape (13,).
        after: State just after, shape (13,).
    """

    time: float
    before: Array
    after: Array


@dataclass(frozen=True, eq=False)
class Truth:
    """The exact motion of a scene.

    Attributes:
        name: Short name, as in the results' column `truth`.
        statement: The formula and its source, one sentence.
        states: Times, shape (n,), to states, shape (n, 13).
        events: The impacts within the scene's duration, in order.
        horizon: Until when the formula holds [s].
    """

    name: str
    statement: str
    states: States
    events: tuple[Impact, ...] = ()
    horizon: float = float("inf")

    def covers(self, t: Array) -> NDArray[np.bool_]:
        """Which times [s] are not past the horizon; the last of n dt may round past it."""
        return t <= self.horizon * (1.0 + 1e-9)

    def after(self, delay: float) -> "Truth":
        """The rest of the motion, from a moment on that is not beyond the first impact [s]."""
        later = tuple(replace(event, time=event.time - delay) for event in self.events)
        return replace(self, states=lambda t: self.states(t + delay), events=later, horizon=self.horizon - delay)

    def __call__(self, times: ArrayLike) -> Trajectory:
        """The motion at times [s] from 0 to `horizon`, shape (n,).

        Raises:
            ValueError: A time lies outside.
        """
        t = np.atleast_1d(np.asarray(times, dtype=float))
        if not np.all((t >= 0.0) & self.covers(t)):
            raise ValueError(f"the truth {self.name!r} holds for 0 <= t <= {self.horizon:.6g} s")
        return Trajectory.from_states(t, self.states(t))
