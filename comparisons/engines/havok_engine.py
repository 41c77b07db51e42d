"""The engine `havok`: a rigid body of Havok's package for the web, in WebAssembly in a process of Node.js; in single precision.

Havok has no gyroscopic term. In a step it takes 4 dt over the ideal step as the number of substeps, rounded up, and 8 at most.
"""

from typing import Any, ClassVar

import numpy as np

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.node_engine import NodeEngine
from dropspin.comparisons.engines.packages import HAVOK
from dropspin.comparisons.engines.rapier_scenes import refusal, surface_of
from dropspin.comparisons.engines.settings import calibrated_values, settings_beside
from dropspin.scenarios import Scenario

SLOWEST, FASTEST = 1e-6, 100.0
WORLD, BODY, SURFACE = settings_beside(__file__).values()


class Havok(NodeEngine):
    """A rigid body of Havok in Node.js."""

    name, package, order, precision = "havok", HAVOK, 1.0, np.float32
    groups: ClassVar = {"world": WORLD, "body": BODY, "surface": SURFACE}
    settings: ClassVar = WORLD | BODY | SURFACE

    def declines(self, scene: Scenario) -> str | None:
        if 0.0 < np.linalg.norm(scene.start.velocity) < SLOWEST:
            return f"Havok takes a velocity of 1e-12 m/s for 0; the adapter takes {SLOWEST:g} m/s and more"
        if self.is_default and np.linalg.norm(scene.start.angular_velocity) > FASTEST:
            return f"Havok starts no body with more than {FASTEST:g} rad/s by default"
        return refusal(scene, "box", "Havok")

    def world_settings(self, scene: Scenario, dt: float) -> dict[str, Any]:
        surface, damping = surface_of(scene), {f"{motion}Damping": rate for motion, rate in mapping.decay_rates(scene).items()}
        if self.is_default:
            return {"world": {"unit": 1.0}, "body": damping if scene.damping else {}, "surface": surface}
        world = calibrated_values(WORLD) | {"idealStepTime": dt}
        return {"world": world, "body": calibrated_values(BODY) | damping, "surface": surface}
