"""Two runs compared: the results that changed, and the causes to which the changes are attributed."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import pandas as pd

from dropspin.comparisons.regressions.attribution import Attribution, attribute, surroundings
from dropspin.comparisons.regressions.changes import (
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
from dropspin.comparisons.results.results import Results
from dropspin.scenarios import DropspinError


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
    other, found = _changed_scenes(old, new), results_in_common(old, new)
    if found.empty:
        why = f"{', '.join(other)} changed between them" if other else "no scene, engine and time step was requested in both"
        raise DropspinError(f"the runs have no result in common: {why}.")
    changed, unmoved = found[found["change"] != "same"].groupby("engine"), unmoved_engines(found)
    attributions = {str(engine): attributed(rows, old, new, str(engine), unmoved) for engine, rows in changed}
    around = list(surroundings(old.provenance, new.provenance).values())
    return Changes(found, attributions, around, other, _in_one_only(old, new), speed_changes(old, new), equal_motions(old, new, other))


def _changed_scenes(old: Results, new: Results) -> list[str]:
    """The scenes of both runs whose definitions differ."""
    return [name for name, scene in new.scenes.items() if name in old.scenes and old.scenes[name].digest != scene.digest]


def results_in_common(old: Results, new: Results) -> pd.DataFrame:
    """What was requested in both runs, in scenes that have not changed, compared."""
    asked = asked_for(comparable_results(old), new), asked_for(comparable_results(new), old)
    return most_changed_first(changes(*(rows[~rows["scene"].isin(_changed_scenes(old, new))] for rows in asked)))


def unmoved_engines(found: pd.DataFrame) -> list[str]:
    """The engines whose results are all the same."""
    return [str(engine) for engine, kinds in found.groupby("engine")["change"] if set(kinds) == {"same"}]


def attributed(rows: pd.DataFrame, old: Results, new: Results, engine: str, unmoved: Sequence[str]) -> Attribution:
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
