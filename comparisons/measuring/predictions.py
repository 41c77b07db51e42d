"""Predicted errors: the error of an integration scheme, where it follows from theory.

Free flight: semi-implicit Euler has an exact discrete solution (`dropspin.scenarios.discrete_flight`); the prediction is its error.
A body that falls flat from the height H and strikes the floor with the speed u has these relative errors, averaged over start phases:

    impact detected late, v⁺ = -e v⁻ - s g h     bounce height  -(1 - e)/2 u h/H,          restitution  -s g h/u
    gravity before the impact, as in the note    bounce height  (2e - 1)(1 + e)/2 u h/H,   restitution  e g h/u

s is the speed that the rebound loses, relative to the velocity that gravity adds in one step. Source: expansion of one step about the
impact, to first order in the step h.
"""

import math
from functools import lru_cache

import numpy as np

from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.scenarios import Scenario, Trajectory, Truth, discrete_flight
from dropspin.scenarios.mechanics import angular_momentum


def flight_error(scene: Scenario, truth: Truth | None, metric: str, dt: float, *, exact_rotation: bool) -> float | None:
    """The error of semi-implicit Euler in free flight; None for other scenes and for rotations without a simple discrete solution."""
    if truth is None or scene.floor is not None or scene.damping is not None or (exact_rotation and not spins_steadily(scene)):
        return None
    value = METRICS[metric].value_or_nan([_flight(scene, truth, dt, exact_rotation)])
    return None if math.isnan(value) else value


@lru_cache(maxsize=4)  # every metric of a scene needs it
def _flight(scene: Scenario, truth: Truth, dt: float, exact_rotation: bool) -> Comparison:
    return Comparison.with_truth(scene, discrete_flight(scene, dt, exact_rotation=exact_rotation), truth)


def bounce_error(
    scene: Scenario, truth: Truth | None, metric: str, dt: float, *, gravity_first: bool = False, restitution_lost: float = 0.0
) -> float | None:
    """The error of the first bounce of a body that falls flat; None for other scenes and metrics.

    Args:
        scene: The scene.
        truth: Its exact solution.
        metric: Name of the metric.
        dt: Time step [s].
        gravity_first: Whether gravity acts before the impact within a step, as in the note.
        restitution_lost: s, the speed that the rebound loses, relative to the velocity that gravity adds in one step.
    """
    if truth is None or truth.name != "bounce-ladder" or not truth.events or not scene.starts_above_floor:
        return None
    assert scene.floor is not None
    u, e, g = -float(truth.events[0].before[8]), scene.floor.restitution, -float(scene.acceleration[1])
    if u < scene.floor.rest_speed:
        return None
    if metric == "bounce_height_error":
        share = 0.5 * (2.0 * e - 1.0) * (1.0 + e) if gravity_first else -0.5 * (1.0 - e)
        return share * u * dt / scene.clearance
    if metric == "restitution_error":
        return (e if gravity_first else -restitution_lost) * g * dt / u
    return None


def spins_steadily(scene: Scenario) -> bool:
    """Whether the body rotates about a principal axis, or does not rotate."""
    w = np.array(scene.start.angular_velocity)
    L = angular_momentum(scene, Trajectory.from_states(np.zeros(1), scene.initial_state[None]))[0]
    return float(np.linalg.norm(np.cross(w, L))) <= 1e-12 * float(np.linalg.norm(w) * np.linalg.norm(L))
