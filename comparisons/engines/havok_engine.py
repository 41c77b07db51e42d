"""The engine `havok`: a rigid body of Havok's package for the web, in WebAssembly in a process of Node.js; in single precision.

Havok has no gyroscopic term. In a step it takes 4 dt over the ideal step as the number of substeps, rounded up, and 8 at most.
"""

from typing import Any

import numpy as np

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.node_engine import NodeEngine
from dropspin.comparisons.engines.packages import HAVOK
from dropspin.comparisons.engines.rapier_scenes import refusal
from dropspin.scenarios import Scenario

GRIPPING, SLOWEST, FASTEST = 1e6, 1e-6, 100.0
UNIT = 1.0 / 256.0
REASONS = {
    "unit": "m; Havok slows down what is slower than 0.1 units/s, by 0.31 units/s²",
    "idealStepTime": "s, so that a step has four substeps; with one, as by default at 4 ms, a box on an edge rebounds with 0.35, not 0.5",
    "speedLimit": "units/s and rad/s, 200 and 100 by default",
    "alwaysActive": "never falls asleep",
    "friction": f"{GRIPPING:g} where the floor grips; on both surfaces, as restitution",
    "angularDamping": "the scene's rate; 0.1 by default",
}
"""Effects were measured at 1 ms without the one setting."""


class Havok(NodeEngine):
    """A rigid body of Havok in Node.js."""

    name, package, order, precision, reasons = "havok", HAVOK, 1.0, np.float32, REASONS

    def declines(self, scene: Scenario) -> str | None:
        if 0.0 < np.linalg.norm(scene.start.velocity) < SLOWEST:
            return f"Havok takes a velocity of 1e-12 m/s for 0; the adapter takes {SLOWEST:g} m/s and more"
        if self.is_default and np.linalg.norm(scene.start.angular_velocity) > FASTEST:
            return f"Havok starts no body with more than {FASTEST:g} rad/s by default"
        return refusal(scene, "box", "Havok")

    def world_settings(self, scene: Scenario, dt: float) -> dict[str, Any]:
        floor, rates = scene.floor, mapping.decay_rates(scene)
        surface = {"restitution": floor.restitution, "friction": mapping.friction_of(floor, GRIPPING)} if floor else {}
        damping = {f"{motion}Damping": rate for motion, rate in rates.items()}
        if self.is_default:
            return {"unit": 1.0, **surface, **(damping if scene.damping else {})}
        return {"unit": UNIT, "idealStepTime": dt, "speedLimit": 1e15, "alwaysActive": True, **surface, **damping}
