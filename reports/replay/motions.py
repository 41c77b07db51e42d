"""What a replay shows of a scene: a body's poses in every engine and in truth, and what the floor does to it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from comparisons.measuring.comparison import Comparison, exactly
from comparisons.results.results import Results
from reports.plots.colours import engine_colours
from scenarios import DropspinError, Scenario, Trajectory, truth_for
from scenarios.mechanics import angular_momentum
from scenarios.rotations import about, conjugate, cross, dot, multiply

Array = NDArray[np.float64]

MOST_FRAMES = 300
"""Of a motion, if its steps can be divided so; between frames a page interpolates."""
IN_SIGHT = 10.0
"""How many times as far as the motion that goes least far others are followed by the view."""
MOST_TURNS = 1e6
"""From frame to frame; what an engine says that blows up is no number of turns."""
TRUTH = "truth"


@dataclass(frozen=True, eq=False)
class Motion:
    """One body's motion.

    Attributes:
        label: The engine's, or `truth`.
        colour: The engine's; empty for the truth, which is drawn in the colour of the text.
        frames: Every so-manyeth state that the engine has given, from the start on, as long as all are finite.
        struck: Frames by which the floor has changed the velocity since the frame before, shape (k,).
        impulses: By how much the floor did, at those frames [N s], shape (k, 3).
        points: Where it did: the point of the floor that the impulse goes through [m], shape (k, 3).
    """

    label: str
    colour: str
    frames: Trajectory
    struck: NDArray[np.intp]
    impulses: Array
    points: Array

    @cached_property
    @np.errstate(over="ignore")  # an engine may say 1e300
    def turns(self) -> NDArray[np.intp]:
        """Whole turns that come to the shorter way from a frame's attitude to the next one's, as angular velocity says; shape (k - 1,)."""
        axes, angles = self._ways
        spins = 0.5 * (self.frames.angular_velocity[1:] + self.frames.angular_velocity[:-1])
        turns = (dot(spins, axes) * np.diff(self.frames.t) - angles) / (2.0 * np.pi)
        return np.rint(np.clip(turns, -MOST_TURNS, MOST_TURNS)).astype(np.intp)

    def pose(self, place: float) -> tuple[Array, Array]:
        """Position [m] and orientation at a frame, or between two: on a straight line, turning evenly."""
        row = min(int(place + 1e-9), len(self.frames) - 1)
        share, x, q = place - row, self.frames.position, self.frames.orientation
        if share < 1e-6 or row == len(self.frames) - 1:
            return x[row], q[row]
        axes, angles = self._ways
        angle = angles[row] + 2.0 * np.pi * self.turns[row]
        return (1.0 - share) * x[row] + share * x[row + 1], multiply(about(axes[row], share * angle), q[row])

    @cached_property
    def _ways(self) -> tuple[Array, Array]:
        """Axis and angle of the shorter way from each attitude to the next."""
        way = multiply(self.frames.orientation[1:], conjugate(self.frames.orientation[:-1]))
        way = np.where(way[:, 3:] < 0.0, -way, way)
        sines = np.linalg.norm(way[:, :3], axis=1)
        return way[:, :3] / np.maximum(sines, np.finfo(float).tiny)[:, None], 2.0 * np.arctan2(sines, way[:, 3])


@dataclass(frozen=True, eq=False)
class Replay:
    """A scene's motions at one step.

    Attributes:
        scene: The scene.
        dt: The step [s].
        interval: Time between frames [s].
        motions: The engines', in order, then the truth's where it is known.
    """

    scene: Scenario
    dt: float
    interval: float
    motions: list[Motion]

    @cached_property
    def sight(self) -> float:
        """How far from the start bodies stay in the view [m]: one that flies off must not make the others too small to be seen."""
        ways = [self._from_start(motion.frames.position).max() for motion in self.motions]
        return IN_SIGHT * max(float(min(ways)), self.scene.body.size)

    def in_sight(self, places: Array) -> NDArray[np.bool_]:
        """Which of some places, shape (k, 3), the view holds."""
        return self._from_start(places) <= self.sight

    @np.errstate(over="ignore")  # an engine may say 1e300
    def _from_start(self, places: Array) -> Array:
        return np.linalg.norm(places - self.scene.start.position, axis=1)


@np.errstate(over="ignore")  # an engine may say 1e300
def replay_of(results: Results, scene_name: str, dt: float | None = None) -> Replay | None:
    """The motions of a scene, at a step or at the coarsest, where engines differ most; None if no engine has moved.

    Raises:
        DropspinError: The run has no such scene or step.
    """
    if scene_name not in results.scenes:
        raise DropspinError(f"no scene {scene_name!r} in this run; it has {', '.join(results.scenes)}.")
    scene = results.scenes[scene_name]
    steps = sorted({step for name, _, step in results.trajectories if name == scene_name}, reverse=True)
    if not steps:
        return None
    if dt is not None and dt not in steps:
        raise DropspinError(f"{scene_name} has no step {dt:g}; this run has {', '.join(f'{step:g}' for step in steps)}.")
    chosen = steps[0] if dt is None else dt
    every = _stride(scene.steps(chosen))
    colours = engine_colours(results.engines)
    moved = {engine: results.trajectories.get((scene_name, engine, chosen)) for engine in results.engines}
    motions = [_motion(scene, engine, colours[engine], motion[::every]) for engine, motion in moved.items() if motion is not None]
    truth = truth_for(scene)
    if truth is not None:
        times = chosen * every * np.arange(scene.steps(chosen) // every + 1, dtype=np.float64)
        motions.append(_motion(scene, TRUTH, "", exactly(truth, times)))
    return Replay(scene, chosen, chosen * every, [motion for motion in motions if len(motion.frames) > 1])


def _stride(steps: int) -> int:
    """Steps from frame to frame: such that the last state is a frame too, unless that leaves less than a quarter of the frames allowed."""
    least = max(1, -(-steps // MOST_FRAMES))
    return next((every for every in range(least, 2 * least + 1) if steps % every == 0), least)


def _motion(scene: Scenario, label: str, colour: str, motion: Trajectory) -> Motion:
    frames = motion[: motion.first_bad_row] if motion.first_bad_row is not None else motion
    if scene.floor is None or len(frames) < 2:
        return Motion(label, colour, frames, np.empty(0, dtype=np.intp), np.empty((0, 3)), np.empty((0, 3)))
    before = np.flatnonzero(Comparison(scene, frames).touching)
    return Motion(label, colour, frames, before + 1, *floor_impulses(scene, frames, before))


def floor_impulses(scene: Scenario, motion: Trajectory, before: NDArray[np.intp]) -> tuple[Array, Array]:
    """What the floor does to a body between some rows and the next.

    Args:
        scene: The scene.
        motion: The body's motion, rows equally far apart.
        before: The rows, shape (k,).

    Returns:
        What gravity and damping leave of the change of momentum [N s], and the point of the floor that it goes through [m], both of shape
        (k, 3): r × J = ΔL leaves r open along J, and the floor is at y = 0. Where that is no point near the body (an impulse along the
        floor, an engine that does not conserve L), it is the point below its centre.
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
