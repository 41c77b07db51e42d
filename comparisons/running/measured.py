"""Every metric of one engine in one scene at one time step, judged."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dropspin.comparisons.judging.convergence import JUMPING
from dropspin.comparisons.judging.horizon import with_horizon
from dropspin.comparisons.judging.verdicts import Judgement, judge, with_limitations, with_precision
from dropspin.comparisons.measuring.batch import compute_cases, compute_states
from dropspin.comparisons.measuring.comparison import Comparison, Unresolved
from dropspin.comparisons.measuring.metric import Average, Metric
from dropspin.comparisons.measuring.metrics import metrics_for
from dropspin.comparisons.measuring.states import States
from dropspin.comparisons.measuring.tolerances import FEW_DRAWS, rounding, tolerance
from dropspin.comparisons.results.table import Case, Measurement
from dropspin.comparisons.running.engine_run import EngineRun
from dropspin.comparisons.running.recording import Breakdown, divergence
from dropspin.comparisons.running.start_phases import StartPhase, exact_motions, start_phases
from dropspin.scenarios import Scenario, Trajectory, Truth

QUICK_NOISE = 2.0
"""Factor on the noise of a mean over 8 start phases, within which the mean over 32 lies: over the catalogue, with Wang's method and MuJoCo
at 3 and 8 ms, the largest difference is 1.4 times the noise, and 0.6 times for most metrics.
"""


class Measured(NamedTuple):
    """A measurement, the average over start phases that its value is the largest part of, and that of its components.

    A remark has neither; a metric that is not the length of a vector, or is not resolved, has no components.
    """

    measurement: Measurement
    average: Average | None = None
    components: Average | None = None


def phases_at(own: StartPhase, dt: float) -> tuple[Sequence[StartPhase], list[States | None]]:
    """The start phases at a time step [s], and the exact motion from each at every step, as far as there is an exact solution."""
    phases = start_phases(own.scene, own.truth, dt, quick=own.quick)
    return phases, [None for _ in phases] if own.truth is None else exactly_at(own.scene, dt, own.truth, phases)


def exactly_at(scene: Scenario, dt: float, truth: Truth, phases: Sequence[StartPhase]) -> list[States | None]:
    """The exact motion of an exact solution from each start phase of a scene, at every step."""
    exact = exact_motions(truth, phases, dt * np.arange(1 + scene.steps(dt), dtype=float))
    found = [States(phase.scene, motion) for phase, motion in zip(phases, exact, strict=True)]
    for _ in compute_states(found):
        pass  # all that is needed of a batch is what was computed
    return list(found)


def compare(motions: Sequence[Trajectory], phases: Sequence[StartPhase], exact: Sequence[States | None]) -> list[Comparison]:
    """Motions from all start phases compared with the exact solution."""
    cases = []
    for phase, motion, known in zip(phases, motions, exact, strict=True):
        cases.append(Comparison.with_truth(phase.scene, motion, phase.truth, None if known is None else known.motion))
        if known is not None:
            vars(cases[-1])["exact_states"] = known
    compute_cases(cases)
    return cases


def breakdown_of(engine_run: EngineRun) -> Breakdown | None:
    """Why an engine has no motion to measure; None if it has."""
    if engine_run.breakdown is not None:
        return engine_run.breakdown
    assert engine_run.motion is not None
    return next(filter(None, map(divergence, [engine_run.motion, *engine_run.phases])), None)


def measure(
    own: StartPhase,
    dt: float,
    engine_run: EngineRun,
    phases: Sequence[StartPhase],
    exact: Sequence[States | None],
    cases: Sequence[Comparison],
    time_per_step: float = np.nan,
) -> list[Measured]:
    """Every metric of one engine at one time step, judged; a remark if it has no motion."""
    scene, truth, quick, _ = own
    case = Case(scene.name, engine_run.label, dt, scene.steps(dt), time_per_step)
    breakdown = breakdown_of(engine_run)
    if breakdown is not None:
        return [Measured(case.remark(breakdown.verdict, breakdown.reason))]
    perturbed = [compare(motions, phases, exact) for motions in engine_run.perturbed]
    rows = [Measured(case.remark("limited", one.message)) for one in engine_run.limitations if not one.is_minor]
    for metric in metrics_for(scene, truth):
        average, judgement = _judge_metric(scene, truth, dt, engine_run.label, metric, cases)
        components = None if np.isnan(average.value) else metric.average_components(cases)
        if quick and len(cases) > 1:
            average, components = average.less_certain(QUICK_NOISE), components and components.less_certain(QUICK_NOISE)
            judgement = _unless_noise_decides(judgement, scene, engine_run.label, dt, metric, average)
        moved = float(np.max([abs(metric.value_or_nan(some) - average.value) for some in perturbed], initial=0.0))
        sampling_noise = FEW_DRAWS * moved if len(cases) == 1 else average.jump + moved
        allowed = tolerance(scene, metric.unit, engine_run.precision, case.steps, sampling_noise)
        # Results of a quick run are not compared with those of other runs: the effect of rounding is not measured.
        judgement = replace(judgement, tolerance=np.nan if quick else allowed)
        judgement = with_limitations(judgement, metric.name, engine_run.limitations)
        if engine_run.precision is not np.float64:
            rounded = float(rounding(scene, metric.unit, engine_run.precision, np.array(case.steps)))
            judgement = with_precision(judgement, max(rounded, allowed))
        name = truth.name if metric.kind == "truth" and truth is not None else ""
        rows.append(Measured(case.measurement(metric.kind, metric.name, metric.unit, judgement, name), average, components))
    if truth is None:
        rows.append(Measured(case.remark("no_truth", "no closed form is known for this scene")))
    return rows


def _unless_noise_decides(judgement: Judgement, scene: Scenario, label: str, dt: float, metric: Metric, average: Average) -> Judgement:
    """A judgement of a mean over few start phases, unless a value within its sampling noise is judged otherwise: then it is undecided."""
    noise = np.inf if metric.name in JUMPING else average.noise
    near = [bound for bound in (judgement.lower, judgement.upper) if abs(bound - average.value) <= noise]
    others = (judge(scene, label, dt, metric, value).verdict for value in (average.value - noise, average.value + noise, *near))
    if judgement.verdict not in ("passed", "failed", "known") or {judgement.verdict} >= set(others):
        return judgement
    reason = f"not decided by the few starts of a quick run (± {noise:.2g}): {judgement.reason}"
    return replace(judgement, verdict="measured", basis="few_starts", reason=reason)


def _judge_metric(
    scene: Scenario, truth: Truth | None, dt: float, label: str, metric: Metric, cases: Sequence[Comparison]
) -> tuple[Average, Judgement]:
    """A metric's average over the start phases, and its judgement."""
    unresolved: Unresolved | None = None
    try:
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
