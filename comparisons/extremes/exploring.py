"""Where an engine breaks: a few values along an axis, and between any two with different conditions, bisection."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from comparisons.extremes.axes import Axis, Setting
from comparisons.extremes.conditions import Condition, Finding
from comparisons.extremes.running import Runner
from scenarios import Scenario

NEAR = 1.03
"""How near to each other, as a ratio, the two values of an edge are."""
MOST_EDGES = 3
"""Between two of the first values; more are a matter of chance."""
UNSTEADY = "timed_out"
"""The condition whose edges depend on the machine, and are not looked for."""


@dataclass(frozen=True)
class Point:
    """What becomes of an engine at a value."""

    value: float
    finding: Finding

    @property
    def condition(self) -> Condition:
        """The finding's."""
        return self.finding.condition


@dataclass(frozen=True)
class Edge:
    """Two neighbouring values of different conditions."""

    before: Point
    after: Point


@dataclass(frozen=True)
class Explored:
    """An engine along an axis: its points, by value; `base` is the scene's own value."""

    scene: Scenario
    axis: Axis
    engine: str
    base: float
    points: tuple[Point, ...]

    def at(self, value: float) -> Point:
        """The point that is nearest to a value."""
        coordinate = self.axis.coordinate
        return min(self.points, key=lambda point: abs(coordinate(point.value) - coordinate(value)))

    @property
    def edges(self) -> list[Edge]:
        """Where the condition changes."""
        return [Edge(first, second) for first, second in pairwise(self.points) if first.condition != second.condition]

    @property
    def sound_range(self) -> tuple[int, int] | None:
        """From the scene's own value, which point is the first and which the last that is sound; None if it is not at its own."""
        sound = [point.condition == "sound" for point in self.points]
        first = last = next(number for number, point in enumerate(self.points) if point.value == self.base)
        if not sound[first]:
            return None
        while first > 0 and sound[first - 1]:
            first -= 1
        while last < len(sound) - 1 and sound[last + 1]:
            last += 1
        return first, last


def explored(
    runner: Runner, setting: Setting, axis: Axis, near: float = NEAR, told: Callable[[float], None] = lambda value: None
) -> Explored:
    """An engine along an axis; `told` is called with each value that is done."""
    base = axis.base(setting)
    look = runner.along(setting, axis)
    points: dict[float, Point] = {}

    def point(value: float) -> Point:
        if value not in points:
            points[value] = Point(value, look(value))
            told(value)
        return points[value]

    first = [point(value) for value in sorted({*axis.values(setting), base})]
    for low, high in pairwise(first):
        _find_edges(point, axis, near, low, high)
    return Explored(setting.scene, axis, runner.label, base, tuple(points[value] for value in sorted(points)))


def _find_edges(point: Callable[[float], Point], axis: Axis, near: float, low: Point, high: Point) -> None:
    """Bisect to where the lower value's condition ends, and go on from there."""
    for _ in range(MOST_EDGES):
        if low.condition == high.condition or UNSTEADY in (low.condition, high.condition):
            return
        below, above = low, high
        while (middle := axis.between(below.value, above.value, near)) is not None:
            found = point(middle)
            below, above = (found, above) if found.condition == low.condition else (below, found)
        low = above
