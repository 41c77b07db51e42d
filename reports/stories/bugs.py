"""The output of `dropspin bugs`: for each public bug report the results of the releases, and a table of all verdicts."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.record.bugs import Bug, Outcome, Verdict, verdict
from dropspin.reports.document import Document, Heading, Paragraph, Part, Sentences, Table
from dropspin.reports.stories.numbers import formatted, in_ms, subject, unit
from dropspin.reports.stories.study import Records, Study
from dropspin.scenarios.text import counted

FEW = 4
"""Number of reports up to which a terminal shows each of them."""


class KnownBugs(Study):
    """The results of `dropspin bugs` for each report."""

    study: Literal["bugs"] = "bugs"
    bugs: list[Bug]
    outcomes: dict[str, list[Outcome]]

    def verdicts(self) -> list[tuple[Bug, Verdict]]:
        """The verdict on each report."""
        return [(bug, verdict(bug, self.outcomes[bug.name])) for bug in self.bugs]

    def rows(self) -> Records:
        """A row for each release of each report; a report without a release has one row."""
        blank = Outcome(release="", state="not run")
        return [
            {"case": bug.name, "kind": bug.kind, "reference": bug.reference, "command": bug.command if bug.label else ""}
            | {"metric": bug.metric, "verdict": words(bug, result, self.outcomes[bug.name])}
            | outcome.model_dump()
            for bug, result in self.verdicts()
            for outcome in self.outcomes[bug.name] or [blank]
        ]

    def document(self) -> Document:
        """Each report with its releases, and a table of the verdicts on all reports."""
        verdicts = self.verdicts()
        parts: list[Part] = []
        for bug, outcome in verdicts:
            parts += _of_bug(bug, outcome, self.outcomes[bug.name], on_terminal=len(self.bugs) <= FEW)
        table = [
            {"case": bug.name, "engine": bug.engine or "–", "verdict": words(bug, found, self.outcomes[bug.name])}
            for bug, found in verdicts
        ]
        parts += [Heading("All cases"), Table(table), Paragraph(_summary(verdicts))]
        return Document("Known bugs", parts)


def _of_bug(bug: Bug, result: Verdict, outcomes: Sequence[Outcome], *, on_terminal: bool) -> list[Part]:
    """The parts of the page on one report."""
    parts: list[Part] = [Heading(f"{bug.name}: {bug.kind}"), Paragraph(f"{bug.symptom}. Reported in {bug.year}: {bug.reference}")]
    if bug.label:
        parts += [Paragraph(f"Closed form: {bug.closed_form}."), Paragraph("Shown by:", bug.command)]
        parts += [Table([_row(bug, outcome) for outcome in outcomes]), Sentences(_said(bug, outcomes))]
    parts.append(Paragraph(f"Verdict: {words(bug, result, outcomes)}.", style="bold"))
    return [replace(part, on_terminal=on_terminal) for part in parts]


def _row(bug: Bug, outcome: Outcome) -> dict[str, str]:
    metric = f"{subject(bug.metric, 'truth', '')}{unit(METRICS[bug.metric].unit)} at {in_ms(bug.dt)}"
    value, right = ("–" if math.isnan(one) else formatted(one) for one in (outcome.value, outcome.right))
    least, most = bug.fault
    row = {"release": f"{bug.engine} {outcome.release}", metric: value, "with the fault": f"{least:g} to {most:g}"}
    row |= {"without it": f"± {bug.sound:g}"} | ({f"in {bug.right_in}": right} if bug.right_in else {})
    return row | {"fault": outcome.state}


def _said(bug: Bug, outcomes: Sequence[Outcome]) -> list[str]:
    """The check that fails in the newest release with the fault, or why no check fails; and why releases were not run."""
    shown = [outcome for outcome in outcomes if outcome.state == "shown"]
    printed = [f"Failed check: {shown[-1].said}" if shown[-1].said else "No check fails."] if shown else []
    silent = [f"The checks of the catalogue's scenes do not detect the fault: {bug.silent}."] if bug.silent else []
    return [*printed, *silent, *(f"{outcome.release}: {outcome.said}." for outcome in outcomes if outcome.state == "not run")]


def words(bug: Bug, result: Verdict, outcomes: Sequence[Outcome]) -> str:
    """A verdict in words."""
    if result.kind == "not run" and len({outcome.state for outcome in outcomes}) > 1:
        return "; ".join(f"{outcome.release} {outcome.state}" for outcome in outcomes)
    if result.kind == "fixed":
        return f"does not occur from release {result.since} on"
    return f"not expressible: {bug.why_not}" if result.kind == "not expressible" else result.kind


def _summary(verdicts: Sequence[tuple[Bug, Verdict]]) -> str:
    """The number of reports with each verdict."""
    kinds = Counter(verdict.kind for _, verdict in verdicts)
    catalogue = sum(verdict.kind in ("shown", "fixed") and not bug.silent for bug, verdict in verdicts)
    of_these = f"{kinds['fixed']} fixed in a later release and {catalogue} detected by a check of the catalogue's scenes"
    parts = [f"{kinds['shown'] + kinds['fixed']} shown (of these, {of_these})"]
    parts += [f"{kinds[kind]} {kind}" for kind in ("not shown", "not expressible", "not run") if kinds[kind]]
    missing = " A release without an environment is not run; --prepare makes it." if kinds["not run"] else ""
    return f"{counted(len(verdicts), 'case')}: {', '.join(parts)}.{missing}"


def exit_code(verdicts: Sequence[tuple[Bug, Verdict]]) -> int:
    """1 if the releases do not show a fault as reported, 3 if a release could not be run, otherwise 0."""
    kinds = {verdict.kind for _, verdict in verdicts}
    return 1 if "not shown" in kinds else 3 if "not run" in kinds else 0
