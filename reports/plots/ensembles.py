"""What becomes of many starts, at the finest step: energy and angular momentum left, and who is at rest."""

from typing import TYPE_CHECKING, Any

import numpy as np

from comparisons.results.results import Results
from reports.plots.style import TIME, Array, at_one_step
from scenarios import DropspinError

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_energy_of_ensemble(results: Results, scene_name: str, axes: "Axes") -> None:
    """Draw the energy left over time: each engine's median, and between which values eight of ten lie."""
    for outcome, look in at_one_step(results, results.ensembles, scene_name, min):
        _draw_spread(outcome.t, outcome.energy, look, axes)
    axes.set_xlabel(TIME)
    axes.set_ylabel("energy, over the scene's")


def plot_angular_momentum_of_ensemble(results: Results, scene_name: str, axes: "Axes") -> None:
    """Draw the length of the angular momentum L over time: each engine's median, and between which values eight of ten lie.

    It is relative to r √(2 E M), E the scene's energy and r the body's size: to that if all of E were in the spin of a ring of that radius.
    So it means the same for starts with and without spin.

    Raises:
        DropspinError: The run was made before this was kept.
    """
    if not keeps_angular_momentum(results, scene_name):
        raise DropspinError(f"{scene_name}: this run was made before angular momenta of ensembles were kept; run it again.")
    for outcome, look in at_one_step(results, results.ensembles, scene_name, min):
        if outcome.angular_momentum is not None:
            _draw_spread(outcome.t, outcome.angular_momentum, look, axes)
    axes.set_xlabel(TIME)
    axes.set_ylabel("|L|, over r √(2 E M)")


def plot_rest_of_ensemble(results: Results, scene_name: str, axes: "Axes") -> None:
    """Draw which share is at rest by when."""
    for outcome, look in at_one_step(results, results.ensembles, scene_name, min):
        axes.ecdf(outcome.rest_time, **look)
    axes.set_xlim(0.0, results.scenes[scene_name].duration)
    axes.set_xlabel(TIME)
    axes.set_ylabel("share at rest")


def keeps_angular_momentum(results: Results, scene_name: str) -> bool:
    """Whether a run has kept the angular momentum of a scene's ensemble."""
    return any(outcome.angular_momentum is not None for outcome, _ in at_one_step(results, results.ensembles, scene_name, min))


def _draw_spread(t: Array, values: Array, look: dict[str, Any], axes: "Axes") -> None:
    low, middle, high = np.quantile(values, [0.1, 0.5, 0.9], axis=0)
    axes.fill_between(t, low, high, color=look["color"], alpha=0.15, linewidth=0.0)
    axes.plot(t, middle, **look)
