"""The scan of an axis: a few values, and bisection between neighbours with different failure modes; and smaller steps than the nominal."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from comparisons.robustness.axes import AXES, Axis
from comparisons.robustness.failure_modes import Diagnosis, FailureMode
from comparisons.robustness.operating_point import OperatingPoint
from comparisons.robustness.runner import MOST_ROWS, Runner
from comparisons.running.inputs import MOST_STEPS
from scenarios import Scenario

NEAR = 1.03
"""The ratio of the two values of a transition, at most."""
MOST_TRANSITIONS = 3
"""Between two of the first values; more of them would be chance."""
UNSTEADY = "timed_out"
"""The failure mode whose transitions depend on the machine, and are not bisected."""

MOST_HALVINGS = 6
FINAL = frozenset({"sound", "declined", "crashed", "timed_out"})
"""Failure modes at which no smaller step is tried."""


@dataclass(frozen=True)
class ScanPoint:
    """The diagnosis of an engine at one value of an axis."""

    value: float
    diagnosis: Diagnosis

    @property
    def mode(self) -> FailureMode:
        """Its failure mode."""
        return self.diagnosis.mode


@dataclass(frozen=True)
class Transition:
    """Two neighbouring points with different failure modes."""

    before: ScanPoint
    after: ScanPoint


@dataclass(frozen=True)
class AxisScan:
    """An engine along an axis: its points in the order of their values; `base` is the nominal value."""

    scene: Scenario
    axis: Axis
    engine: str
    base: float
    points: tuple[ScanPoint, ...]

    def at(self, value: float) -> ScanPoint:
        """The point that is nearest to a value."""
        coordinate = self.axis.coordinate
        return min(self.points, key=lambda point: abs(coordinate(point.value) - coordinate(value)))

    @property
    def transitions(self) -> list[Transition]:
        """The pairs of neighbours between which the failure mode changes."""
        return [Transition(first, second) for first, second in pairwise(self.points) if first.mode != second.mode]

    @property
    def sound_range(self) -> tuple[int, int] | None:
        """The numbers of the first and the last point of the sound range around the nominal value; None if that is not sound."""
        sound = [point.mode == "sound" for point in self.points]
        first = last = next(number for number, point in enumerate(self.points) if point.value == self.base)
        if not sound[first]:
            return None
        while first > 0 and sound[first - 1]:
            first -= 1
        while last < len(sound) - 1 and sound[last + 1]:
            last += 1
        return first, last


def refine(runner: Runner, nominal: OperatingPoint, on_progress: Callable[[float], None] = lambda dt: None) -> tuple[ScanPoint, ...]:
    """An engine at the nominal time step, and at halves of it until it is sound, `MOST_HALVINGS` at most.

    With a floor every step is recorded, because impacts are judged from that only.
    """
    diagnose = runner.along(nominal, AXES["step"])
    most = MOST_STEPS if nominal.scene.floor is None else MOST_ROWS
    points: list[ScanPoint] = []
    for dt in (nominal.dt / 2**halving for halving in range(1 + MOST_HALVINGS)):
        if points and (nominal.scene.duration / dt > most or points[-1].mode in FINAL):
            break
        points.append(ScanPoint(dt, diagnose(dt)))
        on_progress(dt)
    return tuple(points)


def scan_axis(
    runner: Runner,
    nominal: OperatingPoint,
    axis: Axis,
    near: float = NEAR,
    on_progress: Callable[[float], None] = lambda value: None,
    known: Sequence[ScanPoint] = (),
) -> AxisScan:
    """Scan an axis with an engine; `on_progress` is called with each value that is done, `known` points are part of the scan."""
    base = axis.base(nominal)
    diagnose = runner.along(nominal, axis)
    points = {one.value: one for one in known}

    def point(value: float) -> ScanPoint:
        if value not in points:
            points[value] = ScanPoint(value, diagnose(value))
            on_progress(value)
        return points[value]

    first = [point(value) for value in sorted({*axis.values(nominal), base, *points})]
    for low, high in pairwise(first):
        _find_transitions(point, axis, near, low, high)
    return AxisScan(nominal.scene, axis, runner.label, base, tuple(points[value] for value in sorted(points)))


def _find_transitions(point: Callable[[float], ScanPoint], axis: Axis, near: float, low: ScanPoint, high: ScanPoint) -> None:
    """Bisect to where the lower point's failure mode ends, and continue from there."""
    for _ in range(MOST_TRANSITIONS):
        if low.mode == high.mode or UNSTEADY in (low.mode, high.mode):
            return
        below, above = low, high
        while (middle := axis.between(below.value, above.value, near)) is not None:
            found = point(middle)
            below, above = (found, above) if found.mode == low.mode else (below, found)
        low = above
