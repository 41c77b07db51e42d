"""The settings of MuJoCo that can be given, by their names in MJCF: defaults, calibrated values, and where a compiled model has them."""

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from dropspin.comparisons.engines.settings import settings_beside, spelled

CONTACT, OPTION, FLAGS, BODY = settings_beside(__file__).values()
"""Of the pairs of the body with floor and walls, in the default profile of their geoms; of the tables option and flag; of the free joint.

Options and flags that the installed version has are in `SETTINGS`.
"""
assert isinstance(CONTACT["solimp"].calibrated, tuple)
IMPEDANCE = CONTACT["solimp"].calibrated[0]
"""The largest that MuJoCo allows."""
WORDS = {name: setting.values for name, setting in OPTION.items() if setting.values}
"""The words for the numbers 0, 1, …"""
SWITCHES = ("disable", "enable")
FLAG_BITS = {
    name[7:].lower(): (flags, int(bit))
    for flags, kind in (("disableflags", mujoco.mjtDisableBit), ("enableflags", mujoco.mjtEnableBit))
    for name, bit in kind.__members__.items()
    if name[7:].lower() in FLAGS
}
"""The flags that the installed version has: the field of its options, and the bit there."""
SETTINGS = (
    CONTACT | {name: OPTION[name] for name in OPTION if hasattr(mujoco.MjOption, name)} | {name: FLAGS[name] for name in FLAG_BITS} | BODY
)
"""The settings that the installed version has."""
OF_GEOM, OF_PAIR = [0, 2, 3], [0, 0, 1, 2, 2]
"""The friction of a geom as part of that of a pair, which has two directions of sliding and of rolling; and the other way round."""


def set_in(model: Any, given: Mapping[str, Any]) -> None:
    """Set settings in a compiled model."""
    for name, value in given.items():
        if name in CONTACT or name in BODY:
            as_geom = name == "friction" and not model.npair
            _field(model, name)[:] = np.array(value)[OF_GEOM] if as_geom else value
        elif name in FLAG_BITS:
            flags, bit = FLAG_BITS[name]
            is_set = (value == "enable") == (flags == "enableflags")
            setattr(model.opt, flags, getattr(model.opt, flags) & ~bit | bit * is_set)
        else:
            setattr(model.opt, name, WORDS[name].index(value) if name in WORDS else value)
    if given.keys() & BODY.keys():
        mujoco.mj_setConst(model, mujoco.MjData(model))


def in_force(model: Any, walls: int) -> dict[str, Any]:
    """The settings of a compiled model that are computed, or not MuJoCo's own; those of the contacts with some walls in a list."""
    rows = [{name: _contact(model, name, number) for name in CONTACT} for number in range(walls + 1)] if model.ngeom else [{}]
    found = dict.fromkeys(SETTINGS)
    for name, (flags, bit) in FLAG_BITS.items():
        found[name] = SWITCHES[(getattr(model.opt, flags) & bit > 0) == (flags == "enableflags")]
    for name in [name for name in OPTION if name in SETTINGS]:
        value = getattr(model.opt, name)
        found[name] = WORDS[name][value] if name in WORDS else np.array(value).tolist()
    found |= {name: _field(model, name)[0].tolist() for name in BODY} | rows[0]
    ours = {name: value for name, value in found.items() if value is not None and _is_ours(name, value)}
    of_walls = [{name: value for name, value in row.items() if _is_ours(name, value)} for row in rows[1:]]
    return ours | ({"walls": of_walls} if of_walls else {})


def _is_ours(name: str, value: Any) -> bool:
    return SETTINGS[name].is_computed or spelled(value) != spelled(SETTINGS[name].default)


def _contact(model: Any, name: str, number: int) -> Any:
    """A setting of a contact pair, or of a geom, in the form that pairs have."""
    if name == "solreffriction" and not model.npair:
        return [0.0, 0.0]
    value = _field(model, name)[number].tolist()
    return [value[place] for place in OF_PAIR] if name == "friction" and not model.npair else value


def _field(model: Any, name: str) -> Any:
    """Where a model has a setting of its contacts or of its body: one row for each of them."""
    if name in BODY:
        return getattr(model, f"dof_{name}")
    if not model.npair:
        return getattr(model, f"geom_{name}")
    return model.pair_dim if name == "condim" else getattr(model, f"pair_{name}")
