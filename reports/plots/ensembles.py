"""Ensembles over time, at the finest step: energy, angular momentum, and the fraction of members at rest."""

from typing import TYPE_CHECKING, Any

import numpy as np

from comparisons.results.results import Results
from reports.plots.style import TIME, Array, at_one_step

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_energy_of_ensemble(results: Results, scene_name: str, axes: "Axes") -> None:
    """Draw the energy over time: median and 10th–90th percentile of each engine."""
    for outcome, style in at_one_step(results, results.ensembles, scene_name, min):
        _draw_spread(outcome.t, outcome.energy, style, axes)
    axes.set_xlabel(TIME)
    axes.set_ylabel("energy / energy of the scene")


def plot_angular_momentum_of_ensemble(results: Results, scene_name: str, axes: "Axes") -> None:
    """Draw the magnitude of the angular momentum L over time: median and 10th–90th percentile of each engine.

    It is divided by r √(2 E M), with the energy E of the scene and the size r of the body: the angular momentum of a ring of radius r whose
    spin has all of E. This scale is defined for starts without spin too.
    """
    for outcome, style in at_one_step(results, results.ensembles, scene_name, min):
        _draw_spread(outcome.t, outcome.angular_momentum, style, axes)
    axes.set_xlabel(TIME)
    axes.set_ylabel("|L| / (r √(2 E M))")


def plot_rest_of_ensemble(results: Results, scene_name: str, axes: "Axes") -> None:
    """Draw the fraction of members at rest over time."""
    for outcome, style in at_one_step(results, results.ensembles, scene_name, min):
        axes.ecdf(outcome.rest_time, **style)
    axes.set_xlim(0.0, results.scenes[scene_name].duration)
    axes.set_xlabel(TIME)
    axes.set_ylabel("fraction at rest")


def _draw_spread(t: Array, values: Array, style: dict[str, Any], axes: "Axes") -> None:
    low, middle, high = np.quantile(values, [0.1, 0.5, 0.9], axis=0)
    axes.fill_between(t, low, high, color=style["color"], alpha=0.15, linewidth=0.0)
    axes.plot(t, middle, **style)
