"""Results over successive runs."""

from typing import TYPE_CHECKING

import numpy as np

from dropspin.comparisons.regressions.history import History
from dropspin.reports.plots.chart import Chart, Line, draw
from dropspin.reports.plots.colours import engine_styles
from dropspin.reports.plots.style import metric_label, plain

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes

CHANGED = "changed by more than its tolerance"
LONGEST_LABEL = 22


def result_over_runs(history: History, scene_name: str, metric: str) -> Chart:
    """The absolute value of a metric at the smallest time step in several runs, logarithmic; a cross marks each run in which it changed.

    Lines join runs with the same definition of the scene.

    Args:
        history: The runs.
        scene_name: The name of a scene of the runs.
        metric: The name of a metric of this scene.
    """

    def of(results: "pd.DataFrame") -> "pd.DataFrame":
        return results[
            (results["scene"] == scene_name) & (results["metric"] == metric) & ~results["kind"].isin(["order", "asymptotic_error"])
        ]

    results = of(history.results)
    steps = min(results["steps"], key=float)
    lines = []
    for engine, (colour, marker, dashes) in engine_styles(list(dict.fromkeys(history.results["engine"]))).items():
        mine = results[(results["engine"] == engine) & (results["steps"] == steps)].sort_values("run")
        moved = [move.run for move in history.moves if move.engine == engine and (of(move.results)["steps"] == steps).any()]
        for _, same in mine.groupby("scene_digest", sort=False):
            runs, sizes = same["run"].to_numpy(float), same["value"].abs().to_numpy(float)
            has_moved = np.isin(runs, moved)
            lines.append(Line(engine, runs, sizes, colour, dashes=dashes, marker=marker))
            lines.append(Line(CHANGED, runs[has_moved], sizes[has_moved], width=0.0, marker="X"))
    label = f"{metric_label(metric)}\nat {plain(1e3 * float(steps))} ms"
    return Chart("run", label, [line for line in lines if len(line.x)], y_log=True, ticks=list(enumerate(run_labels(history))))


def plot_history(history: History, scene_name: str, metric: str, axes: "Axes") -> None:
    """Draw `result_over_runs` into axes."""
    draw(result_over_runs(history, scene_name, metric), axes)


def run_labels(history: History) -> list[str]:
    """A short label for each run: the versions that differ between runs, else their commits, else their names."""
    stamps = history.stamps.drop(columns=["run", "started"])
    differing = [column for column in stamps if stamps[column].nunique(dropna=False) > 1]
    versions = [column for column in differing if column != "commit"]
    shown = versions or differing
    if not shown:
        return [name[:LONGEST_LABEL] for name in history.names]
    if shown == ["commit"]:
        return list(map(str, stamps["commit"]))
    versions_of = stamps[shown].fillna("").to_dict("records")  # an engine may be absent from a run
    labels = [", ".join(f"{name} {value}" if value else f"no {name}" for name, value in each.items()) for each in versions_of]
    return labels if len(shown) == 1 else [label[:LONGEST_LABEL] for label in labels]
