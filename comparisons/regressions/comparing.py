"""Two runs compared, and histories of runs: the results that changed, and the causes to which the changes are attributed."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import pandas as pd

from dropspin.comparisons.regressions.attribution import Attribution, attribute, surroundings
from dropspin.comparisons.regressions.changes import (
    KEY,
    EqualMotions,
    Motion,
    SpeedChange,
    asked_for,
    changes,
    comparable_results,
    compared_digests,
    digests_of,
    equal_motions,
    most_changed_first,
    regressed,
    speed_changes,
    verify_comparable,
)
from dropspin.comparisons.results.provenance import versions_behind
from dropspin.comparisons.results.results import Results
from dropspin.scenarios import DropspinError

CHANGED = ["worse", "moved", "better", "gone"]
"""The kinds of change that a history lists."""


class Changes(NamedTuple):
    """The differences between two runs.

    Attributes:
        results: The table of comparable results that `changes.changes` returns, largest change first.
        attributions: For each engine, the cause to which its changes are attributed.
        surroundings: The differences that affect all engines, as text.
        other_scenes: Scenes whose definition differs between the runs, so their results are not compared.
        in_one_only: Scenes, engines and time steps that were requested in only one of the runs, as text.
        speed: For pairs of engines, the change of the ratio of their times per step.
        motions: How many motions of each engine are equal bit for bit in both runs; empty if the runs were loaded without trajectories.
    """

    results: pd.DataFrame
    attributions: Mapping[str, Attribution]
    surroundings: list[str]
    other_scenes: list[str]
    in_one_only: list[str]
    speed: list[SpeedChange]
    motions: list[EqualMotions]

    def of(self, *kinds: str) -> pd.DataFrame:
        """The results with the given kinds of change."""
        return self.results[self.results["change"].isin(kinds)]

    @property
    def regressions(self) -> pd.DataFrame:
        """The results that make the comparison fail: those that are worse, moved or gone."""
        return regressed(self.results)


def compare(old: Results, new: Results) -> Changes:
    """Compare a run with an earlier one.

    Results of scenes, engines and time steps that were requested in only one of the two runs are left out; they do not count as new or
    gone.

    Args:
        old: The earlier run.
        new: The later run.

    Returns:
        The changes: `results`, a table with `value` and `before` in `unit`, and the `change` (same, better, worse, moved, new, gone or
        undefined); `attributions`, the cause to which the changes of each engine are attributed; `speed`, the change of the ratio of the
        times per step of two engines; and `motions`, how many motions are equal bit for bit in both runs.

    Raises:
        DropspinError: The runs have no scene, engine and time step in common, or one of them was made with `quick`.
    """
    verify_comparable(old, new)
    other, found = _changed_scenes(old, new), _in_common(old, new)
    if found.empty:
        why = f"{', '.join(other)} changed between them" if other else "no scene, engine and time step was requested in both"
        raise DropspinError(f"the runs have no result in common: {why}.")
    changed, unmoved = found[found["change"] != "same"].groupby("engine"), _unmoved(found)
    attributions = {str(engine): _attributed(rows, old, new, str(engine), unmoved) for engine, rows in changed}
    around = list(surroundings(old.provenance, new.provenance).values())
    return Changes(found, attributions, around, other, _in_one_only(old, new), speed_changes(old, new), equal_motions(old, new, other))


def _changed_scenes(old: Results, new: Results) -> list[str]:
    """The scenes of both runs whose definitions differ."""
    return [name for name, scene in new.scenes.items() if name in old.scenes and old.scenes[name].digest != scene.digest]


def _in_common(old: Results, new: Results) -> pd.DataFrame:
    """What was requested in both runs, in scenes that have not changed, compared."""
    asked = asked_for(comparable_results(old), new), asked_for(comparable_results(new), old)
    return most_changed_first(changes(*(rows[~rows["scene"].isin(_changed_scenes(old, new))] for rows in asked)))


def _unmoved(found: pd.DataFrame) -> list[str]:
    """The engines whose results are all the same."""
    return [str(engine) for engine, kinds in found.groupby("engine")["change"] if set(kinds) == {"same"}]


def _attributed(rows: pd.DataFrame, old: Results, new: Results, engine: str, unmoved: Sequence[str]) -> Attribution:
    """The cause to which changed results of an engine are attributed; its motions differ if those of one result do."""
    stamps = old.provenance, new.provenance
    digests = [digests_of(stamp) for stamp in stamps]
    motions = {compared_digests(row, *digests) for row in rows.to_dict("records")}
    together: Motion = "different" if "different" in motions else "same" if motions == {"same"} else "unknown"
    return attribute(*stamps, engine, unmoved, together)


def _in_one_only(old: Results, new: Results) -> list[str]:
    asked = [(results.provenance["asked"]["dts"], list(results.scenes), results.engines) for results in (old, new)]
    return [
        f"{word} {thing:g} s ({which})" if word == "step" else f"{word} {thing} ({which})"
        for which, mine, other in (("gone", *asked), ("new", *reversed(asked)))
        for word, things, others in zip(("step", "scene", "engine"), mine, other, strict=True)
        for thing in things
        if thing not in others
    ]


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
        results: The comparable results of all runs; the column `run` is the number of the run.
        moves: The changes, in the order of the runs.
    """

    names: list[str]
    stamps: pd.DataFrame
    results: pd.DataFrame
    moves: list[Move]


