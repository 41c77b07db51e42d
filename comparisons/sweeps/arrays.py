"""Jobs of the reference implementation side by side: arrays of parameters go to its kernels, without building a scene for each job.

Some jobs are left to `outcomes.run_scenes`: those that are not ordinary (a body below the floor, a time step that does not fit, a
friction that the impact law does not support) and those that the kernels refuse. The result of a job has the same bits as when it is run
by itself.
"""

import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from dropspin import reference_impl
from dropspin.comparisons.engines.wang import Wang, reference_bodies, reference_world
from dropspin.comparisons.measuring.batch_quantities import BATCH_BYTES, motions_side_by_side
from dropspin.comparisons.measuring.motion_quantities import Setup
from dropspin.comparisons.running.adapter_output import UNIT_TOLERANCE
from dropspin.comparisons.running.arguments import FEWEST_STEPS, MOST_STEPS
from dropspin.comparisons.sweeps.jobs import OPTION, Jobs, scene_of
from dropspin.comparisons.sweeps.outcomes import Outcomes, not_run, requested_metrics, standard_metrics
from dropspin.scenarios import Scenario, SceneError, Trajectory
from dropspin.scenarios.bodies import Body
from dropspin.scenarios.bodies.surface import clearances
from dropspin.scenarios.damping import MOTIONS
from dropspin.scenarios.ensemble import spread_starts
from dropspin.scenarios.field_names import Path, path_of, set_field, with_fields
from dropspin.scenarios.field_types import unit
from dropspin.scenarios.model import TOUCHING
from dropspin.scenarios.state import ORIENTATION, PARTS, POSITION, UP, Array

FRICTION = "floor.friction"
ARRAY_FIELDS = {("floor", "restitution"), ("floor", "friction"), ("floor", "rest_speed"), ("damping", "linear"), ("damping", "angular")}


def run_side_by_side(jobs: Jobs, metrics: tuple[str, ...]) -> Outcomes:
    """The outcomes of the jobs that can be run side by side; the verdicts of all others stay empty."""
    outcomes = not_run(len(jobs), metrics)
    for indices in _groups(jobs):
        group = jobs[indices]
        engine, scene = group.engine_at(0), _representative_scene(group)
        # The steps that a sequential contact leaves unsolved are reported for each job, and are counted only for a job by itself.
        if isinstance(engine, Wang) and engine.option("contact") == "mean" and scene is not None and engine.declines(scene) is None:
            steps = _steps(group, scene)
            ordinary = np.argsort(steps, kind="stable")[np.count_nonzero(steps == 0) :]
            batches = 1 + len(ordinary) * (1 + int(steps.max())) * 13 * 8 // BATCH_BYTES
            for chosen in filter(len, np.array_split(ordinary, batches)):
                outcomes[indices[chosen]] = _of_batch(group[chosen], steps[chosen], engine, scene, metrics)
    return outcomes


def _is_array_field(name: str, column: NDArray[Any]) -> bool:
    """Whether the kernels take a field as an array, with one value for each job."""
    path = path_of(name)
    in_vector = len(path) == 3 and (path[0] == "start" or path[:2] == ("gravity", "acceleration"))
    return column.dtype == float and (in_vector or path in ARRAY_FIELDS or path[0] in ("duration", "body"))


def _groups(jobs: Jobs) -> Iterable[NDArray[np.intp]]:
    """The indices of jobs that differ only in fields that the kernels take as arrays, and that all have friction or none, as laws need."""
    columns = [column for name, column in jobs.values.items() if name.startswith(OPTION) or not _is_array_field(name, column)]
    columns += [column > 0.0 for name, column in jobs.values.items() if name == FRICTION and column.dtype == float]
    keys = list(map(repr, zip(*columns, strict=True))) if columns else [""] * len(jobs)
    _, groups, sizes = np.unique(keys, return_inverse=True, return_counts=True)
    return np.split(np.argsort(groups, kind="stable"), np.cumsum(sizes)[:-1])


def _representative_scene(jobs: Jobs) -> Scenario | None:
    """A scene with the structure of all jobs of a group; the fields that differ are passed as arrays.

    None if no such scene is valid, or if it has walls or a floor that ends.
    """
    fields = jobs.fields.items()
    shared = [(name, column[0]) for name, column in fields if name == FRICTION or not _is_array_field(name, column)]
    for others in ((), fields):
        with suppress(SceneError):
            scene = with_fields(jobs.scene, [*shared, *((name, column[0]) for name, column in others)])
            return None if scene.has_edges_or_walls else scene
    return None


def _steps(jobs: Jobs, scene: Scenario) -> NDArray[np.int64]:
    """The number of steps of each job; 0 for one that has too few or too many."""
    with np.errstate(all="ignore"):  # of values that are not ordinary
        ratio = jobs.fields.get("duration", scene.duration) / jobs.dts + 1e-9
        is_ordinary = (ratio >= FEWEST_STEPS) & (ratio < MOST_STEPS + 1)
    return np.floor(np.where(is_ordinary, ratio, 0.0)).astype(np.int64)


