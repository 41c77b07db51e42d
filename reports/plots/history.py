"""Results plotted over successive runs."""

from typing import TYPE_CHECKING

import numpy as np

from dropspin.comparisons.regressions.comparing import History
from dropspin.reports.plots.colours import engine_colours
from dropspin.reports.plots.style import metric_label, power, thinner

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

LONGEST_LABEL = 22
SMALLEST, MOST_TICKS = 1e-3, 7
"""Results below this fraction of the largest are drawn on a linear part of the axis around 0. The second number is the largest number of
ticks.
"""


def plot_history(history: History, scene_name: str, metric: str, axes: "Axes") -> None:
    """Draw a metric of each engine at the finest time step for a sequence of runs; a ring marks each run in which it changed.

    Args:
        history: The runs.
        scene_name: One of their scenes.
        metric: One of its metrics.
        axes: The axes to draw into.
    """
    from matplotlib.ticker import FuncFormatter, SymmetricalLogLocator

    results = history.results
    shown = results[(results["scene"] == scene_name) & (results["metric"] == metric) & ~results["kind"].isin(["order", "asymptotic_error"])]
    steps = min(shown["steps"], key=float)
    shown = shown[shown["steps"] == steps]
    engines = list(dict.fromkeys(results["engine"]))
    colours = engine_colours(engines)
    for number, engine in enumerate(engines):
        line = shown[shown["engine"] == engine].sort_values("run")
        if line.empty:
            continue
        width = thinner(number, len(engines))
        axes.plot(line["run"], line["value"], color=colours[engine], linewidth=width, marker="o", markersize=width + 1.5, label=engine)
        moved = [move.run for move in history.moves if move.engine == engine and _has(move.results, scene_name, metric, steps)]
        at = line[line["run"].isin(moved)]
        axes.plot(at["run"], at["value"], "o", markersize=13.0, markerfacecolor="none", markeredgecolor=colours[engine])
    sizes = shown["value"].abs()
    if sizes.max() > 0.0:  # shows results that differ by orders of magnitude
        smallest = max(float(sizes[sizes > 0.0].min()), SMALLEST * float(sizes.max()))
        linear = float(10.0 ** np.floor(np.log10(smallest)))
        axes.set_yscale("symlog", linthresh=linear)
        ticks = SymmetricalLogLocator(linthresh=linear, base=10.0)
        ticks.set_params(numticks=MOST_TICKS)
        axes.yaxis.set_major_locator(ticks)
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: _signed(value)))
    axes.set_xlabel("run")
    axes.set_xticks(np.arange(len(history.names)), run_labels(history), rotation=30, ha="right")
    axes.set_ylabel(f"{metric_label(metric)}\nat {1e3 * float(steps):g} ms")


def _signed(value: float) -> str:
    return "0" if value == 0.0 else power(value) if value > 0.0 else f"−{power(-value)}"


def run_labels(history: History) -> list[str]:
    """A short label for each run: the versions that differ between runs, else their commits, else their names."""
    stamps = history.stamps.drop(columns=["run", "started"])
    differing = [column for column in stamps if stamps[column].nunique(dropna=False) > 1]
    versions = [column for column in differing if column != "commit"]
    shown = versions or differing
    if not shown:
        return [name[:LONGEST_LABEL] for name in history.names]
    if len(shown) == 1:
        return [str(value) if column == "commit" else f"{column} {value}" for column in shown for value in stamps[column]]
    return [", ".join(f"{column} {row[column]}" for column in shown)[:LONGEST_LABEL] for row in stamps.to_dict("records")]


def _has(results: "pd.DataFrame", scene_name: str, metric: str, steps: str) -> bool:
    return bool(((results["scene"] == scene_name) & (results["metric"] == metric) & (results["steps"] == steps)).any())
