"""The output of `dropspin log check`: the values that the flights of a recording give, with their intervals, and the findings."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Literal

import numpy as np

from dropspin.comparisons.logs.check import CENTRES, RATIOS, TossFacts, Value
from dropspin.comparisons.logs.log import Finding
from dropspin.reports.document import Charts, Document, Heading, Paragraph, Sentences, Table
from dropspin.reports.plots.chart import Chart, Line
from dropspin.reports.stories.log_findings import remedy, sentence
from dropspin.reports.stories.numbers import formatted, grouped
from dropspin.reports.stories.study import Records, Study, with_all_columns
from dropspin.scenarios.text import counted

SMALL = 0.1
"""Lengths and angles below this are shown in mm and mrad [m, rad]."""
DIGITS = 2
"""Significant digits of the half width of an interval; the value is rounded to the same decimal."""
MOST_ALIKE = 3
"""Largest number of findings of one kind that a terminal shows."""
SPINNING = "tosses of 0.3 s that spin at 8 rad/s or more, about different axes"
NEEDS = dict.fromkeys(RATIOS, SPINNING) | {"drag": "longer flights", "decay of the spin": SPINNING}
"""What a recording needs for a value to be identifiable, by the name of the value."""
MOST_RATIO = 10.0
"""Times the useful half width from which on more tosses are no advice: a hundred times as many."""


class CheckedLog(Study):
    """The results of `dropspin log check`."""

    study: Literal["log_check"] = "log_check"
    recording: str
    values: list[Value]
    findings: list[Finding]
    tosses: list[TossFacts]

    def rows(self) -> Records:
        """A row for each value, finding and toss; every row has the columns of all three kinds."""
        rows = [{"row": "values", **asdict(value), "note": self._note(value)} for value in self.values]
        for finding in self.findings:
            words = {"causes": [cause.name for cause in finding.causes], "remedy": remedy(finding), "sentence": sentence(finding)}
            rows.append({"row": "findings", **asdict(finding), **words})
        rows += [{"row": "tosses", **asdict(toss)} for toss in self.tosses]
        return with_all_columns(rows)

    def document(self) -> Document:
        """The values and the findings; a page also has a chart of the flights."""
        frames = np.array([toss.frames for toss in self.tosses], dtype=float)
        flights = counted(int((frames > 0).sum()), "flight")
        head = f"{self.recording}: {counted(len(self.tosses), 'toss', 'tosses')}; {flights} with {int(frames.sum()):,} frames in total."
        noise = Line("toss", frames, np.array([toss.noise for toss in self.tosses]), width=0.0, marker="o")
        parts = [sentence(finding) for finding in self.findings]
        kinds = grouped(self.findings, lambda finding: finding.kind)
        brief = [sentence for group in kinds.values() for sentence in _brief(group)]
        return Document(
            f"Check of {self.recording}",
            [
                Paragraph(head),
                Table([_row(value, self._note(value)) for value in self.values]),
                Sentences(parts, numbered=True, on_terminal=False),
                Sentences(brief, on_page=False),
                Heading("Flights"),
                Charts("flights", [Chart("frames of free flight", "noise / noise of the other tosses", [noise])]),
            ],
            [Paragraph(f"{counted(len(parts), 'finding')}.")],
        )

    def _note(self, value: Value) -> str | None:
        """What the recording needs for a value to be identifiable; None if the value is identifiable."""
        if value.is_identifiable:
            return None
        if value.name not in CENTRES:
            return NEEDS[value.name]
        ratio, flights = value.half_width / value.useful, sum(toss.frames > 0 for toss in self.tosses)
        more = f"about {math.ceil(flights * ratio**2)} tosses like these, or " if ratio < MOST_RATIO else ""
        return f"{more}a faster spin"


def _row(value: Value, note: str | None) -> dict[str, str]:
    """A value with its interval, or, if it is not identifiable, what the recording needs."""
    name, small = {"quantity": value.name}, value.unit in ("m", "rad") and abs(value.value) < SMALL
    scale, unit = (1e3, f"m{value.unit}") if small else (1.0, value.unit.replace("s^1.5", "(s √s)"))
    if note is not None:
        return {**name, "value": "not identifiable", "95 % interval": f"needs {note}"}
    half = scale * value.half_width
    if not half > 0.0:
        return {**name, "value": f"{formatted(scale * value.value)} {unit}".strip(), "95 % interval": ""}
    decimals = max(DIGITS - 1 - math.floor(math.log10(half)), 0)
    middle, low, high = (f"{scale * number:.{decimals}f}" for number in (value.value, value.low, value.high))
    return {**name, "value": f"{middle} {unit}".strip(), "95 % interval": f"{low} to {high}"}


def _brief(findings: Sequence[Finding]) -> list[str]:
    """Sentences on the first findings of one kind, and the number of the others; each toss may have one."""
    more = len(findings) - MOST_ALIKE
    others = [f"{counted(more, 'more finding', 'more findings')} of this kind ({findings[0].kind})."] if more > 0 else []
    return [*map(sentence, findings[:MOST_ALIKE]), *others]
