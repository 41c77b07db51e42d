"""The figures of the report: plots side by side, in the colours of the page, with one legend."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from comparisons.judging.verdicts import FAILURES
from comparisons.results.results import Results
from reports.plots.bounces import plot_bounce_ladder
from reports.plots.convergence import plot_error_over_dt
from reports.plots.ensembles import plot_angular_momentum_of_ensemble, plot_energy_of_ensemble, plot_rest_of_ensemble
from reports.plots.growth import plot_error_growth
from reports.plots.history import plot_history
from reports.plots.over_time import plot_over_time, quantities
from reports.plots.spins import plot_polhode, wobbles_freely
from reports.plots.style import REPORT
from reports.plots.tradeoff import plot_tradeoff
from scenarios import truth_for

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from comparisons.regressions.history import History
    from comparisons.tradeoff.points import TradeOff

CONVERGENCE = (
    "energy_error",
    "bounce_height_error",
    "horizontal_momentum_error",
    "angular_momentum_direction_error",
    "orientation_error",
    "restitution_error",
    "position_error",
)
GROWTH = ("orientation_error", "position_error", "energy_error")
WORTH_A_POINT, WORTH_A_LINE = 1e-13, 1e-11
"""Errors that are nowhere larger are rounding; over time it accumulates."""
MOST_PANELS = 3
MOST_SCENES = 40
"""A run of more scenes has plots of those that fail only, and of this many of them at most."""


def report_figures(results: Results) -> "Iterator[tuple[str, Figure]]":
    """Name and figure of each plot of the report."""
    names = list(results.scenes)
    failing = results.table.loc[results.breakdowns | results.table["verdict"].isin(FAILURES), "scene"].unique()
    plotted = names if len(names) <= MOST_SCENES else failing[:MOST_SCENES]
    for number, scene in enumerate(names):
        if scene not in plotted:
            continue
        for kind, draw in FIGURES.items():
            figure = draw(results, scene)
            if figure is not None:
                yield f"{number:02d}-{kind}", figure


def tradeoff_figure(found: "TradeOff") -> "Figure":
    """Error over cost in one scene: of one world, and per world in a batch if an engine can step batches."""
    kinds = [False, True] if found.batch_pareto_front else [False]
    with _figure([""] * (len(kinds) + 1)) as (figure, panels):
        for axes, batch in zip(panels, kinds, strict=False):
            plot_tradeoff(found, axes, batch)
        panels[0].set_title(found.scene.name)
        panels[-1].axis("off")
        panels[-1].legend(*panels[0].get_legend_handles_labels(), loc="center left", frameon=False)
    return figure


def ensemble_figure(results: Results, scene_name: str) -> "Figure | None":
    """Energy, |L| and the fraction at rest of an ensemble over time; None if no engine has an outcome."""
    if not any(name == scene_name for name, _, _ in results.ensembles):
        return None
    plots = [plot_energy_of_ensemble, plot_angular_momentum_of_ensemble, plot_rest_of_ensemble]
    with _figure([""] * len(plots)) as (figure, panels):
        for axes, plot in zip(panels, plots, strict=True):
            plot(results, scene_name, axes)
        _add_legend(figure, panels)
    return figure


def time_figure(results: Results, scene_name: str) -> "Figure":
    """Height or tilt, energy and |L| over time, side by side."""
    shown = quantities(results.scenes[scene_name])
    with _figure([""] * len(shown)) as (figure, panels):
        for axes, quantity in zip(panels, shown.values(), strict=True):
            plot_over_time(results, scene_name, quantity, axes)
        _add_legend(figure, panels)
    return figure


def convergence_figure(results: Results, scene_name: str) -> "Figure | None":
    """The first three errors of the scene that are above rounding somewhere, over the time step; None if there are none."""
    present = _errors(results, scene_name, CONVERGENCE, WORTH_A_POINT)[:MOST_PANELS]
    if not present:
        return None
    with _figure([""] * len(present)) as (figure, panels):
        for axes, metric in zip(panels, present, strict=True):
            plot_error_over_dt(results, scene_name, metric, axes)
        _add_legend(figure, panels)
    return figure


def flight_figure(results: Results, scene_name: str) -> "Figure | None":
    """The polhode of a body that does not spin about a principal axis, and errors over time; None for scenes with a floor."""
    scene = results.scenes[scene_name]
    if scene.floor is not None or truth_for(scene) is None:
        return None
    wobbles = wobbles_freely(scene)
    growing = _errors(results, scene_name, GROWTH, WORTH_A_LINE)[: MOST_PANELS - wobbles]
    if not (growing or wobbles):
        return None
    with _figure(["3d"] * wobbles + [""] * len(growing)) as (figure, panels):
        if wobbles:
            plot_polhode(results, scene_name, panels[0])
        for axes, metric in zip(panels[wobbles:], growing, strict=True):
            plot_error_growth(results, scene_name, metric, axes)
        _add_legend(figure, panels)
    return figure


def bounce_figure(results: Results, scene_name: str) -> "Figure | None":
    """The bounce ladder, and the position error over time; None if the exact solution is not a bounce ladder."""
    truth = truth_for(results.scenes[scene_name])
    if truth is None or truth.name != "bounce-ladder" or not truth.events or not results.scenes[scene_name].starts_above_floor:
        return None
    with _figure(["", ""]) as (figure, panels):
        plot_bounce_ladder(results, scene_name, panels[0])
        plot_error_growth(results, scene_name, "position_error", panels[1])
        _add_legend(figure, panels)
    return figure


def history_figure(history: "History", scene_name: str) -> "Figure":
    """Each metric of a scene over runs."""
    results = history.results[~history.results["kind"].isin(["order", "asymptotic_error"])]
    metrics = list(dict.fromkeys(results.loc[results["scene"] == scene_name, "metric"]))
    with _figure([""] * len(metrics), MOST_PANELS) as (figure, panels):
        for axes, metric in zip(panels, metrics, strict=True):
            plot_history(history, scene_name, metric, axes)
        _add_legend(figure, panels)
    return figure


def _errors(results: Results, scene_name: str, metrics: Sequence[str], worth: float) -> list[str]:
    """The metrics of which some engine has an error larger than `worth`."""
    mine = results.measurements[results.measurements["scene"] == scene_name]
    return [name for name in metrics if (mine.loc[mine["metric"] == name, "value"].abs() > worth).any()]


@contextmanager
def _figure(projections: Sequence[str], in_a_row: int | None = None) -> "Iterator[tuple[Figure, list[Axes]]]":
    """A figure in the style of the report with a panel for each projection, `3d` or empty; all in one row, or `in_a_row`."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    with rc_context(REPORT):
        columns = min(in_a_row or len(projections), len(projections))
        rows = -(-len(projections) // columns)
        figure = Figure(figsize=(3.7 * columns, 2.9 * rows), layout=ConstrainedLayoutEngine(w_pad=0.12))
        yield figure, [figure.add_subplot(rows, columns, place, projection=one or None) for place, one in enumerate(projections, 1)]


def _add_legend(figure: "Figure", panels: "list[Axes]") -> None:
    named = {label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    handles, labels = list(named.values()), list(named)
    figure.legend(handles, labels, loc="outside upper left", ncols=len(labels), fontsize=9)


FIGURES: "dict[str, Callable[[Results, str], Figure | None]]" = {
    "time": time_figure,
    "flight": flight_figure,
    "bounces": bounce_figure,
    "convergence": convergence_figure,
    "ensemble": ensemble_figure,
}
"""The kinds of figure that a scene can have in the report."""
