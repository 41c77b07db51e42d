"""The files that a study writes: tables as CSV and JSON, a Markdown page, figures, and the section for the report of a run."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from dropspin.comparisons.published.results import Result
from dropspin.comparisons.published.sources import Source
from dropspin.comparisons.regressions.history import History
from dropspin.comparisons.results.folder import file_name
from dropspin.comparisons.robustness.study import RobustnessStudy
from dropspin.comparisons.symmetries.findings import Finding
from dropspin.comparisons.tradeoff.points import TradeOff
from dropspin.reports.html.replay import replay_page
from dropspin.reports.markdown import history_markdown
from dropspin.reports.output import write_table
from dropspin.reports.plots.figures import history_figure, limits_charts, tradeoff_charts
from dropspin.reports.plots.svg import save_svg
from dropspin.reports.replay.motions import replay_together
from dropspin.reports.sections import Section
from dropspin.reports.views import history, limits, reproduce, symmetries, tradeoff
from dropspin.scenarios import Scenario, Trajectory


def write_limits(found: Sequence[RobustnessStudy], folder: Path) -> None:
    """Write `limits.csv`, `limits.json`, `limits.md` and a figure per scene."""
    write_table(folder, "limits", limits.COLUMNS, [row for one in found for row in limits.rows(one)])
    section = Section("Where engines break down")
    if steps := limits.step_rows(found):
        section.add_heading("The largest steps")
        section.add_table(steps)
        section.add_text(limits.ACCURATE_AND_STABLE)
    for one in found:
        section.add_heading(one.scene.name)
        section.add_text(limits.nominal(one))
        if one.scans:
            section.add_charts(one.scene.name, limits_charts(one))
            section.add_table(limits.range_rows(one))
        section.add_list(limits.sentences(one))
    section.write(folder, "limits")


def write_tradeoff(found: Sequence[TradeOff], within: Sequence[float], folder: Path) -> None:
    """Write `tradeoff.csv`, `tradeoff.json`, `tradeoff.md` and a plot per scene."""
    write_table(folder, "tradeoff", tradeoff.columns(found), [row for one in found for row in tradeoff.rows(one)])
    section = Section("What accuracy costs")
    for one in found:
        section.add_heading(one.scene.name)
        section.add_charts(one.scene.name, tradeoff_charts(one))
        section.add_table(tradeoff.pareto_front_rows(one))
        section.add_list(tradeoff.sentences(one, within))
    section.write(folder, "tradeoff")


def write_reproduced(chosen: Sequence[Source], results: Sequence[Result], folder: Path) -> None:
    """Write `reproduce.csv`, `reproduce.json` and `reproduce.md`."""
    write_table(folder, "reproduce", reproduce.COLUMNS, reproduce.rows(results))
    section = Section("Published results")
    for source in chosen:
        own = [one for one in results if one.source == source.name]
        title, *texts = reproduce.heading(source)
        section.add_heading(title)
        for text in texts:
            section.add_text(text)
        section.add_table(reproduce.table(own))
        section.add_list(reproduce.notes(source, own))
    section.add_heading("All sources")
    section.add_table(reproduce.summary(results))
    section.add_list([reproduce.LEGEND, reproduce.verdict(results)])
    section.write(folder, "reproduce")


def write_symmetries(found: Sequence[Finding], scenes: Mapping[str, Scenario], dt: float, folder: Path) -> None:
    """Write `symmetries.csv`, `symmetries.json`, `symmetries.md`, and `symmetries.html` with a replay of the worst case of each engine.

    Args:
        found: The findings.
        scenes: The scenes by name.
        dt: The time step [s].
        folder: The folder.
    """
    write_table(folder, "symmetries", symmetries.COLUMNS, symmetries.rows(found))
    section = Section("Symmetries and repeated runs")
    section.add_table(symmetries.worst_rows(found))
    section.add_text(symmetries.legend(found))
    section.add_list(symmetries.sentences(found))
    section.write(folder, "symmetries")
    if worst := symmetries.worst_lost(found):
        replays = [replay_together(scenes[one.scene], dt, _as_trajectories(one, dt)) for one in worst]
        (folder / "symmetries.html").write_text(replay_page(replays, [[]] * len(replays)), encoding="utf-8")


def _as_trajectories(lost: Finding, dt: float) -> dict[str, Trajectory]:
    """The engine's motion and the one that should equal it, by labels."""
    assert lost.motions is not None
    labels = lost.engine, f"{lost.engine}, {lost.symmetry}"
    times = dt * np.arange(len(lost.motions[0]), dtype=np.float64)
    return {label: Trajectory.from_states(times, states) for label, states in zip(labels, lost.motions, strict=True)}


def write_history(found: History, folder: Path) -> None:
    """Write `history.csv` and `history.json` with every result of every run, `history.md`, and a plot per scene."""
    results = found.results.drop(columns="verdict").assign(run=[found.names[number] for number in found.results["run"]])
    table = results.merge(found.stamps, on="run")
    known = table.astype(object).where(table.notna(), None)  # JSON has no NaN
    records = [{str(key): value for key, value in row.items()} for row in known.to_dict("records")]
    write_table(folder, "history", [str(name) for name in table], records)
    pictures = {scene: f"{file_name(scene)}.svg" for scene in dict.fromkeys(found.results["scene"])}
    for scene, picture in pictures.items():
        save_svg(history_figure(found, scene), folder / picture)
    (folder / "history.md").write_text(history_markdown(len(found.names), history.sentences(found), pictures), encoding="utf-8")
