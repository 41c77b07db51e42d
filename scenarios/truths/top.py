"""Lagrange's top: a body of revolution spins on a tip that a floor of infinite friction holds.

L is the angular momentum about the tip, r the vector from the tip to the centre of mass, of length l, n = r/l, and A and C the moments of
inertia about the tip across n and along n:

    dL/dt = r × M g        dq/dt = ½ ω q        ω = L/A + (1/C - 1/A) (L·n) n

With the angle θ between n and the vertical, a steady precession at the rate Ω has A Ω² cos θ - C ω·n Ω + M g l = 0. The general motion is a
precession with nutation; its angles are elliptic integrals of the third kind. Here the equations are integrated numerically.

Source: J. L. Lagrange, Mécanique analytique (1788); E. T. Whittaker, Analytical Dynamics, sections 71 to 73; E. Hairer, S. P. Nørsett &
G. Wanner, Solving Ordinary Differential Equations I (1993), section II.5, for the integrator DOP853.
Valid for: a body that touches the floor with one corner, which is at rest, with equal moments of inertia across the line from this corner
to the centre of mass; infinite friction, gravity straight down, no damping; until the floor would have to pull or another corner touches
it.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios.model import TOUCHING, Scenario
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY, Array
from dropspin.scenarios.surfaces import Floor
from dropspin.scenarios.truths.truth import Truth

EQUAL = 1e-12
"""Largest difference of moments of inertia, relative to the largest, up to which they count as equal."""
AT_REST = 1e-12
"""Speed of the tip that counts as rest, relative to that of the centre of mass."""
RTOL, ATOL = 3e-14, 1e-15
"""Tolerances of the integrator, close to the least that double precision allows; the motion is then exact to about 1e-12."""
SAMPLES_PER_STEP = 16
"""Times in a step of the integrator at which the contact is verified."""


def top(scene: Scenario, floor: Floor) -> Truth | None:
    """The exact solution of a top on a corner; None if the scene is no such top."""
    start, body = scene.initial_state, scene.body
    if floor.friction != "infinite" or not scene.falls_straight_down:
        return None
    if any(body.semi_axes) or not scene.starts_on_floor or not start[SPIN].any():
        return None
    heights = rotate(start[ORIENTATION], body.vertices)[:, 1]
    lowest = np.flatnonzero(heights <= heights.min() + TOUCHING * body.size)
    if len(lowest) != 1:
        return None
    arm = -body.vertices[lowest[0]]  # from the tip to the centre of mass, in the body
    length = float(np.linalg.norm(arm))
    axis = arm / length
    along = float(axis @ body.inertia_tensor @ axis)
    across = 0.5 * (float(np.trace(body.inertia_tensor)) - along)
    symmetric = across * np.eye(3) + (along - across) * np.outer(axis, axis)
    if np.abs(body.inertia_tensor - symmetric).max() > EQUAL * max(along, across):
        return None
    tip_velocity = start[VELOCITY] - np.cross(start[SPIN], rotate(start[ORIENTATION], arm))
    if np.linalg.norm(tip_velocity) > AT_REST * max(float(np.linalg.norm(start[VELOCITY])), float(np.linalg.norm(start[SPIN])) * length):
        return None
    found = _integrated(scene, arm, along, across + body.mass * length**2, np.delete(body.vertices, lowest[0], axis=0))
    return found if found.horizon > 0.0 else None


def _integrated(scene: Scenario, arm: Array, along: float, across: float, others: Array) -> Truth:
    """The solution from the moments C (`along`) and A (`across`) about the tip, and the corners that are not the tip."""
    from scipy.integrate import solve_ivp

    start, weight = scene.initial_state, scene.body.mass * scene.acceleration
    axis = arm / float(np.linalg.norm(arm))
    tip = start[POSITION] - rotate(start[ORIENTATION], arm)

    def spin_of(orientation: Array, momentum: Array) -> Array:
        n = rotate(orientation, axis)
        found: Array = momentum / across + (1.0 / along - 1.0 / across) * np.sum(momentum * n, axis=-1, keepdims=True) * n
        return found

    body_arm, body_axis, force = arm.tolist(), axis.tolist(), weight.tolist()

    def rates(t: float, y: Array) -> Array:
        """dq/dt and dL/dt, in numbers: arrays of three take seven times as long, and the integrator needs ten thousand of them."""
        *q, x, y_, z = y.tolist()
        momentum, n = (x, y_, z), _rotated(q, body_axis)
        faster = (1.0 / along - 1.0 / across) * (x * n[0] + y_ * n[1] + z * n[2])
        spin = [part / across + faster * direction for part, direction in zip(momentum, n, strict=True)]
        turning = [0.5 * (q[3] * rate + other) for rate, other in zip(spin, _cross(spin, q), strict=True)]
        scalar = -0.5 * (spin[2] * q[2] + spin[0] * q[0] + spin[1] * q[1])
        return np.array([*turning, scalar, *_cross(_rotated(q, body_arm), force)])

    n = rotate(start[ORIENTATION], axis)
    momentum = across * start[SPIN] + (along - across) * (start[SPIN] @ n) * n
    solved = solve_ivp(
        rates,
        (0.0, scene.duration * (1.0 + 1e-9)),
        np.concatenate([start[ORIENTATION], momentum]),
        method="DOP853",
        rtol=RTOL,
        atol=ATOL,
        dense_output=True,
    )
    solution = solved.sol

    def states(t: Array) -> Array:
        y = solution(t).T
        orientation = y[:, :4] / np.linalg.norm(y[:, :4], axis=1, keepdims=True)
        spin, r = spin_of(orientation, y[:, 4:]), rotate(orientation, arm)
        return np.hstack([tip + r, orientation, np.cross(spin, r), spin])

    def is_held(t: Array) -> NDArray[np.bool_]:
        """Whether the floor pushes, and no other corner touches it, at times [s], shape (n,)."""
        rows, y = states(t), solution(t).T
        spin, r, n = rows[:, SPIN], rotate(rows[:, ORIENTATION], arm), rotate(rows[:, ORIENTATION], axis)
        turning = np.cross(spin, n) * np.sum(y[:, 4:] * n, axis=1, keepdims=True)
        change = np.cross(r, weight) / across + (1.0 / along - 1.0 / across) * turning  # of ω; r × M g is across n
        acceleration = np.cross(change, r) + np.cross(spin, np.cross(spin, r))
        lowest = np.min([rows[:, 1] + rotate(rows[:, ORIENTATION], corner)[:, 1] for corner in others], axis=0)
        held: NDArray[np.bool_] = (acceleration[:, 1] > scene.acceleration[1]) & (lowest > tip[1])
        return held

    # The integrator takes short steps where the motion is fast.
    between = np.linspace(0.0, 1.0, SAMPLES_PER_STEP, endpoint=False)
    times = np.append((solved.t[:-1, None] + between * np.diff(solved.t)[:, None]).ravel(), solved.t[-1])
    held = is_held(times)
    horizon = scene.duration if held.all() else float(times[max(0, int(np.argmin(held)) - 1)])
    ends = "" if held.all() else "the tip lifts off the floor, or another corner strikes the floor"
    statement = "equations of Lagrange's top (1788), integrated numerically (DOP853)"
    return Truth("top", statement, states, horizon=min(horizon, scene.duration) if solved.success else 0.0, ends=ends)


def _cross(a: Sequence[float], b: Sequence[float]) -> tuple[float, float, float]:
    """A × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def _rotated(q: Sequence[float], vector: Sequence[float]) -> list[float]:
    """`rotate` of one vector."""
    twice = [2.0 * part for part in _cross(q, vector)]
    return [part + q[3] * turn + other for part, turn, other in zip(vector, twice, _cross(q, twice), strict=True)]
