"""The output of `dropspin diagnose`: the measured and exact values of one body, or a table of several bodies; then the findings."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import groupby
from typing import Literal

import numpy as np

from dropspin.comparisons.diagnosis.answers import REBOUND, Answer, Finding, Remedy
from dropspin.comparisons.diagnosis.inertia import MOMENT
from dropspin.comparisons.diagnosis.study import BodyDiagnosis, Diagnosis
from dropspin.reports.document import Charts, Document, Heading, Paragraph, Part, Rows, Sentences, Table
from dropspin.reports.plots.chart import Chart, Line
from dropspin.reports.stories.numbers import explained_by, formatted, grouped, in_ms, listed, with_unit
from dropspin.reports.stories.study import Records, Study
from dropspin.scenarios.text import counted

KINDS = {"changed": "changed by the engine", "model": "engine", "target": "target missed"}
"""The words for kinds of findings that are not shown by their names."""
LEAST = 1e-9
"""Absolute values below this one, in SI units, are shown as 0, except moments of inertia."""
STARTS = {"slide": (" from", " at"), "roll": (" from", "")}
"""The prepositions before an initial speed and before a direction, for questions that do not take `at` and `about`."""
COLUMNS = (
    "dt = …: the value measured at this time step. Exact: the exact solution with the damping, armature and contact margin that the engine "
    "uses. Ideal: the exact solution without these. In parentheses: the range over impacts at eight instants within a time step."
)


class Diagnosed(Study):
    """The results of `dropspin diagnose`."""

    study: Literal["diagnosis"] = "diagnosis"
    diagnosis: Diagnosis

    def rows(self) -> Records:
        """A row for each measured value and finding, with the places in the file where settings are written, and for each breakdown."""
        rows = []
        for body in self.diagnosis.bodies:
            of_body = {"file": self.diagnosis.file, "body": body.name, "engine": body.engine, "version": body.version, "dt": body.dt}
            for answer in (*body.answers, *(Answer("simulation", "breakdown", "", detail=why) for why in _breakdown(body))):
                values = {name: value for name, value in asdict(answer).items() if name != "findings"}
                rows += [{**of_body, **values, **_finding_cells(body, answer, finding)} for finding in answer.findings or [None]]
        return rows

    def document(self) -> Document:
        """The measured values of one body or a table of several bodies, the differences between engines, and the findings."""
        bodies, parts = self.diagnosis.bodies, list[Part]([Paragraph(COLUMNS, on_terminal=False)])
        by_name, measured = grouped(bodies, lambda body: body.name), [body for body in bodies if not body.breakdown]
        if len(by_name) > 1:
            parts.append(Table(list(map(_overview, bodies)), ["mass", "lands on"]))
        for of_name in by_name.values():
            for body in of_name:
                parts += _body_parts(body, on_terminal=len(measured) <= 1)
            both = [body for body in of_name if body in measured]
            if len(both) > 1:
                is_alone = len(by_name) == 1
                parts += [Heading(f"{both[0].name}: the engines differ"), Table(differences(both), on_terminal=is_alone)]
        if len(measured) > 1:
            parts.append(Sentences(of_several(bodies), on_page=False))
        if self.diagnosis.others:
            parts.append(Paragraph(f"Not diagnosed: {self.diagnosis.others}."))
        return Document(f"Diagnosis of {self.diagnosis.file}", parts, [Paragraph(summary(self.diagnosis))])


def _kind(finding: Finding) -> str:
    return KINDS.get(finding.kind, finding.kind)


def _finding_cells(body: BodyDiagnosis, answer: Answer, finding: Finding | None) -> dict[str, str]:
    """The columns of a finding; they are empty if there is no finding."""
    if finding is None:
        return {"finding": "", "settings": "", "shares": "", "remedies": "", "reason": ""}
    remedies = "; ".join(_remedies((answer, finding)))
    settings, shares = "; ".join(_settings(body, finding.settings)), "; ".join(f"{name}: {share:.3g}" for name, share in finding.shares)
    return {"finding": finding.kind, "settings": settings, "shares": shares, "remedies": remedies, "reason": finding.detail}


def _body_parts(body: BodyDiagnosis, *, on_terminal: bool) -> list[Part]:
    """The parts of a page on one body. With several bodies, a terminal shows a table instead, and `on_terminal` is false."""
    broken = [Paragraph(f"{body.name}: {why}.", style="bold", on_terminal=on_terminal) for why in _breakdown(body)]
    if not body.answers:
        return [*broken]
    others = f" (--on can choose {listed(body.others)})" if body.others else ""
    frictions = " and ".join(f"{one:g}" for one in (body.friction, body.friction_across) if not math.isnan(one))
    surface = f"{body.surface}{others}, friction {frictions or 'differs between geometries'}" if body.surface else "no surface"
    described = f"{body.name}: {', '.join(body.shapes) or 'no shape'}, {body.mass:.4g} kg"
    head = f"{described}; {body.engine} {body.version}, time step {in_ms(body.dt)}; lands on {surface}."
    drawn = charts(body)
    return [
        *broken,
        Heading(f"{body.name} in {body.engine}"),
        Paragraph(head, on_terminal=on_terminal),
        Table(list(answer_rows(body)), on_terminal=on_terminal),
        Sentences([*sentences(body), *_left_out(body)], numbered=True, on_terminal=on_terminal),
        *([Charts(f"{body.name} {body.engine}", drawn)] if drawn else []),
    ]


def _breakdown(body: BodyDiagnosis) -> list[str]:
    """The reason why a simulation has no result, if there is one, without a full stop."""
    return [body.breakdown.removesuffix(".")] * bool(body.breakdown)


def _left_out(body: BodyDiagnosis) -> list[str]:
    """The parts of the file that the simulations leave out."""
    return [f"Not simulated: {', '.join(body.unmodelled)} of the file."] if body.unmodelled else []


def of_several(bodies: Sequence[BodyDiagnosis]) -> list[str]:
    """The findings of several bodies or engines: one sentence for all that have the same finding."""
    owners: dict[str, list[str]] = {}
    engines, names = {body.engine for body in bodies}, {body.name for body in bodies}
    for body in bodies:
        owner = " ".join([body.name] * (len(names) > 1) + [body.engine] * (len(engines) > 1))
        for sentence in [*(f"{why}." for why in _breakdown(body)), *sentences(body), *_left_out(body)]:
            owners.setdefault(sentence, []).append(owner)
    return [f"{listed(of_sentence)}: {sentence}" for sentence, of_sentence in owners.items()]


def _overview(body: BodyDiagnosis) -> dict[str, str]:
    kinds = [_kind(finding) for _, finding in body.findings]
    findings = ", ".join(f"{kind} ({kinds.count(kind)})" if kinds.count(kind) > 1 else kind for kind in dict.fromkeys(kinds))
    return {
        "body": body.name,
        "engine": body.engine,
        "mass": "–" if math.isnan(body.mass) else f"{body.mass:.3g} kg",
        "lands on": body.surface or "–",
        "findings": ", ".join(filter(None, [body.breakdown, findings])) or "none",
    }


def answer_rows(body: BodyDiagnosis) -> Iterator[dict[str, str]]:
    """A row for each measured value. Equal values for several axes or speeds share a row, as do the moments of inertia."""
    moments = [answer for answer in body.answers if answer.quantity == MOMENT]
    ratios = [formatted(answer.measured / answer.physical) for answer in moments]
    if moments:
        yield _row(body, "inertia", "moments / solid's", ", ".join(dict.fromkeys(ratios)), "", "1", "")
    shown = [answer for answer in body.answers if answer not in moments and answer.question not in ("file", "friction")]
    for _, group in groupby(shown, lambda answer: (answer.question, answer.quantity, _cells(answer))):
        same = list(group)
        kinds = ", ".join(dict.fromkeys(map(_kind, same[0].findings)))
        yield _row(body, same[0].question, _together(same), *_cells(same[0]), kinds)


def _row(body: BodyDiagnosis, question: str, quantity: str, measured: str, in_force: str, physical: str, cause: str) -> dict[str, str]:
    cells = {f"dt = {in_ms(body.dt)}": measured, "exact": in_force, "ideal": physical, "finding": cause}
    return {"what": f"{question}: {quantity}", **cells}


def _cells(answer: Answer) -> tuple[str, str, str]:
    """The measured value with its range over impacts at several instants within a time step, and the two exact values."""
    measured = answer.detail if answer.detail and not math.isfinite(answer.measured) else _value(answer.measured, answer.unit)
    if answer.most - answer.least > 0.0:
        measured += f" ({formatted(answer.least)} to {formatted(answer.most)})"
    return measured, _value(answer.in_force, answer.unit), _value(answer.physical, answer.unit)


def _value(value: float, unit: str) -> str:
    """A value with its unit, small lengths and times in mm and ms; empty if the value is not known."""
    if math.isnan(value):
        return ""
    if math.isinf(value):
        return "never" if unit == "s" else "none"
    if abs(value) < LEAST and unit != "kg m²":
        return with_unit("0", unit)
    if unit in ("m", "s", "m/s") and abs(value) < 0.1:
        value, unit = 1e3 * value, f"m{unit}"
    if unit == "%":
        return "0 %" if abs(value) < 1e-3 else f"{value:+.3g} %"
    return with_unit(f"{value:.4g}" if abs(value) >= 1e-3 else formatted(value), unit)


def sentences(body: BodyDiagnosis) -> Iterator[str]:
    """A sentence for each finding: what is wrong, the settings that cause it, quoted from the file with their lines, and the remedies."""
    for same in grouped(body.findings, _shared).values():
        question, finding = same[0][0].question, same[0][1]
        stated = grouped(same, _statement).items()
        statements = "; ".join(f"{_together([answer for answer, _ in those])} {statement}" for statement, those in stated)
        where = ", ".join(_settings(body, finding.settings))
        if finding.tried:
            where = f"not removed by a change of {' or '.join(_settings(body, finding.tried))}"
        sentence = f"{question.capitalize()}, {_kind(finding)}: {statements}" + (f": {where}." if where else ".")
        yield " ".join([sentence, *_remedies(*same)])


def _shared(pair: tuple[Answer, Finding]) -> tuple[object, ...]:
    """The properties by which findings are grouped into one sentence."""
    answer, finding = pair
    return answer.question, finding.kind, finding.settings, finding.tried, tuple(remedy.text for remedy in finding.remedies)


def _together(answers: Sequence[Answer]) -> str:
    """The measured quantities; those that differ only in the initial speed or direction are joined."""
    quantities = []
    for quantity, same in grouped(answers, lambda answer: answer.quantity).items():
        from_speed, along = STARTS.get(same[0].question, (" at", " about"))
        speeds = dict.fromkeys(f"{answer.speed:g}" for answer in same if math.isfinite(answer.speed))
        directions = dict.fromkeys(answer.direction for answer in same if answer.direction)
        of_speeds = f"{from_speed} {', '.join(speeds)} m/s" if speeds else ""
        quantities.append(quantity + of_speeds + (f"{along} {', '.join(directions)}" if directions else ""))
    return ", ".join(quantities)


def _remedies(*same: tuple[Answer, Finding]) -> Iterator[str]:
    """A sentence for each remedy that the findings share, with the values measured with this remedy."""
    for remedies in zip(*(finding.remedies for _, finding in same), strict=True):
        pairs = zip(remedies, (answer for answer, _ in same), strict=True)
        values = {_value_after(remedy, answer): None for remedy, answer in pairs}
        first = remedies[0]
        text = f"Remedy: {first.text}" if math.isnan(first.value) else f"Remedy, tried: {first.text} gives {', '.join(values)}"
        if first.others or not first.runs:
            also = f"it also applies to {counted(first.others, 'other body', 'other bodies')}, and " if first.others else ""
            text += f" ({also}the whole model {'runs' if first.runs else 'breaks down'} with it)"
        yield f"{text}."


def _value_after(remedy: Remedy, answer: Answer) -> str:
    """The value measured with a remedy. For a spin without a decay time, it is the fraction left after 1 s."""
    value = _value(remedy.value, remedy.unit)
    return value if remedy.unit == answer.unit else f"a fraction of {value} kept in 1 s"


def _statement(pair: tuple[Answer, Finding]) -> str:
    """The statement on a quantity: its measured value, and the expected value or the reason."""
    answer, finding = pair
    measured, in_force, physical = _cells(answer)
    if finding.kind == "impossible":
        return f"is {measured}, but {finding.detail}"
    if finding.kind == "changed":
        return f"is {finding.detail}"
    if finding.detail:
        of_error = f" instead of {in_force}" if finding.is_error and in_force and math.isnan(answer.measured) else ""
        return f"is {measured}{of_error}, {finding.detail}" if measured else f"of the simulation: {finding.detail}"
    wanted = in_force if (finding.is_error or finding.removes_error) and in_force else physical
    limit = f", {_value(answer.limit, answer.unit)} as dt → 0" if finding.kind == "time step" and math.isfinite(answer.limit) else ""
    shares = f" ({explained_by(dict(finding.shares), 'of the difference')})" if finding.shares else ""
    return f"is {measured}" + (f" instead of {wanted}" if wanted else "") + limit + shares


def _settings(body: BodyDiagnosis, names: Sequence[str]) -> list[str]:
    """Settings in the words of the file; of one that the engine compiled of parts that dropspin does not follow, the name."""
    known = body.settings or {}
    return [str(known.get(name, f"{name} (compiled; its place in the file was not found)")) for name in names]


def differences(bodies: Sequence[BodyDiagnosis]) -> Rows:
    """The measured values in which engines differ, with a column for each engine."""
    by_quantity: dict[str, dict[str, str]] = {}
    for body in bodies:
        for answer in (answer for answer in body.answers if answer.question != "file"):
            row = by_quantity.setdefault(f"{answer.question}: {_together([answer])}", {})
            row[f"{body.engine}, dt = {in_ms(body.dt)}"] = _cells(answer)[0] or _value(answer.in_force, answer.unit)
    engines = [f"{body.engine}, dt = {in_ms(body.dt)}" for body in bodies]
    rows = [{"what": quantity, **{engine: row.get(engine, "–") for engine in engines}} for quantity, row in by_quantity.items()]
    return [row for row in rows if len({row[engine] for engine in engines}) > 1]


def summary(diagnosis: Diagnosis) -> str:
    """The number of findings of each kind, as many as there are sentences on each body, and the number of bodies without a result."""
    kinds = [_kind(same[0][1]) for body in diagnosis.bodies for same in grouped(body.findings, _shared).values()]
    text = ", ".join(f"{kinds.count(kind)} {kind}" for kind in dict.fromkeys(kinds))
    broken = sum(bool(body.breakdown) for body in diagnosis.bodies)
    without = f"; {counted(broken, 'body', 'bodies')} without a result" if broken else ""
    return f"{counted(len(kinds), 'finding')}{f' ({text})' if text else ''}{without}."


def charts(body: BodyDiagnosis) -> list[Chart]:
    """A chart of rebound speed / impact speed over the impact speed, with its range over instants of impact; empty without a rebound."""
    impacts = [answer for answer in body.answers if answer.quantity == REBOUND]
    if not any(answer.most > 0.0 for answer in impacts):
        return []
    rows = [(answer.speed, answer.measured, answer.least, answer.most, answer.limit) for answer in impacts]
    speeds, measured, least, most, limit = np.array(rows).T
    lines = [Line(f"dt = {in_ms(body.dt)}", speeds, measured, marker="o", low=least, high=most)]
    lines.append(Line("as dt → 0", speeds, limit, dashes="dashed", marker="s"))
    return [Chart("impact speed [m/s]", "rebound speed / impact speed", lines)]