def _of_batch(jobs: Jobs, steps: NDArray[np.int64], engine: Wang, scene: Scenario, metrics: tuple[str, ...]) -> Outcomes:
    """The outcomes of jobs in one call of the kernels; the verdict of one that is not ordinary stays empty: by itself it has a reason."""
    outcomes = not_run(len(jobs), metrics)
    body, world, setup, starts, is_ordinary = _parameters(jobs, scene)
    if not is_ordinary.all():
        if is_ordinary.any():
            outcomes[is_ordinary] = _of_batch(jobs[is_ordinary], steps[is_ordinary], engine, scene, metrics)
        return outcomes
    try:
        simulator = reference_impl.Simulator(body, world, jobs.dts, engine.methods())
        start = time.perf_counter()
        states = simulator.run(starts, int(steps[-1]), threads=1)
        outcomes.time_per_step = (time.perf_counter() - start) / (int(steps[-1]) * len(jobs))
    except ValueError:
        return outcomes  # a value that the kernels refuse
    motions, valid = motions_side_by_side(setup, states, jobs.dts, 0.5 * jobs.dts, steps, UNIT_TOLERANCE)
    outcomes.verdict[valid], outcomes.steps[valid] = "measured", steps[valid]
    outcomes.state[valid] = states[np.arange(len(jobs)), steps][valid]
    outcomes.standard_metrics[valid] = standard_metrics(motions)[valid]
    for number in np.flatnonzero(valid).tolist() if metrics else ():
        rows, dt = int(steps[number]) + 1, float(jobs.dts[number])
        motion = Trajectory.from_states(dt * np.arange(rows, dtype=float), states[number, :rows], 0.5 * dt)
        outcomes.metrics[number] = requested_metrics(scene_of(jobs, number), motion, metrics)
    return outcomes


def _parameters(jobs: Jobs, scene: Scenario) -> tuple[reference_impl.Body, reference_impl.World, Setup, Array, NDArray[np.bool_]]:
    """Bodies, worlds and starts of jobs for the kernels, what moves for the metrics, and which jobs are ordinary.

    A leading axis of 1 stands for values that all jobs share.
    """
    columns = {path_of(name): column for name, column in jobs.fields.items() if _is_array_field(name, column)}

    def column(*path: str | int, otherwise: Any) -> Array:
        return columns.get(path, np.full(len(jobs), otherwise))

    def vectors(*path: str, otherwise: Array) -> Array:
        return np.stack([column(*path, axis, otherwise=value) for axis, value in enumerate(otherwise)], axis=1)

    bodies, is_ordinary = _bodies(scene, {path: values for path, values in columns.items() if path[0] == "body"})
    semi_axes, vertices = (np.array([getattr(body, name) for body in bodies]) for name in ("semi_axes", "vertices"))
    starts = np.hstack([vectors("start", kind, otherwise=scene.initial_state[part]) for kind, part in PARTS.items()])
    if any(path[:2] == ("start", "orientation") for path in columns):
        starts[:, ORIENTATION] = [unit(tuple(q)) if any(q) else q for q in starts[:, ORIENTATION].tolist()]
    if jobs.seeds is not None:
        assert scene.ensemble is not None
        starts = spread_starts(starts, scene.ensemble, jobs.seeds, vertices, semi_axes, scene.floor is not None)
    world = reference_world(scene, jobs.dts)
    if world.gravity is not None:
        world = replace(world, gravity=vectors("gravity", "acceleration", otherwise=world.gravity))
    if world.floor is not None:
        floor = (column("floor", name, otherwise=getattr(world.floor, name)) for name in ("restitution", "friction", "rest_speed"))
        world = replace(world, floor=reference_impl.Floor(*floor))
    if world.damping is not None:
        linear, angular = (column("damping", name, otherwise=rate) for name, rate in zip(MOTIONS, world.damping, strict=True))
        world = replace(world, damping=(linear, angular))
    setup = replace(
        Setup.of(scene),
        mass=np.array([body.mass for body in bodies]),
        inertia=np.array([body.inertia_tensor for body in bodies]),
        vertices=vertices,
        semi_axes=semi_axes,
        size=np.array([body.size for body in bodies]),
        origin=starts[:, POSITION] if scene.floor is None else np.outer([body.resting_height for body in bodies], UP),
        clearance=clearances(starts, vertices, semi_axes),
        gravity=np.zeros((1, 3)) if world.gravity is None else world.gravity,
        damping=None if world.damping is None else np.asarray(world.damping[0]),
    )
    if scene.floor is not None:  # a start nearer to the limit is left to the scene's own check
        is_ordinary = is_ordinary & (setup.clearance >= -0.5 * TOUCHING * setup.size)
    return reference_bodies(bodies), world, setup, starts, np.broadcast_to(is_ordinary, len(jobs))


def _bodies(scene: Scenario, columns: dict[Path, Array]) -> tuple[list[Body], NDArray[np.bool_]]:
    """One body for all jobs, or one for each, and which of them are valid; the scene's own body replaces one that is not."""
    if not columns:
        return [scene.body], np.ones(1, dtype=bool)
    bodies: list[Body] = []
    for values in zip(*columns.values(), strict=True):
        content = {"body": scene.body.model_dump(exclude_none=True)}
        for path, value in zip(columns, values, strict=True):
            set_field(content, path, float(value))
        try:
            bodies.append(type(scene.body).model_validate(content["body"]))
        except ValidationError:
            bodies.append(scene.body)
    tensors = np.array([body.inertia_tensor for body in bodies])
    finite = np.isfinite(tensors).all(axis=(1, 2))
    is_definite = np.linalg.eigvalsh(np.where(finite[:, np.newaxis, np.newaxis], tensors, 0.0))[:, 0] > 0.0
    return bodies, is_definite & np.array([body is not scene.body for body in bodies])
