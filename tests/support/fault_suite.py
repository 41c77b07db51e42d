"""Detection power of the core catalogue: engines that are exact except for one planted fault, and correct engines of several kinds.

Every faulty engine must fail, no correct one may. `make faults` runs all of them, prints the check that detects each fault, and writes
docs/faults.md. The file is over 300 lines because it is one list of faults with the functions that plant them.
"""

import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table
from scipy.integrate import solve_ivp

from dropspin import scenarios
from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.running.run import run
from dropspin.scenarios.bodies import Box
from dropspin.scenarios.damping import Damping
from dropspin.scenarios.rotations import about, conjugate, multiply, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, RATES, SPIN, VELOCITY
from support.bouncing import Bouncing, bounced, coulomb, pyramid
from support.bouncing import with_restitution as with_restitution_of
from support.sampled import Sampled, undistorted

Array = np.ndarray
ROOT = Path(__file__).parents[2]


@dataclass(frozen=True)
class Made(Engine):
    """An exact engine with a change of the scene that it simulates, or of the states that it returns.

    It runs the core catalogue, and the scenes with an additional tag or name.
    """

    title: str = "exact"
    change: Callable[[Any], Any] = lambda scene: scene
    distort: Callable[..., Array] = undistorted
    claim: float | None = float("inf")
    vanishing: bool = False
    plant: Callable[[Any], Callable[..., Array]] | None = None
    extra: tuple[str, ...] = ()

    name = "made"

    @property
    def label(self):
        return self.title

    def order_in(self, scene):
        return self.claim if scene.floor is None else None

    def prepare(self, scene, dt):
        change = partial(self.change, dt=dt) if self.vanishing else self.change
        return Sampled(scene, dt, change(scene), self.distort if self.plant is None else self.plant(scene))


# Changes of the scene.


def with_floor(scene, **values):
    return scene if scene.floor is None else scene.model_copy(update={"floor": scene.floor.model_copy(update=values)})


def with_coefficient(factor):
    return lambda scene: with_floor(scene, friction=factor * scene.floor.friction) if is_rough(scene) else scene


def with_grip(coefficient):
    """A coefficient in place of infinite friction."""
    return lambda scene: (
        with_floor(scene, friction=coefficient) if scene.floor is not None and scene.floor.friction == "infinite" else scene
    )


def with_restitution(function):
    return lambda scene: scene if scene.floor is None else with_floor(scene, restitution=min(1.0, function(scene.floor.restitution)))


def vanishing_restitution(scene, dt):
    return scene if scene.floor is None else with_floor(scene, restitution=scene.floor.restitution * min(1.0, dt / 4e-3))


def with_gravity(matrix):
    def change(scene):
        if scene.gravity is None:
            return scene
        turned = tuple(float(part) for part in np.asarray(matrix) @ scene.acceleration)
        return scene.model_copy(update={"gravity": scene.gravity.model_copy(update={"acceleration": turned})})

    return change


def with_body(mass=1.0, moments=lambda m: m):
    def change(scene):
        inertia = tuple(float(moment) for moment in moments(np.diag(scene.body.inertia_tensor)))
        body = type(scene.body)(**scene.body.model_dump() | {"mass": mass * scene.body.mass, "inertia": inertia})
        return scene.model_copy(update={"body": body})

    return change


def with_spin(function):
    def change(scene):
        state = scene.initial_state
        state[SPIN] = function(state[SPIN], state[ORIENTATION])
        return scene.starting_at(state)

    return change


def with_damping(**rates):
    def change(scene):
        old = scene.damping or Damping()
        added = {name: getattr(old, name) + rate for name, rate in rates.items()}
        return scene.model_copy(update={"damping": old.model_copy(update=added)}) if scene.floor is None else scene

    return change


def without_damping(scene):
    return scene.model_copy(update={"damping": None})


def hard_coded_gravity(scene):
    if scene.gravity is None:
        return scene
    return scene.model_copy(update={"gravity": scene.gravity.model_copy(update={"acceleration": (0.0, -9.8, 0.0)})})


def hard_coded_mass(scene):
    """1 kg, with the scene's moments of inertia."""
    return scene if scene.body.shape == "vertices" else with_body(mass=1.0 / scene.body.mass)(scene)


