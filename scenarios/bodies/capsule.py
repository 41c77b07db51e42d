"""A capsule: a cylinder with a half ball at each end; the hull of two balls."""

import math
from typing import Literal

import numpy as np

from dropspin.scenarios.bodies.on_axis import OnAxis
from dropspin.scenarios.bodies.outline import Outline, around_axis, outline
from dropspin.scenarios.state import Array


class Capsule(OnAxis):
    """A capsule; its axis is the y axis of the body frame, and `half_length` is half of its length without the half balls."""

    shape: Literal["capsule"]

    @property
    def semi_axes(self) -> Array:
        return np.full(3, self.radius)

    @property
    def resting_height(self) -> float:
        x, y, z = self.centre
        return self.radius - math.hypot(x, z, max(abs(y) - self.half_length, 0.0))

    @property
    def outline(self) -> Outline:
        angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 12)  # an even number: both ends of the cylinder are among the heights
        height = self.radius * np.sin(angles) + np.copysign(self.half_length, angles)
        return outline(around_axis(self.radius * np.cos(angles), height) - self.centre, self.size)

    def tensor_of(self, distribution: str) -> Array:
        r, h = self.radius, self.half_length
        # Of the cylinder and the two half balls: their share of the mass, the moment about the axis and that across it, per mass.
        if distribution == "solid":
            shares, along, across = (1.5 * h, r), (0.5 * r**2, 0.4 * r**2), (0.25 * r**2 + h**2 / 3.0, 0.4 * r**2 + h**2 + 0.75 * h * r)
        else:
            shares, along, across = (h, r), (r**2, 2.0 / 3.0 * r**2), (0.5 * r**2 + h**2 / 3.0, 2.0 / 3.0 * r**2 + h**2 + h * r)
        masses = self.mass * np.array(shares) / sum(shares)
        return np.diag([masses @ across, masses @ along, masses @ across])
