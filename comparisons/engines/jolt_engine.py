"""The engine `jolt`: a rigid body of Jolt, in WebAssembly in a process of Node.js; in single precision."""

from typing import Any, ClassVar

import numpy as np

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.node_engine import NodeEngine
from dropspin.comparisons.engines.packages import JOLT
from dropspin.comparisons.engines.settings import calibrated_values, settings_beside
from dropspin.scenarios import Scenario

GRIPPING, SLOWEST = 1e6, 0.01
SYSTEM, BODY, SURFACE = settings_beside(__file__).values()


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