def principal_inertia(scene):
    """The inertia tensor without its products of inertia."""
    tensor = scene.body.inertia_tensor
    if np.count_nonzero(tensor) == np.count_nonzero(np.diag(tensor)):
        return scene
    moments = tuple(float(moment) for moment in np.diag(tensor))
    return scene.model_copy(update={"body": Box(shape="box", half_extents=(0.3, 0.3, 0.3), mass=scene.body.mass, inertia=moments)})


# Distortions of the states.


def late(rows, times, dt, truth):
    return np.vstack([rows[:1], rows[:-1]])


def late_velocities(rows, times, dt, truth):
    rows[1:, RATES] = rows[:-1, RATES].copy()
    return rows


def at_times(function):
    return lambda rows, times, dt, truth: truth(np.minimum(function(times, dt), truth.horizon)).states


def on_rows(function):
    """A distortion of each state and its time."""

    def distort(rows, times, dt, truth):
        return function(rows.copy(), times[:, None])

    return distort


def after_impacts(function):
    """A distortion that depends on the number of impacts before each state."""

    def distort(rows, times, dt, truth):
        impacts = np.searchsorted([event.time for event in truth.events], times, side="left")
        return function(rows, times, impacts, truth)

    return distort


def pushed(speed):
    def function(rows, times, impacts, truth):
        if truth.events:
            since = np.where(impacts > 0, times - truth.events[0].time, 0.0)
            rows[:, 0] += speed * since
            rows[impacts > 0, 7] += speed
        return rows

    return function


def lively(rows, times, impacts, truth):
    rows[:, 7:9] *= (1.0 + 5e-4 * impacts)[:, None]
    return rows


def without_spin(rows, times, impacts, truth):
    rows[impacts > 0, SPIN] = 0.0
    return rows


def lifted(rows, times, impacts, truth):
    rows[:, 1] += 1e-3 * impacts
    return rows


def turned(angle):
    def function(rows, t):
        extra = about(np.array([1.0, 0.0, 0.0]), angle(t[:, 0]))
        rows[:, ORIENTATION] = multiply(extra, rows[:, ORIENTATION])
        return rows

    return on_rows(function)


def swapped_quaternion(rows, t):
    rows[:, ORIENTATION] = rows[:, [6, 3, 4, 5]]
    return rows


def conjugated(rows, t):
    rows[:, 3:6] *= -1.0
    return rows


def body_frame_spin(rows, t):
    rows[:, SPIN] = unrotate(rows[:, ORIENTATION], rows[:, SPIN])
    return rows


def clamped_spin(rows, t):
    speed = np.linalg.norm(rows[:, SPIN], axis=1, keepdims=True)
    rows[:, SPIN] *= np.minimum(1.0, 100.0 / np.maximum(speed, 1e-300))
    return rows


def clamped_speed(rows, t):
    speed = np.linalg.norm(rows[:, VELOCITY], axis=1, keepdims=True)
    rows[:, VELOCITY] *= np.minimum(1.0, 3.0 / np.maximum(speed, 1e-300))
    return rows


def asleep(rows, t):
    slow = (np.linalg.norm(rows[:, VELOCITY], axis=1) < 0.5) & (np.linalg.norm(rows[:, SPIN], axis=1) < 0.9) & (t[:, 0] > 0.0)
    if slow.any():
        first = int(np.argmax(slow))
        rows[first:] = rows[first]
        rows[first:, RATES] = 0.0
    return rows


def drifting(rows, times, dt, truth):
    rows[:, 0] += 1e-6 * np.arange(len(rows))
    return rows


def noisy(rows, times, dt, truth):
    rows[:, POSITION] += 1e-5 * np.random.default_rng(0).normal(size=(len(rows), 3))
    return rows


def reset(rows, times, dt, truth):
    rows[int(0.7 * len(rows)) :] = rows[0]
    return rows


def not_a_number(rows, t):
    rows[t[:, 0] > 1.0] = np.nan
    return rows


def dead_from_the_second(rows, times, impacts, truth):
    """No restitution from the second impact on."""
    if len(truth.events) > 1:
        late = impacts > 1
        rows[late] = truth.events[1].after
        rows[late, RATES] = 0.0
    return rows


def frozen(rows, times, dt, truth):
    return np.tile(rows[0], (len(rows), 1))


def through_the_floor(rows, times, impacts, truth):
    if truth.events:
        first = truth.events[0]
        since = np.maximum(times - first.time, 0.0)[:, None]
        below = impacts > 0
        fallen = first.before[POSITION] + since * first.before[VELOCITY] + 0.5 * since**2 * np.array([0, -9.8, 0])
        rows[below, POSITION] = fallen[below]
        rows[below, VELOCITY] = (first.before[VELOCITY] + since * np.array([0, -9.8, 0]))[below]
    return rows


