"""What moves and what acts on it: the public description, and the form that kernels take it in."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference_impl.quaternion import from_matrix
from reference_impl.vectors import Mat3, Quat, Vec3

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Body:
    """A rigid body: its mass, its inertia and the vertices that may touch the floor.

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


class Floor(NamedTuple):
    """What the floor y = 0 does to a vertex that hits it."""

    restitution: float
    """The note's µ, the field's e: separation speed over approach speed."""
    friction: float
    """Coulomb's coefficient: 0 for a frictionless floor (eq 15), infinity for one that sticks (eq 17)."""
    rest_speed: float = 0.0
    """Normal speed [m/s] below which restitution counts as 0 (section 3.2); 0 switches the rule off."""


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


class KernelBody(NamedTuple):
    """A body as the kernels see it."""

    mass: float
    inertia: Mat3
    inverse_inertia: Mat3
    moments: Vec3
    """Principal moments [kg m²], the one that differs most from the others last."""
    axes: Quat
    """From the principal frame to the body's."""
    points: Array
    radius: float
    reach: float
    """No part of the body is farther from its centre than this [m]."""


class KernelDamping(NamedTuple):
    """Algorithm 1's factors."""

    linear: float
    angular: float


def kernel_body(body: Body) -> KernelBody:
    """The kernels' form of a body.

    Raises:
        ValueError: It is no body: a mass that is not above 0, a singular inertia, a number that is not finite.
    """
    points = np.ascontiguousarray(body.points, dtype=float)
    inertia = np.asarray(body.inertia, dtype=float)
    if not (math.isfinite(body.mass) and body.mass > 0.0):
        raise ValueError(f"mass: got {body.mass!r}; must be a number above 0, in kg")
    if inertia.shape != (3, 3) or not np.isfinite(inertia).all() or np.linalg.eigvalsh(inertia)[0] <= 0.0:
        raise ValueError(f"inertia: got {inertia.tolist()}; must be a positive definite 3 x 3 matrix, in kg m²")
    if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0 or not np.isfinite(points).all():
        raise ValueError(f"points: got an array of shape {points.shape}; must be finite numbers of shape (n, 3), n at least 1")
    if not (math.isfinite(body.radius) and body.radius >= 0.0):
        raise ValueError(f"radius: got {body.radius!r}; must be 0 or more, in m")
    moments, axes = _principal(inertia)
    # The margin covers the rounding of R: a vertex must never reach the floor before the bounding sphere does.
    reach = (math.sqrt(float(np.max(np.sum(points**2, axis=1)))) + body.radius) * (1.0 + 1e-12)
    return KernelBody(
        float(body.mass),
        _mat3(inertia),
        _mat3(np.linalg.inv(inertia)),
        moments,
        axes,
        points,
        float(body.radius),
        reach,
    )


def _mat3(matrix: Array) -> Mat3:
    return Mat3(*(Vec3(*map(float, row)) for row in matrix))


def _principal(inertia: Array) -> tuple[Vec3, Quat]:
    """Principal moments, the odd one out last, and the rotation from their frame to the body's."""
    if np.count_nonzero(inertia - np.diag(np.diag(inertia))) == 0:
        moments, axes = np.diag(inertia), np.eye(3)
    else:
        moments, axes = np.linalg.eigh(inertia)
    inverse = 1.0 / moments
    gaps = [abs(inverse[(axis + 1) % 3] - inverse[(axis + 2) % 3]) for axis in range(3)]
    odd = int(np.argmin(gaps))
    order = [(odd + 1) % 3, (odd + 2) % 3, odd]  # a cyclic permutation: no axis changes its sense
    axes = axes[:, order] * np.linalg.det(axes)
    return Vec3(*map(float, moments[order])), from_matrix(_mat3(axes))
