"""The comparison of a run with a baseline, in which each accepted result gets a row of kind `baseline` with a verdict."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from dropspin.comparisons.judging.convergence import STUDIES
from dropspin.comparisons.judging.verdicts import FAILURES, Verdict
from dropspin.comparisons.regressions.attribution import CORRECTION, Attribution, attribute
from dropspin.comparisons.regressions.baseline import Baseline
from dropspin.comparisons.regressions.motions import Motion, compared_digests, digests_of
from dropspin.comparisons.regressions.values import (
    KEY,
    asked_for,
    changes,
    comparable_results,
    most_changed_first,
    regressed,
    step_names,
    verify_comparable,
)
from dropspin.comparisons.results.results import Results
from dropspin.comparisons.results.table import Measurement, as_table
from dropspin.scenarios import DropspinError

VERDICTS: dict[str, Verdict] = {"same": "passed", "better": "passed", "worse": "failed", "moved": "failed", "gone": "failed"}
ACCEPTED = {"order": "accepted order", "asymptotic_error": "accepted asymptotic error", "ensemble": "accepted mean"}
"""The column `truth` of a row of kind `baseline`; `accepted` for all others."""


class NothingAccepted(DropspinError):
    """A baseline has no result that the run covers."""


@dataclass(frozen=True, eq=False)
class Checked:
    """The outcome of a check.

    Attributes:
        results: The run, with a row of kind `baseline` for each accepted result, the largest changes first.
        changes: The results of the run compared with the accepted ones: the table that `values.changes` returns, largest change first;
            empty without a baseline.
        not_run: Accepted results that the run does not cover, because it has other scenes, engines or time steps.
        attributions: For each engine with failing accepted results, the causes to which they are attributed, and how many to each.
    """

    results: Results
    changes: pd.DataFrame
    not_run: pd.DataFrame
    attributions: Mapping[tuple[str, Attribution], int] = field(default_factory=dict)


def check(results: Results, baseline: Baseline | None = None) -> Checked:
    """Compare a run with accepted results. The verdicts on the expectations of its scenes stay unchanged.

    A result fails if it is gone, or worse than the accepted result by more than the tolerance; a better result passes. A failed check that
    was accepted as a known failure is `known` as long as its result is not worse.

    Args:
        results: The run.
        baseline: The accepted results, from `load_baseline`; with None, only the expectations of the scenes are checked.

    Returns:
        `results`, the run with a row of kind `baseline` for each accepted result, whose `exit_code()` is that of the check;
        `changes`, its results compared with the accepted ones; and `not_run`, the accepted results that the run does not cover.

    Raises:
        DropspinError: The run is quick, and there is a baseline.
        NothingAccepted: The run covers no accepted result, so that the check would be empty. Not raised if engines broke down, which is
            reported instead.
    """
    if baseline is None:
        nothing = comparable_results(results).iloc[:0]
        return Checked(results, changes(nothing, nothing), nothing)
    verify_comparable(results)
    accepted = asked_for(_with_current_names(baseline, results), results)
    if accepted.empty and not results.breakdowns.any():
        raise NothingAccepted(
            f"none of the {len(baseline.results):,} accepted results is covered by this run's scenes, engines and time steps; "
            "run the accepted scenes, engines and time steps, or accept this run."
        )
    digests = {name: scene.digest for name, scene in results.scenes.items()}
    another = accepted["scene"].map(lambda name: baseline.scenes[name] != digests[name]).astype(bool)
    mine = comparable_results(results)
    comparable = mine[~mine["scene"].isin(accepted.loc[another, "scene"])]
    found = changes(accepted[~another], comparable).merge(accepted[[*KEY, "by", "known_failure"]], on=KEY, how="left")
    found = most_changed_first(found)
    causes = _causes(found, baseline, results)
    corrections = {number for number, cause in causes.items() if cause.is_correction}
    found = found.assign(note=[f"; {CORRECTION}" if number in corrections else "" for number in found.index])
    rows = [_scene_changed(scene, engine) for scene, engine in accepted.loc[another, ["scene", "engine"]].drop_duplicates().to_numpy()]
    rows += _lost_rows(results, found[found["change"] == "gone"])
    rows += [_judged(row, baseline) for row in found[~found["change"].isin(["new", "gone"])].to_dict("records")]
    table = pd.concat([_with_known_failures(results, found), as_table(rows)], ignore_index=True)
    attributions = Counter((found["engine"][number], cause) for number, cause in causes.items())
    return Checked(replace(results, table=table), found.drop(columns="note"), baseline.results.drop(accepted.index), attributions)


def _causes(found: pd.DataFrame, baseline: Baseline, results: Results) -> dict[int, Attribution]:
    """By the number of its row, the cause to which each failing accepted result is attributed."""
    failing, stamp, digests = regressed(found), results.provenance, digests_of(results.provenance)
    unmoved = [str(engine) for engine, changes in found.groupby("engine")["change"] if set(changes) == {"same"}]
    known: dict[tuple[str, str, Motion], Attribution] = {}
    causes = {}
    for number, row in zip(failing.index, failing.to_dict("records"), strict=True):
        engine, by = row["engine"], row["by"]
        of_row = compared_digests(row, baseline.motions.get(by, {}), digests)
        if (engine, by, of_row) not in known:
            earlier = baseline.acceptances[by].stamp_of(engine)
            known[engine, by, of_row] = attribute(earlier, stamp, engine, unmoved, of_row)
        causes[number] = known[engine, by, of_row]
    return causes


def _with_current_names(baseline: Baseline, results: Results) -> pd.DataFrame:
    """The accepted results, in which an engine with another label, or one that cannot be imported, is identified by its requested name."""
    held = set(baseline.results["engine"])
    called = {name: label for label, name in results.provenance["names"].items() if label not in held}
    renamed = {old: called[name] for old, name in baseline.engines.items() if old not in results.engines and name in called}
    return baseline.results.assign(engine=baseline.results["engine"].replace(renamed))


def _judged(found: dict[Any, Any], baseline: Baseline) -> Measurement:
    """The row of an accepted result that the run also measured."""
    by = baseline.acceptances[found["by"]]
    away = "" if found["change"] == "same" else f"; {found['change']} by {found['in_tolerances']:,.3g} times its tolerance"
    reason = f"accepted {found['before']:.6g} ± {found['tolerance']:.2g} on {by.date}, {by.reason}{away}{found['note']}"
    lower, upper = (found[name] if np.isfinite(found[name]) else np.nan for name in ("lower", "upper"))
    return replace(_row(found), lower=lower, upper=upper, value=found["value"], verdict=VERDICTS[found["change"]], reason=reason)


def _row(found: dict[Any, Any]) -> Measurement:
    """A failed row of kind `baseline`, without a value."""
    dt = np.nan if "," in found["steps"] else float(found["steps"])
    truth = ACCEPTED.get(found["kind"], "accepted")
    identity = {name: found[name] for name in ("scene", "engine", "metric", "unit")}
    return Measurement(**identity, dt=dt, kind="baseline", truth=truth, verdict="failed")


def _lost_rows(results: Results, gone: pd.DataFrame) -> list[Measurement]:
    """Rows for accepted results that the run lacks: one for each engine that did not run a scene, otherwise one for each result.

    An order or an asymptotic error that is now undefined does not fail, because the errors from which it is computed are checked
    themselves.
    """
    remarks = results.table[results.table["metric"] == ""].assign(steps=step_names(results))
    remarks = remarks[~remarks["verdict"].isin(["limited", "no_truth"])]
    reasons = {(row.scene, row.engine, row.steps): f"{row.verdict}: {row.reason}" for row in remarks.itertuples()}
    rows: list[Measurement] = []
    for _, lost in gone.groupby(["scene", "engine", "steps"], sort=False):
        first = lost.iloc[0].to_dict()
        where = first["scene"], first["engine"], first["steps"]
        if where in reasons:
            reason = f"{len(lost)} accepted results are gone, {reasons[where]}"
            rows.append(replace(_row(first), metric="", unit="", reason=reason))
            continue
        for row in lost.to_dict("records"):
            if row["kind"] in STUDIES:
                rows.append(replace(_row(row), verdict="measured", reason=f"accepted {row['before']:.6g}, undefined now"))
            else:
                rows.append(replace(_row(row), reason=f"accepted {row['before']:.6g}, not measured now{row['note']}"))
    return rows


def _scene_changed(scene: str, engine: str) -> Measurement:
    reason = "the scene has changed since its results were accepted; accept them again"
    return Measurement(
        scene=scene, engine=engine, kind="baseline", truth="accepted", verdict="failed", reason=reason, basis="scene_changed"
    )


def _with_known_failures(results: Results, found: pd.DataFrame) -> pd.DataFrame:
    """The run's table, in which failures that were accepted as known and are not worse have the verdict `known`."""
    known = found[found["known_failure"].fillna(value=False).astype(bool) & (found["change"].map(VERDICTS) == "passed")]
    keys = pd.MultiIndex.from_frame(results.table.assign(steps=step_names(results))[KEY])
    rows = keys.isin(pd.MultiIndex.from_frame(known[KEY])) & results.table["verdict"].isin(FAILURES).to_numpy()
    table = results.table.copy()
    table.loc[rows, "reason"] = "accepted as a known failure; " + table.loc[rows, "reason"]
    table.loc[rows, "basis"] = "accepted_failure"
    table.loc[rows, "verdict"] = "known"
    return table
