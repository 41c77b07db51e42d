"""The axes of a study of limits. Each axis varies one quantity of the scene, or the time step, up to extreme values.

First come the values of axes: the initial ones of a scan, and the midpoint of two of them, for bisection.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from dropspin.comparisons.engines.mapping import may_tumble
from dropspin.comparisons.limits import operating_point as to
from dropspin.comparisons.limits.operating_point import OperatingPoint
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies.inertia import is_diagonal
from dropspin.scenarios.variations import changed, in_units, with_inertia_ratio, with_size

Between = Callable[[float, float, float], float | None]
"""A function of two values and a ratio that returns the value halfway between them, or None if their ratio is smaller than that ratio."""


def steps(nominal: OperatingPoint) -> list[float]:
    """Time steps [s]: 0.01 to 10 rad per step in free flight; with a floor, from a thousandth of the time of the fall to all of it."""
    time = to.natural_time(nominal.scene)
    return logarithmic(0.01 * time, 10.0 * time, 7) if nominal.scene.floor is None else logarithmic(1e-3 * time, time, 7)


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


def whole_power_between(base: float, low: float, high: float, _: float) -> float | None:
    """`Between` of integer powers of a base; there is no value between adjacent powers."""
    powers = round(math.log(high / low, base))
    return None if powers < 2 else low * base ** (powers // 2)


class Axis(NamedTuple):
    """A quantity that is varied.

    Attributes:
        name: The name on the command line.
        unit: The SI unit; '1' for a ratio.
        values: Function of a scene and a time step that returns the initial values of a scan, in order.
        base: Function of a scene and a time step that returns the nominal value.
        at: Function of a scene, a time step and a value that returns the scene and the time step with this value.
        applies: Whether a scene has the quantity.
        between: The midpoint of two values, see `Between`.
        coordinate: Function that maps a value to a position along the axis, by which distances of values are measured.
        invariant: Whether the exact motion, in scaled units, is the same for every value.
    """

    name: str
    unit: str
    values: Callable[[OperatingPoint], list[float]]
    base: Callable[[OperatingPoint], float]
    at: Callable[[OperatingPoint, float], OperatingPoint]
    applies: Callable[[Scenario], bool] = lambda scene: True
    between: Between = geometric_mean
    coordinate: Callable[[float], float] = math.log
    invariant: bool = False

    @property
    def label(self) -> str:
        """The name, with the unit if it has one."""
        return self.name if self.unit == "1" else f"{self.name} [{self.unit}]"


def _inertia_ratio(nominal: OperatingPoint) -> float:
    moments = np.linalg.eigvalsh(nominal.scene.body.inertia_tensor)
    return float(moments[2] / moments[0])


AXES = {
    axis.name: axis
    for axis in (
        Axis("step", "s", steps, lambda nominal: nominal.dt, to.with_step),
        Axis(
            "spin", "rad/s",
            lambda nominal: logarithmic(0.01 / nominal.dt, 10.0 / nominal.dt, 7), lambda nominal: to.spin(nominal.scene), to.with_spin,
            applies=lambda scene: to.spin(scene) > 0.0,
        ),
        Axis(
            "height", "m",
            lambda nominal: logarithmic(1e-3, 1e6, 10), lambda nominal: nominal.scene.clearance, to.with_height,
            applies=to.falls,
        ),
        Axis(
            "inertia-ratio", "1", lambda nominal: logarithmic(1.0, 1e6, 7), _inertia_ratio,
            to.of_scene(with_inertia_ratio),
            applies=lambda scene: may_tumble(scene) and not scene.body.is_ball and is_diagonal(scene.body.inertia_tensor),
        ),
        Axis(
            "mass", "kg", masses, lambda nominal: nominal.scene.body.mass,
            to.of_scene(lambda scene, mass: in_units(scene, mass=mass / scene.body.mass)),
            between=partial(whole_power_between, 2.0), invariant=True,
        ),
        Axis(
            "restitution", "1", lambda nominal: [0.0, 0.5, 0.9, 0.99, 0.999, 0.9999],
            lambda nominal: nominal.scene.floor.restitution if nominal.scene.floor else math.nan,
            to.of_scene(lambda scene, restitution: changed(scene, floor={"restitution": restitution})),
            applies=lambda scene: scene.floor is not None and scene.floor.restitution < 1.0,
            between=restitution_between, coordinate=lambda restitution: -math.log(1.0 - restitution),
        ),
        Axis("duration", "s", durations, lambda nominal: nominal.scene.duration, to.of_scene(changed)),
        Axis(
            "size", "m", sizes, lambda nominal: nominal.scene.body.size, to.of_scene(with_size),
            applies=lambda scene: scene.floor is not None, between=partial(whole_power_between, 4.0),
        ),
        Axis(
            "scale", "1", lambda nominal: [value / nominal.scene.body.size for value in sizes(nominal)], lambda nominal: 1.0, to.with_scale,
            between=partial(whole_power_between, 4.0), invariant=True,
        ),
    )
}  # fmt: skip
