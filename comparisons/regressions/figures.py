"""A run's figures: what of it can be held against an earlier run, each with a tolerance of its own."""

from collections.abc import Mapping
from typing import Literal

import numpy as np
import pandas as pd

from comparisons.results import Results
from comparisons.studies import ARTEFACTS, JUMPING, STUDIES
from comparisons.verdicts import BREAKDOWNS

KEY = ["scene", "engine", "steps", "metric", "kind"]
"""What tells figures apart; `steps` is the time step in words, of orders and limits all the steps that they were found from."""

BETTER: Mapping[str, Literal["smaller", "larger", "neither"]] = {
    "truth": "smaller",
    "invariant": "smaller",
    "model_error": "smaller",
    "order": "larger",
    "ensemble": "neither",
}
"""Kinds of rows that are figures, and which way is better: errors towards 0, orders upwards; a mean can only be the same or another."""


def figures(results: Results) -> pd.DataFrame:
    """The figures of a run.

    Returns:
        The columns of `KEY`, then `value` and `tolerance` in `unit`, and the `verdict`. Left out is what is not finite, and what only
        shows how a state is sampled.
    """
    frame = results.frame.assign(tolerance=results.tolerances, steps=steps_in_words(results))
    held = frame["kind"].isin(list(BETTER)) & ~frame["metric"].isin(list(ARTEFACTS))
    told = np.isfinite(frame["value"]) & np.isfinite(frame["tolerance"])
    return frame.loc[held & told, [*KEY, "value", "tolerance", "unit", "verdict"]].reset_index(drop=True)


def steps_in_words(results: Results) -> pd.Series:
    """For each row of a run the step [s], or all of them, coarsest first."""
    return results.frame["dt"].map(lambda dt: _every(results) if np.isnan(dt) else repr(dt))


def asked_for(held: pd.DataFrame, results: Results) -> pd.DataFrame:
    """Those of some figures that are of scenes, engines and steps that a run was asked for."""
    steps = {_every(results), *map(repr, _dts(results))}
    return held[held["scene"].isin(list(results.scenes)) & held["engine"].isin(results.engines) & held["steps"].isin(steps)]


def of_engines_that_broke_down(rows: pd.DataFrame, results: Results) -> "pd.Series[bool]":
    """Which of some rows are of engines that broke down in the scene, or are missing: what they have not measured is nobody's wish."""
    pairs = ["scene", "engine"]
    broken = results.frame.loc[results.frame["verdict"].isin(BREAKDOWNS | {"missing"}), pairs]
    return pd.Series(pd.MultiIndex.from_frame(rows[pairs]).isin(pd.MultiIndex.from_frame(broken)), rows.index)


def _every(results: Results) -> str:
    return ", ".join(map(repr, _dts(results)))


def _dts(results: Results) -> list[float]:
    return sorted(map(float, results.provenance["asked"]["dts"]), reverse=True)


def changes(before: pd.DataFrame, after: pd.DataFrame) -> pd.DataFrame:
    """Figures held against earlier ones.

    Args:
        before: The earlier figures, as `figures` has them.
        after: The later ones.

    Returns:
        The columns of `KEY`, then `unit`, `value`, `before`, the `tolerance` that separates them, the bounds `lower` and `upper` on the
        value within which it is not worse, `change` (same, better, worse, moved, new, gone) and by how much
        it has changed, `in_tolerances`.
    """
    held = [*KEY, "value", "tolerance", "unit"]
    both = before[held].merge(after[held], how="outer", on=KEY, suffixes=("_before", "_after"), sort=False)
    old, new = both["value_before"].to_numpy(), both["value_after"].to_numpy()
    # The earlier one's alone: what has gone wrong must not widen what it is held to.
    tolerance = both["tolerance_before"].fillna(both["tolerance_after"]).to_numpy()
    way = both["kind"].map(BETTER).to_numpy()
    errors = way == "smaller"
    # An error may be anything between 0 and what it was; on the other side of 0 it is another error.
    lower = np.where(errors, np.fmin(old, 0.0), old) - tolerance
    upper = np.where(way == "larger", np.inf, np.where(errors, np.fmax(old, 0.0), old) + tolerance)
    better = np.where(errors, np.abs(new) < np.abs(old) - tolerance, (way == "larger") & (new > old + tolerance))
    within = (lower <= new) & (new <= upper)
    other_side = errors & (np.abs(new) <= np.abs(old) + tolerance)
    change = np.select(
        [np.isnan(old), np.isnan(new), within & better, within, (way == "neither") | other_side],
        ["new", "gone", "better", "same", "moved"],
        "worse",
    )
    unit = both["unit_after"].where(both["unit_after"].notna(), both["unit_before"])
    found = {"unit": unit, "value": new, "before": old, "tolerance": tolerance, "lower": lower, "upper": upper, "change": change}
    return both[KEY].assign(**found, in_tolerances=np.abs(new - old) / tolerance)


def regressed(found: pd.DataFrame) -> pd.DataFrame:
    """The changes that close a gate: worse, moved, or gone.

    An order or a limit that can no longer be told follows from the errors, which are figures of their own.
    """
    lost = (found["change"] == "gone") & ~found["kind"].isin(STUDIES)
    return found[found["change"].isin(["worse", "moved"]) | lost]


def most_changed_first(found: pd.DataFrame) -> pd.DataFrame:
    """Changes in the order in which they tell most: by tolerances; counts, which jump from 0 to something, after all others."""
    ordered = found.assign(jumps=found["metric"].isin(list(JUMPING)))
    ordered = ordered.sort_values(["jumps", "in_tolerances"], ascending=[True, False], na_position="last", kind="stable")
    return ordered.drop(columns="jumps").reset_index(drop=True)
