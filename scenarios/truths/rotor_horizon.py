"""The horizon of a free rotation near the unstable rotation about the intermediate axis.

The horizon is the time up to which the initial state, known to one eps, determines the motion.

With a < b < c or a > b > c the principal axes, P = |I_c (I_c - I_b)| and Q = |I_a (I_b - I_a)|, the separatrix is

    S = L² - 2 T I_b = ± (√P ω_c - √Q ω_a) (√P ω_c + √Q ω_a) = 0

near which one factor grows as e^(λt), λ² = (I_c - I_b) (I_b - I_a) ω_b²/(I_a I_c). An error δ of a factor, over its largest value F,
becomes δ/F (e^(λt) - 1) rad of the orientation; a relative error κ of the moments, which does not change the initial state, becomes κ (cosh
λt - 1). If these errors change S by at most the share `TOLERANCE`, they only change the time at which the body turns over, by that share.

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
    at_c, at_a = P * abs(float(spin[2])), Q * abs(float(spin[0]))
    of_state = P * rounding[2] + Q * rounding[0]
    of_c, of_a = (at * EPS * float((Ij + Ik) / abs(Ij - Ik)) if Ij != Ik else 0.0 for at, Ij, Ik in ((at_c, Ic, Ib), (at_a, Ib, Ia)))
    separation = abs(float(Ic * (Ic - Ib) * spin[2] ** 2 - Ia * (Ib - Ia) * spin[0] ** 2))
    change_c, change_a = P * rounding[2] + of_c, Q * rounding[0] + of_a
    change = (2.0 * at_c + change_c) * change_c + (2.0 * at_a + change_a) * change_a
    if change <= TOLERANCE * separation or P * Q == 0.0:
        return math.inf
    to_a = float(abs(Ib * (Ib - Ia) * spin[1] ** 2 + Ic * (Ic - Ia) * spin[2] ** 2))
    rate = math.sqrt(float(abs(Ic - Ib) / (Ia * Ib * Ic)) * to_a)
    largest = P * math.sqrt(to_a / float(abs(Ic * (Ic - Ia))))
    speed = math.sqrt(float(sum(w * w for w in spin)))
    return _crossing(of_state / largest, (of_c + of_a) / largest, speed / rate) / rate


def _crossing(of_state: float, of_moments: float, angle: float) -> float:
    """Solve of_state (eˣ - 1) + of_moments (cosh x - 1) = TOLERANCE angle x for x > 0; the left side grows faster than the right."""
    from scipy.optimize import brentq

    def excess(x: float) -> float:
        return of_state * math.expm1(x) + of_moments * 2.0 * math.sinh(0.5 * x) ** 2 - TOLERANCE * angle * x

    least, most = 1e-12, 700.0
    if excess(least) >= 0.0:
        return 0.0
    return float(brentq(excess, least, most)) if excess(most) > 0.0 else math.inf
