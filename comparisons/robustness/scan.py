"""The scan of an axis: initial values, then bisection between different failure modes. Also the halving of the time step."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated

from pydantic import Field, PlainSerializer, PlainValidator

from dropspin.comparisons.robustness.axes import AXES, Axis
from dropspin.comparisons.robustness.failure_modes import Diagnosis, FailureMode
from dropspin.comparisons.robustness.operating_point import OperatingPoint
from dropspin.comparisons.robustness.runner import MOST_STEPS_PER_START, Runner
from dropspin.comparisons.running.inputs import MOST_STEPS

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
    """The diagnosis of an engine at one value of an axis."""

    value: Annotated[float, Field(allow_inf_nan=False)]
    diagnosis: Diagnosis

    @property
    def mode(self) -> FailureMode:
        """The failure mode."""
        return self.diagnosis.mode


@dataclass(frozen=True)
class Transition:
    """Two neighbouring values with different failure modes."""

    before: ScanPoint
    after: ScanPoint


@dataclass(frozen=True)
class AxisScan:
    """The scan of an engine along an axis: its diagnoses in the order of their values; `base` is the nominal value."""

    axis: Annotated[
        Axis, PlainValidator(lambda axis: AXES[axis] if isinstance(axis, str) else axis), PlainSerializer(lambda axis: axis.name)
    ]
    engine: str
    base: float
    points: tuple[ScanPoint, ...]

    def at(self, value: float) -> ScanPoint:
        """The diagnosis at the tested value nearest to a value."""
        coordinate = self.axis.coordinate
        return min(self.points, key=lambda point: abs(coordinate(point.value) - coordinate(value)))

    @property
    def transitions(self) -> list[Transition]:
        """The pairs of neighbours between which the failure mode changes."""
        return [Transition(first, second) for first, second in pairwise(self.points) if first.mode != second.mode]

    @property
    def sound_range(self) -> tuple[int, int] | None:
        """The indices of the first and the last value of the sound range around the nominal value; None if that value is not sound."""
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
    """The diagnoses of an engine at the nominal time step and at repeated halves of it, until it is sound; at most `MOST_HALVINGS`.

    With a floor every step is recorded, because impacts can only be judged from all steps.
    """
    diagnose = runner.along(nominal, AXES["step"])
    most = MOST_STEPS if nominal.scene.floor is None else MOST_STEPS_PER_START
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
    """Scan an axis with an engine. `on_progress` is called after each value; `known` diagnoses are included in the scan."""
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
    return AxisScan(axis, runner.label, base, tuple(points[value] for value in sorted(points)))


def _find_transitions(point: Callable[[float], ScanPoint], axis: Axis, near: float, low: ScanPoint, high: ScanPoint) -> None:
    """Bisect to the value at which the failure mode of the lower point ends, and continue from there."""
    for _ in range(MOST_TRANSITIONS):
        if low.mode == high.mode or UNSTEADY in (low.mode, high.mode):
            return
        below, above = low, high
        while (middle := axis.between(below.value, above.value, near)) is not None:
            found = point(middle)
            below, above = (found, above) if found.mode == low.mode else (below, found)
        low = above
