"""Jobs of the reference implementation side by side: arrays of parameters straight into its kernels, no scene built for any.

A job that is out of the ordinary (a body below the floor, a step that does not fit, a friction that the law does not know) is left over,
to be looked at singly; so is whatever the kernels refuse. What is run here has the bits it has alone.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

import reference_impl
from comparisons.engines.document import Document, reference_body, reference_world
from comparisons.running.recording import FEWEST_STEPS, MOST_STEPS
from comparisons.sweeps.fields import Path, path_of, put, with_fields
from comparisons.sweeps.jobs import OPTION, Jobs
from comparisons.sweeps.outcomes import Outcomes, origins, truth_metrics
from comparisons.sweeps.singly import scene_of
from reference_impl.summary import Moved
from scenarios import Scenario, SceneError, Trajectory
from scenarios.body import Body
from scenarios.ensemble import clearances, spread_starts
from scenarios.model import TOUCHING, unit

Array = NDArray[np.float64]
Places = NDArray[np.intp]

AT_ONCE = 8 * 2**20  # bytes of motions held at a time: more would not be any faster
PARTS = {"position": 0, "orientation": 3, "velocity": 7, "angular_velocity": 10}
NUMBERS = {("floor", "restitution"), ("floor", "friction"), ("floor", "rest_speed"), ("damping", "linear"), ("damping", "angular")}


def run_side_by_side(jobs: Jobs, found: Outcomes, metrics: tuple[str, ...]) -> None:
    """Run what can be run side by side; the verdicts of all other jobs stay empty."""
    for places in _alike(jobs):
        some = jobs[places]
        engine = some.engine_at(0)
        scene = _representative(some)
        # How many steps a sequential contact leaves unsolved is told of each job, and is counted for one alone.
        if isinstance(engine, Document) and engine.option("contact") == "mean" and scene is not None:
            _run(some, places, engine, scene, found, metrics)


def _goes_into_arrays(name: str, column: NDArray[Any]) -> bool:
    path = path_of(name)
    in_vector = len(path) == 3 and (path[0] == "start" or path[:2] == ("gravity", "acceleration"))
    return column.dtype == float and (in_vector or path in NUMBERS or path[0] in ("duration", "body"))


def _alike(jobs: Jobs) -> Iterator[Places]:
    """The places of jobs that differ in nothing but what goes into arrays."""
    telling = [column for name, column in jobs.values.items() if name.startswith(OPTION) or not _goes_into_arrays(name, column)]
    if not telling:
        yield np.arange(len(jobs))
        return
    groups: dict[str, list[int]] = {}
    for place, values in enumerate(zip(*telling, strict=True)):
        groups.setdefault(repr(values), []).append(place)
    yield from map(np.array, groups.values())


def _representative(jobs: Jobs) -> Scenario | None:
    """A scene of the jobs' structure; of which job does not matter, for what differs goes into arrays."""
    alike = [(name, column[0]) for name, column in jobs.fields.items() if not _goes_into_arrays(name, column)]
    for others in ((), jobs.fields.items()):
        try:
            return with_fields(jobs.scene, [*alike, *((name, column[0]) for name, column in others)])
        except SceneError:
            continue
    return None


@dataclass(frozen=True)
class _Lot:
    """Jobs of one structure as arrays, one row for each, or one for all.

    Attributes:
        body: As the kernels take it.
        world: As the kernels take it.
        starts: Shape (B, 13).
        dts: Shape (B,).
        steps: Shape (B,).
        measured: The body as it is measured: the arguments of `Moved` that are its own.
    """

    body: reference_impl.Body
    world: reference_impl.World
    starts: Array
    dts: Array
    steps: NDArray[np.int64]
    measured: dict[str, Array]

    def __getitem__(self, places: Places) -> "_Lot":
        return _Lot(*(_picked(getattr(self, field.name), places) for field in fields(self)))


