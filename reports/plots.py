"""Plots: each function takes results and draws into axes, for the report and for notebooks alike."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from comparisons import METRICS, Results
from reports.colours import engine_colours, engine_markers
from scenarios import Scenario, Trajectory, truth_for
from scenarios.mechanics import angular_momentum, energy
from scenarios.rotations import rotate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from comparisons.tradeoff import TradeOff

Array = NDArray[np.float64]
Quantity = Callable[[Scenario, Trajectory], Array]

INK, FAINT = "#010203", "#040506"
"""Stand-ins for the page's text colour: the report replaces them, so that one plot serves light and dark."""
MOST_POINTS = 800
ROUNDING = 1e-17
"""Where exact zeros are drawn on logarithmic axes."""
CONVERGENCE = (
    "energy_error",
    "bounce_height_error",
    "horizontal_momentum_error",
    "angular_momentum_direction_error",
    "orientation_error",
    "restitution_error",
    "position_error",
)


def height(scene: Scenario, motion: Trajectory) -> Array:
    """Height of the centre of mass [m]."""
    return motion.position[:, 1]


def tilt(scene: Scenario, motion: Trajectory) -> Array:
    """Upward component of the body's own y axis: 1 upright, -1 turned over."""
    return rotate(motion.orientation, np.array([0.0, 1.0, 0.0]))[:, 1]


def angular_momentum_length(scene: Scenario, motion: Trajectory) -> Array:
    """|L| [kg m²/s]."""
    return np.linalg.norm(angular_momentum(scene, motion), axis=1)


def quantities(scene: Scenario) -> dict[str, Quantity]:
    """What to show of a scene over time, by axis label."""
    shown: dict[str, Quantity] = {}
    moves = scene.gravity is not None or any(scene.start.velocity)
    if moves:
        shown["height [m]"] = height
    else:
        shown["body's y axis, upward part"] = tilt
    shown["energy [J]"] = energy
    if any(scene.start.angular_velocity):
        shown["|L| [kg m²/s]"] = angular_momentum_length
    return shown


