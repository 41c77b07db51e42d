"""The findings of a run as counts and sentences, for terminal, HTML and Markdown."""

import statistics
from collections import Counter
from collections.abc import Collection, Hashable, Iterator, Mapping
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple, get_args

import numpy as np

from dropspin.comparisons.engines.options import calibrated_label, parts_of
from dropspin.comparisons.judging.convergence import ARTEFACTS, JUMPING
from dropspin.comparisons.judging.error_budget import is_determined, is_sufficient
from dropspin.comparisons.judging.verdicts import BREAKDOWNS, FAILURES, VERDICTS, Outcome, with_reason
from dropspin.comparisons.measuring.metrics import METRICS, leading_metric
from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS
from dropspin.comparisons.results.results import SMALLEST_STATED, Results, Status, relative_sizes
from dropspin.reports.plots.colours import in_sentence
from dropspin.reports.stories.matrix import step_times
from dropspin.reports.stories.numbers import (
    duration,
    failing,
    formatted,
    in_ms,
    listed,
    named,
    quantity,
    sized,
    with_unit,
)
from dropspin.scenarios.text import counted

if TYPE_CHECKING:
    import pandas as pd

CONVERGING = frozenset({"passed", "measured", "no_truth"})
"""Verdicts of scenes in which no check fails and no fault is expected."""
SAME_SIZE = 0.999
"""Smallest ratio of an error to the largest one at which the two count as equal."""


class Counts(NamedTuple):
    """The number of checks of a run by verdict, and the checks that show an expected error.

    Attributes:
        passed: Number of passed checks.
        failed: Number of failed checks.
        broken: Number of rows that report a breakdown of an engine.
        fixed: Number of passed checks for which a fault is expected.
        known: The checks with a fault that the scene expects of the engine by name, and with an error that is not negligible.
        limited: The checks whose failure a known limitation of the engine explains.
    """

    passed: int
    failed: int
    broken: int
    fixed: int
    known: "pd.DataFrame"
    limited: "pd.DataFrame"


def counts(results: Results) -> Counts:
    """Count the verdicts of a run."""
    table, verdicts = results.table, results.table["verdict"]
    return Counts(
        passed=int((verdicts == "passed").sum()),
        failed=int(verdicts.isin(FAILURES).sum()),
        broken=int(verdicts.isin(BREAKDOWNS).sum()),
        fixed=int(((verdicts == "passed") & (table["basis"] == "fault_absent")).sum()),
        known=table[(verdicts == "known") & (table["value"].abs() > SMALLEST_STATED)],
        limited=table[(verdicts == "limited") & (table["metric"] != "")],
    )


class ProfileComparison(NamedTuple):
    """An engine with default settings compared with the same engine with calibrated settings.

    Attributes:
        engine: Label of the engine with default settings.
        calibrated: Label of the engine with calibrated settings.
        rows: Errors of both at the finest time step; `part` is the share of the error that calibrated settings remove.
    """

    engine: str
    calibrated: str
    rows: list[dict[Hashable, Any]]

    @property
    def sentence(self) -> str:
        """The comparison in one sentence."""
        parts = [row["part"] for row in self.rows]
        most = sum(part > 0.5 for part in parts)
        are = "is mostly a setting error" if most == 1 else "are mostly setting errors"
        if parts_of(self.calibrated)[1]:  # an option may be a setting that errs
            are = f"{'is' if most == 1 else 'are'} mostly due to settings other than those given"
        return (
            f"{in_sentence(self.engine)}: {most} of its {counted(len(parts), 'error')} above {SMALLEST_STATED:g} "
            f"at the finest time step {are} (median share of the settings in an error: {100 * statistics.median(parts):.1f} %)."
        )


def profile_comparisons(results: Results) -> list[ProfileComparison]:
    """For each engine that was run with default and with calibrated settings, the share of its errors that is due to the settings."""
    frame = results.measurements
    truths = frame[(frame["kind"] == "truth") & frame["value"].notna() & ~frame["scene"].isin(results.recorded)]
    finest = truths[truths["dt"] == truths["dt"].min()].rename(columns={"value": "default"})
    comparisons = []
    for engine in results.engines:
        calibrated = calibrated_label(engine)
        others = finest.loc[finest["engine"] == calibrated, ["scene", "metric", "default"]].rename(columns={"default": "calibrated"})
        both = finest[finest["engine"] == engine].merge(others, on=["scene", "metric"])
        worth = both[both["default"].abs() > SMALLEST_STATED]
        worth = worth.assign(part=(1.0 - worth["calibrated"].abs() / worth["default"].abs()).clip(lower=0.0).fillna(0.0))
        if calibrated is not None and len(worth):
            rows = worth[["scene", "metric", "unit", "default", "calibrated", "part"]].to_dict("records")
            comparisons.append(ProfileComparison(engine, calibrated, rows))
    return comparisons


