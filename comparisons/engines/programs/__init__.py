"""Programs and models with an engine's settings, ready to paste, rendered from templates."""

from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Box, Sphere

# Programs and models made of numbers, not pages of user text: nothing to escape.
TEMPLATES = Environment(loader=PackageLoader(__name__, "."), undefined=StrictUndefined, keep_trailing_newline=True, autoescape=False)


def rendered(template: str, scene: Scenario, **values: Any) -> str:
    """The text of a template for a ball or a flat box that falls onto a floor, with z up."""
    assert scene.floor is not None
    body = scene.body
    extents = [body.radius] if isinstance(body, Sphere) else body.vertices.max(axis=0)[[2, 0, 1]].tolist()
    values |= {"shape": "ball" if isinstance(body, Sphere) else "box", "extents": extents, "lowest": extents[-1]}
    values |= {"mass": body.mass, "gravity": -scene.acceleration[1], "restitution": scene.floor.restitution}
    return TEMPLATES.get_template(template).render(values)


def can_be_pasted(scene: Scenario) -> bool:
    """Whether the templates support the scene: a ball or a box on a floor, under gravity along -y."""
    falls = bool(scene.acceleration[1] < 0.0) and not any(scene.acceleration[::2])
    return falls and scene.floor is not None and isinstance(scene.body, (Sphere, Box))
