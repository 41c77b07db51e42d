"""The engine `cannon-es`: a rigid body of cannon-es, in a process of Node.js.

cannon-es has no gyroscopic term. It limits the impulse of friction at a contact in a step to µ M g, in place of µ times the normal impulse.
"""

from typing import Any, ClassVar

import numpy as np

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.node_engine import NodeEngine
from dropspin.comparisons.engines.packages import CANNON_ES
from dropspin.comparisons.engines.settings import calibrated_values, settings_beside
from dropspin.scenarios import Scenario
from dropspin.scenarios.rotations import rotate

GRIPPING = 1e9
CORNERS_OF_A_FACE = 4
WORLD, SOLVER, CONTACT, BODY = settings_beside(__file__).values()


class CannonES(NodeEngine):
    """A rigid body of cannon-es in Node.js."""

    name, package, order = "cannon-es", CANNON_ES, 1.0
    choices: ClassVar = {"profile": mapping.PROFILES, "floor": ("plane", "box"), "beside": mapping.BESIDE}
    representations: ClassVar = ("floor", "beside")
    groups: ClassVar = {"world": WORLD, "solver": SOLVER, "contact": CONTACT, "body": BODY}
    settings: ClassVar = WORLD | SOLVER | CONTACT | BODY

    def declines(self, scene: Scenario) -> str | None:
        floor = scene.floor
        if floor is not None and not isinstance(floor.friction, str) and not _lies(scene):
            return "cannon-es limits friction by the body's weight, not by the normal force; a ball or a box has to lie on the floor"
        return mapping.refusal_of_floor(scene, self.option("floor")) or mapping.refusal_of_rest_speed(scene, "cannon-es")

    def world_settings(self, scene: Scenario, dt: float) -> dict[str, Any]:
        floor, rates = scene.floor, mapping.decay_rates(scene)
        damping = {f"{motion}Damping": float(-np.expm1(-rate)) for motion, rate in rates.items()}
        contact: dict[str, Any] = {"restitution": floor.restitution, "friction": mapping.friction_of(floor, GRIPPING)} if floor else {}
        if self.is_default:
            return {"world": {}, "solver": {}, "contact": contact, "body": damping if scene.damping else {}}
        share = abs(float(scene.acceleration[1])) * dt / _touching(scene) if floor and not isinstance(floor.friction, str) else 1.0
        solver = {"iterations": SOLVER["iterations"].calibrated, "tolerance": 1e-12 * scene.body.mass}
        relaxed = calibrated_values(CONTACT)
        return {"world": {"frictionGravity": share}, "solver": solver, "contact": contact | relaxed if floor else {}, "body": damping}


def _touching(scene: Scenario) -> int:
    """The number of points at which a body that lies on the floor touches it."""
    heights = rotate(scene.initial_state[3:7], scene.body.vertices)[:, 1]
    return int(np.sum(heights <= heights.min() + 1e-6 * scene.body.size))


def _lies(scene: Scenario) -> bool:
    """Whether the body starts on the floor, as a ball or on a face."""
    return scene.starts_on_floor and (scene.body.is_ball or _touching(scene) == CORNERS_OF_A_FACE)
