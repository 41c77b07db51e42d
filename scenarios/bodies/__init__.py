"""Bodies: what is known of a shape in general (`shape.py`), and one shape a file, which together are the `[body]` table of a scene."""

from typing import Annotated

from pydantic import Field

from dropspin.scenarios.bodies.box import Box
from dropspin.scenarios.bodies.shape import Shape
from dropspin.scenarios.bodies.sphere import Sphere
from dropspin.scenarios.bodies.vertices import Vertices

__all__ = ["Body", "Box", "Shape", "Sphere", "Vertices"]

Body = Annotated[Sphere | Box | Vertices, Field(discriminator="shape")]
