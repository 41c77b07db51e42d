"""A box, whose faces are perpendicular to the axes of the body frame."""

from functools import cached_property
from itertools import product
from typing import ClassVar, Literal

import numpy as np

from dropspin.scenarios.bodies.inertia import PrincipalMoments
from dropspin.scenarios.bodies.shape import Shape
from dropspin.scenarios.state import Array
from dropspin.scenarios.tables import PositiveVector


class Box(Shape):
    """A box; its half extents lie along the x, y and z axes of the body frame."""

    lengths: ClassVar = ("half_extents",)

    shape: Literal["box"]
    half_extents: PositiveVector
    inertia: Literal["solid", "vertices", "note"] | PrincipalMoments = "solid"

    @cached_property
    def vertices(self) -> Array:
        return np.array(list(product((-1.0, 1.0), repeat=3))) * self.half_extents

    @property
    def resting_height(self) -> float:
        return min(self.half_extents)

    def tensor_of(self, distribution: str) -> Array:
        a, b, c = np.square(self.half_extents)
        about_axes = np.diag([b + c, c + a, a + b])
        # A uniform box, eight equal corner masses, and eight corner masses of 1 (eq 8 as printed).
        return about_axes * {"solid": self.mass / 3, "vertices": self.mass, "note": 8.0}[distribution]
