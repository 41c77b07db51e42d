"""The options of a model of MuJoCo in the words of MJCF, and how a specification gets them."""

from typing import Any

import mujoco

from dropspin.comparisons.diagnosis.loose_body import Changes

ELLIPTIC = int(mujoco.mjtCone.mjCONE_ELLIPTIC)
ENUMERATIONS = {"RK4": int(mujoco.mjtIntegrator.mjINT_RK4), "elliptic": ELLIPTIC}
"""Values of options in the words of MJCF."""
FLAGS = {
    "eulerdamp": ("disableflags", int(mujoco.mjtDisableBit.mjDSBL_EULERDAMP), "enable"),
    "refsafe": ("disableflags", int(mujoco.mjtDisableBit.mjDSBL_REFSAFE), "enable"),
    "diagexact": ("enableflags", int(getattr(mujoco.mjtEnableBit, "mjENBL_DIAGEXACT", 0)), "disable"),  # since MuJoCo 4
}
"""Flags that change errors: the field and the bit that is set if a flag is not at its default, and the default."""
OPTIONS = [name for name in dir(mujoco.MjSpec().option) if not name.startswith("_")]
OF_ALL = {*OPTIONS, *FLAGS}
"""Changes that apply to all bodies: those of options, and of flags, which may get their defaults."""


def is_set(option: Any, flag: str) -> bool:
    """Whether a flag is not at its default."""
    field, bit, _ = FLAGS[flag]
    return bool(getattr(option, field) & bit)


def set_options(option: Any, compiled: Any, dt: float, changes: Changes) -> None:
    """Give a specification the options of a compiled model, but for the time step [s] and changes; without the automatic reset."""
    for name in OPTIONS:
        value = changes.get(name, getattr(compiled, name))
        setattr(option, name, ENUMERATIONS[value] if isinstance(value, str) else value)
    option.timestep = dt
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    for field, bit, _ in (FLAGS[name] for name in FLAGS if name in changes):
        setattr(option, field, getattr(option, field) & ~bit)
