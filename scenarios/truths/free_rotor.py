"""A rigid body on which no torque acts: its angular velocity and its attitude, in closed form.

    ω = (A_a cn, ± A_b sn, ± A_c dn)(u) along the body's principal axes a, b, c,   u = rate t + u₀
    R(t) = R₀ B₀ R_z(φ(t)) B(t)ᵀ

b is the intermediate axis, c the one that the angular momentum L circles. B is a triad in the body, with L along its third
axis and one other axis square to a body axis p; in space it only turns about L, by φ, with

    dφ/dt = L (m_a²/I_a + m_b²/I_b) / (m_a² + m_b²)      (for p = c; m_i = I_i ω_i)

Source: L. D. Landau & E. M. Lifshitz, Mechanics, section 37; the attitude as E. T. Whittaker, Analytical Dynamics, section 69,
with Carlson's integrals for the theta functions.
Valid for: any inertia and angular velocity; a body that spins about a principal axis just keeps turning.
"""

import math
from collections.abc import Callable
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from scenarios.mechanics import principal_axes
from scenarios.rotations import about, cross, multiply, unrotate
from scenarios.truths.elliptic import Jacobi, argument, integral_of_sn2, jacobi, quarter_period

Array = NDArray[np.float64]
Rotor = Callable[[Array], tuple[Array, Array]]
"""Times (n,) to orientations (n, 4) and world-frame angular velocities (n, 3)."""


PARALLEL = 1e-15
"""Sine of the angle between angular momentum and velocity below which they count as parallel."""


def free_rotor(inertia: Array, orientation: Array, angular_velocity: Array) -> Rotor:
    """The motion of a free body from its start.

    Args:
        inertia: In the body frame [kg m²], shape (3, 3).
        orientation: At t = 0, shape (4,).
        angular_velocity: At t = 0, world frame [rad/s], shape (3,).
    """
    spin = unrotate(orientation, angular_velocity)
    momentum = inertia @ spin
    torque = np.linalg.norm(cross(momentum, spin))
    # Parallel but for rounding: a scene that says "about this axis" is meant so, and a ball has no other way to spin.
    if torque <= PARALLEL * np.linalg.norm(momentum) * np.linalg.norm(spin):
        return principal_spin(orientation, angular_velocity)
    return AsymmetricTop(inertia, orientation, angular_velocity)


def principal_spin(orientation: Array, angular_velocity: Array) -> Rotor:
    """Steady turning about a principal axis: q(t) = (rotation about ω by |ω| t) q₀."""
    speed = float(np.linalg.norm(angular_velocity))
    axis = angular_velocity / speed if speed > 0.0 else np.zeros(3)

    def motion(t: Array) -> tuple[Array, Array]:
        turned = multiply(about(axis, speed * t), np.broadcast_to(orientation, (len(t), 4)))
        return turned, np.broadcast_to(angular_velocity, (len(t), 3)).copy()

    return motion


