"""The summary of `dropspin sweep`: for each engine the verdicts of its jobs, and the worst values measured."""

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from dropspin.comparisons.judging.verdicts import BREAKDOWNS
from dropspin.comparisons.sweeps.folder import read_sweep_parts
from dropspin.reports.document import Document, Table
from dropspin.reports.stories.numbers import formatted, word

WORST_OF = ("energy_drift", "energy_gain", "penetration")


@dataclass
class Tally:
    """The jobs of one engine: their verdicts, the largest magnitudes of some metrics, and their total time [s]."""

    verdicts: Counter[str] = field(default_factory=Counter)
    worst: dict[str, float] = field(default_factory=dict)
    time: float = 0.0


def tallies(where: str) -> dict[str, Tally]:
    """The tally of each engine; the table is read part by part, because it may be larger than memory."""
    found: dict[str, Tally] = {}
    for part in read_sweep_parts(where, ["engine", "verdict", "steps", "time_per_step", *WORST_OF]):
        frame = part.to_pandas()
        for engine, rows in frame.groupby("engine", sort=False):
            tally = found.setdefault(str(engine), Tally())
            tally.verdicts.update(rows["verdict"])
            tally.time += float((rows["steps"] * rows["time_per_step"]).sum())
            for name in WORST_OF:
                magnitudes = rows[name].abs()
                if magnitudes.notna().any():
                    tally.worst[name] = max(tally.worst.get(name, 0.0), float(magnitudes.max()))
    return found


def summary_rows(found: dict[str, Tally]) -> list[dict[str, Any]]:
    """The tallies as rows of numbers; None where there is no value."""
    return [
        {"engine": engine, "jobs": tally.verdicts.total(), "verdicts": dict(tally.verdicts)}
        | {f"worst_{name}": tally.worst.get(name) for name in WORST_OF}
        | {"time": tally.time}
        for engine, tally in found.items()
    ]


def document(found: dict[str, Tally]) -> Document:
    """The tallies."""
    columns = {f"worst {name.replace('_', ' ')}": name for name in WORST_OF}
    rows = [
        {
            "engine": engine,
            "jobs": f"{tally.verdicts.total():,}",
            "verdicts": ", ".join(f"{count:,} {word(verdict)}" for verdict, count in tally.verdicts.most_common()),
            **{column: formatted(tally.worst.get(name, math.nan)) for column, name in columns.items()},
        }
        for engine, tally in found.items()
    ]
    return Document("Jobs", [Table(rows, left_out_first=[*reversed(columns)])])


def exit_code(found: dict[str, Tally]) -> int:
    """The exit code: 0 if all jobs were run, 3 if an engine broke down in any job."""
    return 3 if any(tally.verdicts.keys() & BREAKDOWNS for tally in found.values()) else 0
