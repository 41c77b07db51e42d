"""Energy, angular momentum, apex and lowest point of a scene's body along a trajectory.

Functions of a scene and a motion call the functions whose names end in `_of`. The latter contain the formulas, for the components of one
state or of arrays of states. They use plain arithmetic only, so that they can be compiled for many bodies with bit-identical results.
"""

from typing import Any

import numpy as np

from dropspin.scenarios.model import Scenario
from dropspin.scenarios.state import Array
from dropspin.scenarios.trajectory import Trajectory

Components = tuple[Any, ...]
"""The components of a vector or quaternion, each a number or an array. A tensor is a tuple of its rows."""


def angular_momentum(scene: Scenario, motion: Trajectory) -> Array:
    """L = R I Rᵀ ω about the centre of mass, world frame [kg m²/s], shape (n, 3)."""
    momentum = angular_momentum_of(_tensor(scene), _components(motion.orientation), _components(motion.angular_velocity))
    return np.stack(momentum, axis=-1)


def angular_momentum_of(inertia: Components, orientation: Components, spin: Components) -> Components:
    """L = R I Rᵀ ω. If I is a multiple of the unit tensor, this is I ω, computed without the orientation."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = inertia
    if xx == yy == zz and xy == xz == yx == yz == zx == zy == 0.0:
        return xx * spin[0], xx * spin[1], xx * spin[2]
    x, y, z, w = orientation
    a, b, c = rotated((-x, -y, -z, w), spin)
    return rotated(orientation, (a * xx + b * yx + c * zx, a * xy + b * yy + c * zy, a * xz + b * yz + c * zz))


def kinetic_energy(scene: Scenario, motion: Trajectory) -> Array:
    """M v²/2 + ω·L/2 [J], shape (n,)."""
    orientation, velocity, spin = map(_components, (motion.orientation, motion.velocity, motion.angular_velocity))
    return kinetic_energy_of(scene.body.mass, _tensor(scene), orientation, velocity, spin)


def kinetic_energy_of(mass: float, inertia: Components, orientation: Components, velocity: Components, spin: Components) -> Any:
    """M v²/2 + ω·L/2."""
    momentum = angular_momentum_of(inertia, orientation, spin)
    return 0.5 * mass * scalar_product(velocity, velocity) + 0.5 * scalar_product(spin, momentum)


def energy(scene: Scenario, motion: Trajectory, synchronised: bool = True, kinetic: Array | None = None) -> Array:
    """Kinetic plus potential energy [J], shape (n,). Potential energy is 0 at rest on the floor, or at the start without a floor.

    The synchronised energy takes the velocity at the time of the position, to first order: E* = E + lag M g·v.
    Semi-implicit Euler conserves E* exactly in free fall, and E only to first order in dt. `kinetic` is the kinetic energy [J], if it was
    already computed.
    """
    position, velocity, origin, gravity = map(_components, (motion.position, motion.velocity, energy_origin(scene), scene.acceleration))
    lag = motion.velocity_lag if synchronised else 0.0
    kinetic = kinetic_energy(scene, motion) if kinetic is None else kinetic
    return energy_of(kinetic, scene.body.mass, position, velocity, origin, gravity, lag)


def energy_of(
    kinetic: Any, mass: float, position: Components, velocity: Components, origin: Components, gravity: Components, lag: float
) -> Any:
    """E* = E_kin - M g·(x - origin) + lag M g·v."""
    x, y, z = position
    vx, vy, vz = velocity
    raised = (mass * (x - origin[0]), mass * (y - origin[1]), mass * (z - origin[2]))
    lagging = (lag * mass * vx, lag * mass * vy, lag * mass * vz)
    return kinetic - scalar_product(raised, gravity) + scalar_product(lagging, gravity)


def energy_origin(scene: Scenario) -> Array:
    """The position of zero potential energy [m], shape (3,): that of rest on the floor, or the initial position."""
    return np.array([0.0, scene.body.resting_height, 0.0]) if scene.floor else np.array(scene.start.position)


def apex(scene: Scenario, motion: Trajectory) -> Array:
    """Height of the apex of a flight [m], v_y²/2g + y, computed from each of its states, shape (n,); gravity points straight down."""
    v = motion.velocity[:, 1]
    return v * v / (-2.0 * scene.acceleration[1]) + motion.position[:, 1] - motion.velocity_lag * v


def lowest_height(scene: Scenario, motion: Trajectory) -> Array:
    """Height of the body's lowest point above the floor [m], shape (n,)."""
    orientation, lowest = _components(motion.orientation), np.full(len(motion), np.inf)
    for vertex in scene.body.hull.tolist():
        np.minimum(lowest, offset_of(orientation, vertex), out=lowest)
    return motion.position[:, 1] + lowest - depth_of(orientation, tuple(scene.body.semi_axes.tolist()))


def offset_of(orientation: Components, vertex: Components) -> Any:
    """Height of a vertex above the centre of mass: the vertical component of `rotated`, without the two others."""
    x, y, z, w = orientation
    a, b, c = vertex
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return b + w * ty + (z * tx - x * tz)


def depth_of(orientation: Components, semi_axes: Components) -> Any:
    """Depth of the lowest point of an ellipsoid below its centre, |S n|: see `dropspin.scenarios.bodies.surface`."""
    a, b, c = semi_axes
    if a == b == c:
        return a
    x, y, z, w = orientation
    up = rotated((-x, -y, -z, w), (0.0, 1.0, 0.0))
    stretched = (a * up[0], b * up[1], c * up[2])
    return np.sqrt(scalar_product(stretched, stretched))


def rotated(orientation: Components, vector: Components) -> Components:
    """A body-frame vector in the world frame: `rotations.rotate` by components."""
    x, y, z, w = orientation
    a, b, c = vector
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return a + w * tx + (y * tz - z * ty), b + w * ty + (z * tx - x * tz), c + w * tz + (x * ty - y * tx)


def scalar_product(a: Components, b: Components) -> Any:
    """A · b, summed in the order of `rotations.dot`."""
    return a[0] * b[0] + a[2] * b[2] + a[1] * b[1]


FORMULAS = (angular_momentum_of, kinetic_energy_of, energy_of, offset_of, rotated, scalar_product, depth_of)
"""The functions that can be compiled."""


def _components(array: Array) -> Components:
    return tuple(array[..., component] for component in range(array.shape[-1]))


def _tensor(scene: Scenario) -> Components:
    return tuple(map(tuple, scene.body.inertia_tensor.tolist()))
