"""The pages of a record in words: the digits in a cell, what changed in a release, and what an engine gets right and wrong."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from comparisons.judging.verdicts import MARKS
from comparisons.measuring.metrics import METRICS
from comparisons.measuring.tolerances import scale
from comparisons.record.findings import Case, Change, Release, digits, leading, problem, relative_error
from reports.views.leading_errors import level
from reports.views.numbers import formatted, in_ms, word

MANY, FEW = 5.0, 2.0
"""The numbers of digits that divide the scenes of an engine into three: errors below 1e-5 do not matter to any use of an engine."""
COLOURS = ((1.0, "red"), (2.0, "orange"), (3.0, "yellow"), (5.0, "green"), (math.inf, "brightgreen"))
"""The colours of a badge: each up to a median of digits."""
MOST_SHOWN = 15
"""Largest number of significant digits in which two values are shown, so that they differ."""


class Cell(NamedTuple):
    """A cell of a matrix: its text, the decade of the error for its colour, the verdict in words, and what it shows when pointed at."""

    text: str
    level: int | None
    status: str
    title: str


def cell(engine: str, release: Release, label: str, scene: str, dt: float) -> Cell:
    """The digits of a release in a scene."""
    case = release.cases.get((label, scene, dt))
    if case is None:
        return Cell("", None, "not measured", "not measured")
    metric, error = leading(scene), relative_error(case, scene)
    again = f"{label} {release.name}, dt = {in_ms(dt)}; measure again: {rerun(engine, release.name)}"
    if case.verdict != "measured":
        return Cell(f"{MARKS[case.verdict]} {word(case.verdict)}", None, word(case.verdict), f"{case.reason}; {again}")
    if math.isnan(error):
        return Cell("too coarse", None, "too coarse", f"the time step is too coarse for the {metric.replace('_', ' ')}; {again}")
    remark = f"known limitation: {case.reason}; " if case.reason else ""
    text = f"{'! ' if case.reason else ''}{digits(error):.1f}"
    return Cell(text, level(error), "known limitation" if case.reason else "measured", f"{remark}{value_of(case, scene)}, {again}")


def value_of(case: Case, scene: str) -> str:
    """The leading error of a scene with its name and unit."""
    metric = leading(scene)
    return f"{metric.replace('_', ' ')} {formatted(case.values[metric])}{_unit(metric)}"


def rerun(engine: str, release: str) -> str:
    """The command that measures a release again."""
    return f"dropspin record -e {engine} --release {release} -o again"


def told(changed: Sequence[Change]) -> dict[str, list[str]]:
    """What changed in each release, newest first: a sentence for each scene, the largest change of digits first.

    Labels whose results changed alike have one sentence, and so have scenes that are declined no longer, or from now on.
    """
    by_scene: dict[tuple[str, str, str], list[Change]] = {}
    for change in changed:
        by_scene.setdefault((change.release, change.label, change.scene), []).append(change)
    sentences: dict[str, dict[tuple[str, ...], list[str]]] = {}
    scenes: dict[tuple[str, str, str], list[str]] = {}
    for (release, label, scene), found in sorted(by_scene.items(), key=lambda item: -max(map(_gained, item[1]))):
        finest = [one for one in found if one.dt == min(change.dt for change in found)]
        shown = next((one for one in finest if one.metric == leading(scene)), finest[0])
        if shown.metric:
            sentences.setdefault(release, {}).setdefault((_moved(shown),), []).append(label)
        else:
            scenes.setdefault((release, label, _began(shown)), []).append(scene)
    for (release, label, words), names in scenes.items():
        sentences.setdefault(release, {}).setdefault((", ".join(names), words), []).append(label)
    order = list(dict.fromkeys(change.release for change in changed))[::-1]
    return {release: [": ".join([", ".join(labels), *said]) for said, labels in sentences[release].items()] for release in order}


def _gained(change: Change) -> float:
    """The size of the change of digits; infinite where there is a value in one of the releases only."""
    if not change.metric:
        return math.inf
    of = scale(problem(change.scene), METRICS[change.metric].unit)
    return abs(digits(abs(change.new) / of) - digits(abs(change.old) / of))


def _moved(change: Change) -> str:
    old, new = _apart(change.old, change.new)
    name = change.metric.replace("_", " ")
    step = f"dt = {in_ms(change.dt)}".replace(" ", "\xa0")  # in one line
    return f"{name} of {change.scene} {old} → {new}{_unit(change.metric)} at {step}"


def _apart(old: float, new: float) -> tuple[str, str]:
    """Two values with at least three significant digits, and so many that they differ."""
    if formatted(old) != formatted(new):
        return formatted(old), formatted(new)
    pairs = ((f"{old:.{count}g}", f"{new:.{count}g}") for count in range(4, MOST_SHOWN + 1))
    return next((pair for pair in pairs if pair[0] != pair[1]), (f"{old!r}", f"{new!r}"))


def _began(change: Change) -> str:
    reason = change.now.reason if change.now.verdict != "measured" else f"before: {change.was.reason}"
    return f"{word(change.was.verdict)} → {word(change.now.verdict)}{f' ({reason})' if reason else ''}"


def _unit(metric: str) -> str:
    unit = METRICS[metric].unit
    return "" if unit == "1" else f" {unit}"


def summary(release: Release, label: str, dt: float) -> list[str]:
    """What an engine gets right and wrong in a release: sentences."""
    own = {scene: case for (of, scene, step), case in release.cases.items() if of == label and step == dt}
    found = {scene: digits(relative_error(case, scene)) for scene, case in own.items()}
    parts = {
        f"at least {MANY:g} digits": [scene for scene, one in found.items() if one >= MANY],
        f"{FEW:g} to {MANY:g} digits": [scene for scene, one in found.items() if FEW <= one < MANY],
        f"fewer than {FEW:g} digits": [scene for scene, one in found.items() if one < FEW],
    }
    for scene, case in own.items():
        if case.verdict != "measured":
            parts.setdefault(word(case.verdict), []).append(scene)
    return [f"{words}: {', '.join(scenes)}" for words, scenes in parts.items() if scenes]


def since(label: str, scene: str, releases: Sequence[Release], changed: Iterable[Change]) -> str:
    """The release since which nothing changed in a scene, or the first that was measured."""
    moved = [change.release for change in changed if (change.label, change.scene) == (label, scene)]
    return moved[-1] if moved else next(one.name for one in releases if any(key[:2] == (label, scene) for key in one.cases))


def badge(engine: str, release: Release, label: str, dt: float) -> Mapping[str, Any]:
    """The badge of an engine as shields.io draws it from a file: https://shields.io/badges/endpoint-badge."""
    own = {scene: case for (of, scene, step), case in release.cases.items() if of == label and step == dt}
    found = [one for scene, case in own.items() if not math.isnan(one := digits(relative_error(case, scene)))]
    middle = float(np.median(found)) if found else 0.0
    message = f"median {middle:.1f} digits in {len(found)} of {len(own)} scenes"
    return {
        "schemaVersion": 1,
        "label": f"{engine} {release.name}",
        "message": message,
        "color": next(colour for most, colour in COLOURS if middle < most),
    }
