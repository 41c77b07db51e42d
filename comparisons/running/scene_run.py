"""One scene of a run: every engine at every time step, the measurements, their convergence, and the engines' agreement."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain, combinations
from typing import Any, NamedTuple

import numpy as np

from comparisons.engines.base import Engine, calibrated_label
from comparisons.judging.agreement import judge_agreement
from comparisons.judging.convergence import (
    ADDED_STEPS,
    ARTEFACTS,
    Claim,
    ConvergenceStudy,
    SeriesPoint,
    attributed_to_accuracy,
    attributed_to_setting,
    study_convergence,
)
from comparisons.judging.error_budget import is_sufficient
from comparisons.judging.horizon import with_horizon
from comparisons.judging.verdicts import Judgement, judge, with_limitations
from comparisons.measuring.comparison import Comparison, Unresolved, exactly
from comparisons.measuring.metric import Average, Metric
from comparisons.measuring.metrics import METRICS, metrics_for
from comparisons.measuring.tolerances import FEW_DRAWS, tolerance
from comparisons.results.ensembles import ENSEMBLE_METRICS, EnsembleOutcome
from comparisons.results.measurement import Case, Measurement, as_table
from comparisons.results.results import Results, TrajectoryKey
from comparisons.running.engine_run import EngineRun
from comparisons.running.ensembles import judge_differences, judge_means
from comparisons.running.inputs import EngineEntry
from comparisons.running.processes import EngineProcesses
from comparisons.running.recording import Breakdown, divergence
from comparisons.running.start_phases import StartPhase, start_phases
from scenarios import Scenario, Trajectory, Truth

FEWEST_STEPS = 8
"""A run of fewer steps is not worth adding."""


class Measured(NamedTuple):
    """A measurement, and the average over start phases that its value is the largest part of; None for a remark."""

    measurement: Measurement
    average: Average | None


@dataclass
class _Collected:
    """What a scene's run has gathered so far, engine by engine."""

    measured: dict[str, list[Measured]]
    studies: dict[str, dict[str, ConvergenceStudy]] = field(default_factory=dict)
    rows: list[Measurement] = field(default_factory=list)
    claims: dict[str, Claim] = field(default_factory=dict)
    trajectories: dict[TrajectoryKey, Trajectory] = field(default_factory=dict)
    ensembles: dict[TrajectoryKey, EnsembleOutcome] = field(default_factory=dict)
    settings: dict[str, dict[str, Any]] = field(default_factory=dict)


def run_scene(
    own: StartPhase,
    entries: Sequence[EngineEntry],
    dts: Sequence[float],
    processes: EngineProcesses,
    on_progress: Callable[[str, str, float], None],
    stamp: Mapping[str, Any],
) -> Results:
    """Run one scene with every engine at every time step.

    Args:
        own: The scene from its own start, and its exact solution.
        entries: The engines.
        dts: Time steps [s].
        processes: The engines' processes.
        on_progress: Called with scene, engine and time step after each engine.
        stamp: The run's provenance.
    """
    scene = own.scene
    labels = tuple(entry.label for entry in entries)
    found = _Collected({label: [] for label in labels})
    for dt in dts:
        phases, exact = _phases_at(own, dt)
        compared: list[tuple[EngineRun, list[Comparison]]] = []
        for entry in entries:
            engine_run = processes.run_engine(entry, scene, dt, [phase.scene for phase in phases])
            cases = [] if _breakdown(engine_run) else _compare(engine_run.phases, phases, exact)
            found.measured[entry.label] += _measure(own, dt, engine_run, phases, exact, cases)
            _collect(found, own, dt, engine_run)
            compared.append((engine_run, cases))
            on_progress(scene.name, entry.label, dt)
        for first, second in combinations(compared, 2):
            found.rows += _agreement(own, dt, phases, first, second)
    if is_sufficient(sorted(dts)):
        for entry in entries:
            if entry.label in found.claims:
                found.studies[entry.label] = _study(found, own, entry, max(dts), processes)
    rows = found.rows + _with_convergence(found, labels)
    provenance = {**stamp, "settings": found.settings}
    return Results(as_table(rows), {scene.name: scene}, labels, found.trajectories, found.ensembles, provenance)


def _phases_at(own: StartPhase, dt: float) -> tuple[Sequence[StartPhase], list[Trajectory | None]]:
    """The start phases at a time step [s], and the exact motion from each at every step, as far as there is an exact solution."""
    phases = start_phases(own.scene, own.truth, dt)
    times = dt * np.arange(1 + own.scene.steps(dt), dtype=float)
    return phases, [None if phase.truth is None else exactly(phase.truth, times) for phase in phases]


def _compare(motions: Sequence[Trajectory], phases: Sequence[StartPhase], exact: Sequence[Trajectory | None]) -> list[Comparison]:
    """Motions from all start phases compared with the exact solution."""
    together = zip(phases, motions, exact, strict=True)
    return [Comparison.with_truth(phase.scene, motion, phase.truth, known) for phase, motion, known in together]


