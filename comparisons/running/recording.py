"""The only code that drives an adapter: prepare a scene, verify what was built, record the motion, synchronise it, classify what failed."""

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparisons.engines.base import Diverged, Engine, EngineMissing, KnownLimitation, Simulation
from comparisons.engines.registry import engine as engine_named
from comparisons.engines.registry import engine_names
from comparisons.judging.verdicts import Verdict
from comparisons.running.verification import BATCH_ULPS, verified_limitations, verified_record, verify_build, verify_start
from scenarios import DropspinError, Scenario, SceneError, Trajectory, load

Array = NDArray[np.float64]

FEWEST_STEPS = 4
MOST_STEPS = 2_000_000
"""Steps of one run; 32 start phases of that many fit into a machine's memory."""


@dataclass(frozen=True)
class EngineEntry:
    """An engine that takes part in a run; `missing` says why one that was asked for cannot."""

    label: str
    engine: Engine | None
    missing: str = ""


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
        settings: The settings that the engine reported.
        seconds: Wall time of recording the motion [s].
    """

    motion: Trajectory
    continuation: Trajectory
    limitations: tuple[KnownLimitation, ...]
    settings: dict[str, Any] = field(default_factory=dict)
    seconds: float = float("nan")


def simulate(scene: Scenario | str, engine: Engine | str, dt: float, every: int = 1) -> Trajectory:
    """Simulate one scene with one engine.

    Args:
        scene: A scene, its catalogue name, or the path of its file.
        engine: An engine, or its name with options, such as `mujoco[integrator=rk4]`.
        dt: Time step [s].
        every: Steps between two rows.

    Returns:
        The motion; its first row is the start.

    Raises:
        DropspinError: The engine is unknown, not installed, or declines the scene, or the time step does not fit it.
        Diverged: The engine gave up.
    """
    scene = as_scene(scene)
    entry = engine_entry(engine)
    if entry.engine is None:
        raise EngineMissing(entry.missing)
    verify_time_step(scene, dt)
    refusal = entry.engine.declines(scene)
    if refusal is not None:
        raise DropspinError(f"{entry.label} declines {scene.name}: {refusal}.")
    recording = record(entry.engine, scene, dt, every)
    for limitation in recording.limitations:
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
        Diverged: The engine gave up.
    """
    steps = scene.steps(dt)
    with engine.prepare(scene, dt) as simulation:
        if verify:
            verify_build(engine, scene, simulation)
        settings = dict(simulation.settings)
        start = time.perf_counter()
        states = verified_record(simulation.record(steps, every), 1 + steps // every)
        seconds = time.perf_counter() - start
        lag = velocity_lag(simulation, dt)
        limitations = verified_limitations(simulation.known_limitations)
        more = states[:0]
        if extra_steps and np.isfinite(states[-1]).all():
            more = verified_record(simulation.record(extra_steps), 1 + extra_steps)[1:]
    times = dt * every * np.arange(len(states), dtype=float)
    later = times[-1] + dt * np.arange(1, len(more) + 1, dtype=float)
    motion, continuation = Trajectory.from_states(times, states, lag), Trajectory.from_states(later, more, lag)
    return Recording(motion, continuation, limitations, settings, seconds)


def record_batch(engine: Engine, starts: Sequence[Scenario], dt: float) -> list[Trajectory]:
    """Drive an engine through one scene from many starts, by its own way to take them together if it has one.

    Raises:
        BuildMismatch: A motion does not begin at its start, or a record is not one.
        Diverged: The engine gave up, or a motion is not finite.
    """
    steps = starts[0].steps(dt)
    times = dt * np.arange(steps + 1, dtype=float)
    with engine.prepare(starts[0], dt) as simulation:
        lag = velocity_lag(simulation, dt)
    motions = []
    for start, states in zip(starts, engine.record_batch(starts, dt, steps), strict=True):
        verify_start(engine, start, states[0], BATCH_ULPS)
        motion = Trajectory.from_states(times, verified_record(states, steps + 1), lag)
        if motion.first_bad_row is not None:
            raise Diverged(f"a start of the ensemble is not finite at t = {motion.t[motion.first_bad_row]:g} s")
        motions.append(motion)
    return motions


def try_record(engine: Engine, scene: Scenario, dt: float, every: int = 1, *, extra_steps: int = 0) -> Recording | Breakdown:
    """Drive an engine through a scene; a refusal, a divergence or an exception is returned, not raised."""
    try:
        refusal = engine.declines(scene)
        if refusal is not None:
            return Breakdown("declined", refusal)
        return record(engine, scene, dt, every, extra_steps=extra_steps)
    except Exception as error:
        return classify(error)


def classify(error: Exception) -> Breakdown:
    """The verdict for what an adapter raised: an engine is somebody else's code, so any exception costs its own row only."""
    if isinstance(error, Diverged):
        return Breakdown("diverged", str(error))
    return Breakdown("crashed", f"{type(error).__name__}: {error}")


def divergence(motion: Trajectory) -> Breakdown | None:
    """The verdict on a motion that is not finite throughout; None if it is."""
    bad = motion.first_bad_row
    return None if bad is None else Breakdown("diverged", f"the state is not finite at t = {motion.t[bad]:g} s")


def time_steps(engine: Engine, scene: Scenario, dt: float, steps: int) -> tuple[float, Array]:
    """The wall time of native stepping alone [s], and the state it leads to, shape (13,).

    Raises:
        Diverged: The engine gave up.
    """
    with engine.prepare(scene, dt) as simulation:
        start = time.perf_counter()
        simulation.advance(steps)
        seconds = time.perf_counter() - start
        return seconds, simulation.state()


def velocity_lag(simulation: Simulation, dt: float) -> float:
    """How far a simulation's velocities lag its positions [s]."""
    return 0.5 * dt if simulation.staggered else 0.0


def engine_entry(engine: Engine | str) -> EngineEntry:
    """An engine by its name, or an engine object, as an entry of a run.

    Raises:
        DropspinError: There is no engine of that name, or it is neither an engine nor a name.
    """
    if isinstance(engine, Engine):
        return EngineEntry(engine.label, engine)
    if not isinstance(engine, str):
        raise DropspinError(f"engine: got {_described(engine)}; give a name such as 'mujoco', or an Engine.")
    try:
        created = engine_named(engine)
    except EngineMissing as error:
        return EngineEntry(engine.strip(), None, str(error))
    return EngineEntry(created.label, created)


def as_scene(scene: Any) -> Scenario:
    """A scene, or the scene of a catalogue name or of a file's path.

    Raises:
        DropspinError: It is neither, or there is no such scene.
    """
    if isinstance(scene, Scenario):
        return scene
    if not isinstance(scene, str):
        raise DropspinError(f"scene: got {_described(scene)}; give a name such as 'drop-ball', a file's path, or a Scenario from load().")
    try:
        return load(scene)
    except SceneError:
        if scene.partition("[")[0].strip() in engine_names():
            raise DropspinError(f"scene {scene!r} is an engine; give the scene first and the engine second.") from None
        raise


def verify_time_step(scene: Scenario, dt: float) -> None:
    """Raise `DropspinError` unless a scene is a sensible number of steps of dt [s]."""
    if isinstance(dt, bool) or not isinstance(dt, int | float | np.floating):
        raise DropspinError(f"dt: got {_described(dt)}; a time step is a number of seconds.")
    if not (np.isfinite(dt) and dt > 0.0 and FEWEST_STEPS <= scene.duration / dt + 1e-9 <= MOST_STEPS):
        raise DropspinError(
            f"dt: got {dt!r} s; scene {scene.name!r} lasts {scene.duration:g} s, so a step must be "
            f"at least {scene.duration / MOST_STEPS:g} s and at most {scene.duration / FEWEST_STEPS:g} s."
        )


def _described(value: object) -> str:
    """A value of a wrong type for a message: its type, and the value if it is short."""
    text = repr(value)
    return f"{text} ({type(value).__name__})" if len(text) <= 40 else f"a {type(value).__name__}"
