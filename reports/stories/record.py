"""The texts on the pages of a record: the digits in a cell, the changes in a release, and the scenes that an engine gets right or wrong."""

import math
from collections.abc import Mapping, Sequence
from shlex import quote
from typing import Any, NamedTuple

import numpy as np

from dropspin.comparisons.judging.verdicts import MARKS
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.tolerances import scale
from dropspin.comparisons.record.findings import Case, Change, Release, digits, leading, problem, relative_error
from dropspin.reports.stories.matrix import level
from dropspin.reports.stories.numbers import duration, formatted, grouped, in_ms, with_unit, word

GROUPS = {"at least 5 digits": 5.0, "at least 2, less than 5 digits": 2.0, "less than 2 digits": 0.0}
"""The groups of scenes that an engine gets right and wrong, with the least digits of each; errors below 1e-5 are not distinguished."""


class Cell(NamedTuple):
    """A cell of a matrix: its text, the decade of the error for its colour, the status, and the tooltip."""

    text: str
    level: int | None
    status: str
    title: str


def cell(release: Release, label: str, scene: str, dt: float) -> Cell:
    """The cell of a release and a scene: the number of correct digits of the leading error, or the mark of the verdict."""
    case, metric = release.cases.get((label, scene, dt)), leading(scene)
    if case is None:
        return Cell("?", None, "not measured", "not measured")
    error, again = relative_error(case, scene), f"{label} {release.name}, dt = {in_ms(dt)}; to repeat it: {rerun(label, release, scene)}"
    remark = f"{case.reason}; " if case.reason else ""
    if math.isnan(error):  # a motion without this error: the time step is too coarse
        status = "too coarse" if case.verdict == "measured" else word(case.verdict)
        return Cell(MARKS[case.verdict], None, status, remark + again)
    parts = [f"{metric.replace('_', ' ')} {with_unit(formatted(case.values[metric]), METRICS[metric].unit)}"]
    parts += [f"{sizes(case)} over initial states"] if sizes(case) else []
    parts += [f"{cost(case)} per simulated second, {case.relative_cost:.3g} times that of Wang's method"] if cost(case) != "–" else []
    shown = ", ".join(parts) + ", "
    status, mark = ("limited", "! ") if case.reason else ("measured", "")
    return Cell(f"{mark}{math.floor(10.0 * digits(error)) / 10.0:.1f}", level(error), status, remark + shown + again)


def rerun(label: str, release: Release, scene: str) -> str:
    """The command that measures a cell again."""
    return f"dropspin record rerun {quote(label)} {release.name} {scene}"


def cost(case: Case) -> str:
    """The wall time of the steps per simulated second."""
    return "–" if math.isnan(case.cost) else duration(case.cost)


def sizes(case: Case) -> str:
    """The range of the size of the leading error over initial states; empty for a scene with one initial state."""
    return "" if math.isnan(case.low) else f"{formatted(case.low)} to {formatted(case.high)}"


def error(case: Case, scene: str) -> str:
    """The leading error from the initial state of the scene, or the verdict if there is no error."""
    return word(case.verdict) if case.verdict != "measured" else formatted(case.values.get(leading(scene), math.nan))


def mean_cost(release: Release, label: str, dt: float, *, with_floor: bool) -> str:
    """The geometric mean of the cost over scenes with or without a floor."""
    cases = release.at(label, dt).items()
    costs = [case.cost for scene, case in cases if (problem(scene).floor is not None) == with_floor and not math.isnan(case.cost)]
    return duration(math.exp(np.mean(np.log(costs)))) if costs else "–"


def remarks(cases: Mapping[str, Case]) -> list[str]:
    """The reasons why there is no result, and known limitations: a sentence for all scenes, or all engines, with the same reason."""
    alike = grouped([name for name, case in cases.items() if case.reason], lambda name: (cases[name].verdict, cases[name].reason))
    words = {verdict: "limited" if verdict == "measured" else word(verdict) for verdict, _ in alike}
    return [f"{', '.join(names)}: {words[verdict]}: {reason}" for (verdict, reason), names in alike.items()]


