"""Figures of charts, and their data, as files."""

from collections.abc import Sequence
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from dropspin.comparisons.results.complete_folders import written_whole
from dropspin.reports.plots.chart import Chart, draw
from dropspin.reports.plots.style import SIZES, ink, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FRAME, ROW = 1.0, 0.3
"""Height of a panel with rows, without them, and of each row [inches]."""
NEAR_END = 0.08
"""A line is labelled at its end if that is within this part of the width of the axes from their right end."""
LINE_HEIGHT = 1.15
"""Least distance of two labels, as a multiple of the size of the font."""
WIDEST = 0.25
"""Largest width of a label, relative to that of the figure."""
FARTHEST = 1.5
"""Largest distance of a label from the end of its line, as a multiple of the size of the font."""


def figure_of(charts: Sequence[Chart], size: str = "report", look: str = "light") -> "Figure":
    """A figure of charts with one legend; a single chart has labels at the ends of its lines instead, if they fit.

    Args:
        charts: The charts, each of which gets a panel.
        size: `column` (86 mm wide, panels one below the other), `page` (178 mm, two in a row) or `report` (up to three in a row).
        look: `light`, `dark`, or `grey` for print without colours.

    Raises:
        UnknownName: The size or the look is unknown.
    """
    with style(size, look):
        from matplotlib.figure import Figure

        width, height, most, _ = SIZES[size]
        across = min(len(charts), most)
        down = -(-len(charts) // across)
        whole = most if size == "page" else across  # a page is filled by one panel, too
        tall = max(height, *(FRAME + ROW * len(chart.rows) for chart in charts))
        figure = Figure(figsize=(width * whole, tall * down))
        named: dict[str, Any] = {}
        for place, chart in enumerate(charts, 1):
            axes = figure.add_subplot(down, across, place)
            draw(chart, axes)
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                named.setdefault(label, handle)
        if len(charts) > 1 or charts[0].rows or charts[0].is_map or not label_ends(figure.axes[0]):
            _add_legend(figure, named)
    return figure


def _add_legend(figure: "Figure", named: dict[str, Any]) -> None:
    """Add a legend above the panels, with as many columns as fit."""
    for columns in range(min(len(named), 5), 0, -1):
        legend = figure.legend(list(named.values()), list(named), loc="outside upper left", ncols=columns)
        if columns == 1 or legend.get_window_extent().width <= figure.bbox.width:
            return
        legend.remove()


def label_ends(axes: "Axes") -> bool:
    """Label the lines of axes at their right ends, in place of a legend.

    Labels are moved up or down so that they do not overlap. No label is added if a line ends before the right edge, if a label is too long,
    or if it would have to move too far.

    Returns:
        Whether the labels fit.
    """
    from scipy.optimize import isotonic_regression  # slow to import, and every command imports this file

    figure = axes.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()  # the layout decides where lines end
    em = figure.dpi / 72.0 * float(axes.xaxis.label.get_fontsize())
    ends: list[tuple[float, str, Any]] = sorted(
        ((_end(line, axes), label, line) for line, label in zip(*axes.get_legend_handles_labels(), strict=True)), key=itemgetter(0)
    )
    heights, least = np.array([y for y, _, _ in ends]), LINE_HEIGHT * em * np.arange(len(ends))
    if not ends or not np.isfinite(heights).all():
        return False
    places = least + isotonic_regression(heights - least).x  # the least squares of the moves
    if np.abs(places - heights).max() > FARTHEST * em:
        return False
    texts = [
        axes.annotate(
            label,
            (1.0, (place - axes.bbox.y0) / axes.bbox.height),
            (4.0, 0.0),
            xycoords="axes fraction",
            textcoords="offset points",
            va="center",
            color=_readable(line.get_color()),
        )
        for (_, label, line), place in zip(ends, places, strict=True)
    ]
    fits = max(text.get_window_extent().width for text in texts) <= WIDEST * figure.bbox.width
    if not fits:
        for text in texts:
            text.remove()
    return fits


def _end(line: Any, axes: "Axes") -> float:
    """The height at which a line ends near the right end of axes [pixels]; NaN if it ends elsewhere, or is none."""
    data = np.asarray(line.get_xydata(), dtype=float) if hasattr(line, "get_xydata") else np.empty((0, 2))
    data = data[np.isfinite(data).all(axis=1)]
    if not len(data):
        return np.nan
    x, y = axes.transData.transform(data[np.argmax(data[:, 0])])
    is_near = x >= axes.bbox.x1 - NEAR_END * axes.bbox.width and axes.bbox.y0 - 1.0 <= y <= axes.bbox.y1 + 1.0
    return float(y) if is_near else np.nan


def _readable(colour: Any) -> Any:
    """A colour mixed with that of the text: pale colours make no readable text."""
    from matplotlib.colors import to_rgb

    return tuple(0.65 * np.array(to_rgb(colour)) + 0.35 * np.array(to_rgb(ink())))


def save_figure(figure: "Figure", file: str | Path) -> None:
    """Save a figure as SVG in which text stays text, as PDF with TrueType fonts, or as PNG. Equal figures give equal files."""
    from matplotlib import rc_context

    file = Path(file)
    stamps = {".png": ["Software"], ".pdf": ["CreationDate", "Creator", "Producer"]}.get(file.suffix, ["Date", "Creator"])
    background = figure.get_facecolor()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": file.stem, "pdf.fonttype": 42}):
        figure.savefig(file, dpi=200, facecolor=background, metadata=dict.fromkeys(stamps))


def save_charts(charts: Sequence[Chart], file: Path) -> None:
    """Save charts as a figure of the report, or their data as CSV, by the ending of the file's name."""
    if file.suffix == ".csv":
        save_data(charts, file)
    else:
        save_figure(figure_of(charts), file)


def save_data(charts: Sequence[Chart], file: str | Path) -> None:
    """Save the data of charts as CSV, with all digits: a row for each point of each line.

    The columns are the number of the chart, the names of x and y with their units, the label of the line, how it is drawn (points, line or
    band), x, y, and the ends `low` and `high` of a band.
    """
    lines = [
        {"chart": number, "x_label": chart.x_name or chart.x_label, "y_label": " ".join((chart.y_name or chart.y_label).split())}
        | {"line": line.label, "drawn": "band" if line.low is not None else "points" if line.marker else "line"}
        | {"x": line.x, "y": np.nan if line.is_fill else line.y, "low": line.low, "high": line.high}
        for number, chart in enumerate(charts, 1)
        for line in chart.lines
    ]
    with written_whole(file) as unfinished:
        pd.concat(map(pd.DataFrame, lines), ignore_index=True).to_csv(unfinished, index=False)
