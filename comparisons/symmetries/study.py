"""The study of the command `dropspin symmetries`: whether engines keep the symmetries of a scene, and repeat their results."""

import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from itertools import chain, product

import numpy as np

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.measuring.differences import differences
from dropspin.comparisons.measuring.symmetries import AGAIN, BATCH, BITWISE, HALVES, NAMES, NEW_PROCESS, ONE_CORE, SYMMETRIES, Symmetry
from dropspin.comparisons.running.arguments import EngineEntry, SceneLike, as_scenes, ignore, verify_time_step
from dropspin.comparisons.running.driving import Breakdown, classify, finite, record_batch, try_record
from dropspin.comparisons.running.engine_entries import engine_entries
from dropspin.comparisons.running.parallel import results_in_parallel, started_crews
from dropspin.comparisons.running.perturbed_starts import SIGNS, perturbed
from dropspin.comparisons.running.process_limits import ONE_MINUTE, ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.symmetries.findings import Effects, Finding, Pairs, judged, not_run, rounding
from dropspin.reference_impl.threads import usable_cores
from dropspin.scenarios import DropspinError, Scenario
from dropspin.scenarios.state import POSITION, RATES, Array
from dropspin.scenarios.variations import AWAY, whole_steps, with_other_numbers

SCENES = ("spin-asymmetric", "drop-ball-backspin", "drop-box-anyhow", "drop-box-sticking", "roll-ball", "slide-box", "turn-box-rough")
"""A free rotation, a ball with backspin, boxes that strike a smooth and a rough floor, a rolling ball, a sliding and a turning box."""
ENGINES = ("wang", "mujoco", "pybullet")
DT = 1e-3  # s
FASTER = (1.001, 1.002)
"""Factors on the initial velocities of the other simulations of a batch, which also start as many thousandths of the body's size away.

If the engine mixes scenes, the other numbers differ by as much.
"""

NOT_REPEATED = "the engine does not repeat its own motion, so that a difference from another one says nothing of a symmetry"


def symmetries(
    scenes: SceneLike | Iterable[SceneLike] = (),
    engines: Engine | str | Iterable[Engine | str] = (),
    *,
    dt: float = DT,
    on_progress: Callable[[str, float], None] | None = None,
    resources: ResourceLimits = ONE_MINUTE,
    jobs: int | None = None,
) -> list[Finding]:
    """Run scenes and transformed scenes that should have the same motion, such as rotated ones, and compare the motions.

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
        One result for each scene, engine and symmetry of the scene.

    Raises:
        DropspinError: A scene or an engine does not exist, a time step does not fit a scene, or two scenes have the same name.
    """
    chosen = as_scenes(scenes, SCENES)
    entries = engine_entries(engines, ENGINES)
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
    compared = processes.call(entry, _compare, scene, dt)
    if isinstance(compared, Breakdown):
        return [not_run(replace(none, symmetry=name), compared) for name in NAMES]
    rows, findings = compared
    processes.renew(entry)
    again = processes.call(entry, _finding, scene, dt, rows, AGAIN)
    processes.renew(entry)
    batch = processes.call(entry, _batch, scene, dt)
    processes.renew(entry)
    on_one_core = batch if isinstance(batch, Breakdown) else processes.call(entry, _on_one_core, scene, dt, rows, batch)
    processes.renew(entry)  # the last one may use one processor only
    repeated = {NEW_PROCESS: again, ONE_CORE: on_one_core}
    return findings + [
        not_run(replace(none, symmetry=name), one) if isinstance(one, Breakdown) else replace(one, symmetry=name)
        for name, one in repeated.items()
    ]


def _compare(entry: EngineEntry, scene: Scenario, dt: float) -> tuple[Array, list[Finding]]:
    """The engine's motion, and all findings that one process can give."""
    rows = states_of(entry, scene, dt)
    names = [name for name in NAMES if name not in (NEW_PROCESS, ONE_CORE)]
    return rows, findings_of(entry, scene, dt, rows, [*names, *entry.adapter.represented_otherwise()])


def _on_one_core(entry: EngineEntry, scene: Scenario, dt: float, rows: Array, batch: Sequence[Array]) -> Finding:
    """The finding of a batch that is run again in a new process, of which all threads may use one processor only."""
    if not hasattr(os, "sched_setaffinity") or usable_cores() == 1:
        raise Breakdown("declined", "the process cannot be restricted to fewer processors")
    for thread in os.listdir("/proc/self/task"):
        os.sched_setaffinity(int(thread), {min(os.sched_getaffinity(0))})
    return _finding(entry, scene, dt, rows, BATCH, batch)


def findings_of(entry: EngineEntry, scene: Scenario, dt: float, rows: Array, names: Iterable[str]) -> list[Finding]:
    """The findings on some symmetries that the scene has; runs in the engine's process.

    If the engine does not repeat its motion, perturbed starts do not show what rounding explains: they differ as much as repeated runs.

    Args:
        entry: The engine.
        scene: The scene.
        dt: Time step [s].
        rows: The states of the engine's motion at each time step, shape (n, 13).
        names: Names of symmetries, and of ways to repeat the run.
    """
    applicable = [name for name in names if name not in SYMMETRIES or SYMMETRIES[name].applies(scene)]
    found = [_finding(entry, scene, dt, rows, name) for name in applicable]
    again = next((finding for finding in found if finding.symmetry == AGAIN), None)
    if again is not None and again.status == "nearly kept":
        most = rounding(np.array(len(rows) - 1.0), entry.adapter.precision)
        return [
            replace(one, status="nearly kept", step=again.step, time=again.time)
            if one.symmetry not in BITWISE and one.status == "kept" and one.difference > most
            else one
            for one in found
        ]
    if again is None or again.status != "lost":
        return found
    unknown = Finding(scene.name, entry.label, "", "not run", reason=NOT_REPEATED)
    return [finding if finding.symmetry in BITWISE else replace(unknown, symmetry=finding.symmetry) for finding in found]


