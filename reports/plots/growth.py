"""How an error grows."""

from typing import TYPE_CHECKING

import numpy as np

from comparisons.measuring.comparison import Comparison, Unresolved
from comparisons.measuring.errors_over_time import ERRORS
from comparisons.results.results import Results
from reports.plots.style import ROUNDING, TIME, Array, at_one_step, label_powers, metric_label, stride
from scenarios import DropspinError, Scenario, Trajectory, Truth, UnknownName, truth_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_error_growth(results: Results, scene_name: str, metric: str, axes: "Axes") -> None:
    """Draw the size of an error over time, logarithmic, of every engine at the finest step.

    The largest value of a line is the metric's, of one start. Velocities are compared as the metrics do it, in the inner half of each
    flight: an impact that comes a step late is an error of time, and would be a spike in energy. Lines are broken there, and end where
    the body gets out of step with the truth.

    Args:
        results: The run.
        scene_name: One of its scenes; it must have a truth.
        metric: A key of `comparisons.measuring.errors_over_time.ERRORS`, such as `orientation_error`.
        axes: What to draw into.

    Raises:
        DropspinError: The scene has no truth, or the metric is not one that can be told at each moment.
    """
    scene = results.scenes[scene_name]
    truth = truth_for(scene)
    if truth is None:
        raise DropspinError(f"{scene_name} has no truth to hold errors against; choose a scene that has, see dropspin list.")
    if metric not in ERRORS:
        raise UnknownName("metric over time", metric, list(ERRORS))
    for motion, look in at_one_step(results, results.trajectories, scene_name, min):
        axes.semilogy(*_sizes(scene, motion, truth, metric), **look)
    label_powers(axes, "y")
    axes.set_xlabel(TIME)
    axes.set_ylabel(metric_label(metric))


@np.errstate(all="ignore")  # an engine may say 1e300
def _sizes(scene: Scenario, motion: Trajectory, truth: Truth, metric: str) -> tuple[Array, Array]:
    """Times and sizes of an error after the start, which all share; NaN where it is not told, nothing where the step is too coarse."""
    case = Comparison.with_truth(scene, motion, truth)
    try:
        sizes = np.maximum(np.abs(ERRORS[metric].at_each_row(case)), ROUNDING)
    except Unresolved:
        return np.empty(0), np.empty(0)
    told = np.concatenate(case.flights) if ERRORS[metric].in_flight else np.arange(len(sizes))
    is_told = np.isin(np.arange(len(sizes)), told) & np.isfinite(sizes)
    ranked, every = np.where(is_told, sizes, -1.0), stride(len(sizes))
    shown = [first + int(np.argmax(ranked[first : first + every])) for first in range(1, len(sizes), every)]  # no peak is lost
    return case.compared.t[shown], np.where(is_told, sizes, np.nan)[shown]
