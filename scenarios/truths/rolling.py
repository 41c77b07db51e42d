"""A ball, or a round body on its side, on a rough floor, level or sloped: it slides until its contact is at rest, and rolls from then on.

With r the radius, I the moment of inertia, k = 1 + M r²/I, and s = v + ω × (-r Y) the velocity of the contact point:

    ds/dt = g_t - k f g_n s/|s|                    sliding; g_t, g_n: gravity along the floor and into it
    s = 0 from then on, if |g_t| <= k f g_n        rolling
    v = v₀ + g_t t - (s₀ + g_t t - s)/k            in both cases, because friction changes v and s in the ratio 1 : k
    ω = ω₀ + (k - 1)/r Y × (s₀ + g_t t - s)/k      in both cases, by the torque of the same friction

A solid ball, k = 7/2, that is thrown without spin rolls at 5/7 of its speed; on a slope it rolls with 5/7 of g_t. A solid cylinder has
k = 3, a hollow one k = 2. The component of ω along Y is constant. The angle of the rotation is an integral of ω where its direction is
constant; else the orientation is integrated numerically.

Source: G. G. de Coriolis, Théorie mathématique des effets du jeu de billard (1835); `dry_friction` for the velocity of the contact point.
Valid for: a ball of equal moments that touches the floor at the start, with any velocity along the floor and any spin; a capsule, a
cylinder or an ellipsoid with two equal shorter axes on its side, if its axis is principal, velocity and slope are across it, and the spin
is about it, and if the other moments of an ellipsoid are equal: about an axis of the middle moment it does not roll stably; any friction,
but infinite friction only without slip; gravity into the floor, which may be sloped, no damping. Restitution has no effect, because the
contact does not separate.
"""

import math
from collections.abc import Callable, Sequence
from itertools import accumulate

import numpy as np

from dropspin.scenarios.bodies import Shape
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.rotations import about, multiply, rotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, UP, VELOCITY, Array
from dropspin.scenarios.surfaces import Floor
from dropspin.scenarios.truths.coulomb_slide import LEVEL
from dropspin.scenarios.truths.dry_friction import Motion, dry_friction
from dropspin.scenarios.truths.truth import Truth, piece

NO_SLIP = 1e-14
"""Speed of a contact point that counts as rest, relative to the ball's speed."""
ONE_AXIS = 1e-14
"""Largest component of an angular velocity perpendicular to the largest one, relative to it, up to which the axis counts as constant."""
ACROSS = 1e-12
"""Largest component of a direction perpendicular to the intended one, relative to its length, that is attributed to rounding."""
SAMPLES = 50
"""Times at which the axis is compared."""
STEP = 0.05
"""Largest rotation in a step of the numerical integration [rad]."""


def rolling(scene: Scenario, floor: Floor) -> Truth | None:
    """The exact solution of a ball that slides and rolls."""
    start, g, body = scene.initial_state, scene.acceleration, scene.body
    velocity, spin, pull = start[VELOCITY], start[SPIN], g * LEVEL
    rolls = _ball(scene) or _on_its_side(scene, (velocity, pull)) if scene.starts_on_floor and g[1] < 0.0 and start[8] == 0.0 else None
    if rolls is None:
        return None
    radius, moment = rolls
    slip = velocity + radius * np.cross(UP, spin)
    if np.linalg.norm(slip) <= NO_SLIP * np.linalg.norm(velocity):
        slip = np.zeros(3)
    if math.isinf(floor.coefficient) and slip.any():
        return None
    share = 1.0 + body.mass * radius**2 / moment  # k
    contact, stops = dry_friction(slip, pull, share * floor.coefficient * -float(g[1]))

    def lost(t: Array) -> tuple[Array, Array]:
        """Changes of velocity by friction, with the sign reversed, and their integrals, each of shape (n, 3)."""
        slipping, way = contact(t)
        t = t[:, None]
        return (slip + pull * t - slipping) / share, (slip * t + 0.5 * pull * t**2 - way) / share

    lever = (share - 1.0) / radius

    def spun(free: Array, change: Array) -> Array:
        return free + lever * np.cross(UP, change)

    def spins(t: Array) -> tuple[Array, Array]:
        change, way = lost(t)
        return spun(spin, change), spun(spin * t[:, None], way)

    orientations = _orientations(scene, spins, stops)

    def states(t: Array) -> Array:
        (change, way), t_ = lost(t), t[:, None]
        position = start[POSITION] + velocity * t_ + 0.5 * pull * t_**2 - way
        return np.hstack([position, orientations(t), velocity + pull * t_ - change, spun(spin, change)])

    statement = "Coulomb friction accelerates the body until its contact point is at rest; then it rolls without slip (Coriolis 1835)"
    return Truth("rolling", statement, states, horizon=scene.duration)


def _ball(scene: Scenario) -> tuple[float, float] | None:
    """The radius of a ball of equal moments, and its moment of inertia."""
    moments = np.linalg.eigvalsh(scene.body.inertia_tensor)
    return (scene.body.size, float(moments[0])) if scene.body.is_ball and float(np.ptp(moments)) == 0.0 else None


