"""Mixtures of Student-t distributions: the distribution function of one, and quantiles."""

import math
from collections.abc import Callable

import numpy as np

from dropspin.scenarios.state import Array

HALVINGS = 14


def student_t(freedom: int, x: Array) -> Array:
    """The distribution function of Student's t with a whole number of degrees of freedom, n > 1: twenty times faster than the general one.

    Source: M. Abramowitz & I. A. Stegun, Handbook of Mathematical Functions (1964), 26.7.3 and 26.7.4.
    """
    tangent = x / math.sqrt(freedom)
    cosine2 = 1.0 / (1.0 + tangent**2)
    more = np.ones_like(cosine2)
    for k in range(freedom - 3, 0, -2):
        more = 1.0 + more * cosine2 * (k / (k + 1))
    if freedom % 2 == 0:
        return 0.5 + 0.5 * tangent * np.sqrt(cosine2) * more
    return 0.5 + (np.arctan(tangent) + tangent * cosine2 * more) / math.pi


def quantiles(below: Callable[[Array], Array], wanted: tuple[float, ...], near: float, unit: float, reach: float) -> list[float]:
    """Quantiles of a distribution between ± reach, by bisection in asinh((x - near) / unit), because they may span many powers of ten.

    Between the last two values the distribution is taken for linear.
    """
    high = np.full(len(wanted), math.asinh((reach + abs(near)) / unit))
    low, targets = -high, np.array(wanted)
    below_low, below_high = (below(near + unit * np.sinh(ends)) for ends in (low, high))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        chance = below(near + unit * np.sinh(middle))
        is_above = chance < targets
        low, high = np.where(is_above, middle, low), np.where(is_above, high, middle)
        below_low, below_high = np.where(is_above, chance, below_low), np.where(is_above, below_high, chance)
    share = (targets - below_low) / np.maximum(below_high - below_low, np.finfo(float).tiny)
    return [float(x) for x in near + unit * np.sinh(low + np.clip(share, 0.0, 1.0) * (high - low))]