def _finding(entry: EngineEntry, scene: Scenario, dt: float, rows: Array, name: str, batch: Sequence[Array] = ()) -> Finding:
    """The finding on one symmetry; `batch` has the motions of an earlier batch, with which a batch is compared."""
    none = Finding(scene.name, entry.label, name, "not run")
    try:
        pairs, effects = _pairs(entry, scene, dt, rows, name, batch)
        away = max(0.0, _distance(SYMMETRIES[name].transformed(scene)) - _distance(scene)) if name in SYMMETRIES else 0.0
        return judged(none, scene, dt, pairs, effects, entry.adapter.precision, away)
    except DropspinError as error:  # the transformed scene is no valid scene
        return not_run(none, Breakdown("declined", str(error)))
    except Exception as error:  # an engine is somebody else's code
        return not_run(none, classify(error))


def _distance(scene: Scenario) -> float:
    """Distance of the body from the origin at the start, over its size."""
    return float(np.linalg.norm(scene.start.position)) / scene.body.size


def _pairs(entry: EngineEntry, scene: Scenario, dt: float, rows: Array, name: str, batch: Sequence[Array]) -> tuple[Pairs, Effects | None]:
    """The motions that should be equal, and the function that measures effects of rounding; None if it has no effect."""
    effects = partial(effects_of_rounding, entry, scene, dt, rows)
    if name == AGAIN:  # twice, for an engine may alternate between two motions
        return [(rows, states_of(entry, scene, dt)) for _ in range(2)], None
    if name in SYMMETRIES:
        return _transformed(entry, scene, dt, rows, SYMMETRIES[name])
    if name == HALVES:
        return _halves(entry, scene, dt, rows)
    if name == BATCH:
        # A compiler vectorises a batch differently from a single simulation, and rounding depends on that.
        before = batch or [rows, *(states_of(entry, other, dt) for other in _others(entry, scene))]
        return list(zip(before, _batch(entry, scene, dt), strict=True)), effects if entry.adapter.compiles else None
    other = replace(entry, engine=entry.adapter.represented_otherwise()[name])
    return [(rows, states_of(other, scene, dt))], effects


def _batch(entry: EngineEntry, scene: Scenario, dt: float) -> list[Array]:
    """The motions of a scene and two others that are run together, states of shape (n, 13)."""
    return [finite(recording).states for recording in record_batch(entry.adapter, [scene, *_others(entry, scene)], dt)]


def _others(entry: EngineEntry, scene: Scenario) -> list[Scenario]:
    """The other members of a scene's batch."""
    return [batch_member(entry.adapter, scene, share) for share in FASTER]


def batch_member(engine: Engine, scene: Scenario, share: float) -> Scenario:
    """The scene from elsewhere and with speeds a factor larger; all its numbers differ by as much if the engine mixes scenes."""
    start = scene.initial_state
    start[POSITION] += (share - 1.0) * scene.body.size * AWAY
    start[RATES] *= share
    return (with_other_numbers(scene, share) if engine.mixes_scenes else scene).starting_at(start)


def _halves(entry: EngineEntry, scene: Scenario, dt: float, rows: Array) -> tuple[Pairs, Effects]:
    """A motion that is stopped half way and continued."""
    half = len(rows) // 2
    nominal = whole_steps(scene, dt, len(rows) - 1 - half).starting_at(rows[half])
    rest = states_of(entry, nominal, dt)

    def effects() -> list[Array]:
        return [np.concatenate([np.zeros(half), effect]) for effect in effects_of_rounding(entry, nominal, dt, rest)]

    return [(rows, np.concatenate([rows[:half], rest]))], effects


def _transformed(entry: EngineEntry, scene: Scenario, dt: float, rows: Array, symmetry: Symmetry) -> tuple[Pairs, Effects]:
    """The motion of a transformed scene, transformed back."""
    times, transformed = dt * np.arange(len(rows), dtype=float), symmetry.transformed(scene)
    states = states_of(entry, transformed, symmetry.time * dt)

    def effects() -> list[Array]:
        starts = [symmetry.back(times[:1], start.initial_state[np.newaxis])[0] for start in perturbed_starts(entry, transformed)]
        return effects_of_rounding(entry, scene, dt, rows, map(scene.starting_at, starts))

    return [(rows, symmetry.back(times, states))], effects


def effects_of_rounding(
    entry: EngineEntry, scene: Scenario, dt: float, rows: Array, starts: Iterable[Scenario] | None = None
) -> list[Array]:
    """The differences of an engine's motion of a scene, states of shape (n, 13), and those from perturbed starts, each of shape (n,)."""
    effects = []
    for start in perturbed_starts(entry, scene) if starts is None else starts:
        with suppress(Breakdown):
            effects.append(differences(scene, rows, states_of(entry, start, dt)))
    return effects


def perturbed_starts(entry: EngineEntry, scene: Scenario) -> list[Scenario]:
    """A scene with its initial state perturbed by a few eps, in some ways."""
    return [perturbed(scene, signs, entry.adapter.precision) for signs in SIGNS]


def states_of(entry: EngineEntry, scene: Scenario, dt: float) -> Array:
    """The states of an engine's motion at each time step, shape (n, 13).

    Raises:
        Breakdown: There is no motion, or it is not finite.
    """
    return finite(try_record(entry.adapter, scene, dt)).states
