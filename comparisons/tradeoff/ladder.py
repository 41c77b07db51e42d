"""The errors of an engine over a ladder of time steps, from the coarsest to those at which the error stops falling.

States are compared at a fixed output interval, so that errors at all time steps are measured at the same times.
"""

import math
import os
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, takewhile
from typing import Literal

import numpy as np

from dropspin.comparisons.engines.exceptions import short
from dropspin.comparisons.judging.verdicts import Verdict
from dropspin.comparisons.measuring.comparison import Comparison, Unresolved
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.running.arguments import MOST_STEPS, EngineEntry
from dropspin.comparisons.running.driving import Breakdown, classify, divergence, record, verify_accepted
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.start_phases import StartPhase, start_phases
from dropspin.scenarios import Scenario, truth_for
from dropspin.scenarios.truths import exact_solution

DIVISIONS = (1, *(k * 2**j for j in range(22) for k in (2, 3)))
"""Numbers of steps per output interval, 1, 2, 3, 4, 6, 8, 12, …, each about 1.4 times the previous one."""
FEWEST_OUTPUTS = 8
LARGEST_TURN = 1.0
"""Rotation in the coarsest time step [rad]."""
BUDGET = 10.0
"""Default processor time for all time steps of a configuration [s]; errors with a floor are means over 32 runs."""
MOST_RECORDED = 200_000  # steps of one run with a floor, all of which are recorded
NO_BETTER = 0.8
"""A time step is no improvement if its error is above this share of the error at the previous time step."""
FEWEST_POINTS = 6
"""The smallest number of time steps that shows a minimum of the error, or convergence to another motion."""
CONVERGED = 0.3
"""The share of the largest error of the motion below which the smallest must be."""
WRONG = 0.01
"""The error of a motion, in rad or relative to the distance that it covers, up to which it is not wrong, also if it does not fall."""
ROWS_OF_MOTION = 65
SMALL, PATIENCE, PATIENCE_WHILE_LARGE = 1e-6, 2, 6
LAST = 3
"""The number of last time steps at which an error that does not fall must be within a tolerance."""
LARGE_ANGLE = 0.5
"""An angle [rad] above which an error may stay at any number of time steps and still fall at smaller ones: it is at most π."""


Ending = Literal["budget", "longest_run", "error_stopped_falling", "failed", "not_run"]


@dataclass(frozen=True)
class Ladder:
    """The time steps at which an engine was tried.

    Attributes:
        engine: Label of the engine.
        steps: Each tested time step [s], beginning with the largest, and the absolute value of the metric; NaN if the metric is undefined.
        ended: The kind of reason why no smaller time step was tried.
        reason: The reason why no smaller time step was tried, as a clause.
        left_out: The reason why the engine is left out of the comparison; empty if it is compared.
        verdict: The verdict on the engine if it broke down, declines the scene or is not installed; otherwise None.
        undefined: Why there is no error at the smallest time step without one, such as that the state is not finite.
        no_batch_cost: Why batches have no cost at the largest time step without one; empty for an engine without batches.
    """

    engine: str
    steps: tuple[tuple[float, float], ...]
    ended: Ending
    reason: str
    left_out: str = ""
    verdict: Verdict | None = None
    undefined: str = ""
    no_batch_cost: str = ""

    @property
    def completed(self) -> tuple[tuple[float, float], ...]:
        """The time steps without one at which the engine's process failed, such as one that takes too long."""
        return self.steps[:-1] if self.ended == "failed" else self.steps


def output_interval(scene: Scenario) -> float:
    """The interval between compared states [s], and coarsest time step: a turn of 1 rad, an eighth of the scene, a quarter of its fall."""
    fastest = float(np.linalg.norm(scene.start.angular_velocity))
    intervals = [scene.duration / FEWEST_OUTPUTS]
    if fastest > 0.0:
        intervals.append(LARGEST_TURN / fastest)
    truth = truth_for(scene)
    if truth is not None and truth.events and truth.events[0].time > 0.0:
        intervals.append(truth.events[0].time / 4.0)
    return min(intervals)


def errors_over_steps(
    entry: EngineEntry, scene: Scenario, metrics: Sequence[str], budget: float, processes: EngineProcesses, within: float = 0.0
) -> Ladder:
    """The errors by the first metric, from the coarsest time step to those at which they stop falling, or to the end of the budget.

    The errors by the second metric, that of the motion, must fall too. Otherwise the engine is left out, because it may simulate another
    motion, for which a small error by the first metric has no meaning: Wang's method conserves the energy of a rotation that is wrong. It
    takes part if its errors by the second metric are undefined, or if the two metrics are the same and the errors within a tolerance.

    Args:
        entry: The engine.
        scene: The scene.
        metrics: The metric of the error, and that of the motion.
        budget: Processor time for all time steps [s]; the time step at which it is exceeded is the last one.
        processes: The engine's process.
        within: The tolerance.
    """
    interval = output_interval(scene)
    most = MOST_STEPS if scene.floor is None else MOST_RECORDED
    tried: list[tuple[float, list[float]]] = []
    spent = 0.0
    verdict: Verdict | None = None
    ended: Ending = "longest_run"
    undefined = ""
    reason = f"a run at the next smaller time step would have more than {most:,} steps"
    run = processes.call(entry, _errors, scene, interval, 1, metrics)  # compiles and warms up before anything is timed
    if isinstance(run, Breakdown):
        return Ladder(entry.label, (), "not_run", run.reason, run.reason, run.verdict)
    for division in takewhile(lambda division: scene.duration * division / interval <= most, DIVISIONS):
        run = processes.call(entry, _errors, scene, interval / division, division, metrics)
        if isinstance(run, Breakdown):
            tried.append((interval / division, [math.nan] * len(metrics)))
            ended, reason, verdict = "failed", run.reason, run.verdict
            break
        errors, seconds, why, broken = run
        tried.append((interval / division, errors))
        spent += seconds
        undefined, verdict = why or undefined, broken or verdict
        stalled = _stalled([errors[0] for _, errors in tried if np.isfinite(errors[0])])
        if stalled and not _has_large_angle(metrics, errors):
            ended, reason = "error_stopped_falling", f"at the last {stalled} time steps the error fell by less than a fifth each"
            break
        if spent >= budget:
            ended, reason = "budget", f"the budget of {budget:g} s of processor time was spent"
            break
    ladder = Ladder(entry.label, tuple((dt, errors[0]) for dt, errors in tried), ended, reason, "", verdict, undefined)
    if verdict is not None and not np.isfinite([error for _, error in ladder.steps]).any():
        return Ladder(entry.label, (), "not_run", undefined or reason, undefined or reason, verdict)
    if metrics[0] == metrics[1] and all(error <= within for _, error in ladder.completed[-LAST:]):
        return ladder
    return replace(ladder, left_out=_left_out(scene, tried, metrics[1], undefined or reason))


