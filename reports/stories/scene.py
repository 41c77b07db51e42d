"""The description of a scene: the effects that it models and those that it leaves out."""

import numpy as np

from dropspin.scenarios.model import Scenario


def modelled(scene: Scenario) -> list[str]:
    """The parts of a scene that are simulated."""
    parts = [f"a {scene.body.description or scene.body.shape} of {scene.body.mass:g} kg"]
    if scene.gravity is not None:
        parts.append(f"gravity of {np.linalg.norm(scene.acceleration):g} m/s²")
    if scene.floor is not None:
        friction = scene.floor.friction
        grip = {"none": "no friction", "infinite": "infinite friction"}.get(str(friction), f"friction {friction}")
        parts.append(f"a floor of restitution {scene.floor.restitution:g} and {grip}")
    if scene.damping is not None:
        linear, angular = scene.damping.rates.values()
        parts.append(f"linear damping of {linear:g} and angular damping of {angular:g} per second")
    if scene.damping is not None and scene.damping.factors:
        linear, angular = scene.damping.factors.values()
        parts[-1] += f", by factors of {linear:g} and {angular:g} per step of {scene.damping.factor_dt:g} s"
    if scene.ensemble is not None:
        parts.append(f"{scene.ensemble.size} starts drawn around the scene's own")
    return parts


def left_out(scene: Scenario) -> list[str]:
    """The parts that a scene does not model; no engine simulates them."""
    return [part for part in ("gravity", "floor", "damping") if getattr(scene, part) is None]
