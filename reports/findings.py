"""What a run found, in words and counts; the one place that reports agree on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from comparisons import Results
from comparisons.verdicts import BREAKDOWNS, FAILURES, VERDICTS

LEAST_STEPS = 3
SMALLEST_RANGE = 3.99
"""Fewer steps than three, or a range of less than four, say nothing about how errors shrink."""
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
    found: dict[str, list[str]] = {engine: [] for engine in results.engines}
    truth = results.frame[(results.frame["kind"] == "truth") & (results.frame["metric"] != "energy_error_raw")]
    for engine in results.engines:
        mine = truth[truth["engine"] == engine]
        table = mine.pivot_table(index=["scene", "metric"], columns="dt", values="value", sort=True, dropna=False)
        dts = [float(dt) for dt in sorted(mine["dt"].unique())]
        if not _says_something(dts):
            continue
        errors = table.to_numpy()
        # An error that changes its sign, or is not known at every step, shows no trend.
        steady = np.abs(np.sign(errors).sum(axis=1)) == len(dts)
        finest, coarsest = np.abs(errors[:, 0]), np.abs(errors[:, -1])
        # Halfway, on a logarithmic scale, between no order and first order.
        stuck = steady & (finest > NEGLIGIBLE) & (coarsest < np.sqrt(dts[-1] / dts[0]) * finest)
        concerned = set(table.index[stuck].get_level_values("scene"))
        found[engine] = [scene for scene in results.scenes if scene in concerned]
    return found


def _says_something(dts: Sequence[float]) -> bool:
    return len(dts) >= LEAST_STEPS and max(dts) / min(dts) >= SMALLEST_RANGE


def verdict_sentence(results: Results) -> str:
    """What came of the expectations, one sentence."""
    tally = counts(results)
    judged = tally.passed + tally.failed
    if tally.broken:
        judgement = f"; of {judged} expectations {tally.failed} fail" if judged else ""
        return f"{tally.broken} {'run' if tally.broken == 1 else 'runs'} of an engine broke down{judgement}."
    if tally.failed:
        return f"{tally.failed} of {judged} expectations fail."
    if judged == 0:
        set_at_all = any(scene.expect for scene in results.scenes.values())
        none = "No expectation is for these engines at these steps" if set_at_all else "No expectations were set"
        return f"{none}; everything was measured."
    return f"All {judged} expectations hold."


def finding_sentences(results: Results) -> list[str]:
    """What a reader should know first about each engine."""
    steps = np.sort(results.frame["dt"].unique())
    sentences = []
    missing = results.frame[results.frame["verdict"] == "missing"].drop_duplicates("engine")
    sentences += [f"{row.reason}" for row in missing.itertuples()]
    if not _says_something(list(steps)):
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
            sentences.append(f"{engine}: {where}no error above {NEGLIGIBLE:g} stays as the step shrinks.")
    return sentences
