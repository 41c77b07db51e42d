"""The output of `dropspin compare`: the changes between two runs."""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from dropspin.comparisons.regressions.changes import EqualMotions, SpeedChange
from dropspin.comparisons.regressions.comparing import Changes
from dropspin.comparisons.results.results import Results
from dropspin.reports.document import Document, Heading, Paragraph, Part, Sentences, Table
from dropspin.reports.stories.failures import reproduce_scenes
from dropspin.reports.stories.numbers import Row, capitalized, formatted, in_ms, subject
from dropspin.scenarios.text import counted

TITLES = {"worse": "Worse", "gone": "Gone", "moved": "Moved", "better": "Better", "lower": "Lower", "undefined": "Undefined", "new": "New"}
"""The heading of each kind of change, the worst kind first."""
MOST_LINES = 12
"""Largest number of lines of a table; JSON has all lines."""


def document(changes: Changes, results: Results) -> Document:
    """The changes of each kind, notes and the verdict; a terminal also shows the commands that repeat failing scenes."""
    by_engine = changes.regressions.groupby("engine", sort=False)["scene"].unique()
    commands = [
        Paragraph("Reproduce:", reproduce_scenes(results, list(scenes), str(engine)), on_page=False) for engine, scenes in by_engine.items()
    ]
    verdict, mark = _verdict(changes), "✗" if len(changes.regressions) else "✓"
    summary = [Sentences(_notes(changes)), Paragraph(verdict, on_page=False)]
    return Document(f"dropspin: {mark} {verdict}", [*_tables(changes), *commands], summary)


def _verdict(changes: Changes) -> str:
    regressed, total = len(changes.regressions), counted(len(changes.results), "result")
    are = "is" if regressed == 1 else "are"
    if regressed:
        return f"{regressed:,} of {total} {are} worse, moved or gone."
    return "The result is not worse." if len(changes.results) == 1 else f"None of {total} is worse."


def _tables(changes: Changes) -> Iterator[Part]:
    """A table for each kind of change, with the largest change of each engine in each scene."""
    for change, word in TITLES.items():
        changed = changes.of(change)
        groups = [group for _, group in changed.groupby(["engine", "scene"], sort=False)]  # which probably have one cause
        if groups:
            more = f", the first {MOST_LINES} of {len(groups)} pairs of a scene and an engine" if len(groups) > MOST_LINES else ""
            rows = [_row(group.iloc[0].to_dict(), len(group)) for group in groups[:MOST_LINES]]
            yield Heading(f"{word}: {counted(len(changed), 'result')}{more}", on_terminal=True)
            yield Table(rows)


def change_cells(row: Row) -> dict[str, str]:
    """The result that changed, its time step, and its values before and now."""
    return {
        "result": subject(row["metric"], row["kind"]),
        "step": "→ 0" if "," in row["steps"] else in_ms(float(row["steps"])),
        "before": formatted(row["before"]),
        "now": formatted(row["value"]),
    }


def _row(row: Row, count: int) -> dict[str, str]:
    """The largest change for an engine in a scene, and how many other results of this engine and scene have changed in the same way."""
    before, after = row["before"], row["value"]
    ratio = abs(after / before) if abs(before) > row["tolerance"] else math.inf  # a ratio of rounding errors is meaningless
    return {
        "scene": row["scene"],
        "engine": row["engine"],
        **change_cells(row),
        "ratio": _ratio(ratio) if math.isfinite(ratio) else "–",
        "tolerances": "–" if math.isnan(row["in_tolerances"]) else f"{row['in_tolerances']:.3g}",
        "others": counted(count - 1, "other result") if count > 1 else "–",
    }


def _ratio(ratio: float) -> str:
    """A ratio to three digits; of one near 1, those of its difference from 1."""
    return f"1 {'−' if ratio < 1.0 else '+'} {abs(ratio - 1.0):.2g}" if f"{ratio:.3g}" == "1" and ratio != 1.0 else f"{ratio:.3g}"


def _notes(changes: Changes) -> list[str]:
    """Sentences on the causes of changes, on what was not compared, on speeds, and on motions that are equal in both runs."""
    notes = []
    for engine, cause in changes.attributions.items():
        kinds = changes.results.loc[changes.results["engine"] == engine, "change"]
        counts = ", ".join(f"{count:,} {change}" for change in TITLES if (count := int((kinds == change).sum())))
        notes.append(f"{engine}: {counts}. {capitalized(cause.message)}.")
    notes += judged_otherwise(changes.judged_otherwise, "now")
    if changes.surroundings and not changes.attributions:
        notes.append(f"No result has changed, although these differ between the runs: {', '.join(changes.surroundings)}.")
    if changes.other_scenes:
        notes.append(f"Not compared, because these scenes have changed: {', '.join(changes.other_scenes)}.")
    if changes.in_one_only:
        notes.append(f"Not compared, because only one of the runs has them: {', '.join(changes.in_one_only)}.")
    notes += map(_speed, changes.speed)
    return notes + ([f"Motions equal bit for bit: {'; '.join(map(_motions, changes.motions))}."] if changes.motions else [])


def judged_otherwise(judged: Mapping[tuple[str, str, str], int], when: str) -> Iterator[str]:
    """For each kind of `Changes.judged_otherwise` a sentence; `when` is "now", or names the run."""
    for (engine, before, after), count in judged.items():
        are = counted(count, "result with the same value is", "results with the same values are")
        yield f"{engine}: {are} {when} {after} instead of {before}."


def _speed(change: SpeedChange) -> str:
    between = f"{change.least:.2f} to {change.most:.2f}" if math.isfinite(change.most) else "unbounded with so few cases"
    return (
        f"Speed (reported, not gated): relative to {change.other}, {change.engine} takes {change.ratio:.2f} times as long as before "
        f"(median of {counted(change.cases, 'case')}, 95 % interval {between})."
    )


def _motions(motions: EqualMotions) -> str:
    first = f", the first difference in {motions.scene} at {in_ms(motions.dt)} in step {motions.step:,}"
    return f"{motions.engine} {motions.equal:,} of {motions.compared:,}{first if motions.equal < motions.compared else ''}"


def as_data(changes: Changes) -> dict[str, Any]:
    """The comparison for JSON."""
    return {
        "results": changes.results[changes.results["change"] != "same"].to_dict("records"),
        "compared": len(changes.results),
        "attributed_to": {engine: {"origin": cause.origin, "message": cause.message} for engine, cause in changes.attributions.items()},
        "surroundings": changes.surroundings,
        "other_scenes": changes.other_scenes,
        "in_one_only": changes.in_one_only,
        "motions": [motions._asdict() for motions in changes.motions],
        "judged_otherwise": [
            {"engine": engine, "before": before, "now": after, "results": count}
            for (engine, before, after), count in changes.judged_otherwise.items()
        ],
        "speed": [change._asdict() for change in changes.speed],
    }
