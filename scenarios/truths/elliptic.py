"""Jacobi's elliptic functions of the complementary parameter, accurate up to the separatrix.

With m₁ = 1 - k² as the argument, instead of k, all digits of a motion near an unstable axis are kept.
"""

import math
from typing import NamedTuple

import numpy as np

from dropspin.scenarios.state import Array

SMALLEST_SINE = 1e-100  # below it sn equals its argument, and the square of cn/sn would overflow
CONVERGED = 1e-8  # each arithmetic-geometric mean squares the error, so one more reaches the last digit


class Jacobi(NamedTuple):
    """The values of sn, cn and dn."""

    sn: Array
    cn: Array
    dn: Array


def jacobi(u: Array, m1: float | Array) -> Jacobi:
    """sn, cn and dn of u for the complementary parameter m₁ = 1 - k²: one number in [0, 1], or one in (0, 1] for each u.

    Gauss's transformation is applied to cn/sn, not to the amplitude, which would lose half the digits where sn is near 1, which is nearly
    everywhere in a motion near the separatrix.

    Source: R. Bulirsch, Numerische Mathematik 7 (1965), 78-90, procedure sncndn.
    """
    if not np.any(m1):
        decayed = np.exp(-np.abs(u))
        sech = 2.0 * decayed / (1.0 + decayed * decayed)
        return Jacobi(np.tanh(u), sech, sech)
    a, b = np.ones_like(m1), np.sqrt(m1)
    steps = [(a, b)]
    while np.any(np.abs(a - b) > CONVERGED * a):
        a, b = 0.5 * (a + b), np.sqrt(a * b)
        steps.append((a, b))
    mean = 0.5 * (a + b)
    sine, cosine = np.sin(mean * u), np.cos(mean * u)
    at_zero = np.abs(sine) < SMALLEST_SINE
    ratio = cosine / np.where(at_zero, 1.0, sine)
    c, dn = mean * ratio, np.ones_like(ratio)
    for a, b in reversed(steps):
        ratio, c = c * ratio, c * dn
        dn = (b + ratio) / (a + ratio)
        ratio = c / a
    sn = np.copysign(1.0 / np.sqrt(c * c + 1.0), sine)
    return Jacobi(np.where(at_zero, sine / mean, sn), np.where(at_zero, cosine, c * sn), np.where(at_zero, 1.0, dn))


def quarter_period(m1: float) -> float:
    """K, the complete integral of the first kind; infinite on the separatrix m₁ = 0."""
    from scipy.special import elliprf

    return math.inf if m1 == 0.0 else float(elliprf(0.0, m1, 1.0))


def argument(sn: float, cn: float, m1: float) -> float:
    """The u in (-2K, 2K] with this elliptic sine and cosine; on the separatrix the cosine is positive."""
    from scipy.special import elliprf

    if m1 == 0.0:
        return math.asinh(sn / cn)
    dn2 = m1 + (1.0 - m1) * cn * cn
    u = sn * float(elliprf(cn * cn, dn2, 1.0))
    return u if cn >= 0.0 else math.copysign(2.0 * quarter_period(m1), sn) - u


def integral_of_sn2(u: Array, at_u: Jacobi, n: float, m1: float) -> Array:
    """The integral of sn² / (1 - n sn²) from 0 to u, for n <= 0: (Π(n; u) - u) / n, without the cancellation.

    On the separatrix it is the elementary integral of tanh² / (1 - n tanh²), which grows without bound.

    Source: B. C. Carlson, DLMF 19.25.14: Π(n; φ, k) = F + n/3 sin³φ R_J(cos²φ, 1 - k² sin²φ, 1, 1 - n sin²φ).
    """
    from scipy.special import elliprj

    if m1 == 0.0:
        root = math.sqrt(-n)
        return (u - (np.arctan(root * at_u.sn) / root if root > 0.0 else at_u.sn)) / (1.0 - n)
    K = quarter_period(m1)
    half_turns = np.round(u / (2.0 * K))
    sign = np.where(half_turns % 2 == 0, 1.0, -1.0)
    within = (sign * at_u.sn) ** 3 / 3.0 * elliprj(at_u.cn**2, at_u.dn**2, 1.0, 1.0 - n * at_u.sn**2)
    return 2.0 * half_turns * float(elliprj(0.0, m1, 1.0, 1.0 - n)) / 3.0 + within
