"""The motions of a replay: the poses of the body in each engine and in the exact solution, and the impulses of floor and walls."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.measuring.comparison import Comparison, exactly
from dropspin.comparisons.results.results import Results
from dropspin.reports.plots.colours import engine_styles
from dropspin.scenarios import DropspinError, Scenario, Trajectory, Truth, reference_for
from dropspin.scenarios.mechanics import angular_momentum
from dropspin.scenarios.rotations import angle_between_orientations, conjugate, cross, dot, multiply
from dropspin.scenarios.state import RATES, UP, Array

Rows = NDArray[np.intp]

MOST_FRAMES = 300
"""Largest number of frames of a motion, if the number of steps has a suitable divisor; the page interpolates between frames."""
IN_SIGHT = 10.0
"""The extent of the view, as a multiple of the extent of the motion that stays nearest to the start."""
MOST_TURNS = 1e6
"""Upper bound on whole turns of a step, or between two frames: a diverging engine may report any angular velocity."""
RESOLVED_HOP = 4.0
"""Number of time steps: an impulse below that of the weight during this time is no impact. In some engines a resting body hops for a step
or two.
"""


class Impacts(NamedTuple):
    """Impacts on the floor and on walls.

    Attributes:
        times: Times of the impacts [s], shape (k,).
        impulses: Impulse on the body [N s], shape (k, 3).
        points: Point through which each impulse acts [m], shape (k, 3).
    """

    times: Array
    impulses: Array
    points: Array


@dataclass(frozen=True, eq=False)
class Motion:
    """One body's motion.

    Attributes:
        label: Label of the engine, or what the reference is: an exact solution or a recording.
        colour: Colour of the engine; empty for the reference, which is drawn in the text colour.
        frames: States at a fixed stride, and those at impacts, from the start to the last finite one.
        rotations: Sum of the rotations of all steps from each frame to the next, as rotation vectors [rad], shape (frames - 1, 3).
        errors: Distance [m] and angle [rad] from the reference at each frame, shape (frames, 2), NaN after its end; None without one.
        impacts: The impacts on the floor and on walls, in order.
    """

    label: str
    colour: str
    frames: Trajectory
    rotations: Array
    errors: Array | None
    impacts: Impacts

    @cached_property
    def turns(self) -> NDArray[np.intp]:
        """Whole turns from each frame to the next in addition to the shorter rotation, shape (frames - 1,)."""
        return _turns(self.rotations, *_shorter_rotations(self.frames)).astype(np.intp)


@np.errstate(over="ignore")  # an engine may return 1e300
def rotations_of_steps(motion: Trajectory) -> Array:
    """The rotation vectors between successive states [rad], shape (n - 1, 3), with as many whole turns as the angular velocity says.

    An engine whose orientation does not follow its angular velocity turns by another angle, which may add up to turns in several steps.
    """
    spins = 0.5 * (motion.angular_velocity[1:] + motion.angular_velocity[:-1])
    axes, angles = _shorter_rotations(motion)
    return axes * (angles + 2.0 * np.pi * _turns(spins * np.diff(motion.t)[:, None], axes, angles))[:, None]


def _shorter_rotations(motion: Trajectory) -> tuple[Array, Array]:
    """Axes and angles, at most half a turn, of the rotations between successive states."""
    return axis_and_angle(multiply(motion.orientation[1:], conjugate(motion.orientation[:-1])))


def _turns(rotations: Array, axes: Array, angles: Array) -> Array:
    """Numbers of whole turns by which rotation vectors exceed shorter rotations."""
    return np.rint(np.clip((dot(rotations, axes) - angles) / (2.0 * np.pi), -MOST_TURNS, MOST_TURNS))


def axis_and_angle(rotation: Array) -> tuple[Array, Array]:
    """Axes, shape (n, 3), and angles [rad] from 0 to π, shape (n,), of quaternions, shape (n, 4)."""
    rotation = np.where(rotation[:, 3:] < 0.0, -rotation, rotation)
    sines = np.linalg.norm(rotation[:, :3], axis=1)
    return rotation[:, :3] / np.maximum(sines, np.finfo(float).tiny)[:, None], 2.0 * np.arctan2(sines, rotation[:, 3])


@dataclass(frozen=True, eq=False)
class Replay:
    """The motions of a scene at one time step.

    Attributes:
        scene: The scene.
        dt: Time step [s].
        interval: Time between frames [s].
        motions: The motions of the engines, in order, and last the reference if there is one.
    """

    scene: Scenario
    dt: float
    interval: float
    motions: list[Motion]

    @cached_property
    def sight(self) -> float:
        """Distance from the start that the view covers [m].

        It is limited, so that a body that flies off does not make the others too small to see.
        """
        distances = [self._from_start(motion.frames.position).max() for motion in self.motions]
        return IN_SIGHT * max(float(min(distances)), self.scene.body.size)

    @cached_property
    @np.errstate(over="ignore")
    def spin(self) -> float:
        """The smallest over all motions of the largest angular velocity [rad/s], so that a diverging engine has no effect."""
        return min(float(np.linalg.norm(motion.frames.angular_velocity, axis=1).max()) for motion in self.motions)

    def in_sight(self, positions: Array) -> NDArray[np.bool_]:
        """Whether positions [m], shape (k, 3), are in the view; shape (k,)."""
        return self._from_start(positions) <= self.sight

    @np.errstate(over="ignore")  # an engine may return 1e300
    def _from_start(self, positions: Array) -> Array:
        return np.linalg.norm(positions - self.scene.start.position, axis=1)


@np.errstate(over="ignore")  # an engine may return 1e300
def replay_of(results: Results, scene_name: str, dt: float | None = None) -> Replay | None:
    """The motions of a scene at a time step, by default the coarsest, at which engines differ most; None if no engine has a motion.

    Raises:
        DropspinError: The run has no such scene or time step.
    """
    if scene_name not in results.scenes:
        raise DropspinError(f"this run has no scene {scene_name!r}; choose one of {', '.join(results.scenes)}.")
    scene = results.scenes[scene_name]
    steps = sorted({step for name, _, step in results.trajectories if name == scene_name}, reverse=True)
    if not steps:
        return None
    if dt is not None and dt not in steps:
        raise DropspinError(f"{scene_name} was not run at {dt:g} s; choose one of {', '.join(f'{step:g}' for step in steps)} s.")
    chosen = steps[0] if dt is None else dt
    moved = {engine: results.trajectories.get((scene_name, engine, chosen)) for engine in results.engines}
    return replay_together(scene, chosen, {engine: motion for engine, motion in moved.items() if motion is not None})


def replay_together(scene: Scenario, dt: float, moved: Mapping[str, Trajectory]) -> Replay:
    """Motions of a scene at a time step [s], by their labels, and the exact solution or the recording if there is one."""
    steps, truth, styles = scene.steps(dt), reference_for(scene), engine_styles(tuple(moved))
    every = _stride(steps)
    first_event = [round(event.time / dt) for event in truth.events[:1]] if truth else []
    shown = np.union1d(np.arange(0, steps + 1, every), first_event).astype(np.intp)
    motions = [_motion(scene, truth, label, styles[label].colour, motion, shown) for label, motion in moved.items()]
    if truth is not None:
        motions.append(_exact_motion(scene, truth, dt * np.arange(steps + 1.0), shown))
    return Replay(scene, dt, dt * every, [motion for motion in motions if len(motion.frames) > 1])


def _stride(steps: int) -> int:
    """Number of steps between frames.

    This is the smallest number for which the last state is a frame, if it is at most twice the smallest that `MOST_FRAMES` allows.
    """
    least = max(1, -(-steps // MOST_FRAMES))
    return next((every for every in range(least, 2 * least + 1) if steps % every == 0), least)


def _motion(scene: Scenario, truth: Truth | None, label: str, colour: str, motion: Trajectory, rows: Rows) -> Motion:
    motion = motion[: motion.first_bad_row] if motion.first_bad_row is not None else motion
    rows = rows[rows < len(motion)]
    impacts = Impacts(np.empty(0), np.empty((0, 3)), np.empty((0, 3)))
    if scene.floor is not None and len(motion) > 1:
        before, after, main = impact_rows(scene, motion)
        impacts = Impacts(motion.t[main], *contact_impulses(scene, motion, before, after))
        # A body bounces between two states: interpolated over a longer time, it would turn back above the floor.
        rows = np.union1d(rows, np.concatenate([main - 1, main]))
    frames, rotations = _framed(motion, rows)
    return Motion(label, colour, frames, rotations, None if truth is None else _errors(frames, exactly(truth, frames.t)), impacts)


def _exact_motion(scene: Scenario, truth: Truth, times: Array, rows: Rows) -> Motion:
    """The exact solution, with frames at some of the times of steps, and at its events."""
    events = [event.time for event in truth.events]
    frames_at, every = np.union1d(times[rows], events), np.union1d(times, events)
    states = np.array([[event.before, event.after] for event in truth.events]).reshape(-1, 13)
    pairs = Trajectory.from_states(np.repeat(events, 2), states)
    # A change of friction is an event, but no impact.
    before = 2 * np.flatnonzero(np.any(states[::2, RATES] != states[1::2, RATES], axis=1))
    impacts = Impacts(pairs.t[before], *contact_impulses(scene, pairs, before, before + 1))
    motion = exactly(truth, every)
    shown = np.searchsorted(every, frames_at)
    return Motion(truth.word, "", *_framed(motion, shown[shown < len(motion)]), None, impacts)


def _framed(motion: Trajectory, rows: Rows) -> tuple[Trajectory, Array]:
    """The frames of a motion at some rows, and the sum of the rotations of all steps between them."""
    if len(rows) < 2:
        return motion[rows], np.empty((0, 3))
    return motion[rows], np.add.reduceat(rotations_of_steps(motion[: rows[-1] + 1]), rows[:-1])


def _errors(motion: Trajectory, exact: Trajectory) -> Array:
    """Distances [m] and angles [rad] between two motions, NaN after the end of the second, shape (frames, 2)."""
    errors, known = np.full((len(motion), 2), np.nan), len(exact)
    errors[:known, 0] = np.linalg.norm(motion.position[:known] - exact.position, axis=1)
    errors[:known, 1] = angle_between_orientations(motion.orientation[:known], exact.orientation)
    return errors


def impact_rows(scene: Scenario, motion: Trajectory) -> tuple[Rows, Rows, Rows]:
    """The impacts of a motion: time steps in which the impulse is that of an impact; adjacent steps are one impact.

    Args:
        scene: The scene, which has a floor.
        motion: The motion of the body, at equally spaced times.

    Returns:
        The row before each impact, the row after it, and the row after the step with the largest impulse in it, each of shape (k,).
    """
    case = Comparison(scene, motion)
    steps = np.flatnonzero(case.motions.in_contact | (case.states.touching & case.states.near_wall[:-1]))
    impulses = np.linalg.norm(contact_impulses(scene, motion, steps, steps + 1)[0], axis=1)
    weight = scene.body.mass * float(np.linalg.norm(scene.acceleration))
    is_impact = impulses > RESOLVED_HOP * weight * (motion.t[1] - motion.t[0])
    steps, impulses = steps[is_impact], impulses[is_impact]
    groups = [group for group in np.split(np.arange(len(steps)), np.flatnonzero(np.diff(steps) > 1) + 1) if len(group)]
    main = [group[np.argmax(impulses[group])] for group in groups]
    first, last, largest = (np.array(places, dtype=np.intp) for places in ([g[0] for g in groups], [g[-1] for g in groups], main))
    return steps[first], steps[last] + 1, steps[largest] + 1


def contact_impulses(scene: Scenario, motion: Trajectory, before: Rows, after: Rows) -> tuple[Array, Array]:
    """The impulse of the floor, or of a wall, on a body between given rows.

    Args:
        scene: The scene.
        motion: The motion of the body.
        before: The rows before, shape (k,).
        after: The rows after, shape (k,).

    Returns:
        The impulse J [N s], which is the change of momentum without the changes by gravity and damping, and the point through which it acts
        [m], both of shape (k, 3). r × J = ΔL determines r except along J; the plane, floor or wall, for which it is nearest to the body
        determines the rest. If that point is not near (an impulse along the floor, an engine that does not conserve L), it is the point
        of the floor below the centre of mass.
    """
    interval = (motion.t[after] - motion.t[before])[:, None]
    linear, angular = (0.0, 0.0) if scene.damping is None else (scene.damping.linear, scene.damping.angular)
    v, x, L = motion.velocity, motion.position[before], angular_momentum(scene, motion)
    J = scene.body.mass * (v[after] - np.exp(-linear * interval) * v[before] - interval * scene.acceleration)
    turned = L[after] - np.exp(-angular * interval) * L[before]
    with np.errstate(divide="ignore", invalid="ignore"):
        line = cross(J, turned) / dot(J, J)[:, None]
        planes = [(np.zeros(3), UP), *((np.array(wall.point), np.array(wall.normal)) for wall in scene.wall or ())]
        arms = np.array([line - ((x + line - point) @ normal / (J @ normal))[:, None] * J for point, normal in planes])
        distances = np.linalg.norm(arms, axis=2)
    nearest = np.nan_to_num(distances, nan=np.inf).argmin(axis=0), np.arange(len(J))
    is_near = distances[nearest] <= 1.5 * scene.body.size
    return J, np.where(is_near[:, None], x + arms[nearest], x * [1.0, 0.0, 1.0])
