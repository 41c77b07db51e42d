"""The cost of the time steps of an engine, measured in its process: wall time per simulated second, for one world and for a batch."""

import math
import time
from collections.abc import Sequence

import numpy as np

from comparisons.engines.base import Diverged, Engine
from comparisons.running.inputs import MOST_STEPS, EngineEntry
from comparisons.running.recording import time_steps
from scenarios import Scenario

LONG_ENOUGH = 2e-3
"""The smallest wall time of a timing [s]."""
MOST_RUNS = 200
BATCH = 256
"""Number of worlds in a batch."""
BATCH_ROUNDS = 3
MOST_BATCH_STEPS = 100_000
"""Number of time steps, summed over all worlds, in one timing."""


def cost(entry: EngineEntry, scene: Scenario, dt: float) -> float:
    """Wall time per simulated second of the engine's time steps [s/s]; NaN if the state after them is not finite.

    In free flight every step takes the same time. One call is timed, with enough steps to make the cost of the call itself negligible,
    beyond the end of the scene if the engine does not break down there. With a floor the time depends on the motion, so whole runs are
    timed.
    """
    if scene.floor is None:
        steps = 16
        while (taken := _timed(entry, scene, dt, steps)) < LONG_ENOUGH and steps < MOST_STEPS:
            steps = min(MOST_STEPS, math.ceil(steps * min(16.0, max(2.0, 1.2 * LONG_ENOUGH / taken))))
        if np.isfinite(taken):
            return taken / (steps * dt)
    steps, total, runs = scene.steps(dt), 0.0, 0
    while total < LONG_ENOUGH and runs < MOST_RUNS:
        total, runs = total + _timed(entry, scene, dt, steps), runs + 1
    return total / runs / (steps * dt)


def _timed(entry: EngineEntry, scene: Scenario, dt: float, steps: int) -> float:
    """Wall time of some time steps [s]; NaN if the state after them is not finite."""
    try:
        timed = time_steps(entry.adapter, scene, dt, steps)
    except Diverged:
        return math.nan
    return timed.stepping if np.isfinite(timed.state).all() else math.nan


def costs_per_world(entry: EngineEntry, scene: Scenario, dts: Sequence[float]) -> list[float]:
    """Wall time per simulated second and world [s/s] of a batch at each time step; NaN if the engine cannot simulate batches.

    In free flight a step takes the same time at any dt; with a floor whole runs are timed, unless they are too long.
    """
    if scene.floor is not None:
        return [_timed_batch(entry.adapter, scene, dt, scene.steps(dt)) / (scene.steps(dt) * dt) for dt in dts]
    steps = MOST_BATCH_STEPS // BATCH
    taken = _timed_batch(entry.adapter, scene, dts[-1], steps)
    return [taken / (steps * dt) for dt in dts]


def _timed_batch(engine: Engine, scene: Scenario, dt: float, steps: int) -> float:
    """The smallest wall time per world of some time steps of a batch [s]; NaN without a batch or if its states are not finite."""
    members, timings = [scene] * BATCH, []
    if steps * BATCH > MOST_BATCH_STEPS:
        return math.nan
    for _ in range(1 + BATCH_ROUNDS):
        batch = engine.prepare_batch(members, dt)
        if batch is None:
            return math.nan
        with batch:
            start = time.perf_counter()
            batch.advance(steps)
            states = np.asarray(batch.states())
            timings.append(time.perf_counter() - start)
        if not np.isfinite(states).all():
            return math.nan
    return min(timings[1:]) / BATCH  # the first round compiles