def _breakdown(engine_run: EngineRun) -> Breakdown | None:
    """Why an engine has no motion to measure; None if it has."""
    if engine_run.breakdown is not None:
        return engine_run.breakdown
    assert engine_run.motion is not None
    return next(filter(None, map(divergence, [engine_run.motion, *engine_run.phases])), None)


def _measure(
    own: StartPhase,
    dt: float,
    engine_run: EngineRun,
    phases: Sequence[StartPhase],
    exact: Sequence[Trajectory | None],
    cases: Sequence[Comparison],
) -> list[Measured]:
    """Every metric of one engine at one time step, judged; a remark if it has no motion."""
    scene, truth = own
    case = Case(scene.name, engine_run.label, dt, scene.steps(dt), engine_run.time_per_step)
    breakdown = _breakdown(engine_run)
    if breakdown is not None:
        return [Measured(case.remark(breakdown.verdict, breakdown.reason), None)]
    perturbed = [_compare(motions, phases, exact) for motions in engine_run.perturbed]
    rows = [Measured(case.remark("limited", one.message), None) for one in engine_run.limitations]
    for metric in metrics_for(scene, truth):
        average, judgement = _judge_metric(scene, truth, dt, engine_run.label, metric, cases)
        moved = float(np.max([abs(metric.value_or_nan(some) - average.value) for some in perturbed], initial=0.0))
        sampling_noise = FEW_DRAWS * moved if len(cases) == 1 else average.jump + moved
        allowed = tolerance(scene, metric.unit, engine_run.precision, case.steps, sampling_noise)
        judgement = with_limitations(replace(judgement, tolerance=allowed), metric.name, engine_run.limitations)
        name = truth.name if metric.kind == "truth" and truth is not None else ""
        rows.append(Measured(case.measurement(metric.kind, metric.name, metric.unit, judgement, name), average))
    if truth is None:
        rows.append(Measured(case.remark("no_truth", "no closed form is known for this scene"), None))
    return rows


def _judge_metric(
    scene: Scenario, truth: Truth | None, dt: float, label: str, metric: Metric, cases: Sequence[Comparison]
) -> tuple[Average, Judgement]:
    """A metric's average over the start phases, and its judgement."""
    unresolved: Unresolved | None = None
    try:
        with np.errstate(all="ignore"):  # an engine may return 1e300; the inf or NaN that follows is judged as such
            average = metric.average(cases)
    except Unresolved as error:
        average, unresolved = Average(*[np.array([np.nan])] * 3), error
    judgement = judge(scene, label, dt, metric, average.value)
    reason = "; ".join(filter(None, [str(unresolved or ""), judgement.reason]))
    # A value that is not a number is a failure, expected or not; one that the step cannot resolve fails only an expectation.
    verdict = "failed" if np.isnan(average.value) and not unresolved else judgement.verdict
    if verdict == "failed" and not reason:
        reason = "what it measures did not happen"
    judgement = replace(judgement, verdict=verdict, reason=reason, cause="unresolved" if unresolved else "")
    return average, with_horizon(judgement, scene, metric, truth, unresolved)


def _study(
    found: _Collected, own: StartPhase, entry: EngineEntry, coarsest: float, processes: EngineProcesses
) -> dict[str, ConvergenceStudy]:
    """The convergence of each metric of one engine, by metric; with coarser steps where those asked for leave it open."""
    claim, series = found.claims[entry.label], _series(found.measured[entry.label])
    studies = {name: study_convergence(own.scene, claim, METRICS[name], points) for name, points in series.items()}
    if any(study.is_open for study in studies.values()):
        coarser = _series([one for factor in ADDED_STEPS for one in _measured_at(own, entry, factor * coarsest, processes)])
        for name in coarser:
            if name in studies and studies[name].is_open:
                studies[name] = study_convergence(own.scene, claim, METRICS[name], [*coarser[name], *series[name]])
    if entry.engine is not None and entry.engine.accuracy and any(study.cause in ("model", "unresolved") for study in studies.values()):
        return _with_accuracy_options(studies, own, claim, entry.engine, sorted({point.dt for point in chain(*series.values())}), processes)
    return studies


def _with_accuracy_options(
    studies: Mapping[str, ConvergenceStudy], own: StartPhase, claim: Claim, engine: Engine, dts: Sequence[float], processes: EngineProcesses
) -> dict[str, ConvergenceStudy]:
    """Studies by metric; those in which the time step alone does not make the error vanish again with the accuracy options refined too."""
    refined = engine.refined(dts)
    series = _series([one for dt, finer in refined for one in _measured_at(own, EngineEntry(finer.label, finer), dt, processes)])
    options = " and ".join(engine.accuracy)
    values = [", ".join(_short(finer.option(option)) for _, finer in refined) for option in engine.accuracy]
    path = f"{'; '.join(values)}, with dt = {', '.join(f'{dt:g}' for dt, _ in refined)} s"
    again = {
        name: study_convergence(own.scene, claim._replace(order=None), METRICS[name], points)
        for name, points in series.items()
        if len(points) == len(refined)
    }
    return {name: attributed_to_accuracy(study, again.get(name), options, path) for name, study in studies.items()}


