"""A rigid body without torque: its angular velocity and its orientation in closed form.

    ω = (A_a cn, ± A_b sn, ± A_c dn)(u) along the body's principal axes a, b, c,   u = rate t + u₀
    R(t) = R₀ B₀ R_z(φ(t)) B(t)ᵀ

b is the intermediate axis, and c is the axis about which the angular momentum L moves in the body frame. B is a triad in the body whose
third axis is along L and one of whose other axes is perpendicular to a body axis p. In space, the triad only rotates about L, by φ, with

    dφ/dt = L (m_a²/I_a + m_b²/I_b) / (m_a² + m_b²)      (for p = c; m_i = I_i ω_i)

Source: L. D. Landau & E. M. Lifshitz, Mechanics, section 37; the orientation as E. T. Whittaker, Analytical Dynamics, section 69,
with Carlson's integrals for the theta functions.
Valid for: any inertia and angular velocity; a spin about a principal axis is constant.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios.bodies.inertia import is_diagonal, principal_axes
from dropspin.scenarios.rotations import about, cross, multiply
from dropspin.scenarios.state import Array
from dropspin.scenarios.truths.elliptic import Jacobi, argument, integral_of_sn2, jacobi, quarter_period
from dropspin.scenarios.truths.rotor_horizon import EPS, horizon, spin_rounding

SMALLEST_M1 = 1e-290
"""Smallest value for which the squares of the elliptic functions do not underflow; below it, a body turns over only after more than 300
e-foldings.
"""
AT_ONCE = 16_384
"""Times for which matrices are held in memory at once; more would be slower."""

Exact = NDArray[Any]
"""An array of exact rationals."""
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

    def until() -> float:
        rounding = spin_rounding(orientation, unit_spin)
        if not is_diagonal(inertia):  # the axes are rounded too
            rounding = np.full(3, EPS * float(np.linalg.norm(unit_spin)))
        ascending, spin = np.argsort(moments, kind="stable"), _along(axes, orientation, unit_spin)
        return horizon(tuple(moments[ascending].tolist()), tuple(spin[ascending]), rounding[ascending]) / fastest

    if _is_steady(moments, axes, orientation, unit_spin):
        return FreeRotor(principal_spin(orientation, angular_velocity), float(np.linalg.norm(angular_velocity)), True, until)
    top = AsymmetricTop(moments, axes, orientation, unit_spin)

    def motion(t: Array) -> tuple[Array, Array]:
        turned, rates = top(t * fastest)
        return turned, rates * fastest

    return FreeRotor(motion, top.largest_spin * fastest, False, until)


def _is_steady(moments: Array, axes: Array, orientation: Array, spin: Array) -> bool:
    """Whether a spin is about a principal axis."""
    if np.ptp(moments) == 0.0:
        return True
    along = _along(axes, orientation, spin)
    return all(moments[m] == moments[n] or along[m] == 0 or along[n] == 0 for m, n in ((0, 1), (1, 2), (2, 0)))


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


class AsymmetricTop:
    """The general free rotor; its period [s] is that of the angular velocity in the body."""

    def __init__(self, moments: Array, axes: Array, orientation: Array, angular_velocity: Array) -> None:
        from scipy.spatial.transform import Rotation

        spin = _along(axes, orientation, angular_velocity)
        order = _circled_axis_last(moments, spin)
        self._axes = axes @ order.T  # columns: a, b, c in the body frame
        self._moments = Ia, Ib, Ic = tuple(float(value) for value in np.abs(order) @ moments)
        exact_spin = tuple(order.astype(int) @ spin)
        spin_a, spin_b, spin_c = map(float, exact_spin)

        # Written as sums of products of one sign, in which 2T I_c - L² and the others lose no digits.
        to_c = Ia * (Ic - Ia) * spin_a**2 + Ib * (Ic - Ib) * spin_b**2  # 2 T Ic - L²
        to_a = Ib * (Ib - Ia) * spin_b**2 + Ic * (Ic - Ia) * spin_c**2  # L² - 2 T Ia
        to_b = _beyond_separatrix(self._moments, exact_spin)  # L² - 2 T Ib
        self._a = math.sqrt(to_c / (Ia * (Ic - Ia)))
        self._b = math.sqrt(to_c / (Ib * (Ic - Ib)))
        self._c = math.copysign(math.sqrt(to_a / (Ic * (Ic - Ia))), spin_c)
        self._b *= math.copysign(1.0, (Ic - Ib) * self._c)  # the sense in which L circles c
        self._rate = math.sqrt((Ic - Ib) * to_a / (Ia * Ib * Ic))
        self._m1 = 0.0 if to_b == 0 else max(min((Ic - Ia) * float(to_b) / ((Ic - Ib) * to_a), 1.0), SMALLEST_M1)
        if self._m1 == 0.0 and spin_a < 0.0:  # cn has one sign on the separatrix; half a turn about c leaves the equations unchanged
            self._a, self._b = -self._a, -self._b
        self._u0 = self._initial_phase(spin_a, spin_b)
        self.largest_spin = math.sqrt(max(self._a**2 + self._c**2, self._b**2 + self._m1 * self._c**2))
        self.period = 4.0 * quarter_period(self._m1) / self._rate

        at_start = self._elliptic(np.zeros(1))
        self._set_precession(at_start)
        start, _ = self._body_frame(at_start)
        self._to_space = Rotation.from_quat(orientation).as_matrix() @ self._axes @ start[0]

    def __call__(self, t: Array) -> tuple[Array, Array]:
        """Orientations (n, 4) and angular velocities (n, 3), world frame, at times [s], shape (n,)."""
        from scipy.spatial.transform import Rotation

        if len(t) > AT_ONCE:
            parts = map(self, np.array_split(t, -(-len(t) // AT_ONCE)))
            turned, rates = zip(*parts, strict=True)
            return np.concatenate(turned), np.concatenate(rates)
        at = self._elliptic(t)
        triads, spins = self._body_frame(at)
        angle = self._precession(t, at)
        cos, sin, zeros, ones = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
        about_l = np.array([[cos, -sin, zeros], [sin, cos, zeros], [zeros, zeros, ones]]).transpose(2, 0, 1)
        matrices = self._to_space @ about_l @ triads.transpose(0, 2, 1)  # from a, b, c to space
        orientation = Rotation.from_matrix(matrices @ self._axes.T).as_quat()
        return orientation, np.einsum("nij,nj->ni", matrices, spins)

    def _initial_phase(self, spin_a: float, spin_b: float) -> float:
        if self._a == 0.0:
            return 0.0
        cn, sn = spin_a / self._a, spin_b / self._b
        length = math.hypot(cn, sn)
        return argument(sn / length, cn / length, self._m1)

    def _elliptic(self, t: Array) -> tuple[Array, Jacobi]:
        """The argument u at times [s], and the elliptic functions of it."""
        u = self._rate * t + self._u0
        return u, jacobi(u, self._m1)

    def _set_precession(self, at_start: tuple[Array, Jacobi]) -> None:
        """Choose as p the body axis that stays farthest from L, so that the triad is always well defined."""
        Ia, Ib, Ic = self._moments
        m_a, m_b, m_c = Ia * self._a, Ib * self._b, Ic * self._c
        self._pole = 2 if abs(m_a) > abs(m_c) else 0
        Io, m_o, m_p2 = (Ia, m_a, (1.0 - self._m1) * m_c**2) if self._pole == 2 else (Ic, m_c, m_a**2)
        self._length = math.sqrt(m_a**2 + m_c**2)  # |L|; the component along b is 0 where sn = 0
        self._steady = self._length / Io
        self._n = -m_p2 / m_o**2
        self._swing = self._length * m_b**2 * (Io - Ib) / (Io * Ib * m_o**2 * self._rate)
        self._swung_at_start = integral_of_sn2(*at_start, self._n, self._m1)

    def _precession(self, t: Array, at: tuple[Array, Jacobi]) -> Array:
        """φ(t) = L t/I_o + swing (G(u) - G(u₀)), G the integral of sn²/(1 - n sn²); o is the one of a and c that is not p."""
        swung = integral_of_sn2(*at, self._n, self._m1) - self._swung_at_start
        return self._steady * t + self._swing * swung

    def _body_frame(self, at: tuple[Array, Jacobi]) -> tuple[Array, Array]:
        """The triads B as columns, (n, 3, 3), and the angular velocities, (n, 3), along a, b, c."""
        _, (sn, cn, dn) = at
        spins = np.column_stack([self._a * cn, self._b * sn, self._c * dn])
        along = spins * self._moments
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        first = cross(along, np.eye(3)[self._pole])
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        return np.stack([first, cross(along, first), along], axis=2), spins


def _along(axes: Array, orientation: Array, angular_velocity: Array) -> Exact:
    """Components along body axes, the columns of (3, 3), of a vector in the world frame, in exact rationals, shape (3,)."""
    x, y, z, w = map(Fraction, orientation.tolist())
    vector = np.array([Fraction(component) for component in angular_velocity.tolist()])
    along, across = np.array([x, y, z]), np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    squares = w * w + along @ along
    spin = ((w * w - along @ along) * vector + 2 * (along @ vector) * along - 2 * w * (across @ vector)) / squares
    return np.array([[Fraction(component) for component in axis] for axis in axes.T.tolist()]) @ spin


def _circled_axis_last(moments: Array, spin: Exact) -> Array:
    """The proper signed permutation, (3, 3), to axes a, b, c with b intermediate and c the one that L circles."""
    ascending = np.argsort(moments, kind="stable")
    ordered = tuple(float(value) for value in moments[ascending])
    circles_largest = _beyond_separatrix(ordered, tuple(spin[ascending])) >= 0
    order = np.eye(3)[ascending if circles_largest else ascending[::-1]]
    order[2] *= np.linalg.det(order)
    return order


def _beyond_separatrix(moments: tuple[float, ...], spin: tuple[Fraction, ...]) -> Fraction:
    """L² - 2 T I_b = I_c (I_c - I_b) ω_c² - I_a (I_b - I_a) ω_a², a difference, in exact rationals."""
    Ia, Ib, Ic = map(Fraction, moments)
    wa, _, wc = spin
    return Ic * (Ic - Ib) * wc**2 - Ia * (Ib - Ia) * wa**2
