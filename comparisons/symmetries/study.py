"""The study of the command `dropspin symmetries`: whether engines keep the symmetries of a scene, and repeat their results.

Rounding breaks every symmetry a little, and a sensitive motion amplifies that. So the initial state of the transformed scene is perturbed
by a few ulp, and the nominal scene is run from there: a difference is attributed to rounding as long as it is not larger than the largest
effect of the perturbations so far, times a factor that allows for a rounding error in each time step. Repeated runs must be equal bit for
bit.
"""

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from comparisons.engines.base import Engine
from comparisons.measuring.differences import differences
from comparisons.measuring.tolerances import FEW_DRAWS, MATTERS, PERTURBATION, ULPS_PER_STEP, perturbed
from comparisons.running.entries import engine_entry
from comparisons.running.inputs import EngineEntry, SceneLike, as_scene, ignore, several, verify_time_step
from comparisons.running.processes import EngineProcesses, Failed, ResourceLimits
from comparisons.running.recording import Breakdown, classify, record_batch, try_record
from comparisons.symmetries.catalogue import SYMMETRIES, Symmetry
from scenarios import DropspinError, Scenario
from scenarios.state import RATES
from scenarios.transformations import whole_steps

Array = NDArray[np.float64]
Effects = Callable[[], list[Array]]
"""A function that runs an engine from perturbed starts and returns the differences from its motion, each of shape (n,)."""
Status = Literal["kept", "rounding", "nearly kept", "lost", "not run"]
STATUSES: tuple[Status, ...] = get_args(Status)
"""From the best to the worst. Kept: rounding explains the difference, which is up to 1e-5 of the motion's sizes and speeds. Rounding:
rounding explains it, but it is larger. Nearly kept: rounding does not explain it, but it is up to 1e-5. Lost: it is larger. Not run: the
engine does not run the transformed scene, or breaks down in it.
"""

SCENES = ("spin-asymmetric", "drop-ball-backspin", "drop-box-anyhow", "drop-box-sticking", "roll-ball", "slide-box", "turn-box-rough")
"""A free rotation, a ball with backspin, boxes that strike a smooth and a rough floor, a rolling ball, a sliding and a turning box."""
ENGINES = ("document", "mujoco", "pybullet")
DT = 1e-3  # s
RESOURCES = ResourceLimits(processor_time=60.0)
AGAIN, BATCH, HALVES, NEW_PROCESS, ONE_CORE = "again", "in a batch", "in two halves", "in a new process", "on one core"
REPEATS = (AGAIN, BATCH, NEW_PROCESS, ONE_CORE, HALVES)
"""Runs of the same scene: after others in the same process, together with two others, in a new process, in a batch on one processor, and
stopped and continued.
"""
BITWISE = (AGAIN, BATCH, NEW_PROCESS, ONE_CORE)
"""Those that must give the same bits; a new simulation may continue from a state with other rounding errors."""
NAMES = (*SYMMETRIES, *REPEATS)
ULPS = 1000.0
"""Rounding errors of a single time step, in ulp of the scene's sizes and speeds, which some engines make in their transformations."""
BY_CHANCE = 3.0
"""Factor on the largest effect of a few perturbations, if it is so large that it is due to chance."""
FASTER = (1.001, 1.002)
"""Factors on the initial velocities of the other simulations of a batch."""


@dataclass(frozen=True)
class Finding:
    """Whether an engine keeps one symmetry, or repeats its result, in one scene.

    Attributes:
        scene: Name of the scene.
        engine: Label of the engine.
        symmetry: The symmetry, or the way in which the run was repeated.
        status: One of `STATUSES`.
        difference: The largest difference of the two motions, of angles [rad] and relative to sizes and speeds; NaN if there is none.
        step: The first time step at which rounding does not explain the difference; None if it does at all steps.
        time: The time of this step [s]; NaN if there is none.
        reason: Why there is no motion to compare; otherwise empty.
        motions: If the symmetry is lost, the engine's motion and the one that should equal it, states of shape (n, 13).
    """

    scene: str
    engine: str
    symmetry: str
    status: Status
    difference: float = float("nan")
    step: int | None = None
    time: float = float("nan")
    reason: str = ""
    motions: tuple[Array, Array] | None = field(default=None, repr=False, compare=False)


