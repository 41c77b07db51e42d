"""Ensembles over time, at the finest time step: energy, angular momentum, and the fraction of bodies at rest."""

from typing import TYPE_CHECKING, Any

import numpy as np

from dropspin.comparisons.results.results import Results
from dropspin.reports.plots.chart import Chart, Line, draw
from dropspin.reports.plots.style import TIME, at_one_step, stride
from dropspin.scenarios.state import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def energy_of_ensemble(results: Results, scene_name: str) -> Chart:
    """The energy over time: median and 10th–90th percentile of each engine."""
    found = at_one_step(results, results.ensembles, scene_name, min)
    return Chart(TIME, "energy / energy of the scene", [_spread(outcome.t, outcome.energy, style) for outcome, style in found])


def angular_momentum_of_ensemble(results: Results, scene_name: str) -> Chart:
    """The magnitude of the angular momentum L over time: median and 10th–90th percentile of each engine.

    It is divided by r √(2 E M), with the energy E of the scene and the size r and the mass M of the body. This is the angular momentum of a
    ring of radius r and mass M whose rotational energy is E. It is positive even if the body does not rotate initially.
    """
    found = at_one_step(results, results.ensembles, scene_name, min)
    return Chart(TIME, "|L| / (r √(2 E M))", [_spread(outcome.t, outcome.angular_momentum, style) for outcome, style in found])


def rest_of_ensemble(results: Results, scene_name: str) -> Chart:
    """The fraction of the ensemble at rest over time. Bodies that still move at the end are not counted as at rest."""
    duration, lines = results.scenes[scene_name].duration, []
    for outcome, style in at_one_step(results, results.ensembles, scene_name, min):
        rested = np.sort(outcome.rest_time[outcome.rest_time < outcome.t[-1]])
        x = np.concatenate([[0.0], rested, [duration]])
        share = np.arange(len(rested) + 1) / len(outcome.rest_time)
        lines.append(Line(x=x, y=np.append(share, share[-1]), **style, is_step=True))
    return Chart(TIME, "fraction at rest", lines, x_range=(0.0, duration))


def plot_energy_of_ensemble(results: Results, scene_name: str, axes: "Axes") -> None:
    """Draw `energy_of_ensemble` into axes."""
    draw(energy_of_ensemble(results, scene_name), axes)


def plot_angular_momentum_of_ensemble(results: Results, scene_name: str, axes: "Axes") -> None:
    """Draw `angular_momentum_of_ensemble` into axes."""
    draw(angular_momentum_of_ensemble(results, scene_name), axes)


def plot_rest_of_ensemble(results: Results, scene_name: str, axes: "Axes") -> None:
    """Draw `rest_of_ensemble` into axes."""
    draw(rest_of_ensemble(results, scene_name), axes)


@np.errstate(all="ignore")  # an engine may return 1e300
def _spread(t: Array, values: Array, style: dict[str, Any]) -> Line:
    every = stride(len(t))
    low, middle, high = np.quantile(values[:, ::every], [0.1, 0.5, 0.9], axis=0)
    return Line(x=t[::every], y=middle, low=low, high=high, **style)
