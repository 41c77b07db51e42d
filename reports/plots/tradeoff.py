"""Error over cost."""

from collections.abc import Mapping, Sequence
from math import isfinite, nan
from typing import TYPE_CHECKING, Any

import numpy as np

from dropspin.reports.plots.chart import Chart, Line, draw
from dropspin.reports.plots.colours import EngineStyle, engine_styles
from dropspin.reports.plots.style import metric_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from dropspin.comparisons.tradeoff.pareto import CostPoint, TradeOff

FRONT, SPREAD = 5.0, 1.0
"""Widths of the line of the Pareto front and of the bars that are spreads of timings [points]."""


def error_over_cost(found: "TradeOff", worlds: int | None = None) -> Chart:
    """Error over cost, both logarithmic: a line for each engine, which connects its time steps, and the Pareto front.

    Horizontal bars reach from the smallest to the largest timing of all rounds; for batches, from the smallest to the median.

    Args:
        found: The trade-off.
        worlds: The number of worlds of a batch, to plot the cost per world; only engines that can simulate batches are then shown.
    """

    def costs(point: "CostPoint") -> tuple[float, float, float]:
        if worlds is None:
            return point.typical_cost, float(point.cost.min()), float(point.cost.max())
        least = point.costs_per_world.get(worlds, nan)
        return least, least, least * point.spreads_per_world.get(worlds, 1.0)

    def line(label: str, points: "Sequence[CostPoint]", style: Mapping[str, Any]) -> Line:
        return Line(label, np.array([costs(point)[0] for point in points]), np.array([point.error for point in points]), **style)

    front = found.pareto_front if worlds is None else found.batch_pareto_front(worlds)
    lines = [line("Pareto front", front, {"colour": "#B0B0B0", "width": FRONT})]
    for engine, style in _styles(found).items():
        points = [point for point in found.points if point.engine == engine and isfinite(costs(point)[0])]
        lines.append(line(engine, points, style._asdict()))
        along = np.array([(*costs(point)[1:], nan) for point in points]).ravel()
        lines.append(Line(engine, along, np.repeat([point.error for point in points], 3), style.colour, SPREAD))
    cost_label = "time per simulated second" if worlds is None else f"per world and simulated second, batch of {worlds}"
    return Chart(f"{cost_label} [s]", metric_label(found.metric), lines, x_log=True, y_log=True)


def throughput(found: "TradeOff") -> Chart:
    """Steps per second of all worlds over the number of worlds, both logarithmic: a line for each engine at its finest time step."""
    lines = []
    for engine, style in _styles(found).items():
        finest = min((one for one in found.points if one.engine == engine), key=lambda one: one.dt)
        sizes = sorted(finest.costs_per_world)
        rates = [1.0 / (finest.dt * finest.costs_per_world[size]) for size in sizes]
        lines.append(Line(engine, np.array(sizes, dtype=float), np.array(rates), **style._asdict()))
    return Chart("number of worlds in a batch", "steps per second, all worlds", lines, x_log=True, y_log=True)


def _styles(found: "TradeOff") -> dict[str, EngineStyle]:
    return engine_styles(list(dict.fromkeys(point.engine for point in found.points)))


def plot_tradeoff(found: "TradeOff", axes: "Axes", worlds: int | None = None) -> None:
    """Draw `error_over_cost` into axes."""
    draw(error_over_cost(found, worlds), axes)
