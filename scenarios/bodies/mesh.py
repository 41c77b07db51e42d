"""A body whose surface is a mesh of triangles. The floor touches its convex hull; Wang's method looks at every vertex."""

from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import ConfigDict, Field, model_validator

from dropspin.scenarios.bodies.hull import FLAT, hull_corners, lowest_face
from dropspin.scenarios.bodies.inertia import Moments, second_moments
from dropspin.scenarios.bodies.mesh_files import Faces
from dropspin.scenarios.bodies.outline import Outline, outline
from dropspin.scenarios.bodies.shape import Shape
from dropspin.scenarios.field_types import AS_LISTS, Vector, rows
from dropspin.scenarios.state import Array

ROUNDING = 1e-15  # of products of inertia, relative to the moments
MOST_DRAWN = 2000  # faces; the hull of a finer mesh is drawn


def is_closed(points: Array, faces: Faces) -> bool:
    """Whether each edge has two triangles, which pass it in opposite directions."""
    return not openness(points, faces)


def openness(points: Array, faces: Faces) -> str:
    """Why triangles have no inside; empty if they have one. Vertices at one position count as one."""
    _, merged = np.unique(points, axis=0, return_inverse=True)
    first, second = merged.reshape(-1)[faces][:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2).T
    here, there = first * len(points) + second, second * len(points) + first
    if np.array_equal(np.sort(here), np.sort(there)):
        return "has triangles that are inside out beside others" if _has_part_inside_out(points, merged.reshape(-1)[faces], faces) else ""
    are_pairs = np.unique(np.minimum(here, there), return_counts=True)[1] % 2 == 0
    return "has triangles that are inside out beside others" if are_pairs.all() else "is not closed"


def _has_part_inside_out(points: Array, merged: Faces, faces: Faces) -> bool:
    """Whether a closed part is inside out and no cavity: not within the bounds of one that is not."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count, first, second = len(points), merged[:, [0, 1]].ravel(), merged[:, [1, 2]].ravel()
    part = connected_components(coo_array((np.ones(len(first)), (first, second)), shape=(count, count)), directed=False)[1][merged[:, 0]]
    corners = points[faces]
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, part, corners.min(axis=1))
    np.maximum.at(high, part, corners.max(axis=1))
    volumes = np.bincount(part, np.linalg.det(corners), minlength=count)
    outer, inner = volumes * volumes.sum() > 0.0, volumes * volumes.sum() < -ROUNDING * volumes.sum() ** 2
    return any(not ((low[outer] < low[own]) & (high[own] < high[outer])).all(axis=1).any() for own in np.flatnonzero(inner))


class Mesh(Shape):
    """A surface of triangles, whose vertices are counterclockwise as seen from outside; or inside out as a whole."""

    model_config = ConfigDict(arbitrary_types_allowed=True)
    lengths: ClassVar = ("points",)
    arrays: ClassVar = ("points", "faces")

    shape: Literal["mesh"]
    center_of_mass: Vector | None = None  # by default that of the distribution that `inertia` names, of a solid if it is numbers
    points: Annotated[Array, rows("rows of three numbers", 3), AS_LISTS, Field(repr=False)]
    faces: Annotated[Faces, rows("rows of three numbers", 3, kind=np.int64), AS_LISTS, Field(repr=False)]
    inertia: Literal["solid", "surface", "vertices", "note"] | Moments = "solid"

    @model_validator(mode="after")
    def _has_mass(self) -> Self:
        if self.faces.min() < 0 or self.faces.max() >= len(self.points):
            raise ValueError(f"faces has an index outside of the {len(self.points)} points")
        needs_inside = self._distribution == "solid" and self.center_of_mass is None
        if needs_inside and (why := openness(self.points, self.faces)):
            raise ValueError(
                f"the mesh {why}, so that nothing is inside; give inertia = 'surface' or 'vertices', or inertia as numbers with "
                "center_of_mass"
            )
        moments = np.linalg.eigvalsh(self.inertia_tensor)
        if not moments[0] > 1e-12 * moments[2]:
            raise ValueError("the mass lies on one line, about which it has no inertia")
        return self

    @property
    def _given(self) -> tuple[Any, ...]:
        return tuple(part.tobytes() if isinstance(part, np.ndarray) else part for part in super()._given)

    @property
    def _distribution(self) -> str:
        return self.inertia if isinstance(self.inertia, str) else "solid"

    @property
    def content(self) -> float:
        """Volume of a solid [m³], below 0 if it is inside out; area of a surface [m²]; or number of vertices."""
        return self._moments_of(self._distribution)[0]

    @cached_property
    def corners(self) -> Array:
        return self.points

    @cached_property
    def centre(self) -> Array:
        return self._moments_of(self._distribution)[1] if self.center_of_mass is None else np.array(self.center_of_mass)

    @cached_property
    def hull(self) -> Array:
        return self.vertices[hull_corners(self.vertices)]

    @cached_property
    def resting_height(self) -> float:
        return lowest_face(self.hull, self.size)

    @property
    def outline(self) -> Outline:
        if len(self.faces) > MOST_DRAWN:
            return outline(self.hull, self.size)
        return Outline(self.vertices, self.faces.tolist())

    def mirrored(self) -> dict[str, Any]:
        return super().mirrored() | {"points": self.points * [-1.0, 1.0, 1.0], "faces": self.faces[:, ::-1]}

    def tensor_of(self, distribution: str) -> Array:
        content, _, squares = self._moments_of(distribution)
        mass = len(self.points) if distribution == "note" else self.mass
        squares = np.where(np.abs(squares) > ROUNDING * np.trace(squares), 0.5 * (squares + squares.T), 0.0)
        return mass / content * (np.trace(squares) * np.eye(3) - squares)

    def _moments_of(self, distribution: str) -> tuple[float, Array, Array]:
        """Volume, area or number of a distribution of unit density, its centre, and its second moments about that, shape (3, 3).

        Over a tetrahedron with the origin and over a triangle with corners a, b, c, s = a + b + c, of content V, the integrals of x and
        x xᵀ are V s/n and V (a aᵀ + b bᵀ + c cᵀ + s sᵀ)/(n (n + 1)), n = 4 and 3. They are taken about the centre itself, found first, so
        that distances from the origin cancel no digits.
        """
        if distribution in ("vertices", "note"):
            centre = self.points.mean(axis=0)
            return float(len(self.points)), centre, second_moments(self.points - centre, 1.0)
        n, centre = 4 if distribution == "solid" else 3, self.points.mean(axis=0)
        for _ in range(2):
            corners = (self.points - centre)[self.faces]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            contents = np.sum(corners[:, 0] * normals, axis=1) / 6.0 if n == 4 else 0.5 * np.linalg.norm(normals, axis=1)
            total, sums = contents.sum(), corners.sum(axis=1)
            if not abs(total) > FLAT * np.ptp(self.points) ** (n - 1):
                raise ValueError(f"the mesh has no {'volume' if n == 4 else 'area'}")
            centre = centre + contents @ sums / (n * total)
        points = np.concatenate([corners.reshape(-1, 3), sums])
        weights = np.concatenate([np.repeat(contents, 3), contents]) / (n * (n + 1))
        return float(total), centre, points.T @ (weights[:, np.newaxis] * points)
