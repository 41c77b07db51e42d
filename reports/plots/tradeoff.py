"""What accuracy costs."""

from typing import TYPE_CHECKING

from reports.colours import engine_colours, engine_markers
from reports.plots.style import ROUNDING, ink, label_powers, metric_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from comparisons.tradeoff import TradeOff


def plot_tradeoff(found: "TradeOff", axes: "Axes") -> None:
    """Draw error over cost, both logarithmic: each engine's steps joined, and the front, which nothing beats in both."""
    engines = list(dict.fromkeys(point.engine for point in found.points))
    colours, markers = engine_colours(engines), engine_markers(engines)
    cheapest, best = zip(*((point.typical, max(point.error, ROUNDING)) for point in found.front), strict=True)
    axes.loglog(cheapest, best, color=ink(), linewidth=5.0, alpha=0.25, label="front")
    for engine in engines:
        mine = [point for point in found.points if point.engine == engine]
        axes.loglog(
            [point.typical for point in mine],
            [max(point.error, ROUNDING) for point in mine],
            color=colours[engine],
            marker=markers[engine],
            markersize=3.5,
            linewidth=1.0,
            label=engine,
        )
    label_powers(axes, "x")
    label_powers(axes, "y")
    axes.set_xlabel("time per simulated second [s]")
    axes.set_ylabel(metric_label(found.metric))