def _picked(given: Any, places: Places) -> Any:
    """Some rows of everything that has one for each job."""
    if isinstance(given, np.ndarray):
        return given if len(given) == 1 else given[places]
    if isinstance(given, reference_impl.Body | reference_impl.World):
        return type(given)(*(_picked(getattr(given, field.name), places) for field in fields(given)))
    if isinstance(given, reference_impl.Floor):
        return reference_impl.Floor(*(_picked(part, places) for part in given))
    if isinstance(given, dict):
        return {name: _picked(part, places) for name, part in given.items()}
    return None if given is None else tuple(_picked(part, places) for part in given)


def _run(jobs: Jobs, places: Places, engine: Document, scene: Scenario, found: Outcomes, metrics: tuple[str, ...]) -> None:
    """Run jobs of one structure, by number of steps, as many at a time as memory is set aside for."""
    lot, ordinary = _lot(jobs, scene)
    ordinary &= _accepted(jobs, engine, scene)
    order = np.flatnonzero(ordinary)[np.argsort(lot.steps[ordinary], kind="stable")]
    for some in _batches(order, lot.steps):
        batch = lot[some]
        steps = int(batch.steps.max())
        try:
            simulator = reference_impl.Simulator(batch.body, batch.world, batch.dts, engine.methods())
            start = time.perf_counter()
            motions = simulator.run(batch.starts, steps, threads=1)
            found.time_per_step[places[some]] = (time.perf_counter() - start) / (steps * len(some))
        except ValueError:
            continue  # a number beyond what the kernels take; looked at singly it costs its own row
        repeated = {
            name: np.repeat(part, len(some), axis=0) if len(part) == 1 and name != "points" else part
            for name, part in batch.measured.items()
        }
        moved = Moved(**repeated, dt=batch.dts, lag=0.5 * batch.dts, rows=batch.steps + 1)
        found.take(places[some], motions, moved, scene.floor is not None, scene.damping is not None)
        found.verdict[places[some][found.verdict[places[some]] == "diverged"]] = ""  # how it diverged is told of a job alone
        if metrics:
            for place, motion, rows in zip(some, motions, moved.rows, strict=True):
                if found.verdict[places[place]] == "measured":
                    dt = float(jobs.dts[place])
                    found.metrics[places[place]] = truth_metrics(
                        scene_of(jobs, place),
                        Trajectory.from_states(dt * np.arange(rows, dtype=float), motion[:rows], 0.5 * dt),
                        metrics,
                    )


def _batches(order: Places, steps: NDArray[np.int64]) -> Iterator[Places]:
    """Places in order of their number of steps, cut so that each lot's motions fit into the memory."""
    first = 0
    while first < len(order):
        size = 1
        while first + size < len(order) and (size + 1) * (1 + steps[order[first + size]]) * 13 * 8 <= AT_ONCE:
            size += 1
        yield order[first : first + size]
        first += size


def _accepted(jobs: Jobs, engine: Document, scene: Scenario) -> NDArray[np.bool_]:
    """Which jobs have a friction that the engine's law knows; whether it does depends on whether there is any, not on how much."""
    friction = jobs.fields.get("floor.friction")
    if friction is None or friction.dtype == object:
        return np.full(len(jobs), engine.declines(scene) is None)
    accepted = np.zeros(len(jobs), dtype=bool)
    for alike in (friction > 0.0, friction == 0.0):
        if alike.any():
            accepted[alike] = engine.declines(with_fields(scene, [("floor.friction", float(friction[alike][0]))])) is None
    return accepted


