"""The findings of a run as counts and sentences, for terminal, HTML and Markdown."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from comparisons.engines.base import calibrated_label
from comparisons.judging.convergence import JUMPING, SATURATION, STUDIES
from comparisons.judging.error_budget import is_sufficient
from comparisons.judging.verdicts import BREAKDOWNS, FAILURES, HOLDS_AGAIN
from comparisons.measuring.tolerances import negligible
from comparisons.results.results import NEGLIGIBLE, UNDECIDED, Results, Status, is_undecided
from reports.views.leading_errors import step_costs
from reports.views.numbers import duration, quantity, size, word

CONVERGING = frozenset({"passed", "measured", "no_truth"})
"""Verdicts that are no finding."""
MOST_NAMED = 2
MOST_METRICS = 3
ENGINE_NAMES = {"document": "document (Wang's method)"}
"""Descriptive names of engines, by label, where the label is not descriptive."""


@dataclass(frozen=True)
class Counts:
    """The checks of a run.

    Attributes:
        passed: Number of passed checks.
        failed: Number of failed checks.
        known: Number of checks that show a fault that the scene expects of the engine by name.
        known_scenes: Number of scenes with such checks.
        fixed: Number of passed checks for which such a fault is expected.
        limited: Number of checks whose failure is explained by a known limitation of the engine.
        of_studies: Number of passed and failed checks of orders and asymptotic errors.
        broken: Number of rows that report a breakdown of an engine.
    """

    passed: int
    failed: int
    known: int
    known_scenes: int
    fixed: int
    limited: int
    of_studies: int
    broken: int


def counts(results: Results) -> Counts:
    """Count the verdicts of a run."""
    verdicts = results.table["verdict"]
    passed, failed, known = verdicts == "passed", verdicts.isin(FAILURES), verdicts == "known"
    fixed = passed & results.table["reason"].str.startswith(HOLDS_AGAIN)
    limited = (verdicts == "limited") & (results.table["metric"] != "")
    of_studies = (passed | failed) & results.table["kind"].isin(STUDIES)
    broken = verdicts.isin(BREAKDOWNS)
    return Counts(
        passed=int(passed.sum()),
        failed=int(failed.sum()),
        known=int(known.sum()),
        known_scenes=results.table.loc[known, "scene"].nunique(),
        fixed=int(fixed.sum()),
        limited=int(limited.sum()),
        of_studies=int(of_studies.sum()),
        broken=int(broken.sum()),
    )


def asymptotic_errors(results: Results, cause: str) -> dict[str, list[str]]:
    """For each engine, the scenes in which an error with this cause does not vanish as dt → 0; negligible errors are left out."""
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
        rows: Errors of both at the finest time step; `part` is the share of the first error that the calibrated engine does not have.
    """

    engine: str
    calibrated: str
    rows: list[dict[str, Any]]

    @property
    def clause(self) -> str:
        """The comparison as a clause that follows the engine's name."""
        parts = sorted(row["part"] for row in self.rows)
        half = parts[len(parts) // 2]
        return (
            f"{sum(part > 0.5 for part in parts)} of its {len(parts)} errors above {NEGLIGIBLE:g} at the finest time step "
            f"are mostly setting errors (median share {100 * half:.1f} %)"
        )

    @property
    def sentence(self) -> str:
        """The comparison in one sentence."""
        return f"{self.engine}: {self.clause}."


def profile_comparisons(results: Results) -> list[ProfileComparison]:
    """For each engine that was run with default and with calibrated settings, the share of its errors that is due to the settings."""
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
    kinds = [f"{judged - tally.of_studies} expectations", f"{tally.of_studies} orders and asymptotic errors"]
    both = " and ".join(kind for kind in kinds if not kind.startswith("0 "))
    return f"All {judged} checks pass: {both}{_known(tally)}."


def _known(tally: Counts) -> str:
    """The end of a sentence: how many values show known errors or are within limitations, how many expected faults do not occur."""
    scenes = _scenes(tally.known_scenes)
    shows = f"show{'s' * (tally.known == 1)} {'a known error' if tally.known == 1 else 'known errors'}"
    known = f"; {tally.known} {'value' if tally.known == 1 else 'values'} in {scenes} {shows}"
    known = known if tally.known else ""
    limited = f"; {tally.limited} {'is' if tally.limited == 1 else 'are'} outside the documented range" if tally.limited else ""
    return (
        known + limited + (f"; {tally.fixed} expected {'fault does' if tally.fixed == 1 else 'faults do'} not occur" if tally.fixed else "")
    )


def finding_sentences(results: Results, lasting: Mapping[str, Mapping[str, list[str]]], profiles: Sequence[ProfileComparison]) -> list[str]:
    """One sentence for each engine, and one for all errors that the time steps leave undecided.

    The sentence gives the number of scenes in which the engine converges, the number with each other status, its largest error, its
    breakdowns, and the cost of a time step. The sentence of a missing engine gives the reason why it is missing.

    Args:
        results: The run.
        lasting: The scenes with errors that do not vanish as dt → 0, by cause and engine.
        profiles: Engines with default settings compared with the calibrated ones.
    """
    missing = results.table[results.table["verdict"] == "missing"].drop_duplicates("engine").set_index("engine")["reason"]
    costs, statuses = step_costs(results), results.statuses()
    sentences, undecided = [], []
    for engine in results.engines:
        if engine in missing:
            sentences.append(str(missing[engine]))
            continue
        remain = {scene for cause in ("model", "setting") for scene in lasting[cause][engine]}
        errors = results.table[(results.table["kind"] == "asymptotic_error") & (results.table["engine"] == engine)]
        opened = errors[is_undecided(errors) & ~errors["metric"].isin(JUMPING)]
        parts = [
            _convergence(results, engine, {scene: of[engine] for scene, of in statuses.items()}, remain),
            *_breakdowns(results, engine),
            *(profile.clause for profile in profiles if profile.engine == engine),
            *_cost(results, engine, costs),
        ]
        sentences.append(f"{ENGINE_NAMES.get(engine, engine)}: {'; '.join(parts)}.")
        if len(opened):
            names = [quantity(metric) for metric in opened["metric"].unique()]
            more = [f"{len(names) - MOST_METRICS} more"] if len(names) > MOST_METRICS else []
            undecided.append(f"{engine} {', '.join(names[:MOST_METRICS] + more)} ({_named(list(opened['scene'].unique()))})")
    return [*sentences, *([f"Undecided limits as dt → 0: {'; '.join(undecided)}."] if undecided else [])]


def _convergence(results: Results, engine: str, statuses: Mapping[str, Status], remain: Collection[str]) -> str:
    """The number of scenes in which an engine converges, the number with each other status, and the largest error relative to its scale."""
    mine = results.table[results.table["engine"] == engine]
    studied = list(mine.loc[mine["kind"] == "asymptotic_error", "scene"].unique())
    if not studied:
        frame = results.measurements
        measured = _scenes(frame.loc[frame["engine"] == engine, "scene"].nunique())
        enough = is_sufficient(results.provenance["asked"]["dts"])
        return f"{measured} measured, no asymptotic errors" + ("" if enough else "; these need three time steps that span a factor of four")
    wrong = [scene for scene in studied if scene in remain or statuses[scene].verdict not in CONVERGING]
    kinds = Counter("setting error" if statuses[scene].verdict in CONVERGING else statuses[scene].words for scene in wrong)
    kinds[UNDECIDED] = sum(statuses[scene].words == UNDECIDED for scene in studied if scene not in wrong)
    counted = [f"{kind} in {count}" for kind, count in kinds.items() if count]
    declined = sum(status.verdict == "declined" for status in statuses.values())
    declines = f", declines {declined}" if declined else ""
    converges = "; ".join(
        [f"converges in {len(studied) - kinds.total()} of {_scenes(len(studied))}{declines}", *filter(None, [", ".join(counted)])]
    )
    if not wrong:
        return converges
    shown = mine[
        mine["scene"].isin(wrong) & (mine["verdict"].isin(["known", "limited", *FAILURES]) | mine["cause"].isin(["model", "setting"]))
    ]
    shown = shown[(shown["metric"] != "") & (shown["kind"] != "order") & ~shown["metric"].isin(JUMPING) & shown["value"].notna()]
    scales = [negligible(results.scenes[scene], unit) for scene, unit in zip(shown["scene"], shown["unit"], strict=True)]
    largest = (shown["value"].abs() / scales).sort_values(ascending=False, kind="stable").index[:1]
    worst = [
        f"largest of these errors: {quantity(row['metric'])} {size(row['value'], row['unit'])} in {row['scene']}"
        f"{'; π is the maximum' if row['unit'] == 'rad' and abs(row['value']) > SATURATION else ''}"
        for row in shown.loc[largest].to_dict("records")
    ]
    return f"{converges}{''.join(f' ({one})' for one in worst)}"


def _named(scenes: Collection[str]) -> str:
    """The names of the scenes if they are few, otherwise their number."""
    return ", ".join(scenes) if len(scenes) <= MOST_NAMED else _scenes(len(scenes))


def _breakdowns(results: Results, engine: str) -> list[str]:
    """The number of scenes in which an engine broke down, for each kind of breakdown."""
    table = results.table[(results.table["engine"] == engine) & results.table["verdict"].isin(BREAKDOWNS)]
    return [f"{word(str(verdict))} in {_scenes(scenes)}" for verdict, scenes in table.groupby("verdict")["scene"].nunique().items()]


def _cost(results: Results, engine: str, costs: Mapping[str, float]) -> list[str]:
    """The median time per step of the fastest engine; for others, the ratio to the fastest engine in the same scene at the same dt."""
    timed = {label: cost for label, cost in costs.items() if cost > 0.0}
    if engine not in timed:
        return []
    fastest = min(timed, key=timed.__getitem__)
    if engine != fastest:
        ratio = f"{timed[engine]:.2g}"
        return [f"{'about' if ratio == '1' else f'{float(ratio):g} times'} the fastest engine's time per step"]
    seconds = results.table.loc[results.table["engine"] == engine, "time_per_step"].median()
    return [f"{duration(float(f'{seconds:.2g}'))} per time step{', the fastest' if len(timed) > 1 else ''}"]


def _scenes(count: int) -> str:
    return f"{count} {'scene' if count == 1 else 'scenes'}"
