"""Contacts of a motion: sequences of time steps in which the floor acts, distinguished from accelerations that are wrong in flight.

A change of velocity that gravity does not explain may come from the floor, or from a wrong acceleration: gravity of another size or
direction, drag, wind, time steps of varying length, rounding. The floor carries the body, so it acts in steps in which

    the lowest point is on the floor, or the fall does not gain speed,

and a sequence of such steps is a contact if the lowest point is on the floor in it, or if it takes a quarter of the speed of the fall, at
any height. An inelastic impact on the end of a uniform rod, whose effective mass is a quarter of the rod's, takes as much.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios.state import Array

Mask = NDArray[np.bool_]
RowNumbers = NDArray[np.intp]

STEADY = 0.1
"""A change of the vertical velocity in a step, over that by gravity, up to which the speed of the fall counts as constant."""
STOPPED = 0.25
"""The share of the speed of the fall that a contact above the floor takes at least."""
RESOLVED = 2.0
"""The change of the vertical velocity in a contact above the floor, over that by gravity in a step, is larger than this."""


class ContactRuns(NamedTuple):
    """The contacts of B motions, each of shape (k,); those of a motion are in the order of time.

    Attributes:
        motion: The number of the motion.
        before: The last row before the contact.
        after: The first row after it, or the last row.
    """

    motion: RowNumbers
    before: RowNumbers
    after: RowNumbers

    @property
    def steps(self) -> tuple[RowNumbers, RowNumbers, RowNumbers]:
        """For each time step of a contact: the numbers of the motion, of the step, and of the contact."""
        lengths = self.after - self.before
        number = np.repeat(np.arange(len(lengths)), lengths)
        within = np.arange(len(number)) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        return self.motion[number], self.before[number] + within, number


def contact_runs(touching: Mask, vertical_velocity: Array, on_floor: Mask, fall: Array) -> ContactRuns:
    """The contacts of B motions.

    Args:
        touching: For each step, whether gravity does not explain the change of velocity, shape (B, n - 1).
        vertical_velocity: At each row [m/s], shape (B, n).
        on_floor: Whether the lowest point is on or below the floor at each row, shape (B, n).
        fall: The speed of fall that gravity adds in a step [m/s], shape (B,).
    """
    rise, steady = np.diff(vertical_velocity, axis=-1), STEADY * fall[:, np.newaxis]
    low = touching & (on_floor[:, :-1] | on_floor[:, 1:])
    held = low | (touching & (rise >= -steady))
    stopped = low | (touching & (rise > steady))
    # With a step without contact before and after each motion, the edges are the beginnings and ends of runs in turn.
    edges = np.flatnonzero(np.diff(_padded(held).ravel())).reshape(-1, 2)
    if not len(edges):
        return ContactRuns(*np.empty((3, 0), dtype=np.intp))
    width = touching.shape[1] + 2
    places = np.where(_padded(stopped), np.arange(width * len(touching)).reshape(-1, width), width * len(touching)).ravel()
    begins = np.minimum.reduceat(places, edges[:, 0] + 1)
    is_low = np.logical_or.reduceat(_padded(low).ravel(), edges[:, 0] + 1)
    ends = edges[:, 1]
    begun = begins <= ends
    motion, before, after = begins[begun] // width, begins[begun] % width - 1, ends[begun] % width
    speed = vertical_velocity[motion, before]
    least = np.maximum(STOPPED * np.abs(speed), RESOLVED * fall[motion])
    counts = is_low[begun] | (vertical_velocity[motion, after] - speed > least)
    return ContactRuns(motion[counts], before[counts], after[counts])


def _padded(steps: Mask) -> Mask:
    return np.pad(steps, ((0, 0), (1, 1)))