def history(runs: Mapping[str, Results]) -> History:
    """Compare the results of several runs over time.

    Args:
        runs: Two or more runs, by name; they are sorted by start time.

    Returns:
        `names` of the runs in order; `stamps`, their times, commits and versions; `results`, the values of all runs; and `moves`, the
        runs in which results changed, and the cause to which each change is attributed.

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
    measured = list(map(comparable_results, results))
    every = pd.concat([rows.assign(run=number) for number, rows in enumerate(measured)], ignore_index=True)
    return History(names, pd.DataFrame(stamps), every, _moves(results, measured))


def _moves(results: Sequence[Results], results_of: Sequence[pd.DataFrame]) -> list[Move]:
    """The runs in which results changed.

    Each result is compared with its value after its last change, so that slow drifts are found. Runs that did not request the result have
    no effect; in the first one in which the engine broke down or declined the scene, it is gone.
    """
    held: dict[str, pd.DataFrame] = {}
    scenes: dict[str, str] = {}
    absent: dict[str, list[tuple[str, ...]]] = {}
    found = []
    for run, one in enumerate(results):
        digests = {name: scene.digest for name, scene in one.scenes.items()}
        other = {name for name, digest in digests.items() if scenes.get(name, digest) != digest}
        scenes |= digests
        held = {engine: rows[~rows["scene"].isin(other)] for engine, rows in held.items()}
        moved = {}
        for engine in one.engines:
            now = results_of[run][results_of[run]["engine"] == engine]
            earlier = held.get(engine, now.iloc[:0])
            before = asked_for(earlier, one)
            change = changes(before, now)
            keys, is_gone = pd.MultiIndex.from_frame(change[KEY]), change["change"] == "gone"
            was_gone = is_gone & keys.isin(absent.get(engine, []))
            absent[engine] = [*set(absent.get(engine, [])).difference(keys), *keys[is_gone]]
            moved[engine] = change.loc[change["change"].isin(CHANGED) & ~was_gone, KEY]
            stays = change["change"].isin(["same", "gone", "undefined"])
            kept, fresh = before.merge(change.loc[stays, KEY], on=KEY), now.merge(change.loc[~stays, KEY], on=KEY)
            held[engine] = pd.concat([earlier.drop(before.index), kept, fresh], ignore_index=True)
        for engine, differing in moved.items():
            for number, rows in _since(differing, results_of[:run], results_of[run]):
                cause = _attributed(rows, results[number], one, engine, _unmoved(_in_common(results[number], one)))
                found.append(Move(engine, number, run, rows, cause))
    return found


def _since(keys: pd.DataFrame, earlier: Sequence[pd.DataFrame], now: pd.DataFrame) -> Iterator[tuple[int, pd.DataFrame]]:
    """The changes of some results, each since the last earlier run from which it differs by more than its tolerance, by these runs.

    Of a slow drift that is not the run before, which alone may not have caused the change.
    """
    for number, rows in reversed(list(enumerate(earlier))):
        found = changes(rows.merge(keys, on=KEY), now.merge(keys, on=KEY))
        found = found[found["change"].isin(CHANGED)]
        if len(found):
            yield number, most_changed_first(found)
            keys = keys[~pd.MultiIndex.from_frame(keys).isin(pd.MultiIndex.from_frame(found[KEY]))]
        if keys.empty:
            return
