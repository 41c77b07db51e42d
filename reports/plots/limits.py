"""Failure modes of engines along an axis."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from comparisons.robustness.axes import Axis
from comparisons.robustness.failure_modes import FAILURE_MODES
from comparisons.robustness.scan import AxisScan
from comparisons.robustness.study import RobustnessStudy
from reports.plots.style import REPORT, ink

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Sound is pale; the others, after Okabe & Ito (2008), are distinguishable with any colour vision.
COLOURS = {
    "declined": "none",
    "sound": "#D9E8D9",
    "inaccurate": "#F0E442",
    "gains_energy": "#E69F00",
    "sinks": "#56B4E9",
    "tunnels": "#0072B2",
    "clamped": "#CC79A7",
    "diverged": "#D55E00",
    "crashed": "#000000",
    "timed_out": "#8C8C8C",
}
HEIGHT = 0.82


def plot_failure_modes(found: RobustnessStudy, axis_name: str, axes: "Axes") -> None:
    """Draw the failure mode of each engine along an axis of a robustness study; the nominal value of the scene is dotted.

    Args:
        found: The study.
        axis_name: One of its axes.
        axes: The axes to draw into.
    """
    lines = [line for line in found.scans if line.axis.name == axis_name]
    for number, line in enumerate(lines):
        _draw_segments(line, number, HEIGHT, axes)
    axes.axvline(lines[0].axis.coordinate(lines[0].base), color=ink(), linewidth=0.8, linestyle=":")
    axes.set_yticks(range(len(lines)), [_in_lines(line.engine) for line in lines], fontsize=7)
    axes.set_ylabel("engine")
    axes.invert_yaxis()
    _label(lines[0].axis, [point.value for line in lines for point in line.points], axes)


def _in_lines(label: str) -> str:
    """The label of an engine, two options per line."""
    name, _, listed = label.partition("[")
    options = listed.removesuffix("]").split(",")
    lines = [",".join(options[first : first + 2]) for first in range(0, len(options), 2)]
    return name if not listed else f"{name}[" + ",\n".join(lines) + "]"


def _draw_segments(line: AxisScan, row: float, height: float, axes: "Axes") -> None:
    """Draw a bar for each failure mode between two transitions."""
    place = line.axis.coordinate
    left = place(line.points[0].value)
    for inside, outside in [*((edge.before, edge.after) for edge in line.transitions), (line.points[-1], line.points[-1])]:
        right = 0.5 * (place(inside.value) + place(outside.value))
        name = _in_words(inside.mode)
        label = None if name in axes.get_legend_handles_labels()[1] else name
        axes.barh(row, right - left, height, left, color=COLOURS[inside.mode], edgecolor=ink(), linewidth=0.0, label=label)
        left = right


def _in_words(mode: str) -> str:
    return mode.replace("_", " ")


def _label(axis: Axis, values: Sequence[float], axes: "Axes") -> None:
    """Set ticks at each power of ten, or at each third one; for restitutions, at the values of the study."""
    low, high = min(values), max(values)
    if axis.name == "restitution":
        ticks = [value for value in (0.0, 0.9, 0.99, 0.999, 0.9999) if low <= value <= high]
    else:
        powers = range(int(np.ceil(np.log10(low))), int(np.floor(np.log10(high))) + 1)
        ticks = [10.0**power for power in powers if len(powers) <= 6 or power % 3 == 0]
    axes.set_xticks([axis.coordinate(tick) for tick in ticks], [f"{tick:g}".replace("e-0", "e-").replace("e+0", "e") for tick in ticks])
    if high > low:
        axes.set_xlim(axis.coordinate(low), axis.coordinate(high))
    axes.set_xlabel(axis.label)
    axes.grid(visible=False)


def limits_figure(found: RobustnessStudy) -> "Figure":
    """The failure modes of all engines along all axes of a scene, one panel per axis."""
    names = list(dict.fromkeys(line.axis.name for line in found.scans))
    engines = len({line.engine for line in found.scans})
    with _panels(len(names), 2, (5.4, 1.0 + 0.3 * engines)) as (figure, panels):
        for axes, name in zip(panels, names, strict=False):
            plot_failure_modes(found, name, axes)
        for number, axes in enumerate(panels):
            axes.set_ylabel("")
            if number % 2:
                axes.set_yticklabels([])
        _add_legend(figure, panels)
    return figure


@contextmanager
def _panels(count: int, across: int, size: tuple[float, float]) -> "Iterator[tuple[Figure, list[Axes]]]":
    """A figure with `count` panels of this size [inches], at most `across` in a row."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    across = min(count, across)
    down = -(-count // across)
    with rc_context(REPORT):
        figure = Figure(figsize=(size[0] * across, size[1] * down), layout="constrained")
        yield figure, [figure.add_subplot(down, across, place) for place in range(1, count + 1)]


def _add_legend(figure: "Figure", panels: "list[Axes]") -> None:
    """Add a legend of the failure modes that occur, from the mildest to the worst."""
    named = {label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    shown = [_in_words(mode) for mode in FAILURE_MODES if _in_words(mode) in named]
    figure.legend([named[label] for label in shown], shown, loc="outside upper left", ncols=len(shown), fontsize=8)
