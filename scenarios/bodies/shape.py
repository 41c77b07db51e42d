"""What is known of a shape: its vertices, which may touch a floor, its mass, inertia and surface, and the shape in other units.

Each shape is the convex hull of ellipsoids about its vertices, which are all equal: points for a box, balls for a capsule, discs for a
cylinder. A new shape is a file of its own beside this one, which gives `vertices`, `semi_axes`, `resting_height` and `tensor_of`; the rest
follows from these unless the shape overrides it.
"""

import math
from abc import abstractmethod
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from pydantic import model_validator

from dropspin.scenarios.bodies.inertia import Moments, is_diagonal, mean_squares, tensor
from dropspin.scenarios.bodies.outline import Outline, around_axis, outline
from dropspin.scenarios.bodies.possible_moments import largest_multiple
from dropspin.scenarios.bodies.surface import RIM, rise_of_centre
from dropspin.scenarios.field_types import Positive, Table, Vector
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.state import Array

INERTIA_ROUNDING = 1.001  # moments are often given with three or four digits
AROUND = 64
"""Points of each circle of the polytope around a round body."""
MIRRORED = np.array([[1.0, -1.0, -1.0], [-1.0, 1.0, 1.0], [-1.0, 1.0, 1.0]])
"""The signs of a tensor of inertia that is mirrored at the plane x = 0."""


class Shape(Table):
    """The `[body]` table of a scene."""

    lengths: ClassVar[tuple[str, ...]]
    """The keys whose values are lengths: numbers, or vectors along the body's axes, or tuples of such vectors."""
    has_own_axis: ClassVar[bool] = False
    """Whether the shape is about a given axis of the body frame, so that its axes cannot have another order."""
    arrays: ClassVar[tuple[str, ...]] = ()
    """The keys whose values are large arrays."""
    description: ClassVar[str] = ""
    """The shape in words, if not by the name of its table's key `shape`."""

    mass: Positive
    center_of_mass: Vector | None = (0.0, 0.0, 0.0)
    """Where it is in the frame in which the shape is given [m]."""
    if TYPE_CHECKING:  # in this order, which the digest of a scene depends on, they are fields of each shape
        shape: str
        inertia: str | Moments

    # By the given values only; pydantic would compare cached arrays too.
    def __eq__(self, other: object) -> bool:
        return isinstance(other, Shape) and self._given == other._given

    def __hash__(self) -> int:
        return hash(self._given)

    @property
    def _given(self) -> tuple[Any, ...]:
        return type(self), *(getattr(self, name) for name in type(self).model_fields)

    @model_validator(mode="after")
    def _inertia_is_about_the_centre_of_mass(self) -> Self:
        if self._has_offset and isinstance(self.inertia, str):
            raise ValueError("center_of_mass does not say where the mass is; give inertia as numbers, about the centre of mass")
        return self

    @property
    def centre(self) -> Array:
        """The centre of mass in the frame of the shape [m], shape (3,)."""
        return np.array(self.center_of_mass)

    @property
    def _lengths(self) -> tuple[str, ...]:
        return (*self.lengths, "center_of_mass") if self._has_offset else self.lengths

    @property
    def _has_offset(self) -> bool:
        return any(self.center_of_mass or ())

    @cached_property
    def corners(self) -> Array:
        """The points whose convex hull the shape is, apart from the ellipsoids about them, in the frame of the shape [m], shape (n, 3)."""
        return np.zeros((1, 3))

    @cached_property
    def vertices(self) -> Array:
        """The corners relative to the centre of mass [m], shape (n, 3)."""
        return self.corners - self.centre

    @property
    def semi_axes(self) -> Array:
        """Semi-axes of the ellipsoid about each vertex, along the axes of the body frame [m], shape (3,); (a, 0, c) is a disc."""
        return np.zeros(3)

    @property
    @abstractmethod
    def resting_height(self) -> float:
        """Lowest possible height of the centre of mass on a floor [m]."""

    @abstractmethod
    def tensor_of(self, distribution: str) -> Array:
        """Inertia about the centre of mass of a distribution of the mass that `inertia` names, in the body frame [kg m²], shape (3, 3)."""

    @property
    def hull(self) -> Array:
        """The corners of the convex hull of the vertices, in the order of the vertices [m], shape (m, 3)."""
        return self.vertices

    @property
    def has_rims(self) -> bool:
        """Whether a disc is about each vertex."""
        return bool(self.semi_axes.any()) and self.semi_axes[1] == 0.0

    @property
    def is_ball(self) -> bool:
        """Whether the surface is a sphere about the centre of mass."""
        return len(self.vertices) == 1 and not self.vertices.any() and np.ptp(self.semi_axes) == 0.0

    @cached_property
    def size(self) -> float:
        """Largest distance of any part from the centre of mass [m]."""
        return float(np.sqrt(np.max(np.sum(self.vertices**2, axis=1)))) + float(self.semi_axes.max())

    @property
    def outline(self) -> Outline:
        """The surface, to be drawn."""
        return outline(self.vertices, self.size)

    def lowest(self, orientation: Array, tolerance: float) -> Array:
        """Offsets of the lowest points from the centre of mass at an orientation, shape (4,), in the world frame [m], shape (n, 3).

        Points that are at most `tolerance` times the size of the body higher than the lowest one are among them; of a disc that lies so
        level, four points of its rim.
        """
        offsets = rotate(orientation, self.vertices)
        lowest = offsets[offsets[:, 1] <= offsets[:, 1].min() + tolerance * self.size]
        rises = rise_of_centre(orientation, self.semi_axes)
        if self.has_rims and rises[1] <= 0.5 * tolerance * self.size:
            rim = rotate(orientation, self.semi_axes * RIM)
            return (lowest[:, np.newaxis] + rim).reshape(-1, 3)
        return lowest - rises

    @cached_property
    def inertia_tensor(self) -> Array:
        """Inertia about the centre of mass, in the body frame [kg m²], shape (3, 3)."""
        return self.tensor_of(self.inertia) if isinstance(self.inertia, str) else tensor(self.inertia)

    @property
    def moments(self) -> tuple[float, ...]:
        """Moments of inertia about the body's own axes [kg m²], without the products of inertia."""
        return tuple(np.diag(self.inertia_tensor).tolist())

    @cached_property
    def largest_spread(self) -> Array:
        """Bounds of the mean squares of x, y and z of the mass, in the body frame, if no mass is outside of the body [m²], shape (3,).

        The mean of x² is at most a b for a mass between -a and b whose centre is at 0.

        Source: R. Bhatia & C. Davis, A better bound on the variance, Amer. Math. Monthly 107 (2000).
        """
        return (self.semi_axes + self.vertices.max(axis=0)) * (self.semi_axes - self.vertices.min(axis=0))

    def possible_multiple(self, squares: Array, enough: float = math.inf) -> float:
        """The largest multiple of second moments about the centre of mass [m²], shape (3, 3), that masses inside of the body have.

        That of the convex hull, or of a polytope around a round body, whose second moments are larger by up to 1 %. If it is above
        `enough`, any other number above that.
        """
        return largest_multiple(_around(self.hull, self.semi_axes), squares, enough)

    @property
    def excess_inertia(self) -> str:
        """Why the given moments of inertia are impossible for a body of this shape; empty if a distribution of its mass has them."""
        if isinstance(self.inertia, str):
            return ""
        squares = mean_squares(self.inertia_tensor, self.mass)
        multiple = self.possible_multiple(squares, 1.0 / INERTIA_ROUNDING)
        if multiple * INERTIA_ROUNDING >= 1.0:
            return ""
        needed, largest = np.diag(squares).clip(0.0), self.largest_spread.clip(0.0)
        possible = self.mass * np.minimum(largest.sum() - largest, self.size**2)
        return (
            f"got {np.array(self.inertia).tolist()} kg m², which needs mass outside of the body: at most {multiple:.3g} times as "
            f"much is possible. It has a root mean square of x, y and z of {_digits(np.sqrt(needed))} m, of which this shape allows "
            f"{_digits(np.sqrt(largest))} m, each by itself, and moments of inertia of up to {_digits(possible)} kg m² for "
            f"{self.mass:g} kg. Correct the inertia, the mass or the size."
        )

    @property
    def ambiguity(self) -> str:
        """What the table leaves to a default that is probably not meant; usually empty."""
        return ""

    def scaled(self, length: float, mass: float) -> dict[str, Any]:
        """The keys of the body with lengths and masses multiplied by factors."""
        keys: dict[str, Any] = {"mass": mass * self.mass, **{name: times(length, getattr(self, name)) for name in self._lengths}}
        has_unit_masses = self.inertia == "note" and is_diagonal(self.inertia_tensor)  # for a body of any mass
        if has_unit_masses or not isinstance(self.inertia, str):
            keys["inertia"] = times(mass * length**2, self.moments if isinstance(self.inertia, str) else self.inertia)
        return keys

    def mirrored(self) -> dict[str, Any]:
        """The keys of the body that differ in its mirror image at the plane x = 0."""
        keys: dict[str, Any] = {"center_of_mass": tuple(self.centre * [-1.0, 1.0, 1.0])} if self._has_offset else {}
        if not is_diagonal(self.inertia_tensor) and not isinstance(self.inertia, str):
            keys["inertia"] = tuple(map(tuple, (self.inertia_tensor * MIRRORED).tolist()))
        return keys

    def with_axes(self, order: tuple[int, ...]) -> dict[str, Any]:
        """The keys of the body with its axes in another order."""
        keys = {name: _permuted(order, getattr(self, name)) for name in self._lengths}
        if not isinstance(self.inertia, str):
            permuted = _permuted(order, self.inertia)
            keys["inertia"] = tuple(permuted[axis] for axis in order) if isinstance(permuted[0], tuple) else permuted
        return keys