def orders(results: Results, scene: str, engine: str) -> str:
    """The observed orders of an engine's errors in a scene, with an interval that contains their 95 % intervals; empty without orders."""
    table = results.table
    mine = table[(table["kind"] == "order") & (table["scene"] == scene) & (table["engine"] == engine)]
    observed = mine[(mine["cause"] == "discretisation") & mine["value"].notna()]
    known = observed[[is_determined(*ends) for ends in zip(observed["lower"], observed["upper"], strict=True)]]
    parts = []
    if len(known):
        least, most = float(known["value"].min()), float(known["value"].max())
        values = f"order {least:.2f}" if most - least < 0.005 else f"orders {least:.2f} to {most:.2f}"
        parts.append(f"{values} ({known['lower'].min():.2f} to {known['upper'].max():.2f})")
    if len(observed) > len(known):
        parts.append(f"{counted(len(observed) - len(known), 'order')} not determined")
    return ", ".join(parts)


def not_repeated(results: Results) -> list[str]:
    """A sentence on each engine that does not repeat its own motion in some scenes."""
    return [
        f"{in_sentence(engine)} does not repeat its own motion in {listed(scenes)}, so that a part of its errors is random; "
        "dropspin symmetries shows where it differs."
        for engine in results.engines
        if (scenes := results.not_repeated(engine))
    ]


def verdict_sentence(results: Results, tally: Counts) -> str:
    """The outcome of the checks in one sentence."""
    judged, known = tally.passed + tally.failed, _known(results, tally)
    if tally.broken:
        judgement = f"; {failing(tally.failed, judged, 'check')}" if judged else ""
        return f"{counted(tally.broken, 'engine run')} broke down{judgement}{known}."
    if tally.failed:
        return f"{failing(tally.failed, judged, 'check')}{known}."
    passing = counted(judged, "check passes", "checks pass")
    if len(tally.known) or len(tally.limited):
        return f"No check fails: {passing}{known}." if judged else f"No check passes or fails{known}."
    if judged:
        return f"{'The check passes' if judged == 1 else f'All {passing}'}{known}."
    if results.measurements.empty:
        return "No check was made, because no scene was simulated."
    if (results.table["basis"] == "few_starts").any():
        return "The few starts of a quick run do not decide any check."
    set_at_all = any(scene.expect for scene in results.scenes.values())
    none = "No expectation covers these engines at these time steps" if set_at_all else "The scenes have no expectations"
    return f"{none}; {counted(len(results.measurements), 'value was', 'values were')} measured."


def _known(results: Results, tally: Counts) -> str:
    """The end of a sentence: how many values show known faults or are limited, how many expected faults do not occur."""
    parts = ""
    for rows, one, many in (
        (tally.known, "value is a known fault", "values are known faults"),
        (tally.limited, "value is not judged (limited)", "values are not judged (limited)"),
    ):
        if len(rows):
            engines = named([in_sentence(engine) for engine in results.engines if engine in set(rows["engine"])], "engine")
            parts += f"; {counted(len(rows), one, many)}: {engines} in {counted(rows['scene'].nunique(), 'scene')}"
    return parts + (f"; {counted(tally.fixed, 'expected fault does', 'expected faults do')} not occur" if tally.fixed else "")


def missing_engines(results: Results) -> list[str]:
    """For each engine that is missing, a sentence with the reason."""
    return list(results.table.loc[results.table["verdict"] == "missing"].drop_duplicates("engine")["reason"])


def finding_sentences(results: Results) -> Iterator[str]:
    """One sentence for each engine that is not missing.

    The sentence gives the number of scenes with each outcome, the largest error that fails, is expected or does not vanish as dt → 0, and
    the cost of a time step.
    """
    times, statuses, lasting = step_times(results), results.statuses(), results.asymptotic_errors("model", "setting")
    lasting = lasting[lasting["value"].abs() > SMALLEST_STATED]
    missing = set(results.table.loc[results.table["verdict"] == "missing", "engine"])
    for engine in results.engines:
        if engine in missing:
            continue
        remain = set(lasting.loc[lasting["engine"] == engine, "scene"])
        outcomes = _convergence(results, engine, {scene: of[engine] for scene, of in statuses.items()}, remain)
        cost = _cost(engine, times, results.provenance.get("compilation", {}).get(engine))
        yield f"{in_sentence(engine)}: {'; '.join([outcomes, *cost])}."


def _convergence(results: Results, engine: str, statuses: Mapping[str, Status], remain: Collection[str]) -> str:
    """The number of scenes with each outcome and reason, and the largest error that fails, is expected or does not vanish as dt → 0."""
    mine = results.table[results.table["engine"] == engine]
    kinds: Counter[tuple[str, str]] = Counter()
    for scene, status in sorted(statuses.items(), key=lambda item: -VERDICTS.index(item[1].verdict)):
        kinds[status.outcome, "setting error" if scene in remain and status.verdict in CONVERGING else status.reason] += 1
    parts = []
    for outcome in get_args(Outcome):
        reasons = {reason: count for (of, reason), count in kinds.items() if of == outcome}
        total = sum(reasons.values())
        because = ", ".join(reason if count == total else f"{reason} in {count}" for reason, count in reasons.items() if reason)
        parts += [with_reason(f"{outcome} in {total}", because)] * bool(total)
    outcomes = f"{', '.join(parts)} of {counted(len(statuses), 'scene')}"
    if not (mine["kind"] == "asymptotic_error").any():
        enough = is_sufficient(results.provenance["asked"]["dts"])
        none = "no asymptotic errors" + ("" if enough else ", which need three time steps that span a factor of four")
        return f"{outcomes}; {none}"
    found = mine[mine["kind"].isin(["truth", "invariant"]) & (mine["value"].abs() > SMALLEST_STATED)]
    found = found[~found["metric"].isin([*JUMPING, *ARTEFACTS])]
    finest = found[found["dt"] == found.groupby("scene")["dt"].transform("min")]
    wrong = finest[finest["verdict"].isin(["known", "limited", *FAILURES]) | finest["cause"].isin(["model", "setting"])]
    return f"{outcomes}{_largest(results, wrong)}"


