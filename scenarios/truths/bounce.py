"""A body that falls flat: the bounce ladder.

    u₀ = √(w² + 2 g H),   t₀ = (w + u₀) / g          first impact; w upward start speed, H clearance
    u_k = e^k u₀,         t_k = t_(k-1) + 2 u_k / g   the impacts after it
    h_k = u_k² / 2g = e^(2k) h_0                      the apexes

For e < 1 the impacts accumulate at t₀ + (2 u₀ / g) e / (1 - e), Zeno's time; then the body rests.

Source: Newton's law of restitution (Principia, 1687, scholium to the laws); geometric sums.
Valid for: a ball on a frictionless floor, with any spin and any horizontal motion; a body that lands on a face, or a round body that lands
where it can lie, such as a capsule on its side, on a frictionless floor, with any horizontal motion and with spin only about the vertical,
up to rounding; each of these on any floor, if it has no spin and no horizontal motion; gravity straight down, no damping. A body that lands
has the mean of its lowest points under its centre of mass; one that rests has its centre of mass above the inside of its base. Valid until
a difference of one eps in a spin about the intermediate axis can turn the body over, or, of a body that lands on a point or a line of a
curved surface, until its impacts, or its spin at rest, have amplified small differences too much.
"""

import math
from collections.abc import Iterator

import numpy as np

from dropspin.scenarios.model import TOUCHING, Scenario
from dropspin.scenarios.rotations import about, multiply, rotate, unrotate
from dropspin.scenarios.state import SPIN, UP, Array
from dropspin.scenarios.surfaces import Floor
from dropspin.scenarios.truths.corner_impact import DISTURBED_DIRECTION, MAX_GROWTH, TOO_SENSITIVE, corner_impact
from dropspin.scenarios.truths.flight import TURNS_OVER, flight_states
from dropspin.scenarios.truths.point_contact import GROWS, growth_of_a_spin
from dropspin.scenarios.truths.truth import Truth, impacts_of, piece

MAX_BOUNCES = 100_000
MIN_FLIGHT_SHARE = 1e-12
"""Flights shorter than this share of the first fall count as rest; the apexes of such flights are below 1e-24 of the drop height."""

DIRECTIONS, SMALL_TURN = 16, 1e-3
"""The small rotations by which the code tests whether a round body lies: the number of horizontal axes, and the angle [rad]."""

FLAT = 1e-9
"""Depth of the curved surface below its centre, relative to the size, up to which a face is lowest."""

LAST = 1e-3
"""Share of the time up to rest in which impacts follow one another so fast that a disturbed motion has another number of them."""

JUST_BEFORE = 1e-9
"""An impact that amplifies small differences too much is not part of the solution; relative to its time."""

SPIN_ROUNDING = 1e-15
"""Largest horizontal part of an angular velocity about the vertical that counts as rounding, relative to the angular velocity."""


def bounce_ladder(scene: Scenario, floor: Floor) -> Truth | None:
    """The exact solution of a flat drop."""
    if not scene.falls_straight_down or not _stays_flat(scene, floor):
        return None
    g = -float(scene.acceleration[1])
    start = scene.initial_state
    upward = float(start[8])
    # A body within TOUCHING of the floor starts on it; otherwise a ball at rest would keep bouncing by a nanometre.
    clearance = scene.clearance if scene.clearance > TOUCHING * scene.body.size else 0.0
    u0 = math.sqrt(upward**2 + 2.0 * g * clearance)
    t0 = (upward + u0) / g
    leaving = _leaving_speeds(u0, g, floor, scene.duration - t0)
    if leaving is None:
        return None
    starts = np.concatenate([[0.0, t0], t0 + np.cumsum(2.0 / g * leaving)])
    # Speeds at the start of flight 0 (the fall), of each flight after an impact, and of rest.
    speeds = np.concatenate([[upward], leaving, [0.0]])
    floor_height = start[1] - scene.clearance
    heights = np.concatenate([[start[1]], np.full(len(speeds) - 1, floor_height)])
    sideways_and_spin = flight_states(start, scene.body.inertia_tensor, np.zeros(3))

    def states(t: Array) -> Array:
        flight = piece(starts, t)
        since, speed = t - starts[flight], speeds[flight]
        pull = np.where(flight == len(speeds) - 1, 0.0, g)
        rows = sideways_and_spin(t)
        rows[:, 1] = heights[flight] + speed * since - 0.5 * pull * since**2
        rows[:, 8] = speed - pull * since
        return rows

    ends = [(scene.duration, ""), (sideways_and_spin.horizon, TURNS_OVER)]
    below_centre = scene.body.semi_axes * unrotate(np.array(scene.start.orientation), UP)
    if np.linalg.norm(below_centre) > FLAT * scene.body.size and not scene.body.is_ball:
        ends += _of_a_curved_surface(scene, floor, float(starts[-1]), states(starts[-1:])[0])
    until, why = min(ends)
    times = starts[1:][starts[1:] <= until]
    before, after = states(times), states(times)
    before[:, 1] = after[:, 1] = floor_height
    after[:, 8] = speeds[1 : len(times) + 1]
    statement = (
        "after impact k the body rises to e^(2k) H, with H the drop height; the impact times are sums of a geometric series "
        "(Newton's restitution)"
    )
    if u0 == 0.0:
        stays = "slides on the floor at a constant velocity" if start[7] or start[9] else "rests on the floor"
        statement = f"the body {stays} and turns about the vertical at the constant angular velocity ω, by the angle ω t"
    return Truth("bounce-ladder", statement, states, impacts_of(times, before, after), until, why)


