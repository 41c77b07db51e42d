"""The only code that drives an adapter: prepare a scene, verify what was built, record the motion, synchronise it, classify what failed."""

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from dropspin.comparisons.engines.base import Diverged, Engine, KnownLimitation
from dropspin.comparisons.engines.exceptions import TimedOut, described, short
from dropspin.comparisons.engines.registry import engine as engine_named
from dropspin.comparisons.judging.verdicts import Verdict
from dropspin.comparisons.running.adapter_output import (
    BuildMismatch,
    verified_batch,
    verified_lag,
    verified_limitations,
    verified_record,
    verified_refusal,
    verified_settings,
    verified_simulation,
    verify_build,
    verify_starts,
)
from dropspin.comparisons.running.arguments import SceneLike, as_scene, ignore, verify_time_step
from dropspin.comparisons.running.progress import OnSimulations
from dropspin.scenarios import DropspinError, Scenario, Trajectory


@dataclass(eq=False)
class Breakdown(Exception):
    """Why an engine gave no motion, or did not finish other work: raised, and kept where the result would be."""

    verdict: Verdict
    reason: str

    def __str__(self) -> str:
        return self.reason


class AnotherAdapter(Breakdown):
    """The adapter that an engine's process has is not the one that was described when the command began."""


@dataclass(frozen=True, eq=False)
class Recording:
    """What one simulation gave.

    Attributes:
        motion: The states, the start first, `every` so many steps.
        limitations: The engine's known limitations that it met on the way.
        settings: The settings that the engine reported; a batch is not asked for them.
        seconds: Wall time of recording the motion [s]; in a batch, the mean over its motions.
    """

    motion: Trajectory
    limitations: tuple[KnownLimitation, ...]
    settings: dict[str, Any] = field(default_factory=dict)
    seconds: float = float("nan")


def simulate(scene: SceneLike, engine: Engine | str, dt: float, every: int = 1) -> Trajectory:
    """Simulate one scene with one engine.

    Args:
        scene: A scene, its catalogue name, the path of its file, or a mapping with the same keys.
        engine: An engine, or its name with options, such as `mujoco[integrator=rk4]`.
        dt: Time step [s].
        every: Number of time steps between two rows.

    Returns:
        The motion: a row for the initial state and one after each `every` time steps.

    Raises:
        DropspinError: The engine is unknown, not installed, or declines the scene, or the time step does not fit the scene.
        Diverged: The simulation diverged.
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
        every: Number of time steps between two rows.
        extra_steps: Steps to take after the scene's end, each recorded, if its last state is finite.
        verify: Whether to compare what was built with the scene; a conformance check that studies something else does not.

    Raises:
        BuildMismatch: The engine built another scene, or its record is not one.
        Diverged: The simulation diverged.
    """
    steps = scene.steps(dt)
    with verified_simulation(engine.prepare(scene, dt)) as simulation:
        if verify:
            verify_build(engine, scene, simulation, dt)
        settings = verified_settings(simulation.settings)
        start = time.perf_counter()
        states = verified_record(simulation.record(steps, every), 1 + steps // every)
        seconds = time.perf_counter() - start
        lag = simulation.velocity_lag
        limitations = verified_limitations(simulation.known_limitations)
        if extra_steps and np.isfinite(states[-1]).all():
            states = np.concatenate([states, verified_record(simulation.record(extra_steps, 1), 1 + extra_steps)[1:]])
    times = dt * every * np.arange(1 + steps // every, dtype=float)
    later = times[-1] + dt * np.arange(1, 1 + len(states) - len(times), dtype=float)
    return Recording(Trajectory.from_states(np.concatenate([times, later]), states, lag), limitations, settings, seconds)


def record_batch(
    engine: Engine, members: Sequence[Scenario], dt: float, on_simulations: OnSimulations = ignore, *, limitations: bool = False
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
        Diverged: The simulation diverged.
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
        states = verified_batch(batch.record(steps, 1), size, steps + 1)
        seconds = (time.perf_counter() - start) / size
        lag = verified_lag(batch.velocity_lag, dt)
        met = [verified_limitations(batch.limitations_of(*of_one)) for of_one in zip(members, states, strict=True)] if limitations else []
    times = dt * np.arange(steps + 1, dtype=float)
    verify_starts(engine, members, states[:, 0])
    on_simulations(size, size)
    motions = [Trajectory.from_states(times, of_one, lag) for of_one in states]
    return [Recording(motion, of_one, seconds=seconds) for motion, of_one in zip(motions, met or [()] * size, strict=True)]


def try_record(engine: Engine, scene: Scenario, dt: float, *, verify: bool = True) -> Recording | Breakdown:
    """Drive an engine through a scene; a refusal, a divergence or an exception is returned, not raised."""
    try:
        verify_accepted(engine, scene)
        return record(engine, scene, dt, verify=verify)
    except Exception as error:
        return classify(error)


def verify_accepted(engine: Engine, scene: Scenario) -> None:
    """Raise `Breakdown` if an engine declines a scene."""
    refusal = verified_refusal(engine.refusal(scene))
    if refusal is not None:
        raise Breakdown("declined", refusal)


def classify(error: BaseException) -> Breakdown:
    """The verdict for what an adapter raised: an engine is somebody else's code, so any exception costs its own row only."""
    if isinstance(error, Breakdown):
        return error.with_traceback(None)
    verdicts: dict[type[BaseException], Verdict] = {Diverged: "diverged", TimedOut: "timed_out", BuildMismatch: "crashed"}
    for kind, verdict in verdicts.items():
        if isinstance(error, kind):
            return Breakdown(verdict, short(str(error)))
    return Breakdown("crashed", described(error))


def finite(recording: Recording | Breakdown) -> Trajectory:
    """The motion that was recorded.

    Raises:
        Breakdown: There is none, or it is not finite throughout.
    """
    broken = recording if isinstance(recording, Breakdown) else divergence(recording.motion)
    if broken is not None:
        raise broken
    assert isinstance(recording, Recording)
    return recording.motion


def divergence(motion: Trajectory) -> Breakdown | None:
    """The verdict on a motion that is not finite throughout; None if it is."""
    bad = motion.first_bad_row
    return None if bad is None else Breakdown("diverged", f"the state is not finite at t = {motion.t[bad]:g} s")
