"""What is taken to its extremes: each axis changes one thing of a scene, or of the step, and leaves the rest."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from comparisons.engines.base import may_tumble
from scenarios import Scenario, load
from scenarios.body import Sphere
from scenarios.mechanics import is_diagonal

Array = NDArray[np.float64]

LEAST_STEPS = 8
"""Of a run, however coarse the step."""


class OperatingPoint(NamedTuple):
    """A scene and a step [s]."""

    scene: Scenario
    dt: float


Between = Callable[[float, float, float], float | None]
"""The value half way between two, or None where they are as near as asked, as a ratio."""


@dataclass(frozen=True)
class Axis:
    """One thing that is varied.

    Attributes:
        name: As on the command line.
        unit: SI; '1' for a ratio.
        applies: Whether a scene has it.
        values: The values to begin with, for a scene at a step, in order.
        base: The value that a scene has at a step.
        at: The scene and the step with another value.
        between: See `Between`.
        coordinate: A value as a length along the axis, by which values are near or far from each other.
        promised: Whether physics promises the same motion, in its own units, whatever the value.
    """

    name: str
    unit: str
    applies: Callable[[Scenario], bool]
    values: Callable[[OperatingPoint], list[float]]
    base: Callable[[OperatingPoint], float]
    at: Callable[[OperatingPoint, float], OperatingPoint]
    between: Between
    coordinate: Callable[[float], float] = math.log
    promised: bool = False

    @property
    def label(self) -> str:
        """Its name, with the unit if it has one."""
        return self.name if self.unit == "1" else f"{self.name} [{self.unit}]"


def natural_time(scene: Scenario) -> float:
    """The time by which a step is coarse or fine [s]: that of a turn by 1 rad, of the fall, or in which gravity passes the body's size."""
    spin = _spin(scene)
    if scene.floor is None and spin > 0.0:
        return 1.0 / spin
    if _falls(scene):
        return fall_time(scene)
    g = float(np.linalg.norm(scene.acceleration))
    return math.sqrt(scene.body.size / g) if g > 0.0 else scene.duration / 8.0


def fall_time(scene: Scenario) -> float:
    """When a body that does not turn reaches the floor [s]."""
    g, upward = -float(scene.acceleration[1]), scene.start.velocity[1]
    return (upward + math.sqrt(upward**2 + 2.0 * g * scene.clearance)) / g


def _spin(scene: Scenario) -> float:
    return float(np.linalg.norm(scene.start.angular_velocity))


def _falls(scene: Scenario) -> bool:
    return scene.starts_above_floor and bool(scene.acceleration[1] < 0.0)


def _changed(scene: Scenario, duration: float | None = None, **tables: Mapping[str, Any]) -> Scenario:
    """The scene with some keys of some tables, or its duration, replaced; what it expects and its ensemble do not count here."""
    content = scene.model_dump(exclude={"expect", "ensemble"}, exclude_none=True)
    for table, keys in tables.items():
        content[table] = {**content[table], **keys}
    return load({**content, "duration": scene.duration if duration is None else duration})


# Values.


def _logarithmic(low: float, high: float, count: int) -> list[float]:
    return [float(f"{value:.6g}") for value in np.geomspace(low, high, count)]


def _powers(low: float, high: float, base: float, each: int) -> list[float]:
    """Whole powers of a power of two, 1 among them: what is multiplied by them keeps its digits."""
    least, most = math.floor(math.log(low, base)), math.ceil(math.log(high, base))
    return [base**exponent for exponent in range(least, most + 1) if exponent % each == 0]


def _half_way(low: float, high: float, ratio: float) -> float | None:
    return None if high <= low * ratio else math.sqrt(low * high)


def _half_way_to_one(low: float, high: float, ratio: float) -> float | None:
    """Of restitutions: by the ratio of what is lost."""
    return None if 1.0 - low <= (1.0 - high) * ratio else 1.0 - math.sqrt((1.0 - low) * (1.0 - high))


