"""The settings of Genesis that can be given, by its names: defaults, calibrated values and reasons."""

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

import numpy as np

from dropspin.comparisons.engines.options import Setting

LEAST, MOST = 1e-4, 0.9999
"""The smallest and the largest impedance that Genesis allows."""
TORSIONAL, ROLLING = ("enable_torsional_friction", "true"), ("enable_rolling_friction", "true")
FLIGHT = {"substeps": Setting(1, "steps of the solver in a time step", least=1)}
"""With and without a floor."""
RIGID = {
    "friction_cone": Setting(
        "pyramidal", "cone of friction", "elliptic", "elliptic: the same friction in every direction", values=("pyramidal", "elliptic")
    ),
    "contact_resolution": Setting(
        "convex",
        "how friction depends on the normal force; with a cone and Newton, signorini",
        why="signorini: the friction is limited by the normal force alone",
        values=("convex", "signorini"),
        is_computed=True,
        needs=(("friction_cone", "elliptic"), ("constraint_solver", "Newton")),
    ),
    "constraint_timeconst": Setting(
        0.01,
        "time constant of contacts, 2 dt or more",
        why="2 dt, the least: the damper stops the normal velocity in one step",
        unit="s",
        least=1e-9,
        is_computed=True,
    ),
    "constraint_solver": Setting("Newton", "of contacts", values=("CG", "Newton")),
    "iterations": Setting(25, "of the solver", least=1),
    "tolerance": Setting(1e-6, "of the solver; 1e-9 in double precision", least=1e-15, is_computed=True),
    "ls_iterations": Setting(50, "of the solver's line search", least=1),
    "ls_tolerance": Setting(0.01, "of the solver's line search", least=1e-15),
    "noslip_iterations": Setting(0, "that remove slip after the solver", needs=(("friction_cone", "pyramidal"),)),
    "impratio": Setting(1.0, "impedance of friction over that of the normal; 100 with a cone", least=1e-9, is_computed=True),
    "enable_torsional_friction": Setting(False, "friction of spin about the normal"),
    "enable_rolling_friction": Setting(False, "friction of rolling", needs=(TORSIONAL,)),
    "use_hibernation": Setting(False, "the body may fall asleep"),
    "hibernation_thresh_vel": Setting(
        2e-3, "speed below which the body falls asleep", unit="m/s", least=1e-15, needs=(("use_hibernation", "true"),)
    ),
}
"""Of the solver, by the names of `RigidOptions`."""
SOL_PARAMS = {
    "dampratio": Setting(1.0, "the smaller, the stiffer a contact", 1e6, "a damper without a spring: the stiffness vanishes", least=1e-9),
    "dmin": Setting(0.9, "impedance at depth 0", MOST, "the largest that Genesis allows", least=LEAST, most=MOST),
    "dmax": Setting(0.95, "impedance at depth `width`", MOST, "as dmin", least=LEAST, most=MOST),
    "width": Setting(0.001, "depth at which the impedance is dmax", unit="m"),
    "mid": Setting(0.5, "where in width the impedance rises fastest", least=LEAST, most=MOST),
    "power": Setting(2.0, "how steeply the impedance rises", least=1.0),
}
"""Of contacts, by the names and in the order of `sol_params`, which begins with the time constant."""
SURFACE = {
    "friction": Setting(1.0, "of the body; the larger acts, and at least 0.01", is_computed=True),
    "floor_friction": Setting(1.0, "of the floor", is_computed=True),
    "friction_torsional": Setting(0.005, "friction of spin, of body and floor", unit="m", needs=(TORSIONAL,)),
    "friction_rolling": Setting(1e-4, "friction of rolling, of body and floor", unit="m", needs=(TORSIONAL, ROLLING)),
}
"""Of the body's surface and the floor's."""
SETTINGS = FLIGHT | RIGID | SOL_PARAMS | SURFACE


def set_surfaces(body: Any, floor: Any, chosen: Mapping[str, Any]) -> None:
    """Give the shapes of body and floor the settings of contacts that are chosen."""
    for shape, prefix in ((body, ""), (floor, "floor_")):
        shape.set_friction(chosen[f"{prefix}friction"])
        for name in {"friction_torsional", "friction_rolling"} & chosen.keys():
            getattr(shape, f"set_{name}")(chosen[name])
        timeconst, *values = shape.get_sol_params().cpu().numpy()
        shape.set_sol_params(np.array([timeconst, *(chosen.get(name, value) for name, value in zip(SOL_PARAMS, values, strict=True))]))


def in_force(solver: Any, body: Any, floor: Any) -> dict[str, Any]:
    """The settings with a floor, as Genesis has them."""
    found = {name: getattr(solver._options, name) for name in RIGID} | {"hibernation_thresh_vel": solver._hibernation_thresh_vel}
    found |= {name: value.name for name, value in found.items() if isinstance(value, IntEnum)}
    surface = [shape.get_friction() for shape in (body, floor)]
    surface += [floor.get_friction_torsional(), floor.get_friction_rolling()]
    numbers = zip(("constraint_timeconst", *SOL_PARAMS, *SURFACE), [*body.get_sol_params(), *surface], strict=True)
    return found | {name: float(str(number.cpu().numpy())) for name, number in numbers}  # not 0.009999999776 for 0.01
