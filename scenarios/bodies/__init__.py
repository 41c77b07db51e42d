"""Bodies: what is known of a shape in general (`shape.py`), and one shape a file, which together are the `[body]` table of a scene."""

from typing import Annotated, Any, get_args

from pydantic import Field, TypeAdapter

from dropspin.scenarios.bodies.box import Box
from dropspin.scenarios.bodies.capsule import Capsule
from dropspin.scenarios.bodies.cylinder import Cylinder
from dropspin.scenarios.bodies.ellipsoid import Ellipsoid
from dropspin.scenarios.bodies.mesh import Mesh
from dropspin.scenarios.bodies.on_axis import OnAxis
from dropspin.scenarios.bodies.shape import Shape
from dropspin.scenarios.bodies.sphere import Sphere
from dropspin.scenarios.bodies.vertices import Vertices

__all__ = ["SHAPES", "Body", "Box", "Capsule", "Cylinder", "Ellipsoid", "Mesh", "OnAxis", "Shape", "Sphere", "Vertices", "body_of"]

Shapes = Sphere | Box | Capsule | Cylinder | Ellipsoid | Vertices | Mesh
SHAPES: tuple[str, ...] = tuple(shape for kind in get_args(Shapes) for shape in get_args(kind.model_fields["shape"].annotation))
"""The names of all shapes."""
Body = Annotated[Shapes, Field(discriminator="shape")]


def body_of(table: dict[str, Any]) -> Shapes:
    """The body of a table."""
    return TypeAdapter[Shapes](Body).validate_python(table)
