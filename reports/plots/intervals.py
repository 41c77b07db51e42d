"""Values with their intervals, a row for each."""

from collections.abc import Sequence

import numpy as np

from dropspin.reports.plots.chart import Chart, Line

BAR = 4.0  # points
COLOUR = "#56B4E9"


def interval_rows(x_label: str, labels: Sequence[str], rows: Sequence[Sequence[float]], other: str = "") -> Chart:
    """A bar for each interval, a circle at the value, and a cross at another value.

    Args:
        x_label: The label of the x axis.
        labels: The label of each row.
        rows: For each row, the value, the ends of its interval, and the value to compare it with, if there is one.
        other: The label of the values to compare with; empty without them.
    """
    numbers, places = np.array(rows), np.arange(len(rows), dtype=float)
    bars = [Line("95 % interval", ends, np.full(2, place), COLOUR, BAR) for ends, place in zip(numbers[:, 1:3], places, strict=True)]
    markers = [Line("value", numbers[:, 0], places, width=0.0, marker="o")]
    if other:
        markers.append(Line(other, numbers[:, 3], places, width=0.0, marker="x"))
    return Chart(x_label, "", [*bars, *markers], rows=tuple(labels))
