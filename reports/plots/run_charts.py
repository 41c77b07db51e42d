"""The charts of each scene of a report, of each trade-off and of each study of limits."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from dropspin.comparisons.judging.verdicts import FAILURES
from dropspin.comparisons.limits.study import LimitsStudy
from dropspin.comparisons.measuring.predictions import spins_steadily
from dropspin.comparisons.results.results import Results
from dropspin.reports.plots.bounces import bounce_ladder
from dropspin.reports.plots.chart import Chart
from dropspin.reports.plots.colours import TABLES
from dropspin.reports.plots.convergence import error_over_dt
from dropspin.reports.plots.ensembles import angular_momentum_of_ensemble, energy_of_ensemble, rest_of_ensemble
from dropspin.reports.plots.growth import error_growth
from dropspin.reports.plots.limits import failure_modes
from dropspin.reports.plots.over_time import over_time, quantities
from dropspin.reports.plots.polhodes import polhode
from dropspin.reports.plots.tradeoff import error_over_cost, throughput
from dropspin.scenarios import reference_for

if TYPE_CHECKING:
    from dropspin.comparisons.tradeoff.pareto import TradeOff

CONVERGENCE: list[str] = TABLES["convergence"]
GROWTH = ("orientation_error", "position_error", "energy_error")
WORTH_A_POINT, WORTH_A_LINE = 1e-13, 1e-11
"""Errors that never exceed this value are rounding errors, which accumulate over time."""
MOST_PANELS = 3
MOST_SCENES = 40
"""Largest number of scenes with plots; a run of more scenes has plots only of scenes in which a check fails."""


def report_charts(results: Results) -> dict[str, dict[str, Sequence[Chart]]]:
    """The charts of the report, by scene and by a key of `CHARTS`."""
    names = list(results.scenes)
    failing = results.table.loc[results.breakdowns | results.table["verdict"].isin(FAILURES), "scene"].unique()
    plotted = names if len(names) <= MOST_SCENES else failing[:MOST_SCENES]
    drawn = {scene: {kind: make(results.by_scene[scene], scene) for kind, make in CHARTS.items()} for scene in plotted}
    return {scene: {kind: charts for kind, charts in by_kind.items() if charts} for scene, by_kind in drawn.items()}


def time_charts(results: Results, scene_name: str) -> list[Chart]:
    """Height or tilt, energy and |L| over time."""
    return [over_time(results, scene_name, quantity) for quantity in quantities(results.scenes[scene_name]).values()]


def convergence_charts(results: Results, scene_name: str) -> list[Chart]:
    """The first three errors of the scene that exceed rounding for some engine, as functions of the time step."""
    return [error_over_dt(results, scene_name, metric) for metric in _errors(results, scene_name, CONVERGENCE, WORTH_A_POINT)[:MOST_PANELS]]


def flight_charts(results: Results, scene_name: str) -> list[Chart]:
    """The polhode of a body that does not spin about a principal axis, and errors over time; none for scenes with a floor."""
    scene = results.scenes[scene_name]
    truth = reference_for(scene)
    if scene.floor is not None or truth is None or not truth.is_exact:
        return []
    paths = [] if spins_steadily(scene) else [polhode(results, scene_name)]
    growing = _errors(results, scene_name, GROWTH, WORTH_A_LINE)[: MOST_PANELS - len(paths)]
    return [*paths, *(error_growth(results, scene_name, metric) for metric in growing)]


def bounce_charts(results: Results, scene_name: str) -> list[Chart]:
    """The bounce ladder, and the position error over time; none if the exact solution is not a bounce ladder."""
    scene = results.scenes[scene_name]
    truth = reference_for(scene)
    if truth is None or truth.name != "bounce-ladder" or not truth.events or not scene.starts_above_floor:
        return []
    return [bounce_ladder(results, scene_name), error_growth(results, scene_name, "position_error")]


def ensemble_charts(results: Results, scene_name: str) -> list[Chart]:
    """Energy, |L| and the fraction at rest of an ensemble over time; none if no engine has an outcome."""
    if not any(name == scene_name for name, _, _ in results.ensembles):
        return []
    return [make(results, scene_name) for make in (energy_of_ensemble, angular_momentum_of_ensemble, rest_of_ensemble)]


def tradeoff_charts(found: "TradeOff") -> list[Chart]:
    """Error over cost in one scene, for one world, and per world in batches; and the throughput over the number of worlds."""
    batches = [worlds for worlds in found.worlds if found.batch_pareto_front(worlds)]
    charts = [error_over_cost(found, worlds) for worlds in (None, *batches)]
    return [*charts, throughput(found)] if len(batches) > 1 else charts


def limits_charts(found: LimitsStudy) -> list[Chart]:
    """The failure modes of all engines along each axis of a scene."""
    return [failure_modes(found, name) for name in dict.fromkeys(scan.axis.name for scan in found.scans)]


def _errors(results: Results, scene_name: str, metrics: Sequence[str], worth: float) -> list[str]:
    """The metrics for which at least one engine has an error larger than `worth`."""
    mine = results.measurements[results.measurements["scene"] == scene_name]
    largest = mine["value"].abs().groupby(mine["metric"]).max()
    return [name for name in metrics if largest.get(name, 0.0) > worth]


CHARTS: dict[str, Callable[[Results, str], Sequence[Chart]]] = {
    "time": time_charts,
    "flight": flight_charts,
    "bounces": bounce_charts,
    "convergence": convergence_charts,
    "ensemble": ensemble_charts,
}
"""The groups of charts that a scene can have in the report."""
