"""One rigid body of a user's model, as the engine that owns the format has it in force: what is read from it, and how it is simulated.

The body is simulated alone, above the surface that it may land on, which is the plane y = 0: y is up, and quaternions are [x, y, z, w].
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np

from dropspin.comparisons.diagnosis.geometries import AXES, DIRECTIONS, VOLUMES, Part, Support
from dropspin.comparisons.diagnosis.xml_file import Ignored, Setting
from dropspin.scenarios.bodies.inertia import principal_axes
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.state import SPIN, UP, Array
from dropspin.scenarios.truths.damped_joint import Resistance, fall, free_motion, spin_about_axis, time_constant

SETTLED = 3.0  # s
STILL = np.zeros(3)
ALONG = 1e-9  # angle of a torque to an axis, below which it is along it [rad]
ROUNDING = 1e-14  # of products of inertia, relative to the moments, and of components, relative to the largest
LIGHT = 0.01
"""Share of the mass that may be in parts without geometry where the geometries are said to contain it."""
Changes = Mapping[str, str | float | tuple[float, ...]]
"""Settings to change, by name: those of `LooseBody.remedies`."""


class Drag(NamedTuple):
    """The coefficients of v, v² and v³ in a damping force [N s/m, N s²/m², N s³/m³], or of ω, ω² and ω³ in a torque [N m s, …]."""

    linear: float = 0.0
    quadratic: float = 0.0
    cubic: float = 0.0


class MassProperties(NamedTuple):
    """Mass [kg], centre of mass [m], shape (3,), and the inertia about it [kg m²], shape (3, 3), in the frame of the body."""

    mass: float
    centre: Array
    inertia: Array


def time_of_decay(times: Array, speeds: Array) -> float:
    """The time at which a speed is 1/e of its start [s], interpolated as an exponential; infinite if it is at none of the times."""
    below = np.flatnonzero(speeds <= speeds[0] / math.e)
    if not len(below):
        return math.inf
    last = int(below[0])
    if speeds[last] <= 0.0:
        return float(times[last])
    before, after = math.log(speeds[last - 1] / speeds[0]), math.log(speeds[last] / speeds[0])
    return float(times[last - 1] + (times[last] - times[last - 1]) * (before + 1.0) / (before - after))


class LooseBody(ABC):
    """A body of a user's model that can be simulated alone, in the process of its engine, and what the engine has in force for it.

    Attributes:
        name: The body's name in the file, or its number.
        engine: The engine.
        version: Its version.
        dt: The time step of the file, or the engine's default [s].
        gravity: Magnitude of the acceleration of gravity [m/s²].
        mass: [kg].
        inertia: About the centre of mass, in the body frame [kg m²], shape (3, 3).
        offset: The centre of mass in the frame that damping and armature act on [m], shape (3,).
        parts: The geometries, visual ones included.
        is_bounded: Whether everything has geometries, inside of which the mass is, but for at most `LIGHT` of the mass.
        pose: The orientation of the body in the file, shape (4,).
        resistance: The damping, a function of velocity and spin.
        falls: The damping of a fall.
        spins: The damping of a spin about each of the three principal axes.
        armature: What the settings add to the mass matrix: a mass [kg], and a moment about each axis [kg m²].
        lifted: The share of the weight that the settings take away.
        unknown: The names of the settings by which forces act that no exact solution here includes.
        surface: The name of what it lands on; empty for nothing.
        others: The names of what else it may land on.
        friction: The coefficient of friction of both together, along x.
        friction_across: That along z; NaN if it is the same.
        restitution: The coefficient of restitution of both together; None if the engine has none.
        margin: Height above the surface from which the contact acts [m].
        rolling: The names of the settings by which friction resists rolling.
        rest_depth: Depth of a body at rest below the surface by the contact settings [m], negative above; NaN if it has no closed form.
        written: The mass and inertia that the file has; None if it has no inertia.
        in_own_frame: The inertia that the file has about the axes of its own frame, shape (3, 3); None of several links.
        settings: Where settings that matter are written, by the engine's names.
        ignored: What the engine read and does not use, or changes: name, what is written, what is in force.
        unmodelled: What the file has beside the body that the simulations leave out.
        missed: A plane of the file that the body falls through, and why; empty if there is none.
        left_out: What of the file the body collides with, in place of which it lands on a plane that is added; empty if there is nothing.
        remedies: By the name of a setting, the changes that take its effect away.
        causes: By question, the settings that may change errors, beside the time step.
    """

    name: str
    engine: str
    version: str
    dt: float
    gravity: float
    mass: float
    inertia: Array
    offset: Array
    parts: Sequence[Part]
    is_bounded: bool
    pose: Array
    resistance: Resistance
    falls: Drag
    spins: Sequence[Drag]
    armature: float = 0.0
    lifted: float = 0.0
    unknown: Sequence[str] = ()
    surface: str
    others: Sequence[str] = ()
    friction: float
    friction_across: float = math.nan
    restitution: float | None = None
    margin: float
    rolling: Sequence[str]
    rest_depth: float
    written: MassProperties | None
    in_own_frame: Array | None = None
    settings: Mapping[str, Setting]
    ignored: Sequence[Ignored]
    unmodelled: Sequence[str]
    missed: str = ""
    left_out: str = ""
    remedies: Mapping[str, Changes]
    causes: Mapping[str, tuple[str, ...]]

    @cached_property
    def lowest(self) -> Callable[[Array], Array]:
        """The function from states to the heights of the body's lowest point, shape (n,) [m]."""
        return Support(self.colliding).lowest

    def in_file(self, *names: str) -> tuple[str, ...]:
        """Those of some settings that the file has."""
        return tuple(name for name in names if name in self.settings and self.settings[name].file)

    @property
    def lands(self) -> bool:
        """Whether there is a surface that gravity holds the body on."""
        return bool(self.surface) and self.gravity * (1.0 - self.lifted) > 0.0

    @property
    def colliding(self) -> Sequence[Part]:
        """The geometries that collide; all if none does."""
        return [part for part in self.parts if part.collides] or self.parts

    @cached_property
    def principal(self) -> tuple[Array, Array]:
        """Principal moments [kg m²], shape (3,), and axes, the columns of shape (3, 3): those of the body where they are principal."""
        return principal_axes(np.where(np.abs(self.inertia) > ROUNDING * np.trace(self.inertia), self.inertia, 0.0))

    def start(self, *, height: float = 0.0, velocity: Array = STILL, spin: Array = STILL) -> Array:
        """A state in the file's pose, with the lowest point at a height [m], shape (13,); `spin` is in the body frame."""
        state = np.concatenate([np.zeros(3), self.pose, velocity, rotate(self.pose, spin)])
        state[1] = height - (self.lowest(state[np.newaxis])[0] if self.parts else 0.0)
        return state

    def in_force(self, start: Array, times: Array, gravity: float) -> Array:
        """The exact motion with the settings in force, shape (n, 13)."""
        weight = -gravity * (1.0 - self.lifted) * UP
        free = (self.mass, self.inertia, weight, self.resistance)
        return free_motion(times, start, *free, armature=self.armature, centre=self.offset)

    def fallen(self, time: float) -> float:
        """The exact distance fallen from rest with the settings in force [m], after a time [s]."""
        if not self.offset.any() and not self.falls.cubic:
            return float(fall(time, self.gravity * (1.0 - self.lifted), self.mass, self.armature, *self.falls[:2])[0])
        return float(-self.in_force(self.start(), np.array([0.0, time]), self.gravity)[-1, 1] + self.start()[1])

    def _keeps_axis(self, axis: int) -> bool:
        """Whether damping slows a spin about a principal axis without turning it away: with several links its torque is another one."""
        spin = self.principal[1][:, axis]
        _, torque = self.resistance(STILL, spin)
        return not self.offset.any() and bool(np.linalg.norm(np.cross(spin, torque)) <= ALONG * np.linalg.norm(torque))

    def spun(self, axis: int, speed: float, time: float) -> float:
        """The exact speed of a spin about a principal axis with the settings in force [rad/s], after a time [s]."""
        moments, axes = self.principal
        if self._keeps_axis(axis) and not self.spins[axis].cubic:
            return float(spin_about_axis(time, speed, moments[axis], self.armature, *self.spins[axis][:2]))
        start = self.start(spin=speed * axes[:, axis])
        return float(np.linalg.norm(self.in_force(start, np.array([0.0, time]), 0.0)[-1, SPIN]))

    def slowed(self, axis: int, speed: float) -> float:
        """The exact time after which a spin about a principal axis is 1/e of its start [s]; infinite if the settings do not slow it."""
        moments, axes = self.principal
        tau = time_constant(speed, moments[axis], self.armature, *self.spins[axis])
        if self._keeps_axis(axis) or math.isinf(tau):
            return tau
        times = np.linspace(0.0, 4.0 * tau, 4001)
        return time_of_decay(times, np.linalg.norm(self.in_force(self.start(spin=speed * axes[:, axis]), times, 0.0)[:, SPIN], axis=1))

    @property
    def points(self) -> Array:
        """Points that bound the body, relative to the centre of mass, in the body frame [m], shape (n, 3)."""
        corners = [(part.shape.hull[:, np.newaxis] + DIRECTIONS * part.shape.semi_axes).reshape(-1, 3) for part in self.parts]
        return np.concatenate([part.position + rotate(part.turn, own) for part, own in zip(self.parts, corners, strict=True)])

    @property
    def solid(self) -> MassProperties | None:
        """Those of a body of the same mass, spread evenly over the geometries."""
        parts = self.colliding
        volumes = [VOLUMES[part.shape.shape](part.shape) for part in parts]
        if not parts or not min(volumes) > 0.0:
            return None
        centre = np.average([part.position for part in parts], axis=0, weights=volumes)
        found = np.zeros((3, 3))
        for part, share in zip(parts, np.array(volumes) / sum(volumes), strict=True):
            axes, arm = rotate(part.turn, AXES).T, part.position - centre
            about = axes @ part.shape.inertia_tensor @ axes.T + arm @ arm * np.eye(3) - np.outer(arm, arm)
            found += self.mass * share * about
        return MassProperties(self.mass, centre + self.offset, found)

    @abstractmethod
    def changed(self, changes: Changes) -> "LooseBody":
        """The body with other settings."""

    @cached_property
    def tried(self) -> Callable[[tuple[str, ...], float], "LooseBody"]:
        """The function from settings and a time step [s] to the body with their remedies and that step in its file, made once."""

        @cache
        def body(settings: tuple[str, ...], dt: float) -> LooseBody:
            changes = {**self.changes(settings), **({"timestep": dt} if dt != self.dt else {})}
            return self.changed(changes) if changes else self

        return body

    def changes(self, settings: Sequence[str]) -> Changes:
        """The changes of the remedies of some settings."""
        return {name: value for setting in settings for name, value in self.remedies[setting].items()}

    @cached_property
    def settled(self) -> Array:
        """`put_down` at the file's time step."""
        return self.put_down(self.dt)

    def put_down(self, dt: float) -> Array:
        """The states of the body that is put down in the file's pose, over three seconds in time steps of dt [s], shape (n, 13).

        It begins where the contact does.
        """
        weight, start = -self.gravity * UP, self.start(height=self.margin)
        found: Array = self.motions(start[np.newaxis], dt, math.ceil(SETTLED / dt), weight, floor=True)[0]
        return found

    @abstractmethod
    def patch(self, changes: Changes, dt: float) -> str:
        """What to write for changes and a time step [s], in the words of the file, and where."""

    @abstractmethod
    def for_contact(self, restitution: float | None, friction: float | None, dt: float) -> Changes:
        """The changes that give coefficients of restitution and of friction at a time step [s], those of `dropspin calibrate`."""

    @property
    def likeness(self) -> tuple[object, ...]:
        """Something that equal bodies have in common, which have the same answers; empty if that is not known."""
        return ()

    def elsewhere(self, dt: float, changes: Changes) -> tuple[int, bool]:
        """The number of other bodies that changes apply to as well, and whether the whole model runs with them."""
        return 0, True

    @abstractmethod
    def motions(self, starts: Array, dt: float, steps: int, gravity: Array, *, floor: bool) -> Array:
        """States after each step, the starts first.

        Args:
            starts: The states at t = 0, of the centre of mass, shape (size, 13).
            dt: Time step [s].
            steps: Number of steps.
            gravity: Acceleration [m/s²], shape (3,).
            floor: Whether the surface is there.

        Returns:
            States, shape (size, 1 + steps, 13).

        Raises:
            Diverged: The simulation broke down.
        """
