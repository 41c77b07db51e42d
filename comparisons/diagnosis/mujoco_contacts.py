"""Contacts of two geometries of a compiled model of MuJoCo, with the settings that MuJoCo mixes of both."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np

from dropspin.scenarios.truths.soft_rest import GeomSettings, mixed


def contact_of(model: Any, first: int, second: int) -> dict[str, Any] | None:
    """The settings of a contact of two geometries, as MuJoCo mixes them; None if they do not collide."""
    for pair in range(model.npair):
        if {model.pair_geom1[pair], model.pair_geom2[pair]} == {first, second}:
            names = ("friction", "solref", "solreffriction", "solimp", "margin", "gap")
            settings = {name: getattr(model, f"pair_{name}")[pair] for name in names}
            return {"condim": model.pair_dim[pair]} | settings | overrides(model)
    types, affinities = model.geom_contype, model.geom_conaffinity
    bodies = [model.geom_bodyid[geom] for geom in (first, second)]
    excluded = [(bodies[0] << 16) + bodies[1], (bodies[1] << 16) + bodies[0]]
    if not (types[first] & affinities[second] or types[second] & affinities[first]) or np.isin(model.exclude_signature, excluded).any():
        return None
    both = mixed(_settings_of(model, first), _settings_of(model, second))
    settings = {name: np.array(getattr(both, name)) for name in ("solref", "solimp", "margin", "friction")}
    settings |= {"friction": settings["friction"][[0, 0, 1, 2, 2]], "gap": model.geom_gap[[first, second]].sum()}
    return {"condim": both.condim} | settings | overrides(model)


def friction_of(contact: dict[str, Any]) -> tuple[float, float]:
    """The coefficients of sliding of a contact, in its second and first direction; 0 without friction."""
    return (0.0, 0.0) if contact["condim"] == 1 else (float(contact["friction"][1]), float(contact["friction"][0]))


def with_friction(contact: Mapping[str, Any], friction: Any) -> dict[str, Any]:
    """The friction of a contact with another coefficient for slides, and three dimensions if it has one."""
    numbers = np.array([friction, friction, *contact["friction"][2:]], float)
    return {"friction": numbers, "condim": 3} if contact["condim"] == 1 else {"friction": numbers}


def overrides(model: Any) -> dict[str, Any]:
    """The settings that all contacts have if the flag `override` is set."""
    option = model.opt
    if not option.enableflags & mujoco.mjtEnableBit.mjENBL_OVERRIDE:
        return {}
    return {name: np.array(getattr(option, f"o_{name}")) for name in ("solref", "solimp", "friction", "margin")}


def _settings_of(model: Any, geom: int) -> GeomSettings:
    names = ("solref", "solimp", "friction", "condim", "margin", "priority", "solmix")
    return GeomSettings(**{name: plain(getattr(model, f"geom_{name}")[geom]) for name in names})


def effect_of(model: Any, name: str, geom: int, other: int) -> tuple[float, float]:
    """By how much a setting of a geometry changes its value in the contact with another one; how near to that it is, as a negative number.

    The change is relative to MuJoCo's default. It is the same for two small coefficients of friction, of which the larger one counts.
    """
    own, beside = _settings_of(model, geom), _settings_of(model, other)
    without = replace(own, **{name: getattr(GeomSettings(), name)})
    written, has, default = (getattr(one, name) for one in (own, mixed(own, beside), mixed(without, beside)))
    return float(np.abs(np.subtract(has, default)).max()), -float(np.abs(np.subtract(has, written)).max())


def plain(value: Any) -> Any:
    """Numbers of a compiled model as a tuple, or as a number."""
    return tuple(value.tolist()) if np.ndim(value) else value.item()
