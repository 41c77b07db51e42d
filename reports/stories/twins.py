"""The output of `dropspin symmetries twins`: a row for each scene and pair of engines."""

import math
from collections.abc import Sequence

from dropspin.comparisons.symmetries.twins import LEVELS, TwinFinding
from dropspin.reports.document import Document, Sentences, Table
from dropspin.reports.stories.words import WORDS


def document(findings: Sequence[TwinFinding]) -> Document:
    """A row for each finding, the meaning of the columns, and the reasons why pairs of engines were not run."""
    reasons = [
        f"Not run: {finding.engine} and {finding.twin} in {finding.scene}: {finding.reason}."
        for finding in findings
        if finding.status == "not run"
    ]
    rows = Table(list(map(_row, findings)), left_out_first=["> 1e-12", "> 1e-09"])
    return Document("Engines of the same algorithm", [rows, Sentences([WORDS["twins"]["legend"], *reasons])])


def _row(finding: TwinFinding) -> dict[str, str]:
    """The row of a finding; – stands for never, or for no such difference."""
    explained = "yes" if finding.unexplained is None else f"not from step {finding.unexplained:,} on"
    return {
        "scene": finding.scene,
        "engines": f"{finding.engine}, {finding.twin}",
        "differ from step": _step(finding.first),
        "before contact": _number(finding.before_contact),
        "after contact": _number(finding.after_contact),
        **{f"> {level:g}": _step(finding.beyond.get(level)) for level in LEVELS},
        "rounding explains it": "not run" if finding.status == "not run" else explained,
    }


def _step(step: int | None) -> str:
    return "–" if step is None else f"{step:,}"


def _number(difference: float) -> str:
    if math.isnan(difference):
        return "–"
    return "0" if difference == 0.0 else f"{difference:.1e}"
