"""Figures over runs: when each moved, and what that is put down to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from comparisons.provenance import versions_behind
from comparisons.regressions.differences import Blame, blame
from comparisons.regressions.figures import KEY, changes, figures, most_changed_first
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
    measured = [figures(one) for one in results]
    every = pd.concat([rows.assign(run=number) for number, rows in enumerate(measured)], ignore_index=True)
    return History(names, pd.DataFrame(stamps), every, _moves(results, measured))


def _moves(results: Sequence[Results], figures_of: Sequence[pd.DataFrame]) -> list[Move]:
    """Where figures moved: each is held against what it last moved to, so no slow drift escapes, and no run that lacks it hides one."""
    engines = list(dict.fromkeys(engine for one in results for engine in one.engines))
    held = dict.fromkeys(engines, figures_of[0].iloc[:0])
    scenes: dict[str, str] = {}
    last: dict[str, int] = {}
    found = []
    for run, one in enumerate(results):
        digests = {name: scene.digest for name, scene in one.scenes.items()}
        other = {name for name, digest in digests.items() if scenes.get(name, digest) != digest}
        scenes |= digests
        held = {engine: rows[~rows["scene"].isin(other)] for engine, rows in held.items()}
        measured = {str(engine): rows for engine, rows in figures_of[run].groupby("engine", sort=False)}
        moved = {}
        for engine, now in measured.items():
            before = held[engine]
            change = changes(before, now)
            moved[engine] = most_changed_first(change[change["change"].isin(["worse", "moved", "better"])])
            stays = change[change["change"].isin(["same", "gone"])]
            kept = before.merge(stays[KEY], on=KEY)
            fresh = now.merge(change[~change["change"].isin(["same", "gone"])][KEY], on=KEY)
            held[engine] = pd.concat([kept, fresh], ignore_index=True) if len(kept) else fresh
        unmoved = [engine for engine, differing in moved.items() if differing.empty and engine in last]
        for engine, differing in moved.items():
            if len(differing):
                stamps = results[last[engine]].provenance, one.provenance
                found.append(Move(engine, last[engine], run, differing, blame(*stamps, engine, unmoved)))
        last |= dict.fromkeys(measured, run)
    return found
