"""Accepted results: a run is checked against them, or replaces them.

A check adds a row of kind `baseline` with a verdict for each accepted result, and attributes the changes that fail.
"""

import datetime
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dropspin.comparisons.judging.verdicts import FAILURES, Verdict
from dropspin.comparisons.regressions.attribution import CORRECTION, Attribution, attribute, common_settings, surroundings
from dropspin.comparisons.regressions.baseline import COLUMNS, Acceptance, Baseline, load_baseline
from dropspin.comparisons.regressions.changes import (
    KEY,
    Motion,
    asked_for,
    broke_down,
    changes,
    comparable_results,
    compared_digests,
    digests_of,
    most_changed_first,
    regressed,
    step_names,
    verify_comparable,
)
from dropspin.comparisons.results.provenance import versions_behind
from dropspin.comparisons.results.results import Results
from dropspin.comparisons.results.table import Measurement, are_among, as_table
from dropspin.scenarios import DropspinError
from dropspin.scenarios.validation import validated

VERDICTS: dict[str, Verdict] = {"same": "passed", "better": "passed", "lower": "passed", "worse": "failed", "moved": "failed"}
LOST = ("gone", "undefined")
ACCEPTED = {"order": "accepted order", "asymptotic_error": "accepted asymptotic error", "ensemble": "accepted mean"}
"""The column `truth` of a row of kind `baseline`; `accepted` for all others."""

STALE = "the scene has changed since its results were accepted; accept them again"


class NothingAccepted(DropspinError):
    """Raised if a run covers no accepted result of a baseline."""


@dataclass(frozen=True, eq=False)
class Checked:
    """The outcome of a check.

    Attributes:
        results: The run, with a row of kind `baseline` for each accepted result, the largest changes first.
        changes: The results of the run compared with the accepted ones: the table that `changes.changes` returns, largest change first;
            empty without a baseline.
        not_run: Accepted results that the run does not cover, because it has other scenes, engines or time steps.
        attributions: For each pair of an engine and a cause, the number of failing accepted results that are attributed to the cause.
    """

    results: Results
    changes: pd.DataFrame
    not_run: pd.DataFrame
    attributions: Mapping[tuple[str, Attribution], int] = field(default_factory=dict)


def accept(
    results: Results, earlier: Baseline, reason: str, date: datetime.date, *, known_failures: bool = False
) -> tuple[Baseline, pd.DataFrame]:
    """Add the results of a run to a baseline as accepted results.

    An accepted result is kept if the run does not cover it, if the new result differs from it by at most its tolerance, or if the engine
    broke down in the scene or is not installed. If the definition of a scene has changed, all its results are replaced.

    Args:
        results: The run.
        earlier: The earlier baseline; `Baseline()` if there is none.
        reason: The reason why these results are accepted, which is stored with them.
        date: Date of the acceptance.
        known_failures: Whether to accept failed checks as known failures.

    Returns:
        The new baseline, and a table of the differences from the earlier one. The table has a row for each result, with `value` and
        `before` in `unit`, and the `change`: new, worse, moved, better, lower, same, gone or undefined. In a scene whose definition has
        changed all results are new, and those are gone that the run does not have, also of other engines or time steps.

    Raises:
        DropspinError: The run was made with `quick`, or the reason is empty or has several lines.
    """
    verify_comparable(results)
    measured = comparable_results(results)
    earlier = _with_current_names(earlier, results, set(measured["engine"]))
    covered = asked_for(earlier.results, results)
    measured["known_failure"] = (measured["verdict"] == "failed") & known_failures
    is_replaced = _has_other_scene(covered, earlier, results)
    comparable, replaced = covered[~is_replaced], covered[is_replaced]
    found = changes(comparable, measured)
    lost = found["change"].isin(LOST) & broke_down(found, results)
    kept = comparable.merge(found.loc[(found["change"] == "same") | lost, KEY], on=KEY)
    now = kept[KEY].merge(measured[[*KEY, "verdict", "known_failure"]], on=KEY, how="left")
    flags = now["known_failure"].eq(True) | ((now["verdict"] == "failed") & kept["known_failure"])
    kept["known_failure"] = np.where(now["verdict"].isna(), kept["known_failure"], flags)
    stamp = results.provenance
    adapters = {engine: code for engine, code in stamp["adapters"].items() if code is not None and (measured["engine"] == engine).any()}
    settings = {engine: common_settings(stamp, engine) for engine in adapters}
    names = {engine: name for engine in adapters if ":" in (name := stamp["names"].get(engine, ""))}
    content = {"date": date, "reason": reason, "versions": versions_behind(stamp), "cpu": stamp["cpu"], "code": stamp["code"]}
    acceptance = validated(Acceptance, "accept", content | {"adapters": adapters, "names": names, "settings": settings})
    moved = measured[~are_among(measured, kept, KEY)].assign(by=acceptance.key)
    outside = earlier.results.drop(covered.index)
    is_of_another_scene = _has_other_scene(outside, earlier, results)
    table = pd.concat([outside[~is_of_another_scene], kept, moved], ignore_index=True)[list(COLUMNS)]
    scenes = {name: scene.digest for name, scene in results.scenes.items()}
    every = {acceptance.key: acceptance, **earlier.acceptances}
    accepted = Baseline(
        {key: one for key, one in every.items() if key in set(table["by"])},
        {**earlier.engines, **{label: name for label, name in stamp["names"].items() if name != label}},
        {**earlier.scenes, acceptance.key: {**earlier.scenes.get(acceptance.key, {}), **scenes}},
        {**earlier.motions, acceptance.key: {**earlier.motions.get(acceptance.key, {}), **digests_of(stamp)}},
        table,
    )
    removed = changes(pd.concat([outside[is_of_another_scene], replaced[~are_among(replaced, measured, KEY)]]), measured.iloc[:0])
    return accepted, pd.concat([found[~lost], removed], ignore_index=True)


