"""The study of the command `dropspin symmetries`: whether engines keep the symmetries of a scene, and repeat their results."""

import os
from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import chain, product

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.judging.verdicts import Verdict
from dropspin.comparisons.measuring.differences import differences
from dropspin.comparisons.measuring.symmetries import AGAIN, BATCH, HALVES, NAMES, NEW_PROCESS, ONE_CORE, SYMMETRIES, Symmetry
from dropspin.comparisons.measuring.tolerances import perturbed
from dropspin.comparisons.running.engine_process import Failed
from dropspin.comparisons.running.entries import engine_entry
from dropspin.comparisons.running.inputs import EngineEntry, SceneLike, as_scene, ignore, several, verify_time_step
from dropspin.comparisons.running.parallel import results_in_parallel, started_crews
from dropspin.comparisons.running.processes import EngineProcesses, ResourceLimits
from dropspin.comparisons.running.recording import Breakdown, classify, divergence, record_batch, try_record
from dropspin.comparisons.symmetries.findings import Effects, Finding, Pairs, judged, not_run
from dropspin.reference_impl.threads import usable_cores
from dropspin.scenarios import DropspinError, Scenario
from dropspin.scenarios.state import POSITION, RATES
from dropspin.scenarios.variations import AWAY, whole_steps, with_other_numbers

Array = NDArray[np.float64]

SCENES = ("spin-asymmetric", "drop-ball-backspin", "drop-box-anyhow", "drop-box-sticking", "roll-ball", "slide-box", "turn-box-rough")
"""A free rotation, a ball with backspin, boxes that strike a smooth and a rough floor, a rolling ball, a sliding and a turning box."""
ENGINES = ("wang", "mujoco", "pybullet")
DT = 1e-3  # s
RESOURCES = ResourceLimits(processor_time=60.0)
FASTER = (1.001, 1.002)
"""Factors on the initial velocities of the other simulations of a batch, which also start as many thousandths of the body's size away.

If the engine mixes scenes, the other numbers differ by as much.
"""


