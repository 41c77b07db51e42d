"""What a run found, in words and counts; the one place that reports agree on."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from comparisons import Results
from comparisons.verdicts import BREAKDOWNS, FAILURES, VERDICTS

PLATEAU = 1.5
"""An error that shrinks by less than this over the whole range of steps does not shrink with the step."""
NEGLIGIBLE = 1e-4
"""Errors below this (of the scene's scale, in m or in rad) are not worth a sentence."""

# Worst first: the verdict that stands for a scene and an engine in the matrix.
SEVERITY = ("crashed", "timed_out", "diverged", "failed", "missing", "declined", "limited", "no_truth", "passed", "measured")
assert set(SEVERITY) == set(VERDICTS)


@dataclass(frozen=True)
class Counts:
    """How many expectations held and failed, and how many rows broke down."""

    passed: int
    failed: int
    broken: int


def counts(results: Results) -> Counts:
    """The verdicts of a run, counted."""
    verdicts = results.frame["verdict"]
    return Counts(int((verdicts == "passed").sum()), int(verdicts.isin(FAILURES).sum()), int(verdicts.isin(BREAKDOWNS).sum()))


def worst_verdicts(results: Results) -> dict[tuple[str, str], str]:
    """For each scene and engine, the verdict that counts."""
    own = results.frame[results.frame["kind"] != "agreement"]
    worst: dict[tuple[str, str], str] = {}
    for scene, engine, verdict in zip(own["scene"], own["engine"], own["verdict"], strict=True):
        worst[scene, engine] = min(verdict, worst.get((scene, engine), verdict), key=SEVERITY.index)
    return worst


def failures(results: Results) -> pd.DataFrame:
    """The rows that failed or broke down."""
    return results.frame[results.frame["verdict"].isin(FAILURES | BREAKDOWNS)]


def plateaus(results: Results) -> dict[str, list[str]]:
    """For each engine the scenes in which an error against the truth does not shrink with the step."""
    if results.frame["dt"].nunique() < 2:
        return {engine: [] for engine in results.engines}
    truth = results.frame[(results.frame["kind"] == "truth") & results.frame["value"].notna()]
    found: dict[str, list[str]] = {}
    for engine in results.engines:
        mine = truth[truth["engine"] == engine]
        if mine.empty:
            found[engine] = []
            continue
        sizes = mine.assign(value=mine["value"].abs()).pivot_table(index=["scene", "metric"], columns="dt", values="value", sort=False)
        finest, coarsest = sizes[mine["dt"].min()], sizes[mine["dt"].max()]
        stuck = finest[(finest > NEGLIGIBLE) & (coarsest < PLATEAU * finest)]
        found[engine] = [str(scene) for scene in stuck.index.unique("scene")]
    return found


def verdict_sentence(results: Results) -> str:
    """What came of the expectations, one sentence."""
    tally = counts(results)
    judged = tally.passed + tally.failed
    if tally.broken:
        return f"{tally.broken} engine runs broke down; of {judged} expectations {tally.failed} fail."
    if tally.failed:
        return f"{tally.failed} of {judged} expectations fail."
    if judged == 0:
        return "No expectations were set; everything was measured."
    return f"All {judged} expectations hold."


def finding_sentences(results: Results) -> list[str]:
    """What a reader should know first about each engine."""
    steps = np.sort(results.frame["dt"].unique())
    sentences = []
    missing = results.frame[results.frame["verdict"] == "missing"].drop_duplicates("engine")
    sentences += [f"{row.reason}" for row in missing.itertuples()]
    if len(steps) < 2:
        return sentences
    found = plateaus(results)
    ran = results.frame[results.frame["kind"] == "truth"].groupby("engine")["scene"].nunique()
    for engine in results.engines:
        stuck, total = found[engine], int(ran.get(engine, 0))
        if total and stuck:
            sentences.append(
                f"{engine}: in {len(stuck)} of {total} scenes ({', '.join(stuck)}) an error does not shrink with the step "
                f"from {steps[-1]:g} to {steps[0]:g} s: it is the model's, no step cures it."
            )
        elif total:
            where = f"in all {total} scenes " if total > 1 else ""
            sentences.append(f"{engine}: {where}every error above {NEGLIGIBLE:g} shrinks with the step.")
    return sentences
