"""The comparison of two runs: the changes, and the causes to which they are attributed."""

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from dropspin.comparisons.regressions.attribution import Attribution, attribute, surroundings
from dropspin.comparisons.regressions.motions import EqualMotions, digests_of, equal_motions, taken_together
from dropspin.comparisons.regressions.speed import SpeedChange, speed_changes
from dropspin.comparisons.regressions.values import asked_for, changes, comparable_results, most_changed_first, regressed, verify_comparable
from dropspin.comparisons.results.results import Results
from dropspin.scenarios import DropspinError


@dataclass(frozen=True, eq=False)
class Changes:
    """The differences between two runs.

    Attributes:
        results: The table of comparable results that `values.changes` returns, largest change first.
        attributions: The cause to which the changes of an engine are attributed, by engine.
        surroundings: The differences that affect all engines, as text.
        other_scenes: Scenes that are different in the later run, so that their results are not compared.
        in_one_only: Scenes, engines and time steps that were requested in only one of the runs, as text.
        speed: The change of each engine's speed relative to the others.
        motions: How many motions of each engine are equal bit for bit; empty if the runs were loaded without trajectories.
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
        """The results that fail a comparison: worse, moved, or gone."""
        return regressed(self.results)


def compare(old: Results, new: Results) -> Changes:
    """Compare a run with an earlier one.

    Results of scenes, engines and time steps that were requested in only one of the runs are left out; they are neither new nor gone.

    Args:
        old: The earlier run.
        new: The later run.

    Returns:
        The changes: `results`, a table with `value` and `before` in `unit`, and the `change` (same, better, worse, moved, new or gone);
        `attributions`, the cause to which the changes of each engine are attributed; `speed`, the change of the time per step; and
        `motions`, how many motions are equal bit for bit.

    Raises:
        DropspinError: The runs have no scene, engine and time step in common, or one is quick.
    """
    other = [name for name, scene in new.scenes.items() if name in old.scenes and old.scenes[name].digest != scene.digest]
    verify_comparable(old, new)
    before, after = comparable_results(old), comparable_results(new)
    found = changes(*(held[~held["scene"].isin(other)] for held in (asked_for(before, new), asked_for(after, old))))
    if found.empty and other:
        raise DropspinError(f"the runs have no result in common: {', '.join(other)} changed between them.")
    if found.empty:
        raise DropspinError("the runs have no result in common: no scene, engine and time step was requested in both.")
    found = most_changed_first(found)
    changed = found.groupby("engine")["change"].agg(lambda change: bool((change != "same").any()))
    unmoved = [str(engine) for engine, moved in changed.items() if not moved]
    stamps = old.provenance, new.provenance
    digests = digests_of(old.provenance), digests_of(new.provenance)
    attributions = {
        str(engine): attribute(*stamps, str(engine), unmoved, taken_together(rows, *digests))
        for engine, rows in found[found["change"] != "same"].groupby("engine")
    }
    in_one_only, speed, motions = _in_one_only(old, new), speed_changes(old, new), equal_motions(old, new, other)
    return Changes(found, attributions, list(surroundings(*stamps).values()), other, in_one_only, speed, motions)


def _in_one_only(old: Results, new: Results) -> list[str]:
    asked = [(results.provenance["asked"]["dts"], list(results.scenes), results.engines) for results in (old, new)]
    return [
        f"{word} {thing:g} s ({which})" if word == "step" else f"{word} {thing} ({which})"
        for which, mine, other in (("gone", *asked), ("new", *reversed(asked)))
        for word, things, others in zip(("step", "scene", "engine"), mine, other, strict=True)
        for thing in things
        if thing not in others
    ]
