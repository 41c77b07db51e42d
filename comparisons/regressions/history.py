"""Figures over runs: when each moved, and what that is put down to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import pandas as pd

from comparisons.provenance import versions_behind
from comparisons.regressions.comparing import Changes, compare
from comparisons.regressions.differences import Blame
from comparisons.regressions.figures import figures
from comparisons.results import Results
from scenarios import DropspinError


@dataclass(frozen=True)
class Move:
    """A run in which figures of an engine moved.

    Attributes:
        engine: Label of the engine.
        before: Number of the earlier run, the last one that has the engine.
        run: Number of the run.
        figures: What changed: worse, better or moved, most changed first, as `regressions.changes` has it.
        blame: What it is put down to.
    """

    engine: str
    before: int
    run: int
    figures: pd.DataFrame
    blame: Blame


@dataclass(frozen=True, eq=False)
class History:
    """Runs in the order of their time.

    Attributes:
        names: Of the runs.
        stamps: What tells each from the one before: time, commit, and versions.
        figures: As `regressions.figures` has them, of all runs; `run` is the number.
        moves: In the order of the runs.
    """

    names: list[str]
    stamps: pd.DataFrame
    figures: pd.DataFrame
    moves: list[Move]


def history(runs: Mapping[str, Results]) -> History:
    """Follow figures over runs.

    Args:
        runs: By name; they are put in the order of when they were started.

    Raises:
        DropspinError: There are fewer than two.
    """
    if len(runs) < 2:
        raise DropspinError(
            f"a history takes two runs or more, and here {'is one' if runs else 'are none'}; give more, or a folder of runs."
        )
    ordered = sorted(runs.items(), key=lambda item: str(item[1].provenance["started"]))
    names, results = [name for name, _ in ordered], [one for _, one in ordered]
    stamps = [
        {"run": name, "started": one.provenance["started"], "commit": one.provenance["commit"]} | versions_behind(one.provenance)
        for name, one in ordered
    ]
    every = pd.concat([figures(one).assign(run=number) for number, one in enumerate(results)], ignore_index=True)
    return History(names, pd.DataFrame(stamps), every, _moves(results))


def _moves(results: Sequence[Results]) -> list[Move]:
    compared: dict[tuple[int, int], Changes] = {}
    found = []
    for engine in dict.fromkeys(engine for one in results for engine in one.engines):
        having = [number for number, one in enumerate(results) if engine in one.provenance["settings"]]
        for before, run in pairwise(having):
            if (before, run) not in compared:
                compared[before, run] = compare(results[before], results[run])
            changes = compared[before, run]
            moved = changes.of("worse", "moved", "better")
            moved = moved[moved["engine"] == engine]
            if len(moved):
                found.append(Move(engine, before, run, moved, changes.blames[engine]))
    return sorted(found, key=lambda move: (move.run, move.engine))
