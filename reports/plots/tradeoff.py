"""Error over cost."""

from math import isfinite, nan
from typing import TYPE_CHECKING

import numpy as np

from dropspin.reports.plots.chart import Chart, Line, draw
from dropspin.reports.plots.colours import engine_styles
from dropspin.reports.plots.style import metric_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from dropspin.comparisons.tradeoff.points import CostPoint, TradeOff


def error_over_cost(found: "TradeOff", worlds: int | None = None) -> Chart:
    """Error over cost, both logarithmic: a line for the time steps of each engine, and the Pareto front.

    Args:
        found: The trade-off.
        worlds: The number of worlds of a batch, for the cost per world; only engines that can simulate such batches are then shown.
    """

    def cost(point: "CostPoint") -> float:
        return point.typical_cost if worlds is None else point.costs_per_world.get(worlds, nan)

    def line(label: str, points: "list[CostPoint]", colour: str = "", marker: str = "", width: float = 1.0) -> Line:
        return Line(label, np.array([cost(one) for one in points]), np.array([one.error for one in points]), colour, width, marker=marker)

    front = found.pareto_front if worlds is None else found.batch_pareto_front(worlds)
    lines = [line("Pareto front", list(front), "#B0B0B0", width=5.0)]
    for engine, (colour, marker) in _styles(found).items():
        lines.append(line(engine, [one for one in found.points if one.engine == engine and isfinite(cost(one))], colour, marker))
    cost_label = "time per simulated second" if worlds is None else f"per world and simulated second, batch of {worlds}"
    return Chart(f"{cost_label} [s]", metric_label(found.metric), lines, x_log=True, y_log=True)


def throughput(found: "TradeOff") -> Chart:
    """Steps per second of all worlds over the number of worlds, both logarithmic: a line for each engine at its finest time step."""
    lines = []
    for engine, (colour, marker) in _styles(found).items():
        finest = min((one for one in found.points if one.engine == engine), key=lambda one: one.dt)
        sizes = sorted(finest.costs_per_world)
        rates = [1.0 / (finest.dt * finest.costs_per_world[size]) for size in sizes]
        lines.append(Line(engine, np.array(sizes, dtype=float), np.array(rates), colour, marker=marker))
    return Chart("number of worlds in a batch", "steps per second, all worlds", lines, x_log=True, y_log=True)


def _styles(found: "TradeOff") -> dict[str, tuple[str, str]]:
    return engine_styles(list(dict.fromkeys(point.engine for point in found.points)))


def plot_tradeoff(found: "TradeOff", axes: "Axes", worlds: int | None = None) -> None:
    """Draw `error_over_cost` into axes."""
    draw(error_over_cost(found, worlds), axes)
