"""Histories of runs: the runs in which each result changed, and the causes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import pandas as pd

from dropspin.comparisons.regressions.attribution import Attribution, attribute
from dropspin.comparisons.regressions.motions import digests_of, taken_together
from dropspin.comparisons.regressions.values import KEY, changes, comparable_results, most_changed_first, verify_comparable
from dropspin.comparisons.results.provenance import versions_behind
from dropspin.comparisons.results.results import Results
from dropspin.scenarios import DropspinError


@dataclass(frozen=True)
class Move:
    """A run in which results of an engine changed.

    Attributes:
        engine: Label of the engine.
        before: Number of the last earlier run that has this engine.
        run: Number of the run.
        results: The changes (worse, better or moved) that `values.changes` returns, largest first.
        attribution: The cause to which the changes are attributed.
    """

    engine: str
    before: int
    run: int
    results: pd.DataFrame
    attribution: Attribution


@dataclass(frozen=True, eq=False)
class History:
    """Runs in the order of their time.

    Attributes:
        names: Names of the runs.
        stamps: Time, commit and versions of each.
        results: The comparable results of all runs; `run` is the number.
        moves: The changes, in the order of the runs.
    """

    names: list[str]
    stamps: pd.DataFrame
    results: pd.DataFrame
    moves: list[Move]


def history(runs: Mapping[str, Results]) -> History:
    """Follow results over runs.

    Args:
        runs: Two or more runs, by name; they are sorted by start time.

    Returns:
        `names` of the runs in order; `stamps`, their times, commits and versions; `results`, the values of all runs; and `moves`, the
        runs in which results changed, and the cause to which each change is attributed.

    Raises:
        DropspinError: There are fewer than two runs, or one is quick.
    """
    if len(runs) < 2:
        raise DropspinError(f"a history needs two or more runs, got {len(runs)}; give more, or a folder of runs.")
    verify_comparable(*runs.values())
    ordered = sorted(runs.items(), key=lambda item: str(item[1].provenance["started"]))
    names, results = [name for name, _ in ordered], [one for _, one in ordered]
    stamps = [
        {"run": name, "started": one.provenance["started"], "commit": one.provenance["commit"]} | versions_behind(one.provenance)
        for name, one in ordered
    ]
    measured = [comparable_results(one) for one in results]
    every = pd.concat([rows.assign(run=number) for number, rows in enumerate(measured)], ignore_index=True)
    return History(names, pd.DataFrame(stamps), every, _moves(results, measured))


def _moves(results: Sequence[Results], results_of: Sequence[pd.DataFrame]) -> list[Move]:
    """The runs in which results changed.

    Each result is compared with its value after its last change, so that slow drifts are found, and runs without the result have no effect.
    """
    engines = list(dict.fromkeys(engine for one in results for engine in one.engines))
    held = dict.fromkeys(engines, results_of[0].iloc[:0])
    scenes: dict[str, str] = {}
    last: dict[str, int] = {}
    found = []
    for run, one in enumerate(results):
        digests = {name: scene.digest for name, scene in one.scenes.items()}
        other = {name for name, digest in digests.items() if scenes.get(name, digest) != digest}
        scenes |= digests
        held = {engine: rows[~rows["scene"].isin(other)] for engine, rows in held.items()}
        measured = {str(engine): rows for engine, rows in results_of[run].groupby("engine", sort=False)}
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
                motions = taken_together(differing, *map(digests_of, stamps))
                found.append(Move(engine, last[engine], run, differing, attribute(*stamps, engine, unmoved, motions)))
        last |= dict.fromkeys(measured, run)
    return found
