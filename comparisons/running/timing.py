"""The clock: the wall time of the native steps of an engine, of one world or of a batch, apart from building, the call, and compilation.

An engine may return from `advance` before its steps are done, and wait for them when the state is read: a time ends with the state.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np

from dropspin.comparisons.engines.base import Engine, numpy_array
from dropspin.comparisons.running.arguments import MOST_STEPS, EngineEntry
from dropspin.comparisons.running.driving import Breakdown, classify, verify_accepted
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.progress import OnProgress, Progress
from dropspin.scenarios import Scenario
from dropspin.scenarios.state import Array

TIMING_REPEATS = 3
"""The least of so many timings counts: other load on the machine can only add to a time."""
LONG_ENOUGH = 0.01
"""A simulation that takes this long is timed once [s]: it has hundreds of steps, and engines are compared over many scenes."""
MUCH_LONGER = 10.0
"""Steps in free flight take at least so many times as long as a call of one step: a call may cost as much as hundreds of steps."""


class TimedSteps(NamedTuple):
    """Wall times of a simulation [s], and its last state.

    Attributes:
        building: Of building it and of its first step, in which an engine may do work that is done once.
        call: Of a second call that takes one step, until the state is there.
        stepping: Of a third call that takes `steps` steps, until the state is there.
        steps: The number of these steps.
        state: The last state, shape (13,); of a batch the last states, shape (size, 13).
    """

    building: float
    call: float
    stepping: float
    steps: int
    state: Array

    @property
    def whole(self) -> float:
        """The time of it all [s]."""
        return self.building + self.call + self.stepping


def time_steps(engine: Engine, given: Scenario | Sequence[Scenario], dt: float, steps: int) -> TimedSteps:
    """Time native steps of a scene, or of a batch of scenes: one, another one, and then others in one call.

    The call itself may cost a compiled engine as much as hundreds of steps.

    Raises:
        Breakdown: The engine cannot simulate batches.
        Diverged: The simulation broke down.
    """
    times = [time.perf_counter()]
    simulation: Any = engine.prepare(given, dt) if isinstance(given, Scenario) else engine.prepare_batch(given, dt)
    if simulation is None:
        raise Breakdown("declined", "the engine cannot simulate batches")
    with simulation:
        for number in (1, 1, steps):
            simulation.advance(number)
            last = simulation.state() if isinstance(given, Scenario) else numpy_array(simulation.states())
            times.append(time.perf_counter())
        last = np.array(last)  # it may be the engine's own memory, which ends with the simulation
    building, call, stepping = (later - earlier for earlier, later in pairwise(times))
    return TimedSteps(building, call, stepping, steps, last)


def timings(once: Callable[[], TimedSteps], most: int, enough: float) -> list[TimedSteps]:
    """Timings of the same steps: at most so many, and no more when they have taken long enough together [s]."""
    found: list[TimedSteps] = []
    while len(found) < most and sum(timed.stepping for timed in found) < enough:
        found.append(once())
    return found


def timings_in_flight(timed: Callable[[int], TimedSteps], steps: int, repeats: int, enough: float) -> list[TimedSteps]:
    """Timings of so many steps of equal cost that the call is short beside them.

    Args:
        timed: Times a number of steps.
        steps: The number to begin with.
        repeats: The number of timings.
        enough: The smallest wall time of the steps [s].
    """
    while True:
        first = timed(steps)
        least = max(enough, MUCH_LONGER * first.call)
        if first.stepping >= least or steps >= MOST_STEPS:
            return [first, *(timed(steps) for _ in range(repeats - 1))]
        steps = min(MOST_STEPS, math.ceil(steps * min(16.0, max(2.0, 1.2 * least / first.stepping))))


def time_per_step(runs: Sequence[TimedSteps]) -> float:
    """The time of a step [s] by the least times of simulations of as many steps.

    The time of the call is left out, unless a call of many steps took hardly longer than one of a single step.
    """
    call, stepping, steps = min(run.call for run in runs), min(run.stepping for run in runs), runs[0].steps
    return (stepping - call) / (steps - 1) if stepping > 2.0 * call and steps > 1 else stepping / steps


class Timing(NamedTuple):
    """The time that an engine's steps take.

    Attributes:
        per_step: The least wall time of a native step [s].
        compilation: What the first simulation took longer than later ones [s]; 0 for an engine that does not compile.
        breakdown: Why there is no time; None if there is one.
        ended: Whether the engine cannot take part, or its process ended.
        in_batches: Whether the engine can step many starts together.
    """

    per_step: float = float("nan")
    compilation: float = 0.0
    breakdown: Breakdown | None = None
    ended: bool = False
    in_batches: bool = False


Timings = Mapping[tuple[str, str, float], Timing]
"""By scene, engine and time step."""


def time_engine(entry: EngineEntry, scene: Scenario, dt: float) -> Timing:
    """Time whole simulations of a scene, native steps only, with compilation timed separately; a failure is part of the result."""
    engine, steps = entry.adapter, scene.steps(dt)
    try:
        verify_accepted(engine, scene)
        first = time_steps(engine, scene, dt, steps) if engine.compiles else None
        runs = timings(lambda: time_steps(engine, scene, dt, steps), TIMING_REPEATS, LONG_ENOUGH)
    except Exception as error:  # whatever an engine raises costs its own row only
        return Timing(breakdown=classify(error))
    compilation = 0.0 if first is None else max(first.whole - min(run.whole for run in runs), 0.0)
    return Timing(time_per_step(runs), compilation, in_batches=engine.steps_batches)


def time_engines(
    scenes: Sequence[Scenario], entries: Sequence[EngineEntry], dts: Sequence[float], processes: EngineProcesses, on_progress: OnProgress
) -> Timings:
    """The time that the steps of each engine take, measured while nothing else runs."""
    found = {}
    for scene, entry, dt in product(scenes, entries, dts):
        on_progress(Progress(scene.name, entry.label, dt, timing=True))
        timing = processes.call(entry, time_engine, scene, dt)
        found[scene.name, entry.label, dt] = Timing(breakdown=timing, ended=True) if isinstance(timing, Breakdown) else timing
    return found
