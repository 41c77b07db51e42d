"""Histories of runs: the runs in which results changed, and the causes to which the changes are attributed."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import pandas as pd

from dropspin.comparisons.regressions.attribution import Attribution
from dropspin.comparisons.regressions.changes import KEY, asked_for, changes, comparable_results, most_changed_first, verify_comparable
from dropspin.comparisons.regressions.comparing import attributed, judged_otherwise, results_in_common, unmoved_engines
from dropspin.comparisons.results.provenance import versions_behind
from dropspin.comparisons.results.results import Results
from dropspin.comparisons.results.table import are_among
from dropspin.scenarios import DropspinError

CHANGED = ["worse", "moved", "better", "gone"]
"""The kinds of change that a history lists."""

DEFINED = [*KEY, "scene_digest"]
"""The columns that identify a result of several runs."""


class Move(NamedTuple):
    """A run in which results of an engine changed.

    Attributes:
        engine: Label of the engine.
        before: Number of the last earlier run from which these results differ by more than their tolerance.
        run: Number of the run in which the results changed.
        results: The changes (worse, better, moved or gone) since then that `changes.changes` returns, largest first.
        attribution: The cause to which the changes are attributed.
    """

    engine: str
    before: int
    run: int
    results: pd.DataFrame
    attribution: Attribution


class History(NamedTuple):
    """The results of several runs in the order of their start times.

    Attributes:
        names: Names of the runs.
        stamps: Time, commit and versions of each run.
        results: The comparable results of all runs; `run` is the number of the run, `scene_digest` a hash of the scene's physics.
        moves: The changes, in the order of the runs.
        judged_otherwise: For each run but the first, the results with the value of the run before that are judged otherwise, as in
            `comparing.Changes`.
    """

    names: list[str]
    stamps: pd.DataFrame
    results: pd.DataFrame
    moves: list[Move]
    judged_otherwise: Sequence[Mapping[tuple[str, str, str], int]]


def history(runs: Mapping[str, Results]) -> History:
    """Compare the results of several runs over time.

    Args:
        runs: Two or more runs, by name; they are sorted by start time.

    Returns:
        `names` of the runs in order; `stamps`, their times, commits and versions; `results`, the values of all runs; and `moves`, the
        runs in which results changed, and the cause to which each change is attributed; `judged_otherwise`, how many unchanged results are
        judged otherwise in each run.

    Raises:
        DropspinError: There are fewer than two runs, or one of them was made with `quick`.
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
    measured = [_defined(comparable_results(one), one) for one in results]
    every = pd.concat([rows.assign(run=number) for number, rows in enumerate(measured)], ignore_index=True)
    judged = [judged_otherwise(before, now, results_in_common(before, now)) for before, now in pairwise(results)]
    return History(names, pd.DataFrame(stamps), every, _moves(results, measured), judged)


def _defined(rows: pd.DataFrame, run: Results) -> pd.DataFrame:
    """Results with the hash of the physics that their scene has in a run."""
    return rows.assign(scene_digest=rows["scene"].map({name: scene.digest for name, scene in run.scenes.items()}))


def _of_same_scenes(rows: pd.DataFrame, run: Results) -> pd.DataFrame:
    """The results of scenes that have the same physics in a run."""
    return rows[rows["scene_digest"] == _defined(rows, run)["scene_digest"]]


def _moves(results: Sequence[Results], results_of: Sequence[pd.DataFrame]) -> list[Move]:
    """The runs in which results changed.

    Each result is compared with its value after its last change, so that slow drifts are found. Runs that did not request the result have
    no effect; in the first one in which the engine broke down or declined the scene, it is gone. Results of a scene with another
    definition are other results.
    """
    held: dict[str, pd.DataFrame] = {}
    absent: dict[str, list[tuple[str, ...]]] = {}
    found = []
    for run, one in enumerate(results):
        for engine in one.engines:
            now = results_of[run][results_of[run]["engine"] == engine]
            earlier = held.get(engine, now.iloc[:0])
            before = asked_for(_of_same_scenes(earlier, one), one)
            change = _defined(changes(before, now), one)
            keys, is_gone = pd.MultiIndex.from_frame(change[DEFINED]), change["change"] == "gone"
            was_gone = is_gone & keys.isin(absent.get(engine, []))
            absent[engine] = [*set(absent.get(engine, [])).difference(keys), *keys[is_gone]]
            for number, rows in _since(change.loc[change["change"].isin(CHANGED) & ~was_gone, DEFINED], results_of[:run], now):
                cause = attributed(rows, results[number], one, engine, unmoved_engines(results_in_common(results[number], one)))
                found.append(Move(engine, number, run, rows, cause))
            stays = change["change"].isin(["same", "gone", "undefined"])
            kept, fresh = before.merge(change.loc[stays, KEY], on=KEY), now.merge(change.loc[~stays, KEY], on=KEY)
            held[engine] = pd.concat([earlier.drop(before.index), kept, fresh], ignore_index=True)
    return found


def _since(keys: pd.DataFrame, earlier: Sequence[pd.DataFrame], now: pd.DataFrame) -> Iterator[tuple[int, pd.DataFrame]]:
    """The changes of some results, each since the last earlier run from which it differs by more than its tolerance, by these runs.

    Of a slow drift that is not the run before, which alone may not have caused the change.
    """
    for number, rows in reversed(list(enumerate(earlier))):
        found = changes(rows.merge(keys, on=DEFINED), now.merge(keys, on=DEFINED))
        found = found[found["change"].isin(CHANGED)]
        if len(found):
            yield number, most_changed_first(found)
            keys = keys[~are_among(keys, found, KEY)]
        if keys.empty:
            return
