"""The error bounds that follow from MuJoCo's friction cone and from its largest impedance, for a motion with calibrated settings."""

from collections.abc import Iterator

import numpy as np

from dropspin.comparisons.engines.base import Array, KnownLimitation
from dropspin.comparisons.engines.mujoco_settings import IMPEDANCE
from dropspin.comparisons.measuring.contact_runs import Mask
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Cylinder
from dropspin.scenarios.bodies.surface import rise_of_centre
from dropspin.scenarios.mechanics import angular_momentum, kinetic_energy
from dropspin.scenarios.rotations import cross, length, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, SPIN, UP, VELOCITY
from dropspin.scenarios.surfaces import Surface, Wall
from dropspin.scenarios.trajectory import Trajectory

NO_FORCE = 1e-6  # relative to gravity and to the size of the body
AT_REST = 1e-3  # m/s; a slip that friction has stopped, and a body that rests, may still have this speed


def limitations_met(scene: Scenario, states: Array, dt: float, *, estimated: bool = False) -> Iterator[KnownLimitation]:
    """The limitations that a motion met.

    Args:
        scene: The scene.
        states: Shape (n, 13), one for each time step.
        dt: Time step [s].
        estimated: Whether the regularisation of a contact has MuJoCo's estimate of its inverse inertia, which is exact for balls alone, and
            never larger than the exact one.
    """
    times = dt * np.arange(len(states), dtype=float)
    box = int(estimated and not scene.body.is_ball)
    for surface in scene.surfaces:
        if surface is not scene.floor and not isinstance(surface.friction, float):
            continue  # the restitution of walls has no metric
        moved = surface.as_floor(states) if isinstance(surface, Wall) else states
        near = moved[:-1, 1] <= scene.body.size
        before, after = moved[:-1][near], moved[1:][near]
        turned = before[:, None, ORIENTATION]
        arms = rotate(turned, scene.body.hull) - rise_of_centre(turned, scene.body.semi_axes)
        heights = before[:, None, 1] + arms[..., 1]
        touching = heights <= 0.0
        if surface is scene.floor and isinstance(scene.body, Cylinder):
            yield from _of_upright_cylinder(scene, before[:, 8], after[:, 8], heights, dt)
        approach = float(-moved[:, 8].min())
        shared = surface.friction != "none" or (touching.sum(axis=1) > 1 - box).any()
        if surface is scene.floor and approach > AT_REST and shared:
            yield _of_impedance(scene, before, arms, touching, approach)
        if isinstance(surface.friction, float):
            velocities = after[:, None, VELOCITY] + cross(after[:, None, SPIN], arms)
            slip = float(np.hypot(velocities[..., 0], velocities[..., 2])[touching].max(initial=0.0))
            if slip > AT_REST:
                left = (len(states) - 1 - np.flatnonzero(near)[touching.any(axis=1)][0]) * dt
                yield _of_friction_cone(scene, surface, Trajectory.from_states(times, states), slip, max(0.0, approach), left)


def _of_upright_cylinder(scene: Scenario, before: Array, after: Array, heights: Array, dt: float) -> Iterator[KnownLimitation]:
    """A cylinder that falls on below the floor, by upward speeds before and after steps, shape (n,), and heights of its rims, (n, 2)."""
    is_free = (before < 0.0) & (np.abs(after - before - dt * scene.acceleration[1]) <= NO_FORCE * np.abs(after - before))
    depth = -float(heights[is_free].min(initial=0.0))
    if depth > NO_FORCE * scene.body.size:
        yield KnownLimitation(
            "MuJoCo takes the lowest point of a cylinder that is upright to 1e-15 rad from rounding errors: it falls without a contact to "
            f"{depth:.2g} m below the floor"
        )


