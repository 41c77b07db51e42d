"""The output of `dropspin symmetries`: the worst finding for each engine and symmetry, and a sentence on each symmetry that is lost."""

import math
from collections.abc import Iterator, Sequence
from operator import attrgetter, itemgetter
from typing import Literal

from dropspin.comparisons.measuring.symmetries import NAMES
from dropspin.comparisons.symmetries.findings import STATUSES, Finding, Status
from dropspin.reports.document import Document, Paragraph, Sentences, Table
from dropspin.reports.stories.matrix import level
from dropspin.reports.stories.numbers import grouped
from dropspin.reports.stories.study import Records, Study
from dropspin.reports.stories.words import WORDS
from dropspin.scenarios.text import counted

COLUMNS = ("scene", "engine", "symmetry", "status", "difference", "step", "time", "reason")
MEANINGS: dict[Status, str] = WORDS["symmetries"]["meanings"]
"""The mark of each status, and its meaning."""


class Symmetries(Study):
    """The results of `dropspin symmetries`."""

    study: Literal["symmetries"] = "symmetries"
    findings: list[Finding]

    def rows(self) -> Records:
        """A row for each finding, with all digits."""
        return [{name: getattr(finding, name) for name in COLUMNS} for finding in self.findings]

    def document(self) -> Document:
        """The worst finding for each engine and symmetry, and each symmetry that is not kept."""
        listed = Sentences(sentences(self.findings), numbered=True)
        return Document("Symmetries and repeated runs", [worst_table(self.findings), Paragraph(legend(self.findings)), listed])


def worst_table(findings: Sequence[Finding]) -> Table:
    """The worst finding of all scenes for each symmetry, with a column for each engine, coloured by the difference."""
    engines, tested = (dict.fromkeys(getattr(finding, name) for finding in findings) for name in ("engine", "symmetry"))
    names = [name for name in dict.fromkeys([*NAMES, *tested]) if name in tested]
    worst = [{engine: _of(findings, engine, name) for engine in engines} for name in names]
    rows = [{"the scene": name, **{engine: _cell(of) for engine, of in row.items()}} for name, row in zip(names, worst, strict=True)]
    return Table(rows, levels=[{engine: level(of[0].difference) for engine, of in row.items() if of} for row in worst])


def _of(findings: Sequence[Finding], engine: str, symmetry: str) -> list[Finding]:
    """The findings for an engine and a symmetry, the worst first; those that were not run come last."""
    mine = [finding for finding in findings if (finding.engine, finding.symmetry) == (engine, symmetry)]
    return sorted(mine, key=lambda finding: (finding.status != "not run", STATUSES.index(finding.status), finding.difference), reverse=True)


def _cell(findings: Sequence[Finding]) -> str:
    if not findings or findings[0].status == "not run":
        return "–"
    worst, ran = findings[0], sum(finding.status != "not run" for finding in findings)
    part = f" ({ran} of {len(findings)})" if ran < len(findings) else ""
    return f"{MEANINGS[worst.status][0]} {f'{worst.difference:.0e}' if worst.difference else 0}{part}"


def worst_lost(findings: Sequence[Finding]) -> list[Finding]:
    """For each engine that loses a symmetry, the finding with the largest difference."""
    lost = sorted((finding for finding in findings if finding.motions is not None), key=lambda finding: -finding.difference)
    return [worst for worst, *_ in grouped(lost, attrgetter("engine")).values()]


def legend(findings: Sequence[Finding]) -> str:
    """The meaning of the numbers, and of each mark that occurs."""
    marks = ", ".join(MEANINGS[status] for status in STATUSES if any(finding.status == status for finding in findings))
    return f"{WORDS['symmetries']['legend']} {marks}."


def sentences(findings: Sequence[Finding]) -> list[str]:
    """A sentence for each symmetry that an engine does not keep, largest difference first, then one for each reason for missing runs."""
    broken = [finding for finding in findings if finding.status in ("lost", "nearly kept")]
    engines = list(dict.fromkeys(finding.engine for finding in findings))
    pairs = dict.fromkeys((finding.engine, finding.symmetry) for finding in broken)
    groups = sorted((_of(broken, *pair) for pair in pairs), key=lambda group: (engines.index(group[0].engine), -group[0].difference))
    return [*map(_broken, groups), *_not_run(findings)]


def _broken(findings: Sequence[Finding]) -> str:
    worst, others = findings[0], findings[1:]
    more = f"; the motions also differ in {counted(len(others), 'other scene')}" if others else ""
    since = f"from step {worst.step} onwards (t = {worst.time:.4g} s)"
    size = f"{worst.difference:.2g}" if math.isfinite(worst.difference) else "infinite"
    return f"{worst.engine}, {worst.symmetry}: in {worst.scene}, the two motions differ {since}; the largest difference is {size}{more}."


def _not_run(findings: Sequence[Finding]) -> Iterator[str]:
    """Sentences on the engines, symmetries and scenes that were not run, by reason."""
    groups = grouped((finding for finding in findings if finding.status == "not run"), attrgetter("engine", "reason"))
    for (engine, reason), group in sorted(groups.items(), key=itemgetter(0)):
        scenes, names = (dict.fromkeys(getattr(finding, name) for finding in group) for name in ("scene", "symmetry"))
        ways = f" ({', '.join(names)})" if len(names) < len(NAMES) // 2 else ""
        options = " (options --time-limit and --dt)" if group[0].verdict == "timed_out" else ""
        yield f"Not run: {engine} in {', '.join(scenes)}{ways}: {reason.removesuffix('.')}{options}."
