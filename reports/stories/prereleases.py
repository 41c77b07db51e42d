"""A note on what changed in prereleases of engines, with a command for each engine that shows the changes."""

from collections.abc import Mapping, Sequence
from itertools import chain

from dropspin.comparisons.record.findings import Release, changes
from dropspin.reports.document import Document, Heading, Paragraph, Part, Sentences
from dropspin.reports.stories.record import change_sentences
from dropspin.scenarios.text import counted


def prereleases(measured: Mapping[str, Sequence[Release]]) -> tuple[Document, bool]:
    """The changes between the releases that were measured of each engine, oldest first; and whether there is a change, or no result."""
    compared = {engine: releases for engine, releases in measured.items() if len(releases) > 1}
    changed = {engine: sentences for engine, releases in compared.items() if (sentences := _sentences(engine, releases))}
    parts = [part for engine, sentences in changed.items() for part in _of_engine(engine, compared[engine], sentences)]
    alike = [f"{engine}: no result changed from {_names(compared[engine])}." for engine in compared if engine not in changed]
    missing = [f"Without a prerelease after the newest release: {', '.join(engine for engine in measured if engine not in compared)}."]
    title = f"Changes in {len(changed)} of {counted(len(compared), 'compared engine')}"
    return Document(title, [*parts, Sentences(alike + (missing if len(compared) < len(measured) else []))]), bool(changed)


def _of_engine(engine: str, releases: Sequence[Release], sentences: Sequence[str]) -> list[Part]:
    chosen = " ".join(f"--release {release.name}" for release in releases)
    heading = Heading(f"{engine}, from {_names(releases)}", on_terminal=True)
    return [heading, Sentences(sentences), Paragraph("To show the changes:", f"dropspin record --pre -e {engine} {chosen}")]


def _sentences(engine: str, releases: Sequence[Release]) -> list[str]:
    without = [f"{release.name} has no results: {release.reason}" for release in releases if not release.cases]
    return without + list(chain(*change_sentences(changes(engine, releases)).values()))


def _names(releases: Sequence[Release]) -> str:
    return " to ".join(release.name for release in releases)
