"""The layout of a state: 13 numbers, position [m], orientation [x, y, z, w], velocity [m/s], angular velocity [rad/s].

`dropspin.reference_impl.state`, which cannot import this package, defines the same layout; a test compares the two.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

POSITION = slice(0, 3)
ORIENTATION = slice(3, 7)
VELOCITY = slice(7, 10)
SPIN = slice(10, 13)
RATES = slice(7, 13)
"""Velocity and angular velocity together."""

UP = np.array([0.0, 1.0, 0.0])
"""The upward direction in the world frame, which is the normal of the floor."""

PARTS = {"position": POSITION, "orientation": ORIENTATION, "velocity": VELOCITY, "angular_velocity": SPIN}
STATE_COLUMNS = tuple(f"{name}_{axis}" for name, part in PARTS.items() for axis in "xyzw"[: part.stop - part.start])
"""The name of each number of a state in a table, such as `position_y`."""