def _has_large_angle(metrics: Sequence[str], errors: Sequence[float]) -> bool:
    return any(METRICS[metric].unit == "rad" and error > LARGE_ANGLE for metric, error in zip(metrics, errors, strict=True))


def _stalled(errors: Sequence[float]) -> int:
    """The number of last time steps over which the errors have stopped falling; 0 if they still fall, or if there are too few."""
    patience = PATIENCE if errors and errors[-1] < SMALL else PATIENCE_WHILE_LARGE
    stays = len(errors) > FEWEST_POINTS and all(later >= NO_BETTER * earlier for earlier, later in pairwise(errors[-patience - 1 :]))
    return patience if stays else 0


def _left_out(scene: Scenario, tried: Sequence[tuple[float, list[float]]], metric: str, reason: str) -> str:
    """The reason why an engine is left out: no error is finite, or large errors of the motion do not fall; empty if it takes part."""
    first, last = (f"{1e3 * tried[place][0]:.4g} ms" for place in (0, -1))
    range_tried = f"{len(tried)} time steps tried, {first} to {last}" if len(tried) > 1 else f"only time step tried, {first}"
    if not np.isfinite([error for _, (error, _) in tried]).any():
        return f"no error is finite at the {range_tried}: {reason}"
    errors = [motion for _, (_, motion) in tried if np.isfinite(motion)]  # none if a flight is too short for it, for example
    size = _covered(scene) if METRICS[metric].unit == "m" else 1.0
    if len(errors) > FEWEST_POINTS and min(errors) > max(CONVERGED * max(errors), WRONG * size):
        unit = "" if METRICS[metric].unit == "1" else f" {METRICS[metric].unit}"
        return f"no convergence observed: {metric.replace('_', ' ')} is {min(errors):.3g} to {max(errors):.3g}{unit} at the {range_tried}"
    return ""


def _covered(scene: Scenario) -> float:
    """The largest distance of the exact motion from its start [m], at least the size of the body."""
    truth = exact_solution(scene)
    position = truth(np.linspace(0.0, min(scene.duration, truth.horizon), ROWS_OF_MOTION)).position
    return max(scene.body.size, float(np.linalg.norm(position - position[0], axis=1).max()))


def _errors(
    entry: EngineEntry, scene: Scenario, dt: float, division: int, metrics: Sequence[str]
) -> tuple[list[float], float, str, Verdict | None]:
    """Sizes of metrics at a time step, NaN where undefined, their processor time [s], and what broke or left the first undefined."""
    start = processor_time()
    verify_accepted(entry.adapter, scene)
    truth, every = truth_for(scene), division if scene.floor is None else 1
    phases = [StartPhase(scene, truth)] if scene.floor is None else start_phases(scene, truth, dt)
    motions, errors = [], [math.nan] * len(metrics)
    try:
        motions = [record(entry.adapter, phase.scene, dt, every).motion for phase in phases]
        cases = [Comparison.with_truth(phase.scene, motion, phase.truth) for phase, motion in zip(phases, motions, strict=True)]
        errors, [why, *_] = map(list, zip(*(_error(metric, cases) for metric in metrics), strict=True))
    except Exception as error:  # the engine may fail at coarse time steps alone
        failure = classify(error)
        if failure.verdict == "timed_out":  # which would cost as much time at the next time step
            raise failure from None
        return errors, processor_time() - start, failure.reason, None if failure.verdict == "diverged" else failure.verdict
    if np.isfinite(errors[0]):
        return errors, processor_time() - start, "", None
    why = next((broken.reason for broken in map(divergence, motions) if broken), why)
    return errors, processor_time() - start, why, None


def _error(metric: str, cases: Sequence[Comparison]) -> tuple[float, str]:
    """The size of a metric, with a floor the root mean square over start phases; NaN and why if it is undefined."""
    try:
        error = METRICS[metric].root_mean_square(cases)
    except Unresolved as unresolved:
        return math.nan, short(str(unresolved))
    return (error, "") if np.isfinite(error) else (math.nan, "the metric has no value")


def processor_time() -> float:
    """Processor time of this process and of its children that have ended [s]."""
    times = os.times()
    return time.process_time() + times.children_user + times.children_system