def _short(value: str) -> str:
    """An option's value; numbers with six digits."""
    try:
        return f"{float(value):g}"
    except ValueError:
        return value


def _measured_at(own: StartPhase, entry: EngineEntry, dt: float, processes: EngineProcesses) -> list[Measured]:
    """Every metric of one engine at a step that was not asked for; nothing if it breaks down there."""
    if own.scene.steps(dt) < FEWEST_STEPS:
        return []
    phases, exact = _phases_at(own, dt)
    engine_run = processes.run_engine(entry, own.scene, dt, [phase.scene for phase in phases])
    return [] if _breakdown(engine_run) else _measure(own, dt, engine_run, phases, exact, _compare(engine_run.phases, phases, exact))


def _collect(found: _Collected, own: StartPhase, dt: float, engine_run: EngineRun) -> None:
    """Keep what one engine gave at one time step, apart from its metrics."""
    scene, label = own.scene, engine_run.label
    case = Case(scene.name, label, dt, scene.steps(dt))
    truth = own.truth.name if own.truth else ""
    for name, value in engine_run.predicted.items():
        found.rows.append(case.measurement("prediction", name, METRICS[name].unit, Judgement(value, "measured"), truth))
    if engine_run.motion is not None:
        found.trajectories[scene.name, label, dt] = engine_run.motion
        found.settings.setdefault(label, {})[f"{scene.name} dt={dt:g}"] = engine_run.settings
        earlier = found.claims[label].limitations if label in found.claims else ()
        found.claims[label] = Claim(label, engine_run.order, engine_run.precision, (*earlier, *engine_run.limitations))
    if engine_run.outcome is not None:
        found.ensembles[scene.name, label, dt] = engine_run.outcome
        for name, judgement in judge_means(scene, dt, engine_run.outcome):
            found.rows.append(case.measurement("ensemble", name, ENSEMBLE_METRICS[name].unit, judgement))


def _agreement(
    own: StartPhase,
    dt: float,
    phases: Sequence[StartPhase],
    first: tuple[EngineRun, Sequence[Comparison]],
    second: tuple[EngineRun, Sequence[Comparison]],
) -> Iterator[Measurement]:
    """The differences between two engines that both have a motion."""
    (one, cases), (other, other_cases) = first, second
    if not (cases and other_cases):
        return
    scene = own.scene
    case = Case(scene.name, one.label, dt, scene.steps(dt))
    truths = [phase.truth for phase in phases]
    for metric, judgement in judge_agreement(scene, own.truth, truths, cases, other_cases, (one.discretisation, other.discretisation)):
        yield case.measurement("agreement", metric.name, metric.unit, judgement, other.label)
    if one.outcome is not None and other.outcome is not None:
        for name, judgement in judge_differences(one.outcome, other.outcome):
            yield case.measurement("agreement", name, ENSEMBLE_METRICS[name].unit, judgement, other.label)


def _with_convergence(found: _Collected, labels: Sequence[str]) -> list[Measurement]:
    """All engines' measurements, each with its cause, followed by their orders and asymptotic errors."""
    rows: list[Measurement] = []
    for label in labels:
        own, twin = found.studies.get(label, {}), found.studies.get(calibrated_label(label) or "")
        if twin is not None:
            own = {name: attributed_to_setting(study, twin.get(name)) for name, study in own.items()}
        measurements = [one.measurement for one in found.measured[label]]
        rows += [_with_cause(one, own) for one in measurements]
        rows += _study_rows(measurements, own)
    return rows


def _series(measured: Sequence[Measured]) -> dict[str, list[SeriesPoint]]:
    """The errors at each time step, by metric."""
    series: dict[str, list[SeriesPoint]] = {}
    for row, average in measured:
        if average is not None and row.metric not in ARTEFACTS:
            series.setdefault(row.metric, []).append(SeriesPoint(row.dt, row.steps, average, row.tolerance))
    return series


def _with_cause(row: Measurement, studies: Mapping[str, ConvergenceStudy]) -> Measurement:
    """A measurement with the cause that its metric's convergence gives, if it has none yet; `known` if it passes as a known model error."""
    if row.cause or row.metric not in studies:
        return row
    study = studies[row.metric]
    is_known = study.asymptotic_error is not None and study.asymptotic_error.verdict == "known"
    shows = is_known and row.verdict == "passed" and (row.lower > 0.0 or row.upper < 0.0)
    return replace(row, cause=study.cause, verdict="known" if shows else row.verdict)


def _study_rows(measurements: Sequence[Measurement], studies: Mapping[str, ConvergenceStudy]) -> Iterator[Measurement]:
    """Orders and asymptotic errors, metric by metric."""
    for name, study in studies.items():
        of = next(one for one in measurements if one.metric == name)
        case = Case(of.scene, of.engine)
        if study.order is not None:
            yield case.measurement("order", name, "1", study.order, of.truth)
        if study.asymptotic_error is not None:
            yield case.measurement("asymptotic_error", name, of.unit, study.asymptotic_error, of.truth)