def single_precision(rows, times, dt, truth):
    return rows.astype(np.float32).astype(float)


# Faults of friction, on a level or sloped floor.


def is_rough(scene):
    return scene.floor is not None and not isinstance(scene.floor.friction, str)


def where_it_slides(function):
    """A distortion of the scenes in which the body starts on a rough floor: of the states, their times and the scene."""

    def plant(scene):
        if not is_rough(scene) or scene.starts_above_floor:
            return undistorted
        return lambda rows, times, dt, truth: function(rows.copy(), times[:, None], scene)

    return plant


def along_axes(rows, t, scene):
    """Each horizontal component of the velocity of a box is slowed by itself, with the whole friction."""
    if scene.body.shape != "box" or scene.acceleration[[0, 2]].any() or scene.start.angular_velocity != (0.0, 0.0, 0.0):
        return rows
    for axis in (0, 2):
        speed, slowed = rows[0, 7 + axis], scene.floor.friction * -scene.acceleration[1]
        until = np.minimum(t[:, 0], abs(speed) / slowed)
        rows[:, axis] = rows[0, axis] + speed * until - 0.5 * np.sign(speed) * slowed * until**2
        rows[:, 7 + axis] = speed - np.sign(speed) * slowed * until
    return rows


def pushing(rows, t, scene):
    """The deceleration with the wrong sign."""
    v = rows[0, VELOCITY].copy()
    rows[:, POSITION] = 2.0 * (rows[0, POSITION] + v * t) - rows[:, POSITION]
    rows[:, VELOCITY] = 2.0 * v - rows[:, VELOCITY]
    return rows


def rolling_resistance(rows, t, scene):
    """The speed of a ball decays by 0.5 % in a second."""
    if scene.body.shape == "sphere":
        rows[:, POSITION] -= 0.5 * 5e-3 * t * (rows[:, POSITION] - rows[0, POSITION])
        rows[:, 7:] *= 1.0 - 5e-3 * t
    return rows


def downhill(rows, t, scene):
    """A gain of 0.1 % of the velocity in a second, on slopes only."""
    if scene.acceleration[[0, 2]].any():
        rows[:, POSITION] += 0.5 * 1e-3 * t * (rows[:, POSITION] - rows[0, POSITION])
        rows[:, 7:] *= 1.0 + 1e-3 * t
    return rows


def attracted(rows, t, scene):
    """A hidden acceleration along the x axis of the world."""
    rows[:, 0] += 0.5e-3 * t[:, 0] ** 2
    rows[:, 7] += 1e-3 * t[:, 0]
    return rows


def one_sided(scene):
    """No friction on a body that slides along +z."""
    return with_floor(scene, friction="none") if is_rough(scene) and scene.start.velocity[2] > 0.0 else scene


def level(scene):
    """The component of gravity along the floor is dropped."""
    return with_gravity(np.diag([0.0, 1.0, 0.0]))(scene) if scene.floor is not None else scene


def hollow(scene):
    """2/3 instead of 2/5 of M r² for balls."""
    return with_body(moments=lambda m: m * 5.0 / 3.0)(scene) if scene.body.shape == "sphere" else scene


def landings(share):
    """Landings on an edge take only a share of the angular velocity that they should take."""

    def plant(scene):
        rocking = import_module("dropspin.scenarios.truths.rocking")  # the package has a function of this name
        ratio = rocking._ratio
        with mock.patch.object(rocking, "_ratio", lambda *edges: 1.0 - share * (1.0 - ratio(*edges))):
            wrong = None if scene.floor is None else rocking.rocking(scene, scene.floor)
        if wrong is None:
            return undistorted
        return lambda rows, times, dt, truth: wrong(np.minimum(times, wrong.horizon)).states

    return plant


def at_rest_below(speed):
    """No restitution in impacts below a speed."""

    def change(scene):
        if scene.floor is None or scene.gravity is None or 2.0 * -scene.acceleration[1] * scene.clearance > speed**2:
            return scene
        return with_floor(scene, restitution=0.0)

    return change


@dataclass(frozen=True)
class Remembering(Made):
    """Exact except that each simulation turns the body by 1 mrad more than the one before in its process."""

    counted: list = field(default_factory=list, compare=False)

    def prepare(self, scene, dt):
        self.counted.append(None)
        angle = 1e-3 * len(self.counted)
        return Sampled(scene, dt, scene, turned(lambda t: angle + 0 * t))


