"""What changed between two runs, for people: tables, sentences, Markdown, and data for programs."""

import math
from collections.abc import Hashable, Mapping
from typing import Any

import pandas as pd

from comparisons.regressions.comparing import Changes
from comparisons.regressions.speed import SpeedChange
from reports.html import page
from reports.numbers import subject, written

TITLES = {"worse": "Worse", "gone": "Gone", "moved": "Moved", "better": "Better", "new": "New"}
"""What is told of each kind of change, worst first."""
AT_MOST = 12
"""Lines of a table; JSON has them all."""


def listed(changes: Changes) -> list[str]:
    """What changed, a line for each metric of an engine in a scene, under a line for each kind of change."""
    told = []
    for title, lines in tables(changes):
        told.append(title)
        told += [
            f"  {line['scene']} · {line['engine']}: {line['figure']} at {line['step']} from {line['before']} to {line['now']}"
            f"{'' if line['ratio'] == '–' else ', ' + line['ratio'] + ' times'}"
            f"{'' if line['tolerances'] == '–' else ', ' + line['tolerances'] + ' times its tolerance away'}"
            for line in lines
        ]
    return told


def tables(changes: Changes) -> list[tuple[str, list[dict[str, str]]]]:
    """A title and rows for each kind of change that there is."""
    found = []
    for change, word in TITLES.items():
        figures = changes.of(change)
        if len(figures):
            lines = _lines(figures)
            more = f", the first {AT_MOST} of {len(lines)} kinds" if len(lines) > AT_MOST else ""
            found.append((f"{word}: {_figures(len(figures))}{more}", lines[:AT_MOST]))
    return found


def sentences(changes: Changes, fail_speed: float | None) -> list[str]:
    """What the changes are put down to, what was not compared, what became of the speed, and the verdict."""
    told = [f"{engine}: {_counted(changes, engine)}. {blame.said[0].upper()}{blame.said[1:]}." for engine, blame in changes.blames.items()]
    if changes.surroundings and not changes.blames:
        told.append(f"No figure has changed, though these differ: {', '.join(changes.surroundings)}.")
    if changes.other_scenes:
        told.append(f"Not compared, as they simulate something else now: {', '.join(changes.other_scenes)}.")
    if changes.in_one_only:
        told.append(f"In one of the runs only: {', '.join(changes.in_one_only)}.")
    told += [_speed(change, fail_speed) for change in changes.speed]
    regressed = changes.regressions
    total = _figures(len(changes.figures))
    verdict = f"{len(regressed):,} of {total} are worse, moved or gone" if len(regressed) else f"None of {total} is worse"
    slower = [] if fail_speed is None else changes.slower(fail_speed)
    late = f"; slower than allowed: {', '.join(change.engine for change in slower)}" if slower else ""
    return [*told, f"{verdict}{late}."]


def summary(changes: Changes, fail_speed: float | None) -> str:
    """The same as Markdown that fits a comment on a pull request."""
    found = tables(changes)
    held = not len(changes.regressions) and not (fail_speed is not None and changes.slower(fail_speed))
    return page("compare.md", held=held, tables=found, sentences=sentences(changes, fail_speed))


def as_data(changes: Changes) -> dict[str, Any]:
    """Everything, for JSON; what is no number is None."""
    differing = changes.figures[changes.figures["change"] != "same"]
    figures = [{str(key): _plain(value) for key, value in row.items()} for row in differing.to_dict("records")]
    return {
        "figures": figures,
        "compared": len(changes.figures),
        "put_down_to": {engine: {"culprit": blame.culprit, "said": blame.said} for engine, blame in changes.blames.items()},
        "surroundings": changes.surroundings,
        "other_scenes": changes.other_scenes,
        "in_one_only": changes.in_one_only,
        "speed": [{key: _plain(value) for key, value in change._asdict().items()} for change in changes.speed],
    }


def _lines(figures: pd.DataFrame) -> list[dict[str, str]]:
    """A line for each metric of an engine in a scene: the figure of it that has changed most."""
    return [_line(group.iloc[0].to_dict(), len(group)) for _, group in figures.groupby(["engine", "scene", "metric", "kind"], sort=False)]


def _line(row: Mapping[Hashable, Any], count: int) -> dict[str, str]:
    before, after = row["before"], row["value"]
    ratio = abs(after / before) if abs(before) > row["tolerance"] else math.inf  # of what is rounding a ratio says nothing
    return {
        "scene": row["scene"],
        "engine": row["engine"],
        "figure": subject(row["metric"], row["kind"]),
        "step": "→ 0" if "," in row["steps"] else f"{1e3 * float(row['steps']):g} ms" + (f" and {count - 1} more" if count > 1 else ""),
        "before": written(before),
        "now": written(after),
        "ratio": f"{ratio:.3g}" if math.isfinite(ratio) else "–",
        "tolerances": "–" if math.isnan(row["in_tolerances"]) else f"{row['in_tolerances']:.3g}",
    }


def _counted(changes: Changes, engine: str) -> str:
    mine = changes.figures.loc[changes.figures["engine"] == engine, "change"]
    return ", ".join(f"{int((mine == change).sum()):,} {change}" for change in TITLES if (mine == change).any())


def _speed(change: SpeedChange, fail_speed: float | None) -> str:
    between = f"{change.least:.2f} to {change.most:.2f}" if math.isfinite(change.most) else "an interval that so few cases do not bound"
    judged = "" if fail_speed is None else f", allowed {1.0 + fail_speed:.2f}"
    return (
        f"Speed: {change.engine} beside {change.beside} takes {change.ratio:.2f} times what it took "
        f"(median of {change.cases}, {between}){judged}."
    )


def _figures(count: int) -> str:
    return f"{count:,} figure{'' if count == 1 else 's'}"


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
