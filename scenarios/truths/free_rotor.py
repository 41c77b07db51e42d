"""A rigid body without torque: its angular velocity and its orientation, exactly.

A spin about a principal axis is constant; any other motion is that of `asymmetric_top`.

Source: L. D. Landau & E. M. Lifshitz, Mechanics, section 37.
Valid for: any inertia and angular velocity.
"""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from dropspin.scenarios.bodies.inertia import is_diagonal, principal_axes
from dropspin.scenarios.rotations import about, multiply
from dropspin.scenarios.state import Array
from dropspin.scenarios.truths.asymmetric_top import AsymmetricTop, Exact
from dropspin.scenarios.truths.rotor_horizon import EPS, horizon, spin_rounding

Rotor = Callable[[Array], tuple[Array, Array]]
"""A function of times, shape (n,), that returns orientations (n, 4) and world-frame angular velocities (n, 3)."""


@dataclass(frozen=True, eq=False)
class FreeRotor:
    """The motion of a free body, as a function of time.

    Attributes:
        motion: Function of times that returns orientations and angular velocities.
        largest_spin: The largest magnitude of ω [rad/s].
        is_steady: Whether ω is constant.
        find_horizon: Function that returns `horizon`, which takes longer than the motion.
    """

    motion: Rotor
    largest_spin: float
    is_steady: bool
    find_horizon: Callable[[], float]

    @cached_property
    def horizon(self) -> float:
        """Time up to which a change of one eps in the initial state does not change the motion noticeably [s]: `rotor_horizon`."""
        return self.find_horizon()

    def __call__(self, t: Array) -> tuple[Array, Array]:
        """Orientations (n, 4) and angular velocities (n, 3), world frame, at times [s], shape (n,)."""
        return self.motion(t)


def free_rotor(inertia: Array, orientation: Array, angular_velocity: Array) -> FreeRotor:
    """The motion of a free body from its initial state.

    The given numbers are taken as exact, so that a body whose ω is 1e-16 off an unstable axis turns over after some time.

    Args:
        inertia: Inertia tensor in the body frame [kg m²], shape (3, 3).
        orientation: Initial orientation, shape (4,).
        angular_velocity: Initial angular velocity in the world frame [rad/s], shape (3,).
    """
    heaviest, fastest = _power_of_two(inertia), _power_of_two(angular_velocity)
    inertia, unit_spin = inertia / heaviest, angular_velocity / fastest  # so that no product leaves the range of doubles
    moments, axes = principal_axes(inertia)
    spin = _along(axes, orientation, unit_spin)

    def until() -> float:
        rounding = spin_rounding(orientation, unit_spin)
        if not is_diagonal(inertia):  # the axes are rounded too
            rounding = np.full(3, EPS * float(np.linalg.norm(unit_spin)))
        ascending = np.argsort(moments, kind="stable")
        return horizon(tuple(moments[ascending].tolist()), tuple(spin[ascending]), rounding[ascending]) / fastest

    if all(moments[m] == moments[n] or spin[m] == 0 or spin[n] == 0 for m, n in ((0, 1), (1, 2), (2, 0))):  # about a principal axis
        return FreeRotor(principal_spin(orientation, angular_velocity), float(np.linalg.norm(angular_velocity)), True, until)
    top = AsymmetricTop(moments, axes, orientation, spin)

    def motion(t: Array) -> tuple[Array, Array]:
        turned, rates = top(t * fastest)
        return turned, rates * fastest

    return FreeRotor(motion, top.largest_spin * fastest, False, until)


def _power_of_two(values: Array) -> float:
    """The power of two just above the largest magnitude; 1 if all are 0."""
    return float(np.ldexp(1.0, np.frexp(np.abs(values).max())[1]))


def principal_spin(orientation: Array, angular_velocity: Array) -> Rotor:
    """Steady rotation about a principal axis: q(t) = (rotation about ω by |ω| t) q₀."""
    speed = float(np.linalg.norm(angular_velocity))
    axis = angular_velocity / speed if speed > 0.0 else np.zeros(3)

    def motion(t: Array) -> tuple[Array, Array]:
        turned = multiply(about(axis, speed * t), np.broadcast_to(orientation, (len(t), 4)))
        return turned, np.broadcast_to(angular_velocity, (len(t), 3)).copy()

    return motion


def _along(axes: Array, orientation: Array, angular_velocity: Array) -> Exact:
    """Components along body axes, the columns of (3, 3), of a vector in the world frame, in exact rationals, shape (3,)."""
    (quaternion, _), (vector, of_vector), (rows, of_rows) = map(_over_one_denominator, (orientation, angular_velocity, axes.T))
    along, (x, y, z, w) = quaternion[:3], quaternion
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    spin = (w * w - along @ along) * vector + 2 * (along @ vector) * along - 2 * w * (across @ vector)
    denominator = (w * w + along @ along) * of_vector * of_rows
    return np.array([Fraction(numerator, denominator) for numerator in rows @ spin])


def _over_one_denominator(values: Array) -> tuple[Exact, int]:
    """Numbers as integers over a common denominator, which take a tenth of the time of fractions in lowest terms."""
    ratios = [value.as_integer_ratio() for value in values.ravel().tolist()]
    common = max(denominator for _, denominator in ratios)  # of doubles: powers of 2
    return np.array([numerator * (common // denominator) for numerator, denominator in ratios], object).reshape(values.shape), common
