"""Two runs held against each other: what has changed, and what it is put down to."""

from collections.abc import Mapping
from dataclasses import dataclass

import pandas as pd

from comparisons.regressions.differences import Blame, blame, surroundings
from comparisons.regressions.figures import asked_for, changes, figures, most_changed_first, regressed
from comparisons.regressions.speed import SpeedChange, speed_changes
from comparisons.results import Results
from scenarios import DropspinError


@dataclass(frozen=True, eq=False)
class Changes:
    """What differs between two runs.

    Attributes:
        figures: As `regressions.changes` has them, most changed first; `change` is same, better, worse, moved, new or gone.
        blames: By engine, what its changes are put down to; of those that have any.
        surroundings: What differs that all engines share, in words.
        other_scenes: Scenes that simulate something else in the later run, so that their figures are not compared.
        in_one_only: Scenes, engines and steps that were asked for in one of the runs only, in words.
        speed: How each engine's speed has changed beside the others'.
    """

    figures: pd.DataFrame
    blames: Mapping[str, Blame]
    surroundings: list[str]
    other_scenes: list[str]
    in_one_only: list[str]
    speed: list[SpeedChange]

    def of(self, *kinds: str) -> pd.DataFrame:
        """The figures of some kinds of change."""
        return self.figures[self.figures["change"].isin(kinds)]

    @property
    def regressions(self) -> pd.DataFrame:
        """What a gate is closed by: worse, moved, or gone."""
        return regressed(self.figures)

    def slower(self, share: float) -> list[SpeedChange]:
        """The engines that have become slower by more than some share, beyond doubt."""
        return [change for change in self.speed if change.least > 1.0 + share]


def compare(old: Results, new: Results) -> Changes:
    """Hold a run against an earlier one.

    Figures of scenes, engines and steps that were asked for in one of the runs only are neither new nor gone: they are left out.

    Raises:
        DropspinError: They have none in common.
    """
    other = [name for name, scene in new.scenes.items() if name in old.scenes and old.scenes[name].digest != scene.digest]
    before, after = figures(old), figures(new)
    found = changes(*(held[~held["scene"].isin(other)] for held in (asked_for(before, new), asked_for(after, old))))
    if found.empty and other:
        raise DropspinError(f"the runs have no figure in common: {', '.join(other)}: another scene now, of the same name.")
    if found.empty:
        raise DropspinError("the runs have no figure in common: no scene, engine and step that both were asked for.")
    found = most_changed_first(found)
    changed = found.groupby("engine")["change"].agg(lambda change: bool((change != "same").any()))
    unmoved = [str(engine) for engine, moved in changed.items() if not moved]
    stamps = old.provenance, new.provenance
    blames = {str(engine): blame(*stamps, str(engine), unmoved) for engine, moved in changed.items() if moved}
    return Changes(found, blames, surroundings(*stamps), other, _in_one_only(old, new), speed_changes(old, new))


def _in_one_only(old: Results, new: Results) -> list[str]:
    asked = [(results.provenance["asked"]["dts"], list(results.scenes), results.engines) for results in (old, new)]
    return [
        f"{word} {thing:g} s ({which})" if word == "step" else f"{word} {thing} ({which})"
        for which, mine, other in (("gone", *asked), ("new", *reversed(asked)))
        for word, things, others in zip(("step", "scene", "engine"), mine, other, strict=True)
        for thing in things
        if thing not in others
    ]
