"""Error over cost."""

from math import isfinite
from typing import TYPE_CHECKING

from comparisons.tradeoff import SIDE_BY_SIDE
from reports.plots.colours import engine_colours, engine_markers
from reports.plots.style import ROUNDING, ink, label_powers, metric_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from comparisons.tradeoff import Point, TradeOff


def plot_tradeoff(found: "TradeOff", axes: "Axes", side_by_side: bool = False) -> None:
    """Draw error over cost, both logarithmic: the time steps of each engine joined by a line, and the Pareto front.

    Args:
        found: The study.
        axes: The axes to draw into.
        side_by_side: Draw the cost per world of a batch, of the engines that simulate batches.
    """
    front = found.front_side_by_side if side_by_side else found.front

    def cost(point: "Point") -> float:
        return point.side_by_side if side_by_side else point.typical

    engines = list(dict.fromkeys(point.engine for point in found.points))
    colours, markers = engine_colours(engines), engine_markers(engines)
    cheapest, best = zip(*((cost(point), max(point.error, ROUNDING)) for point in front), strict=True)
    axes.loglog(cheapest, best, color=ink(), linewidth=5.0, alpha=0.25, label="Pareto front")
    for engine in engines:
        mine = [point for point in found.points if point.engine == engine and isfinite(cost(point))]
        axes.loglog(
            [cost(point) for point in mine],
            [max(point.error, ROUNDING) for point in mine],
            color=colours[engine],
            marker=markers[engine],
            markersize=3.5,
            linewidth=1.0,
            label=engine,
        )
    label_powers(axes, "x")
    label_powers(axes, "y")
    axes.set_xlabel("time per simulated second [s]" + (f",\nper world (batch of {SIDE_BY_SIDE})" if side_by_side else ""))
    axes.set_ylabel(metric_label(found.metric))
