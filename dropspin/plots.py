"""Plots of results, drawn into axes of your own: `dropspin.reports.plots`."""

from dropspin.reports.plots import *  # noqa: F403 - its public names, whatever they are
