"""The engine `rapier-js`: Rapier's package for JavaScript, in a process of Node.js; in single precision.

Releases before 0.20.0 have no gyroscopic term. The package cannot set what `rapier` sets of contacts with a floor, nor lift the limit of
the spin, π/4 a step from 0.20.0 on.
"""

from typing import Any, ClassVar

import numpy as np

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.node_engine import NodeEngine
from dropspin.comparisons.engines.packages import RAPIER_JS
from dropspin.comparisons.engines.rapier_scenes import damping_of, refusal, surface_of
from dropspin.comparisons.engines.settings import calibrated_values, settings_beside
from dropspin.scenarios import Scenario

PARAMETERS, BODY, SURFACE = settings_beside(__file__).values()


class RapierJS(NodeEngine):
    """Rapier's rigid body in Node.js."""

    name, package, order, precision = "rapier-js", RAPIER_JS, 1.0, np.float32
    choices: ClassVar = {"profile": mapping.PROFILES, "floor": ("plane", "box", "mesh"), "beside": mapping.BESIDE}
    representations: ClassVar = ("floor", "beside")
    groups: ClassVar = {"parameters": PARAMETERS, "body": BODY, "surface": SURFACE}
    settings: ClassVar = PARAMETERS | BODY | SURFACE

    def declines(self, scene: Scenario) -> str | None:
        return refusal(scene, self.option("floor"))

    def world_settings(self, scene: Scenario, dt: float) -> dict[str, Any]:
        parameters: dict[str, Any] = {"dt": dt}
        body, decay = dict[str, Any](), scene.damping.rates if scene.damping else {}
        if not self.is_default:
            fall = float(np.linalg.norm(scene.acceleration)) * dt**2
            parameters |= calibrated_values(PARAMETERS)
            parameters |= {
                "normalizedPredictionDistance": fall / parameters["lengthUnit"],
                "predictionDistance": fall,
            }  # the latter up to 0.12.0
            body, decay = calibrated_values(BODY), damping_of(scene, dt)
        body |= {f"{motion}Damping": rate for motion, rate in decay.items()}
        return {"parameters": parameters, "body": body, "surface": surface_of(scene)}
