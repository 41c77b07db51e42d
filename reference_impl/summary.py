"""What became of each of many bodies, in one pass over their recorded motions: energy, contact, rebound, rest.

Definitions are those of the metrics of the same names; here they are worked out at some 20 ns a row, so that a study of a million
motions costs what the motions cost.
"""

from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference_impl.kernels import compile_cached
from reference_impl.quaternion import rotation_matrix, to_body
from reference_impl.vectors import Mat3, Quat, Vec3, compiled, dot, row

Array = NDArray[np.float64]

FIGURES = ("energy_drift", "energy_gain", "penetration", "rebound", "rest_time")


class Moved(NamedTuple):
    """The bodies that moved, one row each; what is alike for all may be given once.

    Attributes:
        mass: [kg], shape (B,).
        inertia: In the body frame [kg m²], shape (B, 3, 3).
        points: Vertices from the centre of mass [m], shape (B, n, 3) or (1, n, 3).
        radius: Rounding of the vertices [m], shape (B,).
        size: The farthest that any part is from the centre of mass [m], shape (B,).
        origin: Where potential energy is 0 [m], shape (B, 3).
        clearance: Height of the lowest point at the start [m], shape (B,).
        gravity: [m/s²], shape (B, 3).
        damping: Decay rate of velocity [1/s], shape (B,).
        dt: Time between two rows [s], shape (B,).
        lag: How far velocities lag positions [s], shape (B,).
        rows: How many rows of each motion count, shape (B,).
    """

    mass: Array
    inertia: Array
    points: Array
    radius: Array
    size: Array
    origin: Array
    clearance: Array
    gravity: Array
    damping: Array
    dt: Array
    lag: Array
    rows: NDArray[np.int64]


TOUCHING = 1e-9  # of the body's size: how near to the floor counts as on it
UNIT = 1e-5  # how far a quaternion's length may be from 1


def summarise(motions: Array, moved: Moved, floor: bool, damped: bool) -> tuple[Array, NDArray[np.int64]]:
    """Figures of each motion, in the order of `FIGURES`, and its first row that is no state: not finite, or without an attitude.

    Args:
        motions: States, shape (B, n, 13).
        moved: What moved.
        floor: Whether there is one; without, nothing is penetrated.
        damped: Whether energy is meant to decay; its drift and gain say nothing then.

    Returns:
        Figures, shape (B, 5), NaN where one does not apply or a row is no state; rows, shape (B,), -1 where all are states.
    """
    figures, bad = np.full((len(motions), len(FIGURES)), np.nan), np.full(len(motions), -1)
    _kernel()(figures, bad, motions, moved, floor, damped)
    return figures, bad


@cache
def _kernel() -> Any:
    return compile_cached(_summarise)


def _summarise(figures, bad, motions, moved, floor, damped):
    for body in range(motions.shape[0]):
        states = motions[body, : moved.rows[body]]
        bad[body] = _first_bad_row(states)
        if bad[body] >= 0:
            continue
        size, dt, g = moved.size[body], moved.dt[body], row(moved.gravity, body)
        flies = not floor or moved.clearance[body] > TOUCHING * size
        contact, apart = _first_contact(states, dt, g, moved.damping[body]) if floor else (-1, -1)
        height = moved.clearance[body] if floor and flies else size
        drift, gain, scale, last_in_motion = _energies(states, moved, body, contact, height)
        if not damped and scale > 0.0:
            figures[body, 0] = drift / scale if flies else np.nan
            figures[body, 1] = gain / scale
        if floor:
            points = moved.points[min(body, moved.points.shape[0] - 1)]
            figures[body, 2] = _depth(states, points, moved.radius[body], size)
        figures[body, 3] = states[apart:, 1].max() / states[0, 1] if contact >= 0 else 0.0
        figures[body, 4] = last_in_motion * dt


@compiled
def _first_bad_row(states):
    """The first that is no state, or -1."""
    for i in range(states.shape[0]):
        length = np.sqrt(states[i, 3] ** 2 + states[i, 4] ** 2 + states[i, 5] ** 2 + states[i, 6] ** 2)
        total = 0.0
        for k in range(13):
            total += 0.0 * states[i, k]  # NaN unless all are finite
        if not abs(length - 1.0 + total) <= UNIT:
            return i
    return -1


@compiled
def _first_contact(states, dt, g, damping):
    """The rows just before and just after the floor first changes the velocity by what neither gravity nor damping do; or -1."""
    before, noise, share = -1, 1e-3 * dt * np.sqrt(dot(g, g)), 1e-6 + 2.0 * dt * damping
    for i in range(states.shape[0] - 1):
        v, after = _velocity(states[i]), _velocity(states[i + 1])
        left = after - v - dt * g
        touches = np.sqrt(dot(left, left)) > noise + share * np.sqrt(dot(v, v))
        if before < 0 and touches:
            before = i
        if before >= 0 and not touches:
            return before, i
    return before, states.shape[0] - 1


@compiled
def _energies(states, moved, body, contact, height):
    """Energy's change up to contact, its largest rise, its scale [J], and the last row in motion; velocity synchronised with position."""
    m, mass, g, origin = moved.inertia[body], moved.mass[body], row(moved.gravity, body), row(moved.origin, body)
    inertia = Mat3(row(m, 0), row(m, 1), row(m, 2))
    weight = np.sqrt(dot(g, g))
    still = mass * max(2.0 * (weight * moved.dt[body]) ** 2, 1e-6 * weight * moved.size[body])
    first = drift = least = gain = scale = 0.0
    last_in_motion = 0
    for i in range(states.shape[0]):
        s = states[i]
        v, spin = _velocity(s), to_body(Quat(s[3], s[4], s[5], s[6]), Vec3(s[10], s[11], s[12]))
        kinetic = 0.5 * (mass * dot(v, v) + dot(spin, inertia @ spin))
        energy = kinetic - mass * dot(Vec3(s[0], s[1], s[2]) - origin, g) + moved.lag[body] * mass * dot(v, g)
        if i == 0:
            first = least = energy
            scale = max(mass * weight * height, kinetic)
        if contact < 0 or i <= contact:
            drift = energy - first
        gain = max(gain, energy - least)
        least = min(least, energy)
        if kinetic > still:
            last_in_motion = i
    return drift, gain, scale, last_in_motion


@compiled
def _depth(states, points, radius, size):
    """How far the lowest point comes below the floor [m]."""
    lowest = 0.0
    for i in range(states.shape[0]):
        s = states[i]
        if s[1] < size + lowest:  # or no part of the body can be as low
            up = rotation_matrix(Quat(s[3], s[4], s[5], s[6])).row2
            for k in range(points.shape[0]):
                lowest = min(lowest, s[1] + dot(up, row(points, k)) - radius)
    return 0.0 - lowest


@compiled
def _velocity(s):
    return Vec3(s[7], s[8], s[9])
