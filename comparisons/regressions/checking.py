"""A run held against what was accepted: each figure gets a row of kind `baseline`, and its verdict."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd

from comparisons.regressions.baseline import Baseline
from comparisons.regressions.figures import KEY, asked_for, changes, figures, most_changed_first, steps_in_words
from comparisons.results import Results, as_frame
from comparisons.studies import STUDIES
from comparisons.verdicts import FAILURES, Verdict
from scenarios import DropspinError

VERDICTS: dict[str, Verdict] = {"same": "passed", "better": "passed", "worse": "failed", "moved": "failed", "gone": "failed"}
ACCEPTED = {"order": "accepted order", "model_error": "accepted limit", "ensemble": "accepted mean"}
"""What stands in the column `truth` of a row of kind `baseline`: of all others, `accepted`."""

ANOTHER_SCENE = "the scene simulates something else than when its figures were accepted"
KNOWN = "accepted as a known failure"
"""How the reasons begin of an engine whose scene was changed, and of checks that fail as they were known to."""

Row = dict[str, Any]


class NothingAccepted(DropspinError):
    """A baseline has no figure of what was run."""


@dataclass(frozen=True, eq=False)
class Checked:
    """What came of a check.

    Attributes:
        results: The run, with a row of kind `baseline` for each accepted figure, those that have changed most first.
        changes: Its figures beside the accepted ones, as `changes` has them, most changed first; empty without a baseline.
        not_run: Accepted figures of scenes, engines and steps that are not the run's, so that nothing is said of them.
    """

    results: Results
    changes: pd.DataFrame
    not_run: pd.DataFrame


def check(results: Results, baseline: Baseline | None = None) -> Checked:
    """Hold a run against accepted figures; its own expectations are judged already, and stay as they are.

    A figure fails that is worse than accepted by more than its tolerance, or gone. One that is better passes. A check of the run that
    fails, and was accepted as a known failure, is `limited` as long as its figure is not worse.

    Raises:
        NothingAccepted: No accepted figure is of what was run: a gate that looks at nothing must not stay open. If engines broke down, it
            is not, and that is told instead.
    """
    if baseline is None:
        nothing = figures(results).iloc[:0]
        return Checked(results, changes(nothing, nothing), nothing)
    accepted = asked_for(_by_their_names_now(baseline, results), results)
    if accepted.empty and not results.breakdowns.any():
        raise NothingAccepted(
            f"none of the {len(baseline.figures):,} accepted figures is of this run's scenes, engines and steps; "
            "run what was accepted, or accept what was run."
        )
    digests = {name: scene.digest for name, scene in results.scenes.items()}
    another = accepted["scene"].map(lambda name: baseline.scenes[name] != digests[name]).astype(bool)
    mine = figures(results)
    comparable = mine[~mine["scene"].isin(accepted.loc[another, "scene"])]
    found = changes(accepted[~another], comparable).merge(accepted[[*KEY, "by", "known_failure"]], on=KEY, how="left")
    found = most_changed_first(found)
    rows = [_another_scene(scene, engine) for scene, engine in accepted.loc[another, ["scene", "engine"]].drop_duplicates().to_numpy()]
    rows += _lost_rows(results, found[found["change"] == "gone"])
    rows += [_row(row, baseline) for row in found[~found["change"].isin(["new", "gone"])].to_dict("records")]
    judged = as_frame(rows)
    frame = pd.concat([_known(results, found), judged], ignore_index=True)
    tolerances = np.concatenate([results.tolerances, np.full(len(judged), np.nan)])
    return Checked(replace(results, frame=frame, tolerances=tolerances), found, baseline.figures.drop(accepted.index))


def _by_their_names_now(baseline: Baseline, results: Results) -> pd.DataFrame:
    """The accepted figures; an engine that cannot be imported, or calls itself otherwise now, is known by what it was asked for by."""
    held = set(baseline.figures["engine"])
    called = {name: label for label, name in results.provenance["names"].items() if label not in held}
    renamed = {old: called[name] for old, name in baseline.engines.items() if old not in results.engines and name in called}
    return baseline.figures.assign(engine=baseline.figures["engine"].replace(renamed))


def _row(found: dict[Any, Any], baseline: Baseline) -> Row:
    by = baseline.acceptances[found["by"]]
    away = "" if found["change"] == "same" else f"; {found['change']} by {found['in_tolerances']:,.3g} times its tolerance"
    reason = f"accepted {found['before']:.6g} ± {found['tolerance']:.2g} on {by.date}, {by.reason}{away}"
    bounds = {name: found[name] if np.isfinite(found[name]) else np.nan for name in ("lower", "upper")}
    return _shared(found) | bounds | {"value": found["value"], "verdict": VERDICTS[found["change"]], "reason": reason}


def _shared(found: dict[Any, Any]) -> Row:
    dt = np.nan if "," in found["steps"] else float(found["steps"])
    held = {name: found[name] for name in ("scene", "engine", "metric", "unit")}
    return held | {"dt": dt, "kind": "baseline", "truth": ACCEPTED.get(found["kind"], "accepted")}


def _lost_rows(results: Results, gone: pd.DataFrame) -> list[Row]:
    """Of what a run should have and has not: one row for all figures of an engine that did not run a scene, else one each.

    An order or a limit that can no longer be told follows from the errors, which are figures of their own.
    """
    remarks = results.frame[results.frame["metric"] == ""].assign(steps=steps_in_words(results))
    remarks = remarks[~remarks["verdict"].isin(["limited", "no_truth"])]
    said = {(row.scene, row.engine, row.steps): f"{row.verdict}: {row.reason}" for row in remarks.itertuples()}
    rows: list[Row] = []
    for _, lost in gone.groupby(["scene", "engine", "steps"], sort=False):
        first = lost.iloc[0].to_dict()
        where = first["scene"], first["engine"], first["steps"]
        if where in said:
            reason = f"{len(lost)} accepted figures are gone, {said[where]}"
            rows.append(_shared(first) | {"metric": "", "unit": "", "verdict": "failed", "reason": reason})
            continue
        for row in lost.to_dict("records"):
            of_errors = row["kind"] in STUDIES
            reason = f"accepted {row['before']:.6g}, " + ("cannot be told any more" if of_errors else "and it is gone")
            rows.append(_shared(row) | {"value": np.nan, "verdict": "measured" if of_errors else "failed", "reason": reason})
    return rows


def _another_scene(scene: str, engine: str) -> Row:
    reason = f"{ANOTHER_SCENE}; accept them again"
    return {"scene": scene, "engine": engine, "dt": np.nan, "kind": "baseline", "truth": "accepted", "verdict": "failed", "reason": reason}


def _known(results: Results, found: pd.DataFrame) -> pd.DataFrame:
    """The run's rows, those that fail `limited` where that was accepted and the figure is not worse."""
    excused = found[found["known_failure"].fillna(value=False).astype(bool) & (found["change"].map(VERDICTS) == "passed")]
    keys = pd.MultiIndex.from_frame(results.frame.assign(steps=steps_in_words(results))[KEY])
    rows = keys.isin(pd.MultiIndex.from_frame(excused[KEY])) & results.frame["verdict"].isin(FAILURES).to_numpy()
    frame = results.frame.copy()
    frame.loc[rows, "reason"] = f"{KNOWN}; " + frame.loc[rows, "reason"]
    frame.loc[rows, "verdict"] = "limited"
    return frame
