"""Moments and tensors of inertia, of any shape."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, WrapValidator

from dropspin.scenarios.field_types import LARGEST, PositiveVector
from dropspin.scenarios.state import Array

OF_URDF = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
ASYMMETRY = 1e-6  # of the largest entry; models are often written with few digits


def _possible(moments: tuple[float, ...]) -> tuple[float, ...]:
    largest = max(moments)
    if largest > (sum(moments) - largest) * (1 + 1e-12):
        raise ValueError("no body has these moments: the largest must not exceed the sum of the other two")
    return moments


def mean_squares(inertia: Array, mass: float) -> Array:
    """The means of x xᵀ over the mass [m²], shape (3, 3), of a tensor of inertia [kg m²], shape (3, 3)."""
    return (0.5 * np.trace(inertia) * np.eye(3) - inertia) / mass


def symmetric(values: Sequence[Any]) -> list[list[Any]]:
    """The rows of a symmetric matrix of which xx, yy, zz, xy, xz, yz are given."""
    xx, yy, zz, xy, xz, yz = values
    return [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]


def _moments(raw: Any, validate: Callable[[Any], Any]) -> Any:
    """A tensor as its rows, given so, as six numbers or with the names of URDF; anything else as `validate` does.

    Raises:
        ValueError: No body has the tensor.
    """
    if isinstance(raw, Mapping) and set(raw) == set(OF_URDF):
        raw = [raw[name] for name in OF_URDF]
    if isinstance(raw, list | tuple) and len(raw) == 6:
        raw = symmetric(raw)
    if not (isinstance(raw, list | tuple) and len(raw) == 3 and all(isinstance(row, list | tuple) for row in raw)):
        return validate(raw)
    if not all(len(row) == 3 and all(type(value) in (int, float) and abs(value) <= LARGEST for value in row) for row in raw):
        raise ValueError("a tensor must have three rows of three numbers")
    matrix = np.array(raw, dtype=float)
    if np.abs(matrix - matrix.T).max() > ASYMMETRY * np.abs(matrix).max():
        raise ValueError("a tensor must be symmetric")
    matrix = 0.5 * (matrix + matrix.T)
    moments = np.linalg.eigvalsh(matrix).tolist()
    if moments[0] <= 0.0:
        raise ValueError(f"must have positive principal moments, has {moments}")
    _possible(tuple(moments))
    return tuple(map(tuple, matrix.tolist()))


PrincipalMoments = Annotated[PositiveVector, AfterValidator(_possible)]
Moments = Annotated[PrincipalMoments | tuple[tuple[float, ...], ...], WrapValidator(_moments)]
"""Three moments about the body's axes, or a tensor: 3 x 3, the six numbers of MJCF (xx, yy, zz, xy, xz, yz), or a table of URDF's names."""


def tensor(moments: tuple[Any, ...]) -> Array:
    """The tensor of moments as a table has them, shape (3, 3)."""
    array = np.array(moments)
    return np.diag(array) if array.ndim == 1 else array


def in_numbers(tensor: Array) -> list[Any]:
    """A tensor as a table has it: three moments, or its rows if it has products of inertia."""
    return list((np.diag(tensor) if is_diagonal(tensor) else tensor).tolist())


def second_moments(points: Array, masses: Array | float) -> Array:
    """Σ m x xᵀ of masses [kg] at points [m], shape (3, 3).

    Summed exactly, because the rounding of ten thousand terms would show in a comparison to the last digits.
    """
    return np.array([[math.fsum(masses * a * b) for b in points.T] for a in points.T])


def is_diagonal(tensor: Array) -> bool:
    """Whether the body axes are exactly principal axes."""
    return np.count_nonzero(tensor - np.diag(np.diag(tensor))) == 0


def principal_axes(inertia: Array) -> tuple[Array, Array]:
    """Principal moments and axes (columns, right-handed): the body axes of a diagonal tensor, else by ascending moment."""
    if is_diagonal(inertia):
        return np.diag(inertia).copy(), np.eye(3)
    moments, axes = np.linalg.eigh(inertia)
    return moments, axes * np.linalg.det(axes)
