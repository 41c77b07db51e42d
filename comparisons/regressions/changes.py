"""What changed between two runs: results by more than their tolerance, motions bit for bit, and speed relative to other engines.

Speeds are ratios between engines of one run, because absolute times depend on the machine. An engine counts as slower only if it became
slower relative to every other engine. Otherwise all others would count as slower if one engine became faster.
"""

from collections.abc import Collection, Iterator, Mapping
from itertools import permutations
from typing import Any, Literal, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from dropspin.comparisons.judging.convergence import ARTEFACTS, JUMPING, STUDIES
from dropspin.comparisons.judging.verdicts import BREAKDOWNS
from dropspin.comparisons.results.results import Results
from dropspin.comparisons.results.table import OF_SYMMETRIES, are_among
from dropspin.scenarios import DropspinError, Trajectory
from dropspin.scenarios.state import Array

KEY = ["scene", "engine", "steps", "metric", "kind"]
"""The columns that identify a result; `steps` is the time step as text, or, for orders and asymptotic errors, all time steps used."""
CONFIDENCE = 0.95
"""Of the interval of a change of speed."""
NEAR_ORDERS = 0.1
"""Difference of orders that higher powers of the time step may cause."""
Digests = Mapping[tuple[str, str, str], str]
"""By scene, engine and time step as text: the hash of the motions that were measured."""
Motion = Literal["same", "different", "unknown"]

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
    every = ", ".join(_steps(results))
    return results.table["dt"].map(lambda dt: every if np.isnan(dt) else repr(dt))


def _steps(results: Results) -> list[str]:
    """The time steps of a run [s] as texts, coarsest first."""
    return [repr(dt) for dt in sorted(map(float, results.provenance["asked"]["dts"]), reverse=True)]


def asked_for(held: pd.DataFrame, results: Results) -> pd.DataFrame:
    """The results of scenes, engines and time steps that were requested in a run, and of symmetries if it has any."""
    steps = [", ".join(_steps(results)), *_steps(results)]
    mine = held[held["scene"].isin(list(results.scenes)) & held["engine"].isin(results.engines) & held["steps"].isin(steps)]
    has_symmetries = results.table["kind"].isin(OF_SYMMETRIES).any()
    return mine if has_symmetries else mine[~mine["kind"].isin(OF_SYMMETRIES)]


def broke_down(rows: pd.DataFrame, results: Results) -> "pd.Series[bool]":
    """Whether each row belongs to an engine that broke down in the scene, or is missing."""
    broken = results.table[results.table["verdict"].isin(BREAKDOWNS | {"missing"})]
    return are_among(rows, broken, ["scene", "engine"])


@np.errstate(over="ignore", invalid="ignore")  # an engine may return 1e300, and a baseline have such a tolerance
def changes(before: pd.DataFrame, after: pd.DataFrame) -> pd.DataFrame:
    """Results compared with earlier ones.

    Args:
        before: The earlier results, from `comparable_results`.
        after: The later results, from `comparable_results`.

    Returns:
        The columns of `KEY`, then `unit`, `value`, `before` (the earlier value), `tolerance`, the bounds `lower` and `upper` within which
        the value is not worse, `change` (same, better, worse, moved, new, gone, undefined of an order or asymptotic error, or lower of an
        order) and `in_tolerances`, the size of the change in tolerances.
    """
    held = [*KEY, "value", "tolerance", "unit"]
    both = before[held].merge(after[held], how="outer", on=KEY, suffixes=("_before", "_after"), sort=False)
    old, new = both["value_before"].to_numpy(), both["value_after"].to_numpy()
    lost = np.isnan(new)
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
        [np.isnan(old), lost & both["kind"].isin(STUDIES), lost, within & better, within, (way == "neither") | other_side],
        ["new", "undefined", "gone", "better", "same", "moved"],
        "worse",
    )
    change = np.where(_is_lowered_by_better_errors(both, change), "lower", change)
    unit = both["unit_after"].where(both["unit_after"].notna(), both["unit_before"])
    found = {"unit": unit, "value": new, "before": old, "tolerance": tolerance, "lower": lower, "upper": upper, "change": change}
    return both[KEY].assign(**found, in_tolerances=np.abs(new - old) / tolerance)


def _is_lowered_by_better_errors(both: pd.DataFrame, change: NDArray[np.str_]) -> NDArray[np.bool_]:
    """Whether each result is an order that is a little lower, although errors to which it is fitted are better and none is worse.

    An order of three errors has a part that vanishes with the time step: errors that all halve change it in its third digit.
    """
    series = ["scene", "engine", "metric"]
    errors = both.assign(better=change == "better", worse=~np.isin(change, ["better", "same", "new"]))[~both["kind"].isin(STUDIES)]
    of_errors = both[series].merge(errors.groupby(series)[["better", "worse"]].any().reset_index(), how="left", on=series)
    follows = of_errors["better"].eq(True) & of_errors["worse"].eq(False)
    is_near = both["value_before"] - both["value_after"] < NEAR_ORDERS
    return np.asarray((both["kind"] == "order") & (change == "worse") & is_near & follows.to_numpy())


def regressed(found: pd.DataFrame) -> pd.DataFrame:
    """The changes that fail a check: worse, moved, or gone.

    An order or an asymptotic error that is now undefined is not among them, because the errors from which it is computed are compared too.
    """
    return found[found["change"].isin(["worse", "moved", "gone"])]


