"""Start phases, and every metric of the motions from them: means over 32 starts average out the phase of an impact within a time step.

An engine detects an impact at the first step that ends below the floor, so its error depends on the phase of the impact within a step.
Starts that lie equal parts of a step further along the scene's motion draw that phase evenly (stratified sampling). A toss of a
recording starts at the end of its flight; its four phases are earlier states of this flight.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from dropspin.comparisons.judging.convergence import JUMPING, SeriesPoint
from dropspin.comparisons.measuring.batch_quantities import compute_cases, compute_states
from dropspin.comparisons.measuring.comparison import Comparison, Unresolved
from dropspin.comparisons.measuring.metric import PHASES_OF_TOSS, Average
from dropspin.comparisons.measuring.metrics import metrics_for
from dropspin.comparisons.measuring.state_quantities import States
from dropspin.comparisons.measuring.tolerances import FEW_DRAWS, rounding, tolerance
from dropspin.comparisons.running.arguments import MOST_ROWS
from dropspin.comparisons.running.engine_run import EngineRun
from dropspin.scenarios import Scenario, Trajectory, Truth
from dropspin.scenarios.state import RATES
from dropspin.scenarios.truths.flight import flight_states
from dropspin.scenarios.truths.measured import tosses

START_PHASES, QUICK_START_PHASES = 32, 8
QUICK_TOSSES = 8
REST_SHARE = 0.1
"""A scene whose body rests after impacts in this share of its duration is about rest, not about impacts."""
QUICK_NOISE = 2.0
"""Factor on the noise of a mean over 8 start phases, within which the mean over 32 lies: over the catalogue, with Wang's method and MuJoCo
at 3 and 8 ms, the largest difference is 1.4 times the noise, and 0.6 times for most metrics.
"""


class StartPhase(NamedTuple):
    """A scene from one start, and its exact solution, if it is known.

    Attributes:
        scene: The scene.
        truth: Its exact solution.
        quick: Whether the scene is to be run from few starts.
        delay: Time by which its start is later than the scene's own [s].
        exact: The exact motion from this start at every step, as far as it is known.
    """

    scene: Scenario
    truth: Truth | None
    quick: bool = False
    delay: float = 0.0
    exact: States | None = None


def number_of_phases(own: StartPhase, dt: float) -> int:
    """The number of start phases: 1 if no impact comes after the first step [s], or if the body rests from a tenth of the duration on.

    Long scenes have fewer, so that they fit into memory. With a recording there are four of each toss.
    """
    scene, truth, quick, *_ = own
    if truth is not None and not truth.is_exact and scene.recording is not None:
        tosses = len(scene.recording.tosses)
        return PHASES_OF_TOSS * (min(tosses, QUICK_TOSSES) if quick else tosses)
    if truth is None or not truth.events or truth.events[0].time <= dt:
        return 1
    end = np.array([scene.duration])
    if truth.events[-1].time < REST_SHARE * scene.duration and truth.covers(end).all() and not truth(end).states[:, RATES].any():
        return 1
    return max(1, min(QUICK_START_PHASES if quick else START_PHASES, MOST_ROWS // scene.steps(dt)))


def start_phases(scene: Scenario, truth: Truth | None, dt: float, *, quick: bool = False) -> list[StartPhase]:
    """The scene from `number_of_phases` starts, whose first impacts are at different phases of a time step, or only the scene itself."""
    count = number_of_phases(StartPhase(scene, truth, quick), dt)
    if truth is None or count == 1:
        return [StartPhase(scene, truth)]
    if truth.is_exact:
        delays = (np.arange(count) + 0.5) / count * dt
        motions = [(scene, truth, truth(delays).states)]
    else:  # states of the flight before each toss
        delays = -(np.arange(PHASES_OF_TOSS) + 0.5) / PHASES_OF_TOSS * dt
        inertia, g = scene.body.inertia_tensor, scene.acceleration
        chosen = tosses(scene)[: count // PHASES_OF_TOSS]
        motions = [(start, toss, flight_states(start.initial_state, inertia, g)(delays)) for start, toss in chosen]
    return [
        StartPhase(start.starting_at(state), motion.after(delay), delay=delay)
        for start, motion, states in motions
        for state, delay in zip(states, delays.tolist(), strict=True)
    ]


def phases_at(own: StartPhase, dt: float) -> Sequence[StartPhase]:
    """The start phases at a time step [s] with their exact motions, as far as these are known."""
    return with_exact_motions(own.truth, start_phases(own.scene, own.truth, dt, quick=own.quick), dt)


def with_exact_motions(truth: Truth | None, phases: Sequence[StartPhase], dt: float) -> Sequence[StartPhase]:
    """Start phases with their exact motions at time steps of dt [s]: one call of the exact solution of the scene itself, if it is known."""
    if truth is None or not truth.is_exact:
        return phases
    times = dt * np.arange(1 + phases[0].scene.steps(dt), dtype=float)
    known = [times[phase.truth.covers(times)] for phase in phases if phase.truth is not None]
    states = truth.states(np.concatenate([t + phase.delay for t, phase in zip(known, phases, strict=True)]))
    parts = np.split(states, np.cumsum([len(t) for t in known[:-1]]))
    found = [States(phase.scene, Trajectory.from_states(t, part)) for phase, t, part in zip(phases, known, parts, strict=True)]
    for _ in compute_states(found):
        pass  # all that is needed of a batch is what was computed
    return [phase._replace(exact=exact) for phase, exact in zip(phases, found, strict=True)]


def compare(motions: Sequence[Trajectory], phases: Sequence[StartPhase]) -> list[Comparison]:
    """Motions from all start phases compared with the exact solution."""
    cases = []
    for phase, motion in zip(phases, motions, strict=True):
        cases.append(Comparison.with_truth(phase.scene, motion, phase.truth, None if phase.exact is None else phase.exact.motion))
        if phase.exact is not None:
            vars(cases[-1])["exact_states"] = phase.exact
    compute_cases(cases)
    return cases


def measure(
    own: StartPhase, dt: float, run: EngineRun, cases: Sequence[Comparison], changes: Sequence[Mapping[str, float]]
) -> dict[str, SeriesPoint]:
    """Every metric of one engine at one time step, by name; `changes`: of each metric, with each set of perturbed starts."""
    scene, quick, precision = own.scene, own.quick, run.claim.precision
    steps, found = scene.steps(dt), {}
    for metric in metrics_for(scene, own.truth):
        components, noise, rounded, unresolved = None, 0.0, 0.0, None
        try:
            average = metric.average(cases)
        except Unresolved as error:
            average, unresolved = Average(*[np.array([np.nan])] * 3), error.with_traceback(None)  # which would keep the motions
        if not np.isnan(average.value):
            components = metric.average_components(cases)
        if quick and len(cases) > 1:
            average, components = average.less_certain(QUICK_NOISE), components and components.less_certain(QUICK_NOISE)
            noise = np.inf if metric.name in JUMPING else average.noise
        moved = float(np.max([change[metric.name] for change in changes], initial=0.0))
        sampling_noise = FEW_DRAWS * moved if len(cases) == 1 else average.jump + moved
        noise = max(noise, run.uncertainties.get(metric.name, 0.0))
        allowed = tolerance(scene, metric.unit, precision, steps, sampling_noise)
        if precision is not np.float64:
            rounded = max(float(rounding(scene, metric.unit, precision, np.array(steps))), allowed)
        # Results of a quick run are not compared with those of other runs: the effect of rounding is not measured.
        compared = np.nan if quick else allowed
        found[metric.name] = SeriesPoint(dt, steps, average, components, compared, noise, rounded, unresolved)
    return found
