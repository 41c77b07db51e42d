"""The growth of an error over time, on a logarithmic scale."""

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from dropspin.comparisons.measuring.comparison import Comparison, Unresolved, exactly
from dropspin.comparisons.measuring.errors_over_time import ERRORS, IN_FLIGHT
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.tolerances import TRUTH_ACCURACY, scale
from dropspin.comparisons.results.results import Results
from dropspin.reports.plots.chart import Chart, Line, draw
from dropspin.reports.plots.style import ROUNDING, TIME, at_one_step, metric_label, stride
from dropspin.scenarios import DropspinError, Scenario, Trajectory, Truth, UnknownName, truth_for
from dropspin.scenarios.state import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def error_growth(results: Results, scene_name: str, metric: str) -> Chart:
    """The absolute value of an error over time, logarithmic, for each engine at the smallest time step.

    The maximum of a line is the value of the metric for a single initial state. As for the metrics, velocities are compared only in the
    middle half of each flight. Otherwise an impact that occurs one time step late, which is an error in time, would appear as a spike in
    energy. Lines therefore have gaps around impacts. They end where the bounces no longer correspond to those of the exact solution.

    Args:
        results: The run.
        scene_name: One of its scenes; it must have an exact solution.
        metric: A key of `dropspin.comparisons.measuring.errors_over_time.ERRORS`, such as `orientation_error`.

    Raises:
        DropspinError: The scene has no exact solution.
        UnknownName: `metric` is not a key of `ERRORS`.
    """
    scene = results.scenes[scene_name]
    truth = truth_for(scene)
    if truth is None:
        raise DropspinError(f"{scene_name} has no exact solution to compare with; choose a scene that has one (see dropspin list).")
    if metric not in ERRORS:
        raise UnknownName("metric over time", metric, list(ERRORS))
    lines = []
    for motion, style in at_one_step(results, results.trajectories, scene_name, min):
        t, sizes = _sizes(scene, motion, truth, metric)
        lines.append(Line(x=t, y=sizes, **style))
    return Chart(TIME, metric_label(metric), lines, y_log=True, rounding=TRUTH_ACCURACY * scale(scene, METRICS[metric].unit))


def plot_error_growth(results: Results, scene_name: str, metric: str, axes: "Axes") -> None:
    """Draw `error_growth` into axes."""
    draw(error_growth(results, scene_name, metric), axes)


@np.errstate(all="ignore")  # an engine may return 1e300
def _sizes(scene: Scenario, motion: Trajectory, truth: Truth, metric: str) -> tuple[Array, Array]:
    """Times [s] and absolute errors after the start, NaN where the error is undefined; empty if the time step is too coarse."""
    case = Comparison.with_truth(scene, motion, truth, _exact(truth, motion.t.tobytes()))
    try:
        sizes = np.maximum(np.abs(ERRORS[metric](case)), ROUNDING)
    except Unresolved:
        return np.empty(0), np.empty(0)
    usable = np.concatenate(case.flights) if ERRORS[metric] in IN_FLIGHT else np.arange(len(sizes))
    is_usable = np.isin(np.arange(len(sizes)), usable) & np.isfinite(sizes)
    ranked, every = np.where(is_usable, sizes, -1.0), stride(len(sizes))
    # The largest of each stride, so that no peak is lost.
    shown = [first + int(np.argmax(ranked[first : first + every])) for first in range(1, len(sizes), every)]
    return case.compared.t[shown], np.where(is_usable, sizes, np.nan)[shown]


@lru_cache(maxsize=1)
def _exact(truth: Truth, times: bytes) -> Trajectory:
    """The exact solution at times [s], which the engines have in common, and the metrics."""
    return exactly(truth, np.frombuffer(times))