def _around(points: Array, semi_axes: Array) -> Array:
    """Points whose hull contains the ellipsoids about given points, shape (n, 3)."""
    if not semi_axes.any():
        return points
    narrow = math.cos(math.pi / AROUND)
    if semi_axes[1] == 0.0:
        ring = around_axis(np.ones(1), np.zeros(1), AROUND) / narrow
    else:
        angles = np.linspace(-0.5 * math.pi, 0.5 * math.pi, AROUND // 2 + 1)
        ring = around_axis(np.cos(angles), np.sin(angles), AROUND) / narrow**2
    return (points[:, np.newaxis] + semi_axes * ring).reshape(-1, 3)


def times(factor: float, values: Any) -> Any:
    """A number, or each number of nested tuples, times a factor."""
    return tuple(times(factor, value) for value in values) if isinstance(values, tuple) else factor * values


def _permuted(order: tuple[int, ...], values: Any) -> Any:
    """The components of a vector, or of each vector of a tuple, in another order; a number unchanged."""
    if isinstance(values, np.ndarray):
        return values[:, list(order)]
    if not isinstance(values, tuple):
        return values
    return tuple(_permuted(order, value) for value in values) if isinstance(values[0], tuple) else tuple(values[axis] for axis in order)


def _digits(values: Array) -> str:
    return f"[{', '.join(f'{value:.3g}' for value in values)}]"
