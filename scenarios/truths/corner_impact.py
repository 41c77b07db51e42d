"""A body falls and strikes the floor repeatedly, as a ball or with a corner or an edge: flight, impulse, flight, and so on.

The impulse is that of `impact_laws`: normal without friction, eq 17 of Wang's lecture note with infinite friction, Coulomb's for a ball; or
that of a given law.

Source: E. T. Whittaker, Analytical Dynamics, section 95 (impact of smooth and of perfectly rough bodies); H. Wang, eq 17.
Valid for: impacts of one corner, or of the two corners of an edge that strike the floor at once and have equal velocities before and after;
a ball with any spin; a Coulomb coefficient for a ball of equal moments only, or by a given law; no damping. Valid up to the first of these
events: the tenth impact; an impact that is not of this kind, in which the floor would have to pull (as eq 17 may demand of a corner that
slides fast), or after which the body stays on the floor; a time at which rounding determines whether the body touches the floor or when it
turns over; growth of an initial disturbance of 1e-10 rad/s to 1e-6.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scenarios.body import Sphere
from scenarios.model import TOUCHING, Scenario
from scenarios.rotations import rotate
from scenarios.state import ORIENTATION, RATES, SPIN, UP, VELOCITY
from scenarios.truths.contact_search import Contact, ContactSearch
from scenarios.truths.flight import Flight, flight_states
from scenarios.truths.impact_laws import Law, law_of, velocities_after
from scenarios.truths.truth import Impact, Truth

Array = NDArray[np.float64]

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


def corner_impact(scene: Scenario, law: Law | None = None) -> Truth | None:
    """The exact solution of a drop on a corner, an edge or as a ball, up to the time at which a disturbance has grown too much.

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
    course = _follow(scene, scene.initial_state, law)
    if len(course.events) > 1:
        course = _until_sensitive(scene, course, _follow(scene, scene.initial_state + DISTURBANCE * DISTURBED_DIRECTION, law))
    if course.horizon == 0.0 or (not course.events and course.ends_at_impact):
        return None  # the body stays in contact from the start, or the first impact is not of this kind
    if not course.events:
        return Truth("flight", "free flight above the floor", course.states, horizon=course.horizon)
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
    """The flights between impacts, until `horizon` [s]."""

    flights: tuple[Flight, ...]
    events: tuple[Impact, ...]
    horizon: float
    ends_at_impact: bool = False  # of another kind

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
    """The flights and impacts until the scene ends, the body stays on the floor, or an impact is not covered by the formula."""
    assert scene.floor is not None
    inertia, g = scene.body.inertia_tensor, scene.acceleration
    flights, now = [flight_states(start, inertia, g)], 0.0
    events: list[Impact] = []
    while True:
        until = min(scene.duration, now + flights[-1].horizon)
        contact = _next_impact(scene, flights[-1], until - now, leaves=bool(events))
        if contact is None:
            return _Course(tuple(flights), tuple(events), until)
        if not contact.is_decided or (events and (len(events) == MAX_IMPACTS or contact.time < MIN_FLIGHT_TIME)):
            return _Course(tuple(flights), tuple(events), now + contact.time)
        now, before = now + contact.time, flights[-1](np.array([contact.time]))[0]
        touching = _touching(scene, before)
        after = before.copy()
        after[RATES] = velocities_after(before, touching.mean(axis=0), scene.body.mass, inertia, scene.floor, law)
        pushes = after[VELOCITY] @ UP > before[VELOCITY] @ UP
        if not (pushes and _have_one_velocity(touching, before) and _have_one_velocity(touching, after)):
            return _Course(tuple(flights), tuple(events), now, ends_at_impact=True)
        events.append(Impact(now, before, after))
        flights.append(flight_states(after, inertia, g))
        if not _leave(touching, after):
            return _Course(tuple(flights), tuple(events), now)


def _until_sensitive(scene: Scenario, course: _Course, disturbed: _Course) -> _Course:
    """The flights and impacts up to the impact after which a disturbance of the initial state has grown by more than `MAX_GROWTH`."""
    per_radian = np.array([scene.body.size] * 3 + [1.0] * 3)  # speeds, m/s, to rates of rotation
    for number, event in enumerate(course.events):
        difference = math.inf
        if number < len(disturbed.events):
            difference = float(np.abs((disturbed.events[number].after[RATES] - event.after[RATES]) / per_radian).max())
        if number > 0 and difference > MAX_GROWTH * DISTURBANCE:
            return _Course(course.flights[: number + 1], course.events[:number], event.time)
    return course


def _next_impact(scene: Scenario, flight: Flight, duration: float, leaves: bool) -> Contact | None:
    """The next time at which the lowest point passes through the floor downwards; None if there is none within `duration`.

    Args:
        scene: The scene.
        flight: A flight that starts at or above the floor.
        duration: Length of the search [s].
        leaves: Whether the body leaves the floor at the beginning of the flight, after an impact.
    """
    body, start = scene.body, flight.start
    offsets = rotate(start[ORIENTATION], body.hull)
    is_on_floor = start[1] + offsets[:, 1].min() - body.rounding <= TOUCHING * body.size
    if is_on_floor and not leaves and _descends(scene, start):
        return Contact(0.0, True)
    return ContactSearch(flight, body.hull, body.rounding).next_contact(duration)


def _descends(scene: Scenario, state: Array) -> bool:
    """Whether a point on the floor descends, or rests and is not pulled upwards."""
    slowest = float(_rising(_touching(scene, state), state).min())
    return slowest < -_no_speed(scene, state) or (abs(slowest) <= _no_speed(scene, state) and scene.acceleration[1] <= 0.0)


def _touching(scene: Scenario, state: Array) -> Array:
    """Offsets of the lowest points from the centre of mass, shape (n, 3)."""
    offsets = rotate(state[ORIENTATION], scene.body.vertices)
    lowest = offsets[offsets[:, 1] <= offsets[:, 1].min() + CORNER_TOLERANCE * scene.body.size]
    return lowest - scene.body.rounding * UP


def _leave(points: Array, state: Array) -> bool:
    """Whether all of the given points ascend."""
    return bool(_rising(points, state).min() > 1e-12 * np.linalg.norm(state[VELOCITY]))


def _rising(points: Array, state: Array) -> Array:
    """Upward velocity [m/s] of points of the body, shape (n,)."""
    upward: Array = state[8] + np.cross(state[SPIN], points)[:, 1]
    return upward


def _no_speed(scene: Scenario, state: Array) -> float:
    """Speed [m/s] up to which a point counts as resting."""
    return float(1e-12 * (np.linalg.norm(state[VELOCITY]) + scene.body.size * np.linalg.norm(state[SPIN])))


def _have_one_velocity(points: Array, state: Array) -> bool:
    """Whether points of the body have equal velocities, so that one impulse at their mean is equivalent to one at each."""
    velocities = state[VELOCITY] + np.cross(state[SPIN], points)
    return bool(np.ptp(velocities, axis=0).max() <= 1e-9 * np.linalg.norm(velocities, axis=1).max())
