"""A body that stands on an edge falls over on a frictionless floor: the edge slips and the centre of mass falls vertically.

ψ is the angle at the edge between the vertical and the centre of mass, R their distance, k = I/(M R²). Energy is conserved:

    (k + sin²ψ) ψ'² = 2 (g/R) (cos ψ_rest - cos ψ)

With sin(ψ/2) = √s cosh u, s = sin²(ψ_rest/2), the time since rest is the integral of a smooth function,

    dt/du = √((k + sin²ψ) R/g) / cos(ψ/2)

which is not an elliptic integral. It is integrated as a Chebyshev series and inverted by Newton's method.

Source: the integrals of energy and of horizontal momentum; C. W. Clenshaw & A. R. Curtis, Numerische Mathematik 2 (1960), for the time.
Valid for: a body that stands on one edge (see `on_one_edge`), with any horizontal velocity, at rest or rotating about the edge too slowly
to pass the top; a frictionless floor; gravity straight down, no damping; until the body lands. The normal force is never negative.
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.polynomial import Chebyshev

from dropspin.scenarios.model import TOUCHING, Scenario
from dropspin.scenarios.rotations import about, multiply
from dropspin.scenarios.state import ORIENTATION, POSITION, UP, VELOCITY, Array
from dropspin.scenarios.surfaces import Floor
from dropspin.scenarios.truths.edge_geometry import MIN_LEVEL, Stand, on_one_edge
from dropspin.scenarios.truths.truth import Truth

MIN_DEGREE, MAX_DEGREE = 16, 512  # of the Chebyshev series
NEGLIGIBLE_COEFFICIENT = 1e-15  # of the largest
GUESS_POINTS = 500  # of the cubic, whose error of 1e-9 Newton's method squares


def slipping(scene: Scenario, floor: Floor) -> Truth | None:
    """The exact solution of a body whose edge slips."""
    stand = on_one_edge(scene) if floor.friction == "none" else None
    if stand is None or stand.slope != 0.0:
        return None
    falling = stand.speed * stand.radius * math.sin(stand.angle)
    if abs(scene.initial_state[8] + falling) > TOUCHING * abs(falling):
        return None
    at_start, at_end = math.sin(0.5 * stand.angle) ** 2, math.sin(0.5 * stand.ahead[0]) ** 2
    level = at_start - 0.25 * (stand.shares[0] + math.sin(stand.angle) ** 2) * stand.radius / stand.gravity * stand.speed**2
    if level < MIN_LEVEL or (stand.speed < 0.0 < stand.behind[0]):
        return None
    since_rest = _time_since_rest(stand, level, at_end)
    rest = math.copysign(float(since_rest(math.acosh(math.sqrt(max(at_start / level, 1.0))))), -stand.speed)
    lands = rest + float(since_rest(since_rest.domain[1]))

    inverse = _inverse(since_rest, partial(_pace, stand, level))

    def states(t: Array) -> Array:
        u = inverse(t - rest)
        half_sine = math.sqrt(level) * np.cosh(u)
        angle = 2.0 * np.arcsin(half_sine)
        speed = 2.0 * math.sqrt(level) * np.sinh(u) / np.sqrt(1.0 - half_sine**2) / _pace(stand, level, u)
        return _states(scene, stand, t, angle, speed)

    statement = "constant energy and horizontal momentum give the time as an integral (by a Chebyshev series, Clenshaw & Curtis 1960)"
    ends = "the body lands on a face" if lands < scene.duration else ""
    return Truth("slipping", statement, states, horizon=min(lands, scene.duration), ends=ends)


def _pace(stand: Stand, level: float, u: Array) -> Array:
    """dt/du [s]."""
    square = level * np.cosh(u) ** 2
    return np.sqrt((stand.shares[0] + 4.0 * square * (1.0 - square)) * stand.radius / (stand.gravity * (1.0 - square)))


def _time_since_rest(stand: Stand, level: float, at_end: float) -> Chebyshev:
    """Time since rest [s] over u, from rest to landing."""
    degree, end = MIN_DEGREE, math.acosh(math.sqrt(at_end / level))
    while True:
        pace = Chebyshev.interpolate(partial(_pace, stand, level), degree, domain=[0.0, end])
        if degree == MAX_DEGREE or np.abs(pace.coef[-4:]).max() < NEGLIGIBLE_COEFFICIENT * np.abs(pace.coef).max():
            return pace.integ(lbnd=0.0)
        degree *= 2


def _inverse(since_rest: Chebyshev, pace: Callable[[Array], Array]) -> Callable[[Array], Array]:
    """The inverse function, from times since rest [s] to u, odd in time: a cubic and one step of Newton's method."""
    from scipy.interpolate import CubicHermiteSpline

    u = np.linspace(0.0, since_rest.domain[1], GUESS_POINTS)
    guess = CubicHermiteSpline(since_rest(u), u, 1.0 / pace(u))

    def inverse(times: Array) -> Array:
        u = guess(np.abs(times))
        return np.copysign(u - (since_rest(u) - np.abs(times)) / pace(u), times)

    return inverse


def _states(scene: Scenario, stand: Stand, t: Array, angle: Array, speed: Array) -> Array:
    """States, shape (n, 13), at times [s], angles ψ [rad] and speeds ψ' [rad/s], shapes (n,)."""
    start, t_ = scene.initial_state, t[:, None]
    sideways = start[VELOCITY] * np.array([1.0, 0.0, 1.0])
    position = start[POSITION] + sideways * t_
    position[:, 1] = stand.pivot[1] + stand.radius * np.cos(angle)
    velocity = sideways - (stand.radius * np.sin(angle) * speed)[:, None] * UP
    orientation = multiply(about(stand.falling, angle - stand.angle), start[ORIENTATION])
    return np.hstack([position, orientation, velocity, speed[:, None] * stand.falling])
