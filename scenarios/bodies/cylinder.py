"""A cylinder: the hull of two discs."""

import math
from functools import cached_property
from typing import Literal

import numpy as np

from dropspin.scenarios.bodies.on_axis import OnAxis
from dropspin.scenarios.bodies.outline import Outline, around_axis, outline
from dropspin.scenarios.state import Array


class Cylinder(OnAxis):
    """A cylinder; its axis is the y axis of the body frame, and `half_length` is half of its length."""

    shape: Literal["cylinder"]

    @property
    def semi_axes(self) -> Array:
        return np.array([self.radius, 0.0, self.radius])

    @cached_property
    def size(self) -> float:
        x, y, z = self.centre
        return math.hypot(self.radius + math.hypot(x, z), self.half_length + abs(y))

    @property
    def resting_height(self) -> float:
        x, y, z = self.centre
        return min(self.radius - math.hypot(x, z), self.half_length - abs(y))

    @property
    def outline(self) -> Outline:
        r, h = self.radius, self.half_length
        return outline(around_axis(np.array([r, r]), np.array([-h, h])) - self.centre, self.size)

    def tensor_of(self, distribution: str) -> Array:
        r, h = self.radius, self.half_length
        if distribution == "solid":
            along, across = 0.5 * r**2, 0.25 * r**2 + h**2 / 3.0
        else:  # the curved surface, and the two faces
            curved = 2.0 * h / (2.0 * h + r)
            along = r**2 * (curved + 0.5 * (1.0 - curved))
            across = curved * (0.5 * r**2 + h**2 / 3.0) + (1.0 - curved) * (0.25 * r**2 + h**2)
        return self.mass * np.diag([across, along, across])
