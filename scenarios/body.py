"""The `[body]` table: the shape of a body, and its mass, inertia and vertices."""

import math
from functools import cached_property
from itertools import product
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

Array = NDArray[np.float64]

LARGEST = 1e50
"""Largest magnitude of a number of a scene: energies and inertias, products of up to five of them, stay finite."""

Number = Annotated[float, Field(strict=True, ge=-LARGEST, le=LARGEST, allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0)]
NotNegative = Annotated[Number, Field(ge=0)]
Vector = Annotated[tuple[Number, ...], Field(min_length=3, max_length=3)]
PositiveVector = Annotated[tuple[Positive, ...], Field(min_length=3, max_length=3)]

FLAT = 1e-14
"""Largest thickness of a set of points, relative to its size, that is attributed to rounding."""


class Table(BaseModel):
    """A table of a file: immutable, without unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def _possible(moments: tuple[float, ...]) -> tuple[float, ...]:
    largest = max(moments)
    if largest > (sum(moments) - largest) * (1 + 1e-12):
        raise ValueError("no body has these moments: the largest must not exceed the sum of the other two")
    return moments


PrincipalMoments = Annotated[PositiveVector, AfterValidator(_possible)]


class _Body(Table):
    mass: Positive

    # By the given values only; pydantic would compare cached arrays too.
    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Body) and self._given == other._given

    def __hash__(self) -> int:
        return hash(self._given)

    @property
    def _given(self) -> tuple[Any, ...]:
        return type(self), *(getattr(self, name) for name in type(self).model_fields)

    @property
    def vertices(self) -> Array:
        """The points that may touch the floor, relative to the centre of mass [m], shape (n, 3)."""
        raise NotImplementedError

    @property
    def hull(self) -> Array:
        """The corners of the convex hull of the vertices, in the order of the vertices [m], shape (m, 3)."""
        return self.vertices

    @property
    def rounding(self) -> float:
        """Distance of the surface from the vertices [m]: the radius of a ball, which has one vertex; 0 for other bodies."""
        return 0.0

    @property
    def inertia_tensor(self) -> Array:
        """Inertia about the centre of mass, in the body frame [kg m²], shape (3, 3)."""
        raise NotImplementedError

    @cached_property
    def size(self) -> float:
        """Largest distance of any part from the centre of mass [m]."""
        return float(np.sqrt(np.max(np.sum(self.vertices**2, axis=1)))) + self.rounding

    @property
    def resting_height(self) -> float:
        """Lowest possible height of the centre of mass on a floor [m]."""
        raise NotImplementedError

    @cached_property
    def largest_spread(self) -> Array:
        """Bounds of the mean squares of x, y and z of the mass, in the body frame, if no mass is outside of the body [m²], shape (3,).

        The mean of x² is at most a b for a mass between -a and b whose centre is at 0.

        Source: R. Bhatia & C. Davis, A better bound on the variance, Amer. Math. Monthly 107 (2000).
        """
        squares: Array = (self.rounding + self.vertices.max(axis=0)) * (self.rounding - self.vertices.min(axis=0))
        return squares


class Sphere(_Body):
    """A ball."""

    shape: Literal["sphere"]
    radius: Positive
    inertia: Literal["solid"] | PrincipalMoments = "solid"

    @cached_property
    def vertices(self) -> Array:
        return np.zeros((1, 3))

    @property
    def rounding(self) -> float:
        return self.radius

    @cached_property
    def inertia_tensor(self) -> Array:
        if self.inertia == "solid":
            return 0.4 * self.mass * self.radius**2 * np.eye(3)
        return np.diag(self.inertia)

    @property
    def resting_height(self) -> float:
        return self.radius


class Box(_Body):
    """A box; its half extents lie along the x, y and z axes of the body frame."""

    shape: Literal["box"]
    half_extents: PositiveVector
    inertia: Literal["solid", "vertices", "note"] | PrincipalMoments = "solid"

    @cached_property
    def vertices(self) -> Array:
        return np.array(list(product((-1.0, 1.0), repeat=3))) * self.half_extents

    @cached_property
    def inertia_tensor(self) -> Array:
        if isinstance(self.inertia, tuple):
            return np.diag(self.inertia)
        a, b, c = np.square(self.half_extents)
        about_axes = np.diag([b + c, c + a, a + b])
        # A uniform box, eight equal corner masses, and eight corner masses of 1 (eq 8 as printed).
        return about_axes * {"solid": self.mass / 3, "vertices": self.mass, "note": 8.0}[self.inertia]

    @property
    def resting_height(self) -> float:
        return min(self.half_extents)


class Vertices(_Body):
    """A rigid set of points, which have equal masses unless masses are given."""

    shape: Literal["vertices"]
    points: Annotated[tuple[Vector, ...], Field(min_length=2, max_length=10_000)]
    masses: Annotated[tuple[Positive, ...], Field(min_length=2)] | None = None
    inertia: Literal["vertices", "note"] | PrincipalMoments = "vertices"

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
    def vertices(self) -> Array:
        points = np.array(self.points)
        return points - np.average(points, axis=0, weights=self._point_masses)

    @cached_property
    def inertia_tensor(self) -> Array:
        if isinstance(self.inertia, tuple):
            return np.diag(self.inertia)
        masses = self._point_masses if self.inertia == "vertices" else np.ones(len(self.points))
        # Summed exactly, because the rounding of ten thousand terms would show in a comparison to the last digits.
        spread = np.array([[math.fsum(masses * a * b) for b in self.vertices.T] for a in self.vertices.T])
        return np.trace(spread) * np.eye(3) - spread

    @cached_property
    def hull(self) -> Array:
        return self.vertices[hull_corners(self.vertices)]

    @cached_property
    def resting_height(self) -> float:
        # On the face nearest to the centre of mass; a plane set of points can lie flat.
        centred = self.vertices - self.vertices.mean(axis=0)
        if np.linalg.matrix_rank(centred, tol=1e-9 * self.size) < 3:
            return 0.0
        from scipy.spatial import ConvexHull, QhullError

        try:
            return float(np.min(np.abs(ConvexHull(self.vertices).equations[:, 3])))
        except QhullError:  # thinner than Qhull resolves
            return 0.0


def hull_corners(points: Array) -> NDArray[np.intp]:
    """Ascending indices of the points, shape (n, 3), that are corners of their convex hull, which may be flat, a line or a point."""
    from scipy.spatial import ConvexHull, QhullError

    centred = points - points.mean(axis=0)
    _, extents, directions = np.linalg.svd(centred, full_matrices=False)
    spanned = directions[extents > FLAT * np.linalg.norm(points)]
    if len(spanned) == 0:
        return np.array([0])
    if len(spanned) == 1:
        along = centred @ spanned[0]
        return np.unique([np.argmin(along), np.argmax(along)])
    try:
        return np.sort(ConvexHull(points if len(spanned) == 3 else centred @ spanned.T).vertices).astype(np.intp)
    except QhullError:  # thinner than Qhull resolves
        return np.arange(len(points))


Body = Annotated[Sphere | Box | Vertices, Field(discriminator="shape")]
