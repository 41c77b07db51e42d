"""What a study of extremes says: surprises first, largest steps, what scales and what does not; tables and files."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from comparisons.extremes import Explored, Extremes, Point, Surprise, surprises
from reports.section import Section
from reports.written import write_table

COLUMNS = ("scene", "engine", "axis", "value", "unit", "across", "across_value", "condition", "criterion", "figure", "said")
AS_SURPRISING = 16
"""Sentences on a terminal; all are in the file."""


def rows(found: Extremes) -> list[dict[str, Any]]:
    """Every point: along axes, then in planes of two."""
    single = [_row(line, point) for line in found.explored for point in line.points]
    double = [
        _row(line, point) | {"across": plane.axes[1].name, "across_value": value}
        for plane in found.mapped
        for value, line in plane.rows
        for point in line.points
    ]
    return single + double


def _row(line: Explored, point: Point) -> dict[str, Any]:
    finding = point.finding
    figure = finding.figure if math.isfinite(finding.figure) else None
    shared = {"scene": line.scene.name, "engine": line.engine, "axis": line.axis.name, "value": point.value, "unit": line.axis.unit}
    return {
        **shared,
        "across": "",
        "across_value": None,
        "condition": finding.condition,
        "criterion": finding.criterion,
        "figure": figure,
        "said": finding.said,
    }


def sentences(found: Sequence[Extremes]) -> list[str]:
    """The surprises of all scenes, the most surprising first."""
    steps = {one.scene.name: one.dt for one in found}
    told = surprises([line for one in found for line in one.explored])
    return [_sentence(surprise, steps[surprise.explored.scene.name]) for surprise in told]


def _sentence(surprise: Surprise, dt: float) -> str:
    line, outside, inside = surprise.explored, surprise.outside, surprise.inside
    condition = outside.condition.replace("_", " ")
    if inside is None:
        where = "as it is"
    else:
        beyond = "above" if line.axis.coordinate(outside.value) > line.axis.coordinate(inside.value) else "below"
        where = f"{line.axis.name} {beyond} {_edge(inside, outside)}{_unit(line)}{_turn(line, inside.value, outside.value, dt)}"
    sudden = ", all of a sudden," if surprise.sudden else ""
    others = f" Sound there: {_listed(surprise.sound)}." if surprise.sound else ""
    return f"{line.scene.name}, {where}: {condition}{sudden} in {_listed(surprise.engines)}; {outside.finding.said}.{others}"


def _edge(inside: Point, outside: Point) -> str:
    """An edge between two values, with as many digits as they have in common, and one."""
    for digits in range(3, 17):
        middle = f"{inside.value:.{digits}g}"
        if middle != f"{outside.value:.{digits}g}":
            return middle
    return repr(inside.value)


def _unit(line: Explored) -> str:
    return "" if line.axis.unit == "1" else f" {line.axis.unit}"


def _turn(line: Explored, inside: float, outside: float, dt: float) -> str:
    """How far a body in flight turns in a step, where that is what an edge depends on."""
    factor = {"spin": dt, "step": float(np.linalg.norm(line.scene.start.angular_velocity))}.get(line.axis.name, 0.0)
    is_told = factor and line.scene.floor is None
    return f" (between {inside * factor:.3g} and {outside * factor:.3g} rad a step)" if is_told else ""


def _listed(names: Sequence[str]) -> str:
    """Some names, the first three of many."""
    named = [*names[:3], f"{len(names) - 3} more"] if len(names) > 4 else list(names)
    return named[0] if len(named) == 1 else f"{', '.join(named[:-1])} and {named[-1]}"


def step_rows(found: Sequence[Extremes]) -> list[dict[str, str]]:
    """The largest steps, by scene and engine."""
    table = []
    for one in found:
        spin = float(np.linalg.norm(one.scene.start.angular_velocity)) if one.scene.floor is None else 0.0
        for engine in dict.fromkeys(line.engine for line in one.explored if line.axis.name == "step"):
            accurate, stable = one.largest_steps(engine)
            table.append(
                {"scene": one.scene.name, "engine": engine, "accurate up to": _step(accurate, spin), "stable up to": _step(stable, spin)}
            )
    return table


def _step(dt: float | None, spin: float) -> str:
    if dt is None:
        return "none that was tried"
    return (f"{1e3 * dt:.3g} ms" if dt < 1.0 else f"{dt:.3g} s") + (f", {spin * dt:.2g} rad" if spin else "")


def range_rows(found: Sequence[Extremes]) -> list[dict[str, str]]:
    """How far each engine is sound along each axis, and what comes beyond."""
    return [
        {
            "scene": line.scene.name,
            "axis": line.axis.label,
            "engine": line.engine,
            **_range(line),
        }
        for one in found
        for line in one.explored
    ]


def _range(line: Explored) -> dict[str, str]:
    points, sound = line.points, line.sound_range
    if sound is None:
        own = line.at(line.base)
        return {"sound from": "–", "to": "–", "beyond": f"{own.condition.replace('_', ' ')} as it is: {own.finding.said}"}
    first, last = sound
    outside = [points[number] for number in (first - 1, last + 1) if 0 <= number < len(points)]
    beyond = "; ".join(f"{point.condition.replace('_', ' ')} at {point.value:.4g}" for point in outside)
    return {"sound from": f"{points[first].value:.4g}", "to": f"{points[last].value:.4g}", "beyond": beyond or "as far as was looked"}


def write(found: Sequence[Extremes], folder: Path) -> None:
    """`limits.csv`, `limits.json`, `limits.md` and the maps."""
    from reports.plots import extremes_figure, stability_figure

    write_table(folder, "limits", COLUMNS, [row for one in found for row in rows(one)])
    section = Section("Where engines break")
    if any(one.explored for one in found):
        section.add_heading("Surprises first")
        section.add_list(sentences(found) or ["None."])
    if steps := step_rows(found):
        section.add_heading("The largest steps")
        section.add_table(steps)
    for one in found:
        section.add_heading(one.scene.name)
        if one.explored:
            section.add_picture(one.scene.name, extremes_figure(one))
            section.add_table(range_rows([one]))
        for along, across in dict.fromkeys((plane.axes[0].name, plane.axes[1].name) for plane in one.mapped):
            section.add_picture(f"{one.scene.name}-{along}-{across}", stability_figure(one, along, across))
        for engine, why in one.left_out.items():
            section.add_text(f"Left out: {engine}, {why}.")
    section.write(folder, "limits")
