"""Energy, angular momentum, apex and lowest point of a scene's body along a trajectory; principal axes of an inertia tensor."""

import numpy as np
from numpy.typing import NDArray

from scenarios.model import Scenario
from scenarios.rotations import dot, rotate, unrotate
from scenarios.trajectory import Trajectory

Array = NDArray[np.float64]


def angular_momentum(scene: Scenario, motion: Trajectory) -> Array:
    """L = R I Rᵀ ω about the centre of mass, world frame [kg m²/s], shape (n, 3); I ω, independent of R, for three equal moments."""
    inertia = scene.body.inertia_tensor
    if np.array_equal(inertia, inertia[0, 0] * np.eye(3)):
        return inertia[0, 0] * motion.angular_velocity
    spin = unrotate(motion.orientation, motion.angular_velocity)
    return rotate(motion.orientation, spin @ inertia)


def kinetic_energy(scene: Scenario, motion: Trajectory) -> Array:
    """M v²/2 + ω·L/2 [J], shape (n,)."""
    linear = 0.5 * scene.body.mass * dot(motion.velocity, motion.velocity)
    return linear + 0.5 * dot(motion.angular_velocity, angular_momentum(scene, motion))


def energy(scene: Scenario, motion: Trajectory, synchronised: bool = True) -> Array:
    """Kinetic plus potential energy [J], shape (n,). Potential energy is 0 at rest on the floor, or at the start without a floor.

    The synchronised energy takes a staggered engine's velocity at the time of its position, to first order: E* = E + lag M g·v.
    Semi-implicit Euler conserves E* exactly in free fall, and E only to first order in dt.
    """
    mass, g = scene.body.mass, scene.acceleration
    origin = np.array([0.0, scene.body.resting_height, 0.0]) if scene.floor else np.array(scene.start.position)
    total = kinetic_energy(scene, motion) - mass * (motion.position - origin) @ g
    return total + motion.velocity_lag * mass * motion.velocity @ g if synchronised else total


def apex(scene: Scenario, motion: Trajectory) -> Array:
    """Height of the apex of a flight [m], v_y²/2g + y, from each of its states, shape (n,); gravity points straight down."""
    v = motion.velocity[:, 1]
    return v * v / (-2.0 * scene.acceleration[1]) + motion.position[:, 1] - motion.velocity_lag * v


def lowest_height(scene: Scenario, motion: Trajectory) -> Array:
    """Height of the body's lowest point above the floor [m], shape (n,)."""
    corners = rotate(motion.orientation[:, None, :], scene.body.vertices[None, :, :])
    return motion.position[:, 1] + corners[:, :, 1].min(axis=1) - scene.body.rounding


def is_diagonal(tensor: Array) -> bool:
    """Whether the body axes are principal axes exactly."""
    return np.count_nonzero(tensor - np.diag(np.diag(tensor))) == 0


def principal_axes(inertia: Array) -> tuple[Array, Array]:
    """Principal moments and axes (columns, right-handed): the body axes of a diagonal tensor, else in ascending order of the moments."""
    if is_diagonal(inertia):
        return np.diag(inertia).copy(), np.eye(3)
    moments, axes = np.linalg.eigh(inertia)
    return moments, axes * np.linalg.det(axes)
