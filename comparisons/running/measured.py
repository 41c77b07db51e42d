"""Every metric of one engine in one scene at one time step."""

from collections.abc import Sequence

import numpy as np

from dropspin.comparisons.judging.convergence import JUMPING, SeriesPoint
from dropspin.comparisons.measuring.batch import compute_cases, compute_states
from dropspin.comparisons.measuring.comparison import Comparison, Unresolved
from dropspin.comparisons.measuring.metric import Average
from dropspin.comparisons.measuring.metrics import metrics_for
from dropspin.comparisons.measuring.states import States
from dropspin.comparisons.measuring.tolerances import FEW_DRAWS, rounding, tolerance
from dropspin.comparisons.running.engine_run import EngineRun
from dropspin.comparisons.running.recording import Breakdown, divergence
from dropspin.comparisons.running.start_phases import StartPhase, exact_motions, start_phases
from dropspin.scenarios import Scenario, Trajectory, Truth

QUICK_NOISE = 2.0
"""Factor on the noise of a mean over 8 start phases, within which the mean over 32 lies: over the catalogue, with Wang's method and MuJoCo
at 3 and 8 ms, the largest difference is 1.4 times the noise, and 0.6 times for most metrics.
"""


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
) -> dict[str, SeriesPoint]:
    """Every metric of one engine at one time step, by name."""
    scene, _, quick, _ = own
    steps, found = scene.steps(dt), {}
    perturbed = [compare(motions, phases, exact) for motions in engine_run.perturbed]
    for metric in metrics_for(scene, own.truth):
        components, noise, rounded, unresolved = None, 0.0, 0.0, None
        try:
            average = metric.average(cases)
        except Unresolved as error:
            average, unresolved = Average(*[np.array([np.nan])] * 3), error
        if not np.isnan(average.value):
            components = metric.average_components(cases)
        if quick and len(cases) > 1:
            average, components = average.less_certain(QUICK_NOISE), components and components.less_certain(QUICK_NOISE)
            noise = np.inf if metric.name in JUMPING else average.noise
        moved = float(np.max([abs(metric.value_or_nan(some) - average.value) for some in perturbed], initial=0.0))
        sampling_noise = FEW_DRAWS * moved if len(cases) == 1 else average.jump + moved
        allowed = tolerance(scene, metric.unit, engine_run.precision, steps, sampling_noise)
        if engine_run.precision is not np.float64:
            rounded = max(float(rounding(scene, metric.unit, engine_run.precision, np.array(steps))), allowed)
        # Results of a quick run are not compared with those of other runs: the effect of rounding is not measured.
        compared = np.nan if quick else allowed
        found[metric.name] = SeriesPoint(dt, steps, average, components, compared, noise, rounded, unresolved)
    return found
