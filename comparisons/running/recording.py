"""The only code that drives an adapter: prepare a scene, verify what was built, record the motion, synchronise it, classify what failed."""

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.engines.base import Diverged, Engine, KnownLimitation
from dropspin.comparisons.engines.exceptions import described, short
from dropspin.comparisons.engines.registry import engine as engine_named
from dropspin.comparisons.judging.verdicts import Verdict
from dropspin.comparisons.running.inputs import SceneLike, as_scene, verify_time_step
from dropspin.comparisons.running.progress import OnSimulations
from dropspin.comparisons.running.verification import (
    BuildMismatch,
    verified_batch,
    verified_lag,
    verified_limitations,
    verified_record,
    verified_refusal,
    verified_settings,
    verify_build,
    verify_starts,
)
from dropspin.scenarios import DropspinError, Scenario, Trajectory
from dropspin.scenarios.state import PARTS

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Breakdown:
    """Why an engine has no motion for a scene."""

    verdict: Verdict
    reason: str


@dataclass(frozen=True, eq=False)
class Recording:
    """What one simulation gave.

    Attributes:
        motion: The states, the start first, `every` so many steps.
        continuation: The states after each of the extra steps that were asked for, at later times; usually empty.
        limitations: The engine's known limitations that it met on the way.
        settings: The settings that the engine reported; a batch is not asked for them.
        seconds: Wall time of recording the motion [s]; in a batch, the mean over its motions.
    """

    motion: Trajectory
    continuation: Trajectory
    limitations: tuple[KnownLimitation, ...]
    settings: dict[str, Any] = field(default_factory=dict)
    seconds: float = float("nan")


def simulate(scene: SceneLike, engine: Engine | str, dt: float, every: int = 1) -> Trajectory:
    """Simulate one scene with one engine.

    Args:
        scene: A scene, its catalogue name, the path of its file, or a mapping with the same keys.
        engine: An engine, or its name with options, such as `mujoco[integrator=rk4]`.
        dt: Time step [s].
        every: Steps between two rows.

    Returns:
        The motion, one row for each `every` steps; the first is the start.

    Raises:
        DropspinError: The engine is unknown, not installed, or declines the scene, or the time step does not fit it.
        Diverged: The simulation broke down.
    """
    scene = as_scene(scene)
    chosen = engine if isinstance(engine, Engine) else engine_named(engine)
    verify_time_step(scene, dt)
    refusal = verified_refusal(chosen.refusal(scene))
    if refusal is not None:
        raise DropspinError(f"{chosen.label} declines {scene.name}: {refusal}.")
    recording = record(chosen, scene, dt, every)
    for limitation in recording.limitations:
        if not limitation.is_minor:
            warnings.warn(limitation.message, stacklevel=2)
    return recording.motion


