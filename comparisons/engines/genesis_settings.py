"""The settings of Genesis that can be given, by its names: defaults, calibrated values and reasons."""

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

import numpy as np

from dropspin.comparisons.engines.settings import settings_beside

FLIGHT, RIGID, SOL_PARAMS, SURFACE = settings_beside(__file__).values()
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