def beside_recordings(results: Results) -> Iterator[str]:
    """For each engine and recording, a sentence with their difference at the finest time step and its uncertainty."""
    for engine, scene in product(results.engines, results.recorded):
        of_engine, metric = results.table[results.table["engine"] == engine], leading_metric(results.scenes[scene])
        rows = of_engine[(of_engine["scene"] == scene) & (of_engine["metric"] == metric)].set_index("kind")
        finest = rows.loc[rows["dt"] == rows["dt"].min(), "value"]
        if "uncertainty" in finest:
            value = with_unit(f"{formatted(finest['truth'])} ± {formatted(finest['uncertainty'])}", METRICS[metric].unit)
            yield f"{in_sentence(engine)}: the {quantity(metric)} differs from the recording in {scene} by {value}."


def ensemble_differences(results: Results) -> Iterator[str]:
    """For each ensemble, the means in which two engines differ at 95 % confidence at every time step; the values are of the finest one.

    Differences of at most `SMALLEST_STATED`, such as those of rounding, are left out.
    """
    pairs = results.agreements[results.agreements["metric"].isin(ENSEMBLE_METRICS)].sort_values("dt", kind="stable")
    of = ["scene", "engine", "truth", "metric"]
    sides = pairs.assign(side=np.sign(pairs["lower"]) + np.sign(pairs["upper"])).groupby(of, sort=False)["side"]
    always = pairs[(sides.transform("min") > 0.0) | (sides.transform("max") < 0.0)].drop_duplicates(of)
    always = always[always["value"].abs() > SMALLEST_STATED]
    for scene, rows in always.groupby("scene", sort=False):
        differing = []
        for (engine, other), of_pair in rows.groupby(["engine", "truth"], sort=False):
            columns = zip(of_pair["metric"], of_pair["value"].abs(), of_pair["unit"], strict=True)
            means = [f"{metric.replace('_', ' ')} by {with_unit(f'{value:.2g}', unit)}" for metric, value, unit in columns]
            differing.append(f"{in_sentence(str(engine))} and {in_sentence(str(other))} in {listed(means)}")
        if "rest_time" in set(rows["metric"]):
            finest = [outcome for (name, _, dt), outcome in results.ensembles.items() if (name, dt) == (scene, rows["dt"].iloc[0])]
            rested = [outcome.rest_time < outcome.t[-1] for outcome in finest]
            if moving := max((int(np.sum(~each)) for each in rested), default=0):
                differing.append(f"up to {moving} of {len(rested[0])} starts still move at the end, which counts as their rest time")
        yield f"Means over the starts of {scene}, which are not checked one by one, differ: {'; '.join(differing)}."


def _largest(results: Results, errors: "pd.DataFrame") -> str:
    """The largest error relative to its scale, with the scenes in which it has this size; empty if there are no errors."""
    if errors.empty:
        return ""
    sizes = relative_sizes(errors, results.scenes)
    first = errors.to_dict("records")[int(np.argmax(sizes))]
    similar = errors["value"].abs().between(SAME_SIZE * abs(first["value"]), abs(first["value"]) / SAME_SIZE)
    equal = errors[(errors["metric"] == first["metric"]) & (sizes >= SAME_SIZE * sizes.max()) & similar]
    names = named(list(equal["scene"].unique()), "scene")
    size = f"{quantity(first['metric'])} {sized(abs(first['value']), first['unit'])}"
    return f"; largest error: {size} at dt = {in_ms(first['dt'])} in {names}"


def _cost(engine: str, times: Mapping[str, float], compilation: float | None) -> list[str]:
    """The time per step of an engine, its ratio to that of the fastest engine, and the time to compile a scene, if any."""
    if engine not in times:
        return []
    absolute = f"{duration(float(f'{times[engine]:.2g}'))} per step"
    fastest = min(times, key=times.__getitem__)
    ratio = float(f"{times[engine] / times[fastest]:.2g}")
    relative = "" if engine == fastest or ratio == 1.0 else f", {ratio:g} times that of {in_sentence(fastest)}"
    compiling = "" if compilation is None else f", after compiling a scene for up to {duration(float(f'{compilation:.2g}'))}"
    return [f"{absolute}{relative}{compiling}"]
