"""The output of `dropspin compare`: the changes between two runs as tables, sentences, and data for JSON."""

import math
from collections.abc import Hashable, Mapping
from typing import Any

import pandas as pd

from dropspin.comparisons.regressions.comparing import Changes
from dropspin.comparisons.regressions.motions import EqualMotions
from dropspin.comparisons.regressions.speed import SpeedChange
from dropspin.comparisons.results.results import Results
from dropspin.reports.views.failures import reproduce_scenes
from dropspin.reports.views.numbers import formatted, subject
from dropspin.scenarios.text import counted

TITLES = {"worse": "Worse", "gone": "Gone", "moved": "Moved", "better": "Better", "new": "New"}
"""The heading of each kind of change, the worst kind first."""
MOST_LINES = 12
"""Largest number of lines of a table; JSON has all lines."""


def listed(changes: Changes) -> list[str]:
    """The changes as lines, one for each engine and scene, under a heading for each kind."""
    listed = []
    for title, lines in tables(changes):
        listed.append(title)
        listed += [
            f"  {line['scene']} · {line['engine']}: {line['result']} at {line['step']} from {line['before']} to {line['now']}"
            f"{'' if line['ratio'] == '–' else ', ' + line['ratio'] + ' times'}"
            f"{'' if line['tolerances'] == '–' else ', ' + line['tolerances'] + ' times its tolerance away'}"
            f"{'' if line['others'] == '–' else '; and ' + line['others']}"
            for line in lines
        ]
    return listed


def tables(changes: Changes) -> list[tuple[str, list[dict[str, str]]]]:
    """The title and the rows of a table for each kind of change that occurs."""
    found = []
    for change, word in TITLES.items():
        results = changes.of(change)
        if len(results):
            lines = _lines(results)
            more = f", the first {MOST_LINES} of {len(lines)} scenes and engines" if len(lines) > MOST_LINES else ""
            found.append((f"{word}: {counted(len(results), 'result')}{more}", lines[:MOST_LINES]))
    return found


def sentences(changes: Changes) -> list[str]:
    """Sentences on the attributions, the scenes that were not compared, the speeds, and, last, the verdict."""
    found = [
        f"{engine}: {_counted(changes, engine)}. {one.message[0].upper()}{one.message[1:]}." for engine, one in changes.attributions.items()
    ]
    if changes.surroundings and not changes.attributions:
        found.append(f"No result has changed, although these differ between the runs: {', '.join(changes.surroundings)}.")
    if changes.other_scenes:
        found.append(f"Not compared, because these scenes have changed: {', '.join(changes.other_scenes)}.")
    if changes.in_one_only:
        found.append(f"In one of the runs only: {', '.join(changes.in_one_only)}.")
    found += [_speed(change) for change in changes.speed]
    if changes.motions:
        found.append(f"Motions equal bit for bit: {'; '.join(map(_motions, changes.motions))}.")
    regressed = changes.regressions
    total = counted(len(changes.results), "result")
    are = "is" if len(regressed) == 1 else "are"
    verdict = f"{len(regressed):,} of {total} {are} worse, moved or gone" if len(regressed) else f"None of {total} is worse"
    return [*found, f"{verdict}."]


def commands(changes: Changes, results: Results) -> list[str]:
    """For each engine with results that are worse, moved or gone, the command that runs the scenes of these results again."""
    by_engine = changes.regressions.groupby("engine", sort=False)["scene"].unique()
    return [f"Reproduce: {reproduce_scenes(results, list(scenes), str(engine))}" for engine, scenes in by_engine.items()]


def as_data(changes: Changes) -> dict[str, Any]:
    """The comparison for JSON; undefined numbers are None."""
    differing = changes.results[changes.results["change"] != "same"]
    results = [{str(key): _plain(value) for key, value in row.items()} for row in differing.to_dict("records")]
    return {
        "results": results,
        "compared": len(changes.results),
        "attributed_to": {engine: {"origin": one.origin, "message": one.message} for engine, one in changes.attributions.items()},
        "surroundings": changes.surroundings,
        "other_scenes": changes.other_scenes,
        "in_one_only": changes.in_one_only,
        "motions": [one._asdict() for one in changes.motions],
        "speed": [{key: _plain(value) for key, value in change._asdict().items()} for change in changes.speed],
    }


def _lines(results: pd.DataFrame) -> list[dict[str, str]]:
    """A line for each engine and scene, with its largest change and the number of others, which probably have the same cause."""
    return [_line(group.iloc[0].to_dict(), len(group)) for _, group in results.groupby(["engine", "scene"], sort=False)]


def _line(row: Mapping[Hashable, Any], count: int) -> dict[str, str]:
    before, after = row["before"], row["value"]
    ratio = abs(after / before) if abs(before) > row["tolerance"] else math.inf  # a ratio of rounding errors is meaningless
    return {
        "scene": row["scene"],
        "engine": row["engine"],
        "result": subject(row["metric"], row["kind"]),
        "step": "→ 0" if "," in row["steps"] else f"{1e3 * float(row['steps']):g} ms",
        "before": formatted(before),
        "now": formatted(after),
        "ratio": f"{ratio:.3g}" if math.isfinite(ratio) else "–",
        "tolerances": "–" if math.isnan(row["in_tolerances"]) else f"{row['in_tolerances']:.3g}",
        "others": counted(count - 1, "other result") if count > 1 else "–",
    }


def _counted(changes: Changes, engine: str) -> str:
    mine = changes.results.loc[changes.results["engine"] == engine, "change"]
    return ", ".join(f"{int((mine == change).sum()):,} {change}" for change in TITLES if (mine == change).any())


def _speed(change: SpeedChange) -> str:
    between = f"{change.least:.2f} to {change.most:.2f}" if math.isfinite(change.most) else "unbounded with so few cases"
    return (
        f"Speed (reported, not gated): {change.engine} relative to {change.other} takes {change.ratio:.2f} times as long as before "
        f"(median of {counted(change.cases, 'case')}, 95 % interval {between})."
    )


def _motions(one: EqualMotions) -> str:
    first = f", the first difference in {one.scene} at {1e3 * one.dt:g} ms in step {one.step:,}" if one.equal < one.compared else ""
    return f"{one.engine} {one.equal:,} of {one.compared:,}{first}"


def _plain(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value
