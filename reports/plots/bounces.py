"""The bounce ladder: how high each bounce rises."""

from typing import TYPE_CHECKING

import numpy as np

from comparisons.measuring.comparison import SHORTEST_FLIGHT, Comparison
from comparisons.results.results import Results
from reports.plots.style import Array, as_truth, at_one_step, label_powers, step_of
from scenarios import DropspinError, Scenario, Trajectory, Truth, truth_for
from scenarios.mechanics import apex

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_bounce_ladder(results: Results, scene_name: str, axes: "Axes") -> None:
    """Draw the apex of each bounce over the drop, logarithmic: every engine's at the finest step, and the truth's e²ᵏ as stairs.

    An engine's flights are its own, between the steps in which the floor changes its velocity; they end with the first that lasts less than
    16 steps.

    Args:
        results: The run.
        scene_name: One of its scenes; its truth must have an impact.
        axes: What to draw into.

    Raises:
        DropspinError: The scene's truth has no impact.
    """
    scene = results.scenes[scene_name]
    truth = truth_for(scene)
    if truth is None or not truth.events or not scene.starts_above_floor:
        raise DropspinError(f"{scene_name} has no bounces that are known; choose a scene that has, such as drop-ball.")
    exact, lasting = _exact_apexes(scene, truth, SHORTEST_FLIGHT * step_of(results.trajectories, scene_name, min))
    shown = [lasting]
    for motion, look in at_one_step(results, results.trajectories, scene_name, min, least_marker=4.0):
        heights = apexes(scene, motion) / exact[0]
        axes.semilogy(range(len(heights)), heights, linestyle="none", **look)
        shown.append(len(heights))
    stairs = exact[: max(shown)] / exact[0]
    axes.step(range(len(stairs)), stairs, where="mid", **as_truth())
    axes.set_xticks(np.arange(0, max(shown), 1 + max(shown) // 8))
    label_powers(axes, "y")
    axes.set_xlabel("bounce")
    axes.set_ylabel("apex, over the drop")


@np.errstate(all="ignore")  # an engine may say 1e300
def apexes(scene: Scenario, motion: Trajectory) -> Array:
    """Apex above the floor [m] of the drop and of the flight after each bounce, the mean over its inner half, shape (flights,)."""
    touching = Comparison(scene, motion).touching
    edges = np.flatnonzero(np.diff(np.concatenate([[True], touching, [True]])))
    found = []
    for start, end in edges.reshape(-1, 2):  # rows at which a flight begins and ends
        if end - start < SHORTEST_FLIGHT:
            break
        quarter = (end - start) // 4
        found.append(float(np.mean(apex(scene, motion[start + quarter : end + 1 - quarter]))))
    return np.array(found) - _floor_height(scene)


def _exact_apexes(scene: Scenario, truth: Truth, shortest: float) -> tuple[Array, int]:
    """The truth's, and how many of its flights last no less than this [s], the drop among them."""
    states = np.array([truth.events[0].before, *(event.after for event in truth.events)])
    heights = apex(scene, Trajectory.from_states(np.zeros(len(states)), states)) - _floor_height(scene)
    is_short = 2.0 * states[1:, 8] / -scene.acceleration[1] < shortest
    return heights, 1 + int(np.argmax(is_short)) if is_short.any() else len(heights)


def _floor_height(scene: Scenario) -> float:
    """Where the centre of mass is when the body touches the floor as it is turned at the start [m]."""
    return scene.start.position[1] - scene.clearance
