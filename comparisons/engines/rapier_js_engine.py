"""The engine `rapier-js`: Rapier's package for JavaScript, in a process of Node.js; in single precision.

Releases before 0.20.0 have no gyroscopic term. The package cannot set what `rapier` sets of contacts with a floor, nor lift the limit of
the spin, π/4 a step from 0.20.0 on.
"""

from typing import Any, ClassVar

import numpy as np

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.node_engine import NodeEngine
from dropspin.comparisons.engines.packages import RAPIER_JS
from dropspin.comparisons.engines.rapier_scenes import WHY_FRICTION, damping_of, refusal, surface_of, why_damping
from dropspin.scenarios import Scenario

LENGTH = 1e6
PARAMETERS = {
    "lengthUnit": (LENGTH, "m; no clamp of the speed, at 400 units/s from 0.20.0 on, here in scenes in any units"),
    "normalizedAllowedLinearError": (1e-3 / LENGTH, "units: Rapier's 1 mm"),
    "numSolverIterations": (1, "substeps; at the default 4 velocity lags by an eighth of a step, and a ball gains 1.7e-3 of its energy"),
    "numInternalPgsIterations": (50, "at 1 a box that turns without friction in 0.19.3 errs by 7.0e-4 rad instead of 2.9e-4"),
}
REASONS = {name: why for name, (_, why) in PARAMETERS.items()} | {
    "normalizedPredictionDistance": "units: a step's fall; at 2 cm a rocking block errs by 0.026 rad, not 1.5e-3",
    "linearDamping": f"{why_damping()}; angularDamping is the same",
    "friction": WHY_FRICTION,
}
"""Effects were measured at 1 ms without the one setting."""


class RapierJS(NodeEngine):
    """Rapier's rigid body in Node.js."""

    name, package, order, precision, reasons = "rapier-js", RAPIER_JS, 1.0, np.float32, REASONS
    choices: ClassVar = {"profile": mapping.PROFILES, "floor": ("plane", "box", "mesh"), "beside": mapping.BESIDE}
    representations: ClassVar = ("floor", "beside")

    def declines(self, scene: Scenario) -> str | None:
        return refusal(scene, self.option("floor"))

    def world_settings(self, scene: Scenario, dt: float) -> dict[str, Any]:
        parameters: dict[str, float] = {"dt": dt}
        decay = scene.damping.rates if scene.damping else {}
        if not self.is_default:
            parameters |= {name: value for name, (value, _) in PARAMETERS.items()}
            fall = float(np.linalg.norm(scene.acceleration)) * dt**2
            parameters |= {"normalizedPredictionDistance": fall / LENGTH, "predictionDistance": fall}  # the latter up to 0.12.0
            decay = damping_of(scene, dt)
        damping = {f"{motion}Damping": rate for motion, rate in decay.items()}
        return {"parameters": parameters, **damping, "canSleep": self.is_default, **surface_of(scene)}
