"""A body falls and strikes the floor repeatedly, as a ball or with a corner or an edge: flight, impulse, flight, and so on.

The impulse is that of `impact_laws`: normal without friction, eq 17 of Wang's lecture note with infinite friction, else that of the floor's
`impact_law`; or that of a given law.

Source: E. T. Whittaker, Analytical Dynamics, section 95 (impact of smooth and of perfectly rough bodies); H. Wang, eq 17.
Valid for: impacts of one corner, or of the two corners of an edge that strike the floor at once and have equal velocities before and after;
a ball with any spin; no damping. The solution ends, and gives the reason, at the first of these events: the hundredth impact; an impact
that is not of this kind, or for which the law has no solution or several, or in which the floor would have to pull (as eq 17 may demand of
a corner that slides fast), or after which the body stays on the floor; a flight that is short relative to the longest, as before impacts
accumulate; a time at which rounding determines whether the body touches the floor or when it turns over; growth of an initial disturbance
of 1e-10 rad/s to 1e-6.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

import numpy as np

from dropspin.scenarios.model import TOUCHING, Floor, Scenario
from dropspin.scenarios.state import ORIENTATION, RATES, SPIN, UP, VELOCITY, Array
from dropspin.scenarios.truths.contact_search import Contact, ContactSearch
from dropspin.scenarios.truths.flight import TURNS_OVER, Flight, flight_states
from dropspin.scenarios.truths.impact_laws import Law, law_of, velocities_after
from dropspin.scenarios.truths.truth import Impact, Truth, piece

CORNER_TOLERANCE = 1e-9  # of the body's size; corners at most this much higher than the lowest touch too
MAX_IMPACTS = 100
SHORTEST_FLIGHT = 1e-7
"""A flight shorter than this share of the longest before it is not followed: its impact speed has lost half of the digits."""
DISTURBANCE = 1e-10  # rad/s, of the start
DISTURBED_DIRECTION = np.array([0.0] * 10 + [0.48, -0.6, 0.64])
MAX_GROWTH = 1e4  # of the disturbance, to 1e-6; beyond it an engine's error cannot be distinguished from the growth of rounding
TOO_SENSITIVE = "the impact amplifies small differences too much"

LAW_NAMES = {
    "normal": "normal impulse",
    "poisson": "Poisson's restitution",
    "clamped": "restitution that adds no energy",
    "coulomb": "Coulomb's friction",
    "cone": "Coulomb's friction against the slip that is left",
    "integrated-newton": "Coulomb's friction at each instant, Newton's restitution",
    "integrated-poisson": "Coulomb's friction at each instant, Poisson's restitution",
    "integrated-energy": "Coulomb's friction at each instant, Stronge's restitution",
}


def corner_impact(scene: Scenario, floor: Floor, law: Law | None = None) -> Truth | None:
    """The exact solution of a drop on a corner, an edge or as a ball, up to the time at which a disturbance has grown too much.

    Args:
        scene: The scene, without damping.
        floor: Its floor.
        law: The impact law; by default the floor's.
    """
    law = law or law_of(scene)
    flights = _until_sensitive(scene, floor, law)
    events = tuple(flight.impact for flight in flights if flight.impact is not None)
    begins, last = np.array([0.0, *(event.time for event in events)]), flights[-1]
    if last.end == 0.0 or (not events and last.is_other_impact):
        return None  # the body stays in contact from the start, or the first impact is not of this kind

    def states(t: Array) -> Array:
        which, rows = piece(begins, t), np.empty((len(t), 13))
        for number, flight in enumerate(flights):
            mine = which == number
            rows[mine] = flight.motion(t[mine] - begins[number])
        return rows

    if not events:
        return Truth("flight", "free flight above the floor", states, horizon=last.end, ends=last.reason)
    impulse = LAW_NAMES[law] if law != "note" else "eq 15" if floor.friction == "none" else "sticking impulse, eq 17"
    points = len(_touching(scene, events[0].before))
    where = {1: "corner", 2: "edge"}.get(points, "face")
    if scene.body.semi_axes.any():
        where = "ball" if scene.body.is_ball else "point"
    count = "one" if len(events) == 1 else str(len(events))
    statement = f"free rotor and parabola, {count} {where} impact{'s' if len(events) > 1 else ''} ({impulse})"
    return Truth(f"{where}-impact", statement, states, events, last.end, last.reason)


@dataclass(frozen=True, eq=False)
class _Flight:
    """One flight, which ends at the time `end` [s] with an impact, or with the scene, or with the solution for the `reason`."""

    motion: Flight
    end: float
    impact: Impact | None = None
    reason: str = ""
    is_other_impact: bool = False  # one that the formula does not cover


def _flights(scene: Scenario, floor: Floor, start: Array, law: Law) -> Iterator[_Flight]:
    """The flights from a state, until the scene ends, the body stays on the floor, or an impact is not covered by the formula."""
    inertia, g = scene.body.inertia_tensor, scene.acceleration
    motion, now, longest = flight_states(start, inertia, g), 0.0, 0.0
    for number in range(MAX_IMPACTS + 1):
        until = min(scene.duration, now + motion.horizon)
        contact = _next_impact(scene, motion, until - now, leaves=number > 0)
        if contact is None:
            yield _Flight(motion, until, reason="" if until == scene.duration else TURNS_OVER)
            return
        now += contact.time
        reason = ""
        if not contact.is_decided:
            reason = "rounding determines whether the body touches the floor"
        elif contact.time < SHORTEST_FLIGHT * longest:
            reason = "impacts follow one another ever faster"
        elif number == MAX_IMPACTS:
            reason = f"impact {MAX_IMPACTS + 1} follows"
        if reason:
            yield _Flight(motion, now, reason=reason)
            return
        longest, before = max(longest, contact.time), motion(np.array([contact.time]))[0]
        touching = _touching(scene, before)
        impact = _impact(scene, floor, law, touching, now, before)
        if isinstance(impact, str):
            yield _Flight(motion, now, reason=impact, is_other_impact=True)
            return
        yield _Flight(motion, now, impact)
        motion = flight_states(impact.after, inertia, g)
        if not _leave(touching, impact.after):
            yield _Flight(motion, now, reason="the body stays on the floor")
            return


def _impact(scene: Scenario, floor: Floor, law: Law, touching: Array, time: float, before: Array) -> Impact | str:
    """The impact of the touching points, or why the formula does not cover it."""
    rates = velocities_after(before, touching.mean(axis=0), scene.body.mass, scene.body.inertia_tensor, floor, law)
    if rates is None:
        return "the impact law has no solution, or several"
    after = before.copy()
    after[RATES] = rates
    if after[VELOCITY] @ UP <= before[VELOCITY] @ UP:
        return "the impact law would have the floor pull"
    if not (_have_one_velocity(touching, before) and _have_one_velocity(touching, after)):
        return "several points strike the floor at once"
    return Impact(time, before, after)


def _until_sensitive(scene: Scenario, floor: Floor, law: Law) -> list[_Flight]:
    """The flights up to the impact after which a disturbance of the initial state has grown by more than `MAX_GROWTH`."""
    per_radian = np.array([scene.body.size] * 3 + [1.0] * 3)  # speeds, m/s, to rates of rotation
    flights: list[_Flight] = []
    disturbed = _flights(scene, floor, scene.initial_state + DISTURBANCE * DISTURBED_DIRECTION, law)
    others: list[_Flight] = []
    for number, flight in enumerate(_flights(scene, floor, scene.initial_state, law)):
        flights.append(flight)
        if number == 0 or flight.impact is None:
            continue
        others += islice(disturbed, number + 1 - len(others))
        other = others[-1].impact if len(others) == number + 1 else None
        if other is None or np.abs((other.after[RATES] - flight.impact.after[RATES]) / per_radian).max() > MAX_GROWTH * DISTURBANCE:
            flights[-1] = _Flight(flight.motion, flight.end, reason=TOO_SENSITIVE)
            break
    return flights


def _next_impact(scene: Scenario, flight: Flight, duration: float, leaves: bool) -> Contact | None:
    """The next time at which the lowest point passes through the floor downwards; None if there is none within `duration`.

    Args:
        scene: The scene.
        flight: A flight that starts at or above the floor.
        duration: Length of the search [s].
        leaves: Whether the body leaves the floor at the beginning of the flight, after an impact.
    """
    body, start = scene.body, flight.start
    is_on_floor = start[1] + body.lowest(start[ORIENTATION], 0.0)[0, 1] <= TOUCHING * body.size
    if is_on_floor and not leaves and _descends(scene, start):
        return Contact(0.0, True)
    return ContactSearch(flight, body.hull, body.semi_axes).next_contact(duration)


def _descends(scene: Scenario, state: Array) -> bool:
    """Whether a point on the floor descends, or rests and is not pulled upwards."""
    slowest = float(_rising(_touching(scene, state), state).min())
    return slowest < -_no_speed(scene, state) or (abs(slowest) <= _no_speed(scene, state) and scene.acceleration[1] <= 0.0)


def _touching(scene: Scenario, state: Array) -> Array:
    """Offsets of the lowest points from the centre of mass, shape (n, 3)."""
    return scene.body.lowest(state[ORIENTATION], CORNER_TOLERANCE)


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
