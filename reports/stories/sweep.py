"""The summary of `dropspin sweep`: for each engine the verdicts of its jobs, and the worst values measured."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from dropspin.comparisons.sweeps.folder import read_sweep_parts
from dropspin.reports.document import Document, Table
from dropspin.reports.stories.numbers import formatted, word
from dropspin.reports.stories.study import Records

WORST_OF = {metric: f"worst_{metric}" for metric in ("energy_drift", "energy_gain", "penetration")}


def rows(where: str) -> Records:
    """A row for each engine: its jobs, their verdicts, the largest values of `WORST_OF` (None if undefined), and the time of all steps [s].

    The table is read part by part, because it may be larger than memory.
    """
    by_engine: dict[str, dict[str, Any]] = {}
    for part in read_sweep_parts(where, ["engine", "verdict", "steps", "time_per_step", *WORST_OF]):
        for engine, jobs in part.to_pandas().groupby("engine", sort=False):
            first = {"engine": engine, "jobs": 0, "verdicts": Counter()} | dict.fromkeys(WORST_OF.values()) | {"time": 0.0}
            row = by_engine.setdefault(str(engine), first)
            row["jobs"] += len(jobs)
            row["verdicts"].update(jobs["verdict"])
            row["time"] += float((jobs["steps"] * jobs["time_per_step"]).sum())
            for metric, name in WORST_OF.items():
                if not math.isnan(largest := float(jobs[metric].abs().max())):
                    row[name] = max(row[name] or 0.0, largest)
    return list(by_engine.values())


def document(table: Sequence[Mapping[str, Any]]) -> Document:
    """A table of the rows."""
    columns = {name.replace("_", " "): name for name in WORST_OF.values()}
    shown = [
        {
            "engine": row["engine"],
            "jobs": f"{row['jobs']:,}",
            "verdicts": ", ".join(f"{count:,} {word(verdict)}" for verdict, count in row["verdicts"].most_common()),
            **{column: formatted(math.nan if row[name] is None else row[name]) for column, name in columns.items()},
        }
        for row in table
    ]
    return Document("Jobs", [Table(shown, left_out_first=[*reversed(columns)])])
