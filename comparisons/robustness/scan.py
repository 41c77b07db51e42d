"""Where an engine breaks: a few values along an axis, and between any two with different conditions, bisection."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from comparisons.robustness.axes import Axis, OperatingPoint
from comparisons.robustness.failure_modes import Diagnosis, FailureMode
from comparisons.robustness.runner import Runner
from scenarios import Scenario

NEAR = 1.03
"""How near to each other, as a ratio, the two values of an edge are."""
MOST_EDGES = 3
"""Between two of the first values; more are a matter of chance."""
UNSTEADY = "timed_out"
"""The condition whose edges depend on the machine, and are not looked for."""


@dataclass(frozen=True)
class ScanPoint:
    """What becomes of an engine at a value."""

    value: float
    diagnosis: Diagnosis

    @property
    def mode(self) -> FailureMode:
        """Its failure mode."""
        return self.diagnosis.mode


@dataclass(frozen=True)
class Transition:
    """Two neighbouring values of different conditions."""

    before: ScanPoint
    after: ScanPoint


@dataclass(frozen=True)
class AxisScan:
    """An engine along an axis: its points, by value; `base` is the scene's own value."""

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
        """Where the condition changes."""
        return [Transition(first, second) for first, second in pairwise(self.points) if first.mode != second.mode]

    @property
    def sound_range(self) -> tuple[int, int] | None:
        """From the scene's own value, which point is the first and which the last that is sound; None if it is not at its own."""
        sound = [point.mode == "sound" for point in self.points]
        first = last = next(number for number, point in enumerate(self.points) if point.value == self.base)
        if not sound[first]:
            return None
        while first > 0 and sound[first - 1]:
            first -= 1
        while last < len(sound) - 1 and sound[last + 1]:
            last += 1
        return first, last


def scan_axis(
    runner: Runner, setting: OperatingPoint, axis: Axis, near: float = NEAR, on_progress: Callable[[float], None] = lambda value: None
) -> AxisScan:
    """An engine along an axis; `on_progress` is called with each value that is done."""
    base = axis.base(setting)
    look = runner.along(setting, axis)
    points: dict[float, ScanPoint] = {}

    def point(value: float) -> ScanPoint:
        if value not in points:
            points[value] = ScanPoint(value, look(value))
            on_progress(value)
        return points[value]

    first = [point(value) for value in sorted({*axis.values(setting), base})]
    for low, high in pairwise(first):
        _find_edges(point, axis, near, low, high)
    return AxisScan(setting.scene, axis, runner.label, base, tuple(points[value] for value in sorted(points)))


def _find_edges(point: Callable[[float], ScanPoint], axis: Axis, near: float, low: ScanPoint, high: ScanPoint) -> None:
    """Bisect to where the lower value's condition ends, and go on from there."""
    for _ in range(MOST_EDGES):
        if low.mode == high.mode or UNSTEADY in (low.mode, high.mode):
            return
        below, above = low, high
        while (middle := axis.between(below.value, above.value, near)) is not None:
            found = point(middle)
            below, above = (found, above) if found.mode == low.mode else (below, found)
        low = above
