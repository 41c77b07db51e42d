"""The axes of a robustness study. Each axis varies one quantity of the scene, or the time step, up to extreme values."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dropspin.comparisons.engines.mapping import may_tumble
from dropspin.comparisons.robustness import transformations as to
from dropspin.comparisons.robustness.axis_values import (
    Between,
    durations,
    geometric_mean,
    logarithmic,
    masses,
    restitution_between,
    sizes,
    steps,
    whole_power_between,
)
from dropspin.comparisons.robustness.operating_point import OperatingPoint, falls, spin
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies.inertia import is_diagonal


@dataclass(frozen=True)
class Axis:
    """A quantity that is varied.

    Attributes:
        name: The name on the command line.
        unit: The SI unit; '1' for a ratio.
        applies: Whether a scene has the quantity.
        values: Function of a scene and a time step that returns the initial values of a scan, in order.
        base: Function of a scene and a time step that returns the nominal value.
        at: Function of a scene, a time step and a value that returns the scene and the time step with this value.
        between: The midpoint of two values, see `Between`.
        coordinate: Function that maps a value to a position along the axis, by which distances of values are measured.
        invariant: Whether the exact motion, in scaled units, is the same for every value.
    """

    name: str
    unit: str
    applies: Callable[[Scenario], bool]
    values: Callable[[OperatingPoint], list[float]]
    base: Callable[[OperatingPoint], float]
    at: Callable[[OperatingPoint, float], OperatingPoint]
    between: Between
    coordinate: Callable[[float], float] = math.log
    invariant: bool = False

    @property
    def label(self) -> str:
        """The name, with the unit if it has one."""
        return self.name if self.unit == "1" else f"{self.name} [{self.unit}]"


def _has_principal_axes(scene: Scenario) -> bool:
    return may_tumble(scene) and not scene.body.is_ball and is_diagonal(scene.body.inertia_tensor)


def _inertia_ratio(nominal: OperatingPoint) -> float:
    moments = np.linalg.eigvalsh(nominal.scene.body.inertia_tensor)
    return float(moments[2] / moments[0])


AXES = {
    axis.name: axis
    for axis in (
        Axis(
            "step",
            "s",
            applies=lambda scene: True,
            values=steps,
            base=lambda nominal: nominal.dt,
            at=to.with_step,
            between=geometric_mean,
        ),
        Axis(
            "spin",
            "rad/s",
            applies=lambda scene: spin(scene) > 0.0,
            values=lambda nominal: logarithmic(0.01 / nominal.dt, 10.0 / nominal.dt, 7),
            base=lambda nominal: spin(nominal.scene),
            at=to.with_spin,
            between=geometric_mean,
        ),
        Axis(
            "height",
            "m",
            applies=falls,
            values=lambda nominal: logarithmic(1e-3, 1e6, 10),
            base=lambda nominal: nominal.scene.clearance,
            at=to.with_height,
            between=geometric_mean,
        ),
        Axis(
            "inertia-ratio",
            "1",
            applies=_has_principal_axes,
            values=lambda nominal: logarithmic(1.0, 1e6, 7),
            base=_inertia_ratio,
            at=to.with_inertia_ratio,
            between=geometric_mean,
        ),
        Axis(
            "mass",
            "kg",
            applies=lambda scene: True,
            values=masses,
            base=lambda nominal: nominal.scene.body.mass,
            at=to.with_mass,
            between=whole_power_between(2.0),
            invariant=True,
        ),
        Axis(
            "restitution",
            "1",
            applies=lambda scene: scene.floor is not None and scene.floor.restitution < 1.0,
            values=lambda nominal: [0.0, 0.5, 0.9, 0.99, 0.999, 0.9999],
            base=lambda nominal: nominal.scene.floor.restitution if nominal.scene.floor is not None else math.nan,
            at=to.with_restitution,
            between=restitution_between,
            coordinate=lambda restitution: -math.log(1.0 - restitution),
        ),
        Axis(
            "duration",
            "s",
            applies=lambda scene: True,
            values=durations,
            base=lambda nominal: nominal.scene.duration,
            at=to.with_duration,
            between=geometric_mean,
        ),
        Axis(
            "size",
            "m",
            applies=lambda scene: scene.floor is not None,
            values=sizes,
            base=lambda nominal: nominal.scene.body.size,
            at=to.with_size,
            between=whole_power_between(4.0),
        ),
        Axis(
            "scale",
            "1",
            applies=lambda scene: True,
            values=lambda nominal: [value / nominal.scene.body.size for value in sizes(nominal)],
            base=lambda nominal: 1.0,
            at=to.with_scale,
            between=whole_power_between(4.0),
            invariant=True,
        ),
    )
}
