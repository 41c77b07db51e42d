"""Tosses as engines continue them from the end of their flights, seen in the frames of the recording."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path, PurePath
from typing import NamedTuple, TypeVar

import numpy as np

from dropspin.comparisons.engines.base import Diverged
from dropspin.comparisons.logs.flights import Flights, Start, flights_of
from dropspin.comparisons.logs.header import Header
from dropspin.comparisons.logs.intervals import FEWEST
from dropspin.comparisons.logs.log import Log, load_log
from dropspin.comparisons.running.arguments import EngineEntry, ignore
from dropspin.comparisons.running.driving import Breakdown, record_batch, verify_accepted
from dropspin.comparisons.running.parallel import results_in_parallel, started_crews
from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.scenarios import DropspinError, Scenario
from dropspin.scenarios.loading import from_mapping
from dropspin.scenarios.model import TOUCHING
from dropspin.scenarios.recording import STARTS, Recording, start_of
from dropspin.scenarios.rotations import cross, length, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, RATES, SPIN, Array
from dropspin.scenarios.text import counted
from dropspin.scenarios.truths.flight import flight_states
from dropspin.scenarios.validation import validated
from dropspin.scenarios.variations import whole_steps, with_values

Result = TypeVar("Result")
STEPS_PER_FRAME = 4
"""Time steps of an engine between two frames: at 148 Hz, 1.69 ms."""
SEED = 48
LONG = 2.0
"""Times the duration of the median toss, after which a toss is not compared."""
FRAME_DIGITS, START_DIGITS = 6, 9
"""After the point, of the numbers of a scene of tosses: a µm, a µs; and so few nm that no start gets below the floor."""
WHOLE = 1e-6
"""Steps by which a number of steps may miss a whole one."""
BATCH_ROWS = 20_000
"""Steps of tosses of about one length that are held in memory at a time."""


class Launches(NamedTuple):
    """Where engines take over.

    Attributes:
        scene: The scene; its own start is of no toss.
        dt: Time step [s].
        point: The tracked point from the centre of mass, in the body frame [m], shape (3,).
        states: States of the centre of mass at the end of each flight, or earlier where noise has put the body below the floor, (m, 13).
        frames: Times of the frames to compare, from these states on [s], shape (m, n); NaN beyond the end of a toss.
    """

    scene: Scenario
    dt: float
    point: Array
    states: Array
    frames: Array


def scene_of(header: Header) -> Scenario:
    """The scene of all tosses: body, gravity and floor; its own start is of no toss.

    Raises:
        DropspinError: The header has no floor.
    """
    if header.floor is None:
        raise DropspinError("the recording's header has no [floor]; give restitution and friction, as far as they are known.")
    content = {"name": "toss", "duration": 1.0, "body": header.body.model_dump(), "floor": header.floor.model_dump()}
    start, gravity = {"position": (0.0, 2.0 * header.body.size, 0.0)}, {"acceleration": header.acceleration.tolist()}
    return from_mapping({**content, "start": start, "gravity": gravity})


def measured_scene(flights: Flights) -> Scenario | None:
    """The scene of the tosses of a recording that have frames after their flights, each from the end of its flight on; None without one.

    It lasts for at most twice the median toss, because engines simulate all tosses equally long.

    Raises:
        DropspinError: The header has no floor, or a body is below it during all of its flight.
    """
    header, random = flights.log.header, np.random.default_rng(SEED)
    scene, found = scene_of(header), []
    for start in flights.starts():
        if start.frame + 1 == len(start.toss):
            continue
        dt = time_step([start])
        states, earlier = _above_floor(scene, start, np.vstack([start.state, start.drawn(random, STARTS - 1)]), dt)
        orientation = start.toss.orientation[start.frame + 1 :]
        position = start.toss.position[start.frame + 1 :] - rotate(orientation, header.tracked_from_centre)
        t = start.toss.t[start.frame + 1 :] - start.toss.t[start.frame] + earlier
        frames = {"t": t, "position": position, "orientation": orientation}
        rounded = {key: values.round(FRAME_DIGITS) for key, values in frames.items()}
        found.append({"name": start.toss.name, **rounded, "starts": states.round(START_DIGITS)})
    if not found:
        return None
    noise = {"position": flights.moving.noise.white, "orientation": flights.turning.noise.white}
    name = PurePath(flights.log.origin).stem
    recording = validated(Recording, flights.log.origin, {"name": name, "noise": noise, "tosses": found})
    duration = min(recording.duration, round(LONG * float(np.median([toss["t"][-1] for toss in found])), 2))
    content = scene.model_dump(include={"body", "gravity", "floor"}, exclude_none=True)
    return from_mapping({**content, "name": name, "duration": duration, "recording": recording, "start": start_of(recording)})


def flights_in(recording: Flights | Log | str | Path) -> Flights:
    """The flights of a recording, which may be the path of its header or the name of one that comes with dropspin, such as `toss-cube`.

    Raises:
        DropspinError: It cannot be loaded, or has no flight.
    """
    if isinstance(recording, Flights):
        return recording
    log = recording if isinstance(recording, Log) else load_log(recording)
    found = flights_of(log, log.header.acceleration)
    if found is None:
        raise DropspinError(f"{log.origin}: no toss has a flight with the acceleration of gravity; dropspin log check says why.")
    return found


def usable(flights: Flights, frames: int = 1) -> list[Start]:
    """The starts of tosses that have so many frames after the flight.

    Raises:
        DropspinError: They are too few for an interval.
    """
    starts = [start for start in flights.starts() if start.frame + frames < len(start.toss)]
    if len(starts) < FEWEST:
        raise DropspinError(
            f"{flights.log.origin}: has {counted(len(starts), 'toss', 'tosses')} with {counted(frames, 'frame')} after a flight; "
            f"give at least {FEWEST}."
        )
    return starts


def launches(header: Header, starts: Sequence[Start], states: Array, dt: float, most: int | None = None) -> Launches:
    """Launches of tosses from states at the end of their flights, shape (m, 13), with the frames from there on, or at most so many.

    A state below the floor is replaced by that of an earlier time step of its flight.

    Raises:
        DropspinError: The header has no floor, or the body is below it during all of a flight.
    """
    scene, found, frames = scene_of(header), states.copy(), []
    for row, start in enumerate(starts):
        found[row : row + 1], earlier = _above_floor(scene, start, states[row : row + 1], dt)
        frames.append(_from(start, start.toss.t, most) - start.toss.t[start.frame] + earlier)
    return Launches(scene, dt, header.tracked_from_centre, found, _padded(frames))


def _above_floor(scene: Scenario, start: Start, states: Array, dt: float) -> tuple[Array, float]:
    """States at the end of a flight, or all by the same time earlier [s], a number of time steps, at which no body is below the floor."""
    found, steps = states, 0
    while (depth := -min(scene.starting_at(state).clearance for state in found)) > TOUCHING * scene.body.size:
        steps += 1
        if steps * dt > start.toss.t[start.frame] - start.toss.t[start.first]:
            raise DropspinError(
                f"toss {start.toss.name}: the body is {1e3 * depth:.3g} mm below the floor during its flight; "
                "correct floor_height, up, tracked_point, or the size or centre of mass of the body."
            )
        flown = [flight_states(state, scene.body.inertia_tensor, scene.acceleration) for state in states]
        found = np.vstack([flight(np.array([-steps * dt])) for flight in flown])
    return found, steps * dt


def of_each_engine(
    entries: Sequence[EngineEntry],
    work: Callable[[EngineEntry, EngineProcesses, Callable[[str], None]], Result | Breakdown],
    on_progress: Callable[[str, float], None] | None,
    resources: ResourceLimits,
    jobs: int | None,
) -> tuple[dict[str, Result], dict[str, str]]:
    """What some work gives for each engine, by label, and the reasons of those that broke down."""
    with started_crews(jobs, len(entries), entries, resources) as crews:
        results = results_in_parallel(entries, work, crews, on_progress or ignore)
    labelled = {entry.label: result for entry, result in zip(entries, results, strict=True)}
    found = {label: result for label, result in labelled.items() if not isinstance(result, Breakdown)}
    return found, {label: result.reason for label, result in labelled.items() if isinstance(result, Breakdown)}


def poses(entry: EngineEntry, launched: Launches, floors: Sequence[Mapping[str, float]] = ({},)) -> Array:
    """The poses of the tracked point in the frames, shape (floors, tosses, frames, 7), by an engine; runs in the engine's process.

    Frames beyond the end of a toss are NaN. An engine whose velocities lag its positions starts with those of so much earlier, so that its
    flight is the recorded one.

    Args:
        entry: The engine.
        launched: The launches.
        floors: Values of the floor that differ from those of the scene.

    Raises:
        Breakdown: The engine declines a floor.
        Diverged: A motion is not finite.
    """
    dt, scenes = launched.dt, [with_values(launched.scene, "floor", **values) for values in floors]
    for scene in scenes:
        verify_accepted(entry.adapter, scene)
    states, steps = launched.states.copy(), launched.frames / dt
    [first] = record_batch(entry.adapter, [whole_steps(scenes[0], dt, 1)], dt)
    states[:, RATES] -= first.motion.velocity_lag * _rates_of_rates(scenes[0], states)
    lengths = np.ceil(np.nanmax(steps, axis=1) - WHOLE).astype(int)
    order, size = np.argsort(lengths, kind="stable"), max(1, BATCH_ROWS // int(lengths.max()))
    found = np.full((len(scenes), *steps.shape, 7), np.nan)
    for number, scene in enumerate(scenes):
        for begin in range(0, len(order), size):
            rows = order[begin : begin + size]
            base = scene.model_copy(update={"duration": math.nextafter(lengths[rows[-1]] * dt, math.inf)})
            recordings = record_batch(entry.adapter, [base.starting_at(states[row]) for row in rows], dt)
            found[number, rows] = _at(np.stack([recording.motion.states[:, : ORIENTATION.stop] for recording in recordings]), steps[rows])
    if not np.isfinite(found[:, np.isfinite(steps)]).all():
        raise Diverged("a toss is not finite")
    found[..., POSITION] += rotate(found[..., ORIENTATION], launched.point)
    return found


def _rates_of_rates(scene: Scenario, states: Array) -> Array:
    """Accelerations and angular accelerations in flight, by Euler's equations [m/s², rad/s²], shape (m, 6)."""
    spin, inertia = unrotate(states[:, ORIENTATION], states[:, SPIN]), scene.body.inertia_tensor
    changes = np.linalg.solve(inertia, cross(spin @ inertia, spin).T).T.astype(np.float64)
    turned = rotate(states[:, ORIENTATION], changes)
    return np.hstack([np.broadcast_to(scene.acceleration, turned.shape), turned])


