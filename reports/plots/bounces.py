"""The bounce ladder: the apex after each bounce."""

from typing import TYPE_CHECKING

import numpy as np

from comparisons.measuring.comparison import SHORTEST_FLIGHT, Comparison
from comparisons.results.results import Results
from reports.plots.style import Array, at_one_step, exact_style, label_powers, step_of
from scenarios import DropspinError, Scenario, Trajectory, Truth, truth_for
from scenarios.mechanics import apex

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_bounce_ladder(results: Results, scene_name: str, axes: "Axes") -> None:
    """Draw the apex after each bounce relative to the drop height, logarithmic: engines at the finest step, and the exact e²ᵏ as stairs.

    The flights of an engine lie between the steps in which the floor changes its velocity. The first flight shorter than 16 steps ends the
    ladder.

    Args:
        results: The run.
        scene_name: One of its scenes; its exact solution must have an impact.
        axes: The axes to draw into.

    Raises:
        DropspinError: The exact solution of the scene has no impact, or there is no exact solution.
    """
    scene = results.scenes[scene_name]
    truth = truth_for(scene)
    if truth is None or not truth.events or not scene.starts_above_floor:
        raise DropspinError(f"{scene_name}: the exact solution has no bounces; choose a scene that has some, such as drop-ball.")
    exact, lasting = _exact_apexes(scene, truth, SHORTEST_FLIGHT * step_of(results.trajectories, scene_name, min))
    shown = [lasting]
    for motion, style in at_one_step(results, results.trajectories, scene_name, min, least_marker=4.0):
        heights = apexes(scene, motion) / exact[0]
        axes.semilogy(range(len(heights)), heights, linestyle="none", **style)
        shown.append(len(heights))
    stairs = exact[: max(shown)] / exact[0]
    axes.step(range(len(stairs)), stairs, where="mid", **exact_style())
    axes.set_xticks(np.arange(0, max(shown), 1 + max(shown) // 8))
    label_powers(axes, "y")
    axes.set_xlabel("bounce")
    axes.set_ylabel("apex / drop height")


@np.errstate(all="ignore")  # an engine may return 1e300
def apexes(scene: Scenario, motion: Trajectory) -> Array:
    """Apex above the floor [m] of the drop and of the flight after each bounce, averaged over the inner half of it, shape (flights,)."""
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
    """Exact apexes above the floor [m], shape (flights,), and how many flights, counting the drop, last at least this long [s]."""
    states = np.array([truth.events[0].before, *(event.after for event in truth.events)])
    heights = apex(scene, Trajectory.from_states(np.zeros(len(states)), states)) - _floor_height(scene)
    is_short = 2.0 * states[1:, 8] / -scene.acceleration[1] < shortest
    return heights, 1 + int(np.argmax(is_short)) if is_short.any() else len(heights)


def _floor_height(scene: Scenario) -> float:
    """Height of the centre of mass when the body touches the floor in the attitude of the start [m]."""
    return scene.start.position[1] - scene.clearance
