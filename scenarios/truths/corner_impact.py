"""A tilted body falls and strikes the floor with one corner: flight, one impulse, flight.

With r from the centre of mass to the corner, v_c = v + ω × r, and K = 1/M - r* I⁻¹ r* (the note's eq 15):

    frictionless   j = -(1 + e) v_n / (N·K N) N             the impulse is normal
    sticking       K j = -v_c - e v_n N                     the note's eq 17, Newton's restitution

Source: E. T. Whittaker, Analytical Dynamics, section 95 (impact of smooth and of perfectly rough bodies); H. Wang, eq 17.
Valid for: one corner alone touches, no damping, from the start to the second impact, which ends it.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from scenarios.body import Sphere
from scenarios.mechanics import lowest_height
from scenarios.model import Floor, Scenario
from scenarios.rotations import rotate
from scenarios.trajectory import Trajectory
from scenarios.truths.flight import flight_states
from scenarios.truths.truth import Impact, States, Truth

Array = NDArray[np.float64]

UP = np.array([0.0, 1.0, 0.0])
SCAN = 4000  # samples of the height in search of an impact, before its root is found
ONE_CORNER = 1e-6  # of the body's size: how far above the corner that touches the next one must be


def corner_impact(scene: Scenario) -> Truth | None:
    """The truth of a drop on one corner."""
    floor = scene.floor
    if floor is None or scene.damping is not None or isinstance(scene.body, Sphere):
        return None
    if not isinstance(floor.friction, str):
        return None
    inertia, g = scene.body.inertia_tensor, scene.acceleration
    falling = flight_states(scene.initial_state, inertia, g)
    time = _next_impact(scene, falling, 0.0, scene.duration)
    if time is None:
        return Truth("flight", "free flight that ends above the floor", falling, horizon=scene.duration)
    before = falling(np.array([time]))[0]
    corner = _single_corner(scene, before)
    if corner is None:
        return None
    after = before.copy()
    after[7:13] = velocities_after(before, corner, scene.body.mass, inertia, floor)
    leaving = flight_states(after, inertia, g)
    # The corner itself leaves at zero height; look for the next impact once it is clear.
    second = _next_impact(scene, leaving, 1e-3 * time, scene.duration - time)
    horizon = scene.duration if second is None else time + second

    def states(t: Array) -> Array:
        rows = np.empty((len(t), 13))
        early = t <= time
        rows[early] = falling(t[early])
        rows[~early] = leaving(t[~early] - time)
        return rows

    law = "normal impulse" if floor.friction == "none" else "sticking impulse, eq 17"
    statement = f"free rotor and parabola, one corner impact ({law}), free rotor and parabola"
    return Truth("corner-impact", statement, states, (Impact(time, before, after),), horizon)


def velocities_after(state: Array, corner: Array, mass: float, inertia: Array, floor: Floor) -> Array:
    """Velocity and angular velocity, shape (6,), after the impact of one corner, offset `corner` in the world frame."""
    q, v, w = state[3:7], state[7:10], state[10:13]
    axes = rotate(q, np.eye(3))  # rows: the body's axes in the world
    inverse = axes.T @ np.linalg.inv(inertia) @ axes
    arm = np.cross(np.eye(3), corner)  # as a matrix: arm @ j = corner × j
    response = np.eye(3) / mass - arm @ inverse @ arm
    approach = v + np.cross(w, corner)
    e = 0.0 if abs(approach[1]) < floor.rest_speed else floor.restitution
    if floor.friction == "none":
        impulse = -(1.0 + e) * approach[1] / response[1, 1] * UP
    else:
        impulse = np.linalg.solve(response, -approach - e * approach[1] * UP)
    return np.concatenate([v + impulse / mass, w + inverse @ np.cross(corner, impulse)])


def _next_impact(scene: Scenario, states: States, start: float, end: float) -> float | None:
    def height(t: Array) -> Array:
        return lowest_height(scene, Trajectory.from_states(t, states(t)))

    if end <= start:
        return None
    t = np.linspace(start, end, SCAN)
    below = np.flatnonzero(height(t) < 0.0)
    if len(below) == 0:
        return None
    if below[0] == 0:
        return start
    bracket = t[below[0] - 1], t[below[0]]
    return float(brentq(lambda s: float(height(np.array([s]))[0]), *bracket, xtol=1e-15, rtol=8.9e-16))


def _single_corner(scene: Scenario, state: Array) -> Array | None:
    offsets = rotate(state[3:7], scene.body.vertices)
    order = np.argsort(offsets[:, 1])
    gap = offsets[order[1], 1] - offsets[order[0], 1]
    return offsets[order[0]] if gap > ONE_CORNER * scene.body.size else None
