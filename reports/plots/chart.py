"""A chart as data: the lines of a plot with their labels, scales and remarks. matplotlib and the script of the report draw it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from dropspin.comparisons.engines.options import parts_of
from dropspin.reports.plots.style import REPORT, ROUNDING, Array, ink, label_powers, load_matplotlib

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Dashes = Literal["", "dashed", "dotted"]
DASHES: dict[Dashes, Any] = {"": "-", "dashed": (0, (3, 3)), "dotted": ":"}
MARKER = 5.0  # points
LONGEST_LEVEL_LABEL = 8  # characters of a tick of the x axis
FLAT = 1e-9
"""Values that vary by less than this share of the largest value are drawn as constant, so that the axis does not show rounding errors."""


@dataclass(frozen=True)
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
        low, high: A band around the values, shape (n,) each.
        is_step: Whether a value holds until the next one.
        is_fill: Whether only the band is drawn: an envelope.
    """

    label: str
    x: Array
    y: Array
    colour: str = ""
    width: float = 1.5
    dashes: Dashes = ""
    marker: str = ""
    low: Array | None = None
    high: Array | None = None
    is_step: bool = False
    is_fill: bool = False


@dataclass(frozen=True)
class Chart:
    """A plot as data.

    Attributes:
        x_label, y_label: Labels of the axes, with units.
        lines: The lines, in the order they are drawn.
        x_log, y_log: Whether an axis is logarithmic.
        ticks: Positions and texts of the ticks of the x axis; empty for automatic ones.
        reference: Label of the line that can be subtracted from the others; empty if no line has the same times.
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

    @property
    def is_flat(self) -> bool:
        """Whether all values are equal, up to rounding."""
        drawn = [values[np.isfinite(values)] for line in self.lines for values in (line.y, line.low, line.high) if values is not None]
        values = np.concatenate([np.empty(0), *drawn])
        return (
            not (self.y_log or self.rows or self.is_map) and len(values) > 0 and float(np.ptp(values)) <= FLAT * float(np.abs(values).max())
        )


def draw(chart: Chart, axes: "Axes") -> None:
    """Draw a chart with matplotlib."""
    axes.set(xscale="log" if chart.x_log else "linear", yscale="log" if chart.y_log else "linear")
    labelled: set[str] = set()
    for line in chart.lines:
        # One entry of the legend for all lines of a label; matplotlib leaves out labels that begin with an underscore.
        _draw_line(chart, line, "_" if line.label in labelled else line.label, axes)
        labelled.add(line.label)
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
        axes.set_yticks(range(len(chart.rows)), [_in_lines(row) for row in chart.rows], fontsize=7)
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
    axes.set_ylabel(chart.y_label)


def _draw_line(chart: Chart, line: Line, label: str, axes: "Axes") -> None:
    colour = line.colour or ink()
    if line.low is not None and line.high is not None:
        alpha, of_band = (0.3, label) if line.is_fill else (0.15, None)
        axes.fill_between(line.x, line.low, line.high, color=colour, linewidth=0.0, alpha=alpha, label=of_band)
    if line.is_fill:
        return
    y = np.maximum(line.y, ROUNDING) if chart.y_log else line.y
    style: dict[str, Any] = {"linestyle": DASHES[line.dashes] if line.width else "none", "linewidth": line.width, "color": colour}
    if line.marker:
        style |= {"marker": line.marker, "markerfacecolor": "none", "markersize": MARKER}
    if line.is_step:
        style["drawstyle"] = "steps-post"
    if chart.rows:
        style["solid_capstyle"] = "butt"
    axes.plot(line.x, y, label=label, **style)


def _in_lines(label: str) -> str:
    """The label of an engine, two options per line."""
    name, options = parts_of(label)
    lines = [",".join(options[first : first + 2]) for first in range(0, len(options), 2)]
    return f"{name}[" + ",\n".join(lines) + "]" if options else name


def figure_of(panels: Sequence[Chart]) -> "Figure":
    """A figure of panels in the style of the report, at most three in a row, with one legend."""
    load_matplotlib()
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    across = min(len(panels), 3)
    down = -(-len(panels) // across)
    named: dict[str, Any] = {}
    with rc_context(REPORT):
        figure = Figure(figsize=(3.7 * across, 2.9 * down), layout=ConstrainedLayoutEngine(w_pad=0.12))
        for place, panel in enumerate(panels, 1):
            axes = figure.add_subplot(down, across, place)
            draw(panel, axes)
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                named.setdefault(label, handle)
        figure.legend(list(named.values()), list(named), loc="outside upper left", ncols=min(len(named), 5), fontsize=9)
    return figure


def save_figure(figure: "Figure", file: "Path") -> None:
    """Save a figure on white, as SVG with text as text or as PNG; equal figures give equal files."""
    from matplotlib import rc_context

    stamps = ["Software"] if file.suffix == ".png" else ["Date", "Creator"]
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": file.stem}):
        figure.savefig(file, dpi=200, facecolor="white", metadata=dict.fromkeys(stamps))
