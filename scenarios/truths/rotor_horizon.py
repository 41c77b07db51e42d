"""The horizon of a free rotation near the unstable rotation about the intermediate axis.

The horizon is the time up to which the initial state, known to one eps, determines the motion.

With a < b < c or a > b > c the principal axes, P = |I_c (I_c - I_b)| and Q = |I_a (I_b - I_a)|, the separatrix is

    S = L² - 2 T I_b = ± (√P ω_c - √Q ω_a) (√P ω_c + √Q ω_a) = 0

near which one factor grows as e^(λt), λ² = (I_c - I_b) (I_b - I_a) ω_b²/(I_a I_c). An error δ of a factor, over its largest value F,
becomes δ/F (e^(λt) - 1) rad of the orientation; a relative error κ of the moments, which does not change the initial state, becomes κ (cosh
λt - 1). If these errors change S by a small share, they only change the time at which the body turns over. Where they change the
complementary parameter m₁ of the elliptic functions of λt, which is S I_c (I_c - I_a) over P (L² - 2 T I_a), by the share σ, and λ by the
share τ, that time changes by less than the share σ/(2K) + τ, K ≥ π/2 being the quarter period, and the orientation by (σ/π + τ) λt.

Source: linearised Euler equations, L. D. Landau & E. M. Lifshitz, Mechanics, section 37.
"""

import math
from fractions import Fraction

import numpy as np

from dropspin.scenarios.state import Array

TOLERANCE = 1e-9
"""Largest error of the orientation, relative to the angle turned, that one eps of the initial state may cause before the solution counts as
undetermined.
"""

EPS = 2.0**-52
SMALL_SHARE = 1e-3
"""The largest share of S whose effect counts as proportional to it."""


def spin_rounding(orientation: Array, angular_velocity: Array) -> Array:
    """The change of ω along the body axes by one eps of the initial state [rad/s], shape (3,); 0 where all terms are 0."""
    x, y, z, w = np.abs(orientation)
    off = 2.0 * np.array([[0.0, x * y + z * w, x * z + y * w], [x * y + z * w, 0.0, y * z + x * w], [x * z + y * w, y * z + x * w, 0.0]])
    return EPS * (np.eye(3) + off) @ np.abs(angular_velocity)


def horizon(moments: tuple[float, ...], spin: tuple[Fraction, ...], rounding: Array) -> float:
    """Time [s] up to which one eps of the initial state changes the orientation by at most `TOLERANCE` times the angle turned.

    Args:
        moments: Principal moments [kg m²], the intermediate one second.
        spin: Along their axes, at the start [rad/s].
        rounding: Rounding error of the spin [rad/s], shape (3,).
    """
    Ia, Ib, Ic = map(Fraction, moments)
    P, Q = math.sqrt(abs(Ic * (Ic - Ib))), math.sqrt(abs(Ia * (Ib - Ia)))
    if P * Q == 0.0 or not any(spin):
        return math.inf
    at_c, at_a = P * abs(float(spin[2])), Q * abs(float(spin[0]))
    if at_a > at_c:  # L circles c
        return horizon(moments[::-1], spin[::-1], rounding[::-1])
    relative_c, relative_a = (0.5 * EPS * float((Ij + Ik) / abs(Ij - Ik)) for Ij, Ik in ((Ic, Ib), (Ib, Ia)))
    of_state, of_moments = P * rounding[2] + Q * rounding[0], relative_c * at_c + relative_a * at_a
    change_c, change_a = P * rounding[2] + relative_c * at_c, Q * rounding[0] + relative_a * at_a
    change = (2.0 * at_c + change_c) * change_c + (2.0 * at_a + change_a) * change_a
    separation = abs(float(Ic * (Ic - Ib) * spin[2] ** 2 - Ia * (Ib - Ia) * spin[0] ** 2))
    of_b = float(abs(Ib * (Ib - Ia) * spin[1] ** 2))
    to_a = of_b + float(abs(Ic * (Ic - Ia) * spin[2] ** 2))
    rate = math.sqrt(float(abs(Ic - Ib) / (Ia * Ib * Ic)) * to_a)
    speed = math.sqrt(float(sum(w * w for w in spin)))
    of_m1 = 2.0 * (at_c * P * rounding[2] + at_a * Q * rounding[0] + (relative_c + relative_a) * at_a**2)  # times the separation
    shift = of_m1 / math.pi + (relative_c + relative_a * of_b / to_a) * separation
    if change <= SMALL_SHARE * separation and shift * rate <= TOLERANCE * separation * speed:
        return math.inf
    largest = P * math.sqrt(to_a / float(abs(Ic * (Ic - Ia))))
    return _crossing(of_state / largest, of_moments / largest, speed / rate) / rate


def _crossing(of_state: float, of_moments: float, angle: float) -> float:
    """Solve of_state (eˣ - 1) + of_moments (cosh x - 1) = TOLERANCE angle x for x > 0; the left side grows faster than the right."""
    from scipy.optimize import brentq

    def excess(x: float) -> float:
        return of_state * math.expm1(x) + of_moments * 2.0 * math.sinh(0.5 * x) ** 2 - TOLERANCE * angle * x

    least, most = 1e-12, 700.0
    if excess(least) >= 0.0:
        return 0.0
    return float(brentq(excess, least, most)) if excess(most) > 0.0 else math.inf
