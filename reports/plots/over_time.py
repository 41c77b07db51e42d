"""Quantities of a motion over time, of each engine and of the exact solution."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from comparisons.results.results import Results
from reports.plots.style import TIME, Array, at_one_step, exact_motion, exact_style, thinned
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
    """Upward component of the y axis of the body: 1 upright, -1 upside down."""
    return rotate(motion.orientation, np.array([0.0, 1.0, 0.0]))[:, 1]


def angular_momentum_length(scene: Scenario, motion: Trajectory) -> Array:
    """|L| [kg m²/s]."""
    return np.linalg.norm(angular_momentum(scene, motion), axis=1)


LABELS: dict[Quantity, str] = {
    height: "height [m]",
    tilt: "upward component of body y axis",
    energy: "energy [J]",
    angular_momentum_length: "|L| [kg m²/s]",
}


def quantities(scene: Scenario) -> dict[str, Quantity]:
    """The quantities to show for a scene, by axis label."""
    moves = scene.gravity is not None or any(scene.start.velocity)
    shown: list[Quantity] = [height if moves else tilt, energy]
    if any(scene.start.angular_velocity):
        shown.append(angular_momentum_length)
    return {LABELS[quantity]: quantity for quantity in shown}


def plot_over_time(results: Results, scene_name: str, quantity: Quantity, axes: "Axes") -> None:
    """Draw a quantity over time: each engine at the coarsest time step, where engines differ most, and the exact solution.

    Args:
        results: The run.
        scene_name: One of its scenes.
        quantity: A function of a scene and a motion, shape (n,).
        axes: The axes to draw into.
    """
    scene = results.scenes[scene_name]
    truth = truth_for(scene)
    for motion, style in at_one_step(results, results.trajectories, scene_name, max):
        shown = thinned(motion)
        axes.plot(shown.t, quantity(scene, shown), **style)
    if truth is not None:
        exact = exact_motion(scene, truth)
        axes.plot(exact.t, quantity(scene, exact), **exact_style())
    axes.set_xlabel(TIME)
    axes.set_ylabel(LABELS.get(quantity, ""))
    axes.ticklabel_format(axis="y", useOffset=False)
