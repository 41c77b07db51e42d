"""Errors of motions that continue measured tosses, one of each kind for each toss."""

from typing import NamedTuple

import numpy as np

from dropspin.scenarios.bodies import Body
from dropspin.scenarios.rotations import angle_between_orientations, angle_between_vectors, dot, length, rotate, rotation_vector, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, UP, Array

LATER = 0.1
"""Time after the first frame that is not of the flight [s]."""
SAME_FACE = 0.35
"""Angle between the vertical in two body frames up to which the same side is down [rad]; faces of an icosahedron are 0.73 apart."""
AT_REST = 0.01
"""Distance, over the length of the body, and angle [rad] from its last mean pose within which a body rests, beside noise."""
RESTS_FOR, MEAN_OF = 0.05, 0.025
"""Time for which it does at least, and time of a mean pose [s]."""
OF_NOISE = 5.0
"""Standard deviations of each component by which noise may move a mean pose: three exceed that in 1.5 of 100,000 poses."""


TIMES = ("impact", "+0.1 s", "mean", "end")
"""When poses are compared."""


class Kind(NamedTuple):
    """A kind of error: the quantity, when it is compared, and the unit; `1` for the length of the body or the energy at the first frame."""

    quantity: str
    at: str
    unit: str


KINDS = (
    *(Kind("position", at, "1") for at in TIMES),
    *(Kind("orientation", at, "rad") for at in TIMES),
    Kind("energy", "mean", "1"),
    Kind("rest time", "end", "s"),
    Kind("same resting face", "end", "1"),
)
"""Of these "same resting face" is no error, but whether it is the same, 1 or 0. A motion that does not rest at the end of the record counts
as resting then, so that the error of the rest time may be larger."""


def body_length(body: Body) -> float:
    """The largest extent of a body along an axis of its frame [m]."""
    return float(np.max(np.ptp(body.vertices, axis=0) + 2.0 * body.semi_axes))


def errors(body: Body, gravity: float, offset: Array, white: Array, t: Array, measured: Array, found: Array) -> Array:
    """The errors of each toss, shape (m, kinds); NaN where a toss is too short or does not come to rest.

    Args:
        body: The body.
        gravity: [m/s²].
        offset: The tracked point from the centre of mass, in the body frame [m], shape (3,).
        white: Standard deviations of the white noise of a frame: of position [m] and rotation vector [rad], shape (m, 6).
        t: Times of the frames [s], shape (m, n), the first one at the end of the flight; NaN beyond the end of a toss.
        measured: Poses of the tracked point, shape (m, n, 7).
        found: The same of the motions.
    """
    size, rows = body_length(body), np.arange(len(t))
    distance = length(found[..., POSITION] - measured[..., POSITION]) / size
    angle = angle_between_orientations(found[..., ORIENTATION], measured[..., ORIENTATION])
    last = np.isfinite(t).sum(axis=1) - 1
    later = np.argmax(t >= t[:, 1:2] + LATER - 1e-9, axis=1)
    columns = []
    for error in (distance, angle):
        columns += [error[:, 1], np.where(later > 0, error[rows, later], np.nan), np.nanmean(error[:, 1:], axis=1), error[rows, last]]
    energies = [_energy(body, gravity, offset, t, motion) for motion in (measured, found)]
    columns.append(np.nanmean(np.abs(energies[1] - energies[0]), axis=1) / energies[0][:, 0])
    rests = [_rest(size, white, t, motion, last) for motion in (measured, found)]
    columns.append(np.abs(np.where(np.isfinite(rests[1]), rests[1], t[rows, last]) - rests[0]))
    down = [unrotate(motion[rows, last][:, ORIENTATION], UP) for motion in (measured, found)]
    columns.append(np.where(np.isfinite(rests[0]), angle_between_vectors(*down) < SAME_FACE, np.nan))
    return np.stack(columns, axis=1)


def _energy(body: Body, gravity: float, offset: Array, t: Array, motion: Array) -> Array:
    """Kinetic and potential energy between frames [J], shape (m, n - 1), by differences."""
    orientation, dt = motion[..., ORIENTATION], np.diff(t)[..., np.newaxis]
    centre = motion[..., POSITION] - rotate(orientation, offset)
    velocity = np.diff(centre, axis=1) / dt
    spin = unrotate(orientation[:, 1:], rotation_vector(orientation[:, :-1], orientation[:, 1:]) / dt)
    heights = 0.5 * (centre[:, 1:, 1] + centre[:, :-1, 1])
    return 0.5 * body.mass * dot(velocity, velocity) + 0.5 * dot(spin @ body.inertia_tensor, spin) + body.mass * gravity * heights


def _rest(size: float, white: Array, t: Array, motion: Array, last: Array) -> Array:
    """The time from which on the mean pose of a body stays at its last one [s], shape (m,); NaN if that is not long before the end."""
    rows, count = np.arange(len(t)), min(t.shape[1], max(1, round(MEAN_OF / float(np.nanmedian(np.diff(t))))))
    turns = rotation_vector(motion[rows, last][:, np.newaxis, ORIENTATION], motion[..., ORIENTATION])
    poses = np.concatenate([motion[..., POSITION] / size, turns], axis=-1)
    means, final = np.lib.stride_tricks.sliding_window_view(poses, count, axis=1).mean(axis=-1), np.maximum(last - count + 1, 0)
    moved = length((means - means[rows, final][:, np.newaxis]).reshape(*means.shape[:2], 2, 3))
    allowed = AT_REST + OF_NOISE * np.sqrt(2.0 / count) * white[:, [0, 3]] / [size, 1.0]
    moves = (moved > allowed[:, np.newaxis]).any(axis=-1)
    first = np.where(moves, np.arange(moves.shape[1]), -1).max(axis=1) + 1
    rests = t[rows, np.minimum(first, final)]
    return np.where(rests <= t[rows, last] - RESTS_FOR, rests, np.nan)
