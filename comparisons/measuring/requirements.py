"""Requirements of metrics: whether a scene has what a metric needs. The first line of a docstring says what is needed."""

import numpy as np

from dropspin.scenarios import Scenario, Trajectory, Truth
from dropspin.scenarios.mechanics import kinetic_energy
from dropspin.scenarios.state import RATES, SPIN, Array
from dropspin.scenarios.truths.truth import Impact


def has_reference(scene: Scenario, truth: Truth | None) -> bool:
    """An exact solution, or a recording."""
    return truth is not None


def has_truth(scene: Scenario, truth: Truth | None) -> bool:
    """An exact solution."""
    return truth is not None and truth.is_exact


def spins(scene: Scenario, truth: Truth | None) -> bool:
    """An exact solution with spin."""
    if truth is None or not truth.is_exact:
        return False
    sampled = truth(np.linspace(0.0, min(scene.duration, truth.horizon), 9))
    return bool(sampled.angular_velocity.any()) or any(event.after[SPIN].any() for event in truth.events)


def has_impact(scene: Scenario, truth: Truth | None) -> bool:
    """An exact solution with an impact, the first one with the floor.

    The body starts above the floor.
    """
    return _first_impact_with_floor(truth) is not None and scene.starts_above_floor


def _first_impact_with_floor(truth: Truth | None) -> Impact | None:
    """The first event of an exact solution, unless it is with a wall."""
    return truth.events[0] if truth is not None and truth.events and truth.events[0].wall is None else None


def has_newton_restitution(scene: Scenario, truth: Truth | None) -> bool:
    """An exact impact with Newton's restitution."""
    return has_impact(scene, truth) and scene.floor is not None and scene.floor.impact_law in ("cone", "integrated-newton")


def lands(scene: Scenario, truth: Truth | None) -> bool:
    """An exact solution that turns on the floor before its first impact."""
    first = _first_impact_with_floor(truth)
    return first is not None and not starts_in_flight(scene) and first.time > 0.0 and bool(first.before[SPIN].any())


def comes_to_rest(scene: Scenario, truth: Truth | None) -> bool:
    """An exact solution that comes to rest.

    It does so after an impact, within the first nine tenths of the scene's duration.
    """
    if truth is None or truth.horizon < scene.duration or not truth.events or truth.events[0].time == 0.0:
        return False
    return not truth([0.9 * scene.duration]).states[0, RATES].any()


def repeats_impacts(scene: Scenario, truth: Truth | None) -> bool:
    """An exact solution that bounces or rocks more than once.

    These impacts do not amplify errors as those of a tumbling body do.
    """
    return truth is not None and truth.name in ("bounce-ladder", "rocking") and len(truth.events) > 1


def has_apex(scene: Scenario, truth: Truth | None) -> bool:
    """An exact solution with an impact, gravity downwards."""
    return has_impact(scene, truth) and bool(scene.acceleration[1] < 0.0)


def has_floor(scene: Scenario, truth: Truth | None) -> bool:
    """A floor that does not end."""
    return scene.floor is not None and not scene.floor.ends


def obeys_contact_laws(scene: Scenario, truth: Truth | None) -> bool:
    """A floor that does not end, no walls, no damping.

    The forces of the floor can then be computed from the motion.
    """
    return scene.floor is not None and scene.damping is None and not scene.has_edges_or_walls


def limits_friction(scene: Scenario, truth: Truth | None) -> bool:
    """A floor that does not end, whose friction is not infinite, no walls, no damping."""
    return obeys_contact_laws(scene, truth) and scene.floor is not None and scene.floor.friction != "infinite"


def opposes_slip_left(scene: Scenario, truth: Truth | None) -> bool:
    """A floor that does not end, whose friction opposes the remaining slip, no walls, no damping.

    In other laws friction opposes the slip at each instant of the impact.
    """
    return obeys_contact_laws(scene, truth) and scene.floor is not None and scene.floor.impact_law == "cone"


def gains_no_energy(scene: Scenario, truth: Truth | None) -> bool:
    """No damping, no end of the floor, and no impact that gains energy in the exact solution.

    Some gain energy whose restitution is large and Newton's.
    """
    if scene.damping is not None or _floor_ends(scene):
        return False
    return truth is None or all(_kinetic(scene, event.after) <= (1.0 + 1e-9) * _kinetic(scene, event.before) for event in truth.events)


def _kinetic(scene: Scenario, state: Array) -> float:
    """The kinetic energy of a state [J]."""
    return float(kinetic_energy(scene, Trajectory.from_states(np.zeros(1), state[np.newaxis]))[0])


def keeps_energy_in_flight(scene: Scenario, truth: Truth | None) -> bool:
    """No damping, no end of the floor, a start in flight."""
    return scene.damping is None and not _floor_ends(scene) and starts_in_flight(scene)


def spins_in_flight(scene: Scenario, truth: Truth | None) -> bool:
    """An exact solution with spin, a start in flight."""
    return starts_in_flight(scene) and spins(scene, truth)


def _floor_ends(scene: Scenario) -> bool:
    """Whether a body can be below the height of the floor without a contact."""
    return scene.floor is not None and scene.floor.ends


def starts_in_flight(scene: Scenario) -> bool:
    """Whether the body starts without contact."""
    return scene.floor is None or scene.starts_above_floor


def keeps_horizontal_momentum(scene: Scenario, truth: Truth | None) -> bool:
    """A frictionless floor that does not end, no walls, gravity straight down, no damping."""
    upright = scene.acceleration[0] == 0.0 and scene.acceleration[2] == 0.0
    return upright and obeys_contact_laws(scene, truth) and scene.floor is not None and scene.floor.friction == "none"
