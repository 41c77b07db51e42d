"""One scene of a run: every engine at every time step, the measurements, their convergence, and the engines' agreement."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any, NamedTuple

from dropspin.comparisons.engines.base import calibrated_label
from dropspin.comparisons.judging.agreement import judge_agreement
from dropspin.comparisons.judging.convergence import Claim, ConvergenceStudy, attributed_to_setting
from dropspin.comparisons.judging.error_budget import is_sufficient
from dropspin.comparisons.judging.verdicts import Judgement
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.metrics import METRICS, leading_metric
from dropspin.comparisons.measuring.states import States
from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS, EnsembleOutcome
from dropspin.comparisons.results.provenance import motion_digest
from dropspin.comparisons.results.results import Results, TrajectoryKey
from dropspin.comparisons.results.table import Case, Measurement, as_table
from dropspin.comparisons.running.engine_run import EngineRun, Timing
from dropspin.comparisons.running.ensembles import judge_differences, judge_means
from dropspin.comparisons.running.inputs import EngineEntry
from dropspin.comparisons.running.measured import Measured, breakdown_of, compare, exactly_at, measure, phases_at
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.progress import OnProgress, OnSimulations, Progress, reporter
from dropspin.comparisons.running.start_phases import StartPhase
from dropspin.comparisons.running.studies import study_engine
from dropspin.scenarios import Trajectory
from dropspin.scenarios.truths import other_laws

Timings = Mapping[tuple[str, str, float], Timing]
"""By scene, engine and time step."""


class _OtherLaw(NamedTuple):
    """An impact law, each start phase with the exact solution under it, and the exact motions."""

    law: str
    phases: Sequence[StartPhase]
    exact: Sequence[States | None]


@dataclass
class _Collected:
    """What a scene's run has gathered so far, engine by engine."""

    measured: dict[str, list[Measured]]
    studies: dict[str, dict[str, ConvergenceStudy]] = field(default_factory=dict)
    means: list[Measurement] = field(default_factory=list)
    other_laws: list[Measurement] = field(default_factory=list)
    predictions: list[Measurement] = field(default_factory=list)
    agreements: list[Measurement] = field(default_factory=list)
    claims: dict[str, Claim] = field(default_factory=dict)
    trajectories: dict[TrajectoryKey, Trajectory] = field(default_factory=dict)
    ensembles: dict[TrajectoryKey, EnsembleOutcome] = field(default_factory=dict)
    settings: dict[str, dict[str, Any]] = field(default_factory=dict)
    motions: dict[str, dict[str, str]] = field(default_factory=dict)


def run_scene(
    own: StartPhase,
    entries: Sequence[EngineEntry],
    dts: Sequence[float],
    processes: EngineProcesses,
    on_progress: OnProgress,
    stamp: Mapping[str, Any],
    timings: Timings,
) -> Results:
    """Run one scene with every engine at every time step.

    Args:
        own: The scene from its own start, and its exact solution.
        entries: The engines.
        dts: Time steps [s].
        processes: The engines' processes.
        on_progress: Called before, while and after each engine works.
        stamp: The run's provenance.
        timings: The time that the engines' steps take.
    """
    scene = own.scene
    labels = tuple(entry.label for entry in entries)
    found = _Collected({label: [] for label in labels})
    for dt in dts:
        phases, exact = phases_at(own, dt)
        laws = _other_laws(own, dt, phases) if dt == min(dts) else []
        compared: list[tuple[EngineRun, list[Comparison]]] = []
        for entry in entries:
            progress = Progress(scene.name, entry.label, dt)
            on_progress(progress)
            timing = timings[scene.name, entry.label, dt]
            engine_run = _run(processes, entry, own, dt, phases, timing, reporter(progress, on_progress))
            cases = [] if breakdown_of(engine_run) else compare(engine_run.phases, phases, exact)
            found.measured[entry.label] += measure(own, dt, engine_run, phases, exact, cases, timing.per_step)
            _collect(found, own, dt, engine_run)
            found.other_laws += _distances(own, dt, engine_run, laws) if cases else []
            compared.append((engine_run, cases))
            on_progress(progress._replace(finished=True))
        for first, second in combinations(compared, 2):
            found.agreements += _agreement(own, dt, phases, first, second)
    if is_sufficient(sorted(dts)):
        for entry in entries:
            if entry.label in found.claims:
                measured = found.measured[entry.label]
                found.studies[entry.label] = study_engine(own, entry, found.claims[entry.label], measured, processes, on_progress)
    rows = found.means + _with_convergence(found, labels) + found.other_laws
    table, predictions, agreements = map(as_table, (rows, found.predictions, found.agreements))
    provenance = {**stamp, "settings": found.settings, "motions": {scene.name: found.motions}}
    return Results(table, {scene.name: scene}, labels, found.trajectories, found.ensembles, provenance, predictions, agreements)


