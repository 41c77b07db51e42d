"""A rigid body without torque that does not spin about a principal axis: its motion in closed form.

    ω = (A_a cn, ± A_b sn, ± A_c dn)(u) along the body's principal axes a, b, c,   u = rate t + u₀
    R(t) = R₀ B₀ R_z(φ(t)) B(t)ᵀ

b is the intermediate axis, and c is the axis about which the angular momentum L moves in the body frame. B is a triad in the body whose
third axis is along L and one of whose other axes is perpendicular to a body axis p. In space, the triad only rotates about L, by φ, with

    dφ/dt = L (m_a²/I_a + m_b²/I_b) / (m_a² + m_b²)      (for p = c; m_i = I_i ω_i)

Source: L. D. Landau & E. M. Lifshitz, Mechanics, section 37; the orientation as E. T. Whittaker, Analytical Dynamics, section 69,
with Carlson's integrals for the theta functions.
Valid for: any inertia and angular velocity but those of a steady spin.
"""

import math
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios.rotations import cross
from dropspin.scenarios.state import Array
from dropspin.scenarios.truths.elliptic import Jacobi, argument, integral_of_sn2, jacobi, quarter_period

SMALLEST_M1 = 1e-290
"""Smallest value for which the squares of the elliptic functions do not underflow; below it, a body turns over only after more than 300
e-foldings.
"""
AT_ONCE = 16_384
"""Times for which matrices are held in memory at once; more would be slower."""

Exact = NDArray[Any]
"""An array of exact rationals."""


