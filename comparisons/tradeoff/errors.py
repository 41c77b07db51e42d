"""The errors of an engine over a ladder of time steps, from the coarsest to the one at which its error stops falling.

Errors are of states at a fixed output interval, the same for every time step, so that all steps are compared at the same times.
"""

import math
import time
from collections.abc import Sequence

import numpy as np

from comparisons.engines.base import Diverged
from comparisons.measuring.comparison import Comparison, Unresolved
from comparisons.measuring.metrics import METRICS
from comparisons.running.inputs import MOST_STEPS, EngineEntry
from comparisons.running.processes import EngineProcesses, Failed
from comparisons.running.recording import record
from comparisons.running.start_phases import StartPhase, start_phases
from scenarios import Scenario, truth_for

DIVISIONS = (1, *(k * 2**j for j in range(22) for k in (2, 3)))
"""1, 2, 3, 4, 6, 8, 12, …: steps per output, each about 1.4 times as many as before."""
FEWEST_OUTPUTS = 8
LARGEST_TURN = 1.0
"""Rotation in the coarsest step [rad]."""
BUDGET_IN_FLIGHT, BUDGET_ON_A_FLOOR = 0.25, 0.05  # s of one run; errors with a floor are means over 32 runs
MOST_RECORDED = 200_000  # steps of one run with a floor, all of which are recorded
NO_BETTER = 0.8
"""A step whose error is above this share of the step's before does not improve on it."""
FEWEST_POINTS = 6
"""The least number of time steps that show a smallest error, or convergence to another motion."""
CONVERGED = 0.3
"""The share of the largest error of the motion that the smallest must be below."""
SMALL, PATIENCE, PATIENCE_WHILE_LARGE = 1e-6, 2, 6


def output_interval(scene: Scenario) -> float:
    """The interval between compared states [s], and the coarsest step: a turn of 1 rad, an eighth of the scene, a quarter of its fall."""
    fastest = float(np.linalg.norm(scene.start.angular_velocity))
    intervals = [scene.duration / FEWEST_OUTPUTS]
    if fastest > 0.0:
        intervals.append(LARGEST_TURN / fastest)
    truth = truth_for(scene)
    if truth is not None and truth.events and truth.events[0].time > 0.0:
        intervals.append(truth.events[0].time / 4.0)
    return min(intervals)


def errors_over_steps(entry: EngineEntry, scene: Scenario, metrics: Sequence[str], processes: EngineProcesses) -> list[tuple[float, float]]:
    """Time steps and errors by the first metric, from the coarsest step to the smallest error, or as far as the budget allows.

    By the second metric, that of the motion, the engine must converge. Else it simulates another motion, and a small error by the first
    metric is worthless: Wang's method keeps the energy of a spin that it gets wrong.

    Raises:
        Failed: The engine is missing, declines the scene, diverges at all steps, or does not converge.
    """
    if entry.engine is None:
        raise Failed("missing", entry.missing)
    refusal = entry.engine.declines(scene)
    if refusal is not None:
        raise Failed("declined", refusal)
    interval = output_interval(scene)
    budget = BUDGET_IN_FLIGHT if scene.floor is None else BUDGET_ON_A_FLOOR
    found: list[tuple[float, float, float]] = []
    not_better = 0
    processes.call(entry, _error, scene, interval, 1, metrics)  # compiles and warms up before anything is timed
    for division in DIVISIONS:
        dt = interval / division
        if scene.duration / dt > (MOST_STEPS if scene.floor is None else MOST_RECORDED):
            break
        try:
            errors, taken = processes.call(entry, _error, scene, dt, division, metrics)
        except Failed:
            if found:
                break  # the coarser steps count
            raise
        if np.isfinite(errors).all():
            not_better = not_better + 1 if found and errors[0] > NO_BETTER * found[-1][1] else 0
            found.append((dt, *errors))
        patience = PATIENCE if found and found[-1][1] < SMALL else PATIENCE_WHILE_LARGE
        if (not_better >= patience and len(found) > FEWEST_POINTS) or taken > budget:
            break
    if not found:
        raise Failed("diverged", "no step gives a finite error")
    _verify_convergence([error for _, _, error in found], metrics[1])
    return [(dt, error) for dt, error, _ in found]


def _verify_convergence(errors: Sequence[float], metric: str) -> None:
    """Raise `Failed` if the errors of the motion do not fall with the time step."""
    stays = max(errors) > SMALL and min(errors) > CONVERGED * max(errors)
    if stays and len(errors) > FEWEST_POINTS:
        unit = METRICS[metric].unit
        value = f"{errors[-1]:.3g}" + ("" if unit == "1" else f" {unit}")
        raise Failed("failed", f"it does not converge: {metric.replace('_', ' ')} stays at {value}, however small the step")


def _error(entry: EngineEntry, scene: Scenario, dt: float, division: int, metrics: Sequence[str]) -> tuple[list[float], float]:
    """Absolute values of metrics at a time step, NaN where one is undefined, and the wall time of a run [s]."""
    assert entry.engine is not None
    truth = truth_for(scene)
    in_flight = scene.floor is None
    phases = [StartPhase(scene, truth)] if in_flight else start_phases(scene, truth, dt)
    taken, cases = 0.0, []
    for phase in phases:
        start = time.perf_counter()
        try:
            motion = record(entry.engine, phase.scene, dt, division if in_flight else 1).motion
        except Diverged:
            return [math.nan] * len(metrics), 0.0
        taken += time.perf_counter() - start
        cases.append(Comparison.with_truth(phase.scene, motion, phase.truth))
    return [_size(metric, cases) for metric in metrics], taken / len(phases)


def _size(metric: str, cases: Sequence[Comparison]) -> float:
    try:
        with np.errstate(all="ignore"):
            return abs(METRICS[metric].average(cases).value)
    except Unresolved:
        return math.nan
