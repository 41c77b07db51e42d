"""A ball: one vertex at the centre of mass, rounded by the radius."""

import math
from typing import ClassVar, Literal

import numpy as np

from dropspin.scenarios.bodies.inertia import Moments
from dropspin.scenarios.bodies.outline import Outline
from dropspin.scenarios.bodies.shape import Shape
from dropspin.scenarios.field_types import Positive
from dropspin.scenarios.state import Array


class Sphere(Shape):
    """A ball."""

    lengths: ClassVar = ("radius",)

    shape: Literal["sphere"]
    radius: Positive
    inertia: Literal["solid", "surface"] | Moments = "solid"

    @property
    def semi_axes(self) -> Array:
        return np.full(3, self.radius)

    @property
    def outline(self) -> Outline:
        return Outline(self.vertices, [], self.radius)

    @property
    def resting_height(self) -> float:
        return self.radius - math.hypot(*self.centre)

    def possible_multiple(self, squares: Array, enough: float = math.inf) -> float:
        """That of an ellipsoid with equal half extents."""
        return max(self.radius**2 - float(np.sum(self.centre**2)), 0.0) / float(np.trace(squares))

    def tensor_of(self, distribution: str) -> Array:
        share = 0.4 if distribution == "solid" else 2.0 / 3.0
        return share * self.mass * self.radius**2 * np.eye(3)
