"""The parameters of a scene that an engine may have wrong, each with the scene in which it is wrong by a given size."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Literal, NamedTuple

import numpy as np

from dropspin.scenarios import DropspinError, Scenario
from dropspin.scenarios.bodies.inertia import in_numbers, is_diagonal
from dropspin.scenarios.damping import Damping
from dropspin.scenarios.rotations import about, rotate
from dropspin.scenarios.state import Array
from dropspin.scenarios.variations import with_values

Change = Callable[[Scenario, float], Scenario]
"""From a scene and the size of an error to the scene with it: the scene itself if it does not have the parameter. It raises `DropspinError`
if no scene can have the error."""


class Parameter(NamedTuple):
    """A parameter, the unit of its error (1 for a share of its value), and the change."""

    name: str
    unit: Literal["1", "rad", "1/s"]
    change: Change


def _scaled(table: str, name: str, scene: Scenario, share: float) -> Scenario:
    """A number of a table times 1 + share, validated: no scene can have a restitution above 1."""
    value = getattr(getattr(scene, table), name, None)
    return scene if not value or isinstance(value, str) else with_values(scene, table, **{name: (1.0 + share) * value})


def _gravity(change: Callable[[Array, float], Array]) -> Change:
    """A change of the acceleration of gravity, if there is any."""
    return lambda scene, size: with_values(scene, "gravity", acceleration=change(scene.acceleration, size).tolist())


def _added_damping(which: str, scene: Scenario, rate: float) -> Scenario:
    if scene.floor is not None or rate < 0.0 or (scene.damping is not None and getattr(scene.damping, which)):
        raise DropspinError(f"no {which} damping of {rate:g} 1/s can be added to {scene.name}.")
    return scene.model_copy(update={"damping": (scene.damping or Damping()).model_copy(update={which: rate})})


def _mass(scene: Scenario, share: float) -> Scenario:
    return with_values(scene, "body", mass=lambda mass: (1.0 + share) * mass, inertia=in_numbers(scene.body.inertia_tensor))


def _moments(wrong: Sequence[int], scene: Scenario, share: float) -> Scenario:
    moments = np.array(scene.body.moments) * (1.0 + share * np.isin(np.arange(3), wrong))
    if not is_diagonal(scene.body.inertia_tensor) or 2.0 * moments.max() > moments.sum():
        raise DropspinError(f"no body has the moments of inertia {moments} kg m² about these axes.")
    return with_values(scene, "body", inertia=tuple(moments.tolist()))


PARAMETERS = (
    Parameter("restitution", "1", partial(_scaled, "floor", "restitution")),
    Parameter("Coulomb coefficient", "1", partial(_scaled, "floor", "friction")),
    Parameter("gravity", "1", _gravity(lambda g, share: (1.0 + share) * g)),
    Parameter("direction of gravity", "rad", _gravity(lambda g, angle: rotate(about(np.array([1.0, 0.0, 0.0]), np.array(angle)), g))),
    Parameter("direction of gravity", "rad", _gravity(lambda g, angle: rotate(about(np.array([0.0, 0.0, 1.0]), np.array(angle)), g))),
    Parameter("linear damping", "1", partial(_scaled, "damping", "linear")),
    Parameter("angular damping", "1", partial(_scaled, "damping", "angular")),
    Parameter("linear damping", "1/s", partial(_added_damping, "linear")),
    Parameter("angular damping", "1/s", partial(_added_damping, "angular")),
    Parameter("mass", "1", _mass),
    Parameter("moments of inertia", "1", partial(_moments, (0, 1, 2))),
    *(Parameter(f"moment of inertia about {name}", "1", partial(_moments, (axis,))) for axis, name in enumerate("xyz")),
)
