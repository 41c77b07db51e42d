"""A body falls and strikes the floor with a corner, an edge or as a ball, again and again: flight, one impulse, flight.

The impulse is that of `impact_laws`: normal without friction, the note's eq 17 where the floor grips, Coulomb's for a ball; or that of the
law asked for.

Source: E. T. Whittaker, Analytical Dynamics, section 95 (impact of smooth and of perfectly rough bodies); H. Wang, eq 17.
Valid for: one corner alone touches, or the two of an edge that meet the floor at once and with one velocity, before and after; a ball with
any spin; a Coulomb coefficient for a ball of equal moments only, or by the law asked for; no damping; from the start to the tenth impact
at most, to an impact that is not of this kind, to one after which the body stays on the floor, or to where a disturbance of 1e-10 rad/s at
the start has grown to 1e-6, whichever comes first.
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
from scenarios.trajectory import Trajectory
from scenarios.truths.flight import flight_states
from scenarios.truths.impact_laws import Law, law_of, velocities_after
from scenarios.truths.truth import Impact, States, Truth

Array = NDArray[np.float64]

UP = np.array([0.0, 1.0, 0.0])
CHUNK = 4000  # samples of the height at a time, in search of an impact
FINEST_ANGLE = 0.02  # rad between two samples: a corner moves by less than 1e-4 of the body's size off a straight line
MOST_CHUNKS = 1000
HALVINGS = 60
ONE_CORNER = 1e-9  # of the body's size: how far above the corner that touches another one touches too
MOST_IMPACTS = 10
SHORTEST_FLIGHT = 1e-7  # s; impacts that come faster pile up, as at Zeno's time
DISTURBANCE = 1e-10  # rad/s, of the start
SPIN_OF_ONE = np.array([0.0] * 10 + [0.48, -0.6, 0.64])
MOST_GROWTH = 1e4  # of a disturbance: beyond it 1e-10 has become 1e-6, and no engine could be told wrong from unlucky


WORDS = {
    "normal": "normal impulse",
    "poisson": "Poisson's restitution",
    "clamped": "restitution that adds no energy",
    "coulomb": "Coulomb's friction",
}


class TooLong(Exception):
    """So many turns before the impact that it is not looked for."""


def corner_impact(scene: Scenario, law: Law | None = None) -> Truth | None:
    """The truth of a drop on a corner, an edge or as a ball, impact after impact, as far as it can be trusted.

    Args:
        scene: The scene.
        law: The impact law; the floor's own by default.
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
            course = _trusted(course, _follow(scene, scene.initial_state + DISTURBANCE * SPIN_OF_ONE, law))
    except TooLong:
        return None
    if course.horizon == 0.0 or (not course.events and course.horizon < scene.duration):
        return None  # it stays in contact from the start, or the first impact is not of this kind
    if not course.events:
        return Truth("flight", "free flight that ends above the floor", course.states, horizon=course.horizon)
    meant = WORDS[law] if law != "note" else "eq 15" if floor.friction == "none" else "sticking impulse, eq 17"
    points = len(_touching(scene, course.events[0].before))
    where = "ball" if isinstance(scene.body, Sphere) else {1: "corner", 2: "edge"}.get(points, "face")
    count = "one" if len(course.events) == 1 else str(len(course.events))
    statement = f"free rotor and parabola, {count} {where} impact{'s' if len(course.events) > 1 else ''} ({meant})"
    return Truth(f"{where}-impact", statement, course.states, course.events, course.horizon)


def _slides_one_way(scene: Scenario) -> bool:
    """Whether friction cannot turn the sliding aside during an impact: a ball of three equal moments."""
    return isinstance(scene.body, Sphere) and float(np.ptp(np.linalg.eigvalsh(scene.body.inertia_tensor))) == 0.0


@dataclass(frozen=True, eq=False)
class _Course:
    """Flights from one impact to the next, until `horizon` [s]."""

    flights: tuple[States, ...]
    events: tuple[Impact, ...]
    horizon: float

    def states(self, t: Array) -> Array:
        """The flight that each time belongs to; an impact's own time is that of the flight before."""
        begins = np.array([0.0, *(event.time for event in self.events)])
        which = np.maximum(np.searchsorted(begins, t, side="left") - 1, 0)
        rows = np.empty((len(t), 13))
        for number, flight in enumerate(self.flights):
            mine = which == number
            rows[mine] = flight(t[mine] - begins[number])
        return rows


def _follow(scene: Scenario, start: Array, law: Law) -> _Course:
    """From impact to impact, until the scene ends, the body stays on the floor, or an impact is not of this kind."""
    assert scene.floor is not None
    inertia, g = scene.body.inertia_tensor, scene.acceleration
    flights, now, state = [flight_states(start, inertia, g)], 0.0, start
    events: list[Impact] = []
    while True:
        wait = _next_impact(scene, state, flights[-1], scene.duration - now, leaves=bool(events))
        if wait is None:
            return _Course(tuple(flights), tuple(events), scene.duration)
        if events and (len(events) == MOST_IMPACTS or wait < SHORTEST_FLIGHT):
            return _Course(tuple(flights), tuple(events), now + wait)
        now, before = now + wait, flights[-1](np.array([wait]))[0]
        touching = _touching(scene, before)
        after = before.copy()
        after[7:13] = velocities_after(before, touching.mean(axis=0), scene.body.mass, inertia, scene.floor, law)
        if not (_move_alike(touching, before) and _move_alike(touching, after)):
            return _Course(tuple(flights), tuple(events), now)
        events.append(Impact(now, before, after))
        flights.append(flight_states(after, inertia, g))
        state = after
        if not _leave(touching, after):
            return _Course(tuple(flights), tuple(events), now)


