"""What a scene does over time, in every engine and in truth."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from comparisons.results.results import Results
from reports.plots.style import TIME, Array, as_truth, at_one_step, exactly, thinned
from scenarios import Scenario, Trajectory, truth_for
from scenarios.mechanics import angular_momentum, energy
from scenarios.rotations import rotate

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Quantity = Callable[[Scenario, Trajectory], Array]


def height(scene: Scenario, motion: Trajectory) -> Array:
    """Height of the centre of mass [m]."""
    return motion.position[:, 1]


def tilt(scene: Scenario, motion: Trajectory) -> Array:
    """Upward component of the body's own y axis: 1 upright, -1 turned over."""
    return rotate(motion.orientation, np.array([0.0, 1.0, 0.0]))[:, 1]


def angular_momentum_length(scene: Scenario, motion: Trajectory) -> Array:
    """|L| [kg m²/s]."""
    return np.linalg.norm(angular_momentum(scene, motion), axis=1)


LABELS: dict[Quantity, str] = {
    height: "height [m]",
    tilt: "body's y axis, upward part",
    energy: "energy [J]",
    angular_momentum_length: "|L| [kg m²/s]",
}


def quantities(scene: Scenario) -> dict[str, Quantity]:
    """What to show of a scene over time, by axis label."""
    moves = scene.gravity is not None or any(scene.start.velocity)
    shown: list[Quantity] = [height if moves else tilt, energy]
    if any(scene.start.angular_velocity):
        shown.append(angular_momentum_length)
    return {LABELS[quantity]: quantity for quantity in shown}


def plot_over_time(results: Results, scene_name: str, quantity: Quantity, axes: "Axes") -> None:
    """Draw one quantity over time: every engine at the coarsest step, where they differ most, and the truth."""
    scene = results.scenes[scene_name]
    truth = truth_for(scene)
    for motion, look in at_one_step(results, results.trajectories, scene_name, max):
        shown = thinned(motion)
        axes.plot(shown.t, quantity(scene, shown), **look)
    if truth is not None:
        exact = exactly(scene, truth)
        axes.plot(exact.t, quantity(scene, exact), **as_truth())
    axes.set_xlabel(TIME)
    axes.set_ylabel(LABELS.get(quantity, ""))
    axes.ticklabel_format(axis="y", useOffset=False)
