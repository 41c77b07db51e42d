"""The body and the world that acts on it: the public description, and the form that the kernels use."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dropspin.reference_impl.vectors import Mat3, Quat, Vec3

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Body:
    """A rigid body: its mass, its inertia and the vertices that may touch the floor.

    In an ensemble of B bodies, each attribute may have an additional first axis of length B.

    Attributes:
        mass: M [kg], or shape (B,).
        inertia: I_body about the centre of mass, in the body frame [kg m²], shape (3, 3) or (B, 3, 3).
        points: Vertices relative to the centre of mass, in the body frame [m], shape (n, 3) or (B, n, 3).
        semi_axes: The semi-axes of the ellipsoid about each vertex, along the axes of the body frame [m], shape (3,) or (B, 3); 0 in the
            lecture note. A ball of radius R has one vertex at its centre and the semi-axes (R, R, R); a cylinder has two vertices on its
            axis y and the semi-axes (R, 0, R).
    """

    mass: float | Array
    inertia: Array
    points: Array
    semi_axes: ArrayLike = (0.0, 0.0, 0.0)


class Floor(NamedTuple):
    """The floor y = 0, or the surface of a wall. Each number may also be of shape (B,)."""

    restitution: float | Array
    """Separation speed over approach speed: µ in the lecture note, e elsewhere."""
    friction: float | Array
    """Coulomb's coefficient: 0 for a frictionless floor (eq 15), infinity for sticking (eq 17)."""
    rest_speed: float | Array = 0.0
    """Normal speed [m/s] below which restitution is 0 (section 3.2); 0 disables this rule."""
    half_extents: Any = None
    """Largest magnitudes of x and z of a point that the floor carries [m], shape (2,) or (B, 2). None: no limit."""
    thickness: Any = None
    """Depth down to which the floor carries a point [m]. None: no limit."""


class Wall(NamedTuple):
    """A plane other than the floor."""

    point: Array
    """A point of the plane [m], shape (3,) or (B, 3)."""
    normal: Array
    """Unit vector into the space that the body can be in, shape (3,) or (B, 3)."""
    surface: Floor
    """Restitution, friction and rest speed; a wall has no end."""


@dataclass(frozen=True)
class World:
    """The gravity, floor, damping and walls that act on a body. A part that is None is not simulated and takes no time.

    Attributes:
        gravity: g [m/s²], shape (3,) or (B, 3).
        floor: The floor y = 0.
        damping: Decay rates of velocity and angular velocity [1/s], each a number or of shape (B,); the factors of Algorithm 1 are
            c = exp(-rate dt).
        walls: Further planes, which act after the floor and in this order.
    """

    gravity: Array | None = None
    floor: Floor | None = None
    damping: tuple[float | Array, float | Array] | None = None
    walls: tuple[Wall, ...] = ()


class KernelBody(NamedTuple):
    """A body in the form that the kernels use."""

    mass: float
    inertia: Mat3
    inverse_inertia: Mat3
    moments: Vec3
    """Principal moments [kg m²]; the last one is the one that differs most from the others."""
    axes: Quat
    """Rotation from the principal frame to the body frame."""
    points: Array
    radius: float
    """Of the ball about each vertex [m], if it is one."""
    reach: float
    """Radius of a sphere about the centre that contains the body [m]."""
    semi_axes: Vec3 | None
    """Of the ellipsoid about each vertex [m]; None if it is a ball."""
    has_rims: bool
    """Whether this ellipsoid is a disc across y, so that a rim is about each vertex."""
    many_points: Array | None
    """Their coordinates over the reach, in single precision, shape (3, n), if they are compared with a floor in blocks; else None."""


class KernelWall(NamedTuple):
    """A wall in the form that the kernels use."""

    frame: Mat3
    """The rotation that takes the normal to the y axis."""
    turn: Quat
    """The same rotation."""
    distance: float
    """Of the plane from the origin, along the normal [m]."""
    surface: Floor


class KernelDamping(NamedTuple):
    """The damping factors of Algorithm 1."""

    linear: float
    angular: float
