"""`dropspin sweep` in words: for each engine the verdicts of its jobs, and the worst values measured."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from comparisons.judging.verdicts import BREAKDOWNS
from comparisons.sweeps.running import read_parts
from reports.views.numbers import formatted, word

WORST = ("energy_drift", "energy_gain", "penetration")


@dataclass
class Tally:
    """One engine's jobs: their verdicts, the worst values, and the time they took [s]."""

    verdicts: Counter[str] = field(default_factory=Counter)
    worst: dict[str, float] = field(default_factory=dict)
    time: float = 0.0


def tallies(where: str) -> dict[str, Tally]:
    """The tallies by engine, counted part by part, as the table may be larger than memory."""
    found: dict[str, Tally] = {}
    for part in read_parts(where, ["engine", "verdict", "steps", "time_per_step", *WORST]):
        frame = part.to_pandas()
        for engine, rows in frame.groupby("engine", sort=False):
            tally = found.setdefault(str(engine), Tally())
            tally.verdicts.update(rows["verdict"])
            tally.time += float((rows["steps"] * rows["time_per_step"]).sum())
            for name in WORST:
                sizes = rows[name].abs()
                if sizes.notna().any():
                    tally.worst[name] = max(tally.worst.get(name, 0.0), float(sizes.max()))
    return found


def summary_rows(found: dict[str, Tally]) -> list[dict[str, Any]]:
    """Rows of numbers; None where there is no value."""
    return [
        {"engine": engine, "jobs": tally.verdicts.total(), "verdicts": dict(tally.verdicts)}
        | {f"worst_{name}": tally.worst.get(name) for name in WORST}
        | {"time": tally.time}
        for engine, tally in found.items()
    ]


def formatted_rows(found: dict[str, Tally]) -> list[dict[str, str]]:
    """Rows of words."""
    return [
        {
            "engine": engine,
            "jobs": f"{tally.verdicts.total():,}",
            "verdicts": ", ".join(f"{count:,} {word(verdict)}" for verdict, count in tally.verdicts.most_common()),
        }
        | {f"worst {name.replace('_', ' ')}": formatted(tally.worst.get(name, np.nan)) for name in WORST}
        for engine, tally in found.items()
    ]


def exit_code(found: dict[str, Tally]) -> int:
    """0: all jobs were run; 3: an engine broke down in one."""
    return 3 if any(tally.verdicts.keys() & BREAKDOWNS for tally in found.values()) else 0