def symmetries(
    scenes: SceneLike | Iterable[SceneLike] = (),
    engines: Engine | str | Iterable[Engine | str] = (),
    *,
    dt: float = DT,
    on_progress: Callable[[str, float], None] | None = None,
    resources: ResourceLimits = RESOURCES,
) -> list[Finding]:
    """Run scenes and scenes that have the same motion, and compare the motions.

    Args:
        scenes: One scene or several: scenes, catalogue names, paths of files, or mappings; by default seven of different kinds.
        engines: One engine or several: engines, or names with options; by default `document`, `mujoco` and `pybullet`.
        dt: Time step [s].
        on_progress: Called with a description of the current work and the fraction of the whole study that is done, from 0 to 1.
        resources: The processor time [s] and memory [bytes] that an engine may use for one scene.

    Returns:
        One finding for each scene, engine and symmetry that the scene has.

    Raises:
        DropspinError: A scene or an engine does not exist, a time step does not fit a scene, or two scenes have the same name.
    """
    chosen = [as_scene(one) for one in several("scenes", scenes) or SCENES]
    if len({scene.name for scene in chosen}) < len(chosen):
        raise DropspinError("two scenes have the same name, which is that of the file; rename one of the files.")
    entries = list({one.label: one for one in map(engine_entry, several("engines", engines) or ENGINES)}.values())
    for scene in chosen:
        verify_time_step(scene, dt)
    found: list[Finding] = []
    callback = on_progress or ignore
    with EngineProcesses(resources) as processes:
        for number, (scene, entry) in enumerate((scene, entry) for scene in chosen for entry in entries):
            callback(f"{scene.name}, {entry.label}", number / (len(chosen) * len(entries)))
            found += _of_engine(processes, entry, scene, dt)
    return found


def _of_engine(processes: EngineProcesses, entry: EngineEntry, scene: Scenario, dt: float) -> list[Finding]:
    """All findings for one engine and one scene."""
    none = Finding(scene.name, entry.label, "", "not run")
    if entry.engine is None:
        return [replace(none, symmetry=name, reason=entry.reason) for name in NAMES]
    try:
        own, found = processes.call(entry, _compare, scene, dt)
        if isinstance(own, Breakdown):
            return [replace(none, symmetry=name, reason=own.reason) for name in NAMES]
        for name, again in IN_NEW_PROCESSES.items():
            processes.renew(entry)
            fresh, repeated = processes.call(entry, again, scene, dt), replace(none, symmetry=name)
            if isinstance(fresh, Breakdown):
                found.append(replace(repeated, reason=fresh.reason))
            else:
                found.append(_judged(repeated, scene, dt, own, fresh, None))
        processes.renew(entry)  # the last one may use one processor only
    except Failed as failure:
        return [replace(none, symmetry=name, reason=failure.reason) for name in NAMES]
    return found


def _compare(entry: EngineEntry, scene: Scenario, dt: float) -> tuple[Array | Breakdown, list[Finding]]:
    """All findings that one process can give."""
    names = [name for name in NAMES if name not in IN_NEW_PROCESSES]
    return findings_of(entry, scene, dt, [*names, *entry.adapter.represented_otherwise()])


def findings_of(entry: EngineEntry, scene: Scenario, dt: float, names: Iterable[str]) -> tuple[Array | Breakdown, list[Finding]]:
    """The engine's motion of a scene, and the findings on some symmetries that the scene has; runs in the engine's process."""
    own = _states(entry, scene, dt)
    if isinstance(own, Breakdown):
        return own, []
    having = [name for name in names if name not in SYMMETRIES or SYMMETRIES[name].applies(scene)]
    return own, [_finding(entry, scene, dt, own, Finding(scene.name, entry.label, name, "not run")) for name in having]


def _finding(entry: EngineEntry, scene: Scenario, dt: float, own: Array, none: Finding) -> Finding:
    """One finding; `none` is that of a symmetry that cannot be compared."""
    try:
        other, perturbations = _other(entry, scene, dt, own, none.symmetry)
    except DropspinError as error:
        return replace(none, reason=str(error))
    except Exception as error:  # an engine is somebody else's code
        return replace(none, reason=classify(error).reason)
    if isinstance(other, Breakdown):
        return replace(none, reason=other.reason)
    try:
        return _judged(none, scene, dt, own, other, perturbations, entry.adapter.precision)
    except Exception as error:  # the engine runs again from perturbed starts
        return replace(none, reason=classify(error).reason)


def _other(entry: EngineEntry, scene: Scenario, dt: float, own: Array, name: str) -> tuple[Array | Breakdown, Effects | None]:
    """The states that should equal the engine's own, and the function that measures effects of rounding; None if it has no effect."""
    if name == AGAIN:
        return _states(entry, scene, dt), None
    if name not in NAMES:
        other = replace(entry, engine=entry.adapter.represented_otherwise()[name])
        if (reason := other.adapter.declines(scene)) is not None:
            raise DropspinError(reason)
        return _states(other, scene, dt), lambda: _effects(entry, scene, dt, own, _perturbed(scene, entry))
    if name == BATCH:
        return _batched(entry, scene, dt), None
    return _halves(entry, scene, dt, own) if name == HALVES else _transformed(entry, scene, dt, own, SYMMETRIES[name])


