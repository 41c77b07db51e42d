"""Checks of arguments that are given for one body or for each: their numbers, their shapes, and what a quantity may be."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dropspin.reference_impl.body import Array

Test = Callable[[Array], NDArray[np.bool_]]
"""For each body, whether the numbers of it are allowed."""
Quantity = tuple[ArrayLike, tuple[int, ...], str, Test]
"""The numbers of a quantity, their shape for one body, what is allowed, and whether they are."""


def is_finite(values: Array) -> NDArray[np.bool_]:
    """Whether all numbers of a body are finite, for each body."""
    return np.logical_and.reduce(np.isfinite(values).reshape(len(values), -1), axis=1)


def is_above_zero(values: Array) -> NDArray[np.bool_]:
    """Whether a number is above 0 and finite, for each body."""
    return is_finite(values) & (values > 0.0)


def are_above_zero(values: Array) -> NDArray[np.bool_]:
    """Whether numbers are above 0, for each body; they may be infinite."""
    return np.all(values > 0.0, axis=1)


def is_unit(vectors: Array) -> NDArray[np.bool_]:
    """Whether a vector has length 1, for each body."""
    return np.abs(np.sum(vectors * vectors, axis=1) - 1.0) < 1e-12


def is_not_negative(values: Array) -> NDArray[np.bool_]:
    """Whether a number is 0 or more and finite, for each body."""
    return is_finite(values) & (values >= 0.0)


def is_ellipsoid(values: Array) -> NDArray[np.bool_]:
    """Whether semi-axes are those of a point, a disc across y, or an ellipsoid."""
    across, is_point = np.all(values[:, [0, 2]] > 0.0, axis=1), ~np.any(values, axis=1)
    return is_finite(values) & np.all(values >= 0.0, axis=1) & (across | is_point)


MIN_MOMENT_RATIO = 1e-13
"""Smallest ratio of two moments of inertia; a smaller one is 0 up to rounding, as for collinear points."""
MIN_LARGEST_MOMENT = 1e-290  # kg m²; so that the inverse is finite too
MAX_ASYMMETRY = 1e-12  # of the largest entry


def is_inertia(matrices: Array) -> NDArray[np.bool_]:
    """Whether a matrix is symmetric and positive definite beyond rounding, for each body."""
    usable = np.where(is_finite(matrices)[:, np.newaxis, np.newaxis], matrices, -np.eye(3))
    lowest = np.linalg.eigvalsh(usable)[:, 0]
    asymmetry = np.abs(usable - usable.transpose(0, 2, 1)).max(axis=(1, 2))
    highest = np.abs(usable).max(axis=(1, 2))
    return (lowest > MIN_MOMENT_RATIO * highest) & (highest > MIN_LARGEST_MOMENT) & (asymmetry <= MAX_ASYMMETRY * highest)


def checked(name: str, values: ArrayLike, shape: tuple[int, ...], allowed: str, holds: Test) -> Array:
    """An argument for one body (of that shape) or for each (one more axis, first) as an array with that axis, shape (1 or B, …).

    Raises:
        ValueError: The shape or a value is not allowed; in an ensemble the text names the body.
    """
    numbers = numbers_of(name, values, allowed)
    array = numbers[np.newaxis] if numbers.ndim == len(shape) else numbers
    if array.shape[1:] != shape or len(array) == 0:
        raise ValueError(f"{name}: must have shape {shape} or {('B', *shape)}, got {numbers.shape}".replace("'", ""))
    wrong = np.flatnonzero(~holds(array))
    if len(wrong):
        whose = f" for body {wrong[0]}" if numbers.ndim > len(shape) else ""
        raise ValueError(f"{name}: got {array[wrong[0]].tolist()}{whose}; must be {allowed}")
    return array


def numbers_of(name: str, values: ArrayLike, allowed: str) -> Array:
    """A copy of the argument, so that later changes to the caller's array have no effect."""
    try:
        array = np.asarray(values)
    except ValueError:  # rows of different length
        array = np.asarray(None)
    if array.dtype.kind not in "iuf":
        raise ValueError(f"{name}: got {values!r}; must be {allowed}")
    return np.array(array, dtype=float, order="C")


def ensemble_size(quantities: Mapping[str, Array]) -> int:
    """The number of bodies B of arguments of shape (1, …) or (B, …).

    Raises:
        ValueError: Two arguments have different B. The text names both.
    """
    sizes = {len(values): name for name, values in quantities.items() if len(values) > 1}
    if len(sizes) > 1:
        listed = " but ".join(f"{size} of {name}" for size, name in sizes.items())
        raise ValueError(f"ensemble: got {listed}; all arguments that differ from body to body must be for the same number of bodies")
    return next(iter(sizes), 1)
