"""Faults of parameters: of gravity, damping, mass and inertia, which show in flight, and of floor and shape, which show at an impact."""

from collections.abc import Callable
from functools import partial
from itertools import permutations

import numpy as np

from dropspin.comparisons.faults.conventions import CONVENTIONS
from dropspin.comparisons.faults.fault_model import FaultModel, Simulated, changed_table
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Box, Ellipsoid
from dropspin.scenarios.bodies.inertia import in_numbers, principal_axes
from dropspin.scenarios.bodies.shape import times
from dropspin.scenarios.model import Gravity
from dropspin.scenarios.state import UP, Array
from dropspin.scenarios.variations import with_values

ORDERS = {order: ", ".join("xyz"[axis] for axis in order) for order in permutations(range(3)) if order != (0, 1, 2)}
"""Other orders of the axes, and their names."""
DOWN, BACK = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, -1.0])
SLOW = 0.2  # m/s; Bullet drops restitution below it
MULTIPLIES = "an engine that multiplies the values of two bodies needs 1 for the floor"
AVERAGES = "an engine that averages the values of two bodies needs the scene's value on both"


def _with_gravity(change: Callable[[Array, float], Array], scene: Scenario) -> Scenario:
    """A change of gravity, by a function of the acceleration and of the mass."""
    acceleration = tuple(float(value) for value in change(scene.acceleration, scene.body.mass))
    return scene.model_copy(update={"gravity": Gravity(acceleration=acceleration)})


def _angular_like_linear(scene: Scenario) -> Scenario:
    return scene if scene.damping is None else with_values(scene, "damping", angular=scene.damping.linear)


def _scaled_inertia(by: Callable[[float], float]) -> Simulated:
    """Moments of inertia times a function of the mass."""
    return lambda scene: with_values(scene, "body", inertia=in_numbers(by(scene.body.mass) * scene.body.inertia_tensor))


def _without_products(scene: Scenario) -> Scenario:
    return with_values(scene, "body", inertia=scene.body.moments)


def _permuted_moments(order: tuple[int, ...], scene: Scenario) -> Scenario:
    """The principal moments about other principal axes."""
    moments, axes = principal_axes(scene.body.inertia_tensor)
    return with_values(scene, "body", inertia=(axes * moments[list(order)] @ axes.T).tolist())


def _as_a_ball(scene: Scenario) -> Scenario:
    """In flight, in which this is the motion without the gyroscopic term; in an impact it is another one."""
    if scene.floor is not None:
        return scene
    mean = float(np.trace(scene.body.inertia_tensor)) / 3.0
    return with_values(scene, "body", inertia=(mean, mean, mean))


def _of_one_kilogram(scene: Scenario) -> Scenario:
    masses = getattr(scene.body, "masses", None)
    parts = {} if masses is None else {"masses": times(1.0 / scene.body.mass, masses)}
    return with_values(scene, "body", mass=1.0, **parts)


def _friction(change: Callable[[float], float]) -> Simulated:
    """A changed coefficient; none and infinite stay."""
    return changed_table("floor", friction=lambda mu: mu if isinstance(mu, str) else change(mu))


def _permuted_extents(order: tuple[int, ...], scene: Scenario) -> Scenario:
    if not isinstance(scene.body, Box | Ellipsoid):
        return scene
    extents = [scene.body.half_extents[axis] for axis in order]
    return with_values(scene, "body", half_extents=extents, inertia=in_numbers(scene.body.inertia_tensor))


def _scaled(size: str, by: float, scene: Scenario) -> Scenario:
    """The radius or the half extents of bodies times a factor, with the same moments of inertia."""
    if scene.floor is None or size not in type(scene.body).model_fields:
        return scene
    larger = {size: lambda values: np.multiply(values, by).tolist()}
    return with_values(scene, "body", inertia=in_numbers(scene.body.inertia_tensor), **larger)