def plot_over_time(results: Results, scene_name: str, quantity: Quantity, axes: "Axes") -> None:
    """Draw one quantity over time: every engine at the coarsest step, where they differ most, and the truth."""
    scene = results.scenes[scene_name]
    truth = truth_for(scene)
    colours = engine_colours(results.engines)
    dts = [dt for name, _, dt in results.trajectories if name == scene_name]
    for number, engine in enumerate(results.engines):
        motion = results.trajectories.get((scene_name, engine, max(dts, default=0.0)))
        if motion is not None:
            thinned = motion[:: max(1, len(motion) // MOST_POINTS)]
            width = _thinner(3.8, 1.2, number, results)
            axes.plot(thinned.t, quantity(scene, thinned), color=colours[engine], linewidth=width, label=engine)
    if truth is not None:
        times = np.linspace(0.0, min(scene.duration, truth.horizon), MOST_POINTS)
        axes.plot(times, quantity(scene, truth(times)), color=INK, linewidth=1.0, linestyle=(0, (3, 3)), label="truth")
    axes.set_xlabel("time [s]")
    axes.ticklabel_format(axis="y", useOffset=False)


def plot_error_over_dt(results: Results, scene_name: str, metric: str, axes: "Axes") -> None:
    """Draw the size of one error over the time step, logarithmic, with a dotted line of first order, and crosses where it was predicted."""
    colours, markers = engine_colours(results.engines), engine_markers(results.engines)
    frame = results.measurements
    mine = frame[(frame["scene"] == scene_name) & (frame["metric"] == metric)]
    largest, is_labelled = 0.0, False
    for number, engine in enumerate(results.engines):
        rows = mine[(mine["engine"] == engine) & mine["value"].notna()].sort_values("dt")
        sizes = np.maximum(rows["value"].abs().to_numpy(), ROUNDING)
        largest = max([largest, *sizes])
        style: Any = {"marker": markers[engine], "markerfacecolor": "none", "linewidth": 1.5, "color": colours[engine]}
        axes.loglog(rows["dt"], sizes, markersize=_thinner(8.0, 4.0, number, results), label=engine, **style)
        foreseen = results.frame[(results.frame["kind"] == "prediction") & (results.frame["engine"] == engine)]
        foreseen = foreseen[(foreseen["scene"] == scene_name) & (foreseen["metric"] == metric) & (foreseen["value"].abs() > ROUNDING)]
        if not foreseen.empty:
            label = None if is_labelled else "predicted"
            is_labelled = True
            axes.loglog(foreseen["dt"], foreseen["value"].abs(), color=INK, linestyle="none", marker="x", markersize=5.0, label=label)
        _draw_fit(results, scene_name, metric, engine, rows["dt"].to_numpy(), rows["value"].to_numpy(), axes)
    dts = np.sort(mine["dt"].unique())
    if len(dts) > 1 and largest > 0.0:
        # Above the data, so that it hides no line that it may coincide with.
        axes.loglog(dts, 2.0 * largest * dts / dts[-1], color=INK, linewidth=1.0, linestyle=":", label="order 1")
    axes.set_xticks(dts, [f"{1e3 * dt:g}" for dt in dts])
    axes.minorticks_off()
    axes.set_xlabel("step [ms]")
    unit = METRICS[metric].unit
    axes.set_ylabel(metric.replace("_", " ") + ("" if unit == "1" else f" [{unit}]"))


def _draw_fit(results: Results, scene_name: str, metric: str, engine: str, dts: Array, errors: Array, axes: "Axes") -> None:
    """Draw |m + C hᵖ| through the finest step, dashed, from the coarsest to a quarter of the finest."""
    frame = results.frame
    mine = frame[(frame["scene"] == scene_name) & (frame["metric"] == metric) & (frame["engine"] == engine)]
    fitted, limits = (mine[mine["kind"] == kind] for kind in ("order", "model_error"))
    if fitted.empty or limits.empty:
        return
    order = float(fitted["value"].iloc[0])
    limit = float(limits["value"].iloc[0]) if limits["cause"].iloc[0] in ("model", "setting") else 0.0
    h = np.geomspace(dts.max(), 0.25 * dts.min(), 50)
    curve = np.abs(limit + (errors[0] - limit) * (h / dts[0]) ** order)
    axes.loglog(h, np.maximum(curve, ROUNDING), color=engine_colours(results.engines)[engine], linewidth=0.8, linestyle=(0, (4, 3)))


def plot_energy_of_ensemble(results: Results, scene_name: str, axes: "Axes") -> None:
    """Draw the energy left in an ensemble over time at the finest step: each engine's median, and between which values eight of ten lie."""
    colours = engine_colours(results.engines)
    finest = min(dt for name, _, dt in results.ensembles if name == scene_name)
    for number, engine in enumerate(results.engines):
        outcome = results.ensembles.get((scene_name, engine, finest))
        if outcome is not None:
            low, middle, high = np.quantile(outcome.energy, [0.1, 0.5, 0.9], axis=0)
            axes.fill_between(outcome.t, low, high, color=colours[engine], alpha=0.15, linewidth=0.0)
            axes.plot(outcome.t, middle, color=colours[engine], linewidth=_thinner(3.8, 1.2, number, results), label=engine)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("energy, over the scene's")


def plot_rest_of_ensemble(results: Results, scene_name: str, axes: "Axes") -> None:
    """Draw at the finest step which share of an ensemble is at rest by when."""
    colours = engine_colours(results.engines)
    finest = min(dt for name, _, dt in results.ensembles if name == scene_name)
    for number, engine in enumerate(results.engines):
        outcome = results.ensembles.get((scene_name, engine, finest))
        if outcome is not None:
            width = _thinner(3.8, 1.2, number, results)
            axes.ecdf(outcome.rest_time, color=colours[engine], linewidth=width, label=engine)
    axes.set_xlim(0.0, results.scenes[scene_name].duration)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("share at rest")


def plot_tradeoff(found: "TradeOff", axes: "Axes") -> None:
    """Draw error over cost, both logarithmic: each engine's steps joined, and the front, which nothing beats in both."""
    engines = list(dict.fromkeys(point.engine for point in found.points))
    colours, markers = engine_colours(engines), engine_markers(engines)
    cheapest, best = zip(*((point.typical, max(point.error, ROUNDING)) for point in found.front), strict=True)
    axes.loglog(cheapest, best, color=INK, linewidth=5.0, alpha=0.25, label="front")
    for engine in engines:
        mine = [point for point in found.points if point.engine == engine]
        axes.loglog(
            [point.typical for point in mine],
            [max(point.error, ROUNDING) for point in mine],
            color=colours[engine],
            marker=markers[engine],
            markersize=3.5,
            linewidth=1.0,
            label=engine,
        )
    unit = METRICS[found.metric].unit
    axes.set_xlabel("time per simulated second [s]")
    axes.set_ylabel(found.metric.replace("_", " ") + ("" if unit == "1" else f" [{unit}]"))


def tradeoff_figure(found: "TradeOff") -> "Figure":
    """Error over cost in one scene."""
    with _figure(2) as (figure, panels):
        plot_tradeoff(found, panels[0])
        panels[0].set_title(found.scene.name)
        panels[1].axis("off")
        panels[1].legend(*panels[0].get_legend_handles_labels(), loc="center left", frameon=False)
    return figure


def ensemble_figure(results: Results, scene_name: str) -> "Figure | None":
    """The energy left in an ensemble and the share of it at rest, over time; None if nothing has an outcome."""
    if not any(name == scene_name for name, _, _ in results.ensembles):
        return None
    with _figure(2) as (figure, panels):
        plot_energy_of_ensemble(results, scene_name, panels[0])
        plot_rest_of_ensemble(results, scene_name, panels[1])
        _add_legend(figure, panels)
    return figure


def time_figure(results: Results, scene_name: str) -> "Figure":
    """Height or tilt, energy and |L| over time, side by side."""
    shown = quantities(results.scenes[scene_name])
    with _figure(len(shown)) as (figure, panels):
        for axes, (label, quantity) in zip(panels, shown.items(), strict=True):
            plot_over_time(results, scene_name, quantity, axes)
            axes.set_ylabel(label)
        _add_legend(figure, panels)
    return figure


def convergence_figure(results: Results, scene_name: str) -> "Figure | None":
    """The scene's first three errors that are not zero everywhere, over the time step; None if all are."""
    mine = results.measurements[results.measurements["scene"] == scene_name]
    present = [name for name in CONVERGENCE if (mine.loc[mine["metric"] == name, "value"].abs() > 1e-13).any()]
    if not present:
        return None
    with _figure(min(len(present), 3)) as (figure, panels):
        for axes, metric in zip(panels, present, strict=False):
            plot_error_over_dt(results, scene_name, metric, axes)
        _add_legend(figure, panels)
    return figure


def _thinner(first: float, last: float, number: int, results: Results) -> float:
    """Sizes from first to last: engines often coincide, and what is drawn later must leave the earlier visible."""
    return float(np.linspace(first, last, max(len(results.engines), 2))[number])


@contextmanager
def _figure(panels: int) -> "Iterator[tuple[Figure, list[Axes]]]":
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    style: Any = {
        "text.parse_math": False,  # names are text, whatever dollars are in them
        "text.color": INK,
        "axes.labelcolor": INK,
        "axes.edgecolor": FAINT,
        "xtick.color": INK,
        "ytick.color": INK,
        "font.size": 9.0,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "grid.color": FAINT,
        "grid.alpha": 0.15,
        "axes.facecolor": "none",
        "figure.facecolor": "none",
        "legend.frameon": False,
    }
    with rc_context(style):
        figure = Figure(figsize=(3.7 * panels, 2.9), layout="constrained")
        yield figure, list(np.atleast_1d(figure.subplots(1, panels)))


def _add_legend(figure: "Figure", panels: "list[Axes]") -> None:
    named = {label: handle for axes in panels for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)}
    handles, labels = list(named.values()), list(named)
    figure.legend(handles, labels, loc="outside upper left", ncols=len(labels), fontsize=9)