def _lot(jobs: Jobs, scene: Scenario) -> tuple[_Lot, NDArray[np.bool_]]:
    """The arrays of jobs, and which of them are ordinary."""
    numbers = {path_of(name): column for name, column in jobs.fields.items() if _goes_into_arrays(name, column)}

    def of(path: Path, otherwise: float | Array) -> Array:
        return numbers.get(path, np.full(len(jobs), otherwise))

    bodies, built = _bodies(scene, {path: column for path, column in numbers.items() if path[0] == "body"})
    has_floor = scene.floor is not None
    radius, points = (np.array([getattr(body, name) for body in bodies]) for name in ("rounding", "vertices"))
    starts = _starts(jobs, scene, numbers, points, radius)
    clearance = clearances(starts, points, radius)
    size = np.array([body.size for body in bodies])
    with np.errstate(all="ignore"):  # what does not fit is left over
        ratio = of(("duration",), scene.duration) / jobs.dts
        fits = built & (ratio + 1e-9 >= FEWEST_STEPS) & (ratio + 1e-9 <= MOST_STEPS)
    if has_floor:
        fits &= clearance >= -0.5 * TOUCHING * size  # what is nearer to the bound is left to the scene itself
    gravity = None
    if scene.gravity is not None:
        gravity = np.stack([of(("gravity", "acceleration", axis), value) for axis, value in enumerate(scene.acceleration)], axis=1)
    world = reference_world(scene)
    if world.floor is not None:
        world = replace(
            world, floor=reference_impl.Floor(*(of(("floor", name), getattr(world.floor, name)) for name in world.floor._fields))
        )
    if world.damping is not None:
        linear, angular = world.damping
        world = replace(world, damping=(of(("damping", "linear"), linear), of(("damping", "angular"), angular)))
    reference = [reference_body(body) for body in bodies]
    body = reference_impl.Body(*(np.array([getattr(one, field.name) for one in reference]) for field in fields(reference_impl.Body)))
    measured = {
        "mass": np.array([body.mass for body in bodies]),
        "inertia": np.array([body.inertia_tensor for body in bodies]),
        "points": points,
        "radius": radius,
        "size": size,
        "origin": origins(starts, np.broadcast_to([body.resting_height for body in bodies], len(jobs)), has_floor),
        "clearance": clearance,
        "gravity": np.zeros((1, 3)) if gravity is None else gravity,
        "damping": np.zeros(1) if world.damping is None else np.asarray(world.damping[0]),
    }
    steps = np.where(fits, np.floor(np.where(fits, ratio, 0.0) + 1e-9), 0).astype(np.int64)
    return _Lot(body, replace(world, gravity=gravity), starts, jobs.dts, steps, measured), fits


def _bodies(scene: Scenario, numbers: dict[Path, Array]) -> tuple[list[Body], NDArray[np.bool_]]:
    """One body for all jobs, or one for each, and which are bodies at all; in the place of one that is none stands the scene's own."""
    if not numbers:
        return [scene.body], np.ones(1, dtype=bool)
    found: list[Body] = []
    for values in zip(*numbers.values(), strict=True):
        content = {"body": scene.body.model_dump(exclude_none=True)}
        for path, value in zip(numbers, values, strict=True):
            put(content, path, float(value))
        try:
            found.append(type(scene.body).model_validate(content["body"]))
        except ValidationError:
            found.append(scene.body)
    tensors = np.array([body.inertia_tensor for body in found])
    finite = np.isfinite(tensors).all(axis=(1, 2))
    spans = np.linalg.eigvalsh(np.where(finite[:, np.newaxis, np.newaxis], tensors, 0.0))[:, 0] > 0.0
    return found, spans & np.array([body is not scene.body for body in found])


def _starts(jobs: Jobs, scene: Scenario, numbers: dict[Path, Array], points: Array, radius: Array) -> Array:
    """The states that the jobs start from, shape (B, 13)."""
    starts = np.tile(scene.initial_state, (len(jobs), 1))
    turned = False
    for kind, first in PARTS.items():
        for axis in range(4 if kind == "orientation" else 3):
            column = numbers.get(("start", kind, axis))
            if column is not None:
                starts[:, first + axis] = column
                turned |= kind == "orientation"
    if turned:
        starts[:, 3:7] = [unit(tuple(q)) if any(q) else q for q in starts[:, 3:7].tolist()]
    if jobs.seeds is None:
        return starts
    assert scene.ensemble is not None
    return spread_starts(starts, scene.ensemble, jobs.seeds, points, radius, scene.floor is not None)
