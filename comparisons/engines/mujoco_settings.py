"""The settings of MuJoCo that can be given, by their names in MJCF: defaults, calibrated values, and where a compiled model has them."""

from collections.abc import Mapping
from typing import Any

import mujoco
import numpy as np

from dropspin.comparisons.engines.options import Setting, spelled

ANY = -float("inf")
IMPEDANCE = 0.9999  # the largest that MuJoCo allows
OVERRIDDEN, OF_EACH = ("override", "enable"), ("override", "disable")
SEARCHES = ("solver", "CG", "Newton")
CONTACT = {
    "condim": Setting("3", "dimensions of a contact", why="1 without friction, 3 with", values=("1", "3", "4", "6"), is_computed=True),
    "friction": Setting(
        (1.0, 1.0, 0.005, 0.0001, 0.0001),
        "sliding twice, torsional, rolling twice",
        why="the scene's coefficient; 1e6 where the floor grips",
        is_computed=True,
    ),
    "solref": Setting(
        (0.02, 1.0),
        "time constant [s] and damping ratio of a contact; or, if negative, -stiffness and -damping",
        why="[0, -(1 + e)/dt]: a damper that turns v into -e v in one step; with the default spring the restitution is 0.13 for any e",
        least=ANY,
        is_computed=True,
        needs=(("kappa", "0"), ("spring_steps", "0"), OF_EACH),
    ),
    "solimp": Setting(
        (0.9, 0.95, 0.001, 0.5, 2.0),
        "impedance of a contact: smallest, largest, width [m], midpoint, power",
        (IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0),
        "the hardest contact that MuJoCo allows, at any depth; at the default 0.9 to 0.95, restitution 0.5 becomes 0.466 at 0.25 ms, and "
        "boxes rest 2 mm deep",
        needs=(OF_EACH,),
    ),
    "solreffriction": Setting(
        (0.0, 0.0),
        "solref of friction; zeros for that of the contact",
        why="stops sliding in one step; if it follows solref, a gripping corner's slip is reversed, which costs 0.51 of its angular "
        "momentum",
        least=ANY,
        is_computed=True,
        needs=(("profile", "calibrated"),),
    ),
    "margin": Setting(0.0, "distance at which a contact begins", unit="m", least=ANY, needs=(OF_EACH,)),
    "gap": Setting(0.0, "distance beyond the margin at which a contact is listed", unit="m", least=ANY),
}
"""Of the pairs of the body with floor and walls; in the default profile of their geoms."""
WORDS = {"cone": ("pyramidal", "elliptic"), "jacobian": ("dense", "sparse", "auto"), "solver": ("PGS", "CG", "Newton")}
"""The words for the numbers 0, 1, …"""
OPTION = {
    "cone": Setting(
        "pyramidal",
        "friction cone",
        "elliptic",
        "elliptic: the same friction in every direction; with pyramidal cones a friction of 1e6 leaves no contact",
        values=WORDS["cone"],
    ),
    "jacobian": Setting(
        "auto",
        "matrices of the solver",
        "dense",
        "MuJoCo's own choice for few bodies, set explicitly because version 4.0.0 has a fault in its sparse solver",
        values=WORDS["jacobian"],
    ),
    "solver": Setting("Newton", "algorithm of the solver", values=WORDS["solver"]),
    "iterations": Setting(100, "of the solver, at most"),
    "tolerance": Setting(1e-8, "at which the solver ends"),
    "ls_iterations": Setting(50, "of the solver's line search, at most", needs=(SEARCHES,)),
    "ls_tolerance": Setting(0.01, "at which the line search ends", needs=(SEARCHES,)),
    "noslip_iterations": Setting(0, "of the solver that takes slip away afterwards"),
    "noslip_tolerance": Setting(1e-6, "at which it ends"),
    "impratio": Setting(1.0, "ratio of the impedances of friction and normal force"),
    "density": Setting(0.0, "density of the medium", unit="kg/m³"),
    "viscosity": Setting(0.0, "viscosity of the medium", unit="Pa s"),
    "wind": Setting((0.0, 0.0, 0.0), "velocity of the medium", unit="m/s", least=ANY),
    "o_margin": Setting(0.0, "margin of all contacts", unit="m", least=ANY, needs=(OVERRIDDEN,)),
    "o_solref": Setting((0.02, 1.0), "solref of all contacts", least=ANY, needs=(OVERRIDDEN,)),
    "o_solimp": Setting((0.9, 0.95, 0.001, 0.5, 2.0), "solimp of all contacts", needs=(OVERRIDDEN,)),
}
"""Of the table option."""
SWITCHES = ("disable", "enable")
FLAGS = {
    "diagexact": Setting(
        "disable",
        "the exact inertia of a contact",
        "enable",
        "the contact's exact inertia, not an estimate; at an impedance of 0.9999 the difference is 1e-4 of a corner's energy",
        values=SWITCHES,
    ),
    "island": Setting(
        "enable",
        "islands of bodies in contact are solved by themselves",
        "disable",
        "one body is one island; the search for it takes a seventh of a step",
        values=SWITCHES,
    ),
    "warmstart": Setting("enable", "the solver starts from the last step's solution", values=SWITCHES),
    "refsafe": Setting("enable", "the time constant in solref is at least two steps", values=SWITCHES),
    "eulerdamp": Setting("enable", "damping of joints is implicit in Euler's method", values=SWITCHES),
    "nativeccd": Setting("enable", "MuJoCo's own collision detection of convex shapes", values=SWITCHES),
    "multiccd": Setting("enable", "several contact points of convex shapes", values=SWITCHES),
    "override": Setting("disable", "o_margin, o_solref and o_solimp are those of all contacts", values=SWITCHES),
    "speculative": Setting("disable", "contacts begin at the time of impact", values=SWITCHES),
    "sleep": Setting("disable", "bodies at rest fall asleep", values=SWITCHES),
}
"""Of the table flag; those that the installed version has are in `SETTINGS`."""
BODY = {"armature": Setting(0.0, "added to the mass and the moments of inertia of the free joint", unit="kg, kg m²")}
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
    return getattr(model, f"geom_{name}") if not model.npair else model.pair_dim if name == "condim" else getattr(model, f"pair_{name}")
