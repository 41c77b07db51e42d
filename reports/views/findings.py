"""The findings of a run, counted and in words; terminal, HTML and Markdown share them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import pandas as pd

from comparisons.engines.base import calibrated_label
from comparisons.judging.convergence import STUDIES
from comparisons.judging.verdicts import BREAKDOWNS, FAILURES, HOLDS_AGAIN, VERDICTS
from comparisons.results.results import NEGLIGIBLE, Results
from reports.views.numbers import word

STATUS_WORDS = {"limited": "outside the documented range"}

SEVERITY = ("crashed", "timed_out", "diverged", "failed", "missing", "declined", "known", "limited", "no_truth", "passed", "measured")
"""Worst first: the verdict that represents a scene and an engine."""
assert set(SEVERITY) == set(VERDICTS)


@dataclass(frozen=True)
class Counts:
    """The checks of a run.

    Attributes:
        passed: How many passed.
        failed: How many failed.
        known: How many show a fault that is expected by name.
        fixed: How many passed although such a fault is expected.
        limited: How many would fail, but for a known limitation of the engine.
        of_studies: How many of those that passed or failed are on orders and asymptotic errors.
        broken: How many rows are of engines that broke down.
    """

    passed: int
    failed: int
    known: int
    fixed: int
    limited: int
    of_studies: int
    broken: int


def counts(results: Results) -> Counts:
    """The verdicts of a run, counted."""
    verdicts = results.table["verdict"]
    passed, failed, known = verdicts == "passed", verdicts.isin(FAILURES), verdicts == "known"
    fixed = passed & results.table["reason"].str.startswith(HOLDS_AGAIN)
    limited = (verdicts == "limited") & (results.table["metric"] != "")
    of_studies = (passed | failed) & results.table["kind"].isin(STUDIES)
    broken = verdicts.isin(BREAKDOWNS)
    return Counts(*(int(rows.sum()) for rows in (passed, failed, known, fixed, limited, of_studies, broken)))


class Status(NamedTuple):
    """What became of an engine in a scene: its worst verdict, and the status in words."""

    verdict: str
    words: str


def statuses(results: Results) -> dict[str, dict[str, Status]]:
    """The status of each engine in each scene."""
    own = results.table[results.table["kind"] != "agreement"]
    by_pair = {(str(scene), str(engine)): rows for (scene, engine), rows in own.groupby(["scene", "engine"])}
    return {scene: {engine: _status(by_pair.get((scene, engine))) for engine in results.engines} for scene in results.scenes}


def _status(rows: pd.DataFrame | None) -> Status:
    if rows is None:
        return Status("missing", word("missing"))
    mentioned = rows[(rows["verdict"] != "known") | (rows["value"].abs() > NEGLIGIBLE)]
    worst = min(mentioned["verdict"], key=SEVERITY.index)
    of_model = bool((rows.loc[rows["verdict"] == "known", "cause"] == "model").any())
    studied = worst in ("passed", "measured") and bool((rows["kind"] == "asymptotic_error").any())
    words = "known model error" if of_model and worst == "known" else "converges" if studied else STATUS_WORDS.get(worst, word(worst))
    return Status(worst, words)


def asymptotic_errors(results: Results, cause: str) -> dict[str, list[str]]:
    """For each engine the scenes in which an error with this cause does not vanish as dt → 0, negligible ones left out."""
    rows = results.asymptotic_errors(cause)
    worth = rows[rows["value"].abs() > NEGLIGIBLE]
    return {
        engine: [scene for scene in results.scenes if ((worth["engine"] == engine) & (worth["scene"] == scene)).any()]
        for engine in results.engines
    }


@dataclass(frozen=True)
class ProfileComparison:
    """An engine with default settings compared with the same engine, calibrated.

    Attributes:
        engine: Label of the engine with default settings.
        calibrated: Label of the calibrated one.
        rows: Errors of both at the finest step; `part` is the share of the first that the calibrated engine does not have.
    """

    engine: str
    calibrated: str
    rows: list[dict[str, Any]]

    @property
    def sentence(self) -> str:
        """The comparison in one sentence."""
        parts = sorted(row["part"] for row in self.rows)
        half = parts[len(parts) // 2]
        return (
            f"{self.engine}: {sum(part > 0.5 for part in parts)} of its {len(parts)} errors above {NEGLIGIBLE:g} at the finest time step "
            f"are mostly setting errors; the median share is {100 * half:.1f} %."
        )


def profile_comparisons(results: Results) -> list[ProfileComparison]:
    """For each engine that was run with default settings and calibrated: how much of the errors is due to settings."""
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
    """The smallest and the largest observed order of an engine's errors in a scene; None if there is none."""
    frame = results.table
    mine = frame[(frame["kind"] == "order") & (frame["scene"] == scene) & (frame["engine"] == engine)]
    found = mine.loc[mine["cause"] == "discretisation", "value"].dropna()
    return (float(found.min()), float(found.max())) if len(found) else None