def _on_its_side(scene: Scenario, along: Sequence[Array]) -> tuple[float, float] | None:
    """The radius of a body of revolution that lies on its side, and its moment of inertia; None if it does not roll straight.

    It rolls straight if its axis is a principal axis, the spin is about this axis, and velocity and slope are perpendicular to it. On one
    point, it has to be stable: the moments across the axis are equal.
    """
    body, orientation, spin = scene.body, np.array(scene.start.orientation), np.array(scene.start.angular_velocity)
    number = _axis_of_revolution(body)
    if number is None:
        return None
    axis, inertia = rotate(orientation, np.eye(3)[number]), body.inertia_tensor[number]
    across = np.delete(np.delete(body.inertia_tensor, number, axis=0), number, axis=1)
    keeps = (
        (len(body.vertices) > 1 or float(np.ptp(np.linalg.eigvalsh(across))) <= ACROSS * inertia[number])
        and abs(axis[1]) <= ACROSS
        and np.abs(np.delete(inertia, number)).max() <= ACROSS * inertia[number]
        and np.linalg.norm(np.cross(spin, axis)) <= ACROSS * np.linalg.norm(spin)
        and all(abs(vector @ axis) <= ACROSS * np.linalg.norm(vector) for vector in along)
    )
    return (float(np.delete(body.semi_axes, number)[0]), float(inertia[number])) if keeps else None


def _axis_of_revolution(body: Shape) -> int | None:
    """The number of the axis of the body frame about which a body is round, if it can lie with this axis level."""
    for number in range(3):
        (radius, other), ends = np.delete(body.semi_axes, number), body.vertices[:, number]
        is_on_axis = np.abs(np.delete(body.vertices, number, axis=1)).max() <= ACROSS * body.size
        lies = ends.min() < 0.0 < ends.max() or (not ends.any() and body.semi_axes[number] > radius)
        if radius == other > 0.0 and is_on_axis and lies:
            return number
    return None


def _orientations(scene: Scenario, spins: Motion, kink: float) -> Callable[[Array], Array]:
    """Orientations at times [s], from the angular velocity and its integral; the angular acceleration jumps at the time `kink`."""
    start = scene.initial_state
    samples = spins(np.linspace(0.0, scene.duration, SAMPLES))[0]
    largest = samples[np.argmax(np.linalg.norm(samples, axis=1))]
    size = float(np.linalg.norm(largest))
    axis = largest / size if size else UP
    if np.linalg.norm(np.cross(axis, samples), axis=1).max() > ONE_AXIS * size:
        return _integrated(start[ORIENTATION], spins, min(kink, scene.duration), scene.duration)
    return lambda t: multiply(about(axis, spins(t)[1] @ axis), start[ORIENTATION])


def _integrated(start: Array, spins: Motion, kink: float, end: float) -> Callable[[Array], Array]:
    """Orientations by Magnus's expansion of order 6, in short steps on each side of the kink."""
    fastest = float(np.linalg.norm(spins(np.linspace(0.0, end, SAMPLES))[0], axis=1).max())
    sides = [(first, last) for first, last in ((0.0, kink), (kink, end)) if last > first]
    grids = [np.linspace(first, last, 2 + math.ceil((last - first) * fastest / STEP)) for first, last in sides]
    nodes = np.concatenate([grids[0], *(grid[1:] for grid in grids[1:])])
    turns = _turns(spins, nodes[:-1], nodes[1:])
    at_nodes = np.array(list(accumulate(turns, lambda before, turn: multiply(turn, before), initial=start)))

    def orientations_at(t: Array) -> Array:
        before = np.minimum(piece(nodes, t), len(nodes) - 2)
        return multiply(_turns(spins, nodes[before], t), at_nodes[before])

    return orientations_at


def _turns(spins: Motion, first: Array, last: Array) -> Array:
    """Rotations between two times each [s], as quaternions, shape (n, 4).

    Source: S. Blanes, F. Casas, J. A. Oteo & J. Ros, The Magnus expansion and some of its applications, Phys. Rep. 470 (2009), eq 257.
    """
    h, middle = last - first, 0.5 * (first + last)
    early, central, late = (spins(middle + offset * h)[0] for offset in (-math.sqrt(0.15), 0.0, math.sqrt(0.15)))
    h = h[:, None]
    a1, a2, a3 = h * central, math.sqrt(15.0) / 3.0 * h * (late - early), 10.0 / 3.0 * h * (late - 2.0 * central + early)
    c1 = np.cross(a1, a2)
    c2 = -np.cross(a1, 2.0 * a3 + c1) / 60.0
    turn = a1 + a3 / 12.0 + np.cross(-20.0 * a1 - a3 + c1, a2 + c2) / 240.0
    half = 0.5 * np.linalg.norm(turn, axis=1)[:, None]
    return np.hstack([0.5 * np.sinc(half / math.pi) * turn, np.cos(half)])
