"""The cost of the time steps of an engine, measured in its process: wall time per simulated second, for one world and for a batch.

And the memory that a batch takes.
"""

import ctypes
import math
import os
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from dropspin.comparisons.engines.base import Diverged
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import Breakdown, classify
from dropspin.comparisons.running.timing import TIMING_REPEATS, TimedSteps, time_per_step, time_steps, timings, timings_in_flight
from dropspin.scenarios import Scenario
from dropspin.scenarios.state import Array

FIRST_STEPS, FIRST_STEPS_OF_A_BATCH = 16, 4
LONG_ENOUGH = 2e-3
"""The smallest wall time of a timing [s]; a cost is measured in several rounds."""
MOST_RUNS = 200
WORLDS = (256,)
"""Numbers of worlds in a batch."""
BATCH_SECONDS = 0.02
"""The smallest wall time of a timing of a batch in free flight [s]."""
LONGEST_RUN, LONGEST_BATCH = 0.05, 4.0
"""The largest wall time of a run in damped flight that is timed whole, and of one of a batch in damped flight or on a floor [s]."""
MEMORY_STEPS = 10
ALIKE, ROUNDING = 1e-3, 64
"""Largest difference of a batch from a single simulation: a share of how far that has moved, and so many eps of the largest number."""
PROCESS = Path("/proc/self")
LOAD = Path("/proc/loadavg")


def load() -> float:
    """The number of threads of the machine that run or wait for a processor beside this one, per processor; NaN if not known."""
    with suppress(OSError):  # of a system other than Linux
        return (float(LOAD.read_text().split()[3].partition("/")[0]) - 1.0) / (os.cpu_count() or 1)
    return math.nan


def cost(entry: EngineEntry, scene: Scenario, dt: float) -> float:
    """Wall time per simulated second of the engine's time steps [s/s]; NaN if the state after them is not finite.

    In flight without damping every step takes the same time: so many are timed that the call is short beside them, beyond the end of the
    scene if the engine does not break down there. Else the time depends on the motion, so whole runs are timed; but of long damped flights
    only the first steps.
    """
    timed = partial(_finite, entry.adapter, scene, dt)
    with suppress(Diverged):
        if _is_timed_in_flight(scene, timed, scene.steps(dt), LONGEST_RUN):
            return time_per_step(timings_in_flight(timed, FIRST_STEPS, TIMING_REPEATS, LONG_ENOUGH)) / dt
    with suppress(Diverged):
        return time_per_step(timings(lambda: timed(scene.steps(dt)), MOST_RUNS, LONG_ENOUGH)) / dt
    return math.nan


def costs_per_world(
    entry: EngineEntry, scene: Scenario, steps: Sequence[tuple[float, float]], worlds: int
) -> tuple[list[float], Breakdown | None]:
    """Wall time per simulated second and world [s/s] of a batch at each time step, as by `cost`, and why the first without one has none.

    NaN if its states are not finite, or if after the first steps they differ from those of a single simulation by more than its error; and
    at all time steps, if at one of them they are not those of a single simulation, but of another method. Whole runs that are too long,
    judged by their first steps, are not timed; this counts as no failure.

    Args:
        entry: The engine.
        scene: The scene.
        steps: Each time step [s], and the error of a single simulation at it.
        worlds: Number of worlds in the batch.
    """
    times: list[float] = []
    failure: Breakdown | None = None
    for dt, error in steps:
        timed, count = partial(_finite, entry.adapter, [scene] * worlds, dt), scene.steps(dt)
        times.append(math.nan)
        try:
            batch, alone = timed(1).state, time_steps(entry.adapter, scene, dt, 1).state  # and compile
            apart = _apart(entry, scene, batch, alone)
            if not apart <= ALIKE:  # as of another method
                return [math.nan] * len(steps), Breakdown("failed", "the states of a batch are not those of a single simulation")
            if apart > error:  # as of an iterative solver that ends elsewhere, which is less accurate than the single simulation
                continue
            if _is_timed_in_flight(scene, timed, count, LONGEST_BATCH):
                with suppress(Diverged):
                    times[-1] = time_per_step(timings_in_flight(timed, FIRST_STEPS_OF_A_BATCH, 1, BATCH_SECONDS))
            if math.isnan(times[-1]) and _is_short(timed, count, LONGEST_BATCH):
                times[-1] = time_per_step([timed(count)])
        except Exception as raised:  # whatever an engine raises costs its own batch only
            failure = failure or classify(raised)
    return [per_step / (dt * worlds) for (dt, _), per_step in zip(steps, times, strict=True)], failure


def _is_timed_in_flight(scene: Scenario, timed: Callable[[int], TimedSteps], steps: int, longest: float) -> bool:
    """Whether as many steps are timed as it takes, in place of a whole run."""
    return scene.floor is None and (scene.damping is None or not _is_short(timed, steps, longest))


def _is_short(timed: Callable[[int], TimedSteps], steps: int, longest: float) -> bool:
    """Whether a run takes at most so long [s], judged by its first steps."""
    return timed(FIRST_STEPS).stepping * steps <= longest * FIRST_STEPS


def _apart(entry: EngineEntry, scene: Scenario, batch: Array, alone: Array) -> float:
    """How far the states of a batch, (size, 13), are from that of a single simulation, (13,), relative to how far that has moved."""
    rounding = ROUNDING * np.finfo(entry.adapter.precision).eps * np.abs(alone).max()
    beyond = float(np.abs(batch - alone).max() - rounding)
    moved = float(np.abs(alone - scene.initial_state).max())
    return 0.0 if beyond <= 0.0 else beyond / moved if moved > 0.0 else math.inf


def _finite(*args: Any) -> TimedSteps:
    """A timing of steps after which the states are finite.

    Raises:
        Diverged: They are not.
    """
    timed = time_steps(*args)
    if not np.isfinite(timed.state).all():
        raise Diverged("the state is not finite")
    return timed


def memory_per_world(entry: EngineEntry, scene: Scenario, dt: float, worlds: int) -> float:
    """The largest memory that a batch takes while it steps, per world [bytes]; NaN if the system is not Linux.

    The batch is simulated twice. Before the second time, memory that the process has free is given back to the system.

    Raises:
        Breakdown: The engine cannot simulate batches.
    """
    members = [scene] * worlds
    if not (PROCESS / "clear_refs").exists():
        return math.nan
    time_steps(entry.adapter, members, dt, MEMORY_STEPS)
    if hasattr(libc := ctypes.CDLL(None), "malloc_trim"):  # of glibc
        libc.malloc_trim(0)
    (PROCESS / "clear_refs").write_text("5")  # sets the peak to the present memory
    before = _process_memory("VmRSS")
    time_steps(entry.adapter, members, dt, MEMORY_STEPS)
    return (_process_memory("VmHWM") - before) / worlds


def _process_memory(key: str) -> int:
    """A number of this process's status: its present memory, `VmRSS`, or the peak of that, `VmHWM` [bytes]."""
    [size] = re.findall(rf"^{key}:\s+(\d+) kB$", (PROCESS / "status").read_text(), re.MULTILINE)
    return 1024 * int(size)
