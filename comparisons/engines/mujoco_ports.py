"""MuJoCo models for its ports to other languages, which have the calibrated contacts of `mujoco` but not all of its flags."""

from typing import Any

import mujoco
import numpy as np

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.engines.mapping import refusal_of_damped_axes
from dropspin.comparisons.engines.mujoco_engine import REASONS as MUJOCO_REASONS
from dropspin.comparisons.engines.mujoco_engine import MuJoCo
from dropspin.comparisons.engines.mujoco_model import FORM, calibrated_specification, contact, default_specification
from dropspin.comparisons.engines.mujoco_settings import SETTINGS as MUJOCO_SETTINGS
from dropspin.comparisons.engines.mujoco_settings import in_force, set_in
from dropspin.comparisons.engines.mujoco_simulation import set_damping
from dropspin.scenarios import Scenario

STICKING = 1e4
"""Friction of a floor that grips, in single precision; with 1e5 a gripping corner can become NaN in MJX, with 1e3 a turning box slips."""
CONES = {"pyramidal": mujoco.mjtCone.mjCONE_PYRAMIDAL, "elliptic": mujoco.mjtCone.mjCONE_ELLIPTIC}
REASONS = {name: MUJOCO_REASONS[name] for name in ("solref", "solimp", "solreffriction", "condim", "jacobian")} | {
    "friction": f"the scene's coefficient; where the floor grips, {STICKING:g} in single precision and 1e6 in double",
    "cone": "elliptic, or pyramidal without friction, where it has no effect: MJX has no elliptic contacts of one dimension",
    "eulerdamp": "disable: without damping, MJX need not compute the acceleration from the contact force again; in single precision a "
    "rebound would err by up to 2e-3",
}

OF_CONTACTS = ("friction", "solref", "solimp", "solreffriction", "cone", "impratio")
OF_SOLVER = ("iterations", "tolerance", "ls_iterations", "ls_tolerance")
OF_PROFILES = {name: tuple(need for need in setting.needs if need[0] == "profile") for name, setting in MUJOCO_SETTINGS.items()}
SETTINGS = {
    name: MUJOCO_SETTINGS[name]._replace(needs=OF_PROFILES[name]) for name in (*OF_CONTACTS, *OF_SOLVER, "density", "viscosity", "armature")
}
"""MuJoCo's settings that its ports have, which lack the options `kappa` and `spring_steps`."""


class Port(Engine):
    """A port of MuJoCo with the options `integrator` and `profile`: it claims and declines what MuJoCo does, unless it says otherwise."""

    compiles, reasons, settings = True, REASONS, SETTINGS

    @property
    def order(self) -> float:  # type: ignore[override]  # the claim depends on the option
        """That of MuJoCo's manual."""
        return self._mujoco.order

    @property
    def _mujoco(self) -> MuJoCo:
        return MuJoCo({name: text for name, text in self.options.items() if name in ("integrator", "profile", *SETTINGS)})

    def discretisation(self, scene: Scenario) -> str | None:
        """MuJoCo's."""
        return self._mujoco.discretisation(scene)

    def declines(self, scene: Scenario) -> str | None:
        return refusal_of_damped_axes(scene) or self._mujoco.declines(scene)


def ported_model(scene: Scenario, dt: float, engine: Port) -> tuple[Any, dict[str, Any]]:
    """A compiled model without the flags that ports lack (autoreset, diagexact), and its settings."""
    integrator, precision, given = engine.option("integrator"), engine.precision, engine.given
    settings: dict[str, Any] = {"mujoco": mujoco.__version__, "precision": np.dtype(precision).name, "integrator": integrator}
    settings |= {"profile": engine.option("profile")}
    if engine.is_default:
        spec, pair = default_specification(scene, dt, integrator, FORM), dict[str, Any]()
    else:
        pair = {} if scene.floor is None else contact(scene.floor, dt)
        if scene.floor is not None and scene.floor.friction == "infinite" and precision is np.float32:
            pair["friction"][:2] = [STICKING, STICKING]
        spec = calibrated_specification(scene, dt, integrator, FORM, [pair] if pair else [], {})
        if pair:
            settings |= {"cone": "pyramidal" if pair["condim"] == 1 else "elliptic", "jacobian": "dense"}
            spec.option.cone = CONES[settings["cone"]]
        if scene.damping is None:
            settings["eulerdamp"] = "disable"
            spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
    spec.option.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    model = spec.compile()
    set_damping(model, scene)
    set_in(model, given)
    if engine.is_default:
        settings |= {name: value for name, value in in_force(model, 0).items() if name in SETTINGS}
    return model, settings | pair | given
