"""The motions of a replay: the body's poses in each engine and in the exact solution, and the impulses of the floor."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from comparisons.measuring.comparison import Comparison, exactly
from comparisons.results.results import Results
from reports.plots.colours import EXACT, engine_colours
from scenarios import DropspinError, Scenario, Trajectory, truth_for
from scenarios.mechanics import angular_momentum
from scenarios.rotations import about, conjugate, cross, dot, multiply

Array = NDArray[np.float64]

MOST_FRAMES = 300
"""Frames of a motion, if its steps can be divided so; the page interpolates between frames."""
IN_SIGHT = 10.0
"""The view reaches this many times as far from the start as the shortest motion."""
MOST_TURNS = 1e6
"""Upper bound on whole turns between two frames: a diverging engine may report any angular velocity."""


@dataclass(frozen=True, eq=False)
class Motion:
    """One body's motion.

    Attributes:
        label: Label of the engine, or `EXACT`.
        colour: Colour of the engine; empty for the exact solution, which is drawn in the text colour.
        frames: Recorded states at a fixed stride, from the start to the last finite one.
        struck: Frames for which the floor changed the velocity since the previous frame, shape (k,).
        impulses: Impulse of the floor at those frames [N s], shape (k, 3).
        points: Point of the floor through which each impulse acts [m], shape (k, 3).
    """

    label: str
    colour: str
    frames: Trajectory
    struck: NDArray[np.intp]
    impulses: Array
    points: Array

    @cached_property
    @np.errstate(over="ignore")  # an engine may return 1e300
    def turns(self) -> NDArray[np.intp]:
        """Whole turns between frames beyond the shorter rotation, from the angular velocity; shape (frames - 1,)."""
        axes, angles = self._rotations
        spins = 0.5 * (self.frames.angular_velocity[1:] + self.frames.angular_velocity[:-1])
        turns = (dot(spins, axes) * np.diff(self.frames.t) - angles) / (2.0 * np.pi)
        return np.rint(np.clip(turns, -MOST_TURNS, MOST_TURNS)).astype(np.intp)

    def pose(self, place: float) -> tuple[Array, Array]:
        """Position [m] and orientation at a frame, or interpolated between two: straight motion, uniform rotation.

        Args:
            place: Number of the frame; fractions lie between two frames.
        """
        row = min(int(place + 1e-9), len(self.frames) - 1)
        share, x, q = place - row, self.frames.position, self.frames.orientation
        if share < 1e-6 or row == len(self.frames) - 1:
            return x[row], q[row]
        axes, angles = self._rotations
        angle = angles[row] + 2.0 * np.pi * self.turns[row]
        return (1.0 - share) * x[row] + share * x[row + 1], multiply(about(axes[row], share * angle), q[row])

    @cached_property
    def _rotations(self) -> tuple[Array, Array]:
        """Axis and angle [rad] of the shorter rotation from each attitude to the next, shapes (frames - 1, 3) and (frames - 1,)."""
        rotation = multiply(self.frames.orientation[1:], conjugate(self.frames.orientation[:-1]))
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
        motions: Those of the engines, in order, then the exact solution if there is one.
    """

    scene: Scenario
    dt: float
    interval: float
    motions: list[Motion]

    @cached_property
    def sight(self) -> float:
        """Distance from the start that the view covers [m]: a body that flies off must not make the others too small to see."""
        distances = [self._from_start(motion.frames.position).max() for motion in self.motions]
        return IN_SIGHT * max(float(min(distances)), self.scene.body.size)

    def in_sight(self, positions: Array) -> NDArray[np.bool_]:
        """Which positions [m], shape (k, 3), are in the view."""
        return self._from_start(positions) <= self.sight

    @np.errstate(over="ignore")  # an engine may return 1e300
    def _from_start(self, positions: Array) -> Array:
        return np.linalg.norm(positions - self.scene.start.position, axis=1)


@np.errstate(over="ignore")  # an engine may return 1e300
def replay_of(results: Results, scene_name: str, dt: float | None = None) -> Replay | None:
    """The motions of a scene at a time step, by default at the coarsest, where engines differ most; None if no engine has a motion.

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
    every = _stride(scene.steps(chosen))
    colours = engine_colours(results.engines)
    moved = {engine: results.trajectories.get((scene_name, engine, chosen)) for engine in results.engines}
    motions = [_motion(scene, engine, colours[engine], motion[::every]) for engine, motion in moved.items() if motion is not None]
    truth = truth_for(scene)
    if truth is not None:
        times = chosen * every * np.arange(scene.steps(chosen) // every + 1, dtype=np.float64)
        motions.append(_motion(scene, EXACT, "", exactly(truth, times)))
    return Replay(scene, chosen, chosen * every, [motion for motion in motions if len(motion.frames) > 1])


def _stride(steps: int) -> int:
    """Steps between frames: the least that makes the last state a frame, if it is at most twice the least that `MOST_FRAMES` allows."""
    least = max(1, -(-steps // MOST_FRAMES))
    return next((every for every in range(least, 2 * least + 1) if steps % every == 0), least)


def _motion(scene: Scenario, label: str, colour: str, motion: Trajectory) -> Motion:
    frames = motion[: motion.first_bad_row] if motion.first_bad_row is not None else motion
    if scene.floor is None or len(frames) < 2:
        return Motion(label, colour, frames, np.empty(0, dtype=np.intp), np.empty((0, 3)), np.empty((0, 3)))
    before = np.flatnonzero(Comparison(scene, frames).touching)
    return Motion(label, colour, frames, before + 1, *floor_impulses(scene, frames, before))


def floor_impulses(scene: Scenario, motion: Trajectory, before: NDArray[np.intp]) -> tuple[Array, Array]:
    """The impulse of the floor on a body between given rows and the rows after them.

    Args:
        scene: The scene.
        motion: The motion of the body, at equally spaced times.
        before: The rows, shape (k,).

    Returns:
        The impulse J [N s], which is the change of momentum less those by gravity and damping, and the point of the floor through which it
        acts [m], both of shape (k, 3). r × J = ΔL determines r except along J; the floor at y = 0 determines the rest. If that point is not
        near the body (an impulse along the floor, an engine that does not conserve L), it is the point below the centre of mass.
    """
    interval = motion.t[1] - motion.t[0]
    linear, angular = (0.0, 0.0) if scene.damping is None else (scene.damping.linear, scene.damping.angular)
    v, x, L = motion.velocity, motion.position[before], angular_momentum(scene, motion)
    J = scene.body.mass * (v[before + 1] - np.exp(-linear * interval) * v[before] - interval * scene.acceleration)
    turned = L[before + 1] - np.exp(-angular * interval) * L[before]
    with np.errstate(divide="ignore", invalid="ignore"):
        r = cross(J, turned) / dot(J, J)[:, None]
        r = r - ((x + r)[:, 1] / J[:, 1])[:, None] * J
        is_near = dot(r, r) <= (1.5 * scene.body.size) ** 2
    return J, np.where(is_near[:, None], x + r, x * [1.0, 0.0, 1.0])
