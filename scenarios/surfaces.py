"""The floor and the walls of a scene: tables of its file."""

import math
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from dropspin.scenarios.field_types import NotNegative, Number, Positive, Table, Vector, unit
from dropspin.scenarios.rotations import turned_states
from dropspin.scenarios.state import POSITION, Array

FrictionLaw = Literal["cone", "integrated-newton", "integrated-poisson", "integrated-energy"]


class Surface(Table):
    """What the contacts of a floor or a wall depend on.

    `impact_law` is the model of an impact with a coefficient of friction: see `dropspin.scenarios.truths.friction_impact`.
    """

    restitution: Annotated[Number, Field(ge=0, le=1)]
    friction: Literal["none", "infinite"] | NotNegative
    rest_speed: NotNegative = 0.0
    impact_law: FrictionLaw = "cone"

    @property
    def coefficient(self) -> float:
        """The Coulomb coefficient: 0 without friction, inf for infinite friction."""
        return {"none": 0.0, "infinite": math.inf}[self.friction] if isinstance(self.friction, str) else self.friction

    @model_validator(mode="after")
    def _law_has_friction(self) -> Self:
        if self.friction == 0.0:
            object.__setattr__(self, "friction", "none")
        if self.impact_law != "cone" and isinstance(self.friction, str):
            raise ValueError(f"impact_law is {self.impact_law!r}, which needs a coefficient of friction; friction is {self.friction!r}")
        return self


class Floor(Surface):
    """The plane y = 0, facing up, or, with an end, the box below it: |x| and |z| up to `half_extents` [m], y down to -`thickness` [m]."""

    half_extents: Annotated[tuple[Positive, ...], Field(min_length=2, max_length=2)] | None = None
    thickness: Positive | None = None

    @property
    def ends(self) -> bool:
        """Whether a body can pass by the floor."""
        return self.half_extents is not None or self.thickness is not None


class Wall(Surface):
    """The plane through a point [m], with a normal, of length 1, into the space that the body can be in."""

    point: Vector
    normal: Annotated[Vector, AfterValidator(unit)]

    @property
    def frame(self) -> Array:
        """The rotation that takes the normal to the y axis, a quaternion, shape (4,)."""
        x, y, z = self.normal
        return np.array(unit((-z, 0.0, x, 1.0 + y))) if y > -1.0 else np.array([1.0, 0.0, 0.0, 0.0])

    def as_floor(self, states: Array) -> Array:
        """States, shape (..., 13), in the frame in which the wall is the plane y = 0, facing up."""
        moved = states.copy()
        moved[..., POSITION] -= self.point
        return turned_states(moved, self.frame)