def check(results: Results, baseline: Baseline | str | Path | None = None) -> Checked:
    """Compare a run with accepted results.

    A result fails if it is absent, or worse than the accepted result by more than the tolerance; a better result passes. A failed check
    that was accepted as a known failure has the verdict `known`, unless its result is worse than the accepted one; the verdicts of all
    other checks of the run stay the same.

    Args:
        results: The run.
        baseline: The accepted results, from `load_baseline`, or their file; with None, only the checks of the run itself count.

    Returns:
        `results`, the run with a row of kind `baseline` for each accepted result, whose `exit_code()` is that of the check;
        `changes`, its results compared with the accepted ones; and `not_run`, the accepted results that the run does not cover.

    Raises:
        DropspinError: The run was made with `quick`, and there is a baseline.
        NothingAccepted: The run covers no accepted result, so there is nothing to check. If engines broke down, this is reported instead.
    """
    if isinstance(baseline, str | Path):
        baseline = load_baseline(baseline)
    if baseline is None:
        nothing = comparable_results(results).iloc[:0]
        return Checked(results, changes(nothing, nothing), nothing)
    verify_comparable(results)
    baseline = _with_current_names(baseline, results, results.engines)
    accepted = asked_for(baseline.results, results)
    if accepted.empty and not results.breakdowns.any():
        raise NothingAccepted(
            f"none of the {len(baseline.results):,} accepted results is covered by this run's scenes, engines and time steps; "
            "run the accepted scenes, engines and time steps, or accept this run."
        )
    of_other_scenes = _has_other_scene(accepted, baseline, results)
    measured = comparable_results(results)
    comparable = measured[~are_among(measured, accepted[of_other_scenes], KEY)]
    found = changes(accepted[~of_other_scenes], comparable).merge(accepted[[*KEY, "by", "known_failure"]], on=KEY, how="left")
    found = most_changed_first(found)
    causes = _causes(found, baseline, results)
    noted = found.assign(note=[f"; {CORRECTION}" if number in causes and causes[number].is_correction else "" for number in found.index])
    stale = accepted.loc[of_other_scenes, ["scene", "engine"]].drop_duplicates().to_numpy()
    rows = [
        Measurement(scene=scene, engine=engine, kind="baseline", truth="accepted", verdict="failed", reason=STALE, basis="scene_changed")
        for scene, engine in stale
    ]
    rows += _lost_rows(results, noted[noted["change"].isin(LOST)])
    for row in noted[~noted["change"].isin(["new", *LOST])].to_dict("records"):
        by = baseline.acceptances[row["by"]]
        by_how_much = f"{abs(row['value'] - row['before']):.3g}, {row['in_tolerances']:,.3g} times its tolerance"
        away = "" if row["change"] == "same" else f"; {row['change']} by {by_how_much}"
        reason = f"accepted {row['before']:.6g} ± {row['tolerance']:.2g} on {by.date}, {by.reason}{away}{row['note']}"
        lower, upper = (row[name] if np.isfinite(row[name]) else np.nan for name in ("lower", "upper"))
        rows.append(_row(row, VERDICTS[row["change"]], reason, value=row["value"], lower=lower, upper=upper))
    table = pd.concat([_with_known_failures(results, found), as_table(rows)], ignore_index=True)
    attributions = Counter((found["engine"][number], cause) for number, cause in causes.items())
    return Checked(replace(results, table=table), found, baseline.results.drop(accepted.index), attributions)