GRAVITY: dict[str, Callable[[Array, float], Array]] = {
    "gravity is omitted": lambda g, _: 0.0 * g,
    "gravity has the opposite sign; the scene gives an acceleration, y up": lambda g, _: -g,
    "gravity is 9.81 m/s² along -y for every scene": lambda g, _: 9.81 * DOWN,
    "gravity is 9.81 m/s² along -y for every scene that has gravity": lambda g, _: 9.81 * DOWN * g.any(),
    "gravity acts along y only; it is a vector": lambda g, _: g * UP,
    "gravity is 9.81 m/s² along -z for every scene; y is up": lambda g, _: 9.81 * BACK,
    "gravity acts along -z; y is up": lambda g, _: np.linalg.norm(g) * BACK,
    "gravity acts along -y with the scene's magnitude; it is a vector": lambda g, _: np.linalg.norm(g) * DOWN,
    "gravity's y and z appear to be swapped; y is up": lambda g, _: g[[0, 2, 1]],
    "gravity appears to be given in a frame with z up; y is up": lambda g, _: g[[0, 2, 1]] * [1, 1, -1],
    "gravity appears to be rotated into a frame with z up; y is up": lambda g, _: g[[0, 2, 1]] * [1, -1, 1],
    "gravity is multiplied by the mass; it is an acceleration, not a force": lambda g, mass: g * mass,
    "gravity is divided by the mass; it is an acceleration, not a force": lambda g, mass: g * mass**-1.0,
    "gravity acts twice": lambda g, _: 2.0 * g,
}
"""By the message of a fault: the acceleration that is simulated, from that of the scene and the mass."""
PARAMETERS: dict[str, dict[str, Simulated]] = {
    "gravity": {message: partial(_with_gravity, change) for message, change in GRAVITY.items()},
    "damping": {
        "damping is omitted": lambda scene: scene.model_copy(update={"damping": None}),
        "angular damping is omitted": changed_table("damping", angular=0.0),
        "linear damping is omitted": changed_table("damping", linear=0.0),
        "linear damping acts on the angular velocity as well": _angular_like_linear,
    },
    "mass": {"mass is 1 kg for every scene": _of_one_kilogram},
    "inertia": {
        "angular velocity stays constant, as without the gyroscopic term or with the inertia of a ball": _as_a_ball,
        **{
            f"the moments of inertia appear to be permuted to ({named})": partial(_permuted_moments, order)
            for order, named in ORDERS.items()
        },
        "products of inertia are omitted: the body's own axes are not principal axes": _without_products,
        "inertia is twice as large, relative to the mass": _scaled_inertia(lambda mass: 2.0),
        "inertia is half as large, relative to the mass": _scaled_inertia(lambda mass: 0.5),
        "inertia is multiplied by the mass": _scaled_inertia(lambda mass: mass),
        "inertia is divided by the mass": _scaled_inertia(lambda mass: 1.0 / mass),
        "inertia is that of the solid shape for every scene": changed_table("body", inertia="solid"),
    },
    "floor": {"the body falls through the floor": lambda scene: scene.model_copy(update={"floor": None})},
    "restitution": {
        "restitution is 0 for every scene": changed_table("floor", restitution=0.0),
        "restitution is 1 for every scene": changed_table("floor", restitution=1.0),
        f"restitution appears to be squared; {MULTIPLIES}": changed_table("floor", restitution=lambda e: e**2),
        f"restitution appears to be halved; {AVERAGES}": changed_table("floor", restitution=lambda e: e / 2),
        "restitution is the mean of the scene's value and 1": changed_table("floor", restitution=lambda e: (e + 1) / 2),
        "restitution is 0 below a speed that the engine sets; the scene's rest_speed is 0": changed_table("floor", rest_speed=SLOW),
    },
    "friction": {
        "friction is omitted": changed_table("floor", friction="none"),
        "friction is infinite for every scene": changed_table("floor", friction="infinite"),
        "friction is 0.5 for every scene": changed_table("floor", friction=0.5),
        "friction is 1 for every scene": changed_table("floor", friction=1.0),
        f"friction appears to be squared; {MULTIPLIES}": _friction(lambda mu: mu**2),
        f"friction appears to be halved; {AVERAGES}": _friction(lambda mu: mu / 2),
    },
    "size": {
        **{f"the half extents appear to be permuted to ({named})": partial(_permuted_extents, order) for order, named in ORDERS.items()},
        "the radius is half as large as it should be: is a radius read as a diameter?": partial(_scaled, "radius", 0.5),
        "the radius is twice as large as it should be: is a diameter read as a radius?": partial(_scaled, "radius", 2.0),
        "the body is half as large as it should be: are half extents read as extents?": partial(_scaled, "half_extents", 0.5),
        "the body is twice as large as it should be: are extents read as half extents?": partial(_scaled, "half_extents", 2.0),
    },
}
"""By what is wrong: the message of each fault, and the scene that is simulated."""
FAULT_MODELS = (
    *CONVENTIONS,
    *(
        FaultModel(message, simulated, is_peculiarity=simulated is _as_a_ball, about=about)
        for about, faults in PARAMETERS.items()
        for message, simulated in faults.items()
    ),
)
"""All faults of adapters that are known; earlier ones are preferred where several give the same motion."""