def _batched(entry: EngineEntry, scene: Scenario, dt: float) -> Array | Breakdown:
    """The states of a scene that is run in a batch with two others; differences of the others from single runs are added to them."""
    start = scene.initial_state
    others = [scene.starting_at(np.concatenate([start[:7], start[RATES] * share])) for share in FASTER]
    states, *batched = [motion.states for motion in record_batch(entry.adapter, [scene, *others], dt)]
    for other, together in zip(others, batched, strict=True):
        alone = _states(entry, other, dt)
        if isinstance(alone, Breakdown):
            return alone
        states = states + np.abs(together - alone)  # without a difference, its bits stay
    return states


def _on_one_core(entry: EngineEntry, scene: Scenario, dt: float) -> Array | Breakdown:
    """The same in a process that may use one processor, so that engines that share work among threads have one."""
    if not hasattr(os, "sched_setaffinity"):
        return Breakdown("declined", "this system cannot restrict a process to one processor")
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    return _batched(entry, scene, dt)


def _halves(entry: EngineEntry, scene: Scenario, dt: float, own: Array) -> tuple[Array | Breakdown, Effects | None]:
    """The states of a scene that is stopped half way and continued."""
    half = len(own) // 2
    nominal = whole_steps(scene, dt, len(own) - 1 - half).starting_at(own[half])
    rest = _states(entry, nominal, dt)
    if isinstance(rest, Breakdown):
        return rest, None

    def of_rest() -> list[Array]:
        effects = _effects(entry, nominal, dt, rest, _perturbed(nominal, entry))
        return [np.concatenate([np.zeros(half), effect]) for effect in effects]

    return np.concatenate([own[:half], rest]), of_rest


def _transformed(
    entry: EngineEntry, scene: Scenario, dt: float, own: Array, symmetry: Symmetry
) -> tuple[Array | Breakdown, Effects | None]:
    """The states of a transformed scene, transformed back."""
    times, transformed = dt * np.arange(len(own), dtype=float), symmetry.transformed(scene)
    states = _states(entry, transformed, symmetry.time * dt)
    if isinstance(states, Breakdown):
        return states, None

    def of_transformed() -> list[Array]:
        starts = [symmetry.back(times[:1], start.initial_state[np.newaxis])[0] for start in _perturbed(transformed, entry)]
        return _effects(entry, scene, dt, own, map(scene.starting_at, starts))

    return symmetry.back(times, states), of_transformed


def _effects(entry: EngineEntry, scene: Scenario, dt: float, own: Array, starts: Iterable[Scenario]) -> list[Array]:
    """The differences of an engine's motion and those from perturbed starts, each of shape (n,)."""
    motions = (_states(entry, start, dt) for start in starts)
    return [differences(scene, own, motion) for motion in motions if not isinstance(motion, Breakdown)]


def _perturbed(scene: Scenario, entry: EngineEntry) -> list[Scenario]:
    """A scene with its initial state perturbed by a few ulp, in some ways."""
    return [one for [one] in perturbed(scene, [scene], entry.adapter.precision)]


def _states(entry: EngineEntry, scene: Scenario, dt: float) -> Array | Breakdown:
    """The states of an engine's motion at each time step, shape (n, 13), or why there are none."""
    recording = try_record(entry.adapter, scene, dt)
    return recording if isinstance(recording, Breakdown) else recording.motion.states


def _judged(
    none: Finding, scene: Scenario, dt: float, own: Array, other: Array, effects: Effects | None, precision: type = np.float64
) -> Finding:
    """A finding with its status; where rounding has no effect, the two motions must be equal bit for bit."""
    difference = differences(scene, own, other)
    largest, steps = float(difference.max()), np.arange(len(own), dtype=float)
    allowed, ulp = np.zeros_like(difference), float(np.finfo(precision).eps)
    if effects is not None:
        allowed = ulp * (ULPS + ULPS_PER_STEP * steps)
    if effects is not None and not (difference <= allowed).all():  # most engines need no perturbed runs
        grown = np.maximum.accumulate(np.max([np.zeros_like(difference), *effects()], axis=0))
        # A large effect is one of chance, such as a contact that is missed in a time step: it does not add up, and others are as large.
        small = np.minimum(grown * (FEW_DRAWS + steps / PERTURBATION), MATTERS * ulp / np.finfo(float).eps)
        allowed = BY_CHANCE * grown + small + allowed
    beyond = np.flatnonzero(~(difference <= allowed))
    if not len(beyond):
        return replace(none, status="kept" if largest <= MATTERS else "rounding", difference=largest)
    first = int(beyond[0])
    # What perturbations explain does not count, even if it is large.
    unexplained = float(difference[beyond].max())
    status: Status = "nearly kept" if unexplained <= MATTERS else "lost"
    motions = (own, other) if status == "lost" else None
    return replace(none, status=status, difference=unexplained, step=first, time=first * dt, motions=motions)


IN_NEW_PROCESSES = {NEW_PROCESS: _states, ONE_CORE: _on_one_core}
"""Runs of the same scene in processes that did nothing before."""
