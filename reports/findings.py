"""What a run found, in words and counts; the one place that reports agree on."""

from dataclasses import dataclass
from typing import Any

from comparisons import Results
from comparisons.engines.base import calibrated_label
from comparisons.studies import STUDIES
from comparisons.verdicts import BREAKDOWNS, FAILURES, VERDICTS

NEGLIGIBLE = 1e-4
"""Errors below this (of the scene's scale, in m or in rad) are not worth a sentence."""

# Worst first: the verdict that stands for a scene and an engine in the matrix.
SEVERITY = ("crashed", "timed_out", "diverged", "failed", "missing", "declined", "limited", "no_truth", "passed", "measured")
assert set(SEVERITY) == set(VERDICTS)


@dataclass(frozen=True)
class Counts:
    """How many checks held and failed, how many of them are of limits and orders, and how many rows broke down."""

    passed: int
    failed: int
    of_studies: int
    broken: int


def counts(results: Results) -> Counts:
    """The verdicts of a run, counted."""
    verdicts = results.frame["verdict"]
    passed, failed = verdicts == "passed", verdicts.isin(FAILURES)
    of_studies = (passed | failed) & results.frame["kind"].isin(STUDIES)
    return Counts(int(passed.sum()), int(failed.sum()), int(of_studies.sum()), int(verdicts.isin(BREAKDOWNS).sum()))


def verdicts(results: Results) -> dict[tuple[str, str], list[str]]:
    """For each scene and engine its verdicts, the one that counts first."""
    own = results.frame.loc[results.frame["kind"] != "agreement", ["scene", "engine", "verdict"]].drop_duplicates()
    by_engine = own.groupby(["scene", "engine"])["verdict"]
    return {(str(scene), str(engine)): sorted(mine, key=SEVERITY.index) for (scene, engine), mine in by_engine}


def lasting_errors(results: Results, cause: str) -> dict[str, list[str]]:
    """For each engine the scenes in which an error that is worth a word, and of this cause, does not vanish with the step."""
    lasting = results.lasting_errors(cause)
    worth = lasting[lasting["value"].abs() > NEGLIGIBLE]
    return {
        engine: [scene for scene in results.scenes if ((worth["engine"] == engine) & (worth["scene"] == scene)).any()]
        for engine in results.engines
    }


@dataclass(frozen=True)
class ProfileComparison:
    """An engine with its defaults beside the same engine, calibrated.

    Attributes:
        engine: Label of the one with its defaults.
        calibrated: Label of the other.
        rows: Errors of both at the finest step; `part` is how much of the first one the calibrated engine does not have.
    """

    engine: str
    calibrated: str
    rows: list[dict[str, Any]]

    @property
    def sentence(self) -> str:
        """In one sentence."""
        parts = sorted(row["part"] for row in self.rows)
        half = parts[len(parts) // 2]
        return (
            f"{self.engine}: of its {len(parts)} errors above {NEGLIGIBLE:g} at the finest step, {sum(part > 0.5 for part in parts)} "
            f"are mostly the settings'; in the median {100 * half:.1f} % of an error."
        )


def profile_comparisons(results: Results) -> list[ProfileComparison]:
    """For each engine that was run with its defaults and calibrated: how much of the error was the setting."""
    frame = results.measurements
    truths = frame[(frame["kind"] == "truth") & frame["value"].notna()]
    found = []
    for engine in results.engines:
        twin = calibrated_label(engine)
        if twin not in results.engines:
            continue
        finest = truths[truths["dt"] == truths["dt"].min()].set_index(["scene", "metric"])
        mine, other = (finest[finest["engine"] == label] for label in (engine, twin))
        both = mine.join(other["value"].rename("calibrated"), how="inner")
        worth = both[both["value"].abs() > NEGLIGIBLE].reset_index()
        rows = [
            {
                "scene": row["scene"],
                "metric": row["metric"],
                "unit": row["unit"],
                "default": row["value"],
                "calibrated": row["calibrated"],
                "part": max(0.0, 1.0 - abs(row["calibrated"]) / abs(row["value"])),
            }
            for row in worth.to_dict("records")
        ]
        if rows:
            found.append(ProfileComparison(engine, twin, rows))
    return found


def orders(results: Results, scene: str, engine: str) -> tuple[float, float] | None:
    """The least and the largest order at which an engine's errors vanish in a scene; None if none does at a clear order."""
    frame = results.frame
    mine = frame[(frame["kind"] == "order") & (frame["scene"] == scene) & (frame["engine"] == engine)]
    found = mine.loc[mine["cause"] == "discretisation", "value"].dropna()
    return (float(found.min()), float(found.max())) if len(found) else None


def verdict_sentence(results: Results) -> str:
    """What came of the checks, one sentence."""
    tally = counts(results)
    judged = tally.passed + tally.failed
    if tally.broken:
        judgement = f"; of {judged} checks {tally.failed} fail" if judged else ""
        return f"{tally.broken} {'run' if tally.broken == 1 else 'runs'} of an engine broke down{judgement}."
    if tally.failed:
        return f"{tally.failed} of {judged} checks fail."
    if judged == 0:
        set_at_all = any(scene.expect for scene in results.scenes.values())
        none = "No expectation is for these engines at these steps" if set_at_all else "No expectations were set"
        return f"{none}; {'everything' if len(results.measurements) else 'nothing'} was measured."
    kinds = [f"{judged - tally.of_studies} expectations of the scenes", f"{tally.of_studies} limits and orders"]
    both = " and ".join(kind for kind in kinds if not kind.startswith("0 "))
    return f"All {judged} checks hold: {both}."


def finding_sentences(results: Results) -> list[str]:
    """What a reader should know first about each engine."""
    missing = results.frame[results.frame["verdict"] == "missing"].drop_duplicates("engine")
    sentences = [f"{row.reason}" for row in missing.itertuples()]
    models, settings = lasting_errors(results, "model"), lasting_errors(results, "setting")
    limits = results.frame[results.frame["kind"] == "model_error"]
    studied = limits.groupby("engine")["scene"].nunique()
    for engine in results.engines:
        stuck, total = models[engine], int(studied.get(engine, 0))
        if stuck:
            sentences.append(
                f"{engine}: model error in {len(stuck)} of {total} scenes ({', '.join(stuck)}): an error that stays as the step goes to 0."
            )
        if settings[engine]:
            sentences.append(
                f"{engine}: wrong settings in {len(settings[engine])} of {total} scenes ({', '.join(settings[engine])}): "
                "an error that stays as the step goes to 0, and that the calibrated profile does not have."
            )
        if total and not stuck and not settings[engine]:
            where = f"in all {total} scenes " if total > 1 else ""
            sentences.append(f"{engine}: {where}no error above {NEGLIGIBLE:g} stays as the step goes to 0.")
    return sentences + [comparison.sentence for comparison in profile_comparisons(results)]