def _run(
    processes: EngineProcesses,
    entry: EngineEntry,
    own: StartPhase,
    dt: float,
    phases: Sequence[StartPhase],
    timing: Timing,
    on_simulations: OnSimulations,
) -> EngineRun:
    """Run a scene with an engine, unless its process ended while it was timed."""
    if timing.ended:
        return EngineRun(entry.label, timing.breakdown)
    engine_run = processes.run_engine(entry, own.scene, dt, [phase.scene for phase in phases], on_simulations, quick=own.quick)
    return engine_run if engine_run.breakdown else replace(engine_run, breakdown=timing.breakdown)


def _collect(found: _Collected, own: StartPhase, dt: float, engine_run: EngineRun) -> None:
    """Keep what one engine gave at one time step, apart from its metrics."""
    scene, label = own.scene, engine_run.label
    case = Case(scene.name, label, dt, scene.steps(dt))
    truth = own.truth.name if own.truth else ""
    for name, value in engine_run.predicted.items():
        found.predictions.append(case.measurement("prediction", name, METRICS[name].unit, Judgement(value, "measured"), truth))
    if engine_run.motion is not None:
        found.trajectories[scene.name, label, dt] = engine_run.motion
        found.settings.setdefault(label, {})[f"{scene.name} dt={dt:g}"] = engine_run.settings
        found.motions.setdefault(label, {})[repr(float(dt))] = motion_digest([engine_run.motion, *engine_run.phases])
        earlier = found.claims[label].limitations if label in found.claims else ()
        found.claims[label] = Claim(label, engine_run.order, engine_run.precision, (*earlier, *engine_run.limitations))
    if engine_run.outcome is not None:
        found.ensembles[scene.name, label, dt] = engine_run.outcome
        for name, judgement in judge_means(scene, dt, engine_run.outcome):
            found.means.append(case.measurement("ensemble", name, ENSEMBLE_METRICS[name].unit, judgement))


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


def _other_laws(own: StartPhase, dt: float, phases: Sequence[StartPhase]) -> list[_OtherLaw]:
    """The exact solutions under the impact laws that the scene does not name, from each start phase."""
    found = []
    for law, truth in other_laws(own.scene).items():
        of_law = [phase._replace(truth=truth.after(phase.delay)) for phase in phases]
        found.append(_OtherLaw(law, of_law, exactly_at(own.scene, dt, truth, of_law)))
    return found


def _distances(own: StartPhase, dt: float, engine_run: EngineRun, laws: Sequence[_OtherLaw]) -> Iterator[Measurement]:
    """How far an engine is from the exact solution under each other impact law, in the leading metric of the scene; this is no error."""
    case = Case(own.scene.name, engine_run.label, dt, own.scene.steps(dt))
    for law, phases, exact in laws:
        metric = METRICS[leading_metric(own.scene)]
        value = metric.value_or_nan(compare(engine_run.phases, phases, exact))
        yield case.measurement("other_law", metric.name, metric.unit, Judgement(value, "measured"), law)


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
