"""The engine `rapier-js`: Rapier's package for JavaScript, in a process of Node.js; in single precision.

Releases before 0.20.0 have no gyroscopic term. The package cannot set what `rapier` sets of contacts with a floor, nor lift the limit of
the spin, π/4 a step from 0.20.0 on.
"""

from collections.abc import Mapping
from itertools import count
from typing import Any, ClassVar

import numpy as np

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.base import Array, AsBuilt, Diverged, Engine, Simulation
from dropspin.comparisons.engines.rapier_js_node import node
from dropspin.comparisons.engines.rapier_scenes import WHY_DAMPING, WHY_FRICTION, damping_of, refusal, surface_of
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Sphere
from dropspin.scenarios.state import PARTS

NUMBERS = count()
"""Of the worlds in Node.js."""
LENGTH = 1e6
PARAMETERS = {
    "lengthUnit": (LENGTH, "m; no clamp of the speed, at 400 units/s from 0.20.0 on, here in scenes in any units"),
    "normalizedAllowedLinearError": (1e-3 / LENGTH, "units: Rapier's 1 mm"),
    "numSolverIterations": (1, "substeps; at the default 4 velocity lags by an eighth of a step, and a ball gains 1.7e-3 of its energy"),
    "numInternalPgsIterations": (50, "at 1 a box that turns without friction in 0.19.3 errs by 7.0e-4 rad instead of 2.9e-4"),
}
REASONS = {name: why for name, (_, why) in PARAMETERS.items()} | {
    "normalizedPredictionDistance": "units: a step's fall; at 2 cm a rocking block errs by 0.026 rad, not 1.5e-3",
    "linearDamping": f"{WHY_DAMPING}; angularDamping is the same",
    "friction": WHY_FRICTION,
}
"""Effects were measured at 1 ms without the one setting."""


class RapierJS(Engine):
    """Rapier's rigid body in Node.js, on a half-space, a box or two triangles; or with Rapier's defaults (profile=default)."""

    name, order, precision, reasons = "rapier-js", 1.0, np.float32, REASONS
    shapes: ClassVar = ("sphere", "box")
    choices: ClassVar = {"profile": mapping.PROFILES, "floor": ("plane", "box", "mesh"), "beside": mapping.BESIDE}
    representations: ClassVar = ("floor", "beside")

    def declines(self, scene: Scenario) -> str | None:
        return refusal(scene, self.option("floor"))

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return RapierJSSimulation(scene, dt, {name: self.option(name) for name in self.choices})


class RapierJSSimulation(Simulation):
    """A Rapier world in Node.js."""

    def __init__(self, scene: Scenario, dt: float, options: Mapping[str, str]) -> None:
        parameters: dict[str, float] = {"dt": dt}
        decay = scene.damping.rates if scene.damping else {}
        calibrated = options["profile"] == "calibrated"
        if calibrated:
            parameters |= {name: value for name, (value, _) in PARAMETERS.items()}
            fall = float(np.linalg.norm(scene.acceleration)) * dt**2
            parameters |= {"normalizedPredictionDistance": fall / LENGTH, "predictionDistance": fall}  # the latter up to 0.12.0
            decay = damping_of(scene, dt)
        ground = {"kind": options["floor"], "halfSize": mapping.FLOOR_HALF_SIZE, **surface_of(scene)} if scene.floor else {}
        made = {f"{motion}Damping": rate for motion, rate in decay.items()} | {"canSleep": not calibrated}
        self._node, self._world = node(), next(NUMBERS)
        bodies = [_body(one) for one in mapping.bodies_in(scene, options["beside"])]
        given = {"gravity": scene.acceleration.tolist(), "parameters": parameters, "ground": ground, "made": made}
        answer, _ = self._node.ask("open", world=self._world, bodies=bodies, **given)
        self._built, self.velocity_lag = answer.get("built"), 0.5 * dt / answer["substeps"]
        self._state = self._ask(0)[0]
        self.settings = {"version": self._node.version, **options, **answer["parameters"], **made, **surface_of(scene)}

    def _ask(self, steps: int, every: int = 1) -> Array:
        """States now and after each `every` of some steps."""
        answer, states = self._node.ask("record", world=self._world, steps=steps, every=every)
        if not answer["enabled"]:
            raise Diverged("Rapier disabled the body: its state is not finite")
        self._state = states[-1]
        return states

    def advance(self, steps: int) -> None:
        self._ask(steps, max(steps, 1))

    def record(self, steps: int, every: int = 1) -> Array:
        return self._ask(steps, every)

    def state(self) -> Array:
        return self._state

    def as_built(self) -> AsBuilt | None:
        return None if self._built is None else mapping.built(**self._built)

    def close(self) -> None:
        if not self._node.has_ended:
            self._node.ask("close", world=self._world)


def _body(scene: Scenario) -> dict[str, Any]:
    """A scene's body, as the driver takes it."""
    body = scene.body
    moments, axes = mapping.principal_frame(body.inertia_tensor)
    shape = {"radius": body.size} if isinstance(body, Sphere) else {"halfExtents": body.vertices.max(0).tolist()}
    inertia = {"mass": body.mass, "moments": moments.tolist(), "axes": axes.tolist()}
    return shape | inertia | {name: scene.initial_state[part].tolist() for name, part in PARTS.items()}
