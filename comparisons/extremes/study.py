"""Where engines break: every axis of a scene, one at a time and in pairs."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product, takewhile

from comparisons.extremes.axes import AXES, Axis, Setting
from comparisons.extremes.exploring import Explored, Point, explored
from comparisons.extremes.running import Runner
from comparisons.isolation import Cells, Limits
from comparisons.simulating import Contestant, assert_step_fits, contestant_named
from scenarios import DropspinError, Scenario
from scenarios.errors import UnknownName

IN_FLIGHT = (
    "document",
    "document[rotation=gyroscopic]",
    "document[rotation=rk4]",
    "mujoco",
    "mujoco[integrator=implicitfast]",
    "mujoco[integrator=rk4]",
    "pybullet",
    "pybullet[coordinates=multibody,velocity_clamp=kept]",
)
ON_A_FLOOR = (
    "document",
    "document[contact=sequential,law=coulomb,rotation=rk4]",
    "mujoco",
    "pybullet",
    "pybullet[coordinates=multibody,velocity_clamp=kept]",
)
SCENES = ("spin-principal", "spin-asymmetric", "drop-ball-lively", "drop-box-flat", "rock-block")
"""A spin that every method knows, one that few do, a ball and a box that bounce, and a block that comes to rest."""
DT = 5e-3  # s
WITHIN = 0.1
NEAR_IN_PAIRS = 1.3
LIMITS = Limits(processor_time=60.0)
ACCURATE, STABLE = ("sound",), ("sound", "inaccurate")


@dataclass(frozen=True)
class Mapped:
    """An engine along one axis, for several values of another: by the other's value."""

    scene: Scenario
    axes: tuple[Axis, Axis]
    engine: str
    rows: tuple[tuple[float, Explored], ...]


@dataclass(frozen=True)
class Extremes:
    """What becomes of engines at a scene's extremes.

    Attributes:
        scene: The scene.
        dt: The step where it is not the step that is varied [s].
        within: How large an error may be.
        explored: Engines along axes.
        mapped: Engines in planes of two axes.
        left_out: Engines that do not run the scene, and why.
    """

    scene: Scenario
    dt: float
    within: float
    explored: tuple[Explored, ...]
    mapped: tuple[Mapped, ...]
    left_out: dict[str, str]

    def largest_steps(self, engine: str) -> tuple[float | None, float | None]:
        """The largest steps that an engine is accurate at, and stable, together with all finer ones [s]; None if the finest is not."""
        points = next((one.points for one in self.explored if one.axis.name == "step" and one.engine == engine), ())
        return _last_before_any_other(points, ACCURATE), _last_before_any_other(points, STABLE)


def _last_before_any_other(points: Sequence[Point], allowed: Sequence[str]) -> float | None:
    values = [point.value for point in takewhile(lambda point: point.condition in allowed, points)]
    return values[-1] if values else None


def default_pairs(scene: Scenario) -> list[tuple[str, str]]:
    """The planes that say most of what is cheap to see."""
    wanted = [("spin", "inertia-ratio")] if scene.floor is None else [("step", "size"), ("step", "restitution")]
    return [pair for pair in wanted if all(AXES[name].applies(scene) for name in pair)]


def limits(
    scene: Scenario,
    engines: Sequence[str] = (),
    axes: Sequence[str] = (),
    pairs: Sequence[tuple[str, str]] | None = None,
    dt: float = DT,
    within: float = WITHIN,
    progress: Callable[[str, float], None] = lambda what, share: None,
    time_limits: Limits = LIMITS,
) -> Extremes:
    """Take a scene to its extremes.

    Args:
        scene: The scene.
        engines: Names with options; by default the methods that the scene lets differ.
        axes: Names of axes; by default all that the scene has, see `AXES`.
        pairs: Planes of two axes: along the first for a few values of the second. By default those of `default_pairs`, or none where axes
            are named.
        dt: Time step [s].
        within: How large an error may be: a ratio, or an angle in radians.
        progress: Called with a word on what is done, and the share of all of it.
        time_limits: What an engine may use for one point.

    Raises:
        DropspinError: There is no such engine or axis, or the scene has it not.
    """
    assert_step_fits(scene, dt)
    if not 0.0 < within < math.inf:
        raise DropspinError(f"within: got {within!r}; it is a number above 0, a ratio or an angle in radians.")
    if any(along == across for along, across in pairs or ()):
        raise DropspinError("a pair is of two different axes.")
    chosen = _axes(scene, tuple(dict.fromkeys(axes))) if axes or pairs is None else []
    planes = [tuple(_axes(scene, pair)) for pair in (default_pairs(scene) if pairs is None and not axes else pairs or [])]
    named = [contestant_named(name) for name in engines or (IN_FLIGHT if scene.floor is None else ON_A_FLOOR)]
    contestants = list({one.label: one for one in named}.values())
    left_out: dict[str, str] = {one.label: one.missing for one in contestants if one.engine is None}
    taking_part = [one for one in contestants if one.engine is not None]
    setting = Setting(scene, dt)
    work = len(taking_part) * (len(chosen) + 2 * len(planes))
    done, lines, maps = 0, [], []

    def told(contestant: Contestant, what: str) -> Callable[[float], None]:
        return lambda value: progress(f"{contestant.label}, {what} {value:.3g}", done / work)

    with Cells(time_limits) as cells:
        for contestant, axis in product(taking_part, chosen):
            lines.append(explored(Runner(contestant, within, cells), setting, axis, told=told(contestant, axis.name)))
            done += 1
        for contestant, (along, across) in product(taking_part, planes):
            runner, rows = Runner(contestant, within, cells), []
            for value in across.values(setting):
                moved = across.at(setting, value)
                what = f"{across.name} {value:.3g}, {along.name}"
                rows.append((value, explored(runner, moved, along, NEAR_IN_PAIRS, told(contestant, what))))
            maps.append(Mapped(scene, (along, across), contestant.label, tuple(rows)))
            done += 2
    return Extremes(scene, dt, within, tuple(lines), tuple(maps), left_out)


def _axes(scene: Scenario, names: Sequence[str]) -> list[Axis]:
    """The axes of these names, or all that a scene has."""
    for name in names:
        if name not in AXES:
            raise UnknownName("axis", name, AXES)
        if not AXES[name].applies(scene):
            has = ", ".join(axis.name for axis in AXES.values() if axis.applies(scene))
            raise DropspinError(f"axis {name!r}: {scene.name} has none; it has {has}.")
    return [AXES[name] for name in names] if names else [axis for axis in AXES.values() if axis.applies(scene)]
