"""Plots: each function returns a `Chart`, and each `plot_` function draws one into axes, for notebooks and papers.

A plot function creates no figure and no legend; it labels its lines, so that `axes.legend()` creates a legend. docs/examples.md shows every
plot with the code that draws it.
"""

from dropspin.reports.plots.bounces import bounce_ladder, plot_bounce_ladder
from dropspin.reports.plots.chart import Chart, Line, draw, figure_of
from dropspin.reports.plots.convergence import error_over_dt, plot_error_over_dt
from dropspin.reports.plots.ensembles import (
    angular_momentum_of_ensemble,
    energy_of_ensemble,
    plot_angular_momentum_of_ensemble,
    plot_energy_of_ensemble,
    plot_rest_of_ensemble,
    rest_of_ensemble,
)
from dropspin.reports.plots.growth import error_growth, plot_error_growth
from dropspin.reports.plots.history import plot_history
from dropspin.reports.plots.limits import failure_modes, plot_failure_modes
from dropspin.reports.plots.over_time import Quantity, angular_momentum_length, height, over_time, plot_over_time, quantities, tilt
from dropspin.reports.plots.spins import plot_polhode, polhode
from dropspin.reports.plots.tradeoff import error_over_cost, plot_tradeoff

__all__ = [
    "Chart",
    "Line",
    "Quantity",
    "angular_momentum_length",
    "angular_momentum_of_ensemble",
    "bounce_ladder",
    "draw",
    "energy_of_ensemble",
    "error_growth",
    "error_over_cost",
    "error_over_dt",
    "failure_modes",
    "figure_of",
    "height",
    "over_time",
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
    "polhode",
    "quantities",
    "rest_of_ensemble",
    "tilt",
]
