"""Moments and tensors of inertia, of any shape."""

from typing import Annotated

import numpy as np
from pydantic import AfterValidator

from dropspin.scenarios.state import Array
from dropspin.scenarios.tables import PositiveVector


def _possible(moments: tuple[float, ...]) -> tuple[float, ...]:
    largest = max(moments)
    if largest > (sum(moments) - largest) * (1 + 1e-12):
        raise ValueError("no body has these moments: the largest must not exceed the sum of the other two")
    return moments


PrincipalMoments = Annotated[PositiveVector, AfterValidator(_possible)]


def is_diagonal(tensor: Array) -> bool:
    """Whether the body axes are exactly principal axes."""
    return np.count_nonzero(tensor - np.diag(np.diag(tensor))) == 0


def principal_axes(inertia: Array) -> tuple[Array, Array]:
    """Principal moments and axes (columns, right-handed): the body axes of a diagonal tensor, else by ascending moment."""
    if is_diagonal(inertia):
        return np.diag(inertia).copy(), np.eye(3)
    moments, axes = np.linalg.eigh(inertia)
    return moments, axes * np.linalg.det(axes)
