"""Trajectories: the states of a body over time."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, STATE_COLUMNS, VELOCITY, Array

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The motion of a body, in the world frame.

    Attributes:
        t: Times [s], shape (n,).
        position: Centre of mass [m], shape (n, 3).
        orientation: Unit quaternions [x, y, z, w], body to world, shape (n, 4).
        velocity: Velocity of the centre of mass [m/s], shape (n, 3).
        angular_velocity: Angular velocity [rad/s], shape (n, 3).
        velocity_lag: Time by which velocities lag positions [s]: half a time step under semi-implicit Euler, otherwise mostly 0.
    """

    t: Array
    position: Array
    orientation: Array
    velocity: Array
    angular_velocity: Array
    velocity_lag: float = 0.0

    @classmethod
    def from_states(cls, t: Array, states: Array, velocity_lag: float = 0.0) -> Self:
        """A trajectory from states (position, orientation, velocity, angular velocity), shape (n, 13), without copying them."""
        motion = cls(t, states[:, POSITION], states[:, ORIENTATION], states[:, VELOCITY], states[:, SPIN], velocity_lag)
        vars(motion)["states"] = states
        return motion

    @cached_property
    def states(self) -> Array:
        """All states, shape (n, 13)."""
        return np.hstack([self.position, self.orientation, self.velocity, self.angular_velocity])

    def __reduce__(self) -> tuple[Callable[..., Self], tuple[Array, Array, float]]:
        """Pickled as one array, in half of the time that four take."""
        return type(self).from_states, (self.t, self.states, self.velocity_lag)

    def to_frame(self) -> "pd.DataFrame":
        """A table with a row for each time and a column for each of the 13 components, such as `position_y` and `orientation_w`.

        Returns:
            A pandas DataFrame; its index is the time `t` [s].
        """
        import pandas as pd

        return pd.DataFrame(self.states, index=pd.Index(self.t, name="t"), columns=list(STATE_COLUMNS))

    def __repr__(self) -> str:
        if len(self) == 0:
            return "<Trajectory: no states>"
        return f"<Trajectory: {len(self)} states from t = {self.t[0]:.3g} s to {self.t[-1]:.3g} s>"

    def __len__(self) -> int:
        return len(self.t)

    def __getitem__(self, rows: slice | NDArray[np.bool_] | NDArray[np.intp]) -> Self:
        """The motion at some of its times."""
        return self.from_states(self.t[rows], self.states[rows], self.velocity_lag)

    @property
    def first_bad_row(self) -> int | None:
        """The number of the first row with a value that is not finite, or None."""
        finite = np.isfinite(self.states)
        return None if finite.all() else int(np.argmin(finite.all(axis=1)))
