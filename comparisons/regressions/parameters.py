"""The parameters of a scene that an engine may have wrong, each with the scene in which it is wrong by a given size."""

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios import Scenario
from dropspin.scenarios.model import Damping
from dropspin.scenarios.rotations import about, rotate

Change = Callable[[Scenario, float], Scenario | None]
"""From a scene and the size of an error to the scene with it: the scene itself if it does not have the parameter, None if no scene can have
the error."""


class Parameter(NamedTuple):
    """A parameter, the unit of its error (1 for a share of its value), and the change."""

    name: str
    unit: Literal["1", "rad", "1/s"]
    change: Change


def _restitution(scene: Scenario, share: float) -> Scenario:
    if scene.floor is None or not scene.floor.restitution:
        return scene
    return scene.model_copy(update={"floor": scene.floor.model_copy(update={"restitution": (1.0 + share) * scene.floor.restitution})})


def _friction(scene: Scenario, share: float) -> Scenario:
    if scene.floor is None or isinstance(scene.floor.friction, str) or not scene.floor.friction:
        return scene
    return scene.model_copy(update={"floor": scene.floor.model_copy(update={"friction": (1.0 + share) * scene.floor.friction})})


def _with_gravity(scene: Scenario, acceleration: NDArray[np.float64]) -> Scenario:
    if scene.gravity is None:
        return scene
    return scene.model_copy(update={"gravity": scene.gravity.model_copy(update={"acceleration": tuple(map(float, acceleration))})})


def _tilted(axis: tuple[float, float, float]) -> Change:
    return lambda scene, angle: _with_gravity(scene, rotate(about(np.array(axis), np.array(angle)), scene.acceleration))


def _damping(which: str) -> Change:
    def change(scene: Scenario, share: float) -> Scenario:
        if scene.damping is None or not getattr(scene.damping, which):
            return scene
        return scene.model_copy(update={"damping": scene.damping.model_copy(update={which: (1.0 + share) * getattr(scene.damping, which)})})

    return change


def _added_damping(which: str) -> Change:
    def change(scene: Scenario, rate: float) -> Scenario | None:
        if scene.floor is not None or rate < 0.0 or (scene.damping is not None and getattr(scene.damping, which)):
            return None
        return scene.model_copy(update={"damping": (scene.damping or Damping()).model_copy(update={which: rate})})

    return change


def _mass(scene: Scenario, share: float) -> Scenario:
    moments = tuple(map(float, np.diag(scene.body.inertia_tensor)))
    body = type(scene.body)(**scene.body.model_dump() | {"mass": (1.0 + share) * scene.body.mass, "inertia": moments})
    return scene.model_copy(update={"body": body})


def _moments(*wrong: int) -> Change:
    def change(scene: Scenario, share: float) -> Scenario | None:
        tensor = scene.body.inertia_tensor
        if np.count_nonzero(tensor - np.diag(np.diag(tensor))):
            return None
        moments = np.diag(tensor) * (1.0 + share * np.isin(np.arange(3), wrong))
        if 2.0 * moments.max() > moments.sum():  # no body has these moments
            return None
        body = type(scene.body)(**scene.body.model_dump() | {"inertia": tuple(map(float, moments))})
        return scene.model_copy(update={"body": body})

    return change


PARAMETERS = (
    Parameter("restitution", "1", _restitution),
    Parameter("Coulomb coefficient", "1", _friction),
    Parameter("gravity", "1", lambda scene, share: _with_gravity(scene, (1.0 + share) * scene.acceleration)),
    Parameter("direction of gravity", "rad", _tilted((1.0, 0.0, 0.0))),
    Parameter("direction of gravity", "rad", _tilted((0.0, 0.0, 1.0))),
    Parameter("linear damping", "1", _damping("linear")),
    Parameter("angular damping", "1", _damping("angular")),
    Parameter("linear damping", "1/s", _added_damping("linear")),
    Parameter("angular damping", "1/s", _added_damping("angular")),
    Parameter("mass", "1", _mass),
    Parameter("moments of inertia", "1", _moments(0, 1, 2)),
    *(Parameter(f"moment of inertia about {name}", "1", _moments(axis)) for axis, name in enumerate("xyz")),
)
