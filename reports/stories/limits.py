"""The output of `dropspin limits`: the largest time steps, and for each engine the range of tested values in which it does not fail."""

from collections.abc import Callable, Collection, Sequence
from itertools import groupby
from typing import Literal

import numpy as np
from pydantic import Field

from dropspin.comparisons.limits.axes import AXES
from dropspin.comparisons.limits.study import AxisScan, LimitsStudy, ScanPoint
from dropspin.reports.document import Charts, Document, Heading, Paragraph, Part, Rows, Sentences, Table
from dropspin.reports.plots.run_charts import limits_charts
from dropspin.reports.stories.numbers import duration, left_out
from dropspin.reports.stories.study import Records, Study
from dropspin.reports.stories.words import WORDS
from dropspin.scenarios.text import counted

COLUMNS = ("scene", "engine", "axis", "value", "unit", "failure_mode", "criterion", "size", "message", "compared_until")


class Limits(Study):
    """The results of `dropspin limits` in each scene, and which scenes lack an axis."""

    study: Literal["limits"] = "limits"
    scenes: list[LimitsStudy]
    left_out: dict[str, str] = Field(default_factory=dict)

    def rows(self) -> Records:
        """A row for each tested value, and a row for each engine that is missing."""
        return [row for study in self.scenes for row in _rows(study)]

    def document(self) -> Document:
        """The ranges in each scene, and the largest time steps at which engines are accurate and stable."""
        parts: list[Part] = []
        for study in self.scenes:
            charts = [Charts(study.scene.name, limits_charts(study))] if study.scans else []
            parts += [Heading(study.scene.name), Paragraph(nominal(study)), *charts, Table(range_rows(study))]
            parts.append(Sentences(sentences(study), numbered=True))
        if self.left_out:
            parts.append(Sentences(left_out(self.left_out)))
        steps = step_rows(self.scenes)
        summary: list[Part] = [Heading("The largest steps"), Table(steps), Paragraph(WORDS["limits"]["steps"])] if steps else []
        return Document("Where engines break down", parts, summary)


def _rows(study: LimitsStudy) -> Records:
    """A row for each value of each scan and for each smaller time step tried at the nominal values, and one for each engine left out."""
    name, scanned = study.scene.name, {scan.engine for scan in study.scans if scan.axis.name == "step"}
    points = [(scan.engine, scan.axis, point) for scan in study.scans for point in scan.points]
    not_scanned = [engine for engine in study.refinements if engine not in scanned]
    points += [(engine, AXES["step"], point) for engine in not_scanned for point in study.steps(engine)]
    tested = [(name, engine, axis.name, point.value, axis.unit, *point.diagnosis) for engine, axis, point in points]
    missing = [(name, engine, None, None, None, "missing", None, None, reason, None) for engine, reason in study.left_out.items()]
    return [dict(zip(COLUMNS, row, strict=True)) for row in [*tested, *missing]]


def nominal(study: LimitsStudy) -> str:
    """The conditions of a study: scene, time step and tolerance. An axis may vary the time step."""
    return (
        f"{study.scene.name} at dt = {duration(study.dt)}. "
        f"Sound: the engine meets no failure criterion, and its errors are at most {study.within:g} (ratios, or angles in rad)."
    )


def step_rows(studies: Sequence[LimitsStudy]) -> Rows:
    """The largest tested time steps at which each engine is accurate and stable, for each scene."""
    rows = []
    for study in studies:
        scene = study.scene
        spin = float(np.linalg.norm(scene.start.angular_velocity)) if scene.floor is None else 0.0
        for engine in dict.fromkeys(scan.engine for scan in study.scans if scan.axis.name == "step"):
            accurate, stable = (_largest(steps, study.steps(engine), spin) for steps in study.step_ranges(engine))
            rows.append({"scene": scene.name, "engine": engine, "accurate up to": accurate, "stable up to": stable})
    return rows


def _largest(steps: tuple[float, float] | None, tried: Sequence[ScanPoint], spin: float) -> str:
    """The largest of the time steps that meet a condition, or, if there are none, the smallest tested one with its failure mode."""
    if steps is None:
        return f"{_mode(tried[0])} at {duration(tried[0].value)}, the smallest tested"
    smallest, dt = steps
    turn = f" ({spin * dt:.2g} rad per step)" if spin else ""
    turn += f", from {duration(smallest)} on" if smallest > tried[0].value else ""
    return duration(dt) + turn + (", the largest tested" if dt == tried[-1].value else "")


