"""The cost of the time steps of an engine, measured in its process: wall time per simulated second, for one world and for a batch.

And the memory that a batch takes.
"""

import ctypes
import math
import os
import re
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dropspin.comparisons.engines.base import Diverged, Engine, numpy_array
from dropspin.comparisons.running.inputs import MOST_STEPS, EngineEntry
from dropspin.comparisons.running.recording import TimedSteps, time_per_step, time_steps
from dropspin.scenarios import Scenario

LONG_ENOUGH = 2e-3
"""The smallest wall time of a timing [s]."""
MUCH_LONGER = 10.0
"""A timing in free flight takes at least so many times as long as that of one step: a call may cost as much as hundreds of steps."""
MOST_RUNS = 200
WORLDS = (256,)
"""Numbers of worlds in a batch."""
TIMINGS = 3
"""The least of so many timings in free flight counts in a round: other load can only add to a time."""
BATCH_SECONDS = 0.02
"""The smallest wall time of a timing of a batch in free flight [s]."""
LONGEST_BATCH = 4.0
"""The largest wall time of a timing of a batch on a floor [s]."""
MEMORY_STEPS = 10
PROCESS = Path("/proc/self")
LOAD = Path("/proc/loadavg")


def load() -> float:
    """The number of threads of the machine that run or wait for a processor beside this one, per processor; NaN if not known."""
    try:
        running = LOAD.read_text().split()[3].partition("/")[0]
    except OSError:  # of a system other than Linux
        return math.nan
    return (float(running) - 1.0) / (os.cpu_count() or 1)


def cost(entry: EngineEntry, scene: Scenario, dt: float) -> float:
    """Wall time per simulated second of the engine's time steps [s/s]; NaN if the state after them is not finite.

    The time of the call is left out, as by `TimedSteps.per_step`. In free flight every step takes the same time: so many are timed that the
    call is short beside them, beyond the end of the scene if the engine does not break down there. With a floor the time depends on the
    motion, so whole runs are timed.
    """
    if scene.floor is None:
        steps = 16
        while (timed := _timed(entry, scene, dt, steps)) is not None and steps < MOST_STEPS:
            if timed.stepping >= (enough := max(LONG_ENOUGH, MUCH_LONGER * timed.call)):
                again = (_timed(entry, scene, dt, steps) for _ in range(TIMINGS - 1))
                return _least([timed, *filter(None, again)]) / dt
            steps = min(MOST_STEPS, math.ceil(steps * min(16.0, max(2.0, 1.2 * enough / timed.stepping))))
    steps, runs = scene.steps(dt), list[TimedSteps]()
    while sum(run.stepping for run in runs) < LONG_ENOUGH and len(runs) < MOST_RUNS:
        if (timed := _timed(entry, scene, dt, steps)) is None:
            return math.nan
        runs.append(timed)
    return _least(runs) / dt


def _least(runs: Sequence[TimedSteps]) -> float:
    """The time of a step [s] by the least times of simulations of as many steps: other load on the machine can only add to each of them."""
    return time_per_step(min(run.call for run in runs), min(run.stepping for run in runs), runs[0].steps)


def _timed(entry: EngineEntry, scene: Scenario, dt: float, steps: int) -> TimedSteps | None:
    """The wall times of some time steps; None if the state after them is not finite."""
    try:
        timed = time_steps(entry.adapter, scene, dt, steps)
    except Diverged:
        return None
    return timed if np.isfinite(timed.state).all() else None


def costs_per_world(entry: EngineEntry, scene: Scenario, dts: Sequence[float], worlds: int) -> list[float]:
    """Wall time per simulated second and world [s/s] of a batch at each time step; NaN if the engine cannot simulate batches.

    In free flight a step takes the same time at any dt, and that of a call is left out, as by `cost`; with a floor whole runs are timed,
    unless they are too long.
    """
    members = [scene] * worlds
    if scene.floor is not None:
        return [_cost_on_a_floor(entry.adapter, members, dt) / (dt * worlds) for dt in dts]
    dt = dts[-1]
    _timed_batch(entry.adapter, members, dt, 1)  # compiles
    steps, one = 4, _timed_batch(entry.adapter, members, dt, 1)
    while (taken := _timed_batch(entry.adapter, members, dt, steps)) < max(BATCH_SECONDS, MUCH_LONGER * one) and steps < MOST_STEPS:
        steps *= 4
    return [time_per_step(one, taken, steps) / (each * worlds) for each in dts]


def _cost_on_a_floor(engine: Engine, members: Sequence[Scenario], dt: float) -> float:
    """The wall time of a step of a batch [s] over a whole run; NaN if the run is too long, judged by its first steps."""
    steps, few = members[0].steps(dt), 16
    _timed_batch(engine, members, dt, 1)  # compiles
    if not _timed_batch(engine, members, dt, few) * steps <= LONGEST_BATCH * few:
        return math.nan
    return _timed_batch(engine, members, dt, steps) / steps


def _timed_batch(engine: Engine, members: Sequence[Scenario], dt: float, steps: int) -> float:
    """Wall time of some time steps of a batch [s]; NaN without a batch or if its states are not finite."""
    batch = engine.prepare_batch(members, dt)
    if batch is None:
        return math.nan
    with batch:
        start = time.perf_counter()
        batch.advance(steps)
        states = numpy_array(batch.states())
        taken = time.perf_counter() - start
    return taken if np.isfinite(states).all() else math.nan


def memory_per_world(entry: EngineEntry, scene: Scenario, dt: float, worlds: int) -> float:
    """The largest memory that a batch takes while it steps, per world [bytes]; NaN if the system is not Linux, or without batches.

    The batch is simulated twice. Before the second time, memory that the process has free is given back to the system.
    """
    members = [scene] * worlds
    if not (PROCESS / "clear_refs").exists() or math.isnan(_timed_batch(entry.adapter, members, dt, MEMORY_STEPS)):
        return math.nan
    if hasattr(libc := ctypes.CDLL(None), "malloc_trim"):  # of glibc
        libc.malloc_trim(0)
    (PROCESS / "clear_refs").write_text("5")  # sets the peak to the present memory
    before = _process_memory("VmRSS")
    _timed_batch(entry.adapter, members, dt, MEMORY_STEPS)
    return (_process_memory("VmHWM") - before) / worlds


def _process_memory(key: str) -> int:
    """A number of this process's status: its present memory, `VmRSS`, or the peak of that, `VmHWM` [bytes]."""
    found = re.search(rf"^{key}:\s+(\d+) kB$", (PROCESS / "status").read_text(), re.MULTILINE)
    assert found is not None
    return 1024 * int(found[1])
