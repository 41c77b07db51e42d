"""The engine `jolt`: a rigid body of Jolt, in WebAssembly in a process of Node.js; in single precision."""

from typing import Any, ClassVar

import numpy as np

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.node_engine import NodeEngine
from dropspin.comparisons.engines.options import Setting, calibrated_values
from dropspin.comparisons.engines.packages import JOLT
from dropspin.scenarios import Scenario

GRIPPING, SLOWEST = 1e6, 0.01
SYSTEM = {
    "mPenetrationSlop": Setting(0.02, "depth that is not corrected", 0.0, "m; else a body stays as deep as it lands, up to 2 cm", "m"),
    "mUseBodyPairContactCache": Setting(
        True,
        "contacts are kept while a body hardly moves",
        False,
        "normals that are kept turn with the body; a stick that slips errs by 1.1 cm, not 0.9 mm",
    ),
    "mMinVelocityForRestitution": Setting(
        1.0,
        "impact speed below which a body does not rebound",
        why="m/s, the scene's rest speed; 1 by default",
        unit="m/s",
        is_computed=True,
    ),
    "mSpeculativeContactDistance": Setting(
        0.02,
        "distance at which a contact begins",
        why="m, a step's fall; at 2 cm bodies rebound above the floor, a box that falls 1 m by up to 4 mm at 1 ms",
        unit="m",
        is_computed=True,
    ),
    "mBaumgarte": Setting(0.2, "share of the depth that a step corrects", most=1.0),
    "mNumVelocitySteps": Setting(10, "iterations for velocities", least=2),
    "mNumPositionSteps": Setting(2, "iterations for positions"),
}
"""Of the physics system."""
BODY = {
    "mAllowSleeping": Setting(True, "the body may fall asleep", False, "by default bodies slower than 0.03 m/s sleep after 0.5 s"),
    "mApplyGyroscopicForce": Setting(False, "the gyroscopic term", True, "off by default; a tumbling body then keeps its angular velocity"),
    "mMaxLinearVelocity": Setting(500.0, "largest speed", 1e15, "m/s, 500 by default", "m/s"),
    "mMaxAngularVelocity": Setting(47.12389, "largest spin", 1e15, "rad/s, 47 by default", "rad/s"),
    "mLinearDamping": Setting(
        0.05,
        "damping",
        why="(1 - exp(-rate dt))/dt, for Jolt multiplies by 1 - c dt; 0.05 by default; mAngularDamping is the same",
        unit="1/s",
        is_computed=True,
    ),
    "mAngularDamping": Setting(0.05, "damping of rotation", unit="1/s", is_computed=True),
}
"""Of the body."""
SURFACE = {
    "mRestitution": Setting(0.0, "of body and floor", is_computed=True, most=1.0),
    "mFriction": Setting(
        0.2, "of body and floor", why=f"{GRIPPING:g} where the floor grips; on both surfaces, as restitution", is_computed=True
    ),
}
"""Effects were measured at 1 ms without the one setting."""


class Jolt(NodeEngine):
    """A rigid body of Jolt in Node.js."""

    name, package, order, precision = "jolt", JOLT, 1.0, np.float32
    choices: ClassVar = {"profile": mapping.PROFILES, "floor": ("plane", "box"), "beside": mapping.BESIDE}
    representations: ClassVar = ("floor", "beside")
    groups: ClassVar = {"system": SYSTEM, "body": BODY, "surface": SURFACE}
    settings: ClassVar = SYSTEM | BODY | SURFACE

    def declines(self, scene: Scenario) -> str | None:
        if 0.0 < np.linalg.norm(scene.start.angular_velocity) < SLOWEST:
            return f"Jolt does not turn a body by less than 1e-6 rad in a step; the adapter takes {SLOWEST:g} rad/s and more"
        return mapping.refusal_of_floor(scene, self.option("floor"))

    def world_settings(self, scene: Scenario, dt: float) -> dict[str, Any]:
        floor, rates = scene.floor, mapping.decay_rates(scene)
        damping = {f"m{motion.title()}Damping": float(-np.expm1(-rate * dt)) / dt for motion, rate in rates.items()}
        surface = {"mRestitution": floor.restitution, "mFriction": mapping.friction_of(floor, GRIPPING)} if floor else {}
        if self.is_default:
            return {"system": {}, "body": damping if scene.damping else {}, "surface": surface}
        fall = float(np.linalg.norm(scene.acceleration)) * dt**2
        system = {"mMinVelocityForRestitution": floor.rest_speed if floor else 0.0, "mSpeculativeContactDistance": fall}
        return {"system": calibrated_values(SYSTEM) | system, "body": calibrated_values(BODY) | damping, "surface": surface}