def symmetries(
    scenes: SceneLike | Iterable[SceneLike] = (),
    engines: Engine | str | Iterable[Engine | str] = (),
    *,
    dt: float = DT,
    on_progress: Callable[[str, float], None] | None = None,
    resources: ResourceLimits = RESOURCES,
    jobs: int | None = None,
) -> list[Finding]:
    """Run scenes and scenes that have the same motion, and compare the motions.

    Args:
        scenes: One scene or several: scenes, catalogue names, paths of files, or mappings; by default seven of different kinds.
        engines: One engine or several: engines, or names with options; by default `wang`, `mujoco` and `pybullet`.
        dt: Time step [s].
        on_progress: Called with a description of the current work and the fraction of the whole study that is done, from 0 to 1, in any
            thread, but in one at a time.
        resources: The processor time [s] and memory [bytes] that an engine may use for one scene.
        jobs: Number of pairs of a scene and an engine to run at a time; by default, the number of processors that this process may use. It
            changes no result.

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

    def of_pair(pair: tuple[Scenario, EngineEntry], processes: EngineProcesses, report: Callable[[str], None]) -> list[Finding]:
        scene, entry = pair
        report(f"{scene.name}, {entry.label}")
        return _of_engine(processes, entry, scene, dt)

    pairs = list(product(chosen, entries))
    with started_crews(jobs, len(pairs), entries, resources) as crews:
        return list(chain.from_iterable(results_in_parallel(pairs, of_pair, crews, on_progress or ignore)))


def _of_engine(processes: EngineProcesses, entry: EngineEntry, scene: Scenario, dt: float) -> list[Finding]:
    """All findings for one engine and one scene; a crash costs those that one process would have given."""
    none = Finding(scene.name, entry.label, "", "not run")
    if entry.engine is None:
        absence: Verdict = entry.absence or "missing"
        return [replace(none, symmetry=name, reason=entry.reason, verdict=absence) for name in NAMES]
    try:
        own, found = processes.call(entry, _compare, scene, dt)
    except Failed as failure:
        own, found = Breakdown(failure.verdict, failure.reason), []
    if isinstance(own, Breakdown):
        return [not_run(replace(none, symmetry=name), own) for name in NAMES]
    for name, again in IN_NEW_PROCESSES.items():
        repeated = replace(none, symmetry=name)
        try:
            processes.renew(entry)
            found.append(processes.call(entry, again, scene, dt, own, repeated))
        except Failed as failure:
            found.append(not_run(repeated, Breakdown(failure.verdict, failure.reason)))
    processes.renew(entry)  # the last one may use one processor only
    return found


def _compare(entry: EngineEntry, scene: Scenario, dt: float) -> tuple[Array | Breakdown, list[Finding]]:
    """All findings that one process can give."""
    names = [name for name in NAMES if name not in IN_NEW_PROCESSES]
    return findings_of(entry, scene, dt, [*names, *entry.adapter.represented_otherwise()])


def findings_of(entry: EngineEntry, scene: Scenario, dt: float, names: Iterable[str]) -> tuple[Array | Breakdown, list[Finding]]:
    """The engine's motion of a scene, and the findings on some symmetries that the scene has; runs in the engine's process."""
    own = states_of(entry, scene, dt)
    if isinstance(own, Breakdown):
        return own, []
    having = [name for name in names if name not in SYMMETRIES or SYMMETRIES[name].applies(scene)]
    return own, [_finding(entry, scene, dt, own, Finding(scene.name, entry.label, name, "not run")) for name in having]


def _finding(entry: EngineEntry, scene: Scenario, dt: float, own: Array, none: Finding) -> Finding:
    """One finding; `none` is that of a symmetry that cannot be compared."""
    try:
        pairs, effects = _pairs(entry, scene, dt, own, none.symmetry)
        return judged(none, scene, dt, pairs, effects, entry.adapter.precision)
    except _NotComparable as error:
        return not_run(none, error.breakdown)
    except DropspinError as error:  # the transformed scene is no valid scene
        return not_run(none, Breakdown("declined", str(error)))
    except Exception as error:  # an engine is somebody else's code
        return not_run(none, classify(error))


class _NotComparable(Exception):
    """A run gave no motion."""

    def __init__(self, breakdown: Breakdown) -> None:
        super().__init__(breakdown.reason)
        self.breakdown = breakdown


def _pairs(entry: EngineEntry, scene: Scenario, dt: float, own: Array, name: str) -> tuple[Pairs, Effects | None]:
    """The motions that should be equal, and the function that measures effects of rounding; None if it has no effect."""
    if name == AGAIN:
        return [(own, _motion(entry, scene, dt))], None
    if name in SYMMETRIES:
        return _transformed(entry, scene, dt, own, SYMMETRIES[name])
    if name == HALVES:
        return _halves(entry, scene, dt, own)
    if name == BATCH:
        # A compiler vectorises a batch otherwise than a single simulation, and rounding depends on that.
        effects = (lambda: effects_of_rounding(entry, scene, dt, own)) if entry.adapter.compiles else None
        return _batched(entry, scene, dt, own), effects
    other = replace(entry, engine=entry.adapter.represented_otherwise()[name])
    return [(own, _motion(other, scene, dt))], lambda: effects_of_rounding(entry, scene, dt, own)


def _batched(entry: EngineEntry, scene: Scenario, dt: float, own: Array) -> Pairs:
    """Of a scene and two others: the motions of single runs, and those of a batch."""
    others = [batch_member(entry.adapter, scene, share) for share in FASTER]
    together = [recording.motion for recording in record_batch(entry.adapter, [scene, *others], dt)]
    for motion in together:
        if (broken := divergence(motion)) is not None:
            raise _NotComparable(broken)
    alone = [own, *(_motion(entry, other, dt) for other in others)]
    return list(zip(alone, (motion.states for motion in together), strict=True))


def batch_member(engine: Engine, scene: Scenario, share: float) -> Scenario:
    """The scene from elsewhere and with speeds a factor larger; all its numbers differ by as much if the engine mixes scenes."""
    start = scene.initial_state
    start[POSITION] += (share - 1.0) * scene.body.size * AWAY
    start[RATES] *= share
    return (with_other_numbers(scene, share) if engine.mixes_scenes else scene).starting_at(start)


def _halves(entry: EngineEntry, scene: Scenario, dt: float, own: Array) -> tuple[Pairs, Effects]:
    """A motion that is stopped half way and continued."""
    half = len(own) // 2
    nominal = whole_steps(scene, dt, len(own) - 1 - half).starting_at(own[half])
    rest = _motion(entry, nominal, dt)

    def of_rest() -> list[Array]:
        effects = effects_of_rounding(entry, nominal, dt, rest)
        return [np.concatenate([np.zeros(half), effect]) for effect in effects]

    return [(own, np.concatenate([own[:half], rest]))], of_rest


def _transformed(entry: EngineEntry, scene: Scenario, dt: float, own: Array, symmetry: Symmetry) -> tuple[Pairs, Effects]:
    """The motion of a transformed scene, transformed back."""
    times, transformed = dt * np.arange(len(own), dtype=float), symmetry.transformed(scene)
    states = _motion(entry, transformed, symmetry.time * dt)

    def of_transformed() -> list[Array]:
        starts = [symmetry.back(times[:1], start.initial_state[np.newaxis])[0] for start in _perturbed(transformed, entry)]
        return effects_of_rounding(entry, scene, dt, own, map(scene.starting_at, starts))

    return [(own, symmetry.back(times, states))], of_transformed


def _in_new_process(entry: EngineEntry, scene: Scenario, dt: float, own: Array, none: Finding) -> Finding:
    """The finding of a run in a process that did nothing before."""
    return replace(_finding(entry, scene, dt, own, replace(none, symmetry=AGAIN)), symmetry=none.symmetry)


def _on_one_core(entry: EngineEntry, scene: Scenario, dt: float, own: Array, none: Finding) -> Finding:
    """The finding of a batch in a process all of whose threads may use one processor."""
    if not hasattr(os, "sched_setaffinity") or usable_cores() == 1:
        return not_run(none, Breakdown("declined", "the process cannot be restricted to fewer processors"))
    for thread in os.listdir("/proc/self/task"):
        os.sched_setaffinity(int(thread), {min(os.sched_getaffinity(0))})
    return replace(_finding(entry, scene, dt, own, replace(none, symmetry=BATCH)), symmetry=none.symmetry)


def effects_of_rounding(
    entry: EngineEntry, scene: Scenario, dt: float, own: Array, starts: Iterable[Scenario] | None = None
) -> list[Array]:
    """The differences of an engine's motion and those from perturbed starts, by default the scene's own, each of shape (n,)."""
    motions = (states_of(entry, start, dt) for start in (_perturbed(scene, entry) if starts is None else starts))
    return [differences(scene, own, motion) for motion in motions if not isinstance(motion, Breakdown)]


def _perturbed(scene: Scenario, entry: EngineEntry) -> list[Scenario]:
    """A scene with its initial state perturbed by a few eps, in some ways."""
    return [one for [one] in perturbed(scene, [scene], entry.adapter.precision)]


def _motion(entry: EngineEntry, scene: Scenario, dt: float) -> Array:
    """The states of an engine's motion at each time step, shape (n, 13).

    Raises:
        _NotComparable: There is no motion.
    """
    states = states_of(entry, scene, dt)
    if isinstance(states, Breakdown):
        raise _NotComparable(states)
    return states


def states_of(entry: EngineEntry, scene: Scenario, dt: float) -> Array | Breakdown:
    """The states of an engine's motion at each time step, shape (n, 13), or why there are none."""
    recording = try_record(entry.adapter, scene, dt)
    if isinstance(recording, Breakdown):
        return recording
    return divergence(recording.motion) or recording.motion.states


IN_NEW_PROCESSES = {NEW_PROCESS: _in_new_process, ONE_CORE: _on_one_core}
"""Runs of the same scene in processes that did nothing before."""
