"""The settings of Bullet that calibration uses, and why.

Maximal coordinates (btRigidBody) give v+ = -e v exactly once three settings are 0: the contact thresholds that start a collision early,
the error reduction that adds penetration to the rebound, and the speed below which Bullet drops restitution.
"""

import numpy as np

from dropspin.scenarios import Scenario

STRONGEST_FRICTION = 10.0  # Bullet clamps the coefficient of a contact to this
FASTEST = 1e12  # m/s and rad/s; Bullet clamps the speeds of a multibody to 100 by default
RESIDUAL = float(np.finfo(float).eps)  # of the speed that gravity gives in a step; Bullet's residuals are squares of speeds

REASONS = {
    "coordinates": "maximal: a rebound of e times the approach speed; a multibody's is e (u + g dt), and its speeds are clamped at 100",
    "fixedTimeStep": "the step asked for; Bullet's own is 1/240 s",
    "numSubSteps": "no steps within a step, whose states would not be recorded",
    "deterministicOverlappingPairs": "contacts in the same order in every run",
    "restitution": "the scene's; Bullet multiplies those of two bodies, and the floor's is 1",
    "solverResidualThreshold": "the square of one ulp of the speed that gravity gives in a step: solved to rounding, for two thirds of the "
    "cost of 0; at the default 1e-7 a resting box jitters at 5 mm/s, a corner errs by 5e-6",
    "numSolverIterations": "enough to solve contacts to rounding; the default, 50, leaves an error at impacts on a floor that grips",
    "contactERP": "corrects no depth; at the default 0.08 a resting box jitters at 3 mm/s, and rebounds gain the depth over a step",
    "erp": "as contactERP, for joints",
    "frictionERP": "as contactERP, for friction",
    "contactSlop": "tolerates no depth",
    "restitutionVelocityThreshold": "the scene's rest speed, by default 0; Bullet drops restitution below 0.2 m/s",
    "useSplitImpulse": "keeps corrections of depth out of the velocities",
    "splitImpulsePenetrationThreshold": "at any depth",
    "enableConeFriction": "the same friction in every direction, for a multibody; maximal coordinates ignore it, and limit friction along "
    "the initial slip and across it separately, so that friction is up to 1.41 times larger where the slip turns in an impact",
    "lateralFriction": f"the scene's coefficient; {STRONGEST_FRICTION:g}, the most that Bullet allows, where the floor grips",
    "contactProcessingThreshold": "contacts begin at touch; at the default, restitution 0.5 becomes 0.248 at 1 ms and 0.024 at 0.25 ms",
    "linearDamping": "1 - exp(-rate), 0 without damping; a multibody's default is 0.04",
    "angularDamping": "as linearDamping",
    "activationState": "never falls asleep",
    "maxJointVelocity": "no clamp of a multibody's speeds, which are by default 100 m/s and 100 rad/s (velocity_clamp=kept keeps them)",
}
"""Effects were measured on a ball dropped from 1 m and a box at rest, restitution 0.5, without the one setting."""


def world_parameters(scene: Scenario, dt: float) -> dict[str, float]:
    """The calibrated parameters of the physics engine at a time step [s]."""
    return {
        "fixedTimeStep": dt,
        "numSubSteps": 0,
        "solverResidualThreshold": (RESIDUAL * float(np.linalg.norm(scene.acceleration)) * dt) ** 2,
        "numSolverIterations": 500,
        "erp": 0.0,
        "contactERP": 0.0,
        "frictionERP": 0.0,
        "contactSlop": 0.0,
        "restitutionVelocityThreshold": 0.0 if scene.floor is None else scene.floor.rest_speed,
        "useSplitImpulse": 1,
        "splitImpulsePenetrationThreshold": 0.0,
        "enableConeFriction": 1,
        "deterministicOverlappingPairs": 1,
    }


def damping_properties(scene: Scenario, default: bool) -> dict[str, float]:
    """Bullet's damping of a scene; maximal coordinates damp as v (1 - k)^t, so that k = 1 - exp(-rate) is the scene's decay.

    In the default profile a scene without damping keeps Bullet's default of 0.04.
    """
    if scene.damping is None:
        return {} if default else {"linearDamping": 0.0, "angularDamping": 0.0}
    linear, angular = scene.damping.linear, scene.damping.angular
    if default:
        return {"linearDamping": linear, "angularDamping": angular}
    return {"linearDamping": float(-np.expm1(-linear)), "angularDamping": float(-np.expm1(-angular))}


def contact_properties(scene: Scenario, default: bool) -> dict[str, float]:
    """Bullet's contact settings of the body on the scene's floor."""
    assert scene.floor is not None
    friction = {"none": 0.0, "infinite": STRONGEST_FRICTION}.get(str(scene.floor.friction))
    surface = {"restitution": scene.floor.restitution, "lateralFriction": float(scene.floor.friction) if friction is None else friction}
    return surface if default else surface | {"contactProcessingThreshold": 0.0}
