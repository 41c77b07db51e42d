"""The bounce ladder: the apex after each bounce."""

from typing import TYPE_CHECKING

import numpy as np

from dropspin.comparisons.measuring.comparison import SHORTEST_FLIGHT, Comparison
from dropspin.comparisons.results.results import Results
from dropspin.reports.plots.chart import Chart, Line, draw
from dropspin.reports.plots.style import at_one_step, step_of
from dropspin.scenarios import DropspinError, Scenario, Trajectory, Truth, truth_for
from dropspin.scenarios.mechanics import apex
from dropspin.scenarios.state import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def bounce_ladder(results: Results, scene_name: str) -> Chart:
    """The height of the apex after bounce k relative to the drop height, logarithmic, at the smallest time step, and the exact value e²ᵏ.

    e is the coefficient of restitution. The plot ends before the first flight (the motion between two contacts) of fewer than 16 steps.

    Args:
        results: The run.
        scene_name: The name of a scene of the run. Its exact solution must have impacts, all of them with the floor.

    Raises:
        DropspinError: The exact solution of the scene has no impact, or there is no exact solution.
    """
    scene = results.scenes[scene_name]
    truth = truth_for(scene)
    strikes = [] if truth is None else [event.wall is None for event in truth.events]
    if truth is None or not strikes or not all(strikes) or not scene.starts_above_floor:
        raise DropspinError(f"{scene_name}: the exact solution has no bounces; choose a scene that has some, such as drop-ball.")
    exact, lasting = _exact_apexes(scene, truth, SHORTEST_FLIGHT * step_of(results.trajectories, scene_name, min))
    lines = []
    for motion, style in at_one_step(results, results.trajectories, scene_name, min):
        heights = apexes(scene, motion) / exact[0]
        lines.append(Line(x=np.arange(len(heights), dtype=float), y=heights, **style | {"width": 0.0, "is_sparse": False}))
    shown = max([lasting, *(len(line.x) for line in lines)])
    stairs = exact[:shown] / exact[0]
    lines.append(Line(truth.word, np.arange(len(stairs), dtype=float), stairs, width=1.0, dashes="dashed"))
    ticks = [(float(bounce), str(bounce)) for bounce in range(0, shown, 1 + shown // 8)]
    return Chart("bounce", "apex / drop height", lines, y_log=True, ticks=ticks)


def plot_bounce_ladder(results: Results, scene_name: str, axes: "Axes") -> None:
    """Draw `bounce_ladder` into axes."""
    draw(bounce_ladder(results, scene_name), axes)


@np.errstate(all="ignore")  # an engine may return 1e300
def apexes(scene: Scenario, motion: Trajectory) -> Array:
    """Apex above the floor [m] of the drop and of each later flight, averaged over the middle half of the flight, shape (flights,)."""
    in_contact = Comparison(scene, motion).motions.in_contact
    edges = np.flatnonzero(np.diff(np.concatenate([[True], in_contact, [True]])))
    found = []
    for start, end in edges.reshape(-1, 2):  # rows at which a flight begins and ends
        if end - start < SHORTEST_FLIGHT:
            break
        quarter = (end - start) // 4
        found.append(float(np.mean(apex(scene, motion[start + quarter : end + 1 - quarter]))))
    return np.array(found) - _floor_height(scene)


def _exact_apexes(scene: Scenario, truth: Truth, shortest: float) -> tuple[Array, int]:
    """Exact apexes above the floor [m], shape (flights,), and the number of flights, with the drop, of at least this duration [s]."""
    states = np.array([truth.events[0].before, *(event.after for event in truth.events)])
    heights = apex(scene, Trajectory.from_states(np.zeros(len(states)), states)) - _floor_height(scene)
    is_short = 2.0 * states[1:, 8] / -scene.acceleration[1] < shortest
    return heights, 1 + int(np.argmax(is_short)) if is_short.any() else len(heights)


def _floor_height(scene: Scenario) -> float:
    """Height of the centre of mass when the body touches the floor in its initial orientation [m]."""
    return scene.start.position[1] - scene.clearance
