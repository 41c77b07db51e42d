"""Plots: each `plot_` function draws results into axes, for the report and for notebooks alike.

A plot function makes no figure and no legend; it labels what it draws, so that `axes.legend()` makes one. docs/examples.md shows every
picture and the lines that draw it.
"""

from reports.plots.bounces import plot_bounce_ladder
from reports.plots.convergence import plot_error_over_dt
from reports.plots.ensembles import plot_angular_momentum_of_ensemble, plot_energy_of_ensemble, plot_rest_of_ensemble
from reports.plots.figures import (
    bounce_figure,
    convergence_figure,
    ensemble_figure,
    flight_figure,
    history_figure,
    time_figure,
    tradeoff_figure,
)
from reports.plots.growth import plot_error_growth
from reports.plots.history import plot_history
from reports.plots.limits import limits_figure, plot_failure_modes
from reports.plots.over_time import Quantity, angular_momentum_length, height, plot_over_time, quantities, tilt
from reports.plots.spins import plot_polhode
from reports.plots.style import FAINT, INK
from reports.plots.tradeoff import plot_tradeoff

__all__ = [
    "FAINT",
    "INK",
    "Quantity",
    "angular_momentum_length",
    "bounce_figure",
    "convergence_figure",
    "ensemble_figure",
    "flight_figure",
    "height",
    "history_figure",
    "limits_figure",
    "plot_angular_momentum_of_ensemble",
    "plot_bounce_ladder",
    "plot_energy_of_ensemble",
    "plot_error_growth",
    "plot_error_over_dt",
    "plot_failure_modes",
    "plot_history",
    "plot_over_time",
    "plot_polhode",
    "plot_rest_of_ensemble",
    "plot_tradeoff",
    "quantities",
    "tilt",
    "time_figure",
    "tradeoff_figure",
]