def redefined(results: Results, baseline: Baseline) -> list[str]:
    """The scenes of a run that have accepted results of another definition."""
    return sorted(set(baseline.results.loc[_has_other_scene(baseline.results, baseline, results), "scene"]))


def _has_other_scene(rows: pd.DataFrame, baseline: Baseline, results: Results) -> "pd.Series[bool]":
    """Whether each accepted result is of a scene that is another one in a run."""
    pairs = zip(rows["by"], rows["scene"], strict=True)
    differ = [scene in results.scenes and baseline.scenes[by][scene] != results.scenes[scene].digest for by, scene in pairs]
    return pd.Series(differ, rows.index, dtype=bool)


def _causes(found: pd.DataFrame, baseline: Baseline, results: Results) -> dict[int, Attribution]:
    """By the number of its row, the cause to which each failing accepted result is attributed."""
    stamp, digests = results.provenance, digests_of(results.provenance)
    same = {str(engine): set(rows["by"]) for engine, rows in found.groupby("engine") if set(rows["change"]) == {"same"}}

    @cache
    def around(by: str) -> Mapping[str, str]:
        return surroundings(baseline.acceptances[by].stamp_of(""), stamp)

    @cache
    def attributed(engine: str, by: str, motions: Motion) -> Attribution:
        # Libraries that have not changed since the results of another engine were accepted are not excluded by these.
        unmoved = [other for other, accepted in same.items() if all(around(by).items() <= around(one).items() for one in accepted)]
        return attribute(baseline.acceptances[by].stamp_of(engine), stamp, engine, unmoved, motions)

    failing = regressed(found)
    return {
        number: attributed(row["engine"], row["by"], compared_digests(row, baseline.motions.get(row["by"], {}), digests))
        for number, row in zip(failing.index, failing.to_dict("records"), strict=True)
    }


def _with_current_names(baseline: Baseline, results: Results, labels: Collection[str]) -> Baseline:
    """The baseline, in which an engine that has another label in a run, one of some, has this one: they were asked for by one name."""
    held = set(baseline.results["engine"])
    called = {name: label for label, name in results.provenance["names"].items() if label in labels and label not in held}
    renamed = {old: called[name] for old, name in baseline.engines.items() if old not in results.engines and name in called}
    return baseline.relabelled(renamed) if renamed else baseline


def _row(found: Mapping[Any, Any], verdict: Verdict, reason: str, **others: Any) -> Measurement:
    """A row of kind `baseline` about an accepted result; without a value unless one is given."""
    identity = {name: found[name] for name in ("scene", "engine", "metric", "unit")} | others
    dt = np.nan if "," in found["steps"] else float(found["steps"])
    truth = ACCEPTED.get(found["kind"], "accepted")
    return Measurement(**identity, dt=dt, kind="baseline", truth=truth, verdict=verdict, reason=reason)


def _lost_rows(results: Results, gone: pd.DataFrame) -> Iterator[Measurement]:
    """Rows for accepted results that the run lacks: one for each engine that did not run a scene, otherwise one for each result.

    An order or an asymptotic error that is now undefined does not fail, because the errors from which it is computed are checked
    themselves.
    """
    remarks = results.table[results.table["metric"] == ""].assign(steps=step_names(results))
    remarks = remarks[~remarks["verdict"].isin(["limited", "no_truth"])]
    reasons = {(row.scene, row.engine, row.steps): f"{row.verdict}: {row.reason}" for row in remarks.itertuples()}
    for where, lost in gone.groupby(["scene", "engine", "steps"], sort=False):
        records = lost.to_dict("records")
        if where in reasons:
            yield _row(records[0], "failed", f"{len(lost)} accepted results are gone, {reasons[where]}", metric="", unit="")
            continue
        for row in records:
            verdict: Verdict = "failed" if row["change"] == "gone" else "measured"
            now = f"not measured now{row['note']}" if row["change"] == "gone" else "undefined now"
            yield _row(row, verdict, f"accepted {row['before']:.6g}, {now}")


def _with_known_failures(results: Results, found: pd.DataFrame) -> pd.DataFrame:
    """The run's table, in which failures that were accepted as known and are not worse have the verdict `known`."""
    known = found[found["known_failure"].fillna(value=False).astype(bool) & (found["change"].map(VERDICTS) == "passed")]
    table = results.table.copy()
    rows = are_among(table.assign(steps=step_names(results)), known, KEY) & table["verdict"].isin(FAILURES)
    table.loc[rows, "reason"] = "accepted as a known failure; " + table.loc[rows, "reason"]
    table.loc[rows, ["basis", "verdict"]] = ["accepted_failure", "known"]
    return table
