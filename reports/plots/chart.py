"""A chart as data: the lines of a plot with their labels, scales and remarks. matplotlib and the script of the report draw it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import cycle
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from dropspin.reports.plots.colours import TABLES, Dashes, human_label
from dropspin.reports.plots.style import LINE, ROUNDING, ink, is_grey, label_powers
from dropspin.scenarios.state import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DASHES: dict[Dashes, Any] = {"": "-", "dashed": (0, (3, 3)), "dotted": ":", "dashdot": "-.", "long": (0, (9, 2))}
GREYS: list[tuple[str, Dashes]] = TABLES["greys"]
"""Greys and dash patterns of the lines in a grey style, in the order of their labels."""
MARKER = 5.0  # points
BETWEEN_MARKERS = 0.18  # of the diagonal of the axes
LONGEST_ROW = 24
"""Characters of a line of the label of a row, and of the label of the y axis."""
LONGEST_LEVEL_LABEL = 8  # characters of a tick of the x axis
FLAT = 1e-9
"""Values that vary by less than this share of the largest value are drawn as constant, so that the axis does not show rounding errors."""


@dataclass(frozen=True, eq=False)
class Line:
    """A line of a chart.

    Attributes:
        label: Label in the legend; lines with the same label are shown and hidden together.
        x: Positions of the values along the x axis, shape (n,).
        y: The values, shape (n,); NaN is a gap.
        colour: A colour; empty for the colour of the text.
        width: Width [points]; 0 for markers alone.
        dashes: The dash pattern of the line.
        marker: A marker of matplotlib; empty for none.
        is_sparse: Whether only a few points have markers, different points for each line, so that lines that coincide stay visible.
        low, high: A band around the values, shape (n,) each.
        is_step: Whether a value holds until the next one.
        is_fill: Whether only the band is drawn: an envelope.
    """

    label: str
    x: Array
    y: Array
    colour: str = ""
    width: float = LINE
    dashes: Dashes = ""
    marker: str = ""
    is_sparse: bool = False
    low: Array | None = None
    high: Array | None = None
    is_step: bool = False
    is_fill: bool = False


@dataclass(frozen=True)
class Chart:
    """A plot as data.

    Attributes:
        x_label, y_label: Labels of the axes, with units.
        x_name, y_name: What x and y of the lines are, with units, where it is not what the labels say; else empty.
        lines: The lines, in the order they are drawn.
        x_log, y_log: Whether an axis is logarithmic.
        ticks: Positions and texts of the ticks of the x axis; empty for automatic ones.
        reference: Label of the line that can be subtracted from the others; empty if no line has the same times as the others.
        rounding: Values below this are rounding errors.
        remark: A sentence below the plot.
        x_range: The limits of the x axis; None for the range of the data.
        rows: Labels of the rows, if y is the number of a row, with the first row at the top; empty if y is a value.
        is_map: Whether both axes have the same scale and no ticks.
        texts: Texts, each with its position x and y.
    """

    x_label: str
    y_label: str
    lines: Sequence[Line]
    x_log: bool = False
    y_log: bool = False
    ticks: Sequence[tuple[float, str]] = ()
    reference: str = ""
    rounding: float = 0.0
    remark: str = ""
    x_range: tuple[float, float] | None = None
    rows: Sequence[str] = ()
    is_map: bool = False
    texts: Sequence[tuple[float, float, str]] = ()
    x_name: str = ""
    y_name: str = ""

    @property
    def is_flat(self) -> bool:
        """Whether all values are equal, up to rounding."""
        drawn = [values[np.isfinite(values)] for line in self.lines for values in (line.y, line.low, line.high) if values is not None]
        values = np.concatenate([np.empty(0), *drawn])
        return (
            not (self.y_log or self.rows or self.is_map) and len(values) > 0 and float(np.ptp(values)) <= FLAT * float(np.abs(values).max())
        )


def draw(chart: Chart, axes: "Axes") -> None:
    """Draw a chart with matplotlib, in the current style; in a grey one, lines differ by grey, dash pattern and marker."""
    axes.set(xscale="log" if chart.x_log else "linear", yscale="log" if chart.y_log else "linear")
    _draw_lines(in_grey(chart) if is_grey() else chart, axes)
    if chart.is_flat:
        low, high = axes.get_ylim()
        middle = 0.5 * (low + high)
        axes.set_ylim(middle - 0.1 * abs(middle) - ROUNDING, middle + 0.1 * abs(middle) + ROUNDING)
    if chart.ticks:
        places, labels = zip(*chart.ticks, strict=True)
        axes.set_xticks(places, labels, rotation=30.0 if max(map(len, labels)) > LONGEST_LEVEL_LABEL else 0.0)
        axes.minorticks_off()
    elif chart.x_log:
        label_powers(axes, "x")
    if chart.y_log:
        label_powers(axes, "y")
    elif chart.rows:
        axes.set_yticks(range(len(chart.rows)), [fill(human_label(row), LONGEST_ROW) for row in chart.rows], fontsize="small")
        axes.set_ylim(len(chart.rows) - 0.5, -0.5)
        axes.grid(visible=False)
    else:
        axes.ticklabel_format(axis="y", useOffset=False)
    if chart.is_map:
        axes.set_aspect("equal")
        axes.set_axis_off()
        for x, y, text in chart.texts:
            axes.text(x, y, text, ha="center", va="center")
    if chart.x_range is not None:
        axes.set_xlim(*chart.x_range)
    axes.set_xlabel(chart.x_label)
    axes.set_ylabel("\n".join(fill(part, LONGEST_ROW) for part in chart.y_label.splitlines()))


def in_grey(chart: Chart) -> Chart:
    """The chart for print without colours: a grey and a dash pattern for each label with a colour; for bars, darker along the legend."""
    from matplotlib.colors import to_rgb

    labels = list(dict.fromkeys(line.label for line in chart.lines if line.colour and np.ptp(to_rgb(line.colour)) > 0.0))
    ramp: list[tuple[str, Dashes]] = [(f"{level:.2f}", "") for level in np.linspace(0.85, 0.0, len(labels))]
    greys = dict(zip(labels, ramp if chart.rows else cycle(GREYS), strict=False))

    def grey(line: Line) -> Line:
        shade, dashes = greys.get(line.label, (line.colour, line.dashes))
        return replace(line, colour=shade, dashes=line.dashes or dashes)

    return replace(chart, lines=[grey(line) for line in chart.lines])


def _draw_lines(chart: Chart, axes: "Axes") -> None:
    labelled: set[str] = set()
    sparse = [line for line in chart.lines if line.is_sparse]
    for line in chart.lines:
        # One entry of the legend for all lines of a label; matplotlib leaves out labels that begin with an underscore.
        label = "_" if line.label in labelled else human_label(line.label)
        labelled.add(line.label)
        style: dict[str, Any] = {"solid_capstyle": "butt"} if chart.rows else {}
        if line.is_sparse:
            style["markevery"] = ((sparse.index(line) + 0.5) / len(sparse) * BETWEEN_MARKERS, BETWEEN_MARKERS)
        _draw_line(line, label, np.maximum(line.y, ROUNDING) if chart.y_log else line.y, style, axes)


def _draw_line(line: Line, label: str, y: Array, style: dict[str, Any], axes: "Axes") -> None:
    colour = line.colour or ink()
    if line.low is not None and line.high is not None:
        edge, of_band = (0.8, label) if line.is_fill else (0.0, None)
        axes.fill_between(line.x, line.low, line.high, facecolor=(colour, 0.15), edgecolor=colour, linewidth=edge, label=of_band)
    if line.is_fill:
        return
    style |= {"linestyle": DASHES[line.dashes] if line.width else "none", "linewidth": line.width, "color": colour}
    if line.marker:
        style |= {"marker": line.marker, "markerfacecolor": "none", "markersize": MARKER}
    if line.is_step:
        style["drawstyle"] = "steps-post"
    axes.plot(line.x, y, label=label, **style)
