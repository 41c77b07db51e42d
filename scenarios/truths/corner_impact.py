"""A body falls and strikes the floor repeatedly, with a corner, an edge or as a ball: flight, one impulse, flight.

The impulse is that of `impact_laws`: normal without friction, eq 17 of Wang's lecture note with infinite friction, Coulomb's for a ball; or
that of a given law.

Source: E. T. Whittaker, Analytical Dynamics, section 95 (impact of smooth and of perfectly rough bodies); H. Wang, eq 17.
Valid for: one corner touches, or the two of an edge that meet the floor at once and have one velocity, before and after; a ball with any
spin; a Coulomb coefficient for a ball of equal moments only, or by a given law; no damping. Valid from the start to the tenth impact at
most, to an impact that is not of this kind, to one after which the body stays on the floor, or to where a disturbance of 1e-10 rad/s at the
start has grown to 1e-6, whichever comes first.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scenarios.body import Sphere
from scenarios.mechanics import lowest_height
from scenarios.model import TOUCHING, Scenario
from scenarios.rotations import rotate, unrotate
from scenarios.state import ORIENTATION, RATES, SPIN, UP, VELOCITY
from scenarios.trajectory import Trajectory
from scenarios.truths.flight import flight_states
from scenarios.truths.impact_laws import Law, law_of, velocities_after
from scenarios.truths.truth import Impact, States, Truth

Array = NDArray[np.float64]

CHUNK_SIZE = 4000  # samples of the height at a time, in search of an impact
MAX_CHUNKS = 1000
MAX_SAMPLE_ANGLE = 0.02  # rad between two samples; a corner then deviates from a straight line by less than 1e-4 of the body's size
MAX_HALVINGS = 60  # of the first sample's time
CORNER_TOLERANCE = 1e-9  # of the body's size; corners at most this much higher than the lowest touch too
MAX_IMPACTS = 10
MIN_FLIGHT_TIME = 1e-7  # s; faster impacts accumulate, as at Zeno's time
DISTURBANCE = 1e-10  # rad/s, of the start
DISTURBED_DIRECTION = np.array([0.0] * 10 + [0.48, -0.6, 0.64])
MAX_GROWTH = 1e4  # of the disturbance, to 1e-6; beyond it an engine's error cannot be distinguished from the growth of rounding

LAW_NAMES = {
    "normal": "normal impulse",
    "poisson": "Poisson's restitution",
    "clamped": "restitution that adds no energy",
    "coulomb": "Coulomb's friction",
}


class TooLong(Exception):
    """The body turns so often before the impact that the search gives up."""


def corner_impact(scene: Scenario, law: Law | None = None) -> Truth | None:
    """The exact solution of a drop on a corner, an edge or as a ball, up to where a disturbance has grown too much.

    Args:
        scene: The scene.
        law: The impact law; by default the floor's.
    """
    floor = scene.floor
    if floor is None or scene.damping is not None:
        return None
    if law is None and not isinstance(floor.friction, str) and not _slides_one_way(scene):
        return None
    law = law or law_of(floor)
    try:
        course = _follow(scene, scene.initial_state, law)
        if len(course.events) > 1:
            course = _until_sensitive(course, _follow(scene, scene.initial_state + DISTURBANCE * DISTURBED_DIRECTION, law))
    except TooLong:
        return None
    if course.horizon == 0.0 or (not course.events and course.horizon < scene.duration):
        return None  # the body stays in contact from the start, or the first impact is not of this kind
    if not course.events:
        return Truth("flight", "free flight that ends above the floor", course.states, horizon=course.horizon)
    impulse = LAW_NAMES[law] if law != "note" else "eq 15" if floor.friction == "none" else "sticking impulse, eq 17"
    points = len(_touching(scene, course.events[0].before))
    where = "ball" if isinstance(scene.body, Sphere) else {1: "corner", 2: "edge"}.get(points, "face")
    count = "one" if len(course.events) == 1 else str(len(course.events))
    statement = f"free rotor and parabola, {count} {where} impact{'s' if len(course.events) > 1 else ''} ({impulse})"
    return Truth(f"{where}-impact", statement, course.states, course.events, course.horizon)


def _slides_one_way(scene: Scenario) -> bool:
    """Whether the direction of sliding cannot change during an impact, as for a ball of three equal moments."""
    return isinstance(scene.body, Sphere) and float(np.ptp(np.linalg.eigvalsh(scene.body.inertia_tensor))) == 0.0


@dataclass(frozen=True, eq=False)
class _Course:
    """Flights from one impact to the next, until `horizon` [s]."""

    flights: tuple[States, ...]
    events: tuple[Impact, ...]
    horizon: float

    def states(self, t: Array) -> Array:
        """The states at times [s]; the time of an impact belongs to the flight before it."""
        begins = np.array([0.0, *(event.time for event in self.events)])
        which = np.maximum(np.searchsorted(begins, t, side="left") - 1, 0)
        rows = np.empty((len(t), 13))
        for number, flight in enumerate(self.flights):
            mine = which == number
            rows[mine] = flight(t[mine] - begins[number])
        return rows


def _follow(scene: Scenario, start: Array, law: Law) -> _Course:
    """The course until the scene ends, the body stays on the floor, or an impact is not of this kind."""
    assert scene.floor is not None
    inertia, g = scene.body.inertia_tensor, scene.acceleration
    flights, now, state = [flight_states(start, inertia, g)], 0.0, start
    events: list[Impact] = []
    while True:
        wait = _next_impact(scene, state, flights[-1], scene.duration - now, leaves=bool(events))
        if wait is None:
            return _Course(tuple(flights), tuple(events), scene.duration)
        if events and (len(events) == MAX_IMPACTS or wait < MIN_FLIGHT_TIME):
            return _Course(tuple(flights), tuple(events), now + wait)
        now, before = now + wait, flights[-1](np.array([wait]))[0]
        touching = _touching(scene, before)
        after = before.copy()
        after[RATES] = velocities_after(before, touching.mean(axis=0), scene.body.mass, inertia, scene.floor, law)
        if not (_have_one_velocity(touching, before) and _have_one_velocity(touching, after)):
            return _Course(tuple(flights), tuple(events), now)
        events.append(Impact(now, before, after))
        flights.append(flight_states(after, inertia, g))
        state = after
        if not _leave(touching, after):
            return _Course(tuple(flights), tuple(events), now)


def _until_sensitive(course: _Course, disturbed: _Course) -> _Course:
    """The course up to the impact after which the disturbance of the start has grown by more than `MAX_GROWTH`."""
    for number, event in enumerate(course.events):
        difference = math.inf
        if number < len(disturbed.events):
            difference = float(np.abs(disturbed.events[number].after[RATES] - event.after[RATES]).max())
        if number > 0 and difference > MAX_GROWTH * DISTURBANCE:
            return _Course(course.flights[: number + 1], course.events[:number], event.time)
    return course


def _next_impact(scene: Scenario, start: Array, states: States, duration: float, leaves: bool) -> float | None:
    """Time [s] at which the lowest point next descends through the floor; None if it does not within `duration`.

    Args:
        scene: The scene.
        start: A state at or above the floor, shape (13,).
        states: The flight from it.
        duration: Length of the search [s].
        leaves: Whether the body leaves the floor at the start, after an impact.
    """

    def height(t: Array) -> Array:
        return lowest_height(scene, Trajectory.from_states(t, states(t)))

    def at(t: float) -> float:
        return float(height(np.array([t]))[0])

    on_floor = TOUCHING * scene.body.size
    if not leaves and at(0.0) <= on_floor and _descends(scene, start):
        return 0.0
    left = leaves or at(0.0) > on_floor  # a body that stands on the floor must leave it before it can descend again
    step = min(duration / CHUNK_SIZE, MAX_SAMPLE_ANGLE / max(_fastest_spin(scene, start), 1e-300))
    chunks = 0
    for begin, end in _within_reach(scene, start, duration):
        left = left or begin > 0.0
        now = begin
        while now < end:
            t = np.minimum(now + np.arange(CHUNK_SIZE + 2) * step, end)
            h = height(t)
            if leaves and now == 0.0:
                if h[1] < 0.0:
                    return _within_first_sample(at, float(t[1]))
                h[0] = 0.5 * h[1]  # above the floor, where rounding may put it below
            has_left = left | np.logical_or.accumulate(h[:-1] > on_floor)
            impact = _first_descent(at, t, h, has_left, on_floor, MAX_SAMPLE_ANGLE**2 * scene.body.size)
            if impact is not None:
                return impact
            left, now, chunks = bool(has_left[-1]), now + CHUNK_SIZE * step, chunks + 1
            if chunks > MAX_CHUNKS:
                raise TooLong
    return None


def _first_descent(
    at: Callable[[float], float], t: Array, h: Array, has_left: NDArray[np.bool_], on_floor: float, shallow: float
) -> float | None:
    """Time [s] of the first descent through the floor among samples, or between them, where the height has a minimum.

    Args:
        at: Height [m] at a time [s].
        t: Times of the samples [s], shape (n,).
        h: Heights at them [m], shape (n,).
        has_left: Whether the body has left the floor before each sample but the last, shape (n - 1,).
        on_floor: Height [m] up to which the body counts as touching the floor.
        shallow: Height [m] below which a minimum between samples may be below the floor.
    """
    from scipy.optimize import minimize_scalar

    crosses = (h[1:] < 0.0) & (h[:-1] >= 0.0)
    dips = np.zeros_like(crosses)
    dips[1:] = (h[1:-1] < np.minimum(h[:-2], h[2:])) & (h[1:-1] < shallow)
    for n in np.flatnonzero(has_left & (crosses | dips)):
        if crosses[n]:
            return _root(at, t[n], t[n + 1])
        lowest = minimize_scalar(at, bounds=(t[n - 1], t[n + 1]), method="bounded", options={"xatol": 1e-12})
        if lowest.fun < -on_floor:
            return _root(at, t[n - 1], lowest.x)
    return None


def _root(at: Callable[[float], float], begin: float, end: float) -> float:
    """Time [s] between two times of heights of different sign at which the height is 0."""
    from scipy.optimize import brentq

    return float(brentq(at, begin, end, xtol=1e-15, rtol=8.9e-16))


def _within_first_sample(at: Callable[[float], float], end: float) -> float:
    """Time [s] of the impact of a body that leaves the floor and is back before the first sample of its height."""
    above = end
    for _ in range(MAX_HALVINGS):
        below, above = above, 0.5 * above
        if at(above) > 0.0:
            return _root(at, above, below)
    return 0.0


def _within_reach(scene: Scenario, start: Array, duration: float) -> list[tuple[float, float]]:
    """The intervals [s] in which the centre is low enough for a corner to touch the floor: x_y(t) below the body's size."""
    reach = 1.001 * scene.body.size  # a ball touches at exactly this height, which rounding may miss
    parabola = [0.5 * scene.acceleration[1], start[8], start[1] - reach]
    crossings = sorted(float(root.real) for root in np.roots(parabola) if root.imag == 0.0 and 0.0 < root.real < duration)
    edges = [0.0, *crossings, duration]
    return [(begin, end) for begin, end in pairwise(edges) if np.polyval(parabola, 0.5 * (begin + end)) < 0.0]


