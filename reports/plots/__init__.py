"""Plots: each function returns a `Chart`, and each `plot_` function draws one into axes, for notebooks and papers.

A `plot_` function creates neither a figure nor a legend. It labels its lines, so `axes.legend()` creates a legend.
`figure_of` makes a figure of charts that is as wide as a column or a page. docs/examples.md shows every plot with the code that draws it.
"""

from dropspin.reports.plots.bounces import bounce_ladder as bounce_ladder
from dropspin.reports.plots.bounces import plot_bounce_ladder as plot_bounce_ladder
from dropspin.reports.plots.chart import Chart as Chart
from dropspin.reports.plots.chart import Line as Line
from dropspin.reports.plots.chart import draw as draw
from dropspin.reports.plots.colours import human_label as human_label
from dropspin.reports.plots.convergence import error_over_dt as error_over_dt
from dropspin.reports.plots.convergence import plot_error_over_dt as plot_error_over_dt
from dropspin.reports.plots.ensembles import angular_momentum_of_ensemble as angular_momentum_of_ensemble
from dropspin.reports.plots.ensembles import energy_of_ensemble as energy_of_ensemble
from dropspin.reports.plots.ensembles import plot_angular_momentum_of_ensemble as plot_angular_momentum_of_ensemble
from dropspin.reports.plots.ensembles import plot_energy_of_ensemble as plot_energy_of_ensemble
from dropspin.reports.plots.ensembles import plot_rest_of_ensemble as plot_rest_of_ensemble
from dropspin.reports.plots.ensembles import rest_of_ensemble as rest_of_ensemble
from dropspin.reports.plots.figure import figure_of as figure_of
from dropspin.reports.plots.figure import label_ends as label_ends
from dropspin.reports.plots.figure import save_data as save_data
from dropspin.reports.plots.figure import save_figure as save_figure
from dropspin.reports.plots.growth import error_growth as error_growth
from dropspin.reports.plots.growth import plot_error_growth as plot_error_growth
from dropspin.reports.plots.history import plot_history as plot_history
from dropspin.reports.plots.history import result_over_runs as result_over_runs
from dropspin.reports.plots.limits import failure_modes as failure_modes
from dropspin.reports.plots.limits import plot_failure_modes as plot_failure_modes
from dropspin.reports.plots.over_time import Quantity as Quantity
from dropspin.reports.plots.over_time import angular_momentum_length as angular_momentum_length
from dropspin.reports.plots.over_time import height as height
from dropspin.reports.plots.over_time import over_time as over_time
from dropspin.reports.plots.over_time import plot_over_time as plot_over_time
from dropspin.reports.plots.over_time import quantities as quantities
from dropspin.reports.plots.over_time import tilt as tilt
from dropspin.reports.plots.polhodes import plot_polhode as plot_polhode
from dropspin.reports.plots.polhodes import polhode as polhode
from dropspin.reports.plots.style import style as style
from dropspin.reports.plots.tradeoff import error_over_cost as error_over_cost
from dropspin.reports.plots.tradeoff import plot_tradeoff as plot_tradeoff
