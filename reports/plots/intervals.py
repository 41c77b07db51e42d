"""Values with their intervals, a row for each."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from dropspin.reports.plots.chart import Chart, Line

BAR = 4.0  # points
COLOUR = "#56B4E9"


class Interval(NamedTuple):
    """A row: its label, a value, the ends of its interval, and another value to compare it with."""

    label: str
    value: float
    lower: float
    upper: float
    other: float = float("nan")


def interval_rows(x_label: str, rows: Sequence[Interval], other: str = "") -> Chart:
    """A bar for each interval, a circle at the value, and a cross at the other value, which has the label `other` if there is one."""
    labels, values, _, _, others = zip(*rows, strict=True)
    places = np.arange(len(rows), dtype=float)
    bars = [Line("95 % interval", np.array(row[2:4]), np.full(2, place), COLOUR, BAR) for row, place in zip(rows, places, strict=True)]
    markers = [Line("value", np.array(values), places, width=0.0, marker="o")]
    if other:
        markers.append(Line(other, np.array(others), places, width=0.0, marker="x"))
    return Chart(x_label, "", [*bars, *markers], rows=labels)