class AsymmetricTop:
    """The general free rotor; its period [s] is that of the angular velocity in the body."""

    def __init__(self, inertia: Array, orientation: Array, angular_velocity: Array) -> None:
        from scipy.spatial.transform import Rotation

        moments, axes = principal_axes(inertia)
        spin = axes.T @ unrotate(orientation, angular_velocity)
        order = _circled_axis_last(moments, spin)
        self._axes = axes @ order.T  # columns: a, b, c in the body frame
        self._moments = Ia, Ib, Ic = tuple(float(value) for value in np.abs(order) @ moments)
        spin_a, spin_b, spin_c = (float(value) for value in order @ spin)

        # Sums of products of one sign: 2T I_c - L² and its like lose no digits.
        to_c = Ia * (Ic - Ia) * spin_a**2 + Ib * (Ic - Ib) * spin_b**2  # 2 T Ic - L²
        to_a = Ib * (Ib - Ia) * spin_b**2 + Ic * (Ic - Ia) * spin_c**2  # L² - 2 T Ia
        to_b = _beyond_separatrix(self._moments, (spin_a, spin_b, spin_c))  # L² - 2 T Ib
        self._a = math.sqrt(to_c / (Ia * (Ic - Ia)))
        self._b = math.sqrt(to_c / (Ib * (Ic - Ib)))
        self._c = math.copysign(math.sqrt(to_a / (Ic * (Ic - Ia))), spin_c)
        self._b *= math.copysign(1.0, (Ic - Ib) * self._c)  # the sense in which L circles c
        self._rate = math.sqrt((Ic - Ib) * to_a / (Ia * Ib * Ic))
        self._m1 = min((Ic - Ia) * to_b / ((Ic - Ib) * to_a), 1.0)
        self._u0 = self._initial_phase(spin_a, spin_b)
        self.period = 4.0 * quarter_period(self._m1) / self._rate

        self._set_precession()
        start, _ = self._body_frame(self._elliptic(np.zeros(1)))
        self._to_space = Rotation.from_quat(orientation).as_matrix() @ self._axes @ start[0]

    def __call__(self, t: Array) -> tuple[Array, Array]:
        """Orientations (n, 4) and angular velocities (n, 3), world frame, at times [s], shape (n,)."""
        from scipy.spatial.transform import Rotation

        at = self._elliptic(t)
        triads, spins = self._body_frame(at)
        angle = self._precession(t, at)
        cos, sin, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
        turned = np.array([[cos, -sin, zero], [sin, cos, zero], [zero, zero, one]]).transpose(2, 0, 1)
        matrices = self._to_space @ turned @ triads.transpose(0, 2, 1)  # from a, b, c to space
        orientation = Rotation.from_matrix(matrices @ self._axes.T).as_quat()
        return orientation, np.einsum("nij,nj->ni", matrices, spins)

    def _initial_phase(self, spin_a: float, spin_b: float) -> float:
        if self._a == 0.0:
            return 0.0
        cn, sn = spin_a / self._a, spin_b / self._b
        length = math.hypot(cn, sn)
        return argument(sn / length, cn / length, self._m1)

    def _elliptic(self, t: Array) -> tuple[Array, Jacobi]:
        """U, the functions' argument, at times [s], and the functions of it."""
        u = self._rate * t + self._u0
        return u, jacobi(u, self._m1)

    def _set_precession(self) -> None:
        """Choose the body axis p that L stays farthest from, so that the triad is always well defined."""
        Ia, Ib, Ic = self._moments
        m_a, m_b, m_c = Ia * self._a, Ib * self._b, Ic * self._c
        self._pole = 2 if abs(m_a) > abs(m_c) else 0
        Io, m_o, m_p2 = (Ia, m_a, (1.0 - self._m1) * m_c**2) if self._pole == 2 else (Ic, m_c, m_a**2)
        self._length = math.sqrt(m_a**2 + m_c**2)  # |L|: b's share is 0 where sn = 0
        self._steady = self._length / Io
        self._n = -m_p2 / m_o**2
        self._swing = self._length * m_b**2 * (Io - Ib) / (Io * Ib * m_o**2 * self._rate)
        self._swung_at_start = integral_of_sn2(*self._elliptic(np.zeros(1)), self._n, self._m1)

    def _precession(self, t: Array, at: tuple[Array, Jacobi]) -> Array:
        """φ(t) = L t/I_o + swing (G(u) - G(u₀)), G the integral of sn²/(1 - n sn²); I_o belongs to the third axis."""
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


def _circled_axis_last(moments: Array, spin: Array) -> Array:
    """The proper signed permutation, (3, 3), to axes a, b, c with b intermediate and c the one that L circles."""
    ascending = np.argsort(moments, kind="stable")
    ordered = tuple(float(value) for value in moments[ascending])
    circles_largest = _beyond_separatrix(ordered, tuple(float(value) for value in spin[ascending])) >= 0.0
    order = np.eye(3)[ascending if circles_largest else ascending[::-1]]
    order[2] *= np.linalg.det(order)
    return order


def _beyond_separatrix(moments: tuple[float, ...], spin: tuple[float, ...]) -> float:
    """L² - 2 T I_b = I_c (I_c - I_b) ω_c² - I_a (I_b - I_a) ω_a², a difference, hence in exact rationals."""
    Ia, Ib, Ic = map(Fraction, moments)
    wa, _, wc = map(Fraction, spin)
    return float(Ic * (Ic - Ib) * wc**2 - Ia * (Ib - Ia) * wa**2)
