"""The Python boundary: flat float64 arrays in and out, value types in between."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reference_impl.contact import Floor
from reference_impl.step import advance
from reference_impl.vectors import Mat3, Quat, Vec3, compiled

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Body:
    """What moves: its mass, its inertia and the vertices that may touch the floor.

    Attributes:
        mass: M [kg].
        inertia: I_body about the centre of mass, in the body frame [kg m²], shape (3, 3).
        points: Vertices from the centre of mass, in the body frame [m], shape (n, 3).
        radius: Rounding of the vertices [m]: 0 for the note's own; a ball is one point at its centre, rounded by R.
    """

    mass: float
    inertia: Array
    points: Array
    radius: float = 0.0


@dataclass(frozen=True)
class World:
    """What acts on a body. A part that is None is not modelled and costs nothing.

    Attributes:
        gravity: g [m/s²], shape (3,).
        floor: The floor y = 0.
        damping: Decay rates of velocity and angular velocity [1/s]; Algorithm 1's factors are c = exp(-rate dt).
    """

    gravity: Array | None = None
    floor: Floor | None = None
    damping: tuple[float, float] | None = None


def step(state: ArrayLike, body: Body, world: World, dt: float, forces: ArrayLike | None = None) -> Array:
    """Advance one state by one step of the note's Algorithm 1.

    Args:
        state: Position [m], orientation [x, y, z, w], velocity [m/s], angular velocity [rad/s], shape (13,).
        body: The body.
        world: What acts on it.
        dt: Time step [s].
        forces: Force on each vertex, in the world frame [N], shape (n, 3) (eq 9). None: none.

    Returns:
        The next state, shape (13,).

    Source: H. Wang, Rigid Body Dynamics (lecture note), Algorithms 1 and 2.
    """
    on_vertices = None if forces is None else np.ascontiguousarray(forces, dtype=float)
    return _run(_as_state(state), body, world, dt, 1, 1, on_vertices)[1]


def simulate(state: ArrayLike, body: Body, world: World, dt: float, steps: int, every: int = 1) -> Array:
    """Advance one state by many steps, recording each `every`-th.

    Args:
        state: As in `step`, shape (13,).
        body: The body.
        world: What acts on it.
        dt: Time step [s].
        steps: Number of steps.
        every: Steps between two rows of the result. Left-over steps at the end are taken only up to the last row.

    Returns:
        The states, the start first, shape (1 + steps // every, 13).
    """
    return _run(_as_state(state), body, world, dt, steps, every, None)


class _KernelBody(NamedTuple):
    mass: float
    inverse_inertia: Mat3
    points: Array
    radius: float
    reach: float


class _KernelDamping(NamedTuple):
    linear: float
    angular: float


def _as_state(state: ArrayLike) -> Array:
    array = np.ascontiguousarray(state, dtype=float)
    if array.shape != (13,):
        raise ValueError(f"state must have shape (13,), got {array.shape}")
    return array


def _run(state: Array, body: Body, world: World, dt: float, steps: int, every: int, forces: Array | None) -> Array:
    points = np.ascontiguousarray(body.points, dtype=float)
    inverse = np.linalg.inv(body.inertia)
    # The margin covers the rounding of R: a vertex must never reach the floor before the bounding sphere does.
    reach = (math.sqrt(float(np.max(np.sum(points**2, axis=1)))) + body.radius) * (1.0 + 1e-12)
    kernel_body = _KernelBody(
        float(body.mass), Mat3(*(Vec3(*map(float, row)) for row in inverse)), points, float(body.radius), reach
    )
    gravity = None if world.gravity is None else Vec3(*map(float, world.gravity))
    damping = None if world.damping is None else _KernelDamping(*(math.exp(-rate * dt) for rate in world.damping))
    rows = np.empty((1 + steps // every, 13))
    _fill(rows, state, float(dt), every, kernel_body, gravity, forces, damping, world.floor)
    return rows


@compiled
def _fill(rows, state, dt, every, body, gravity, forces, damping, floor):
    x = Vec3(float(state[0]), float(state[1]), float(state[2]))
    q = Quat(float(state[3]), float(state[4]), float(state[5]), float(state[6]))
    v = Vec3(float(state[7]), float(state[8]), float(state[9]))
    w = Vec3(float(state[10]), float(state[11]), float(state[12]))
    rows[0] = state
    for row in range(1, rows.shape[0]):
        for _ in range(every):
            x, q, v, w = advance(x, q, v, w, dt, body, gravity, forces, damping, floor)
        out = rows[row]
        out[0], out[1], out[2] = x.x, x.y, x.z
        out[3], out[4], out[5], out[6] = q.x, q.y, q.z, q.w
        out[7], out[8], out[9] = v.x, v.y, v.z
        out[10], out[11], out[12] = w.x, w.y, w.z
