"""Requirements of metrics: the properties that a scene must have for a metric to apply."""

import numpy as np

from dropspin.scenarios import Scenario, Truth
from dropspin.scenarios.state import RATES, SPIN


def has_truth(scene: Scenario, truth: Truth | None) -> bool:
    """Whether the exact solution is known."""
    return truth is not None


def spins(scene: Scenario, truth: Truth | None) -> bool:
    """Whether the body rotates at some time in the exact solution."""
    if truth is None:
        return False
    sampled = truth(np.linspace(0.0, min(scene.duration, truth.horizon), 9))
    return bool(sampled.angular_velocity.any()) or any(event.after[SPIN].any() for event in truth.events)


def has_impact(scene: Scenario, truth: Truth | None) -> bool:
    """Whether the body starts above the floor and strikes the floor."""
    return truth is not None and len(truth.events) > 0 and scene.starts_above_floor


def lands(scene: Scenario, truth: Truth | None) -> bool:
    """Whether the body turns on the floor before its first impact."""
    return (
        truth is not None
        and not starts_in_flight(scene)
        and len(truth.events) > 0
        and bool(truth.events[0].time > 0.0 and truth.events[0].before[SPIN].any())
    )


def comes_to_rest(scene: Scenario, truth: Truth | None) -> bool:
    """Whether the body comes to rest after an impact, within the first nine tenths of the scene's duration."""
    if truth is None or truth.horizon < scene.duration or not truth.events or truth.events[0].time == 0.0:
        return False
    return not truth([0.9 * scene.duration]).states[0, RATES].any()


def repeats_impacts(scene: Scenario, truth: Truth | None) -> bool:
    """Whether there are several impacts that do not amplify errors as those of a tumbling body do."""
    return truth is not None and truth.name in ("bounce-ladder", "rocking") and len(truth.events) > 1


def has_apex(scene: Scenario, truth: Truth | None) -> bool:
    """Whether the body rises to an apex after an impact."""
    return has_impact(scene, truth) and bool(scene.acceleration[1] < 0.0)


def has_floor(scene: Scenario, truth: Truth | None) -> bool:
    """Whether there is a floor."""
    return scene.floor is not None


def obeys_contact_laws(scene: Scenario, truth: Truth | None) -> bool:
    """Whether the forces of the floor can be computed from the motion: there is a floor, and no damping."""
    return scene.floor is not None and scene.damping is None


def limits_friction(scene: Scenario, truth: Truth | None) -> bool:
    """Whether, in addition, friction is limited by a coefficient, which is 0 without friction."""
    return obeys_contact_laws(scene, truth) and scene.floor is not None and scene.floor.friction != "infinite"


def keeps_energy(scene: Scenario, truth: Truth | None) -> bool:
    """Whether there is no damping, so that energy is lost only at the floor."""
    return scene.damping is None


def keeps_energy_in_flight(scene: Scenario, truth: Truth | None) -> bool:
    """Whether energy is conserved in the first flight."""
    return scene.damping is None and starts_in_flight(scene)


def spins_in_flight(scene: Scenario, truth: Truth | None) -> bool:
    """Whether the body starts in flight and has spin."""
    return starts_in_flight(scene) and spins(scene, truth)


def starts_in_flight(scene: Scenario) -> bool:
    """Whether the body starts without contact."""
    return scene.floor is None or scene.starts_above_floor


def keeps_horizontal_momentum(scene: Scenario, truth: Truth | None) -> bool:
    """Whether no force acts along the floor."""
    upright = scene.acceleration[0] == 0.0 and scene.acceleration[2] == 0.0
    return upright and scene.damping is None and scene.floor is not None and scene.floor.friction == "none"
