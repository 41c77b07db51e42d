"""The type of a reference, an exact solution or a measured motion: the motion, its impacts, and the time up to which it is valid."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dropspin.scenarios.state import Array
from dropspin.scenarios.trajectory import Trajectory

States = Callable[[Array], Array]
"""A function from times [s], shape (n,), to states, shape (n, 13)."""
EXACT, RECORDED = "exact solution", "recording"
"""What a reference is, in words, and its label in plots and replays."""


@dataclass(frozen=True, eq=False)
class Impact:
    """An impact on the floor or a wall.

    Attributes:
        time: Time of the impact [s].
        before: State just before the impact, shape (13,).
        after: State just after the impact, shape (13,).
        wall: The number of the wall; None for the floor.
    """

    time: float
    before: Array
    after: Array
    wall: int | None = None


def impacts_of(times: Array, before: Array, after: Array) -> tuple[Impact, ...]:
    """The impacts at times [s], shape (n,), with the states before and after them, shapes (n, 13)."""
    return tuple(Impact(float(time), *states) for time, *states in zip(times, before, after, strict=True))


def piece(begins: Array, t: Array) -> NDArray[np.intp]:
    """The number of the piece of a motion at each time; the time at which a piece begins belongs to the one before it."""
    return np.maximum(np.searchsorted(begins, t, side="left") - 1, 0)


@dataclass(frozen=True, eq=False)
class Truth:
    """The exact motion of a scene, or a measured one.

    Attributes:
        name: Short name, as in the column `truth` of the results.
        statement: A sentence with the formula and its source.
        states: Function that returns the states, shape (n, 13), at times of shape (n,).
        events: The impacts within the scene's duration, in order.
        horizon: Time up to which the solution is valid [s].
        ends: The reason why the solution is not valid after the horizon, if the horizon is before the end of the scene.
        frames: The times at which a measured motion is known [s], shape (n,); None for an exact solution, which is known at all times.
    """

    name: str
    statement: str
    states: States
    events: tuple[Impact, ...] = ()
    horizon: float = float("inf")
    ends: str = ""
    frames: Array | None = None

    @property
    def is_exact(self) -> bool:
        """Whether the motion is an exact solution, not a measured one."""
        return self.frames is None

    @property
    def word(self) -> str:
        """The word for the motion in texts: `exact solution` or `recording`."""
        return EXACT if self.is_exact else RECORDED

    def covers(self, t: Array) -> NDArray[np.bool_]:
        """For each time [s], whether it is at most the horizon; with a margin for the rounding of n dt."""
        return t <= self.horizon * (1.0 + 1e-9)

    def covers_all(self, duration: float) -> bool:
        """Whether the solution is valid for the whole of a scene with this duration [s]."""
        return bool(self.covers(np.array([duration]))[0])

    def after(self, delay: float) -> "Truth":
        """The same motion with its time origin at `delay` [s], which must not be after the first impact."""
        later = tuple(replace(event, time=event.time - delay) for event in self.events)
        frames = None if self.frames is None else self.frames - delay
        return replace(self, states=lambda t: self.states(t + delay), events=later, horizon=self.horizon - delay, frames=frames)

    def __call__(self, times: ArrayLike) -> Trajectory:
        """The motion at times [s] from 0 to `horizon`, shape (n,).

        Raises:
            ValueError: A time is outside this range.
        """
        t = np.atleast_1d(np.asarray(times, dtype=float))
        if not np.all((t >= 0.0) & self.covers(t)):
            raise ValueError(f"the {self.word} {self.name!r} is valid for 0 <= t <= {self.horizon:.6g} s")
        return Trajectory.from_states(t, self.states(t))