def verdict_sentence(results: Results, tally: Counts) -> str:
    """The outcome of the checks in one sentence."""
    judged = tally.passed + tally.failed
    if tally.broken:
        judgement = f"; {tally.failed} of {judged} checks fail" if judged else ""
        return f"{tally.broken} engine {'run' if tally.broken == 1 else 'runs'} broke down{judgement}{_known(tally)}."
    if tally.failed:
        return f"{tally.failed} of {judged} checks fail{_known(tally)}."
    if judged == 0 and tally.known:
        return f"No check passes or fails{_known(tally)}."
    if judged == 0:
        set_at_all = any(scene.expect for scene in results.scenes.values())
        none = "No expectation covers these engines at these time steps" if set_at_all else "The scenes have no expectations"
        return f"{none}; {len(results.measurements):,} values were measured."
    kinds = [f"{judged - tally.of_studies} expectations of the scenes", f"{tally.of_studies} orders and asymptotic errors"]
    both = " and ".join(kind for kind in kinds if not kind.startswith("0 "))
    return f"All {judged} checks pass: {both}{_known(tally)}."


def _known(tally: Counts) -> str:
    """The results that show known faults, those that do no longer, and those within limitations, as the end of a sentence."""
    known = f"; {tally.known} {'result shows' if tally.known == 1 else 'results show'} known faults" if tally.known else ""
    limited = f"; {tally.limited} {'is' if tally.limited == 1 else 'are'} within known limitations of engines" if tally.limited else ""
    return (
        known + limited + (f"; {tally.fixed} expected {'fault does' if tally.fixed == 1 else 'faults do'} not show" if tally.fixed else "")
    )


def _undecided(limits: pd.DataFrame) -> list[str]:
    """The metrics, once for each scene, whose interval contains 0 and values that are not negligible, so that no cause is stated."""
    reach = limits[["lower", "upper"]].abs().max(axis=1)
    return [metric.replace("_", " ") for metric in limits.loc[(limits["cause"] == "unresolved") & (reach > NEGLIGIBLE), "metric"]]


def _known_scenes(results: Results, engine: str) -> list[str]:
    """The scenes in which results of an engine show a fault that is expected by name, negligible ones left out."""
    known = (results.table["verdict"] == "known") & (results.table["value"].abs() > NEGLIGIBLE)
    return list(results.table.loc[known & (results.table["engine"] == engine), "scene"].unique())


def finding_sentences(results: Results, lasting: Mapping[str, Mapping[str, list[str]]], profiles: Sequence[ProfileComparison]) -> list[str]:
    """The main finding about each engine.

    Args:
        results: The run.
        lasting: By cause and engine, the scenes with errors that do not vanish as dt → 0.
        profiles: Engines with default settings compared with the calibrated ones.
    """
    missing = results.table[results.table["verdict"] == "missing"].drop_duplicates("engine")
    sentences = [f"{row.reason}" for row in missing.itertuples()]
    models, settings = lasting["model"], lasting["setting"]
    limits = results.table[results.table["kind"] == "asymptotic_error"]
    studied = limits.groupby("engine")["scene"].nunique()
    for engine in results.engines:
        stuck, total = models[engine], int(studied.get(engine, 0))
        if stuck:
            sentences.append(
                f"{engine}: model error in {len(stuck)} of {total} scenes ({', '.join(stuck)}): an error that does not vanish as dt → 0."
            )
        known = [scene for scene in _known_scenes(results, engine) if scene not in stuck]
        if known:
            sentences.append(f"{engine}: known {'fault' if len(known) == 1 else 'faults'} at these time steps in {', '.join(known)}.")
        if settings[engine]:
            sentences.append(
                f"{engine}: setting error in {len(settings[engine])} of {total} scenes ({', '.join(settings[engine])}): "
                "an error that does not vanish as dt → 0, but that the calibrated profile does not have."
            )
        opened = _undecided(limits[limits["engine"] == engine])
        if total and not stuck and not settings[engine] and not opened and not known:
            where = f" in all {total} scenes" if total > 1 else ""
            sentences.append(f"{engine}: errors above {NEGLIGIBLE:g} vanish as dt → 0{where}.")
        elif opened:
            none = "" if stuck or settings[engine] else "no model error; "
            sentences.append(f"{engine}: {none}undecided by these time steps: {', '.join(dict.fromkeys(opened))}.")
    return sentences + [comparison.sentence for comparison in profiles]