@dataclass(frozen=True)
class WrongRotor(Made):
    """Exact except for the gyroscopic torque, of which it uses a share, in free flight without damping."""

    share: float = 1.0

    def prepare(self, scene, dt):
        if scene.floor is not None or scene.damping is not None or not any(scene.start.angular_velocity):
            return Sampled(scene, dt, scene, undistorted)
        tensor = scene.body.inertia_tensor
        inverse = np.linalg.inv(tensor)
        start = scene.initial_state

        def rates(t, y):
            q, spin = y[:4] / np.linalg.norm(y[:4]), y[4:]
            turning = 0.5 * multiply(q, np.array([*spin, 0.0]))
            return np.concatenate([turning, -self.share * inverse @ np.cross(spin, tensor @ spin)])

        begin = np.concatenate([start[ORIENTATION], unrotate(start[ORIENTATION], start[SPIN])])
        steps = scene.steps(dt)
        times = dt * np.arange(steps + 1)
        fast = np.linalg.norm(start[SPIN]) * scene.duration > 1000.0
        if fast:  # about a principal axis, where the gyroscopic term is 0
            return Sampled(scene, dt, scene, undistorted)
        solved = solve_ivp(rates, (0.0, times[-1]), begin, "DOP853", t_eval=times, rtol=1e-12, atol=1e-13)
        q = (solved.y[:4] / np.linalg.norm(solved.y[:4], axis=0)).T

        def distort(rows, at, step, truth):
            rows, known = rows.copy(), np.minimum(np.arange(len(rows)), steps)  # whoever times steps may take more than the scene has
            rows[:, ORIENTATION] = q[known]
            rows[:, SPIN] = rotate(q[known], solved.y[4:].T[known])
            return rows

        return Sampled(scene, dt, scene, distort)


@dataclass(frozen=True)
class DampedAxis(Made):
    """Exact except for a damping of 0.05 1/s about the body's x axis, in free flight of slow bodies."""

    def prepare(self, scene, dt):
        if scene.floor is not None or np.linalg.norm(scene.start.angular_velocity) * scene.duration > 1000.0:
            return Sampled(scene, dt, scene, undistorted)
        states = integrated(scene, dt, lambda v, spin: (0.0 * v, -np.array([0.05, 0.0, 0.0]) * spin))
        return Sampled(scene, dt, scene, lambda rows, at, step, truth: states[: len(rows)].copy())


def integrated(scene, dt, added, method="DOP853"):
    """The states of free flight by an accurate integrator, with added accelerations: of the velocity, and of the spin in the body frame."""
    tensor, g = scene.body.inertia_tensor, scene.acceleration
    inverse, start = np.linalg.inv(tensor), scene.initial_state
    k, kappa = (scene.damping.linear, scene.damping.angular) if scene.damping else (0.0, 0.0)

    def rates(t, y):
        q, v, spin = y[ORIENTATION], y[VELOCITY], y[SPIN]
        turning, (pushed, spun) = 0.5 * multiply(q, np.array([*spin, 0.0])), added(v, spin)
        return np.concatenate([v, turning, g - k * v + pushed, -inverse @ np.cross(spin, tensor @ spin) - kappa * spin + spun])

    begin = start.copy()
    begin[SPIN] = unrotate(start[ORIENTATION], start[SPIN])
    times = dt * np.arange(scene.steps(dt) + 1)
    solved = solve_ivp(rates, (0.0, times[-1]), begin, method, t_eval=times, rtol=3e-14, atol=1e-14).y.T
    q = solved[:, ORIENTATION] / np.linalg.norm(solved[:, ORIENTATION], axis=1, keepdims=True)
    return np.hstack([solved[:, POSITION], q, solved[:, VELOCITY], rotate(q, solved[:, SPIN])])


@dataclass(frozen=True)
class Leaking(Made):
    """Exact except that each simulation begins 1 mm/s faster than the one before in its process."""

    counted: list = field(default_factory=list, compare=False)

    def prepare(self, scene, dt):
        self.counted.append(None)
        state = scene.initial_state
        state[7] += 1e-3 * (len(self.counted) - 1)
        return Sampled(scene, dt, scene.starting_at(state), undistorted)


# Faults of single steps and single impacts.


def kicked(steps):
    """A start with gravity in some additional steps."""

    def change(scene, dt):
        state = scene.initial_state
        state[VELOCITY] += steps * dt * scene.acceleration
        return scene.starting_at(state)

    return change