def _of_a_curved_surface(scene: Scenario, floor: Floor, rest: float, at_rest: Array) -> Iterator[tuple[float, str]]:
    """When impacts, or a spin from the time of rest on, have amplified small differences too much [s], and why the solution ends then.

    On two points, as the ends of a line, the body stays on both if it turns about that line alone.
    """
    lowest = scene.body.lowest(np.array(scene.start.orientation), 1e-12)
    line = lowest[-1] - lowest[0]
    along = np.concatenate([np.zeros(10), line / np.linalg.norm(line)]) if len(lowest) > 1 else DISTURBED_DIRECTION
    struck = corner_impact(scene, floor, disturbed=along)
    if struck is not None and struck.ends == TOO_SENSITIVE and struck.horizon < (1.0 - LAST) * rest:
        yield (1.0 - JUST_BEFORE) * struck.horizon, TOO_SENSITIVE
    at_rest[8] = 0.0
    if len(lowest) == 1 and at_rest[SPIN].any() and (growth := growth_of_a_spin(scene.starting_at(at_rest))):
        yield rest + math.log(MAX_GROWTH) / growth, GROWS


def _leaving_speeds(u0: float, g: float, floor: Floor, remaining: float) -> Array | None:
    """Speeds after the impacts until the scene ends or the body rests; None if there are too many impacts."""
    e = floor.restitution
    if remaining < 0.0 or u0 < floor.rest_speed or e * u0 <= 0.0:
        return np.empty(0)
    first = 2.0 * e * u0 / g
    if e == 1.0:
        flights = remaining / first + 1.0
    else:
        # Flight k = 1, 2, … lasts first * e^(k-1); flights after the end, or too short to count, are not needed.
        share = 1.0 - remaining * (1.0 - e) / first
        flights = math.log(share) / math.log(e) + 1.0 if share > 0.0 else math.inf
        flights = min(flights, math.log(MIN_FLIGHT_SHARE) / math.log(e))
        if floor.rest_speed > 0.0:
            flights = min(flights, math.log(floor.rest_speed / u0) / math.log(e) + 1.0)
    if flights > MAX_BOUNCES:
        return None
    speeds: Array = u0 * e ** np.arange(1.0, math.ceil(flights) + 1.0)
    # The last flight ends with an impact slower than rest_speed.
    bounces = np.concatenate([[u0], speeds[:-1]]) >= floor.rest_speed
    return speeds[bounces & (speeds > MIN_FLIGHT_SHARE * u0)]


def _stays_flat(scene: Scenario, floor: Floor) -> bool:
    """Whether every impact is a single upward impulse through the centre of mass."""
    start = scene.start
    if floor.friction != "none" and (start.velocity[0] or start.velocity[2] or any(start.angular_velocity)):
        return False
    if scene.body.is_ball:  # of any inertia: the impulse is through its centre of mass
        return True
    lowest = scene.body.lowest(np.array(start.orientation), 1e-12)
    rests = scene.starts_on_floor and not start.velocity[1]
    under_centre = np.abs(lowest[:, [0, 2]].mean(axis=0)).max() <= 1e-12 * scene.body.size or (rests and _surrounds_the_centre(lowest))
    is_carried = _surrounds_the_centre(lowest) or (bool(scene.body.semi_axes.any()) and _lies(scene))
    return is_carried and bool(under_centre) and _turns_about_the_vertical(scene)


def _surrounds_the_centre(base: Array) -> bool:
    """Whether the centre of mass is above the inside of the base: seen from it, no gap between neighbouring points is half a turn."""
    angles = np.sort(np.arctan2(base[:, 2], base[:, 0]))
    return float(np.diff(angles, append=angles[0] + 2.0 * math.pi).max()) < math.pi - SMALL_TURN


def _lies(scene: Scenario) -> bool:
    """Whether a round body lies on the floor without falling over: no small rotation about a horizontal axis brings it lower."""
    body, pose, angles = scene.body, np.array(scene.start.orientation), np.linspace(0.0, 2.0 * math.pi, DIRECTIONS, endpoint=False)
    axes = np.stack([np.cos(angles), np.zeros(DIRECTIONS), np.sin(angles)], axis=1)
    heights = [-float(body.lowest(turn, 0.0)[0, 1]) for turn in multiply(about(axes, np.full(DIRECTIONS, SMALL_TURN)), pose)]
    return min(heights) >= -float(body.lowest(pose, 0.0)[0, 1]) - 1e-12 * body.size


def _turns_about_the_vertical(scene: Scenario) -> bool:
    """Whether a flat body stays flat: without spin, or with spin about a vertical principal axis."""
    w = np.array(scene.start.angular_velocity)
    momentum = scene.body.inertia_tensor @ unrotate(np.array(scene.start.orientation), w)
    sideways = np.abs(rotate(np.array(scene.start.orientation), momentum)[[0, 2]]).max()
    return bool(np.abs(w[[0, 2]]).max() <= SPIN_ROUNDING * abs(w[1]) and sideways <= 1e-12 * np.linalg.norm(momentum))
