"""The study of the command `dropspin limits`: engines along every axis of a scene.

An axis is scanned at its initial values, then by bisection between different failure modes. Which value comes next follows from the
diagnoses so far, so the scan is a loop.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise, product
from typing import Annotated

from pydantic import Field, PlainSerializer, PlainValidator

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.limits.axes import AXES, Axis
from dropspin.comparisons.limits.failure_modes import Diagnosis, FailureMode
from dropspin.comparisons.limits.operating_point import OperatingPoint
from dropspin.comparisons.limits.runner import MOST_STEPS_PER_START, Runner
from dropspin.comparisons.running.arguments import MOST_STEPS, EngineEntry, SceneLike, as_scene, ignore, verify_time_step
from dropspin.comparisons.running.engine_entries import engine_entries
from dropspin.comparisons.running.parallel import results_in_parallel, started_crews
from dropspin.comparisons.running.process_limits import ONE_MINUTE, ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.scenarios import DropspinError, Scenario
from dropspin.scenarios.errors import verify_known

IN_FLIGHT = (
    *("wang", "wang[rotation=gyroscopic]", "wang[rotation=rk4]"),
    *("mujoco", "mujoco[integrator=implicitfast]", "mujoco[integrator=rk4]"),
    *("pybullet", "pybullet[coordinates=multibody,velocity_clamp=kept]"),
)
ON_A_FLOOR = (
    *("wang", "wang[contact=sequential,law=coulomb,rotation=rk4]", "mujoco"),
    *("pybullet", "pybullet[coordinates=multibody,velocity_clamp=kept]"),
)
SCENES = ("spin-principal", "spin-asymmetric", "drop-ball-lively", "drop-box-flat", "rock-block")
"""A rotation that every method reproduces, one that few reproduce, a ball and a box that bounce, and a block that comes to rest."""
DT = 5e-3  # s
WITHIN = 0.1
ACCURATE, STABLE = ("sound",), ("sound", "inaccurate")

NEAR = 1.03
"""Largest ratio of the two values of a transition."""
MOST_TRANSITIONS = 3
"""Largest number of transitions between two initial values; more of them would be due to chance."""
UNSTEADY = "timed_out"
"""The failure mode whose transitions are not bisected, because they depend on the machine."""
MOST_HALVINGS = 6
FINAL = frozenset({"sound", "declined", "crashed", "timed_out"})
"""Failure modes after which no smaller time step is tried."""


@dataclass(frozen=True)
class ScanPoint:
    """The failure mode of an engine at one value of an axis."""

    value: Annotated[float, Field(allow_inf_nan=False)]
    diagnosis: Diagnosis

    @property
    def mode(self) -> FailureMode:
        """The failure mode."""
        return self.diagnosis.mode


@dataclass(frozen=True)
class AxisScan:
    """The scan of an engine along an axis: its failure modes in the order of the values; `base` is the nominal value."""

    axis: Annotated[
        Axis, PlainValidator(lambda axis: AXES[axis] if isinstance(axis, str) else axis), PlainSerializer(lambda axis: axis.name)
    ]
    engine: str
    base: float
    points: tuple[ScanPoint, ...]

    @property
    def nominal(self) -> ScanPoint:
        """The diagnosis at the nominal value."""
        return next(point for point in self.points if point.value == self.base)

    @property
    def transitions(self) -> list[tuple[ScanPoint, ScanPoint]]:
        """The pairs of neighbours between which the failure mode changes."""
        return [(first, second) for first, second in pairwise(self.points) if first.mode != second.mode]

    @property
    def sound_range(self) -> tuple[int, int] | None:
        """The indices of the first and the last value of the sound range around the nominal value; None if that value is not sound."""
        nominal = self.points.index(self.nominal)
        return next(((row[0], row[-1]) for row in _rows(self.points, ACCURATE) if nominal in row), None)


@dataclass(frozen=True)
class LimitsStudy:
    """The failure modes of engines at extreme values of a scene.

    Attributes:
        scene: The scene.
        dt: The time step, if it is not varied [s].
        within: The largest error that counts as accurate: relative to the scale of the metric, or in rad for an angle.
        scans: The scans of each engine along each axis.
        left_out: The engines that do not run the scene, with the reason.
        refinements: For each engine that runs the scene, its failure mode at the nominal time step and, if the run is not sound, at smaller
            time steps.
    """

    scene: Scenario
    dt: float
    within: float
    scans: tuple[AxisScan, ...]
    left_out: dict[str, str]
    refinements: dict[str, tuple[ScanPoint, ...]]

    def step_ranges(self, engine: str) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
        """The tested time steps [s] from and up to which an engine is accurate, and stable; None if there are none.

        They begin with the smallest one, or, if the engine is accurate or stable at the nominal one, below this where that begins: at
        smaller ones errors may grow by rounding.
        """
        nominal = next((scan.base for scan in self.scans if scan.axis.name == "step" and scan.engine == engine), math.nan)
        points = self.steps(engine)
        return _range(points, ACCURATE, nominal), _range(points, STABLE, nominal)

    def steps(self, engine: str) -> tuple[ScanPoint, ...]:
        """The failure mode of an engine at each tested time step, in the order of the time steps."""
        scanned = (scan.points for scan in self.scans if scan.axis.name == "step" and scan.engine == engine)
        return next(scanned, tuple(reversed(self.refinements.get(engine, ()))))


def _rows(points: Sequence[ScanPoint], allowed: Sequence[str]) -> list[list[int]]:
    """The indices of the points in each row of neighbours whose modes are allowed."""
    by_mode = groupby(range(len(points)), lambda number: points[number].mode in allowed)
    return [list(numbers) for is_allowed, numbers in by_mode if is_allowed]


def _range(points: Sequence[ScanPoint], allowed: Sequence[str], nominal: float) -> tuple[float, float] | None:
    """The first and the last value of the points in a row whose modes are allowed, around the nominal one or else from the first on."""
    rows = [[points[number].value for number in row] for row in _rows(points, allowed)]
    found = next((row for row in rows if nominal in row), rows[0] if rows and rows[0][0] == points[0].value else None)
    return None if found is None else (found[0], found[-1])


def find_limits(
    scene: SceneLike,
    engines: Engine | str | Iterable[Engine | str] = (),
    axes: Sequence[str] = (),
    *,
    dt: float = DT,
    within: float = WITHIN,
    on_progress: Callable[[str, float], None] | None = None,
    resources: ResourceLimits = ONE_MINUTE,
    jobs: int | None = None,
) -> LimitsStudy:
    """Vary one quantity of a scene at a time, up to extreme values, and find the failure modes of engines.

    Args:
        scene: A scene, its catalogue name, the path of its file, or a mapping with the same keys.
        engines: One engine or several: engines, or names with options; by default, several methods that give different results in this
            scene.
        axes: Names of the quantities to vary, such as `step`, `spin` or `mass`; by default, all that the scene has.
        dt: Time step [s], unless it is varied.
        within: The largest error that counts as accurate: relative to the scale of the metric, or in rad for an angle.
        on_progress: Called with a description of the current work and the fraction of the whole study that is done, from 0 to 1, in any
            thread, but in one at a time.
        resources: The processor time [s] and memory [bytes] that an engine may use for one tested value.
        jobs: Number of axes to scan at a time; by default, the number of processors that this process may use. It changes no result.

    Returns:
        For each engine and axis, the failure mode at each tested value, or that the engine is sound there.

    Raises:
        DropspinError: An engine or an axis does not exist, or the scene does not have the quantity of an axis.
    """
    scene = as_scene(scene)
    verify_time_step(scene, dt)
    if not 0.0 < within < math.inf:
        raise DropspinError(f"within: got {within!r}; give a number above 0, a ratio or an angle in radians.")
    chosen = _axes(scene, tuple(dict.fromkeys(axes)))
    entries = engine_entries(engines, IN_FLIGHT if scene.floor is None else ON_A_FLOOR)
    left_out = {entry.label: entry.reason for entry in entries if entry.engine is None}
    present = [entry for entry in entries if entry.engine is not None]
    nominal, callback = OperatingPoint(scene, dt), on_progress or ignore

    def refined(entry: EngineEntry, processes: EngineProcesses, report: Callable[[str], None]) -> tuple[ScanPoint, ...]:
        return refine(Runner(entry, nominal, within, processes, report))

    def scanned(piece: tuple[EngineEntry, Axis], processes: EngineProcesses, report: Callable[[str], None]) -> AxisScan:
        entry, axis = piece
        known = refinements[entry.label] if axis.name == "step" else ()
        return scan_axis(Runner(entry, nominal, within, processes, report), axis, known=known)

    pieces = list(product(present, chosen))
    with started_crews(jobs, len(pieces), present, resources) as crews:
        share = 1.0 / (1 + len(chosen))
        results = results_in_parallel(present, refined, crews, lambda work, done: callback(work, share * done))
        refinements = {entry.label: points for entry, points in zip(present, results, strict=True)}
        scans = results_in_parallel(pieces, scanned, crews, lambda work, done: callback(work, share + (1.0 - share) * done))
    return LimitsStudy(scene, dt, within, tuple(scans), left_out, refinements)


def _axes(scene: Scenario, names: Sequence[str]) -> list[Axis]:
    """The axes with these names, or all axes that a scene has."""
    verify_known("axis", names, AXES)
    has = [name for name, axis in AXES.items() if axis.applies(scene)]
    for name in names:
        if name not in has:
            raise DropspinError(f"axis {name!r}: {scene.name} does not have it; it has {', '.join(has)}.")
    return [AXES[name] for name in names or has]


def refine(runner: Runner) -> tuple[ScanPoint, ...]:
    """The diagnoses of an engine at the nominal time step and at repeated halves of it, until it is sound; at most `MOST_HALVINGS`.

    With a floor every step is recorded, because impacts can only be judged from all steps.
    """
    scene, dt = runner.nominal
    diagnose = runner.along(AXES["step"])
    most = MOST_STEPS if scene.floor is None else MOST_STEPS_PER_START
    points: list[ScanPoint] = []
    for smaller in (dt / 2**halving for halving in range(1 + MOST_HALVINGS)):
        if points and (scene.duration / smaller > most or points[-1].mode in FINAL):
            break
        points.append(ScanPoint(smaller, diagnose(smaller)))
        runner.report(f"{runner.entry.label}, dt {smaller:.3g}")
    return tuple(points)


def scan_axis(runner: Runner, axis: Axis, near: float = NEAR, known: Sequence[ScanPoint] = ()) -> AxisScan:
    """Scan an axis with an engine: the initial values, then bisection between different failure modes; with diagnoses that are `known`."""
    base, diagnose = axis.base(runner.nominal), runner.along(axis)
    points = {tried.value: tried for tried in known}

    def point(value: float) -> ScanPoint:
        if value not in points:
            points[value] = ScanPoint(value, diagnose(value))
            runner.report(f"{runner.entry.label}, {axis.name} {value:.3g}")
        return points[value]

    first = [point(value) for value in sorted({*axis.values(runner.nominal), base, *points})]
    for start, high in pairwise(first):
        low = start
        for _ in range(MOST_TRANSITIONS):
            if low.mode == high.mode or UNSTEADY in (low.mode, high.mode):
                break
            # Bisect to the value at which the failure mode of the lower point ends, and continue from there.
            below, above = low, high
            while (middle := axis.between(below.value, above.value, near)) is not None:
                inner = point(middle)
                below, above = (inner, above) if inner.mode == low.mode else (below, inner)
            low = above
    return AxisScan(axis, runner.entry.label, base, tuple(points[value] for value in sorted(points)))
