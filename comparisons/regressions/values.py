"""The results of a run that can be compared with an earlier run, each with its own tolerance."""

from collections.abc import Mapping
from typing import Literal

import numpy as np
import pandas as pd

from dropspin.comparisons.judging.convergence import ARTEFACTS, JUMPING, STUDIES
from dropspin.comparisons.judging.verdicts import BREAKDOWNS
from dropspin.comparisons.results.results import Results
from dropspin.comparisons.results.table import OF_SYMMETRIES
from dropspin.scenarios import DropspinError

KEY = ["scene", "engine", "steps", "metric", "kind"]
"""The columns that identify a result; `steps` is the time step as text, or, for orders and asymptotic errors, all time steps used."""

BETTER: Mapping[str, Literal["smaller", "larger", "neither"]] = {
    "truth": "smaller",
    "invariant": "smaller",
    "asymptotic_error": "smaller",
    "order": "larger",
    "ensemble": "neither",
    "symmetry": "smaller",
    "determinism": "smaller",
}
"""Kinds of comparable rows, with the direction of an improvement: errors towards 0, orders upwards; a mean has none."""


def verify_comparable(*runs: Results) -> None:
    """Raise `DropspinError` if a run is quick: its means are over fewer starts, and its results have no tolerances."""
    if any(run.is_quick for run in runs):
        raise DropspinError("a quick run has too few starts to be compared with other runs or accepted; run it again without --quick.")


def comparable_results(results: Results) -> pd.DataFrame:
    """The comparable results of a run.

    Returns:
        The columns of `KEY`, then `value` and `tolerance` in `unit`, and the `verdict`. Results that are not finite are left out, and so
        are metrics that depend on how a state is sampled, such as `energy_error_raw`.
    """
    table = results.table.assign(steps=step_names(results))
    compared = table["kind"].isin(list(BETTER)) & ~table["metric"].isin(list(ARTEFACTS))
    usable = np.isfinite(table["value"]) & np.isfinite(table["tolerance"])
    return table.loc[compared & usable, [*KEY, "value", "tolerance", "unit", "verdict"]].reset_index(drop=True)


def step_names(results: Results) -> pd.Series:
    """For each row of a run, its time step [s] as text, or all its time steps, coarsest first."""
    return results.table["dt"].map(lambda dt: _all_steps(results) if np.isnan(dt) else repr(dt))


def asked_for(held: pd.DataFrame, results: Results) -> pd.DataFrame:
    """The results of scenes, engines and time steps that were requested in a run, and of symmetries if it has any."""
    steps = {_all_steps(results), *map(repr, _dts(results))}
    mine = held[held["scene"].isin(list(results.scenes)) & held["engine"].isin(results.engines) & held["steps"].isin(steps)]
    has_symmetries = results.table["kind"].isin(OF_SYMMETRIES).any()
    return mine if has_symmetries else mine[~mine["kind"].isin(OF_SYMMETRIES)]


def broke_down(rows: pd.DataFrame, results: Results) -> "pd.Series[bool]":
    """Whether each row belongs to an engine that broke down in the scene, or is missing."""
    pairs = ["scene", "engine"]
    broken = results.table.loc[results.table["verdict"].isin(BREAKDOWNS | {"missing"}), pairs]
    return pd.Series(pd.MultiIndex.from_frame(rows[pairs]).isin(pd.MultiIndex.from_frame(broken)), rows.index)


def _all_steps(results: Results) -> str:
    """All time steps of a run, as the text that identifies results fitted to them."""
    return ", ".join(map(repr, _dts(results)))


def _dts(results: Results) -> list[float]:
    return sorted(map(float, results.provenance["asked"]["dts"]), reverse=True)


@np.errstate(over="ignore", invalid="ignore")  # an engine may return 1e300, and a baseline have such a tolerance
def changes(before: pd.DataFrame, after: pd.DataFrame) -> pd.DataFrame:
    """Results compared with earlier ones.

    Args:
        before: The earlier results, from `comparable_results`.
        after: The later results, from `comparable_results`.

    Returns:
        The columns of `KEY`, then `unit`, `value`, `before` (the earlier value), `tolerance`, the bounds `lower` and `upper` within which
        the value is not worse, `change` (same, better, worse, moved, new, gone) and `in_tolerances`, the size of the change in
        tolerances.
    """
    held = [*KEY, "value", "tolerance", "unit"]
    both = before[held].merge(after[held], how="outer", on=KEY, suffixes=("_before", "_after"), sort=False)
    old, new = both["value_before"].to_numpy(), both["value_after"].to_numpy()
    # The earlier tolerance alone: a result that has gone wrong must not widen its own bounds.
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
    """The changes that fail a check: worse, moved, or gone.

    An order or an asymptotic error that is now undefined is not among them, because the errors from which it is computed are compared too.
    """
    lost = (found["change"] == "gone") & ~found["kind"].isin(STUDIES)
    return found[found["change"].isin(["worse", "moved"]) | lost]


def most_changed_first(found: pd.DataFrame) -> pd.DataFrame:
    """Changes, the largest relative to its tolerance first; metrics that change in jumps come last."""
    ordered = found.assign(jumps=found["metric"].isin(list(JUMPING)))
    ordered = ordered.sort_values(["jumps", "in_tolerances"], ascending=[True, False], na_position="last", kind="stable")
    return ordered.drop(columns="jumps").reset_index(drop=True)
