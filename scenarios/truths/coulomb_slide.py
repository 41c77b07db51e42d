"""A body lies or slides flat on a floor, level or sloped: friction acts against its velocity until it stops.

    dv/dt = g_t - f g_n v/|v|        g_t, g_n: gravity along the floor and into it

If |g_t| <= f g_n, it stays where it stops, and a body that starts at rest does not move. On a level floor it stops at t = |v₀|/(f g), after
|v₀|²/(2 f g). On a frictionless slope it slides with the acceleration g_t. The body stays flat if the normal force can act ahead of the
centre of mass by f times its height; at rest, down the slope by |g_t|/g_n times its height. These points must lie within the base.

Source: C. A. de Coulomb, Théorie des machines simples (1785); `dry_friction` for the motion on a slope.
Valid for: a box or other body on at least three vertices, lying on the floor at the start, without spin, at rest or moving along the floor;
a Coulomb coefficient, infinite friction at rest, or a slope without friction; gravity into the floor, which may be sloped, no damping.
Restitution has no effect, because no contact separates.
"""

import math

import numpy as np

from dropspin.scenarios.bodies.hull import convex_hull
from dropspin.scenarios.model import TOUCHING, Scenario
from dropspin.scenarios.state import POSITION, SPIN, VELOCITY, Array
from dropspin.scenarios.surfaces import Floor
from dropspin.scenarios.truths.dry_friction import dry_friction
from dropspin.scenarios.truths.truth import Truth

LEVEL = np.array([1.0, 0.0, 1.0])


def coulomb_slide(scene: Scenario, floor: Floor) -> Truth | None:
    """The exact solution of a flat slide, or of rest on a slope."""
    start, g = scene.initial_state, scene.acceleration
    if g[1] >= 0.0 or start[8] != 0.0 or start[SPIN].any():
        return None
    pull, into = g * LEVEL, -float(g[1])
    velocity = start[VELOCITY]
    if not pull.any() and (floor.friction == "none" or not velocity.any()):
        return None  # `bounce_ladder` has it
    if math.isinf(floor.coefficient) and velocity.any():
        return None
    motion, _ = dry_friction(velocity, pull, floor.coefficient * into)
    if not _stays_flat(scene, velocity, pull / into, floor.coefficient):
        return None

    def states(t: Array) -> Array:
        rows = np.tile(start, (len(t), 1))
        rows[:, VELOCITY], way = motion(t)
        rows[:, POSITION] += way
        return rows

    statement = "dv/dt = g_t - f g_n v/|v| until the body stops; g_t and g_n are gravity along the floor and into it (Coulomb friction)"
    return Truth("coulomb-slide", statement, states, horizon=scene.duration)


def _stays_flat(scene: Scenario, velocity: Array, slope: Array, friction: float) -> bool:
    """Whether the point at which the normal force must act is within the base.

    The distance of this point from the centre of mass is height times friction coefficient, in the direction of the velocity, which turns
    from its initial direction towards the slope. Where the body rests, the distance is height times slope.
    """
    base = scene.body.lowest(np.array(scene.start.orientation), TOUCHING)
    hull = convex_hull(base[:, [0, 2]]) if scene.starts_on_floor and len(base) >= 3 else None
    if hull is None:  # also where the base is a line
        return False
    height, steepness = -float(base[:, 1].min()), float(np.linalg.norm(slope))
    outward, reach = hull.equations[:, :2], -hull.equations[:, 2]
    needed = outward @ slope[[0, 2]] if friction >= steepness else np.zeros(len(reach))  # else it never rests
    if velocity.any() or friction < steepness:
        first = (velocity if velocity.any() else slope)[[0, 2]]
        last = slope[[0, 2]] if steepness else first
        needed = np.maximum(needed, min(friction, 1e9) * _farthest(outward, first / np.linalg.norm(first), last / np.linalg.norm(last)))
    return bool((height * needed < reach).all())


def _farthest(outward: Array, first: Array, last: Array) -> Array:
    """The largest component along each unit vector, shape (n, 2), of the directions between two directions."""
    between = (outward @ (first + last) > 0.0) & (np.minimum(outward @ first, outward @ last) >= first @ last)
    return np.where(between, 1.0, np.maximum(outward @ first, outward @ last))
