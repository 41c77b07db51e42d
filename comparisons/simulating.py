"""One scene through one engine, and what came of it."""

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from comparisons.building import assert_built_as_meant, sound_limits, sound_record
from comparisons.comparison import Comparison
from comparisons.engines.base import Diverged, Engine, EngineMissing, Limit
from comparisons.engines.registry import engine as engine_named
from comparisons.ensembles import Outcome, outcome_of
from comparisons.predictions import predicted_errors
from comparisons.tolerances import nudged
from scenarios import DropspinError, Scenario, Trajectory

TIMED_REPEATS = 3
LEAST_STEPS = 4
MOST_STEPS = 2_000_000  # of one run; 32 start phases of that many are what a machine's memory holds


def simulate(scene: Scenario, engine: str | Engine, dt: float, every: int = 1) -> Trajectory:
    """Run one scene through one engine.

    Args:
        scene: The scene.
        engine: An engine, or its name with options, such as `mujoco[integrator=rk4]`.
        dt: Time step [s].
        every: Steps between two rows.

    Returns:
        The motion, the start as its first row.

    Raises:
        DropspinError: There is no such engine, it is not installed, or it declines the scene.
        Diverged: The engine gave up.
    """
    chosen = engine_named(engine) if isinstance(engine, str) else engine
    assert_step_fits(scene, dt)
    refusal = chosen.declines(scene)
    if refusal is not None:
        raise DropspinError(f"{chosen.label} declines {scene.name}: {refusal}.")
    motion, limits = _motion(scene, chosen, dt, every)
    for limit in limits:
        warnings.warn(limit.said, stacklevel=2)
    return motion


def _motion(scene: Scenario, engine: Engine, dt: float, every: int = 1) -> tuple[Trajectory, tuple[Limit, ...]]:
    """What an engine does with a scene, checked, and which of its limits it met."""
    with engine.prepare(scene, dt) as simulation:
        assert_built_as_meant(engine, scene, simulation)
        states = sound_record(simulation.record(scene.steps(dt), every), 1 + scene.steps(dt) // every)
        lag = 0.5 * dt if simulation.staggered else 0.0
        limits = sound_limits(simulation.limits)
    return Trajectory.from_states(dt * every * np.arange(len(states), dtype=float), states, lag), limits


def assert_step_fits(scene: Scenario, dt: float) -> None:
    """Raise `DropspinError` unless a scene is a sensible number of steps of dt [s]."""
    if not (np.isfinite(dt) and dt > 0.0 and LEAST_STEPS <= scene.duration / dt + 1e-9 <= MOST_STEPS):
        raise DropspinError(
            f"dt: got {dt!r} s; scene {scene.name!r} lasts {scene.duration:g} s, so a step must be "
            f"at least {scene.duration / MOST_STEPS:g} s and at most {scene.duration / LEAST_STEPS:g} s."
        )


@dataclass(frozen=True)
class Contestant:
    """An engine that takes part, or was to: `missing` says why it cannot."""

    label: str
    engine: Engine | None
    missing: str = ""


@dataclass
class Attempt:
    """What came of one engine on one scene at one step; of what it claims, its discretisation, order, precision and errors by metric.

    `nudged` are its motions from starts that a few ulp tell from those of `phases`, set by set, where there is one only or the body touches
    the floor: what rounding may come to.
    `cases` are its motions from each start beside the truth, which whoever judges them puts there.
    """

    label: str
    verdict: str = ""
    reason: str = ""
    motion: Trajectory | None = None
    phases: list[Trajectory] = field(default_factory=list)
    nudged: list[list[Trajectory]] = field(default_factory=list)
    cases: list[Comparison] = field(default_factory=list)
    limits: Sequence[Limit] = ()
    settings: dict[str, Any] = field(default_factory=dict)
    time_per_step: float = float("nan")
    outcome: Outcome | None = None
    discretisation: str | None = None
    order: float | None = None
    precision: type = np.float64
    predicted: dict[str, float] = field(default_factory=dict)


def contestant_named(chosen: str | Engine) -> Contestant:
    """The engine of a name, or one at hand.

    Raises:
        DropspinError: There is no engine of that name.
    """
    if isinstance(chosen, Engine):
        return Contestant(chosen.label, chosen)
    try:
        created = engine_named(chosen)
    except EngineMissing as error:
        return Contestant(chosen.strip(), None, str(error))
    return Contestant(created.label, created)


def attempt_by(contestant: Contestant, scene: Scenario, dt: float, starts: Sequence[Scenario]) -> Attempt:
    """Run a scene as written, then from each of its start phases if there are several; whatever goes wrong is told in the attempt."""
    engine = contestant.engine
    attempt = Attempt(contestant.label)
    if engine is None:
        attempt.verdict, attempt.reason = "missing", contestant.missing
        return attempt
    try:
        refusal = engine.declines(scene)
        if refusal is not None:
            attempt.verdict, attempt.reason = "declined", refusal
            return attempt
        attempt.discretisation, attempt.order, attempt.precision = engine.discretisation(scene), engine.order_in(scene), engine.precision
        attempt.motion, attempt.limits = _motion(scene, engine, dt)
        attempt.phases = [attempt.motion] if len(starts) == 1 else [_motion(start, engine, dt)[0] for start in starts]
        attempt.nudged = [[_motion(start, engine, dt)[0] for start in moved] for moved in nudged(scene, starts, engine.precision)]
        attempt.outcome = None if scene.ensemble is None else outcome_of(engine, scene, dt)
        # What is predicted of a bounce is a mean over start phases.
        attempt.predicted = predicted_errors(engine, scene, dt) if scene.floor is None or len(starts) > 1 else {}
        attempt.settings, attempt.time_per_step = _settings_and_time(engine, scene, dt)
    except Diverged as error:
        attempt.verdict, attempt.reason = "diverged", str(error)
    except Exception as error:  # an engine is somebody else's code: whatever it raises costs its own row and is told there
        attempt.verdict, attempt.reason = "crashed", f"{type(error).__name__}: {error}"
    return attempt


def _settings_and_time(engine: Engine, scene: Scenario, dt: float) -> tuple[dict[str, Any], float]:
    """The engine's stamp, and the least of three timings of its native stepping alone [s per step]."""
    steps = scene.steps(dt)
    timings = []
    for _ in range(TIMED_REPEATS):
        with engine.prepare(scene, dt) as simulation:
            settings = dict(simulation.settings)
            start = time.perf_counter()
            simulation.advance(steps)
            timings.append(time.perf_counter() - start)
    return settings, min(timings) / steps
