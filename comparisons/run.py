"""The main job: scenes × engines × time steps, measured against truth and against each other, and judged."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import combinations, product
from typing import Any

import numpy as np

from comparisons.agreement import agreement_rows
from comparisons.comparison import Comparison, Unresolved, exactly
from comparisons.engines.base import Engine, calibrated_label
from comparisons.ensembles import Outcome, ensemble_rows
from comparisons.isolation import Cells, Limits
from comparisons.metrics import Average, Metric, metrics_for
from comparisons.phases import Phase, start_phases
from comparisons.predictions import prediction_rows
from comparisons.provenance import adapter_code, provenance
from comparisons.results import Results, TrajectoryKey, as_frame, joined
from comparisons.simulating import Attempt, Contestant, assert_step_fits, contestant_named
from comparisons.studies import Claim, blame_settings, study_rows
from comparisons.tolerances import FEW_DRAWS, tolerance
from comparisons.verdicts import assert_expectations_can_be_judged, excused, judge
from scenarios import DropspinError, Scenario, Trajectory, Truth, truth_for

DEFAULT_DTS = (4e-3, 2e-3, 1e-3)

Progress = Callable[[str, str, float], None]
Row = dict[str, Any]


def run(
    scenes: Sequence[Scenario],
    engines: Sequence[str | Engine],
    dts: Sequence[float] = DEFAULT_DTS,
    progress: Progress = lambda scene, engine, dt: None,
    limits: Limits = Limits(),  # noqa: B008 - it cannot be changed
    keep: Callable[[Results], None] = lambda part: None,
    done: Iterable[Results] = (),
) -> Results:
    """Run every scene through every engine at every step, measure, and judge.

    Args:
        scenes: The scenes; their names must differ.
        engines: Engines, or names with options. One that is not installed is `missing` in the results, and the rest runs.
        dts: Time steps [s].
        progress: Called with scene, engine and step after each of len(scenes) * len(engines) * len(dts) pieces of work.
        limits: What an engine may use for one of these pieces; each engine works in a process of its own.
        keep: Called with the results of each scene as soon as it is done.
        done: Results of scenes from an earlier run. Those that were asked for in the same way, of the same versions, are not run again.

    Raises:
        DropspinError: Something was asked for that cannot be: an unknown engine, a step that is no step, equal names.
    """
    contestants, truths = prepared(scenes, engines, dts)
    labels = [contestant.label for contestant in contestants]
    asked = {"scenes": [scene.name for scene in scenes], "engines": labels, "dts": list(dts), "time_limit": limits.processor_time}
    stamp = provenance(asked)
    stamp["names"] = {one.label: name.strip() for one, name in zip(contestants, engines, strict=True) if isinstance(name, str)}
    stamp["adapters"] = {contestant.label: adapter_code(contestant.engine) for contestant in contestants if contestant.engine is not None}
    earlier = {scene.model_dump_json(): part for part in done for scene in part.scenes.values() if _is_the_same(part.provenance, stamp)}
    parts = []
    with Cells(limits) as cells:
        for scene, truth in zip(scenes, truths, strict=True):
            if scene.model_dump_json() in earlier:
                parts.append(replace(earlier[scene.model_dump_json()], scenes={scene.name: scene}))
                for contestant, dt in product(contestants, dts):
                    progress(scene.name, contestant.label, dt)
                continue
            parts.append(_run_scene(Phase(scene, truth), contestants, dts, cells, progress, stamp))
            keep(parts[-1])
    return joined(parts, stamp)


def prepared(
    scenes: Sequence[Scenario], engines: Sequence[str | Engine], dts: Sequence[float]
) -> tuple[list[Contestant], list[Truth | None]]:
    """The engines that a run would be of and the scenes' truths, once it is sure that all of it can be run.

    Raises:
        DropspinError: Something was asked for that cannot be.
    """
    contestants = [contestant_named(name) for name in engines]
    labels = [contestant.label for contestant in contestants]
    truths = [truth_for(scene) for scene in scenes]
    _assert_sensible(scenes, truths, dts, labels)
    if len(set(labels)) < len(labels):
        raise DropspinError(f"an engine is named twice: {', '.join(labels)}; name each once.")
    return contestants, truths


def _is_the_same(earlier: Mapping[str, Any], stamp: Mapping[str, Any]) -> bool:
    """Whether two runs had the same engines, steps, time limit, versions, code and machine."""
    asked = all(earlier["asked"][what] == stamp["asked"][what] for what in ("engines", "dts", "time_limit"))
    return asked and all(earlier[what] == stamp[what] for what in ("versions", "python", "cpu", "code", "adapters"))


def _run_scene(
    written: Phase, contestants: Sequence[Contestant], dts: Sequence[float], cells: Cells, progress: Progress, stamp: Mapping[str, Any]
) -> Results:
    scene, truth = written
    labels = tuple(contestant.label for contestant in contestants)
    rows: list[Row] = []
    measured: dict[str, list[Row]] = {label: [] for label in labels}
    claims: dict[str, Claim] = {}
    trajectories: dict[TrajectoryKey, Trajectory] = {}
    ensembles: dict[TrajectoryKey, Outcome] = {}
    settings: dict[str, dict[str, Any]] = {}
    for dt in dts:
        phases = start_phases(scene, truth, dt)
        times = dt * np.arange(1 + scene.steps(dt), dtype=float)
        exact = [None if phase.truth is None else exactly(phase.truth, times) for phase in phases]
        attempts: list[Attempt] = []
        for contestant in contestants:
            attempt = cells.attempt(contestant, scene, dt, phases)
            measured[contestant.label] += _truth_rows(written, dt, attempt, phases, exact)
            rows += prediction_rows(scene, truth, contestant.label, dt, attempt.predicted)
            if contestant.engine is not None and attempt.motion is not None:
                trajectories[scene.name, contestant.label, dt] = attempt.motion
                settings.setdefault(contestant.label, {})[f"{scene.name} dt={dt:g}"] = attempt.settings
                earlier = claims[contestant.label].limits if contestant.label in claims else ()
                claims[contestant.label] = Claim(contestant.label, attempt.order, attempt.precision, (*earlier, *attempt.limits))
            if attempt.outcome is not None:
                ensembles[scene.name, contestant.label, dt] = attempt.outcome
                rows += ensemble_rows(scene, contestant.label, dt, attempt.outcome)
            attempts.append(attempt)
            progress(scene.name, contestant.label, dt)
        for first, second in combinations(attempts, 2):
            rows += agreement_rows(written, dt, first, second, phases)
    studies = {label: study_rows(scene, claim, measured[label]) for label, claim in claims.items()}
    for label in labels:
        own = measured[label] + studies.get(label, [])
        twin = calibrated_label(label)
        if twin in studies:
            blame_settings(own, studies[twin])
        rows += own
    moves = np.array([row.get("tolerance", np.nan) for row in rows], dtype=float)
    return Results(as_frame(rows), {scene.name: scene}, labels, trajectories, ensembles, {**stamp, "settings": settings}, moves)


def measure(scene: Scenario, motion: Trajectory) -> dict[str, float]:
    """Every metric that the scene has, of one motion; NaN where the step is too coarse for it."""
    truth = truth_for(scene)
    case = Comparison.with_truth(scene, motion, truth)
    return {metric.name: _value_or_nan(metric, [case]) for metric in metrics_for(scene, truth)}


def _truth_rows(written: Phase, dt: float, attempt: Attempt, phases: Sequence[Phase], exact: Sequence[Trajectory | None]) -> list[Row]:
    scene, truth = written
    steps = scene.steps(dt)
    shared: Row = {"scene": scene.name, "engine": attempt.label, "dt": dt, "time_per_step": attempt.time_per_step, "steps": steps}
    if attempt.verdict:
        return [shared | {"verdict": attempt.verdict, "reason": attempt.reason}]
    assert attempt.motion is not None
    bad = next((motion for motion in [attempt.motion, *attempt.phases] if motion.first_bad_row is not None), None)
    if bad is not None:
        reason = f"the state is not finite at t = {bad.t[bad.first_bad_row]:g} s"
        return [shared | {"verdict": "diverged", "reason": reason}]

    def beside_truth(motions: Sequence[Trajectory]) -> list[Comparison]:
        beside = zip(phases, motions, exact, strict=True)
        return [Comparison.with_truth(phase.scene, motion, phase.truth, known) for phase, motion, known in beside]

    attempt.cases = cases = beside_truth(attempt.phases)
    nudged = [beside_truth(motions) for motions in attempt.nudged]
    rows = [shared | {"verdict": "limited", "reason": limit.said} for limit in attempt.limits]
    for metric in metrics_for(scene, truth):
        row = shared | {"metric": metric.name, "unit": metric.unit, "kind": metric.kind}
        if metric.kind == "truth" and truth is not None:
            row["truth"] = truth.name
        measured = _measured(scene, dt, attempt.label, metric, cases)
        average = measured["average"]
        moves = float(np.max([abs(_value_or_nan(metric, moved) - average.value) for moved in nudged], initial=0.0))
        luck = FEW_DRAWS * moves if len(cases) == 1 else average.jump + moves
        measured["tolerance"] = tolerance(scene, metric.unit, attempt.precision, steps, luck)
        rows.append(row | excused({"metric": metric.name} | measured, attempt.limits))
    if truth is None:
        rows.append(shared | {"verdict": "no_truth", "reason": "no closed form is known for this scene"})
    return rows


def _measured(scene: Scenario, dt: float, label: str, metric: Metric, cases: list[Comparison]) -> Row:
    """A metric's mean over the start phases, judged."""
    try:
        with np.errstate(all="ignore"):  # an engine may say 1e300; what comes of it is inf or NaN, and judged as such
            average = metric.average(cases)
        unresolved = ""
    except Unresolved as error:
        average, unresolved = Average(*[np.array([np.nan])] * 3), str(error)
    value = average.value
    judgement = judge(scene, label, dt, metric, value)
    reason = "; ".join(filter(None, [unresolved, judgement.reason]))
    # What should be a number and is none is a failure, expected or not; what the step cannot resolve fails only what was expected.
    verdict = "failed" if np.isnan(value) and not unresolved else judgement.verdict
    if verdict == "failed" and not reason:
        reason = "not a number: what is measured here never happened"
    cause = "unresolved" if unresolved else ""
    measurement = {"value": value, "lower": judgement.lower, "upper": judgement.upper, "verdict": verdict, "cause": cause, "reason": reason}
    return measurement | {"average": average}


def _value_or_nan(metric: Metric, cases: Sequence[Comparison]) -> float:
    try:
        return metric.average(cases).value
    except Unresolved:
        return float("nan")


def _assert_sensible(scenes: Sequence[Scenario], truths: Sequence[Truth | None], dts: Sequence[float], labels: Sequence[str]) -> None:
    names = [scene.name for scene in scenes]
    if len(set(names)) < len(names):
        raise DropspinError(f"two scenes have the same name ({', '.join(names)}); a scene's name is its file's, rename one.")
    if len(set(dts)) < len(dts):
        raise DropspinError(f"dt: a step is named twice ({', '.join(f'{dt:g}' for dt in dts)}); name each once.")
    for scene, truth in zip(scenes, truths, strict=True):
        assert_expectations_can_be_judged(scene, truth, labels)
        for dt in dts:
            assert_step_fits(scene, dt)
