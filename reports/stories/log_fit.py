"""The output of `dropspin log fit`: friction and restitution by engine, and which of them transfer from one engine to another."""

import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Literal

from dropspin.comparisons.logs.fit import EQUAL, Estimate, LogFit, Transfer
from dropspin.comparisons.logs.log import Finding
from dropspin.reports.document import Charts, Document, Sentences, Table
from dropspin.reports.plots.intervals import interval_rows
from dropspin.reports.stories.log_findings import corrections
from dropspin.reports.stories.numbers import formatted, grouped, left_out
from dropspin.reports.stories.study import Records, Study, with_all_columns
from dropspin.reports.stories.words import WORDS

TRANSFERS: Mapping[str, Mapping[str, str]] = WORDS["log_fit"]["transfers"]
NOT_IDENTIFIED: Mapping[str, str] = WORDS["log_fit"]["not_identified"]
UNTOUCHED = "no body touches the floor of the header in these frames; correct floor_height, or give more frames (--frames)"
"""Why neither parameter is identified then."""


class FittedLog(Study):
    """The results of `dropspin log fit`."""

    study: Literal["log_fit"] = "log_fit"
    recording: str
    findings: list[Finding]
    fit: LogFit

    def rows(self) -> Records:
        """A row for each estimate, for each difference between two engines, and for each engine left out."""
        fit, estimates = self.fit, [*self.fit.estimates, *([self.fit.friction] if self.fit.friction else [])]
        rows = [{"row": "estimates", **asdict(row), "discrepancy": fit.discrepancies.get(row.engine)} for row in estimates]
        rows += [{"row": "transfers", **asdict(row)} for row in fit.transfers]
        return with_all_columns(rows, fit.left_out)

    def document(self) -> Document:
        """A row for each engine, and a sentence for each pair of engines and each parameter that the tosses do not identify."""
        fit, rows = self.fit, []
        for engine, estimates in grouped(fit.estimates, lambda estimate: estimate.engine).items():
            cells = {estimate.parameter: interval(estimate) for estimate in estimates}
            rows.append({"engine": engine, **cells, "discrepancy": f"{formatted(1e3 * fit.discrepancies[engine])} mm"})
        if fit.friction:
            rows.append({"engine": fit.friction.engine, "friction": interval(fit.friction), "restitution": "", "discrepancy": ""})
        legend = (
            f"Fitted to the first {fit.frames} frames after the flight of each of {fit.tosses} tosses, with 95 % intervals. The "
            "discrepancy is the standard deviation of differences from the recorded poses that neither noise nor errors of the initial "
            "states explain."
        )
        if fit.friction:
            legend += (
                " The interval of an engine holds for this engine only; the interval of 'any engine' includes differences between engines."
            )
        reasons = NOT_IDENTIFIED if fit.touches else dict.fromkeys(NOT_IDENTIFIED, UNTOUCHED)
        unknown = [
            f"{row.parameter.capitalize()} is not identified with {row.engine}: {reasons[row.parameter]}."
            for row in fit.estimates
            if not row.has_lower and not row.has_upper
        ]
        unlike = [
            f"The discrepancy with {engine} is large for the size of the body: its values may mean nothing, as where frames are missing."
            for engine in fit.unlike
        ]
        charts = [
            interval_rows(parameter, [row.engine for row in alike], [(row.value, row.lower, row.upper) for row in alike])
            for parameter, alike in grouped(fit.estimates, lambda estimate: estimate.parameter).items()
        ]
        sentences = [legend, *unlike, *unknown, *map(transfer, fit.transfers), *left_out(fit.left_out)]
        return Document(
            f"Friction and restitution of {self.recording}",
            [Table(rows), *([Charts("coefficients", charts)] if charts else []), Sentences(sentences)],
            [Sentences(corrections(self.recording, self.findings), style="bold")],
        )


def interval(estimate: Estimate) -> str:
    """An estimate with its interval, or the bound that the tosses give."""
    if estimate.has_lower and estimate.has_upper:
        return f"{estimate.value:.3f} ({estimate.lower:.3f} to {estimate.upper:.3f})"
    if estimate.has_lower:
        return f"at least {math.floor(1e3 * estimate.lower + 1e-9) / 1e3:.3f}"  # a bound is rounded to the side on which it holds
    if estimate.has_upper:
        return f"at most {math.ceil(1e3 * estimate.upper - 1e-9) / 1e3:.3f}"
    return "not identified"


def transfer(pair: Transfer) -> str:
    """A sentence on whether the fitted value of a parameter is the same for two engines."""
    statement = TRANSFERS[pair.parameter][pair.verdict].format(first=pair.first, second=pair.second)
    if math.isinf(pair.upper):
        return f"{statement}: for at least one of them they show a bound on one side alone."
    return (
        f"{statement}. {pair.first} needs {abs(pair.difference):.3f} {'more' if pair.difference > 0.0 else 'less'} (95 % interval of "
        f"the difference: {pair.lower:.3f} to {pair.upper:.3f}; differences of up to {EQUAL} count as equal)."
    )
