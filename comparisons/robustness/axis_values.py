"""Values along the axes: those that a scan begins with, and the value halfway between two, by which it bisects."""

import math
from collections.abc import Callable

import numpy as np

from comparisons.robustness.operating_point import OperatingPoint, natural_time

Between = Callable[[float, float, float], float | None]
"""From two values and a ratio to the value halfway between them; None if their ratio is smaller than that."""


def steps(nominal: OperatingPoint) -> list[float]:
    """Time steps [s]: from .01 to 10 rad a step in free flight; with a floor, from a thousandth of the fall to all of it."""
    time = natural_time(nominal.scene)
    if nominal.scene.floor is None:
        return logarithmic(0.01 * time, 10.0 * time, 7)
    return logarithmic(1e-3 * time, time, 7)


def masses(nominal: OperatingPoint) -> list[float]:
    """Masses [kg], the nominal one times powers of 1024."""
    return [nominal.scene.body.mass * factor for factor in _powers(1e-9, 1e9, 2.0, 10)]


def durations(nominal: OperatingPoint) -> list[float]:
    """The scene's own duration and the powers of ten above it up to 10⁴ s."""
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
    """Whole powers of a power of two, 1 among them: multiplication by them loses no digits."""
    least, most = math.floor(math.log(low, base)), math.ceil(math.log(high, base))
    return [base**exponent for exponent in range(least, most + 1) if exponent % each == 0]


def geometric_mean(low: float, high: float, ratio: float) -> float | None:
    """`Between` of positive values."""
    return None if high <= low * ratio else math.sqrt(low * high)


def restitution_between(low: float, high: float, ratio: float) -> float | None:
    """`Between` of restitutions, by the ratio of 1 - e."""
    return None if 1.0 - low <= (1.0 - high) * ratio else 1.0 - math.sqrt((1.0 - low) * (1.0 - high))


def whole_power_between(base: float) -> Between:
    """`Between` of whole powers of a base; it has no value between neighbouring powers."""

    def between(low: float, high: float, ratio: float) -> float | None:
        powers = round(math.log(high / low, base))
        return None if powers < 2 else low * base ** (powers // 2)

    return between
