"""Faults that show in free flight: of gravity, damping, mass and inertia."""

from collections.abc import Callable
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.faults.fault_model import FaultModel, Simulated, axis_names, changed_table, faults_of
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies.shape import times
from dropspin.scenarios.model import Gravity
from dropspin.scenarios.variations import with_values

Array = NDArray[np.float64]

STANDARD_GRAVITY = 9.81
ORDERS = [order for order in permutations(range(3)) if order != (0, 1, 2)]


def _gravity(change: Callable[[Array], Array]) -> Simulated:
    """The scene with a function of its gravity, also if it has none."""
    return lambda scene: scene.model_copy(update={"gravity": Gravity(acceleration=tuple(map(float, change(scene.acceleration))))})


def _standard_gravity(*direction: float) -> Simulated:
    return _gravity(lambda g: STANDARD_GRAVITY * np.array(direction))


def _gravity_along(*direction: float) -> Simulated:
    return _gravity(lambda g: np.linalg.norm(g) * np.array(direction))


def _gravity_by_mass(power: float) -> Simulated:
    return lambda scene: _gravity(lambda g: g * scene.body.mass**power)(scene)


def _angular_like_linear(scene: Scenario) -> Scenario:
    return with_values(scene, "damping", angular=scene.damping and scene.damping.linear)


def _scaled_inertia(by: Callable[[float], float]) -> Simulated:
    """Moments of inertia times a function of the mass."""
    return lambda scene: with_values(scene, "body", inertia=times(by(scene.body.mass), scene.body.moments))


def _permuted_moments(order: tuple[int, ...]) -> Simulated:
    return changed_table("body", inertia=lambda given: tuple(given[axis] for axis in order) if isinstance(given, tuple) else given)


def _as_a_ball(scene: Scenario) -> Scenario:
    """In flight, in which this is the motion without the gyroscopic term; in an impact it is another one."""
    if scene.floor is not None:
        return scene
    mean = float(np.trace(scene.body.inertia_tensor)) / 3.0
    return with_values(scene, "body", inertia=(mean, mean, mean))


FLIGHT = (
    *faults_of(
        "gravity",
        ("gravity is omitted", _gravity(lambda g: 0.0 * g)),
        ("gravity has the opposite sign; the scene gives an acceleration, y up", _gravity(lambda g: -g)),
        ("gravity is 9.81 m/s² along -y for every scene", _standard_gravity(0.0, -1.0, 0.0)),
        ("gravity is 9.81 m/s² along -z for every scene; y is up", _standard_gravity(0.0, 0.0, -1.0)),
        ("gravity acts along -z; y is up", _gravity_along(0.0, 0.0, -1.0)),
        ("gravity acts along -y with the scene's magnitude; it is a vector", _gravity_along(0.0, -1.0, 0.0)),
        ("gravity's y and z appear to be swapped; y is up", _gravity(lambda g: g[[0, 2, 1]])),
        ("gravity appears to be given in a frame with z up; y is up", _gravity(lambda g: g[[0, 2, 1]] * [1, 1, -1])),
        ("gravity appears to be rotated into a frame with z up; y is up", _gravity(lambda g: g[[0, 2, 1]] * [1, -1, 1])),
        ("gravity is multiplied by the mass; it is an acceleration, not a force", _gravity_by_mass(1.0)),
        ("gravity is divided by the mass; it is an acceleration, not a force", _gravity_by_mass(-1.0)),
        ("gravity acts twice", _gravity(lambda g: 2.0 * g)),
    ),
    *faults_of(
        "damping",
        ("damping is omitted", lambda scene: scene.model_copy(update={"damping": None})),
        ("angular damping is omitted", changed_table("damping", angular=0.0)),
        ("linear damping is omitted", changed_table("damping", linear=0.0)),
        ("linear damping acts on the angular velocity as well", _angular_like_linear),
    ),
    *faults_of("mass", ("mass is 1 kg for every scene", changed_table("body", mass=1.0))),
    FaultModel(
        "angular velocity stays constant, as without the gyroscopic term or with the inertia of a ball",
        simulated=_as_a_ball,
        is_peculiarity=True,
        about="inertia",
    ),
    *faults_of(
        "inertia",
        *((f"the moments of inertia appear to be permuted to ({axis_names(order)})", _permuted_moments(order)) for order in ORDERS),
        ("products of inertia are omitted: the body's own axes are not principal axes", _scaled_inertia(lambda mass: 1.0)),
        ("inertia is twice as large", _scaled_inertia(lambda mass: 2.0)),
        ("inertia is half as large", _scaled_inertia(lambda mass: 0.5)),
        ("inertia is multiplied by the mass", _scaled_inertia(lambda mass: mass)),
        ("inertia is divided by the mass", _scaled_inertia(lambda mass: 1.0 / mass)),
        ("inertia is that of the solid shape for every scene", changed_table("body", inertia="solid")),
    ),
)
