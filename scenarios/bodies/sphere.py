"""A ball: one vertex at the centre of mass, rounded by the radius."""

from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from dropspin.scenarios.bodies.inertia import PrincipalMoments
from dropspin.scenarios.bodies.shape import Shape
from dropspin.scenarios.state import Array
from dropspin.scenarios.tables import Positive


class Sphere(Shape):
    """A ball."""

    lengths: ClassVar = ("radius",)

    shape: Literal["sphere"]
    radius: Positive
    inertia: Literal["solid"] | PrincipalMoments = "solid"

    @cached_property
    def vertices(self) -> Array:
        return np.zeros((1, 3))

    @property
    def rounding(self) -> float:
        return self.radius

    @property
    def resting_height(self) -> float:
        return self.radius

    def tensor_of(self, distribution: str) -> Array:
        return 0.4 * self.mass * self.radius**2 * np.eye(3)
