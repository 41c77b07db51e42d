"""The output of `dropspin run`: the overview of a run, computed once for terminal, HTML and Markdown."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from dropspin.comparisons.results.ensembles import QUICK_MEMBERS
from dropspin.comparisons.results.results import Results, Status
from dropspin.comparisons.running.forecast import Forecast
from dropspin.comparisons.running.start_phases import QUICK_START_PHASES, START_PHASES
from dropspin.reports.document import Document, Heading, Paragraph, Part, Sentences, Table
from dropspin.reports.stories.conclusion import Point, conclusion, conditions
from dropspin.reports.stories.failures import Failure, failure_parts, failures, reproduce_drawn
from dropspin.reports.stories.findings import (
    ProfileComparison,
    beside_recordings,
    counts,
    ensemble_differences,
    finding_sentences,
    missing_engines,
    not_repeated,
    profile_comparisons,
    verdict_sentence,
)
from dropspin.reports.stories.impact_laws import law_rows
from dropspin.reports.stories.matrix import Leading, leading_errors, legend_of_marks, matrix_of
from dropspin.reports.stories.numbers import listed
from dropspin.reports.stories.words import WORDS
from dropspin.scenarios.text import counted


class Overview(NamedTuple):
    """The first part of a report.

    Attributes:
        verdict: The outcome of the checks in one sentence.
        points: What a quick run left out, engines that are missing, do not repeat their motions or have default settings, which engine
            to use for which quantity, and the command that draws the same random scenes again.
        findings: The main finding on each engine.
        statuses: The status of each engine in each scene, by scene and engine.
        leading: The leading error of each scene with an exact solution, by scene.
        profiles: Engines with default settings compared with the calibrated ones.
        failures: The failures; those of one result at several time steps count as one.
        tags: By property, such as Coulomb friction, the scenes that have it; the conclusion excepts scenes by these properties.
        laws: The distances of engines to other impact laws, in scenes in which the laws differ: the rows of `law_rows`.
    """

    verdict: str
    points: Sequence[Point]
    findings: Sequence[str]
    statuses: Mapping[str, Mapping[str, Status]]
    leading: Mapping[str, Leading]
    profiles: Sequence[ProfileComparison]
    failures: Sequence[Failure]
    tags: Mapping[str, Sequence[str]]
    laws: Sequence[Mapping[str, str]]

    @property
    def conclusion(self) -> list[str]:
        """The sentences of `points`."""
        return [str(point) for point in self.points]


def overview(results: Results) -> Overview:
    """The overview of a run."""
    profiles = profile_comparisons(results)
    before = [*_quick(results), *missing_engines(results), *not_repeated(results), *(profile.sentence for profile in profiles)]
    after = [*ensemble_differences(results), *beside_recordings(results), *reproduce_drawn(results)]
    return Overview(
        verdict=verdict_sentence(results, counts(results)),
        points=[*map(Point, before), *conclusion(results), *map(Point, after)],
        findings=list(finding_sentences(results)),
        statuses=results.statuses(),
        leading=leading_errors(results),
        profiles=profiles,
        failures=failures(results),
        tags=conditions(results),
        laws=law_rows(results),
    )


def document(results: Results, summary: Overview, tables: Sequence[Part] = (), explained: Sequence[Part] = ()) -> Document:
    """A short report: the conclusion, a finding on each engine, its status in each scene, distances to other impact laws, and failures.

    Args:
        results: The run.
        summary: Its overview.
        tables: What a terminal shows first.
        explained: The failures as a terminal shows them, from `unexpected_failures`; a page does not need the search for their causes.
    """
    statuses = [
        {"scene": scene, **{engine: f"{status.mark} {status.words}" for engine, status in by_engine.items()}}
        for scene, by_engine in summary.statuses.items()
    ]
    laws: list[Part] = [Paragraph(WORDS["impact_laws"]["legend"]), Table(summary.laws)] if summary.laws else []
    failed = [f"✗ {failure.sentence}" for failure in summary.failures]
    failures_listed = Sentences(failed, commands=[failure.reproduce for failure in summary.failures], on_terminal=False)
    versions = ", ".join(f"{name} {version or 'not installed'}" for name, version in results.provenance["versions"].items())
    matrix, notes = matrix_of(summary.statuses, summary.leading)
    parts = [
        *tables,
        Heading("Summary", on_page=False, on_terminal=bool(tables)),
        Sentences(summary.findings, on_terminal=False),
        Table(matrix, [*reversed(results.engines)], on_page=False),
        Sentences(notes, style="dim", on_page=False),
        Table(statuses, on_terminal=False),
        Sentences([f"With {tag}: {listed(scenes, 6)}." for tag, scenes in summary.tags.items()], style="dim"),
        Sentences([f"{words}: {meaning}" for words, meaning in legend_of_marks(summary.statuses).items()], on_terminal=False),
        *(replace(part, on_terminal=False) for part in laws),
        failures_listed,
        *explained,
        Paragraph(f"{versions} on {results.provenance['cpu']}", on_terminal=False),
    ]
    return Document("dropspin", parts, [Sentences(summary.conclusion), Paragraph(summary.verdict, style="bold")])


def unexpected_failures(results: Results, summary: Overview) -> list[Part]:
    """The failures of a run without those of accepted results, with what explains them, for a terminal."""
    unexpected = [failure for failure in summary.failures if not failure.accepted]
    return [replace(part, on_page=False) for part in failure_parts(results, unexpected)]


def _quick(results: Results) -> list[str]:
    """What a quick run left out, and the number of its checks that are not decided, if any; empty for other runs."""
    if not results.is_quick:
        return []
    undecided = int((results.table["basis"] == "few_starts").sum())
    decided = f"So few starts do not decide {counted(undecided, 'check')}. " if undecided else ""
    return [
        f"Quick run: {QUICK_START_PHASES} start phases instead of {START_PHASES}, at most {QUICK_MEMBERS} members of an ensemble, and no "
        f"perturbed starts in double precision. {decided}Run again without --quick to compare or accept the results."
    ]


WORTH_SAYING = 60.0
"""Shortest run whose time is forecast on the terminal [s]."""
MUCH_SHORTER = 0.5
"""Share of the time of a run below which a quick run is mentioned."""


def forecast_sentence(forecast: Forecast) -> str:
    """The time that a run will take, with that of the engine that takes longest and of a quick run; empty if it is short."""
    if forecast.seconds < WORTH_SAYING:
        return ""
    longest = max(forecast.by_engine, key=forecast.by_engine.__getitem__)
    of_engine = f", of which {longest} {_minutes(forecast.by_engine[longest])}" if len(forecast.by_engine) > 1 else ""
    of_quick = f"; --quick takes {_minutes(forecast.quick)}" if forecast.quick < MUCH_SHORTER * forecast.seconds else ""
    return f"{_minutes(forecast.seconds)} on {counted(forecast.jobs, 'processor')}{of_engine}{of_quick}"


def _minutes(seconds: float) -> str:
    return "less than 1 min" if seconds < WORTH_SAYING else f"about {seconds / WORTH_SAYING:.0f} min"