def jittering(times, dt):
    return times + 0.2 * dt * np.random.default_rng(0).uniform(-1.0, 1.0, len(times)) * (times > 0.0)


def late_positions(rows, times, dt, truth):
    rows[1:, POSITION] = rows[:-1, POSITION].copy()
    return rows


def half_precision_once(scene):
    """The state after a tenth of a second passes through half precision."""
    at = 0.1
    truth = scenarios.truth_for(scene)
    if truth is None or truth.horizon < at:
        return undistorted
    state = np.float16(truth(np.array([at])).states[0]).astype(float)
    try:
        rest = scenarios.truth_for(scene.starting_at(state))
    except scenarios.DropspinError:  # rounding has sunk it into the floor
        return undistorted
    if rest is None:
        return undistorted

    def distort(rows, times, dt, truth):
        later = times > at
        rows[later] = rest(np.minimum(times[later] - at, rest.horizon)).states
        return rows

    return distort


def tilted_floor(angle):
    """The floor is turned by an angle about the x axis, for balls that fall on it."""
    turn = about(np.array([1.0, 0.0, 0.0]), np.array(angle))

    def plant(scene):
        if scene.floor is None or scene.body.shape != "sphere" or not scene.starts_above_floor:
            return undistorted
        level = with_gravity(np.array([rotate(turn, axis) for axis in np.eye(3)]).T)(scene)
        state = level.initial_state
        for part in (POSITION, VELOCITY, SPIN):
            state[part] = rotate(turn, state[part])
        state[ORIENTATION] = multiply(turn, state[ORIENTATION])
        tilted = scenarios.truth_for(level.starting_at(state))
        if tilted is None:
            return undistorted

        def distort(rows, times, dt, truth):
            rows = tilted(np.minimum(times, tilted.horizon)).states
            for part in (POSITION, VELOCITY, SPIN):
                rows[:, part] = unrotate(turn, rows[:, part])
            rows[:, ORIENTATION] = multiply(conjugate(turn), rows[:, ORIENTATION])
            return rows

        return distort

    return plant


def bouncing_by(law):
    """Impacts of balls by a law."""

    def plant(scene):
        if Bouncing(title="", law=law).declines(scene) or scene.floor is None:
            return undistorted
        return lambda rows, times, dt, truth: bounced(scene, law, np.minimum(times, truth.horizon))

    return plant


def other_vertex(scene):
    """The impulse of the first impact of a box acts at the vertex opposite in its face."""
    truth = scenarios.truth_for(scene)
    if scene.floor is None or scene.body.shape == "sphere" or truth is None or not truth.events or not scene.starts_above_floor:
        return undistorted
    before, after, when = truth.events[0].before, truth.events[0].after.copy(), truth.events[0].time
    q, impulse = before[ORIENTATION], scene.body.mass * (after[VELOCITY] - before[VELOCITY])
    corners = rotate(q, scene.body.vertices)
    second = corners[np.argsort(corners[:, 1])[1]]
    spin = unrotate(q, np.cross(second, impulse))
    after[SPIN] = before[SPIN] + rotate(q, np.linalg.solve(scene.body.inertia_tensor, spin))
    rest = scenarios.truth_for(scene.model_copy(update={"floor": None}).starting_at(after))

    def distort(rows, times, dt, truth):
        later = times > when
        rows[later] = rest(times[later] - when).states
        return rows

    return distort if rest else undistorted


def doubled_at_first(scene, slip, speed, number):
    return coulomb(scene, slip, speed, number, 2.0 if number == 0 else 1.0)


def fault(title, **parts):
    return Made(title=title, **parts)


def sliding(title, **parts):
    return Made(title=title, extra=("friction",), **parts)


