"""The output of `dropspin log compare`: errors of engines relative to measured tosses, differences between engines, parts of errors."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Literal

from dropspin.comparisons.logs.compare import Error, LogComparison, Pair, Share
from dropspin.comparisons.logs.log import Finding
from dropspin.reports.document import Charts, Document, Heading, Paragraph, Part, Sentences, Table
from dropspin.reports.plots.chart import Chart
from dropspin.reports.plots.colours import in_sentence
from dropspin.reports.plots.intervals import interval_rows
from dropspin.reports.stories.log_findings import corrections
from dropspin.reports.stories.numbers import formatted, grouped, left_out
from dropspin.reports.stories.study import Records, Study, with_all_columns
from dropspin.reports.stories.words import WORDS
from dropspin.scenarios.text import counted

UNITS = {"1": (100.0, " [%]"), "rad": (180.0 / math.pi, " [°]"), "s": (1.0, " [s]")}
"""By unit of a value, the factor that converts it to the unit that is shown, and this unit."""
OF = {"position": UNITS["1"], "orientation": UNITS["rad"]}
"""The factor and the unit, as in `UNITS`, of each quantity in the tables of differences and of parts."""
AT = {"impact": "at impact", "+0.1 s": "0.1 s later", "mean": "mean over the motion", "end": "at the end"}


class ComparedLog(Study):
    """The results of `dropspin log compare`."""

    study: Literal["log_compare"] = "log_compare"
    recording: str
    findings: list[Finding]
    comparison: LogComparison

    def rows(self) -> Records:
        """A row for each error, difference, group, part and engine left out."""
        study = self.comparison
        rows = [{"row": part, **asdict(row)} for part in ("errors", "pairs", "parts") for row in getattr(study, part)]
        rows += [{"row": "groups", "quantity": quantity, "engines": group} for quantity, groups in study.groups.items() for group in groups]
        return with_all_columns(rows, study.left_out)

    def document(self) -> Document:
        """The errors, the groups, the differences and the parts."""
        study, parts = self.comparison, list[Part]()
        if study.errors:
            parts += [
                Table(list(_error_rows(study.errors, study.tosses)), left_out_first=["at impact", "0.1 s later"]),
                Paragraph(WORDS["log_compare"]["errors"].format(tosses=study.tosses, length=1e3 * study.length)),
                Charts("errors", [_error_chart(quantity, study.errors) for quantity in OF]),
            ]
        if study.pairs:
            parts += [
                Heading("Differences between engines", on_terminal=True),
                Table([_pair_row(pair) for pair in study.pairs]),
                Charts("differences", [_pair_chart(quantity, study.pairs) for quantity in OF]),
            ]
        parts.append(Sentences([*_group_sentences(study), *left_out(study.left_out)]))
        if study.parts:
            heading = Heading("Parts of the mean errors over the motion", on_terminal=True)
            parts += [heading, Table(list(_part_rows(study))), Paragraph(WORDS["log_compare"]["parts"])]
        return Document(
            f"Engines compared with {self.recording}", parts, [Sentences(corrections(self.recording, self.findings), style="bold")]
        )


def _error_chart(quantity: str, errors: Sequence[Error]) -> Chart:
    """The mean error of each engine over the motion."""
    scale, unit = OF[quantity]
    shown = [error for error in errors if (error.quantity, error.at) == (quantity, "mean")]
    rows = [[scale * size for size in (error.value, error.lower, error.upper, error.noise_floor)] for error in shown]
    return interval_rows(f"error of {quantity}{unit}", [error.engine for error in shown], rows, "noise floor")


def _pair_chart(quantity: str, pairs: Sequence[Pair]) -> Chart:
    """The differences between engines."""
    scale, unit = OF[quantity]
    shown = [pair for pair in pairs if pair.quantity == quantity]
    names = [f"{in_sentence(pair.first)} − {in_sentence(pair.second)}" for pair in shown]
    rows = [[*(scale * size for size in (pair.difference, pair.lower, pair.upper)), 0.0] for pair in shown]
    return interval_rows(f"difference of {quantity}{unit}", names, rows, "no difference")


def _error_rows(errors: Sequence[Error], most: int) -> Iterator[dict[str, str]]:
    for (engine, quantity), kinds in grouped(errors, lambda error: (error.engine, error.quantity)).items():
        scale, unit = UNITS[kinds[0].unit]
        fewer = {kind.at: f"; {counted(kind.tosses, 'toss', 'tosses')}" if kind.tosses < most else "" for kind in kinds}
        cells = {kind.at: f"{_interval(scale, kind.value, kind)} ({formatted(scale * kind.noise_floor)}{fewer[kind.at]})" for kind in kinds}
        yield {"engine": engine, "error": quantity + unit} | {name: cells.get(at, "") for at, name in AT.items()}


def _interval(scale: float, value: float, of: Error | Pair | Share) -> str:
    """A value in the unit that is shown, with its interval; the value alone if it has no interval."""
    ends = "" if math.isnan(of.lower) else f", {formatted(scale * of.lower)} to {formatted(scale * of.upper)}"
    return formatted(scale * value) + ends


def _pair_row(pair: Pair) -> dict[str, str]:
    scale, unit = OF[pair.quantity]
    return {
        "engines": f"{pair.first} − {pair.second}",
        "error": pair.quantity + unit,
        "difference": _interval(scale, pair.difference, pair),
        "differ": "yes" if pair.differs else "not significantly",
    }


def _group_sentences(study: LogComparison) -> list[str]:
    """A sentence on the groups for each quantity, and the meaning of the groups."""
    alike = {quantity: [" and ".join(group) for group in groups if len(group) > 1] for quantity, groups in study.groups.items()}
    sentences = [f"In {name}, these engines do not differ significantly: {'; '.join(groups)}." for name, groups in alike.items() if groups]
    return [*sentences, WORDS["log_compare"]["groups"]] if study.pairs else []


def _part_rows(study: LogComparison) -> Iterator[dict[str, str]]:
    for (engine, quantity), parts in grouped(study.parts, lambda part: (part.engine, part.quantity)).items():
        scale, unit = OF[quantity]
        cells = {part.part: _interval(scale, part.value, part) for part in parts}
        yield {"engine": engine, "error": quantity + unit, **cells}