def _mode(point: ScanPoint) -> str:
    return point.mode.replace("_", " ")


def range_rows(study: LimitsStudy) -> Rows:
    """The range in which each engine is sound along each axis, and the failure modes beyond."""
    modes = {engine: _mode(points[0]) for engine, points in study.refinements.items() if points[0].mode != "sound"}
    return [{"axis": scan.axis.label, "engine": scan.engine, **_range(scan, modes.get(scan.engine))} for scan in study.scans]


def _range(scan: AxisScan, nominal: str | None) -> dict[str, str]:
    """The range along an axis. `nominal` is the failure mode at the nominal values, which recurs at every value of an invariant axis."""
    points, ends = scan.points, scan.sound_range
    count, sound = len(points), sum(point.mode == "sound" for point in points)
    none = {"sound from": "–", "to": "–"}
    if ends is None:
        base = f"{_mode(scan.nominal)} at the nominal value, {scan.base:.4g}"
        return none | {"beyond": f"{base}; sound at {sound} of {count} tested values"}
    least, most = (f"{points[number].value:.4g}" for number in ends)
    outside = [f"{_mode(point)} at {point.value:.4g}" for point in _outside(scan)]
    if scan.axis.invariant and nominal:
        same = f"at all {count} tested values" if sound == count else f"from {least} to {most}"
        return none | {"beyond": "; ".join([f"{nominal} at the nominal value; the same motion {same}", *outside])}
    if not outside:
        outside = [f"not tested; {'the same motion' if scan.axis.invariant else 'sound'} at all {count} tested values"]
    elif len(outside) == 1:
        outside.append(f"no {'smaller' if ends[0] == 0 else 'larger'} value tested")
    return {"sound from": least, "to": most, "beyond": "; ".join(outside)}


def _outside(scan: AxisScan) -> list[ScanPoint]:
    """The neighbours of the sound range: those tested values at which it ends."""
    first, last = scan.sound_range or (0, len(scan.points))
    return [scan.points[number] for number in (first - 1, last + 1) if 0 <= number < len(scan.points)]


def sentences(study: LimitsStudy) -> list[str]:
    """Sentences on engines that are not sound at the nominal values, on crashes beyond a sound range, and on engines left out."""
    failing = [(engine, points) for engine, points in study.refinements.items() if points[0].mode != "sound"]
    crashes = [
        f"{scan.engine} crashed at {point.value:.4g} on the axis {scan.axis.label}: {point.diagnosis.message}."
        for scan in study.scans
        for point in _outside(scan)
        if point.mode == "crashed"
    ]
    return [_refinement(engine, points) for engine, points in failing] + crashes + _compared_in_part(study) + left_out(study.left_out)


def _compared_in_part(study: LimitsStudy) -> list[str]:
    """Sentences on the values of an axis at which the exact solution ends before the motion, so that later errors are not judged."""
    found = []
    for label in dict.fromkeys(scan.axis.label for scan in study.scans):
        points = [point for scan in study.scans if scan.axis.label == label for point in scan.points]
        ends = {point.value: until for point in points if (until := point.diagnosis.compared_until) is not None}
        if ends:
            where = f"{counted(len(ends), 'value', 'values')}, {_span(ends, '{:.4g}'.format)},"
            ending = f"the exact solution ends before the motion, after {_span(ends.values(), duration)}; later errors are not judged"
            found.append(f"Axis {label}: at {where} {ending}.")
    return found


def _span(values: Collection[float], written: Callable[[float], str]) -> str:
    """The least and the largest of some values, or the one that they are written as."""
    return " to ".join(dict.fromkeys(map(written, (min(values), max(values)))))


def _refinement(engine: str, points: Sequence[ScanPoint]) -> str:
    nominal, *smaller = points
    where = f"{engine} is not sound at the nominal values and dt = {duration(nominal.value)}"
    sentence = f"{where}: {_mode(nominal)}, {nominal.diagnosis.message}."
    if not smaller:
        return f"{sentence} No smaller time step was tried."
    tried = [f"{mode} at {', '.join(duration(point.value) for point in group)}" for mode, group in groupby(smaller, _mode)]
    sentence += f" Smaller time steps tried: {'; '.join(tried)}."
    last = smaller[-1]
    if last.mode == "sound":
        return f"{sentence} With --dt {last.value:g} ranges are those around a sound run."
    return f"{sentence} At {duration(last.value)}, the smallest tried, {last.diagnosis.message}."
