"""The output of `dropspin log fit`: friction and restitution by engine, and what engines disagree on."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any, Literal

from dropspin.comparisons.logs.fit import Disagreement, Estimate, LogFit
from dropspin.comparisons.logs.log import Finding
from dropspin.reports.document import Charts, Document, Sentences, Table
from dropspin.reports.plots.intervals import Interval, interval_rows
from dropspin.reports.stories.log_findings import corrections
from dropspin.reports.stories.numbers import formatted, grouped, left_out
from dropspin.reports.stories.study import Study, with_all_columns

DISAGREEMENTS: Mapping[str, str] = {
    "restitution": "it is a setting of the engine, not a property of the body",
    "friction": "it depends on the engine's model of contact",
}
NOT_IDENTIFIED: Mapping[str, str] = {
    "friction": "no toss slides, or the engine does not use it; tosses that strike the floor at a flat angle would bound it",
    "restitution": "the motions do not depend on it, or the engine does not use it",
}


class FittedLog(Study):
    """What `dropspin log fit` found."""

    study: Literal["log_fit"] = "log_fit"
    recording: str
    findings: list[Finding]
    fit: LogFit

    def rows(self) -> list[dict[str, Any]]:
        """Every estimate and every disagreement, and a row for each engine left out."""
        fit = self.fit
        rows = [{"row": "estimates", **asdict(one), "discrepancy": fit.discrepancies[one.engine]} for one in fit.estimates]
        rows += [{"row": "disagreements", **asdict(one)} for one in fit.disagreements]
        return with_all_columns(rows, fit.left_out)

    def document(self) -> Document:
        """A row for each engine, and a sentence for each disagreement and each parameter that the tosses do not identify."""
        fit, rows = self.fit, []
        for engine, estimates in grouped(fit.estimates, lambda estimate: estimate.engine).items():
            cells = {estimate.parameter: interval(estimate) for estimate in estimates}
            rows.append({"engine": engine, **cells, "discrepancy": f"{formatted(1e3 * fit.discrepancies[engine])} mm"})
        legend = (
            f"From {fit.frames} frames after the flight of each of {fit.tosses} tosses, with 95 % intervals. The discrepancy is what an "
            "engine leaves of these frames beside the noise of the recording and the errors of the start."
        )
        unknown = [
            f"{one.parameter.capitalize()} is not identified with {one.engine}: {NOT_IDENTIFIED[one.parameter]}."
            for one in fit.estimates
            if not one.has_lower and not one.has_upper
        ]
        charts = [
            interval_rows(parameter, [Interval(one.engine, one.value, one.lower, one.upper) for one in of_one])
            for parameter, of_one in grouped(fit.estimates, lambda estimate: estimate.parameter).items()
        ]
        sentences = [legend, *unknown, *map(disagreement, fit.disagreements), *left_out(fit.left_out)]
        return Document(
            f"Friction and restitution of {self.recording}",
            [Table(rows), *([Charts("coefficients", charts)] if charts else []), Sentences(sentences)],
            [Sentences(corrections(self.recording, self.findings), style="bold")],
        )


def interval(estimate: Estimate) -> str:
    """An estimate with its interval, or the bound that the tosses give."""
    lower, upper = f"{estimate.lower:.3f}", f"{estimate.upper:.3f}"
    if estimate.has_lower and estimate.has_upper:
        return f"{estimate.value:.3f} ({lower} to {upper})"
    if estimate.has_lower or estimate.has_upper:
        return f"at least {lower}" if estimate.has_lower else f"at most {upper}"
    return "not identified"


def disagreement(found: Disagreement) -> str:
    """A sentence on a parameter of which two engines need different values."""
    return (
        f"Two engines disagree on {found.parameter}: {DISAGREEMENTS[found.parameter]}. {found.first} needs "
        f"{abs(found.difference):.3f} {'more' if found.difference > 0.0 else 'less'} than {found.second} "
        f"(95 % interval of the difference {found.lower:.3f} to {found.upper:.3f})."
    )
