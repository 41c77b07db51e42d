"""Jacobi's elliptic functions, from the complementary parameter, so that they stay exact up to the separatrix.

With m₁ = 1 - k² given (not 1 - m₁ recomputed from k), the motion near an unstable axis keeps all its digits.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import elliprf, elliprj

Array = NDArray[np.float64]


class Jacobi(NamedTuple):
    """sn, cn and dn at some arguments."""

    sn: Array
    cn: Array
    dn: Array


def jacobi(u: Array, m1: float) -> Jacobi:
    """sn, cn and dn of u for the complementary parameter m₁ = 1 - k² in [0, 1].

    By the descending Landen transformation (arithmetic-geometric mean).

    Source: Abramowitz & Stegun (1964), 16.4 and 16.6; R. Bulirsch, Numer. Math. 7 (1965), for the use of m₁.
    """
    if m1 == 0.0:
        sech = 1.0 / np.cosh(u)
        return Jacobi(np.tanh(u), sech, sech)
    a, b = 1.0, math.sqrt(m1)
    ratios: list[float] = []
    while abs(a - b) > 1e-17 * a and len(ratios) < 60:
        a, b, c = 0.5 * (a + b), math.sqrt(a * b), 0.5 * (a - b)
        ratios.append(c / a)
    amplitude = (2.0 ** len(ratios)) * a * u
    for ratio in reversed(ratios):
        amplitude = 0.5 * (amplitude + np.arcsin(ratio * np.sin(amplitude)))
    sn, cn = np.sin(amplitude), np.cos(amplitude)
    return Jacobi(sn, cn, np.sqrt(m1 + (1.0 - m1) * cn * cn))


def quarter_period(m1: float) -> float:
    """K, the complete integral of the first kind; infinite on the separatrix m₁ = 0."""
    return math.inf if m1 == 0.0 else float(elliprf(0.0, m1, 1.0))


def argument(sn: float, cn: float, m1: float) -> float:
    """The u in (-2K, 2K] whose elliptic sine and cosine are these."""
    dn2 = m1 + (1.0 - m1) * cn * cn
    u = sn * float(elliprf(cn * cn, dn2, 1.0))
    return u if cn >= 0.0 else math.copysign(2.0 * quarter_period(m1), sn) - u


def integral_of_sn2(u: Array, at_u: Jacobi, n: float, m1: float) -> Array:
    """The integral of sn² / (1 - n sn²) from 0 to u, for n <= 0: (Π(n; u) - u) / n, without the cancellation.

    Source: B. C. Carlson, DLMF 19.25.14: Π(n; φ, k) = F + n/3 sin³φ R_J(cos²φ, 1 - k² sin²φ, 1, 1 - n sin²φ).
    """
    K = quarter_period(m1)
    half_turns = np.round(u / (2.0 * K))
    sign = np.where(half_turns % 2 == 0, 1.0, -1.0)
    within = (sign * at_u.sn) ** 3 / 3.0 * elliprj(at_u.cn**2, at_u.dn**2, 1.0, 1.0 - n * at_u.sn**2)
    if math.isinf(K):
        return within
    return 2.0 * half_turns * float(elliprj(0.0, m1, 1.0, 1.0 - n)) / 3.0 + within
