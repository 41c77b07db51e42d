"""Two runs compared: the results that changed, and the causes to which the changes are attributed."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import pandas as pd

from dropspin.comparisons.judging.verdicts import FAILURES
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
        judged_otherwise: By engine, earlier and later verdict, the number of results that are the same and fail in one of the runs alone.
    """

    results: pd.DataFrame
    attributions: Mapping[str, Attribution]
    surroundings: list[str]
    other_scenes: list[str]
    in_one_only: list[str]
    speed: list[SpeedChange]
    motions: list[EqualMotions]
    judged_otherwise: Mapping[tuple[str, str, str], int]

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
        raise DropspinError(f"the runs have no result in common: {_why_nothing_is_compared(old, new, other)}.")
    changed, unmoved = found[found["change"] != "same"].groupby("engine"), unmoved_engines(found)
    attributions = {str(engine): attributed(rows, old, new, str(engine), unmoved) for engine, rows in changed}
    around = list(surroundings(old.provenance, new.provenance).values())
    motions, judged = equal_motions(old, new, other), judged_otherwise(old, new, found)
    return Changes(found, attributions, around, other, _in_one_only(old, new), speed_changes(old, new), motions, judged)


def _why_nothing_is_compared(old: Results, new: Results, other: Sequence[str]) -> str:
    if other:
        return f"{', '.join(other)} changed between them"
    if all(set(of_old) & set(of_new) for of_old, of_new in zip(*_asked(old, new), strict=True)):
        return "of what was requested in both, one of them at least has no results"
    return "no scene, engine and time step was requested in both"


def _changed_scenes(old: Results, new: Results) -> list[str]:
    """The scenes of both runs whose definitions differ."""
    return [name for name, scene in new.scenes.items() if name in old.scenes and old.scenes[name].digest != scene.digest]


def results_in_common(old: Results, new: Results) -> pd.DataFrame:
    """What was requested in both runs, in scenes that have not changed, compared."""
    asked = asked_for(comparable_results(old), new), asked_for(comparable_results(new), old)
    return most_changed_first(changes(*(rows[~rows["scene"].isin(_changed_scenes(old, new))] for rows in asked)))


def judged_otherwise(old: Results, new: Results, found: pd.DataFrame) -> dict[tuple[str, str, str], int]:
    """`Changes.judged_otherwise` of compared results: they have other bounds, or a limitation is declared in one of the runs alone."""
    same = found.loc[found["change"] == "same", KEY]
    verdicts = [comparable_results(results)[[*KEY, "verdict"]] for results in (old, new)]
    both = same.merge(verdicts[0], on=KEY).merge(verdicts[1], on=KEY, suffixes=("_before", "_after"))
    both = both[both["verdict_before"].isin(FAILURES) != both["verdict_after"].isin(FAILURES)]
    return dict(Counter(both[["engine", "verdict_before", "verdict_after"]].itertuples(index=False, name=None)))


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


def _asked(*runs: Results) -> list[tuple[Sequence[float], Sequence[str], Sequence[str]]]:
    """The time steps [s], scenes and engines of each run."""
    return [(results.provenance["asked"]["dts"], list(results.scenes), results.engines) for results in runs]


def _in_one_only(old: Results, new: Results) -> list[str]:
    asked = _asked(old, new)
    return [
        f"{word} {thing:g} s ({which})" if word == "step" else f"{word} {thing} ({which})"
        for which, mine, other in (("gone", *asked), ("new", *reversed(asked)))
        for word, things, others in zip(("step", "scene", "engine"), mine, other, strict=True)
        for thing in things
        if thing not in others
    ]