DEGREES = np.pi / 180
FAULTS = [
    fault("gravity 0.1 % too strong", change=with_gravity(1.001 * np.eye(3))),
    fault("gravity 1 % too weak", change=with_gravity(0.99 * np.eye(3))),
    fault("gravity 1 mrad off the vertical", change=with_gravity([[1, 1e-3, 0], [0, 1, 0], [0, 0, 1]])),
    fault("gravity along z instead of y", change=with_gravity([[1, 0, 0], [0, 0, 0], [0, 1, 0]])),
    fault("restitution 1 % too high", change=with_restitution(lambda e: 1.01 * e)),
    fault("restitution 0.3 % too high", change=with_restitution(lambda e: 1.003 * e)),
    fault("restitution 0.3 % too low", change=with_restitution(lambda e: 0.997 * e)),
    fault("restitution squared", change=with_restitution(lambda e: e * e)),
    fault("restitution used as the ratio of energies", change=with_restitution(np.sqrt)),
    fault("restitution ignored", change=with_restitution(lambda e: 0.0)),
    fault("restitution that vanishes as dt → 0", change=vanishing_restitution, vanishing=True),
    fault("friction omitted", change=lambda scene: with_floor(scene, friction="none")),
    fault("coefficient of friction 1 % too large", change=with_coefficient(1.01)),
    fault("infinite friction on every floor", change=lambda scene: with_floor(scene, friction="infinite")),
    fault("coefficient of friction 0.6 in place of infinite friction", change=with_grip(0.6)),
    fault("coefficient of friction 1 in place of infinite friction", change=with_grip(1.0)),
    fault("damping ignored", change=without_damping),
    fault("gravity of 9.8 m/s² along -y in every scene", change=hard_coded_gravity),
    fault("mass of 1 kg in every scene, correct inertia", change=hard_coded_mass),
    fault("products of inertia set to 0", change=principal_inertia),
    fault("mass 1 % too large, correct inertia", change=with_body(mass=1.01)),
    fault("inertia 1 % too large", change=with_body(moments=lambda m: 1.01 * m)),
    fault("moments of inertia about x and y swapped", change=with_body(moments=lambda m: m[[1, 0, 2]])),
    fault("moments of inertia 3 times too large, as for masses at the corners of a box", change=with_body(moments=lambda m: 3.0 * m)),
    WrongRotor(title="no gyroscopic term", share=0.0),
    WrongRotor(title="gyroscopic term with the wrong sign", share=-1.0),
    WrongRotor(title="gyroscopic term 1 % too small", share=0.99),
    fault("initial angular velocity taken as given in the body frame", change=with_spin(lambda w, q: rotate(q, w))),
    fault("initial angular velocity taken as given in degrees per second", change=with_spin(lambda w, q: DEGREES * w)),
    fault("angular velocity reported in the body frame", distort=on_rows(body_frame_spin)),
    fault("quaternion reported in the order w, x, y, z", distort=on_rows(swapped_quaternion)),
    fault("quaternion reported from world to body", distort=on_rows(conjugated)),
    fault("quaternion of length 1.0001", distort=on_rows(lambda rows, t: rows * np.array([1] * 3 + [1 + 1e-4] * 4 + [1] * 6))),
    fault("orientation wrong by 1 mrad", distort=turned(lambda t: 1e-3 + 0 * t)),
    fault("orientation drifts by 1e-5 rad/s", distort=turned(lambda t: 1e-5 * t)),
    fault("additional linear damping of 1e-3 1/s in free flight", change=with_damping(linear=1e-3)),
    fault("additional angular damping of 1e-3 1/s in free flight", change=with_damping(angular=1e-3)),
    fault("states reported one time step late", distort=late),
    fault("velocities reported one time step late", distort=late_velocities),
    fault("time runs 0.1 % too fast", distort=at_times(lambda t, dt: 1.001 * t)),
    fault("angular velocity clamped at 100 rad/s", distort=on_rows(clamped_spin)),
    fault("speed clamped at 3 m/s", distort=on_rows(clamped_speed)),
    fault("body stopped as soon as it is slower than 0.5 m/s", distort=on_rows(asleep)),
    fault("state in single precision", distort=single_precision),
    fault("0.1 % of energy gained at each bounce", distort=after_impacts(lively)),
    fault("horizontal velocity of 1 mm/s gained in the first impact", distort=after_impacts(pushed(1e-3))),
    fault("body lifted by 1 mm at each impact", distort=after_impacts(lifted)),
    fault("angular velocity set to 0 at the first impact", distort=after_impacts(without_spin)),
    fault("body stopped at the second impact", distort=after_impacts(dead_from_the_second)),
    fault("body falls through the floor", distort=after_impacts(through_the_floor)),
    fault("position drifts by 1e-6 m per time step", distort=drifting),
    fault("position with random noise of 1e-5 m", distort=noisy),
    fault("state reset to the initial one after 70 % of the run", distort=reset),
    fault("NaN after 1 s", distort=on_rows(not_a_number)),
    fault("body does not move", distort=frozen),
    fault("method of first order, claimed to be exact", distort=at_times(lambda t, dt: t * (1 + 0.1 * dt))),
    fault("method of second order, claimed to be of fourth order", distort=at_times(lambda t, dt: t * (1 + 10 * dt * dt)), claim=4.0),
    Remembering(title="orientation wrong by a further 1 mrad in each further simulation"),
    sliding("friction computed for each axis separately", plant=where_it_slides(along_axes)),
    sliding("no friction on bodies that slide along +z", change=one_sided),
    sliding("friction that accelerates the body along its slip", plant=where_it_slides(pushing)),
    sliding("balls on a rough floor lose 0.5 % of their speed per second", plant=where_it_slides(rolling_resistance)),
    sliding("bodies on slopes gain 0.1 % of their speed per second", plant=where_it_slides(downhill)),
    sliding("additional acceleration of 1 mm/s² along x on a rough floor", plant=where_it_slides(attracted)),
    sliding("component of gravity along the floor set to 0", change=level),
    sliding("balls with the moment of inertia 2/3 M r² of a hollow ball", change=hollow),
    fault("landing on an edge takes 1 % less angular velocity than it should", plant=landings(0.99), extra=("roll-prism-slope",)),
    fault("no restitution if the first impact is slower than 1 m/s", change=at_rest_below(1.0), extra=("bounce-elastic",)),
    fault("gravity of 9.81 instead of 9.8 m/s²", change=with_gravity(9.81 / 9.8 * np.eye(3))),
    fault("gravity acts twice in the first time step", change=kicked(1.0), vanishing=True),
    fault("time steps that vary at random by up to 20 %", distort=at_times(jittering)),
    fault("state rounded once to half precision, after 0.1 s", plant=half_precision_once),
    fault("positions reported one time step late", distort=late_positions),
    DampedAxis(title="additional angular damping about one axis of the body"),
    fault("floor tilted by 1 mrad under falling balls", plant=tilted_floor(1e-3)),
    fault(
        "restitution of balls that decreases with the impact speed",
        plant=bouncing_by(with_restitution_of(lambda e, speed: e / (1.0 + 0.02 * speed))),
    ),
    sliding("friction on balls doubled in the first impact", plant=bouncing_by(doubled_at_first)),
    sliding("friction pyramid instead of the friction cone in impacts of balls", plant=bouncing_by(pyramid)),
    fault("impulse at another vertex than the one that strikes", plant=other_vertex),
    Leaking(title="initial velocity 1 mm/s larger in each further simulation"),
    fault("moment of inertia about y 1 % too large", change=with_body(moments=lambda m: m * np.array([1.0, 1.01, 1.0]))),
    fault("three equal moments of inertia instead of the true ones", change=with_body(moments=lambda m: np.full(3, m.mean()))),
    fault(
        "mirrored motion: left-handed axes", distort=on_rows(lambda rows, t: rows * np.array([1, 1, -1, -1, -1, 1, 1, 1, 1, -1, -1, -1, 1]))
    ),
]


