"""Errors at each time of a motion; a metric is usually the largest of them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from comparisons.measuring.comparison import Comparison, Unresolved
from scenarios.mechanics import energy
from scenarios.rotations import angle_between_orientations, angle_between_vectors, length

Array = NDArray[np.float64]


def energy_error(case: Comparison, synchronised: bool = True) -> Array:
    """Energy minus the truth's, over the scene's energy."""
    found = case.energy[: len(case.exact)] if synchronised else energy(case.scene, case.compared, synchronised=False)
    return (found - case.exact_energy) / case.energy_scale


def angular_momentum_error(case: Comparison) -> Array:
    """Difference of angular momentum from the truth, over the truth's largest."""
    exact = case.exact_angular_momentum
    scale = np.max(length(exact))
    if scale == 0.0:
        raise Unresolved("the angular momentum is 0 in double precision")
    sizes: Array = length(case.angular_momentum - exact) / scale
    return sizes


def angular_momentum_direction_error(case: Comparison) -> Array:
    """Angle between the angular momentum and the truth's [rad]."""
    return angle_between_vectors(case.angular_momentum, case.exact_angular_momentum)


def position_error(case: Comparison) -> Array:
    """Distance of the centre of mass from the truth's [m]."""
    return length(case.compared.position - case.exact.position)


def orientation_error(case: Comparison) -> Array:
    """Angle of the rotation from the truth's attitude to the engine's [rad]."""
    return angle_between_orientations(case.compared.orientation, case.exact.orientation)


@dataclass(frozen=True)
class ErrorOverTime:
    """An error at each time: the function from a comparison to its values, and whether it is defined in flight only."""

    at_each_row: Callable[[Comparison], Array]
    in_flight: bool


ERRORS = {
    "energy_error": ErrorOverTime(energy_error, in_flight=True),
    "angular_momentum_error": ErrorOverTime(angular_momentum_error, in_flight=True),
    "angular_momentum_direction_error": ErrorOverTime(angular_momentum_direction_error, in_flight=True),
    "position_error": ErrorOverTime(position_error, in_flight=False),
    "orientation_error": ErrorOverTime(orientation_error, in_flight=False),
}
"""By the name of the metric that is the largest of each."""
