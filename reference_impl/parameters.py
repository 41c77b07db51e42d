"""Parameters that may differ from body to body. They are checked and packed into rows of numbers, which the kernels read."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dropspin.reference_impl.body import Array, Body, Floor, KernelBody, KernelDamping, KernelWall, Wall, World
from dropspin.reference_impl.checks import (
    Quantity,
    are_above_zero,
    checked,
    ensemble_size,
    is_above_zero,
    is_ellipsoid,
    is_finite,
    is_inertia,
    is_not_negative,
    is_unit,
    numbers_of,
)
from dropspin.reference_impl.quaternion import from_matrix
from dropspin.reference_impl.vectors import Mat3, Quat, Vec3, compiled

# The first column of each quantity: `pack` writes them in the order of `_quantities`, then what follows from them, then the walls.
STEP_SIZE, GRAVITY, DAMPING, FLOOR, EDGES, MASS, INERTIA, SEMI_AXES = 0, 1, 4, 6, 9, 12, 13, 22
INVERSE_INERTIA, MOMENTS, AXES, REACH = 25, 34, 37, 41
WALLS, WALL_COLUMNS, WALL = 42, 17, "walls"


class Parameters(NamedTuple):
    """Bodies in their worlds with their time steps: one row for all, or one for each."""

    columns: Array
    """Shape (1, 42 + 17 n) or (B, 42 + 17 n) with n walls."""
    points: Array
    """Vertices [m], shape (1, n, 3) or (B, n, 3)."""
    is_ensemble: bool
    """Whether any argument was given for each body, even if B is 1."""


def pack(body: Body, world: World, dt: float | Array) -> Parameters:
    """A body in a world, or an ensemble of them.

    Raises:
        ValueError: A number is out of range, a shape is wrong, or two arguments are for ensembles of different size.
    """
    quantities = _quantities(body, world, dt)
    arrays = {name: checked(name, *quantity) for name, quantity in quantities.items()}
    is_ensemble = any(np.ndim(values) > len(shape) for values, shape, *_ in quantities.values())
    size = ensemble_size(arrays)
    points = arrays.pop("points")
    # The margin covers the rounding of R: no vertex may reach the floor before the bounding sphere does.
    reach = (np.sqrt(np.max(np.sum(points**2, axis=2), axis=1)) + arrays["semi_axes"].max(axis=1)) * (1.0 + 1e-12)
    for rate in ("linear damping", "angular damping"):
        arrays[rate] = _decay(arrays[rate], arrays["dt"])
    of_body = [values for name, values in arrays.items() if not name.startswith(WALL)]
    in_order = [*of_body, np.linalg.inv(arrays["inertia"]), *_principal(arrays["inertia"]), reach]
    for name in _walls(world):
        frames = _frames(arrays[f"{name}normal"])
        in_order += [arrays[f"{name}restitution"], arrays[f"{name}friction"], arrays[f"{name}rest_speed"], frames]
        in_order += [np.array([from_matrix(_matrix(frame)) for frame in frames])]
        in_order += [np.sum(arrays[f"{name}normal"] * arrays[f"{name}point"], axis=1)]
    columns = np.concatenate([np.broadcast_to(part.reshape(len(part), -1), (size, part[0].size)) for part in in_order], axis=1)
    return Parameters(np.ascontiguousarray(columns), points, is_ensemble)


def _quantities(body: Body, world: World, dt: float | Array) -> dict[str, Quantity]:
    """Each argument with the shape for one body, the allowed values in words, and a test for them."""
    floor = world.floor or Floor(0.0, 0.0)
    gravity = np.zeros(3) if world.gravity is None else world.gravity
    if world.damping is not None and len(world.damping) != 2:
        raise ValueError(f"damping: got {world.damping!r}; must be two rates, of velocity and of angular velocity, in 1/s")
    linear, angular = world.damping or (0.0, 0.0)
    walls: dict[str, Quantity] = {}
    for name, wall in _walls(world).items():
        walls |= _surface(name, wall.surface)
        walls[f"{name}point"] = (wall.point, (3,), "finite numbers, in m", is_finite)
        walls[f"{name}normal"] = (wall.normal, (3,), "a vector of length 1", is_unit)
    points = numbers_of("points", body.points, "finite numbers, in m")
    vertices = max((1, *points.shape[-2:-1]))
    return {
        "dt": (dt, (), "a number above 0, in s", is_above_zero),
        "gravity": (gravity, (3,), "finite numbers, in m/s²", is_finite),
        "linear damping": (linear, (), "0 or more, in 1/s", is_not_negative),
        "angular damping": (angular, (), "0 or more, in 1/s", is_not_negative),
        **_surface("", floor),
        "half_extents": ((np.inf, np.inf) if floor.half_extents is None else floor.half_extents, (2,), "above 0, in m", are_above_zero),
        "thickness": (np.inf if floor.thickness is None else floor.thickness, (), "above 0, in m", lambda depth: depth > 0.0),
        "mass": (body.mass, (), "a number above 0, in kg", is_above_zero),
        "inertia": (body.inertia, (3, 3), "a symmetric, positive definite 3 x 3 matrix, in kg m²", is_inertia),
        "points": (points, (vertices, 3), "finite numbers, in m, for at least one vertex", is_finite),
        "semi_axes": (body.semi_axes, (3,), "0 or more, in m, of a disc 0 along y", is_ellipsoid),
        **walls,
    }


def _walls(world: World) -> dict[str, Wall]:
    """The walls by the beginning of the names of their quantities."""
    return {f"{WALL}[{number}].": wall for number, wall in enumerate(world.walls)}


def _surface(name: str, surface: Floor) -> dict[str, Quantity]:
    return {
        f"{name}restitution": (surface.restitution, (), "between 0 and 1", lambda e: (e >= 0.0) & (e <= 1.0)),
        f"{name}friction": (surface.friction, (), "0 or more", lambda f: f >= 0.0),
        f"{name}rest_speed": (surface.rest_speed, (), "0 or more, in m/s", is_not_negative),
    }


def frictions(world: World) -> Iterator[Array]:
    """The coefficients of friction of the floor and of the walls."""
    surfaces = [*([world.floor] if world.floor else []), *(wall.surface for wall in world.walls)]
    return (np.asarray(surface.friction, dtype=float) for surface in surfaces)


def _decay(rates: Array, step_sizes: Array) -> Array:
    """Algorithm 1's factors, by `math`, because the last bit of NumPy's exponential may depend on the length of the array."""
    return np.array([math.exp(-rate * dt) for rate, dt in zip(*np.broadcast_arrays(rates, step_sizes), strict=True)])


def _principal(inertia: Array) -> tuple[Array, Array]:
    """Principal moments, shape (B, 3), the most different one last, and rotations from their frames to the bodies', shape (B, 4)."""
    different, which = np.unique(inertia.reshape(-1, 9), axis=0, return_inverse=True)
    pairs = [_principal_of_one(matrix.reshape(3, 3)) for matrix in different]
    return np.array([moments for moments, _ in pairs])[which], np.array([axes for _, axes in pairs])[which]


