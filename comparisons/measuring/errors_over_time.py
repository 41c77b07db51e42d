"""Errors at each time of a motion; a metric is usually the largest of these errors."""

from collections.abc import Callable

from dropspin.comparisons.measuring.comparison import Comparison, Unresolved
from dropspin.scenarios.rotations import angle_between_orientations, angle_between_vectors, length, rotation_vector
from dropspin.scenarios.state import Array

Rows = slice | list[int]
ALL = slice(None)


def energy_error(case: Comparison, synchronised: bool = True) -> Array:
    """Difference of energy from that of the exact solution, over the scene's energy."""
    energy = case.states.energy if synchronised else case.states.energy_as_stored
    return (energy[: len(case.exact)] - case.exact_states.energy) / case.energy_scale


def angular_momentum_error(case: Comparison) -> Array:
    """Difference of angular momentum from the exact solution, over the largest exact value."""
    return length(angular_momentum_difference(case))


def angular_momentum_difference(case: Comparison, rows: Rows = ALL) -> Array:
    """The difference as a vector in the world frame, over the largest exact value, shape (n, 3)."""
    computed, exact, scale = case.angular_momentum, case.exact_states.angular_momentum, case.exact_states.largest_angular_momentum
    if scale == 0.0:
        raise Unresolved("the angular momentum is 0 in double precision")
    return (computed[rows] - exact[rows]) / scale


def angular_momentum_direction_error(case: Comparison) -> Array:
    """Angle between the angular momentum and that of the exact solution [rad]."""
    return angle_between_vectors(case.angular_momentum, case.exact_states.angular_momentum)


def position_error(case: Comparison) -> Array:
    """Distance of the centre of mass from that of the exact solution [m]."""
    return length(position_difference(case))


def position_difference(case: Comparison, rows: Rows = ALL) -> Array:
    """The vector from the exact centre of mass to that of the engine [m], shape (n, 3)."""
    return case.compared.position[rows] - case.exact.position[rows]


def orientation_error(case: Comparison) -> Array:
    """Angle of the rotation from the exact orientation to that of the engine [rad]."""
    return angle_between_orientations(case.compared.orientation, case.exact.orientation)


def orientation_difference(case: Comparison, rows: Rows = ALL) -> Array:
    """The rotation from the exact orientation to that of the engine as a vector in the world frame [rad], shape (n, 3)."""
    return rotation_vector(case.exact.orientation[rows], case.compared.orientation[rows])


IN_FLIGHT = energy_error, angular_momentum_error, angular_momentum_direction_error
"""Errors that are defined in flight only."""
ERRORS: dict[str, Callable[[Comparison], Array]] = {error.__name__: error for error in (*IN_FLIGHT, position_error, orientation_error)}
"""Errors by the name of the metric that is their largest value."""