class AsymmetricTop:
    """The general free rotor; its period [s] is that of the angular velocity in the body."""

    def __init__(self, moments: Array, axes: Array, orientation: Array, spin: Exact) -> None:
        """Solve the motion from its initial state.

        Args:
            moments: Principal moments [kg m²], shape (3,).
            axes: Their axes in the body frame, columns, shape (3, 3).
            orientation: Initial orientation, shape (4,).
            spin: Initial angular velocity along these axes [rad/s], shape (3,).
        """
        from scipy.spatial.transform import Rotation

        order, to_b = _circled_axis_last(moments, spin)  # L² - 2 T Ib
        self._axes = axes @ order.T  # columns: a, b, c in the body frame
        self._moments = Ia, Ib, Ic = tuple(float(value) for value in np.abs(order) @ moments)
        spin_a, spin_b, spin_c = (order @ spin.astype(float) + 0.0).tolist()  # no -0.0, whose sign copysign would take

        # Written as sums of products of one sign, in which 2T I_c - L² and the others lose no digits.
        to_c = Ia * (Ic - Ia) * spin_a**2 + Ib * (Ic - Ib) * spin_b**2  # 2 T Ic - L²
        to_a = Ib * (Ib - Ia) * spin_b**2 + Ic * (Ic - Ia) * spin_c**2  # L² - 2 T Ia
        self._a = math.sqrt(to_c / (Ia * (Ic - Ia)))
        self._b = math.sqrt(to_c / (Ib * (Ic - Ib)))
        self._c = math.copysign(math.sqrt(to_a / (Ic * (Ic - Ia))), spin_c)
        self._b *= math.copysign(1.0, (Ic - Ib) * self._c)  # the sense in which L circles c
        self._rate = math.sqrt((Ic - Ib) * to_a / (Ia * Ib * Ic))
        self._m1 = 0.0 if to_b == 0 else max(min((Ic - Ia) * float(to_b) / ((Ic - Ib) * to_a), 1.0), SMALLEST_M1)
        if self._m1 == 0.0 and spin_a < 0.0:  # cn has one sign on the separatrix; half a turn about c leaves the equations unchanged
            self._a, self._b = -self._a, -self._b
        self.largest_spin = math.sqrt(max(self._a**2 + self._c**2, self._b**2 + self._m1 * self._c**2))
        self._set_precession()
        sn, cn = self._at_start(spin_a, spin_b)

        self._u0 = argument(sn, cn, self._m1)
        self.period = 4.0 * quarter_period(self._m1) / self._rate
        u = np.zeros(1) + self._u0
        at_start = jacobi(u, self._m1)
        self._swung_at_start = integral_of_sn2(u, at_start, self._n, self._m1)
        start, _ = self._body_frame(at_start)
        self._to_space = Rotation.from_quat(orientation).as_matrix() @ self._axes @ start[0]

    def __call__(self, t: Array) -> tuple[Array, Array]:
        """Orientations (n, 4) and angular velocities (n, 3), world frame, at times [s], shape (n,)."""
        from scipy.spatial.transform import Rotation

        if len(t) > AT_ONCE:
            parts = map(self, np.array_split(t, -(-len(t) // AT_ONCE)))
            turned, rates = zip(*parts, strict=True)
            return np.concatenate(turned), np.concatenate(rates)
        u = self._rate * t + self._u0
        at_u = jacobi(u, self._m1)
        triads, spins = self._body_frame(at_u)
        # φ(t) = L t/I_o + swing (G(u) - G(u₀)), G the integral of sn²/(1 - n sn²); o is the one of a and c that is not p.
        angle = self._steady * t + self._swing * (integral_of_sn2(u, at_u, self._n, self._m1) - self._swung_at_start)
        cos, sin, zeros, ones = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
        about_l = np.array([[cos, -sin, zeros], [sin, cos, zeros], [zeros, zeros, ones]]).transpose(2, 0, 1)
        matrices = self._to_space @ about_l @ triads.transpose(0, 2, 1)  # from a, b, c to space
        orientation = Rotation.from_matrix(matrices @ self._axes.T).as_quat()
        return orientation, np.einsum("nij,nj->ni", matrices, spins)

    def _at_start(self, spin_a: float, spin_b: float) -> tuple[float, float]:
        """The elliptic sine and cosine at the start."""
        if self._a == 0.0:
            return 0.0, 1.0
        cn, sn = spin_a / self._a, spin_b / self._b
        length = math.hypot(cn, sn)
        return sn / length, cn / length

    def _set_precession(self) -> None:
        """Choose as p the body axis that stays farthest from L, so that the triad is always well defined."""
        Ia, Ib, Ic = self._moments
        m_a, m_b, m_c = Ia * self._a, Ib * self._b, Ic * self._c
        self._pole = 2 if abs(m_a) > abs(m_c) else 0
        Io, m_o, m_p2 = (Ia, m_a, (1.0 - self._m1) * m_c**2) if self._pole == 2 else (Ic, m_c, m_a**2)
        self._length = math.sqrt(m_a**2 + m_c**2)  # |L|; the component along b is 0 where sn = 0
        self._steady = self._length / Io
        self._n = -m_p2 / m_o**2
        self._swing = self._length * m_b**2 * (Io - Ib) / (Io * Ib * m_o**2 * self._rate)

    def _body_frame(self, at_u: Jacobi) -> tuple[Array, Array]:
        """The triads B as columns, (n, 3, 3), and the angular velocities, (n, 3), along a, b, c."""
        sn, cn, dn = at_u
        spins = np.column_stack([self._a * cn, self._b * sn, self._c * dn])
        along = spins * self._moments
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        first = cross(along, np.eye(3)[self._pole])
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        return np.stack([first, cross(along, first), along], axis=2), spins


def _circled_axis_last(moments: Array, spin: Exact) -> tuple[Array, Fraction]:
    """The proper signed permutation, (3, 3), to axes a, b, c with b intermediate and c the one that L circles; and L² - 2 T I_b.

    L circles the axis of the largest moment if L² - 2 T I_b = I_c (I_c - I_b) ω_c² - I_a (I_b - I_a) ω_a² is not below 0, whichever of
    the two others is called c. It is a difference, taken in exact rationals.
    """
    ascending = np.argsort(moments, kind="stable")
    Ia, Ib, Ic = map(Fraction, moments[ascending].tolist())
    wa, _, wc = spin[ascending]
    beyond = Ic * (Ic - Ib) * wc**2 - Ia * (Ib - Ia) * wa**2
    order = np.eye(3)[ascending if beyond >= 0 else ascending[::-1]]
    order[2] *= np.linalg.det(order)
    return order, beyond
