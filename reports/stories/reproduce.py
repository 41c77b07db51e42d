"""The output of `dropspin reproduce`: for each source, the published values beside the values that were computed here."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict
from itertools import groupby
from typing import Literal, get_args

from dropspin.comparisons.published.results import Result, Status
from dropspin.comparisons.published.sources import Source
from dropspin.reports.document import Document, Heading, Paragraph, Part, Rows, Sentences, Table
from dropspin.reports.stories.study import Records, Study
from dropspin.reports.stories.study import exit_code as code_of
from dropspin.reports.stories.words import WORDS
from dropspin.scenarios.text import counted

STATUSES: tuple[Status, ...] = get_args(Status)
DIFFERENCES: dict[Status, str] = {"differs": "differs by", "error of the source": "error"}
"""The word before a difference, by status."""


class Reproduction(Study):
    """The results of `dropspin reproduce`, and the sources."""

    study: Literal["reproduce"] = "reproduce"
    sources: list[Source]
    results: list[Result]

    def rows(self) -> Records:
        """A row for each result."""
        return list(map(asdict, self.results))

    def document(self) -> Document:
        """The results of each source, and the number of all results that are reproduced."""
        parts: list[Part] = []
        for source in self.sources:
            results = [result for result in self.results if result.source == source.name]
            citation = f"Source: {source.citation}; {source.place} (licence: {source.licence})."
            parts += [Heading(f"{source.name}: {source.title}", on_terminal=True), Paragraph(citation), Paragraph(source.setting)]
            parts += [Table(_table(results)), Sentences(_notes(source, results), numbered=True)]
        parts += [Heading("All sources", on_terminal=True), Table(_summary(self.results))]
        parts.append(Sentences([WORDS["reproduce"]["legend"], _verdict(self.results)], numbered=True))
        return Document("Published results", parts)


def _table(results: Sequence[Result]) -> Rows:
    """The results of one source: a row for each tool with what computes its values here, followed by a row for each value."""
    rows = []
    for (tool, by), group in groupby(results, key=lambda result: (result.tool, result.by)):
        rows.append((f"{tool}: {by}" if by else tool, "", "", ""))
        rows += [(f"- {result.quantity}", result.published, result.here or "–", _difference(result)) for result in group]
    return [dict(zip(("result", "published", "here", "verdict"), row, strict=True)) for row in rows]


def _difference(result: Result) -> str:
    if result.status == "reproduced" and set(result.published) & set("<>≤±"):
        return "within"
    word = DIFFERENCES.get(result.status, result.status)
    return f"{word} {result.difference:.1e}" if result.status in DIFFERENCES and math.isfinite(result.difference) else word


def _notes(source: Source, results: Sequence[Result]) -> list[str]:
    """The reasons for the choice of engines, the reasons why values are not reproduced, and the remarks on the source."""
    reasons = [(group.tool, group.by, group.why) for group in source.groups if group.why]
    reasons += [(row.tool, row.by, f"{row.status}: {row.reason.removesuffix('.')}") for row in results if row.reason]
    return [*(f"{tool}, {by}: {why}." if by else f"{tool}: {why}." for tool, by, why in dict.fromkeys(reasons)), *source.remarks]


def _summary(results: Sequence[Result]) -> Rows:
    """The number of results of each status for each source, and their sums."""
    present = [status for status in STATUSES if any(row.status == status for row in results)]
    names = list(dict.fromkeys(row.source for row in results))
    counts = {name: Counter(row.status for row in results if row.source == name) for name in names}
    counts |= {"all": Counter(row.status for row in results)} if len(names) > 1 else {}
    return [{"source": name, **{status: str(count[status]) for status in present}} for name, count in counts.items()]


def _verdict(results: Sequence[Result]) -> str:
    """A sentence with the number of values that are reproduced, that differ, and that were not run."""
    counts = Counter(row.status for row in results)
    claimed = counts["reproduced"] + counts["differs"]
    not_run = f"; {counted(counts['not run'], 'was', 'were')} not run" if counts["not run"] else ""
    are = "is" if 1 in (counts["reproduced"], claimed) else "are"
    reproduced = f"{counts['reproduced']} of {counted(claimed, 'value')} {are} reproduced"
    return f"{reproduced}; {counted(counts['differs'], 'differs', 'differ')}{not_run}."


def exit_code(results: Sequence[Result], *, named: bool) -> int:
    """1 if a value differs that is claimed to be reproducible, 3 if an engine broke down or a named source lacks it, otherwise 0."""
    if any(row.status == "differs" for row in results):
        return 1
    return code_of((row.verdict for row in results), named=named)