def most_changed_first(found: pd.DataFrame) -> pd.DataFrame:
    """Changes, the largest relative to its tolerance first; fits to several time steps and metrics that change in jumps come last.

    Fits follow from the errors at each time step, and a limit near 0 has a small tolerance.
    """
    ordered = found.assign(later=found["metric"].isin(list(JUMPING)) | found["kind"].isin(STUDIES))
    ordered = ordered.sort_values(["later", "in_tolerances"], ascending=[True, False], na_position="last", kind="stable")
    return ordered.drop(columns="later").reset_index(drop=True)


def digests_of(stamp: Mapping[str, Any]) -> Digests:
    """The hashes of the motions of a run, from its provenance; empty for runs of versions that recorded none."""
    return {(scene, engine, step): digest for (scene, engine, step), digest in leaves(stamp.get("motions", {}), 3)}


def leaves(nested: Mapping[str, Any], depth: int) -> Iterator[tuple[tuple[str, ...], Any]]:
    """The content of mappings in each other down to a depth, with its keys."""
    for key, inner in nested.items():
        if depth == 1:
            yield (key,), inner
        else:
            yield from (((key, *keys), content) for keys, content in leaves(inner, depth - 1))


def compared_digests(row: Mapping[Any, Any], old: Digests, new: Digests) -> Motion:
    """Whether the motions that were measured for a result are equal bit for bit in two runs.

    Args:
        row: The result, with the columns of `KEY`.
        old: The hashes of the earlier motions.
        new: Those of the later motions.

    Returns:
        `unknown` where a hash is missing, and for means of ensembles and symmetries, which have other motions, unless the former differ.
    """
    pairs = [(old.get(key), new.get(key)) for key in ((row["scene"], row["engine"], step) for step in row["steps"].split(", "))]
    if any(None not in pair and pair[0] != pair[1] for pair in pairs):
        return "different"
    is_measured_from = row["kind"] in ("truth", "invariant", "order", "asymptotic_error")
    return "same" if is_measured_from and not any(None in pair for pair in pairs) else "unknown"


class EqualMotions(NamedTuple):
    """How many motions of one engine are equal bit for bit in two runs.

    Attributes:
        engine: Label of the engine.
        equal: Number of motions that are equal.
        compared: Number of motions that both runs have: one for each scene and time step.
        scene: Scene of the motion whose difference begins earliest in its scene; empty if all are equal.
        dt: Time step of that motion [s]; 0 if all are equal.
        step: The first step after which that motion differs, counted from the start, which is step 0; 0 if all are equal.
    """

    engine: str
    equal: int
    compared: int
    scene: str = ""
    dt: float = 0.0
    step: int = 0


def equal_motions(old: Results, new: Results, left_out: Collection[str] = ()) -> list[EqualMotions]:
    """Compare the motions that two runs have in common, bit for bit.

    Args:
        old: The earlier run, with its trajectories.
        new: The later run, with its trajectories.
        left_out: Scenes that are not compared.

    Returns:
        For each engine that has motions in both runs, how many are equal, and the one that differs first.
    """
    found = []
    for engine in new.engines:
        common = [key for key in new.trajectories if key in old.trajectories and key[1] == engine and key[0] not in left_out]
        steps = {key: _first_difference(old.trajectories[key], new.trajectories[key]) for key in common}
        differing = [(scene, dt, step) for (scene, _, dt), step in steps.items() if step is not None]
        if common:
            earliest = min(differing, key=lambda one: one[1] * one[2], default=())
            found.append(EqualMotions(engine, len(common) - len(differing), len(common), *earliest))
    return found


def _first_difference(old: Trajectory, new: Trajectory) -> int | None:
    """The first row in which two trajectories have different bits; None if there is none. NaN equals NaN of the same bits."""
    rows = min(len(old), len(new))
    bits, others = (np.ascontiguousarray(motion.states[:rows]).view(np.uint64) for motion in (old, new))
    differs = (bits != others).any(axis=1)
    return int(differs.argmax()) if differs.any() else None if len(old) == len(new) else rows


class SpeedChange(NamedTuple):
    """The change of an engine's time per step relative to that of another engine.

    Attributes:
        engine: Label of the engine.
        other: Label of the other engine.
        ratio: The ratio of the two times per step, divided by the earlier ratio; the median over scenes and time steps.
        least: Lower end of the median's confidence interval.
        most: Upper end of this interval.
        cases: Number of scenes and time steps.
    """

    engine: str
    other: str
    ratio: float
    least: float
    most: float
    cases: int


def speed_changes(old: Results, new: Results) -> list[SpeedChange]:
    """For each engine of both runs, the smallest slowdown relative to any other engine, with that engine."""
    before, after = (
        results.table.dropna(subset=["time_per_step", "dt"]).pivot_table("time_per_step", ["scene", "dt"], "engine", aggfunc="first")
        for results in (old, new)
    )
    smallest: dict[str, SpeedChange] = {}
    for engine, other in permutations([engine for engine in new.engines if engine in before and engine in after], 2):
        ratios = (after[engine] / after[other] / (before[engine] / before[other])).dropna().to_numpy()
        if len(ratios):
            change = SpeedChange(engine, other, float(np.median(ratios)), *_interval_of_median(ratios), len(ratios))
            smallest[engine] = min(smallest.get(engine, change), change, key=lambda one: one.least)
    return list(smallest.values())


def _interval_of_median(ratios: Array) -> tuple[float, float]:
    """The exact confidence interval of the median of positive numbers, which is unbounded with fewer than six."""
    from scipy import stats

    interval = stats.quantile_test(ratios, q=1.0).confidence_interval(CONFIDENCE)
    return float(np.nan_to_num(interval.low, nan=0.0)), float(np.nan_to_num(interval.high, nan=np.inf))
