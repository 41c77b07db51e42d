"""The engine `jolt`: a rigid body of Jolt, in WebAssembly in a process of Node.js; in single precision."""

from typing import Any, ClassVar

import numpy as np

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.node_engine import NodeEngine
from dropspin.comparisons.engines.packages import JOLT
from dropspin.scenarios import Scenario

GRIPPING, SLOWEST = 1e6, 0.01
SYSTEM = {
    "mPenetrationSlop": (0.0, "m; else a body stays as deep as it lands, up to 2 cm"),
    "mUseBodyPairContactCache": (False, "normals that are kept turn with the body; a stick that slips errs by 1.1 cm, not 0.9 mm"),
}
BODY = {
    "mAllowSleeping": (False, "by default bodies slower than 0.03 m/s sleep after 0.5 s"),
    "mApplyGyroscopicForce": (True, "off by default; a tumbling body then keeps its angular velocity"),
    "mMaxLinearVelocity": (1e15, "m/s, 500 by default"),
    "mMaxAngularVelocity": (1e15, "rad/s, 47 by default"),
}
REASONS = {name: why for name, (_, why) in (SYSTEM | BODY).items()} | {
    "mMinVelocityForRestitution": "m/s, the scene's rest speed; 1 by default",
    "mSpeculativeContactDistance": "m, a step's fall; at 2 cm bodies rebound above the floor, a box that falls 1 m by up to 4 mm at 1 ms",
    "mLinearDamping": "(1 - exp(-rate dt))/dt, for Jolt multiplies by 1 - c dt; 0.05 by default; mAngularDamping is the same",
    "mFriction": f"{GRIPPING:g} where the floor grips; on both surfaces, as restitution",
}
"""Effects were measured at 1 ms without the one setting."""


class Jolt(NodeEngine):
    """A rigid body of Jolt in Node.js."""

    name, package, order, precision, reasons = "jolt", JOLT, 1.0, np.float32, REASONS
    choices: ClassVar = {"profile": mapping.PROFILES, "floor": ("plane", "box"), "beside": mapping.BESIDE}
    representations: ClassVar = ("floor", "beside")

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
        calibrated, body = ({name: value for name, (value, _) in chosen.items()} for chosen in (SYSTEM, BODY))
        return {"system": calibrated | system, "body": body | damping, "surface": surface}
