"""Failure modes of engines along an axis."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from dropspin.comparisons.limits.axes import Axis
from dropspin.comparisons.limits.failure_modes import FAILURE_MODES
from dropspin.comparisons.limits.study import AxisScan, LimitsStudy
from dropspin.reports.plots.chart import Chart, Line, draw
from dropspin.reports.plots.colours import TABLES
from dropspin.reports.plots.style import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS: dict[str, str] = TABLES["failure_modes"]
SAME_MOTION = "#D5D5D5"
"""Along an axis that does not change the exact motion: the engine has its failure mode, if any, at every value."""
BAR = 10.0  # points


def failure_modes(found: LimitsStudy, axis_name: str) -> Chart:
    """The failure mode of each engine along an axis of a study of limits; a dotted line marks the nominal value of the scene.

    Args:
        found: The study.
        axis_name: The name of an axis of the study.
    """
    scans = [scan for scan in found.scans if scan.axis.name == axis_name]
    axis = scans[0].axis
    bars = [bar for row, scan in enumerate(scans) for bar in _bars(scan, row)]
    order = ["same motion", *map(_in_words, FAILURE_MODES)]
    nominal = Line(
        "nominal value", np.full(2, axis.coordinate(scans[0].base)), np.array([-0.5, len(scans) - 0.5]), width=1.0, dashes="dotted"
    )
    values = [point.value for scan in scans for point in scan.points]
    return Chart(
        axis.label,
        "engine",
        [*sorted(bars, key=lambda bar: order.index(bar.label)), nominal],
        ticks=_ticks(axis, values),
        x_range=(axis.coordinate(min(values)), axis.coordinate(max(values))) if max(values) > min(values) else None,
        rows=[scan.engine for scan in scans],
        x_name="-log(1 - restitution)" if axis.name == "restitution" else f"log of {axis.label}",
        y_name="number of the engine",
    )


def plot_failure_modes(found: LimitsStudy, axis_name: str, axes: "Axes") -> None:
    """Draw `failure_modes` into axes."""
    draw(failure_modes(found, axis_name), axes)


def _bars(scan: AxisScan, row: int) -> Iterator[Line]:
    """A bar for each failure mode between two transitions."""
    place = scan.axis.coordinate
    left = place(scan.points[0].value)
    for inside, outside in [*scan.transitions, (scan.points[-1], scan.points[-1])]:
        right = 0.5 * (place(inside.value) + place(outside.value))
        is_same = scan.axis.invariant and inside.mode == "sound"
        label, colour = ("same motion", SAME_MOTION) if is_same else (_in_words(inside.mode), COLOURS[inside.mode])
        yield Line(label, np.array([left, right]), np.full(2, float(row)), colour, BAR)
        left = right


def _in_words(mode: str) -> str:
    return mode.replace("_", " ")


def _ticks(axis: Axis, values: list[float]) -> list[tuple[float, str]]:
    """Ticks at each power of ten, or at every third one; for coefficients of restitution, at the tested values."""
    low, high = min(values), max(values)
    if axis.name == "restitution":
        ticks = [value for value in (0.0, 0.9, 0.99, 0.999, 0.9999) if low <= value <= high]
    else:
        powers = range(int(np.ceil(np.log10(low))), int(np.floor(np.log10(high))) + 1)
        ticks = [10.0**power for power in powers if len(powers) <= 6 or power % 3 == 0]
    return [(axis.coordinate(tick), plain(tick)) for tick in ticks]