def _at(motions: Array, steps: Array) -> Array:
    """Poses of motions, shape (m, k, 7), after numbers of steps that need not be whole, shape (m, n); between two steps, on the chord."""
    before = np.minimum(np.floor(np.nan_to_num(steps) + WHOLE).astype(int), motions.shape[1] - 2)
    share, row = np.abs(steps - before)[..., np.newaxis], np.arange(len(steps))[:, np.newaxis]
    found = (1.0 - share) * motions[row, before] + share * motions[row, before + 1]
    found[..., ORIENTATION] /= length(found[..., ORIENTATION])[..., np.newaxis]
    return found


def recorded(starts: Sequence[Start], most: int | None = None) -> Array:
    """The recorded poses from the end of each flight on, shape (tosses, frames, 7); NaN beyond the end of a toss."""
    return _padded([_from(start, np.hstack([start.toss.position, start.toss.orientation]), most) for start in starts])


def _from(start: Start, rows: Array, most: int | None) -> Array:
    """The rows of a toss from the end of its flight on, or at most so many after it."""
    return rows[start.frame : None if most is None else start.frame + most + 1]


def _padded(rows: Sequence[Array]) -> Array:
    """Rows of arrays of different lengths, with NaN at the end of the shorter ones."""
    found = np.full((len(rows), max(map(len, rows)), *rows[0].shape[1:]), np.nan)
    for row, one in zip(found, rows, strict=True):
        row[: len(one)] = one
    return found


def time_step(starts: Sequence[Start], steps: int = STEPS_PER_FRAME) -> float:
    """The time step of the engines [s], for a number of steps in a frame."""
    return float(np.median(np.concatenate([np.diff(start.toss.t) for start in starts]))) / steps