def _principal_of_one(inertia: Array) -> tuple[Array, Quat]:
    if np.count_nonzero(inertia - np.diag(np.diag(inertia))) == 0:
        moments, axes = np.diag(inertia), np.eye(3)
    else:
        moments, axes = np.linalg.eigh(inertia)
    inverse = 1.0 / moments
    gaps = [abs(inverse[(axis + 1) % 3] - inverse[(axis + 2) % 3]) for axis in range(3)]
    odd = int(np.argmin(gaps))
    order = [(odd + 1) % 3, (odd + 2) % 3, odd]  # a cyclic permutation keeps the axes right-handed
    axes = axes[:, order] * np.linalg.det(axes)
    return moments[order], from_matrix(_matrix(axes))


def _matrix(rows: Array) -> Mat3:
    return Mat3(*(Vec3(*map(float, row)) for row in rows.reshape(3, 3)))


def _frames(normals: Array) -> Array:
    """Rotations that take unit vectors, shape (B, 3), to the y axis, as matrices, shape (B, 9).

    Source: J. F. Hughes & T. Möller, Building an orthonormal basis from a unit vector, J. Graphics Tools 4 (1999).
    """
    sign = np.where(normals[:, 1] < 0.0, -1.0, 1.0)  # the half turn about x comes first where 1 + y would lose digits
    x, y, z = sign * normals.T
    a, c, b = 1.0 - x * x / (1.0 + y), 1.0 - z * z / (1.0 + y), -x * z / (1.0 + y)
    return np.stack([a, -x, b, *normals.T, sign * b, -sign * z, sign * c], axis=1)


# Reading from the columns of one body.


@compiled
def read_body(columns, points, semi_axes, has_rims, many_points):
    """The body."""
    return KernelBody(
        float(columns[MASS]),
        _read_matrix(columns, INERTIA),
        _read_matrix(columns, INVERSE_INERTIA),
        read_vector(columns, MOMENTS),
        read_quaternion(columns, AXES),
        points,
        float(columns[SEMI_AXES]),
        float(columns[REACH]),
        semi_axes,
        has_rims,
        many_points,
    )


@compiled
def read_damping(columns, first):
    """Algorithm 1's damping factors."""
    return KernelDamping(float(columns[first]), float(columns[first + 1]))


@compiled
def read_floor_with_edges(columns, first):
    """A floor that ends."""
    endless = read_surface(columns, first)
    half_extents = (float(columns[EDGES]), float(columns[EDGES + 1]))
    return Floor(endless.restitution, endless.friction, endless.rest_speed, half_extents, float(columns[EDGES + 2]))


@compiled
def read_wall(columns, number):
    """One of the walls."""
    first = WALLS + number * WALL_COLUMNS
    return KernelWall(
        _read_matrix(columns, first + 3),
        read_quaternion(columns, first + 12),
        float(columns[first + 16]),
        read_surface(columns, first),
    )


@compiled
def read_surface(columns, first):
    """A wall's surface, or a floor without an end."""
    return Floor(float(columns[first]), float(columns[first + 1]), float(columns[first + 2]), None, None)


@compiled
def read_vector(columns, first):
    """The vector in three columns."""
    return Vec3(float(columns[first]), float(columns[first + 1]), float(columns[first + 2]))


@compiled
def read_quaternion(columns, first):
    """The quaternion in four columns."""
    return Quat(float(columns[first]), float(columns[first + 1]), float(columns[first + 2]), float(columns[first + 3]))


@compiled
def _read_matrix(columns, first):
    return Mat3(read_vector(columns, first), read_vector(columns, first + 3), read_vector(columns, first + 6))


@compiled
def read_nothing(values, place):
    """A value for a part that the world or the body does not have."""
    return None