def _trusted(course: _Course, disturbed: _Course) -> _Course:
    """The course up to the impact after which a disturbance of the start has grown beyond what can be trusted."""
    for number, event in enumerate(course.events):
        apart = math.inf
        if number < len(disturbed.events):
            apart = float(np.abs(disturbed.events[number].after[7:13] - event.after[7:13]).max())
        if number > 0 and apart > MOST_GROWTH * DISTURBANCE:
            return _Course(course.flights[: number + 1], course.events[:number], event.time)
    return course


def _next_impact(scene: Scenario, start: Array, states: States, duration: float, leaves: bool) -> float | None:
    """When the lowest point next comes down through the floor, from a state at or above it; None if not within `duration`.

    `leaves` says that it just leaves the floor, after an impact.
    """
    from scipy.optimize import brentq, minimize_scalar

    def height(t: Array) -> Array:
        return lowest_height(scene, Trajectory.from_states(t, states(t)))

    def at(t: float) -> float:
        return float(height(np.array([t]))[0])

    on_floor = TOUCHING * scene.body.size
    if not leaves and at(0.0) <= on_floor and _descends(scene, start):
        return 0.0
    left = leaves or at(0.0) > on_floor  # a body that stands on the floor must leave it before it can come down again
    step = min(duration / CHUNK, FINEST_ANGLE / max(_fastest_spin(scene, start), 1e-300))
    chunks = 0
    for begin, end in _within_reach(scene, start, duration):
        left = left or begin > 0.0
        now = begin
        while now < end:
            t = np.minimum(now + np.arange(CHUNK + 2) * step, end)
            h = height(t)
            if leaves and now == 0.0:
                if h[1] < 0.0:
                    return _within_first_sample(at, float(t[1]))
                h[0] = 0.5 * h[1]  # above the floor, whatever rounding says of the moment it leaves
            for n in range(len(t) - 1):
                left = left or h[n] > on_floor
                dips = n > 0 and h[n] < min(h[n - 1], h[n + 1]) and h[n] < FINEST_ANGLE**2 * scene.body.size
                if left and h[n + 1] < 0.0 <= h[n]:
                    return float(brentq(at, t[n], t[n + 1], xtol=1e-15, rtol=8.9e-16))
                if left and dips:
                    lowest = minimize_scalar(at, bounds=(t[n - 1], t[n + 1]), method="bounded", options={"xatol": 1e-12})
                    if lowest.fun < -on_floor:
                        return float(brentq(at, t[n - 1], lowest.x, xtol=1e-15, rtol=8.9e-16))
            now, chunks = now + CHUNK * step, chunks + 1
            if chunks > MOST_CHUNKS:
                raise TooLong
    return None


def _within_first_sample(at: Callable[[float], float], end: float) -> float:
    """When a body that leaves the floor is back, sooner than the first sample of its height."""
    from scipy.optimize import brentq

    above = end
    for _ in range(HALVINGS):
        below, above = above, 0.5 * above
        if at(above) > 0.0:
            return float(brentq(at, above, below, xtol=1e-15, rtol=8.9e-16))
    return 0.0


def _within_reach(scene: Scenario, start: Array, duration: float) -> list[tuple[float, float]]:
    """The times [s] at which the centre is so low that a corner may touch the floor: x_y(t) below the body's size."""
    reach = 1.001 * scene.body.size  # a ball's own reach ends where it touches, which rounding may miss
    parabola = [0.5 * scene.acceleration[1], start[8], start[1] - reach]
    crossings = sorted(float(root.real) for root in np.roots(parabola) if root.imag == 0.0 and 0.0 < root.real < duration)
    edges = [0.0, *crossings, duration]
    return [(begin, end) for begin, end in pairwise(edges) if np.polyval(parabola, 0.5 * (begin + end)) < 0.0]


def _descends(scene: Scenario, state: Array) -> bool:
    """Whether any of the points on the floor goes down, or stays, pulled down."""
    slowest = float(_rising(_touching(scene, state), state).min())
    return slowest < -_no_speed(scene, state) or (abs(slowest) <= _no_speed(scene, state) and scene.acceleration[1] <= 0.0)


def _fastest_spin(scene: Scenario, state: Array) -> float:
    """No free motion from this state spins faster: |ω| <= |L| over the least moment [rad/s]."""
    inertia = scene.body.inertia_tensor
    momentum = inertia @ unrotate(state[3:7], state[10:13])
    return float(np.linalg.norm(momentum) / np.linalg.eigvalsh(inertia)[0])


def _touching(scene: Scenario, state: Array) -> Array:
    """Offsets from the centre of mass of the points that are lowest, shape (n, 3)."""
    offsets = rotate(state[3:7], scene.body.vertices)
    lowest = offsets[offsets[:, 1] <= offsets[:, 1].min() + ONE_CORNER * scene.body.size]
    return lowest - scene.body.rounding * UP


def _leave(points: Array, state: Array) -> bool:
    """Whether all of these points go up."""
    return bool(_rising(points, state).min() > 1e-12 * np.linalg.norm(state[7:10]))


def _rising(points: Array, state: Array) -> Array:
    """Upward velocity [m/s] of points of the body, shape (n,)."""
    upward: Array = state[8] + np.cross(state[10:13], points)[:, 1]
    return upward


def _no_speed(scene: Scenario, state: Array) -> float:
    return float(1e-12 * (np.linalg.norm(state[7:10]) + scene.body.size * np.linalg.norm(state[10:13])))


def _move_alike(points: Array, state: Array) -> bool:
    """Whether points of the body have one velocity, so that one impulse amid them does for all what one at each would do."""
    velocities = state[7:10] + np.cross(state[10:13], points)
    return bool(np.ptp(velocities, axis=0).max() <= 1e-9 * np.linalg.norm(velocities, axis=1).max())
