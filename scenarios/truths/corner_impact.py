"""A body strikes the floor and walls repeatedly, as a ball or with a corner or an edge: flight, impulse, flight, and so on.

A wall is the floor in its own frame: the search for its impacts, and their laws, are those of the floor.

The impulse is that of `impact_laws`: normal without friction, eq 17 of Wang's lecture note with infinite friction, else that of the floor's
`impact_law`; or that of a given law.

Source: E. T. Whittaker, Analytical Dynamics, section 95 (impact of smooth and of perfectly rough bodies); H. Wang, eq 17.
Valid for: impacts of one corner, or of the two corners of an edge that strike the floor at once and have equal velocities before and after;
a ball with any spin; no damping. The solution ends, and gives the reason, at the first of these events: the hundredth impact; an impact
that is not of this kind, or for which the law has no solution or several, or in which the floor would have to pull (as eq 17 may demand of
a corner that slides fast), or after which the body stays on the floor, unless it is a ball without walls, which slides and rolls on; a
flight that is short relative to the longest, as before impacts accumulate or where two planes are struck at once; a time at which rounding
determines whether the body touches a plane or when it turns over; growth of an initial disturbance of 1e-10 rad/s to 1e-6.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from dropspin.scenarios.model import TOUCHING, Scenario
from dropspin.scenarios.rotations import rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, RATES, SPIN, UP, VELOCITY, Array
from dropspin.scenarios.surfaces import Floor, Surface, Wall
from dropspin.scenarios.truths.contact_search import Contact, ContactSearch
from dropspin.scenarios.truths.flight import TURNS_OVER, Flight, flight_states
from dropspin.scenarios.truths.impact_laws import Law, law_of, velocities_after
from dropspin.scenarios.truths.rolling import rolling
from dropspin.scenarios.truths.truth import Impact, States, Truth, piece

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
    "coulomb": "Coulomb friction",
    "cone": "Coulomb friction against the remaining slip",
    "integrated-newton": "Coulomb friction at each instant, Newton's restitution",
    "integrated-poisson": "Coulomb friction at each instant, Poisson's restitution",
    "integrated-energy": "Coulomb friction at each instant, Stronge's restitution",
}


def corner_impact(scene: Scenario, floor: Floor, law: Law | None = None, disturbed: Array = DISTURBED_DIRECTION) -> Truth | None:
    """The exact solution of a drop on a corner, an edge or as a ball, up to the time at which a disturbance has grown too much.

    Args:
        scene: The scene, without damping.
        floor: Its floor.
        law: The impact law; by default that of each surface.
        disturbed: The direction of the disturbance, shape (13,).
    """
    planes = [_Plane(surface, law or law_of(scene, surface), number) for number, surface in enumerate(scene.surfaces)]
    flights = _until_sensitive(scene, planes, disturbed)
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
    struck = [planes[0 if event.wall is None else 1 + event.wall] for event in events]
    impulse = ", ".join(dict.fromkeys(plane.law_name for plane in struck))
    points = len(_touching(scene, struck[0].seen(events[0].before)))
    where = {1: "corner", 2: "edge"}.get(points, "face")
    if scene.body.semi_axes.any():
        where = "ball" if scene.body.is_ball else "point"
    impacts = f"one {where} impact" if len(events) == 1 else f"{where} impacts"  # their number: what `until_near` leaves
    then = "; then sliding and rolling (Coriolis 1835)" if last.is_rolling else ""
    statement = f"flights on a parabola, with the rotation of a body without torque, and {impacts} ({impulse}){then}"
    return Truth(f"{where}-impact", statement, states, events, last.end, last.reason)


@dataclass(frozen=True, eq=False)
class _Plane:
    """A plane that the body may strike, the floor (number 0) or a wall, with its impact law."""

    surface: Surface
    law: Law
    number: int

    @property
    def name(self) -> str:
        return f"wall[{self.number - 1}]" if self.number else "floor"

    @property
    def law_name(self) -> str:
        if self.law != "note":
            return LAW_NAMES[self.law]
        return "eq 15 of Wang's lecture note" if self.surface.friction == "none" else "sticking impulse, eq 17 of Wang's lecture note"

    def seen(self, state: Array) -> Array:
        """A state in the frame in which the plane is the floor."""
        return self.surface.as_floor(state) if isinstance(self.surface, Wall) else state

    def seen_flight(self, flight: Flight, inertia: Array) -> Flight:
        """A flight in this frame."""
        if not isinstance(self.surface, Wall):
            return flight
        return flight_states(self.seen(flight.start), inertia, rotate(self.surface.frame, flight.acceleration))

    def unseen(self, rates: Array) -> Array:
        """Velocity and angular velocity in the world, from those in this frame, shape (6,)."""
        return unrotate(self.surface.frame, rates.reshape(2, 3)).ravel() if isinstance(self.surface, Wall) else rates


@dataclass(frozen=True, eq=False)
class _Flight:
    """One flight. At the time `end` [s] there is an impact, or the scene ends, or the solution ends for the `reason`."""

    motion: States
    end: float
    impact: Impact | None = None
    reason: str = ""
    is_other_impact: bool = False  # one that the formula does not cover
    is_rolling: bool = False  # a ball on the floor, after its last flight


def _flights(scene: Scenario, planes: Sequence[_Plane], start: Array) -> Iterator[_Flight]:
    """The flights from a state, until the scene ends, the body stays on a plane, or an impact is not covered by the formula."""
    inertia, g = scene.body.inertia_tensor, scene.acceleration
    motion, now, longest, left = flight_states(start, inertia, g), 0.0, 0.0, None
    for number in range(MAX_IMPACTS + 1):
        until = min(scene.duration, now + motion.horizon)
        pairs = [(plane, _next_impact(scene, plane.seen_flight(motion, inertia), until - now, leaves=plane is left)) for plane in planes]
        contacts = sorted(((plane, contact) for plane, contact in pairs if contact is not None), key=lambda pair: pair[1].time)
        if not contacts:
            yield _Flight(motion, until, reason="" if until == scene.duration else TURNS_OVER)
            return
        plane, contact = contacts[0]
        now += contact.time
        reason = ""
        if not contact.is_decided:
            reason = f"rounding determines whether the body touches the {plane.name}"
        elif len(contacts) > 1 and contacts[1][1].time - contact.time <= SHORTEST_FLIGHT * max(longest, contact.time):
            reason = "the body strikes two planes at once"
        elif contact.time < SHORTEST_FLIGHT * longest:
            reason = "impacts follow one another ever faster"
        elif number == MAX_IMPACTS:
            reason = f"impact {MAX_IMPACTS + 1} follows"
        if reason:
            yield _Flight(motion, now, reason=reason)
            return
        longest, before = max(longest, contact.time), motion(np.array([contact.time]))[0]
        touching = _touching(scene, plane.seen(before))
        impact = _impact(scene, plane, touching, now, before)
        if isinstance(impact, str):
            yield _Flight(motion, now, reason=impact, is_other_impact=True)
            return
        yield _Flight(motion, now, impact)
        motion, left = flight_states(impact.after, inertia, g), plane
        if not _leave(touching, plane.seen(impact.after)):
            rolls = _rolling_from(scene, plane, impact.after, scene.duration - now)
            stays = _Flight(motion, now, reason=f"the body stays on the {plane.name}")
            yield stays if rolls is None else _Flight(rolls, scene.duration, is_rolling=True)
            return


def _rolling_from(scene: Scenario, plane: _Plane, after: Array, duration: float) -> States | None:
    """The motion on an endless floor of a ball that stays on it after an impact; None for other bodies and planes."""
    if not (scene.body.is_ball and isinstance(plane.surface, Floor) and scene.wall is None):
        return None
    on_floor = after.copy()
    on_floor[8] = 0.0
    follows = rolling(scene.starting_at(on_floor).model_copy(update={"duration": duration}), plane.surface)
    return None if follows is None else follows.states


def _impact(scene: Scenario, plane: _Plane, touching: Array, time: float, before: Array) -> Impact | str:
    """The impact of the touching points, or why the formula does not cover it."""
    seen = plane.seen(before)
    rates = velocities_after(seen, touching.mean(axis=0), scene.body.mass, scene.body.inertia_tensor, plane.surface, plane.law)
    if rates is None:
        return "the impact law has no solution, or several"
    seen_after, after = seen.copy(), before.copy()
    seen_after[RATES], after[RATES] = rates, plane.unseen(rates)
    if seen_after[VELOCITY] @ UP <= seen[VELOCITY] @ UP:
        return f"the impact law would have the {plane.name} pull"
    if not (_have_one_velocity(touching, seen) and _have_one_velocity(touching, seen_after)):
        return f"several points strike the {plane.name} at once"
    return Impact(time, before, after, plane.number - 1 if plane.number else None)


def _until_sensitive(scene: Scenario, planes: Sequence[_Plane], direction: Array) -> list[_Flight]:
    """The flights up to the impact after which a disturbance of the initial state has grown by more than `MAX_GROWTH`."""
    per_radian = np.array([scene.body.size] * 3 + [1.0] * 3)  # speeds, m/s, to rates of rotation
    flights: list[_Flight] = []
    disturbed = _flights(scene, planes, scene.initial_state + DISTURBANCE * direction)
    others: list[_Flight] = []
    for number, flight in enumerate(_flights(scene, planes, scene.initial_state)):
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
        flight: A flight that starts at or above the floor, which is the plane in its frame.
        duration: Length of the search [s].
        leaves: Whether the body leaves the floor at the beginning of the flight, after an impact.
    """
    body, start = scene.body, flight.start
    is_on_floor = start[1] + body.lowest(start[ORIENTATION], 0.0)[0, 1] <= TOUCHING * body.size
    if is_on_floor and not leaves and _descends(scene, start, flight.acceleration):
        return Contact(0.0, True)
    return ContactSearch(flight, body.hull, body.semi_axes).next_contact(duration)


