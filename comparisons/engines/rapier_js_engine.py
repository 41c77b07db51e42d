"""The engine `rapier-js`: Rapier's package for JavaScript, in a process of Node.js; in single precision.

Releases before 0.20.0 have no gyroscopic term. The package cannot set what `rapier` sets of contacts with a floor, nor lift the limit of
the spin, π/4 a step from 0.20.0 on.
"""

from typing import Any, ClassVar

import numpy as np

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.node_engine import NodeEngine
from dropspin.comparisons.engines.options import Setting, calibrated_values
from dropspin.comparisons.engines.packages import RAPIER_JS
from dropspin.comparisons.engines.rapier_scenes import WHY_FRICTION, damping_of, refusal, surface_of, why_damping
from dropspin.scenarios import Scenario

LENGTH = 1e6
PARAMETERS = {
    "lengthUnit": Setting(
        1.0,
        "length of a unit",
        LENGTH,
        "m; no clamp of the speed, at 400 units/s from 0.20.0 on, here in scenes in any units",
        "m",
        least=1e-9,
    ),
    "normalizedAllowedLinearError": Setting(1e-3, "units; depth that is not corrected", 1e-3 / LENGTH, "units: Rapier's 1 mm"),
    "normalizedPredictionDistance": Setting(
        2e-3,
        "units; distance at which a contact begins",
        why="units: a step's fall; at 2 cm a rocking block errs by 0.026 rad, not 1.5e-3",
        is_computed=True,
    ),
    "numSolverIterations": Setting(
        4, "substeps", 1, "substeps; at the default 4 velocity lags by an eighth of a step, and a ball gains 1.7e-3 of its energy", least=1
    ),
    "numInternalPgsIterations": Setting(
        1, "of a substep", 50, "at 1 a box that turns without friction in 0.19.3 errs by 7.0e-4 rad instead of 2.9e-4", least=1
    ),
    "contact_natural_frequency": Setting(30.0, "of contacts", unit="Hz", least=1e-9),
}
BODY = {
    "canSleep": Setting(True, "the body may fall asleep", False, "never falls asleep"),
    "linearDamping": Setting(0.0, "damping", why=f"{why_damping()}; angularDamping is the same", unit="1/s", is_computed=True),
    "angularDamping": Setting(0.0, "damping of rotation", unit="1/s", is_computed=True),
}
SURFACE = {
    "restitution": Setting(0.0, "of body and floor", is_computed=True),
    "friction": Setting(0.5, "of body and floor", why=WHY_FRICTION, is_computed=True),
}


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
            parameters |= {"normalizedPredictionDistance": fall / LENGTH, "predictionDistance": fall}  # the latter up to 0.12.0
            body, decay = calibrated_values(BODY), damping_of(scene, dt)
        body |= {f"{motion}Damping": rate for motion, rate in decay.items()}
        return {"parameters": parameters, "body": body, "surface": surface_of(scene)}
