"""Values along the axes: the initial values of a scan, and the midpoint of two values, for bisection."""

import math
from collections.abc import Callable

import numpy as np

from dropspin.comparisons.robustness.operating_point import OperatingPoint, natural_time

Between = Callable[[float, float, float], float | None]
"""A function of two values and a ratio that returns the value halfway between them, or None if their ratio is smaller than that ratio."""


def steps(nominal: OperatingPoint) -> list[float]:
    """Time steps [s]: 0.01 to 10 rad per step in free flight; with a floor, from a thousandth of the time of the fall to all of it."""
    time = natural_time(nominal.scene)
    if nominal.scene.floor is None:
        return logarithmic(0.01 * time, 10.0 * time, 7)
    return logarithmic(1e-3 * time, time, 7)


def masses(nominal: OperatingPoint) -> list[float]:
    """Masses [kg], the nominal one times powers of 1024."""
    return [nominal.scene.body.mass * factor for factor in _powers(1e-9, 1e9, 2.0, 10)]


def durations(nominal: OperatingPoint) -> list[float]:
    """The duration of the scene and the powers of ten above it up to 10⁴ [s]."""
    longer = [10.0**power for power in range(5) if 10.0**power > 1.1 * nominal.scene.duration]
    return [nominal.scene.duration, *longer]


def sizes(nominal: OperatingPoint) -> list[float]:
    """Sizes [m] from 0.1 mm to 1 km, the nominal one times powers of 16."""
    size = nominal.scene.body.size
    return [size * factor for factor in _powers(1e-4 / size, 1e3 / size, 4.0, 2)]


def logarithmic(low: float, high: float, count: int) -> list[float]:
    """Values in equal ratios, rounded to six digits."""
    return [float(f"{value:.6g}") for value in np.geomspace(low, high, count)]


def _powers(low: float, high: float, base: float, each: int) -> list[float]:
    """Integer powers of a power of two, including 1; multiplication by them causes no rounding."""
    least, most = math.floor(math.log(low, base)), math.ceil(math.log(high, base))
    return [base**exponent for exponent in range(least, most + 1) if exponent % each == 0]


def geometric_mean(low: float, high: float, ratio: float) -> float | None:
    """`Between` of positive values."""
    return None if high <= low * ratio else math.sqrt(low * high)


def restitution_between(low: float, high: float, ratio: float) -> float | None:
    """`Between` of coefficients of restitution, by the ratio of 1 - e."""
    return None if 1.0 - low <= (1.0 - high) * ratio else 1.0 - math.sqrt((1.0 - low) * (1.0 - high))


def whole_power_between(base: float) -> Between:
    """`Between` of integer powers of a base; there is no value between adjacent powers."""

    def between(low: float, high: float, ratio: float) -> float | None:
        powers = round(math.log(high / low, base))
        return None if powers < 2 else low * base ** (powers // 2)

    return between
