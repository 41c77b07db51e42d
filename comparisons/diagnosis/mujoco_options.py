"""The options of a model of MuJoCo in the words of MJCF, and how a specification gets them."""

from typing import Any

import mujoco

from dropspin.comparisons.diagnosis.loose_body import Changes

ELLIPTIC = int(mujoco.mjtCone.mjCONE_ELLIPTIC)
ENUMERATIONS = {"RK4": int(mujoco.mjtIntegrator.mjINT_RK4), "elliptic": ELLIPTIC}
"""Values of options in the words of MJCF."""
OPTIONS = [name for name in dir(mujoco.MjSpec().option) if not name.startswith("_")]
OF_ALL = {*OPTIONS, "eulerdamp"}
"""Changes that apply to all bodies: those of options, and the flag `eulerdamp`, which may be enabled."""


def set_options(option: Any, compiled: Any, dt: float, changes: Changes) -> None:
    """Give a specification the options of a compiled model, but for the time step [s] and changes; without the automatic reset."""
    for name in OPTIONS:
        value = changes.get(name, getattr(compiled, name))
        setattr(option, name, ENUMERATIONS[value] if isinstance(value, str) else value)
    option.timestep = dt
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    if "eulerdamp" in changes:
        option.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP)
