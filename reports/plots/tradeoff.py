"""Error over cost."""

from math import isfinite
from typing import TYPE_CHECKING

import numpy as np

from comparisons.tradeoff.costs import BATCH
from reports.plots.chart import Chart, Line, draw
from reports.plots.colours import engine_styles
from reports.plots.style import metric_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from comparisons.tradeoff.points import CostPoint, TradeOff


def error_over_cost(found: "TradeOff", batch: bool = False) -> Chart:
    """Error over cost, both logarithmic: a line for the time steps of each engine, and the Pareto front.

    Args:
        found: The trade-off.
        batch: Whether the cost is per world in a batch; only engines that can simulate batches are then shown.
    """

    def cost(point: "CostPoint") -> float:
        return point.cost_per_world if batch else point.typical_cost

    def line(label: str, points: "list[CostPoint]", colour: str = "", marker: str = "", width: float = 1.0) -> Line:
        return Line(label, np.array([cost(one) for one in points]), np.array([one.error for one in points]), colour, width, marker=marker)

    lines = [line("Pareto front", list(found.batch_pareto_front if batch else found.pareto_front), "#B0B0B0", width=5.0)]
    for engine, (colour, marker) in engine_styles(list(dict.fromkeys(point.engine for point in found.points))).items():
        lines.append(line(engine, [one for one in found.points if one.engine == engine and isfinite(cost(one))], colour, marker))
    per_world = f", per world (batch of {BATCH})" if batch else ""
    return Chart(f"time per simulated second{per_world} [s]", metric_label(found.metric), lines, x_log=True, y_log=True)


def plot_tradeoff(found: "TradeOff", axes: "Axes", batch: bool = False) -> None:
    """Draw `error_over_cost` into axes."""
    draw(error_over_cost(found, batch), axes)
