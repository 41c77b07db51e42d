"""What capsules and cylinders have in common: equal ends on the y axis of the body frame."""

from functools import cached_property
from typing import ClassVar, Literal

import numpy as np

from dropspin.scenarios.bodies.inertia import Moments
from dropspin.scenarios.bodies.shape import Shape
from dropspin.scenarios.field_types import Positive
from dropspin.scenarios.state import UP, Array


class OnAxis(Shape):
    """The hull of two equal ends, which are `half_length` from the centre of the shape along the y axis."""

    lengths: ClassVar = ("radius", "half_length")
    has_own_axis: ClassVar = True

    radius: Positive
    half_length: Positive
    inertia: Literal["solid", "surface"] | Moments = "solid"

    @cached_property
    def corners(self) -> Array:
        return np.outer([-self.half_length, self.half_length], UP)