# Correct engines.


def other_sign(rows, times, dt, truth):
    rows[1::2, 3:7] *= -1.0
    return rows


def rounded(rows, times, dt, truth):
    return rows * (1.0 + 1e-15 * np.random.default_rng(0).normal(size=rows.shape))


def in_pieces(rows, times, dt, truth):
    """Evaluated in a hundred pieces."""
    pieces = [truth(part).states for part in np.array_split(np.minimum(times, truth.horizon), 100) if len(part)]
    return np.vstack(pieces)


@dataclass(frozen=True)
class Integrated(Made):
    """Free flight by an accurate integrator; the exact solution with a floor."""

    method: str = "DOP853"

    def prepare(self, scene, dt):
        if scene.floor is not None or np.linalg.norm(scene.start.angular_velocity) * scene.duration > 1000.0:
            return Sampled(scene, dt, scene, undistorted)
        states = integrated(scene, dt, lambda v, spin: (0.0 * v, 0.0 * spin), self.method)
        return Sampled(scene, dt, scene, lambda rows, at, step, truth: states[: len(rows)].copy())


@dataclass(frozen=True)
class Restarted(Made):
    """The exact solution, started again from its own state halfway."""

    def prepare(self, scene, dt):
        def distort(rows, times, step, truth):
            middle = len(rows) // 2
            if scene.floor is not None or middle == 0:
                return rows
            rest = scenarios.truth_for(scene.starting_at(rows[middle]))
            return np.vstack([rows[:middle], rest(times[middle:] - times[middle]).states])

        return Sampled(scene, dt, scene, distort)


