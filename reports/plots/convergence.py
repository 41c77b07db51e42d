"""Errors as functions of the time step."""

import math
from collections.abc import Hashable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.tolerances import TRUTH_ACCURACY, scale
from dropspin.comparisons.results.results import Results
from dropspin.reports.plots.chart import Chart, Line, draw
from dropspin.reports.plots.colours import engine_styles
from dropspin.reports.plots.style import metric_label, plain
from dropspin.scenarios.state import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FINER = 0.25
"""Smallest time step of the fitted lines, at which the asymptotic errors are drawn, relative to the finest time step."""
PREDICTED = "predicted"
"""Label of predicted errors."""
BAND = 1.3
"""Width of the bands that are intervals of asymptotic errors: the ratio of the time steps at its ends."""


def error_over_dt(results: Results, scene_name: str, metric: str) -> Chart:
    """The absolute value of an error as a function of the time step, logarithmic.

    A dotted line has the slope of the observed order, rounded to an integer, if the error vanishes as dt → 0. If rounding errors leave too
    few time steps to fit an order, the slope is that between the two largest time steps. Dashed lines are the fits that give the order and
    the asymptotic error; crosses are predicted errors. If the 95 % interval of an asymptotic error excludes 0, a band at the left end shows
    it.

    Args:
        results: The run.
        scene_name: The name of a scene of the run.
        metric: The name of a metric of this scene.
    """
    shown, predictions = (
        rows[(rows["scene"] == scene_name) & (rows["metric"] == metric)].to_dict("records") for rows in (results.table, results.predictions)
    )
    values = sorted((row for row in shown if row["kind"] in ("truth", "invariant")), key=lambda row: row["dt"])
    rounding = TRUTH_ACCURACY * scale(results.scenes[scene_name], METRICS[metric].unit)
    lines: list[Line] = []
    guides: dict[int, float] = {}  # by order: the largest error at the coarsest time step
    for engine, (colour, marker, dashes) in engine_styles(results.engines).items():
        dts, errors = _points(row for row in values if row["engine"] == engine and not math.isnan(row["value"]))
        lines.append(Line(engine, dts, np.abs(errors), colour, dashes=dashes, marker=marker))
        at, predicted = _points(row for row in predictions if row["engine"] == engine and row["value"] != 0.0)
        if len(at):
            lines.append(Line(PREDICTED, at, np.abs(predicted), width=0.0, marker="x"))
        studies = {row["kind"]: row for row in shown if row["engine"] == engine}
        order, asymptotic = studies.get("order"), studies.get("asymptotic_error")
        m = 0.0
        if asymptotic and asymptotic["cause"] in ("model", "setting"):
            m = asymptotic["value"]
            low, high = sorted(abs(asymptotic[side]) for side in ("lower", "upper"))
            across = FINER * dts.min() * np.array([1.0, BAND])
            lines.append(Line(engine, across, np.full(2, abs(m)), colour, low=np.full(2, low), high=np.full(2, high), is_fill=True))
        if asymptotic and (order or m != 0.0):
            # An error that hardly depends on dt has no order; the line to its asymptotic error then has order 1.
            lines.append(_fit(engine, dts, errors, order["value"] if order else 1.0, m, colour))
        if order and order["cause"] == "discretisation" and math.isfinite(order["value"]):
            rounded = max(1, round(order["value"]))
            guides[rounded] = max(guides.get(rounded, 0.0), abs(errors[-1]))
        elif asymptotic and asymptotic["cause"] == "rounding" and (p := _slope(dts, np.abs(errors), rounding)):
            guides[p] = max(guides.get(p, 0.0), abs(errors[-1]))
    dts = np.unique([row["dt"] for row in values])
    for p, largest in sorted(guides.items()):
        # Above the data, so that it hides no line.
        lines.append(Line(f"order {p}", dts, 2.0 * largest * (dts / dts[-1]) ** p, width=1.0, dashes="dotted"))
    ends = [FINER * dts.min()] if any(line.dashes == "dashed" for line in lines) else []
    return Chart(
        "time step [ms]",
        metric_label(metric),
        lines,
        x_log=True,
        y_log=True,
        ticks=[(float(dt), plain(1e3 * dt)) for dt in [*ends, *dts]],
        rounding=rounding,
        x_name="time step [s]",
        y_name=f"absolute value of {metric_label(metric)}",
    )


def plot_error_over_dt(results: Results, scene_name: str, metric: str, axes: "Axes") -> None:
    """Draw `error_over_dt` into axes."""
    draw(error_over_dt(results, scene_name, metric), axes)


def _points(rows: Iterable[Mapping[Hashable, Any]]) -> tuple[Array, Array]:
    """Time steps and values of rows, shape (n,) each."""
    found = [(row["dt"], row["value"]) for row in rows]
    return tuple(np.reshape(found, (-1, 2)).T)


def _slope(dts: Array, errors: Array, rounding: float) -> int:
    """The order between the two coarsest time steps, rounded; 0 if there is none, or if one of the errors is a rounding error."""
    if len(dts) < 2 or not errors[-2:].min() > rounding:
        return 0
    return max(0, round(float(np.log(errors[-1] / errors[-2]) / np.log(dts[-1] / dts[-2]))))


def _fit(engine: str, dts: Array, errors: Array, order: float, m: float, colour: str) -> Line:
    """The curve |m + C hᵖ| through the error at the finest time step, from the coarsest time step to a quarter of the finest."""
    h = np.geomspace(dts.max(), FINER * dts.min(), 50)
    return Line(engine, h, np.abs(m + (errors[0] - m) * (h / dts[0]) ** order), colour, width=0.8, dashes="dashed")
