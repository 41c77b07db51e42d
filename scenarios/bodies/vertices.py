"""A body that is given by points, which are its only parts or the corners of a body with given moments of inertia."""

from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from dropspin.scenarios.bodies.hull import hull_corners, lowest_face
from dropspin.scenarios.bodies.inertia import Moments, second_moments
from dropspin.scenarios.bodies.shape import Shape, times
from dropspin.scenarios.field_types import Positive, Vector
from dropspin.scenarios.state import Array


class Vertices(Shape):
    """A rigid set of points, which have equal masses unless masses are given."""

    lengths: ClassVar = ("points",)
    description: ClassVar = "body with given vertices"

    shape: Literal["vertices"]
    points: Annotated[tuple[Vector, ...], Field(min_length=2, max_length=10_000)]
    center_of_mass: Vector | None = None  # by default that of the masses
    masses: Annotated[tuple[Positive, ...], Field(min_length=2)] | None = None
    inertia: Literal["vertices", "note"] | Moments = "vertices"

    @model_validator(mode="before")
    @classmethod
    def _mass_from_masses(cls, table: dict[str, Any]) -> dict[str, Any]:
        masses = table.get("masses")
        if "mass" not in table and isinstance(masses, (list, tuple)) and all(type(m) in (int, float) for m in masses):
            return {**table, "mass": float(sum(masses))}
        return table

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.masses is not None and len(self.masses) != len(self.points):
            raise ValueError(f"masses has {len(self.masses)} entries for {len(self.points)} points; each point needs one")
        if self.masses is not None and not np.isclose(self.mass, np.sum(self.masses), rtol=1e-9, atol=0):
            raise ValueError(f"mass is {self.mass:g} but masses add up to {np.sum(self.masses):g}; the two must be equal")
        moments = np.linalg.eigvalsh(self.inertia_tensor)
        if moments[0] <= 1e-12 * moments[2]:
            raise ValueError("the points lie on one line, about which they have no inertia; they must span at least a plane")
        return self

    @cached_property
    def _point_masses(self) -> Array:
        if self.masses is None:
            return np.full(len(self.points), self.mass / len(self.points))
        return np.array(self.masses)

    @cached_property
    def corners(self) -> Array:
        return np.array(self.points)

    @cached_property
    def centre(self) -> Array:
        if self.center_of_mass is not None:
            return np.array(self.center_of_mass)
        return np.average(self.corners, axis=0, weights=self._point_masses)

    @cached_property
    def hull(self) -> Array:
        return self.vertices[hull_corners(self.vertices)]

    @cached_property
    def resting_height(self) -> float:
        return lowest_face(self.vertices, self.size)

    def tensor_of(self, distribution: str) -> Array:
        masses = self._point_masses if distribution == "vertices" else np.ones(len(self.points))
        spread = second_moments(self.vertices, masses)
        return np.trace(spread) * np.eye(3) - spread

    @property
    def ambiguity(self) -> str:
        if {"inertia", "masses"} & self.model_fields_set:
            return ""
        return (
            f"without inertia and masses, the mass is at the {len(self.points)} points; a solid body has other moments of inertia. Give "
            "inertia = [Ixx, Iyy, Izz], or inertia = 'vertices' if this is meant."
        )

    def scaled(self, length: float, mass: float) -> dict[str, Any]:
        keys = super().scaled(length, mass)
        return keys if self.masses is None else {**keys, "masses": times(mass, self.masses)}

    def mirrored(self) -> dict[str, Any]:
        return super().mirrored() | {"points": tuple((-x, y, z) for x, y, z in self.points)}