@dataclass(frozen=True)
class Declared32(Made):
    """Single precision, declared."""

    precision = np.float32

    def prepare(self, scene, dt):
        # In single precision the tip of a top is not at rest, and such a start has no exact solution; that of the scene itself is as near.
        known = scene if scenarios.truth_for(scene) else scenarios.load(scene.name)
        return Sampled(scene, dt, known, self.distort)


@dataclass(frozen=True)
class NoFloors(Made):
    """Declines scenes with a floor."""

    def declines(self, scene):
        return "floors are not supported" if scene.floor is not None else None


SOUND = [
    Made(title="the exact solution, sampled", extra=("friction", "bounce-elastic")),
    Made(title="the exact solution with quaternions of alternating sign", distort=other_sign),
    Made(title="the exact solution with relative errors of 1e-15", distort=rounded),
    Made(title="the exact solution, evaluated in a hundred pieces", distort=in_pieces),
    Made(title="the exact solution, no order claimed", claim=None),
    Made(title="the exact solution, first order claimed", claim=1.0),
    Integrated(title="integration with DOP853 at a tolerance of 3e-14"),
    Restarted(title="the exact solution, restarted halfway from its own state"),
    Declared32(title="the exact solution in single precision, declared as such", distort=single_precision, extra=("friction",)),
    NoFloors(title="the exact solution without floors, which the engine declines"),
]
ENGINES = [*FAULTS, *SOUND]


def scenes_with(*wanted: str) -> list[str]:
    """The names of the scenes with one of these tags or names, without the ensemble: its members have no exact solution."""
    found = map(scenarios.load, scenarios.names())
    return [scene.name for scene in found if scene.ensemble is None and {scene.name, *scene.tags} & set(wanted)]


def failed_checks(number: int, scenes: Sequence[str] = ()) -> list[tuple[str, str]]:
    """The scenes, by default those that the engine is meant for, and the checks in them that it fails."""
    with np.errstate(all="ignore"):
        found = run(scenes or scenes_with("core", *ENGINES[number].extra), ENGINES[number], jobs=1)  # one engine on each processor
    bad = found.table[found.table["verdict"].isin(["failed", "crashed", "diverged"])]
    return [(row.scene, f"{row.metric} ({row.kind})" if row.metric else row.verdict) for row in bad.itertuples()]


def main() -> int:
    """Run all engines, print and write the table; 1 if a fault is missed or a correct engine fails."""
    total = len(ENGINES)
    with ProcessPoolExecutor() as pool:
        found = list(track(pool.map(failed_checks, range(total)), total=total, console=Console(stderr=True)))
    return report(found[: len(FAULTS)], found[len(FAULTS) :])


def report(caught: list[list[tuple[str, str]]], alarms: list[list[tuple[str, str]]]) -> int:
    """Print and write the first check that detects each fault, and the false alarms."""
    console = Console(width=150)
    table = Table("planted fault", "first failed check", "in", "checks failed", box=SIMPLE_HEAD)
    lines = ["| planted fault | first failed check | in scene | failed checks |", "|---|---|---|---|"]
    for engine, checks in zip(FAULTS, caught, strict=True):
        scene, check = checks[0] if checks else ("–", "not detected")
        table.add_row(engine.title, check, scene, str(len(checks)))
        lines.append(f"| {engine.title} | {check.replace('_', ' ')} | {scene} | {len(checks)} |")
    console.print(table)
    missed = sum(not checks for checks in caught)
    false = {engine.title: checks for engine, checks in zip(SOUND, alarms, strict=True) if checks}
    summary = f"{len(FAULTS) - missed} of {len(FAULTS)} faults are detected. {len(false)} of {len(SOUND)} correct engines fail a check."
    console.print(summary)
    for title, checks in false.items():
        console.print(f"false alarm of {title!r}: {checks}")
    sound = "; ".join(engine.title for engine in SOUND)
    write_section("planted", "\n".join(lines) + f"\n\n{summary} The correct engines are: {sound}.\n")
    return 1 if missed or false else 0


def write_section(name: str, text: str) -> None:
    """Replace what is between the marker of a section of docs/faults.md and the next end."""
    page = ROOT / "docs/faults.md"
    old = page.read_text(encoding="utf-8")
    start = old.index(f"<!-- {name} -->") + len(f"<!-- {name} -->\n")
    page.write_text(old[:start] + text + old[old.index("<!-- end -->", start) :], encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
