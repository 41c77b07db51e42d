"""Error over cost."""

from math import isfinite
from typing import TYPE_CHECKING

from comparisons.tradeoff.costs import BATCH
from reports.plots.colours import engine_colours, engine_markers
from reports.plots.style import ROUNDING, ink, label_powers, metric_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from comparisons.tradeoff.points import CostPoint, TradeOff


def plot_tradeoff(found: "TradeOff", axes: "Axes", batch: bool = False) -> None:
    """Draw error over cost, both logarithmic: each engine's time steps joined, and the Pareto front.

    Args:
        found: The trade-off.
        axes: The axes to draw into.
        batch: Whether to draw the cost per world in a batch, of the engines that can step batches.
    """
    front = found.batch_pareto_front if batch else found.pareto_front

    def cost(point: "CostPoint") -> float:
        return point.cost_per_world if batch else point.typical_cost

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
    axes.set_xlabel(f"time per simulated second{f', per world (batch of {BATCH})' if batch else ''} [s]")
    axes.set_ylabel(metric_label(found.metric))
