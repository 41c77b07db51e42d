"""Markdown pages: a short report of a run, summaries of checks and comparisons for pull requests, and histories."""

from collections.abc import Mapping, Sequence

from dropspin.comparisons.regressions.checking import Checked
from dropspin.comparisons.regressions.comparing import Changes
from dropspin.comparisons.results.provenance import versions_behind
from dropspin.comparisons.results.results import Results
from dropspin.reports.pages import page
from dropspin.reports.views import check, compare
from dropspin.reports.views.failures import Failure, grouped
from dropspin.reports.views.impact_laws import NOTE
from dropspin.reports.views.run import Overview

MOST_SENTENCES = 24
"""Largest number of sentences on the failures of one engine in a summary; JUnit and JSON have all failures."""


def run_markdown(results: Results, summary: Overview) -> str:
    """A short report of a run."""
    return page("report.md", **vars(summary), engines=results.engines, provenance=results.provenance, note_on_laws=NOTE)


def check_markdown(checked: Checked, file: check.BaselineFile | None, found: Sequence[Failure]) -> str:
    """The outcome of a check."""
    results = checked.results
    return page(
        "check.md",
        sentences=[check.scope(file), *check.sentences(checked, file)],
        groups=grouped(results, found, None if file is None else file.path),
        most=MOST_SENTENCES,
        engines=results.engines,
        tallies={engine: _tally(results, engine) for engine in results.engines},
        versions=versions_behind(results.provenance),
        cpu=results.provenance["cpu"],
    )


def compare_markdown(changes: Changes) -> str:
    """The changes between two runs."""
    return page("compare.md", held=not len(changes.regressions), tables=compare.tables(changes), sentences=compare.sentences(changes))


def history_markdown(runs: int, sentences: Sequence[str], pictures: Mapping[str, str]) -> str:
    """A history of runs, with a picture for each scene: by name, its file."""
    return page("history.md", runs=runs, sentences=sentences, pictures=pictures)


def _tally(results: Results, engine: str) -> dict[str, int]:
    """The number of checks of an engine with each verdict, and of those in which it broke down or is missing."""
    mine = results.table["engine"] == engine
    verdicts = results.table.loc[mine, "verdict"].value_counts()
    return {str(verdict): int(count) for verdict, count in verdicts.items()} | {"broke down": int(results.breakdowns[mine].sum())}