def record(engine: Engine, scene: Scenario, dt: float, every: int = 1, *, extra_steps: int = 0, verify: bool = True) -> Recording:
    """Drive an engine through a scene.

    Args:
        engine: The engine.
        scene: The scene; its duration gives the number of steps.
        dt: Time step [s].
        every: Steps between two rows.
        extra_steps: Steps to take after the scene's end, each recorded, if its last state is finite.
        verify: Whether to compare what was built with the scene; a conformance check that studies something else does not.

    Raises:
        BuildMismatch: The engine built another scene, or its record is not one.
        Diverged: The simulation broke down.
    """
    steps = scene.steps(dt)
    with engine.prepare(scene, dt) as simulation:
        if verify:
            verify_build(engine, scene, simulation, dt)
        settings = verified_settings(simulation.settings)
        start = time.perf_counter()
        states = verified_record(simulation.record(steps, every), 1 + steps // every)
        seconds = time.perf_counter() - start
        lag = simulation.velocity_lag
        limitations = verified_limitations(simulation.known_limitations)
        more = states[:0]
        if extra_steps and np.isfinite(states[-1]).all():
            more = verified_record(simulation.record(extra_steps), 1 + extra_steps)[1:]
    times = dt * every * np.arange(len(states), dtype=float)
    later = times[-1] + dt * np.arange(1, len(more) + 1, dtype=float)
    motion, continuation = Trajectory.from_states(times, states, lag), Trajectory.from_states(later, more, lag)
    return Recording(motion, continuation, limitations, settings, seconds)


def record_batch(
    engine: Engine,
    members: Sequence[Scenario],
    dt: float,
    on_simulations: OnSimulations = lambda done, total: None,
    *,
    limitations: bool = False,
) -> list[Recording]:
    """Drive an engine through scenes of the same number of steps: together if it can, else one after another.

    Args:
        engine: The engine.
        members: The scenes; they differ in their starts alone, unless the engine `mixes_scenes`.
        dt: Time step [s].
        on_simulations: Called after each simulation, or once after a batch.
        limitations: Whether to ask a batch for the known limitations that it met, which takes time.

    Raises:
        BuildMismatch: A motion does not begin at its start, or a record is not one.
        Diverged: The simulation broke down.
    """
    batch = engine.prepare_batch(members, dt)
    if batch is None:
        recordings = []
        for number, member in enumerate(members, 1):
            recordings.append(record(engine, member, dt))
            on_simulations(number, len(members))
        return recordings
    steps, size = members[0].steps(dt), len(members)
    with batch:
        start = time.perf_counter()
        states = verified_batch(batch.record(steps), size, steps + 1)
        seconds = (time.perf_counter() - start) / size
        lag = verified_lag(batch.velocity_lag, dt)
        met = [verified_limitations(batch.limitations_of(*of_one)) for of_one in zip(members, states, strict=True)] if limitations else []
    times = dt * np.arange(steps + 1, dtype=float)
    verify_starts(engine, members, states[:, 0])
    on_simulations(size, size)
    positions, orientations, velocities, spins = (states[..., part] for part in PARTS.values())
    parts = zip(positions, orientations, velocities, spins, strict=True)
    motions = [Trajectory(times, *of_one, velocity_lag=lag) for of_one in parts]
    none = motions[0][:0]
    return [Recording(motion, none, of_one, seconds=seconds) for motion, of_one in zip(motions, met or [()] * size, strict=True)]


def try_record(
    engine: Engine, scene: Scenario, dt: float, every: int = 1, *, extra_steps: int = 0, verify: bool = True
) -> Recording | Breakdown:
    """Drive an engine through a scene; a refusal, a divergence or an exception is returned, not raised."""
    try:
        refusal = verified_refusal(engine.refusal(scene))
        if refusal is not None:
            return Breakdown("declined", refusal)
        return record(engine, scene, dt, every, extra_steps=extra_steps, verify=verify)
    except Exception as error:
        return classify(error)


def classify(error: Exception) -> Breakdown:
    """The verdict for what an adapter raised: an engine is somebody else's code, so any exception costs its own row only."""
    if isinstance(error, Diverged):
        return Breakdown("diverged", short(str(error)))
    if isinstance(error, BuildMismatch):
        return Breakdown("crashed", short(str(error)))
    return Breakdown("crashed", described(error))


def divergence(motion: Trajectory) -> Breakdown | None:
    """The verdict on a motion that is not finite throughout; None if it is."""
    bad = motion.first_bad_row
    return None if bad is None else Breakdown("diverged", f"the state is not finite at t = {motion.t[bad]:g} s")


class TimedSteps(NamedTuple):
    """Wall times of a simulation [s], and its last state.

    Attributes:
        building: Of building it.
        call: Of a first call that takes one step, until the state is there.
        stepping: Of a second call that takes `steps` steps, until the state is there.
        steps: The number of these steps.
        state: The last state, shape (13,).
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

    @property
    def per_step(self) -> float:
        """The time of a step [s], as `time_per_step`."""
        return time_per_step(self.call, self.stepping, self.steps)


def time_per_step(call: float, stepping: float, steps: int) -> float:
    """The time of a step [s] without that of the call, unless a call of many steps [s] took hardly longer than one of a single step [s]."""
    return (stepping - call) / (steps - 1) if stepping > 2.0 * call and steps > 1 else stepping / steps


def time_steps(engine: Engine, scene: Scenario, dt: float, steps: int) -> TimedSteps:
    """Time native steps: one, and then others in one call. The call itself may cost a compiled engine as much as hundreds of steps.

    An engine may return from `advance` before its steps are done, and wait for them when the state is read.

    Raises:
        Diverged: The simulation broke down.
    """
    times = [time.perf_counter()]
    with engine.prepare(scene, dt) as simulation:
        times.append(time.perf_counter())
        for number in (1, steps):
            simulation.advance(number)
            state = simulation.state()
            times.append(time.perf_counter())
    building, call, stepping = (later - earlier for earlier, later in pairwise(times))
    return TimedSteps(building, call, stepping, steps, state)
