"""Faults that show at an impact: of the floor, its restitution and friction, and the size of the body."""

from collections.abc import Callable

import numpy as np

from comparisons.conformance.fault_model import Simulated, axis_names, changed_table, faults_of, moments_of_inertia
from comparisons.conformance.flight import ORDERS
from scenarios import Scenario
from scenarios.body import Box

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
        return changed_table("body", half_extents=extents, inertia=moments_of_inertia(scene))(scene)

    return permuted


def _scaled_size(by: float) -> Simulated:
    def scaled(scene: Scenario) -> Scenario:
        if scene.floor is None:
            return scene
        sizes = {"radius", "half_extents"} & set(type(scene.body).model_fields)
        larger = {size: lambda given: np.multiply(given, by).tolist() for size in sizes}
        return changed_table("body", inertia=moments_of_inertia(scene), **larger)(scene)

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
        ("the body is half as large as it should be: is a radius read as a diameter, or half extents as extents?", _scaled_size(0.5)),
        ("the body is twice as large as it should be: is a diameter read as a radius, or extents as half extents?", _scaled_size(2.0)),
    ),
)