def _whole_power_between(base: float) -> Between:
    def between(low: float, high: float, ratio: float) -> float | None:  # nothing is between neighbouring powers
        powers = round(math.log(high / low, base))
        return None if powers < 2 else low * base ** (powers // 2)

    return between


# The axes.


def _steps(setting: OperatingPoint) -> list[float]:
    time = natural_time(setting.scene)
    if setting.scene.floor is None:
        return _logarithmic(0.01 * time, 10.0 * time, 7)
    return _logarithmic(1e-3 * time, time, 7)


def _with_step(setting: OperatingPoint, dt: float) -> OperatingPoint:
    return OperatingPoint(_changed(setting.scene, max(setting.scene.duration, LEAST_STEPS * dt)), dt)


def _with_spin(setting: OperatingPoint, spin: float) -> OperatingPoint:
    """In flight for as many turns as the scene has; on a floor for as long."""
    scene, factor = setting.scene, spin / _spin(setting.scene)
    duration = scene.duration if scene.floor is not None else max(scene.duration / factor, LEAST_STEPS * setting.dt)
    faster = tuple(factor * rate for rate in scene.start.angular_velocity)
    return OperatingPoint(_changed(scene, duration, start={"angular_velocity": faster}), setting.dt)


def _with_height(setting: OperatingPoint, height: float) -> OperatingPoint:
    """The scene lasts as many times its fall as before."""
    scene = setting.scene
    x, y, z = scene.start.position
    higher = _changed(scene, start={"position": (x, y + height - scene.clearance, z)})
    duration = scene.duration * fall_time(higher) / fall_time(scene)
    return OperatingPoint(_changed(higher, max(duration, LEAST_STEPS * setting.dt)), setting.dt)


def _with_inertia_ratio(setting: OperatingPoint, ratio: float) -> OperatingPoint:
    """The largest moment is kept, on its axis, and where the middle one lies between the least and the largest it can be; the shape too."""
    scene = setting.scene
    least, middle, largest = np.sort(np.diag(scene.body.inertia_tensor))
    lowest = max(least, largest - least)  # a body's moments are the sides of a triangle
    share = (middle - lowest) / (largest - lowest) if largest > lowest else 0.5
    new_least = largest / ratio
    new_lowest = max(new_least, largest - new_least)
    new = np.array([new_least, min(new_lowest + share * (largest - new_lowest), largest), largest])
    order = np.argsort(np.argsort(np.diag(scene.body.inertia_tensor), kind="stable"), kind="stable")
    return OperatingPoint(_changed(scene, body={"inertia": tuple(float(moment) for moment in new[order])}), setting.dt)


def _inertia_ratio(setting: OperatingPoint) -> float:
    moments = np.linalg.eigvalsh(setting.scene.body.inertia_tensor)
    return float(moments[2] / moments[0])


def _with_mass(setting: OperatingPoint, mass: float) -> OperatingPoint:
    scene = setting.scene
    return OperatingPoint(_changed(scene, body=_body_times(scene, 1.0, mass / scene.body.mass)), setting.dt)


def _masses(setting: OperatingPoint) -> list[float]:
    return [setting.scene.body.mass * factor for factor in _powers(1e-9, 1e9, 2.0, 10)]


def _with_restitution(setting: OperatingPoint, restitution: float) -> OperatingPoint:
    return OperatingPoint(_changed(setting.scene, floor={"restitution": restitution}), setting.dt)


def _with_duration(setting: OperatingPoint, duration: float) -> OperatingPoint:
    return OperatingPoint(_changed(setting.scene, duration), setting.dt)


def _durations(setting: OperatingPoint) -> list[float]:
    longer = [10.0**power for power in range(5) if 10.0**power > 1.1 * setting.scene.duration]
    return [setting.scene.duration, *longer]


def _with_size(setting: OperatingPoint, size: float) -> OperatingPoint:
    """The body alone: how high it starts above the floor stays."""
    scene = setting.scene
    factor = size / scene.body.size
    x, y, z = scene.start.position
    content = {"position": (x, y - scene.clearance + factor * (scene.clearance + scene.body.size), z)}
    smaller = _changed(scene, body=_body_times(scene, factor, 1.0), start=content)
    x, y, z = smaller.start.position
    return OperatingPoint(_changed(smaller, start={"position": (x, y + scene.clearance - smaller.clearance, z)}), setting.dt)


def _sizes(setting: OperatingPoint) -> list[float]:
    size = setting.scene.body.size
    return [size * factor for factor in _powers(1e-4 / size, 1e3 / size, 4.0, 2)]


def _with_scale(setting: OperatingPoint, factor: float) -> OperatingPoint:
    """All lengths times a factor, all times with its root, gravity as it is."""
    scene, time = setting.scene, math.sqrt(factor)
    start = {
        "position": tuple(factor * x for x in scene.start.position),
        "velocity": tuple(time * v for v in scene.start.velocity),
        "angular_velocity": tuple(rate / time for rate in scene.start.angular_velocity),
    }
    tables: dict[str, Mapping[str, Any]] = {"body": _body_times(scene, factor, 1.0), "start": start}
    if scene.floor is not None:
        tables["floor"] = {"rest_speed": time * scene.floor.rest_speed}
    if scene.damping is not None:
        tables["damping"] = {"linear": scene.damping.linear / time, "angular": scene.damping.angular / time}
    return OperatingPoint(_changed(scene, time * scene.duration, **tables), time * setting.dt)


def _body_times(scene: Scenario, length: float, mass: float) -> dict[str, Any]:
    """Keys of the body with its lengths and masses multiplied."""
    given = scene.body.model_dump(exclude_none=True)
    keys: dict[str, Any] = {"mass": mass * given["mass"]}
    for name in {"radius", "half_extents", "points"} & given.keys():
        keys[name] = _times(length, given[name])
    if "masses" in given:
        keys["masses"] = _times(mass, given["masses"])
    if given["inertia"] == "note" and is_diagonal(scene.body.inertia_tensor):  # unit masses, whatever the body's is
        given["inertia"] = tuple(float(moment) for moment in np.diag(scene.body.inertia_tensor))
    if not isinstance(given["inertia"], str):
        keys["inertia"] = _times(mass * length**2, given["inertia"])
    return keys


def _times(factor: float, values: Any) -> Any:
    return tuple(_times(factor, value) for value in values) if isinstance(values, tuple) else factor * values


def restored(states: Array, axis: Axis, base: float, value: float) -> Array:
    """A motion in the units of the scene it is scaled from, shape (n, 13)."""
    if axis.name != "scale":
        return states
    factor = value / base
    time = math.sqrt(factor)
    return states / np.array([factor] * 3 + [1.0] * 4 + [time] * 3 + [1.0 / time] * 3)


AXES = {
    axis.name: axis
    for axis in (
        Axis(
            "step",
            "s",
            lambda scene: True,
            _steps,
            lambda setting: setting.dt,
            _with_step,
            _half_way,
        ),
        Axis(
            "spin",
            "rad/s",
            lambda scene: _spin(scene) > 0.0,
            lambda setting: _logarithmic(0.01 / setting.dt, 10.0 / setting.dt, 7),
            lambda setting: _spin(setting.scene),
            _with_spin,
            _half_way,
        ),
        Axis(
            "height",
            "m",
            _falls,
            lambda setting: _logarithmic(1e-3, 1e6, 10),
            lambda setting: setting.scene.clearance,
            _with_height,
            _half_way,
        ),
        Axis(
            "inertia-ratio",
            "1",
            lambda scene: may_tumble(scene) and not isinstance(scene.body, Sphere) and is_diagonal(scene.body.inertia_tensor),
            lambda setting: _logarithmic(1.0, 1e6, 7),
            _inertia_ratio,
            _with_inertia_ratio,
            _half_way,
        ),
        Axis(
            "mass",
            "kg",
            lambda scene: True,
            _masses,
            lambda setting: setting.scene.body.mass,
            _with_mass,
            _whole_power_between(2.0),
            promised=True,
        ),
        Axis(
            "restitution",
            "1",
            lambda scene: scene.floor is not None and scene.floor.restitution < 1.0,
            lambda setting: [0.0, 0.5, 0.9, 0.99, 0.999, 0.9999],
            lambda setting: setting.scene.floor.restitution if setting.scene.floor is not None else math.nan,
            _with_restitution,
            _half_way_to_one,
            lambda restitution: -math.log(1.0 - restitution),
        ),
        Axis(
            "duration",
            "s",
            lambda scene: True,
            _durations,
            lambda setting: setting.scene.duration,
            _with_duration,
            _half_way,
        ),
        Axis(
            "size",
            "m",
            lambda scene: scene.floor is not None,
            _sizes,
            lambda setting: setting.scene.body.size,
            _with_size,
            _whole_power_between(4.0),
        ),
        Axis(
            "scale",
            "1",
            lambda scene: True,
            lambda setting: [value / setting.scene.body.size for value in _sizes(setting)],
            lambda setting: 1.0,
            _with_scale,
            _whole_power_between(4.0),
            promised=True,
        ),
    )
}
