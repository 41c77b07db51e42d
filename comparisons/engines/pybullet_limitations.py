"""What Bullet cannot do, where a motion met it: balls and hulls in place of shapes, friction, and rotations that are too fast."""

from collections.abc import Iterator

import numpy as np

from dropspin.comparisons.engines.base import Array, KnownLimitation
from dropspin.scenarios import Scenario, Trajectory
from dropspin.scenarios.bodies import Body, Cylinder, Ellipsoid, Mesh
from dropspin.scenarios.bodies.hull import MERIDIANS
from dropspin.scenarios.mechanics import angular_momentum, kinetic_energy
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.state import ORIENTATION, SPIN, UP, VELOCITY

ALMOST = 0.999
NO_PUSH = 1e-6  # relative to what gravity adds in a step
MOST_BALLS = 16  # createCollisionShapeArray drops all others without notice
STRONGEST_FRICTION = 10.0  # Bullet clamps the coefficient of a contact to this
UPRIGHT, LEVEL = 0.01, 1e-6  # rad; a difference of heights of corners, relative to the size of the body
LARGEST_TURN = np.pi / 4  # rad a step; beyond it Bullet's rotation is too small


def limitations_met(scene: Scenario, rows: Array, dt: float, is_maximal: bool) -> Iterator[KnownLimitation]:
    """Bullet's known limitations that a motion met, with states at every step, shape (n, 13)."""
    turn = float(np.linalg.norm(rows[:, SPIN], axis=1).max()) * dt
    if turn > LARGEST_TURN:
        yield KnownLimitation(
            f"the body turns by up to {turn:.3g} rad a step; Bullet's rotations are too small beyond π/4", {"orientation_error": np.pi}
        )
    if scene.floor is None:
        return
    if isinstance(scene.body, Ellipsoid):
        yield _of_facets(scene, rows, dt)
    if isinstance(scene.body, Cylinder) and _stands(scene.body, rows):
        yield KnownLimitation("Bullet gives a cylinder that lands upright one contact point in the first step, so that it tips")
    if scene.wall is not None:
        return  # the impulse of the floor is not known apart from those of walls
    fall, friction = dt * scene.acceleration, scene.floor.coefficient
    pushes = np.diff(rows[:, VELOCITY], axis=0) - fall
    along, up = np.hypot(pushes[:, 0], pushes[:, 2]), pushes[:, 1]
    if is_hull(scene.body) and _lands_flat(scene.body, rows[int(np.argmax(up > NO_PUSH * np.linalg.norm(fall)))]):
        yield KnownLimitation("Bullet gives a convex hull one contact point in a step: one that lands on a face or an edge tips")
    if np.isinf(friction) and bool(np.any((up > NO_PUSH * np.linalg.norm(fall)) & (along > ALMOST * STRONGEST_FRICTION * up))):
        yield KnownLimitation(
            f"a contact needs more than {STRONGEST_FRICTION:g} times its normal force to stick; Bullet clamps friction there, so it slips"
        )
    if is_maximal and 0.0 < friction < np.inf:
        struck = (up > NO_PUSH * np.abs(up).max()) & (along > (1.0 + NO_PUSH) * friction * up)
        if struck.any():
            ratio = float((along[struck] / up[struck]).max()) / friction
            yield _turning_slip(scene, rows, dt, ratio, friction * float(up[struck].max()))


def _of_facets(scene: Scenario, rows: Array, dt: float) -> KnownLimitation:
    """The limitation of an ellipsoid that is the hull of points, with states at every step, shape (n, 13).

    A contact point is wrong by up to half the distance d of neighbouring points. An impact at the speed u then changes the angular velocity
    wrongly by up to M (1 + e) u d / I, and the velocity by up to its lever times that, or (1 + e) u.
    """
    assert scene.floor is not None
    body = scene.body
    left = dt * len(rows)
    change = (1.0 + scene.floor.restitution) * max(0.0, -float(rows[:, 8].min()))
    turned = body.mass * change * body.size * np.pi / MERIDIANS / float(np.linalg.eigvalsh(body.inertia_tensor)[0])
    return KnownLimitation(
        f"Bullet has no ellipsoids: this one is the convex hull of {len(body.outline.vertices)} points",
        {"position_error": min(change, turned * body.size) * left, "orientation_error": min(np.pi, turned * left)},
    )


def is_hull(body: Body) -> bool:
    """Whether a body is Bullet's convex hull of its corners, because these are too many for a compound shape."""
    return isinstance(body, Mesh) and len(body.hull) > MOST_BALLS


def _stands(body: Cylinder, rows: Array) -> bool:
    """Whether a cylinder comes to the floor with its axis within `UPRIGHT` of the vertical, in states of shape (n, 13)."""
    is_upright = np.abs(rotate(rows[:, ORIENTATION], np.broadcast_to(UP, (len(rows), 3)))[:, 1]) > np.cos(UPRIGHT)
    return bool(np.any(is_upright & (rows[:, 1] <= body.size)))


def _lands_flat(body: Body, state: Array) -> bool:
    """Whether several corners are lowest in a state, shape (13,)."""
    return bool(np.ptp(body.lowest(state[ORIENTATION], LEVEL), axis=0).max() > UPRIGHT * body.size)


def _turning_slip(scene: Scenario, rows: Array, dt: float, ratio: float, wrong: float) -> KnownLimitation:
    """The limitation of friction in maximal coordinates.

    Bullet limits friction along the first direction of the slip and across it, each by µ times the normal force. Where the slip turns in an
    impact with the normal impulse J, the impulse along the floor is wrong by up to µ J, and the velocity at the floor by a = µ J/M.

    Args:
        scene: The scene.
        rows: States at every step, shape (n, 13).
        dt: Time step [s].
        ratio: The largest impulse along the floor, over µ times the normal one.
        wrong: a, the error of the velocity at the floor [m/s].
    """
    body, left = scene.body, dt * len(rows)
    motion = Trajectory.from_states(dt * np.arange(len(rows), dtype=float), rows)
    fastest = float(np.max(np.linalg.norm(motion.velocity, axis=1) + body.size * np.linalg.norm(motion.angular_velocity, axis=1)))
    height = scene.clearance if scene.starts_above_floor else body.size
    g = abs(float(scene.acceleration[1]))
    energy = max(body.mass * g * height, float(kinetic_energy(scene, motion)[0]))
    spin = float(np.linalg.norm(angular_momentum(scene, motion), axis=1).max())
    sizes = {
        "position_error": wrong * left,
        "orientation_error": min(np.pi, body.mass * body.size * wrong / float(np.linalg.eigvalsh(body.inertia_tensor)[0]) * left),
        "energy_error": body.mass * wrong * (fastest + 0.5 * wrong) / energy,
        "friction_cone_excess": (np.sqrt(2.0) - 1.0) * wrong / np.sqrt(2.0 * energy / body.mass),
        "friction_push": body.mass * wrong * fastest / energy,
    }
    if spin > 0.0:
        turned = body.mass * body.size * wrong / spin
        sizes |= {"angular_momentum_error": turned, "angular_momentum_direction_error": min(np.pi, 0.5 * np.pi * turned)}
    if g > 0.0 and scene.starts_above_floor:
        sizes["bounce_height_error"] = wrong * (fastest + 0.5 * wrong) / (g * height)
    return KnownLimitation(
        "in maximal coordinates Bullet limits friction along the initial slip and across it separately: the slip turns, and the impulse "
        f"along the floor is up to {ratio:.3g} µ times the normal one; coordinates=multibody keeps the cone",
        sizes,
    )