def change_sentences(changed: Sequence[Change]) -> dict[str, list[str]]:
    """What changed in each release, newest first: a sentence for each scene, the largest change of digits first.

    Engines and scenes that changed alike share a sentence; scenes with a value in only one of the two releases come last.
    """
    shown = [_shown(changes) for changes in grouped(changed, lambda change: (change.release, change.label, change.scene)).values()]
    ordered = sorted(shown, key=lambda change: -_gained(change))
    sentences: dict[str, list[str]] = {change.release: [] for change in reversed(changed)}
    by_label = grouped(ordered, lambda change: (change.release, change.label, _words(change)))
    scenes = {key: ", ".join(change.scene for change in alike) for key, alike in by_label.items()}
    for (release, names, words), keys in grouped(scenes, lambda key: (key[0], scenes[key], key[2])).items():
        sentences[release].append(f"{names} with {', '.join(label for _, label, _ in keys)}: {words}")
    return sentences


def _shown(changes: Sequence[Change]) -> Change:
    """The change of a scene at the finest time step: of its leading error, else of the metric that changed most."""
    least = min(change.dt for change in changes)
    finest = [change for change in changes if change.dt == least]
    return next((change for change in finest if change.metric == leading(change.scene)), finest[0])


def _gained(change: Change) -> float:
    """The size of the change in digits; -1 if only one of the two releases has a value."""
    if not change.metric:
        return -1.0
    of = scale(problem(change.scene), METRICS[change.metric].unit)
    return abs(digits(abs(change.new) / of) - digits(abs(change.old) / of))


def _words(change: Change) -> str:
    if not change.metric:
        reason = change.now.reason if change.now.verdict != "measured" else f"before: {change.was.reason}"
        return f"{word(change.was.verdict)} → {word(change.now.verdict)} ({reason})"
    old, new, unit = formatted(change.old), formatted(change.new), METRICS[change.metric].unit
    moved = f"→ {with_unit(new, unit)}" if old != new else f"changed by {with_unit(formatted(change.new - change.old), unit)}"
    step = f"dt = {in_ms(change.dt)}".replace(" ", "\xa0")  # in one line
    return f"{change.metric.replace('_', ' ')} {old} {moved} at {step}"


def summary(release: Release, label: str, dt: float) -> list[str]:
    """Sentences on the scenes that an engine gets right and wrong in a release."""
    cases = release.at(label, dt)

    def group(scene: str) -> str:
        count, verdict = digits(relative_error(cases[scene], scene)), cases[scene].verdict
        without = "too coarse" if verdict == "measured" else word(verdict)  # as in `cell`
        return next((words for words, least in GROUPS.items() if count >= least), without)

    groups = grouped(cases, group)
    return [f"{words}: {', '.join(groups[words])}" for words in dict.fromkeys([*GROUPS, *groups]) if words in groups]


def changes_in_words(changed: Sequence[Change]) -> str:
    """The releases in which results changed, and the other releases in which scenes gained or lost their results."""
    numbers = list(dict.fromkeys(change.release for change in changed if change.metric))
    others = [release for release in dict.fromkeys(change.release for change in changed) if release not in numbers]
    parts = [f"results changed in {', '.join(numbers)}" if numbers else "no result changed"]
    return "; ".join(parts + ([f"scenes gained or lost results in {', '.join(others)}"] if others else []))


def badge(engine: str, release: Release, label: str, dt: float) -> dict[str, Any]:
    """The badge of an engine, as shields.io reads it: https://shields.io/badges/endpoint-badge."""
    errors = [relative_error(case, scene) for scene, case in release.at(label, dt).items()]
    known = [digits(error) for error in errors if not math.isnan(error)]
    message = f"median {np.median(known):.1f} digits in {len(known)} of {len(errors)} scenes" if known else "no scene"
    return {"schemaVersion": 1, "label": f"{engine} {release.name}", "message": message, "color": "blue" if known else "lightgrey"}
