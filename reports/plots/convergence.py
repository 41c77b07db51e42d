"""Errors over the time step."""

from typing import TYPE_CHECKING, Any

import numpy as np

from comparisons.results.results import Results
from reports.plots.colours import engine_colours, engine_markers
from reports.plots.style import ROUNDING, Array, ink, label_powers, metric_label, thinner

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_error_over_dt(results: Results, scene_name: str, metric: str, axes: "Axes") -> None:
    """Draw the absolute value of an error over the time step, logarithmic.

    A dotted line has order 1, dashed lines are the fits that the order and the asymptotic error come from, crosses are predicted errors.

    Args:
        results: The run.
        scene_name: One of its scenes.
        metric: One of its metrics.
        axes: The axes to draw into.
    """
    colours, markers = engine_colours(results.engines), engine_markers(results.engines)
    frame = results.measurements
    mine = frame[(frame["scene"] == scene_name) & (frame["metric"] == metric)]
    largest, is_labelled = 0.0, False
    for number, engine in enumerate(results.engines):
        rows = mine[(mine["engine"] == engine) & mine["value"].notna()].sort_values("dt")
        sizes = np.maximum(rows["value"].abs().to_numpy(), ROUNDING)
        largest = max([largest, *sizes])
        style: Any = {"marker": markers[engine], "markerfacecolor": "none", "linewidth": 1.5, "color": colours[engine]}
        axes.loglog(rows["dt"], sizes, markersize=thinner(8.0, 4.0, number, len(results.engines)), label=engine, **style)
        predicted = results.table[(results.table["kind"] == "prediction") & (results.table["engine"] == engine)]
        predicted = predicted[(predicted["scene"] == scene_name) & (predicted["metric"] == metric) & (predicted["value"].abs() > ROUNDING)]
        if not predicted.empty:
            label = None if is_labelled else "predicted"
            is_labelled = True
            axes.loglog(predicted["dt"], predicted["value"].abs(), color=ink(), linestyle="none", marker="x", markersize=5.0, label=label)
        _draw_fit(results, scene_name, metric, engine, rows["dt"].to_numpy(), rows["value"].to_numpy(), axes)
    dts = np.sort(mine["dt"].unique())
    if len(dts) > 1 and largest > 0.0:
        # Above the data, so that it hides no line.
        axes.loglog(dts, 2.0 * largest * dts / dts[-1], color=ink(), linewidth=1.0, linestyle=":", label="order 1")
    axes.set_xticks(dts, [f"{1e3 * dt:g}" for dt in dts])
    axes.minorticks_off()
    label_powers(axes, "y")
    axes.set_xlabel("time step [ms]")
    axes.set_ylabel(metric_label(metric))


def _draw_fit(results: Results, scene_name: str, metric: str, engine: str, dts: Array, errors: Array, axes: "Axes") -> None:
    """Draw |m + C hᵖ|, dashed, through the error at the finest step, from the coarsest step to a quarter of the finest."""
    frame = results.table
    mine = frame[(frame["scene"] == scene_name) & (frame["metric"] == metric) & (frame["engine"] == engine)]
    fitted, asymptotic = (mine[mine["kind"] == kind] for kind in ("order", "asymptotic_error"))
    if fitted.empty or asymptotic.empty:
        return
    order = float(fitted["value"].iloc[0])
    m = float(asymptotic["value"].iloc[0]) if asymptotic["cause"].iloc[0] in ("model", "setting") else 0.0
    h = np.geomspace(dts.max(), 0.25 * dts.min(), 50)
    curve = np.abs(m + (errors[0] - m) * (h / dts[0]) ** order)
    axes.loglog(h, np.maximum(curve, ROUNDING), color=engine_colours(results.engines)[engine], linewidth=0.8, linestyle=(0, (4, 3)))
