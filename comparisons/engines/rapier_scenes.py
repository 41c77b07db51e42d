"""What the adapters of Rapier and of engines that are like it share: the scenes that Rapier cannot reproduce, surfaces and damping."""

import numpy as np

from dropspin.comparisons.engines import mapping
from dropspin.scenarios import Scenario, truth_for
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.state import ORIENTATION

GRIPPING = 1e6


def refusal(scene: Scenario, kind: str, engine: str = "Rapier") -> str | None:
    """Why Rapier, Havok or Box3D cannot reproduce a scene on a floor of a kind, `plane`, `box` or `mesh`; None if it can."""
    body, floor = scene.body, scene.floor
    unfit = mapping.refusal_of_floor(scene, kind) or mapping.refusal_of_rest_speed(scene, engine)
    if unfit is not None or floor is None or floor.restitution == 0.0:
        return unfit
    if floor.friction != "none" and not (body.is_ball and floor.friction == "infinite"):
        return f"{engine}'s friction does not respond to the rebound; a rough floor needs restitution 0, or a ball that it grips"
    truth = truth_for(scene)
    heights = [rotate(hit.before[ORIENTATION], body.vertices)[:, 1] for hit in truth.events] if truth else []
    landings = np.reshape(heights, (-1, len(body.vertices)))
    if np.any(np.sum(landings <= landings.min(axis=1, keepdims=True) + 1e-6 * body.size, axis=1) > 1):
        return f"{engine} rebounds with another restitution where several corners land at once, as here"
    return None


def damping_of(scene: Scenario, dt: float) -> dict[str, float]:
    """Rapier's coefficients of the damping of `linear` and `angular` velocities [1/s]; empty without damping."""
    return {motion: float(np.expm1(rate * dt)) / dt for motion, rate in scene.damping.rates.items()} if scene.damping else {}


def surface_of(scene: Scenario) -> dict[str, float]:
    """Restitution and coefficient of friction of body and floor; empty without a floor."""
    floor = scene.floor
    return {"restitution": floor.restitution, "friction": mapping.friction_of(floor, GRIPPING)} if floor else {}
