"""A box, whose faces are perpendicular to the axes of the body frame."""

import math
from functools import cached_property
from itertools import product
from typing import ClassVar, Literal

import numpy as np

from dropspin.scenarios.bodies.inertia import Moments, is_diagonal
from dropspin.scenarios.bodies.shape import Shape
from dropspin.scenarios.field_types import PositiveVector
from dropspin.scenarios.state import Array


class Box(Shape):
    """A box; its half extents lie along the x, y and z axes of the body frame."""

    lengths: ClassVar = ("half_extents",)

    shape: Literal["box"]
    half_extents: PositiveVector
    inertia: Literal["solid", "surface", "vertices", "note"] | Moments = "solid"

    @cached_property
    def corners(self) -> Array:
        return np.array(list(product((-1.0, 1.0), repeat=3))) * self.half_extents

    @property
    def resting_height(self) -> float:
        return float(np.min(np.array(self.half_extents) - np.abs(self.centre)))

    def possible_multiple(self, squares: Array, enough: float = math.inf) -> float:
        """By itself along each axis, if the axes of the box are principal axes; a mass between -a and b has a mean square of up to a b."""
        if is_diagonal(squares):
            return float(np.min(self.largest_spread / np.maximum(np.diag(squares), 1e-300)).clip(0.0))
        return super().possible_multiple(squares, enough)

    def tensor_of(self, distribution: str) -> Array:
        a, b, c = np.square(self.half_extents)
        about_axes = np.diag([b + c, c + a, a + b])
        if distribution == "surface":
            areas = 1.0 / np.array(self.half_extents)  # of the faces across each axis, relative to one another
            x, y, z = self.mass * np.square(self.half_extents) * (areas.sum() + 2.0 * areas) / (3.0 * areas.sum())
            return np.diag([y + z, z + x, x + y])
        # A uniform box, eight equal corner masses, and eight corner masses of 1 (eq 8 as printed).
        return about_axes * {"solid": self.mass / 3, "vertices": self.mass, "note": 8.0}[distribution]
