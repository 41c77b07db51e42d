"""An ellipsoid."""

import math
from typing import ClassVar, Literal

import numpy as np

from dropspin.scenarios.bodies.inertia import Moments
from dropspin.scenarios.bodies.outline import Outline, around_axis, outline
from dropspin.scenarios.bodies.shape import Shape
from dropspin.scenarios.field_types import PositiveVector
from dropspin.scenarios.state import Array


class Ellipsoid(Shape):
    """An ellipsoid; its half extents lie along the x, y and z axes of the body frame."""

    lengths: ClassVar = ("half_extents",)

    shape: Literal["ellipsoid"]
    half_extents: PositiveVector
    inertia: Literal["solid", "surface"] | Moments = "solid"

    @property
    def semi_axes(self) -> Array:
        return np.array(self.half_extents)

    @property
    def resting_height(self) -> float:
        """The distance of the centre of mass c from the nearest point of the surface, at a² c / (a² - t) along each axis.

        By a Lagrange multiplier t up to the square of the shortest half extent, which it is if c has no part along that axis.

        Source: D. Eberly, Distance from a point to an ellipse, an ellipsoid, or a hyperellipsoid (2013).
        """
        from scipy.optimize import brentq

        squares, centre = self.semi_axes**2, self.centre
        least = squares.min()
        is_shortest = squares == least
        offset = float(np.linalg.norm(centre[is_shortest]))

        def outside(t: float) -> float:
            gaps = np.where(squares > t, squares - t, 1.0)
            return float(np.sum(squares * (centre / gaps) ** 2)) - 1.0

        if offset == 0.0 and outside(least) < 0.0:
            across = centre[~is_shortest] / (squares[~is_shortest] - least)
            height = math.sqrt(least * (1.0 - float(np.sum(squares[~is_shortest] * across**2))))
            return math.hypot(height, float(least * np.linalg.norm(across)))
        t = brentq(outside, 0.0, least - math.sqrt(least) * offset, xtol=1e-300, rtol=1e-15)
        return float(np.linalg.norm(centre * t / (squares - t)))

    def possible_multiple(self, squares: Array, enough: float = math.inf) -> float:
        """In units of the half extents the body is a ball, in which a mean square distance of up to 1 from its middle is possible.

        Source: F. Uhlig, Linear Algebra Appl. 25 (1979), 219-237, for the S-lemma, by which no other condition is needed.
        """
        left = max(1.0 - float(np.sum((self.centre / self.semi_axes) ** 2)), 0.0)
        return left / float(np.sum(np.diag(squares) / self.semi_axes**2))

    @property
    def outline(self) -> Outline:
        angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 13)
        return outline(self.semi_axes * around_axis(np.cos(angles), np.sin(angles)) - self.centre, self.size)

    def tensor_of(self, distribution: str) -> Array:
        """The tensor of inertia; of the surface by the means over the unit sphere of w, n² w and n²/w, w² = Σ (n/a)².

        A point is at (a n) where the surface has w times the sphere's area; its mean square along an axis is a² <n² w>/<w>. The flux of
        n w^k e through the sphere, e along that axis, gives <w> + <n²/w>/a² = 4 <n² w> for k = 1, and for k = -1 the mean of n²/w.

        Source: B. C. Carlson, Elliptic integrals, DLMF 19.16.3 (R_G as the mean of w) and 19.16.5 (R_D).
        """
        squares = np.square(self.half_extents)
        if distribution == "solid":
            a, b, c = squares
            return 0.2 * self.mass * np.diag([b + c, c + a, a + b])
        from scipy.special import elliprd, elliprf, elliprg

        x, y, z = 1.0 / squares
        inverse = 0.5 * (elliprf(x, y, z) - np.array([x * elliprd(y, z, x), y * elliprd(z, x, y), z * elliprd(x, y, z)]) / 3.0)
        means = 0.25 * (squares + inverse / elliprg(x, y, z))
        return self.mass * (means.sum() * np.eye(3) - np.diag(means))
