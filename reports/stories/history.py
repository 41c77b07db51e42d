"""The output of `dropspin compare history`: the runs in which results changed."""

from collections.abc import Iterator

from dropspin.comparisons.regressions.history import DEFINED, History
from dropspin.reports.document import Charts, Document, Heading, Part, Rows, Sentences, Table
from dropspin.reports.plots.history import result_over_runs
from dropspin.reports.stories.compare import change_cells, judged_otherwise
from dropspin.reports.stories.numbers import capitalized
from dropspin.scenarios.text import counted

MOST_RESULTS = 6
"""Largest number of results listed for one run; the table in the file has all of them."""


def document(history: History) -> Document:
    """The results that changed most, and the cause to which the changes in each run are attributed."""
    causes = [
        f"{move.engine}: {counted(len(move.results), 'result')} changed from {history.names[move.before]} to {history.names[move.run]}. "
        f"{capitalized(move.attribution.message)}."
        for move in history.moves
    ]
    judged = [
        sentence
        for name, of_run in zip(history.names[1:], history.judged_otherwise, strict=True)
        for sentence in judged_otherwise(of_run, f"in {name}")
    ]
    scenes = counted(history.results["scene"].nunique(), "scene")
    unchanged = f"No result changed in {counted(len(history.names), 'run')} of {scenes}."
    if not history.results.duplicated(DEFINED).any():
        unchanged = "No result was compared, because no two runs have one in common."
    changed = rows(history)
    parts: list[Part] = [Table(changed), Sentences([*(causes or [unchanged]), *judged, *_redefined(history)])]
    drawn = history.results[~history.results["kind"].isin(["order", "asymptotic_error"])]
    for scene in history.results["scene"].unique():
        metrics = drawn.loc[drawn["scene"] == scene, "metric"].unique()
        parts += [Heading(scene), Charts(scene, [result_over_runs(history, scene, metric) for metric in metrics])]
    return Document(f"Results over {len(history.names)} runs", parts)


def _redefined(history: History) -> Iterator[str]:
    """For each scene with several definitions, the runs whose definition is not that of the run before."""
    for scene, of_scene in history.results.groupby("scene", sort=False):
        digests = of_scene.groupby("run")["scene_digest"].first()
        if runs := [history.names[run] for run in digests.index[digests != digests.shift()][1:]]:
            yield f"{scene} has another definition in {', '.join(runs)} than in the run before: only runs with the same one are compared."


def rows(history: History) -> Rows:
    """For each run in which results changed, the results that changed most."""
    return [
        {
            "run": history.names[move.run],
            "engine": move.engine,
            "scene": row["scene"],
            **change_cells(row),
            "change": row["change"],
        }
        for move in history.moves
        for row in move.results.head(MOST_RESULTS).to_dict("records")
    ]