def _descends(scene: Scenario, state: Array, gravity: Array) -> bool:
    """Whether a point on the floor descends, or rests and is not pulled upwards."""
    slowest = float(_rising(_touching(scene, state), state).min())
    return slowest < -_no_speed(scene, state) or (abs(slowest) <= _no_speed(scene, state) and gravity[1] <= 0.0)


def _touching(scene: Scenario, state: Array) -> Array:
    """Offsets of the lowest points from the centre of mass, shape (n, 3)."""
    return scene.body.lowest(state[ORIENTATION], CORNER_TOLERANCE)


def _leave(points: Array, state: Array) -> bool:
    """Whether all of the given points ascend."""
    return bool(_rising(points, state).min() > 1e-12 * np.linalg.norm(state[VELOCITY]))


def _rising(points: Array, state: Array) -> Array:
    """Upward velocity [m/s] of points of the body, shape (n,)."""
    return state[8] + np.cross(state[SPIN], points)[:, 1]


def _no_speed(scene: Scenario, state: Array) -> float:
    """Speed [m/s] up to which a point counts as resting."""
    return float(1e-12 * (np.linalg.norm(state[VELOCITY]) + scene.body.size * np.linalg.norm(state[SPIN])))


def _have_one_velocity(points: Array, state: Array) -> bool:
    """Whether points of the body have equal velocities, so that one impulse at their mean is equivalent to one at each."""
    velocities = state[VELOCITY] + np.cross(state[SPIN], points)
    return bool(np.ptp(velocities, axis=0).max() <= 1e-9 * np.linalg.norm(velocities, axis=1).max())