def _of_impedance(scene: Scenario, before: Array, arms: Array, touching: Mask, approach: float) -> KnownLimitation:
    """The change of restitution where several forces share an impulse: those of several corners, or friction and the normal force.

    Each has the regularisation R = (1 - d)/d A with its own inverse inertia A, where d is the impedance. It leaves up to R/A of the
    contact's change of velocity, by as much as M A for a body of mass M.

    Args:
        scene: The scene, with a floor.
        before: States before each step, shape (n, 13).
        arms: The corners relative to the centre of mass [m], shape (n, corners, 3).
        touching: Whether they are below the floor, shape (n, corners).
        approach: The largest speed of fall [m/s].
    """
    assert scene.floor is not None
    velocities = (before[:, None, VELOCITY] + cross(before[:, None, SPIN], arms))[touching]
    stopped = velocities[:, 1:2] if scene.floor.friction == "none" else velocities
    turned = unrotate(before[:, None, ORIENTATION], cross(arms, np.broadcast_to(UP, arms.shape)))[touching]
    inverse_inertias = 1.0 + scene.body.mass * np.sum(turned * np.linalg.solve(scene.body.inertia_tensor, turned.T).T, axis=1)
    speed = (1.0 + scene.floor.restitution) * float(length(stopped).max(initial=0.0))
    changed = (1.0 - IMPEDANCE) / IMPEDANCE * float(inverse_inertias.max(initial=0.0)) * speed / approach
    sizes = {"restitution_error": changed} | _of_bounce(scene, scene.floor.restitution * approach, changed * approach)
    return KnownLimitation(
        f"several forces share an impulse; MuJoCo's largest impedance, {IMPEDANCE:g}, changes the restitution by up to {changed:.2g}", sizes
    )


def _of_friction_cone(scene: Scenario, surface: Surface, motion: Trajectory, slip: float, approach: float, left: float) -> KnownLimitation:
    """The errors of contacts that slip under Coulomb friction, at the corners that begin a step below the floor or behind the wall.

    MuJoCo's friction cone is convex: a contact that slips at s [m/s] gains up to a = µ s of rebound speed (dual cone, one-step damper).
    A hop from the floor takes 2 (e u + a)/g, where u is the approach speed; during 2 a/g of it friction acts too late, so that the slip is
    wrong by up to 2 µ a until the next landing compensates. From a wall there is no landing, and the velocities stay wrong.

    Args:
        scene: The scene.
        surface: The floor or the wall.
        motion: The motion.
        slip: The largest speed of slip s [m/s].
        approach: The largest speed of approach u [m/s].
        left: Time from the first contact to the end [s].
    """
    e, g = surface.restitution, -float(scene.acceleration[1])
    body, is_wall = scene.body, isinstance(surface, Wall)
    fastest = approach + float(np.linalg.norm(scene.acceleration)) * (motion.t[1] - motion.t[0])  # the exact impact may be a step later
    added = surface.coefficient * slip
    late = 2.0 * surface.coefficient * added
    hop = left if is_wall else 2.0 * (e * fastest + added) / g if g > 0.0 else 0.0
    pushed = late if body.is_ball else late + added  # the normal force of a ball has no torque, and its friction turns it
    turning = pushed / body.size  # of a body that stays flat on a floor
    if body.is_ball or is_wall:
        turning = body.mass * body.size * pushed / np.min(np.linalg.eigvalsh(body.inertia_tensor))
    lifted = body.mass * (e * fastest * added + 0.5 * added**2)
    height = scene.clearance if scene.starts_above_floor else body.size
    energy = max(body.mass * abs(g) * height, float(kinetic_energy(scene, motion)[0]))
    sizes = {
        "position_error": (late + added) * hop,
        "orientation_error": turning * hop,
        "energy_error": (body.mass * slip * late + lifted) / energy,
        "energy_gain": lifted / energy,
    }
    spin = float(length(angular_momentum(scene, motion)).max())
    if spin > 0.0:
        turned = body.mass * body.size * pushed / spin
        sizes |= {"angular_momentum_error": turned, "angular_momentum_direction_error": 0.5 * np.pi * turned}
    if not is_wall:
        sizes |= _of_bounce(scene, e * fastest, added) | ({"restitution_error": added / approach} if approach > 0.0 else {})
    return KnownLimitation(
        f"contacts slip at up to {slip:.3g} m/s; with calibrated contacts MuJoCo's friction cone adds up to µ times that, {added:.3g} m/s, "
        "to the rebound",
        sizes,
    )


def _of_bounce(scene: Scenario, rebound: float, added: float) -> dict[str, float]:
    """The error of the bounce height if a speed is added to that of the rebound [m/s]; empty for a scene without a bounce."""
    g = -float(scene.acceleration[1])
    if g <= 0.0 or not scene.starts_above_floor:
        return {}
    return {"bounce_height_error": (2.0 * rebound * added + added**2) / (2.0 * g * scene.clearance)}
