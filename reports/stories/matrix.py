"""The matrix of a run: a row for each scene, a cell for each engine with its status and the leading error."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from dropspin.comparisons.judging.verdicts import BREAKDOWNS, FAILURES, VERDICTS
from dropspin.comparisons.results.results import UNDECIDED, Results, Status
from dropspin.reports.stories.leading_errors import leading_errors
from dropspin.reports.stories.numbers import formatted, in_ms, quantity, unit

MOST_SCENES = 24
"""Largest number of rows. Of more scenes, those in which no engine has a finding are left out first, then those with the least severe
findings.
"""
WITHOUT_FINDING = frozenset({"passed", "measured", "declined", "no_truth"})


@dataclass(frozen=True)
class MatrixRow:
    """A scene: the quantity whose errors are shown, and for each engine, in order, the mark of its status and the size of its error."""

    scene: str
    quantity: str
    cells: list[tuple[str, str]]
    fails: bool


@dataclass(frozen=True)
class Matrix:
    """The rows of a matrix, a heading for the errors, the meaning of the marks, and a sentence on the scenes left out."""

    rows: list[MatrixRow]
    title: str
    legend: str
    left_out: str


def matrix(results: Results, statuses: Mapping[str, Mapping[str, Status]]) -> Matrix:
    """The matrix of a run, of at most `MOST_SCENES` scenes."""
    scenes, left_out = _shown(statuses)
    leading = leading_errors(results)
    rows = []
    for scene in scenes:
        errors, by_engine = leading.get(scene), statuses[scene]
        of = quantity(errors.metric) + unit(errors.unit) if errors else ""
        sizes = {engine: formatted(size) for engine, size in errors.sizes.items() if not math.isnan(size)} if errors else {}
        cells = [(status.mark, sizes.get(engine, "")) for engine, status in by_engine.items()]
        rows.append(MatrixRow(scene, of, cells, any(status.verdict in FAILURES | BREAKDOWNS for status in by_engine.values())))
    steps = sorted({in_ms(errors.dt) for errors in leading.values()})
    legend = legend_of_marks({scene: statuses[scene] for scene in scenes})
    return Matrix(rows, f"error at dt = {' or '.join(steps)}" if steps else "", legend, left_out)


def legend_of_marks(statuses: Mapping[str, Mapping[str, Status]]) -> str:
    """The meaning of each mark, least severe first; one mark stands for known model errors and other known faults."""
    shown = [status for by_engine in statuses.values() for status in by_engine.values()]
    meant = {(status.verdict, status.mark, "known error" if status.verdict == "known" else status.words) for status in shown}
    marks = sorted(((VERDICTS.index(verdict), mark, words) for verdict, mark, words in meant), reverse=True)
    words: dict[str, dict[str, None]] = {}
    for _, mark, status in marks:
        words.setdefault(mark, {})[status] = None
    return ", ".join(f"{mark} {' or '.join(meanings)}" for mark, meanings in words.items())


def _shown(statuses: Mapping[str, Mapping[str, Status]]) -> tuple[list[str], str]:
    """The scenes that have a row, and a sentence on the others."""
    if len(statuses) <= MOST_SCENES:
        return list(statuses), ""
    found = [scene for scene, by_engine in statuses.items() if any(map(_is_finding, by_engine.values()))]
    worst = sorted(found, key=lambda scene: min(VERDICTS.index(status.verdict) for status in statuses[scene].values()))[:MOST_SCENES]
    fine, more = len(statuses) - len(found), len(found) - len(worst)
    left_out = [f"{fine} in which no engine has a finding"] * bool(fine) + [f"{more} with less severe findings"] * bool(more)
    return [scene for scene in statuses if scene in worst], f"Scenes not shown: {', '.join(left_out)}."


def _is_finding(status: Status) -> bool:
    return status.verdict not in WITHOUT_FINDING or status.words == UNDECIDED
