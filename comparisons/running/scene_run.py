"""One scene of a run: the engines simulate it one after another, are compared with each other, and are judged.

What is done with one engine is an `EngineStudy`.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain, combinations
from typing import Any

from dropspin.comparisons.engines.options import calibrated_label
from dropspin.comparisons.judging.agreement import judge_agreement
from dropspin.comparisons.judging.convergence import ARTEFACTS
from dropspin.comparisons.judging.error_budget import is_sufficient
from dropspin.comparisons.judging.verdicts import FAILURES, Judgement
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.metrics import METRICS, leading_metric
from dropspin.comparisons.measuring.tolerances import scale
from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS, EnsembleOutcome
from dropspin.comparisons.results.results import Results, TrajectoryKey
from dropspin.comparisons.results.table import Case, Measurement, as_table
from dropspin.comparisons.running.ablation import explaining_failure, written_out
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.engine_study import EngineStudy, Outcome
from dropspin.comparisons.running.ensembles import judge_differences, judge_means
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.progress import OnProgress
from dropspin.comparisons.running.start_phases import StartPhase, compare, phases_at, with_exact_motions
from dropspin.comparisons.running.timing import Timings
from dropspin.scenarios import Scenario, Trajectory
from dropspin.scenarios.truths import other_laws

Compared = tuple[Outcome, Sequence[Comparison]]
"""What an engine gave at a time step, and its motions from all start phases compared with the exact ones."""

TURNED = 1.0
"""An error of the orientation above this [rad] does not grow in proportion to what causes it."""


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
    studies = [EngineStudy(own, entry, processes, on_progress) for entry in entries]
    of_steps = [_at_step(own, studies, dt, timings, is_finest=dt == min(dts)) for dt in dts]
    agreements, distances = (list(chain(*rows)) for rows in zip(*of_steps, strict=True))
    by_label = {study.entry.label: study for study in studies}
    judged = []
    for study in studies:
        study.calibrated = by_label.get(calibrated_label(study.entry.label) or "")
        rows = list(study.rows(is_extrapolated=is_sufficient(sorted(dts))))
        judged += [*rows, *_explaining_settings(study, rows)]
    return _results(studies, [*judged, *distances], agreements, stamp)


def _at_step(
    own: StartPhase, studies: Sequence[EngineStudy], dt: float, timings: Timings, *, is_finest: bool
) -> tuple[list[Measurement], list[Measurement]]:
    """Run every engine at a time step; the differences between engines, and at the finest step the distances to other impact laws.

    The motions that are compared are in memory until it returns.
    """
    phases = phases_at(own, dt)
    cases = [study.run_at(dt, phases, timings[own.scene.name, study.entry.label, dt]) for study in studies]
    compared = [(study.outcomes[-1], of_study) for study, of_study in zip(studies, cases, strict=True) if of_study]
    pairs = list(combinations(compared, 2))
    agreements = [row for pair in pairs for row in _agreement(own, *pair, len(pairs))]
    measures_distances = is_finest and own.scene.recording is None
    return agreements, list(_distances_to_other_laws(own.scene, dt, phases, compared)) if measures_distances else []


def _agreement(own: StartPhase, first: Compared, second: Compared, pairs: int) -> Iterator[Measurement]:
    """The differences between two engines, of which a number of pairs is compared."""
    ((case, _, one, _, _), cases), ((_, _, other, _, _), other_cases) = first, second
    shared = one.discretisation if one.discretisation == other.discretisation else None
    for metric, judgement in judge_agreement(own.scene, own.truth, cases, other_cases, shared):
        yield case.measurement("agreement", metric.name, metric.unit, judgement, other.claim.label)
    if one.outcome is not None and other.outcome is not None:
        for name, judgement in judge_differences(one.outcome, other.outcome, pairs):
            yield case.measurement("agreement", name, ENSEMBLE_METRICS[name].unit, judgement, other.claim.label)


def _distances_to_other_laws(
    scene: Scenario, dt: float, phases: Sequence[StartPhase], compared: Sequence[Compared]
) -> Iterator[Measurement]:
    """How far engines are from the exact solutions under the impact laws that the scene does not name, in its leading metric; no errors."""
    laws = {
        law: with_exact_motions(truth, [phase._replace(truth=truth.after(phase.delay)) for phase in phases], dt)
        for law, truth in other_laws(scene).items()
    }
    if not laws:  # also without an exact solution, where no metric leads
        return
    metric = METRICS[leading_metric(scene)]
    for outcome, cases in compared:
        for law, of_law in laws.items():
            value = metric.value_or_nan(compare([case.motion for case in cases], of_law))
            yield outcome.case.measurement("other_law", metric.name, metric.unit, Judgement(value, "measured"), law)


def _explaining_settings(study: EngineStudy, rows: Sequence[Measurement]) -> Iterator[Measurement]:
    """The changed settings that explain the leading, or else the largest error that fails at the finest time step, or as dt → 0."""
    scene, engine = study.own.scene, study.entry.engine
    measured = [row for row in rows if row.kind in ("truth", "invariant") and row.metric not in ARTEFACTS]
    as_dt_falls = {row.metric for row in rows if row.kind == "asymptotic_error" and row.verdict in FAILURES}
    failing = [row for row in measured if row.verdict in FAILURES] or [row for row in measured if row.metric in as_dt_falls]
    if engine is None or (engine.is_calibrated and not engine.given_numbers) or not failing or study.own.truth is None:
        return
    dt = min(row.dt for row in failing)
    sizes = {row.metric: abs(row.value) / scale(scene, row.unit) for row in failing if row.dt == dt}
    turned = {name for name, size in sizes.items() if METRICS[name].unit == "rad" and size > TURNED}
    metric = METRICS[max(sizes, key=lambda name: (name not in turned, name == leading_metric(scene), sizes[name]))]
    options = study.processes.call(study.entry, written_out, scene, dt)
    if isinstance(options, Breakdown):
        return
    case = Case(scene.name, study.entry.label, dt, scene.steps(dt))
    for settings, share in explaining_failure(engine, options, study.error_of(metric, dt)).items():
        yield case.measurement("setting", metric.name, "1", Judgement(share, "measured"), settings)


def _results(
    studies: Sequence[EngineStudy], judged: Sequence[Measurement], agreements: Sequence[Measurement], stamp: Mapping[str, Any]
) -> Results:
    """The run of one scene as results: means of ensembles first, predicted errors and agreements in tables of their own."""
    scene, known, *_ = studies[0].own
    truth = known.name if known else ""
    means: list[Measurement] = []
    predictions: list[Measurement] = []
    trajectories: dict[TrajectoryKey, Trajectory] = {}
    ensembles: dict[TrajectoryKey, EnsembleOutcome] = {}
    settings: dict[str, dict[str, Any]] = {}
    motions: dict[str, dict[str, str]] = {}
    for case, _, run, _, digest in chain(*zip(*(study.outcomes for study in studies), strict=True)):
        key = case.scene, case.engine, case.dt
        for name, value in run.predicted.items():
            predictions.append(case.measurement("prediction", name, METRICS[name].unit, Judgement(value, "measured"), truth))
        if run.motion is not None:
            trajectories[key] = run.motion
            settings.setdefault(case.engine, {})[f"{case.scene} dt={case.dt:g}"] = run.settings
            motions.setdefault(case.engine, {})[repr(float(case.dt))] = digest
        if run.outcome is not None:
            ensembles[key] = run.outcome
            for name, judgement in judge_means(scene, case.dt, run.outcome):
                means.append(case.measurement("ensemble", name, ENSEMBLE_METRICS[name].unit, judgement))
    labels = tuple(study.entry.label for study in studies)
    table, predicted, differences = map(as_table, ([*means, *judged], predictions, agreements))
    provenance = {**stamp, "settings": settings, "motions": {scene.name: motions}}
    return Results(table, {scene.name: scene}, labels, trajectories, ensembles, provenance, predicted, differences)
