"""Faults that show at an impact: of the floor, its restitution and friction, and the size of the body."""

from collections.abc import Callable

import numpy as np

from dropspin.comparisons.faults.fault_model import Simulated, axis_names, changed_table, faults_of
from dropspin.comparisons.faults.flight import ORDERS
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Box
from dropspin.scenarios.variations import with_values

SLOW = 0.2  # m/s; Bullet drops restitution below it


def _restitution(change: Callable[[float], float]) -> Simulated:
    return changed_table("floor", restitution=change)


def _friction(change: Callable[[float], float]) -> Simulated:
    """A changed coefficient; none and infinite stay."""
    return changed_table("floor", friction=lambda mu: mu if isinstance(mu, str) else change(mu))


def _permuted_extents(order: tuple[int, ...]) -> Simulated:
    def permuted(scene: Scenario) -> Scenario:
        if not isinstance(scene.body, Box):
            return scene
        extents = [scene.body.half_extents[axis] for axis in order]
        return with_values(scene, "body", half_extents=extents, inertia=scene.body.moments)

    return permuted


def _scaled(size: str, by: float) -> Simulated:
    """The radius of spheres or the half extents of boxes times a factor, with the same moments of inertia."""

    def scaled(scene: Scenario) -> Scenario:
        if scene.floor is None or size not in type(scene.body).model_fields:
            return scene
        larger = {size: lambda given: np.multiply(given, by).tolist()}
        return with_values(scene, "body", inertia=scene.body.moments, **larger)

    return scaled


MULTIPLIES = "an engine that multiplies the values of two bodies needs 1 for the floor"
AVERAGES = "an engine that averages the values of two bodies needs the scene's value on both"
IMPACT = (
    *faults_of("floor", ("the body falls through the floor", lambda scene: scene.model_copy(update={"floor": None}))),
    *faults_of(
        "restitution",
        ("restitution is 0 for every scene", changed_table("floor", restitution=0.0)),
        ("restitution is 1 for every scene", changed_table("floor", restitution=1.0)),
        (f"restitution appears to be squared; {MULTIPLIES}", _restitution(lambda e: e**2)),
        (f"restitution appears to be halved; {AVERAGES}", _restitution(lambda e: e / 2)),
        ("restitution is the mean of the scene's value and 1", _restitution(lambda e: (e + 1) / 2)),
        ("restitution is 0 below a speed that the engine sets; the scene's rest_speed is 0", changed_table("floor", rest_speed=SLOW)),
    ),
    *faults_of(
        "friction",
        ("friction is omitted", changed_table("floor", friction="none")),
        ("friction is infinite for every scene", changed_table("floor", friction="infinite")),
        ("friction is 0.5 for every scene", changed_table("floor", friction=0.5)),
        ("friction is 1 for every scene", changed_table("floor", friction=1.0)),
        (f"friction appears to be squared; {MULTIPLIES}", _friction(lambda mu: mu**2)),
        (f"friction appears to be halved; {AVERAGES}", _friction(lambda mu: mu / 2)),
    ),
    *faults_of(
        "size",
        *((f"the box's extents appear to be permuted to ({axis_names(order)})", _permuted_extents(order)) for order in ORDERS),
        ("the sphere is half as large as it should be: is a radius read as a diameter?", _scaled("radius", 0.5)),
        ("the sphere is twice as large as it should be: is a diameter read as a radius?", _scaled("radius", 2.0)),
        ("the box is half as large as it should be: are half extents read as extents?", _scaled("half_extents", 0.5)),
        ("the box is twice as large as it should be: are extents read as half extents?", _scaled("half_extents", 2.0)),
    ),
)
