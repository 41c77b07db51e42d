"""What a scene does over time, in every engine and in truth."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from comparisons import Results
from reports.colours import engine_colours
from reports.plots.style import MOST_POINTS, Array, ink, thinned, thinner
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
    colours = engine_colours(results.engines)
    dts = [dt for name, _, dt in results.trajectories if name == scene_name]
    for number, engine in enumerate(results.engines):
        motion = results.trajectories.get((scene_name, engine, max(dts, default=0.0)))
        if motion is not None:
            shown = thinned(motion)
            width = thinner(3.8, 1.2, number, len(results.engines))
            axes.plot(shown.t, quantity(scene, shown), color=colours[engine], linewidth=width, label=engine)
    if truth is not None:
        times = np.linspace(0.0, min(scene.duration, truth.horizon), MOST_POINTS)
        axes.plot(times, quantity(scene, truth(times)), color=ink(), linewidth=1.0, linestyle=(0, (3, 3)), label="truth")
    axes.set_xlabel("time [s]")
    axes.set_ylabel(LABELS.get(quantity, ""))
    axes.ticklabel_format(axis="y", useOffset=False)