def _descends(scene: Scenario, state: Array) -> bool:
    """Whether a point on the floor descends, or rests and is not pulled upwards."""
    slowest = float(_rising(_touching(scene, state), state).min())
    return slowest < -_no_speed(scene, state) or (abs(slowest) <= _no_speed(scene, state) and scene.acceleration[1] <= 0.0)


def _fastest_spin(scene: Scenario, state: Array) -> float:
    """Upper bound of the spin in a free motion from this state, |L| over the least moment [rad/s]."""
    inertia = scene.body.inertia_tensor
    momentum = inertia @ unrotate(state[ORIENTATION], state[SPIN])
    return float(np.linalg.norm(momentum) / np.linalg.eigvalsh(inertia)[0])


def _touching(scene: Scenario, state: Array) -> Array:
    """Offsets of the lowest points from the centre of mass, shape (n, 3)."""
    offsets = rotate(state[ORIENTATION], scene.body.vertices)
    lowest = offsets[offsets[:, 1] <= offsets[:, 1].min() + CORNER_TOLERANCE * scene.body.size]
    return lowest - scene.body.rounding * UP


def _leave(points: Array, state: Array) -> bool:
    """Whether all of these points ascend."""
    return bool(_rising(points, state).min() > 1e-12 * np.linalg.norm(state[VELOCITY]))


def _rising(points: Array, state: Array) -> Array:
    """Upward velocity [m/s] of points of the body, shape (n,)."""
    upward: Array = state[8] + np.cross(state[SPIN], points)[:, 1]
    return upward


def _no_speed(scene: Scenario, state: Array) -> float:
    """Speed [m/s] up to which a point counts as at rest."""
    return float(1e-12 * (np.linalg.norm(state[VELOCITY]) + scene.body.size * np.linalg.norm(state[SPIN])))


def _have_one_velocity(points: Array, state: Array) -> bool:
    """Whether points of the body have one velocity, so that one impulse at their mean is equivalent to one at each."""
    velocities = state[VELOCITY] + np.cross(state[SPIN], points)
    return bool(np.ptp(velocities, axis=0).max() <= 1e-9 * np.linalg.norm(velocities, axis=1).max())
