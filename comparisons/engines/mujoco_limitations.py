"""The error bounds that follow from MuJoCo's friction cone and from its largest impedance, for a motion with calibrated settings."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.engines.base import Array, KnownLimitation
from dropspin.comparisons.engines.mujoco_model import IMPEDANCE
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies.surface import rise_of_centre
from dropspin.scenarios.mechanics import angular_momentum, kinetic_energy
from dropspin.scenarios.rotations import cross, length, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, SPIN, UP, VELOCITY
from dropspin.scenarios.trajectory import Trajectory

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
    if scene.floor is None:
        return
    before, after = states[:-1], states[1:]
    arms = rotate(before[:, None, ORIENTATION], scene.body.vertices) - rise_of_centre(before[:, None, ORIENTATION], scene.body.semi_axes)
    touching = before[:, None, 1] + arms[..., 1] <= 0.0
    box = int(estimated and not scene.body.is_ball)
    if float(-states[:, 8].min()) > AT_REST and (scene.floor.friction != "none" or (touching.sum(axis=1) > 1 - box).any()):
        yield _of_impedance(scene, before, arms, touching)
    if isinstance(scene.floor.friction, float):
        velocities = after[:, None, VELOCITY] + cross(after[:, None, SPIN], arms)
        slip = float(np.hypot(velocities[..., 0], velocities[..., 2])[touching].max(initial=0.0))
        if slip > AT_REST:
            yield _of_friction_cone(scene, scene.floor.friction, states, slip, dt)


def _of_impedance(scene: Scenario, before: Array, arms: Array, touching: NDArray[np.bool_]) -> KnownLimitation:
    """The change of restitution where several forces share an impulse: those of several corners, or friction and the normal force.

    Each has the regularisation R = (1 - d)/d A with its own inverse inertia A, where d is the impedance. It leaves up to R/A of the
    contact's change of velocity, by as much as M A for a body of mass M.

    Args:
        scene: The scene, with a floor.
        before: States before each step, shape (n, 13).
        arms: The corners relative to the centre of mass [m], shape (n, corners, 3).
        touching: Whether they are below the floor, shape (n, corners).
    """
    assert scene.floor is not None
    velocities = (before[:, None, VELOCITY] + cross(before[:, None, SPIN], arms))[touching]
    stopped = velocities[:, 1:2] if scene.floor.friction == "none" else velocities
    turned = unrotate(before[:, None, ORIENTATION], cross(arms, np.broadcast_to(UP, arms.shape)))[touching]
    inverse_inertias = 1.0 + scene.body.mass * np.sum(turned * np.linalg.solve(scene.body.inertia_tensor, turned.T).T, axis=1)
    speed = (1.0 + scene.floor.restitution) * float(length(stopped).max(initial=0.0))
    approach = float(-before[:, 8].min())
    changed = (1.0 - IMPEDANCE) / IMPEDANCE * float(inverse_inertias.max(initial=0.0)) * speed / approach
    sizes = {"restitution_error": changed} | _of_bounce(scene, scene.floor.restitution * approach, changed * approach)
    return KnownLimitation(
        f"several forces share an impulse; MuJoCo's largest impedance, {IMPEDANCE:g}, changes the restitution by up to {changed:.2g}", sizes
    )


def _of_friction_cone(scene: Scenario, friction: float, states: Array, slip: float, dt: float) -> KnownLimitation:
    """The errors of contacts that slip under Coulomb friction, at the corners that begin a step below the floor.

    MuJoCo's friction cone is convex: a contact that slips at s [m/s] gains up to a = µ s of rebound speed (dual cone, one-step damper).
    The hop takes 2 (e u + a)/g, where u is the approach speed; during 2 a/g of it friction acts too late, so that the slip is wrong by up
    to 2 µ a until the next landing compensates.
    """
    assert scene.floor is not None
    e, g, approach = scene.floor.restitution, -float(scene.acceleration[1]), max(0.0, float(-states[:, 8].min()))
    fastest = approach + max(g, 0.0) * dt  # the exact impact may be a step later
    added = friction * slip
    late = 2.0 * friction * added
    hop = 2.0 * (e * fastest + added) / g if g > 0.0 else 0.0
    body = scene.body
    # The normal force of a ball has no torque, and its friction turns it; other bodies stay flat.
    turning = body.mass * body.size * late / np.min(np.diag(body.inertia_tensor)) if body.is_ball else (late + added) / body.size
    lifted = body.mass * (e * fastest * added + 0.5 * added**2)
    motion = Trajectory.from_states(dt * np.arange(len(states), dtype=float), states)
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
        turned = body.mass * body.size * (late + (0.0 if body.is_ball else added)) / spin
        sizes |= {"angular_momentum_error": turned, "angular_momentum_direction_error": 0.5 * np.pi * turned}
    if approach > 0.0:
        sizes["restitution_error"] = added / approach
    sizes |= _of_bounce(scene, e * fastest, added)
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
