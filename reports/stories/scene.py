"""The description of a scene: the effects that it models and those that it leaves out."""

import numpy as np

from dropspin.scenarios.model import Scenario
from dropspin.scenarios.surfaces import Surface
from dropspin.scenarios.text import counted


def modelled(scene: Scenario) -> list[str]:
    """The parts of a scene that are simulated."""
    body = scene.body.description or scene.body.shape
    parts = [f"{'an' if body[0] in 'aeiou' else 'a'} {body} of {scene.body.mass:g} kg"]
    if scene.gravity is not None:
        parts.append(f"gravity of {np.linalg.norm(scene.acceleration):g} m/s²")
    if scene.floor is not None:
        x, z = scene.floor.half_extents or (0.0, 0.0)
        extent = f" up to |x| = {x:g} m and |z| = {z:g} m," if x else ""
        depth = f" {scene.floor.thickness:g} m thick," if scene.floor.thickness else ""
        parts.append(f"a floor{extent}{depth} of {_surface(scene.floor)}")
    for wall in scene.wall or ():
        through, along = ("(" + ", ".join(f"{value:g}" for value in vector) + ")" for vector in (wall.point, wall.normal))
        parts.append(f"a wall through {through} m with the normal {along}, of {_surface(wall)}")
    if scene.damping is not None:
        linear, angular = scene.damping.rates.values()
        parts.append(f"linear damping of {linear:g} and angular damping of {angular:g} per second")
    if scene.damping is not None and scene.damping.factors:
        linear, angular = scene.damping.factors.values()
        parts[-1] += f", by factors of {linear:g} and {angular:g} per step of {scene.damping.factor_dt:g} s"
    if scene.ensemble is not None:
        parts.append(f"{counted(scene.ensemble.size, 'start')} drawn around that of the scene")
    if scene.recording is not None:
        parts.append(counted(len(scene.recording.tosses), "measured toss", "measured tosses"))
    return parts


def _surface(surface: Surface) -> str:
    grip = {"none": "no friction", "infinite": "infinite friction"}.get(str(surface.friction), f"friction {surface.friction}")
    return f"restitution {surface.restitution:g} and {grip}"


def left_out(scene: Scenario) -> list[str]:
    """The parts that a scene does not model; no engine simulates them."""
    return [part for part in ("gravity", "floor", "damping") if getattr(scene, part) is None]
