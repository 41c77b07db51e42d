"""The study of the command `dropspin limits`: engines along every axis of a scene."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import product, takewhile

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.robustness.axes import AXES, Axis
from dropspin.comparisons.robustness.operating_point import OperatingPoint
from dropspin.comparisons.robustness.runner import Runner
from dropspin.comparisons.robustness.scan import AxisScan, ScanPoint, refine, scan_axis
from dropspin.comparisons.running.entries import engine_entry
from dropspin.comparisons.running.inputs import EngineEntry, SceneLike, as_scene, ignore, several, verify_time_step
from dropspin.comparisons.running.parallel import results_in_parallel, started_crews
from dropspin.comparisons.running.processes import EngineProcesses, ResourceLimits
from dropspin.scenarios import DropspinError, Scenario
from dropspin.scenarios.errors import UnknownName

IN_FLIGHT = (
    "wang",
    "wang[rotation=gyroscopic]",
    "wang[rotation=rk4]",
    "mujoco",
    "mujoco[integrator=implicitfast]",
    "mujoco[integrator=rk4]",
    "pybullet",
    "pybullet[coordinates=multibody,velocity_clamp=kept]",
)
ON_A_FLOOR = (
    "wang",
    "wang[contact=sequential,law=coulomb,rotation=rk4]",
    "mujoco",
    "pybullet",
    "pybullet[coordinates=multibody,velocity_clamp=kept]",
)
SCENES = ("spin-principal", "spin-asymmetric", "drop-ball-lively", "drop-box-flat", "rock-block")
"""A rotation that every method reproduces, one that few reproduce, a ball and a box that bounce, and a block that comes to rest."""
DT = 5e-3  # s
WITHIN = 0.1
RESOURCES = ResourceLimits(processor_time=60.0)
ACCURATE, STABLE = ("sound",), ("sound", "inaccurate")


@dataclass(frozen=True)
class RobustnessStudy:
    """The failure modes of engines at extreme values of a scene.

    Attributes:
        scene: The scene.
        dt: The time step, if it is not varied [s].
        within: The largest error that counts as accurate: a ratio, or an angle in radians.
        scans: The scans of each engine along each axis.
        left_out: Engines that do not run the scene, with the reason.
        refinements: For each other engine, the diagnosis at the nominal time step, and, if it is not sound there, at smaller time steps.
    """

    scene: Scenario
    dt: float
    within: float
    scans: tuple[AxisScan, ...]
    left_out: dict[str, str]
    refinements: dict[str, tuple[ScanPoint, ...]]

    def steps(self, engine: str) -> tuple[ScanPoint, ...]:
        """The diagnoses of an engine at each time step tried, in the order of the time steps."""
        scanned = (one.points for one in self.scans if one.axis.name == "step" and one.engine == engine)
        return next(scanned, tuple(reversed(self.refinements.get(engine, ()))))

    def largest_steps(self, engine: str) -> tuple[float | None, float | None]:
        """The largest tested time steps up to which an engine is accurate, and stable [s]; None if there is none."""
        points = self.steps(engine)
        return _last_in_a_row(points, ACCURATE), _last_in_a_row(points, STABLE)


def _last_in_a_row(points: Sequence[ScanPoint], allowed: Sequence[str]) -> float | None:
    """The last value of the initial sequence of points whose modes are allowed."""
    values = [point.value for point in takewhile(lambda point: point.mode in allowed, points)]
    return values[-1] if values else None


def find_limits(
    scene: SceneLike,
    engines: Engine | str | Iterable[Engine | str] = (),
    axes: Sequence[str] = (),
    *,
    dt: float = DT,
    within: float = WITHIN,
    on_progress: Callable[[str, float], None] | None = None,
    resources: ResourceLimits = RESOURCES,
    jobs: int | None = None,
) -> RobustnessStudy:
    """Vary one quantity of a scene at a time, up to extreme values, and find the failure modes of engines.

    Args:
        scene: A scene, its catalogue name, the path of its file, or a mapping with the same keys.
        engines: One engine or several: engines, or names with options; by default methods that give different results for such scenes.
        axes: Names of axes, such as `step`, `spin` or `mass`; by default all that the scene has.
        dt: Time step, if it is not varied [s].
        within: The largest error that counts as accurate: a ratio, or an angle in radians.
        on_progress: Called with a description of the current work and the fraction of the whole study that is done, from 0 to 1, in any
            thread, but in one at a time.
        resources: The processor time [s] and memory [bytes] that an engine may use for one tested value.
        jobs: Number of axes to scan at a time; by default, the number of processors that this process may use. It changes no result.

    Returns:
        For each engine and axis, the ranges in which the engine is accurate and stable, and its failure modes outside them.

    Raises:
        DropspinError: An engine or an axis does not exist, or the scene does not have the axis.
    """
    scene = as_scene(scene)
    verify_time_step(scene, dt)
    if not 0.0 < within < math.inf:
        raise DropspinError(f"within: got {within!r}; give a number above 0, a ratio or an angle in radians.")
    chosen = _axes(scene, tuple(dict.fromkeys(axes)))
    named = [engine_entry(name) for name in several("engines", engines) or (IN_FLIGHT if scene.floor is None else ON_A_FLOOR)]
    entries = list({one.label: one for one in named}.values())
    left_out = {one.label: one.reason for one in entries if one.engine is None}
    present = [one for one in entries if one.engine is not None]
    nominal, callback = OperatingPoint(scene, dt), on_progress or ignore

    def refined(entry: EngineEntry, processes: EngineProcesses, report: Callable[[str], None]) -> tuple[ScanPoint, ...]:
        return refine(Runner(entry, within, processes), nominal, lambda value: report(f"{entry.label}, dt {value:.3g}"))

    def scanned(piece: tuple[EngineEntry, Axis], processes: EngineProcesses, report: Callable[[str], None]) -> AxisScan:
        entry, axis = piece
        known = refinements[entry.label] if axis.name == "step" else ()
        runner = Runner(entry, within, processes)
        return scan_axis(runner, nominal, axis, on_progress=lambda value: report(f"{entry.label}, {axis.name} {value:.3g}"), known=known)

    pieces = list(product(present, chosen))
    with started_crews(jobs, len(pieces), present, resources) as crews:
        share = 1.0 / (1 + len(chosen))
        found = results_in_parallel(present, refined, crews, lambda what, done: callback(what, share * done))
        refinements = {entry.label: points for entry, points in zip(present, found, strict=True)}
        scans = results_in_parallel(pieces, scanned, crews, lambda what, done: callback(what, share + (1.0 - share) * done))
    return RobustnessStudy(scene, dt, within, tuple(scans), left_out, refinements)


def _axes(scene: Scenario, names: Sequence[str]) -> list[Axis]:
    """The axes with these names, or all axes that a scene has."""
    for name in names:
        if name not in AXES:
            raise UnknownName("axis", name, AXES)
        if not AXES[name].applies(scene):
            has = ", ".join(axis.name for axis in AXES.values() if axis.applies(scene))
            raise DropspinError(f"axis {name!r}: {scene.name} does not have it; it has {has}.")
    return [AXES[name] for name in names] if names else [axis for axis in AXES.values() if axis.applies(scene)]
