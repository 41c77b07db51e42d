"""The geometry of the floor y = 0: its normal, components along it, and the points at which a body can touch it."""

import math

from numpy import float32

from dropspin.reference_impl.vectors import Vec3, compiled, dot, row

N = Vec3(0.0, 1.0, 0.0)
"""The floor's unit normal, upwards."""
BLOCK = 64
"""Number of vertices that are compared with the floor together, where there are as many: whole registers of any processor.

In single precision, which halves what is read; those of a block in which any may be below the floor are compared again one by one.
"""
SINGLE = 1e-6
"""Above the largest error of a height in single precision, relative to the reach of the body: a dozen roundings of 6e-8 at most."""
RIM_POINTS = 3
PLACES = ((1.0, 0.0), (-0.5, math.sqrt(0.75)), (-0.5, -math.sqrt(0.75)))
"""Cosine and sine of the angles around a rim from its lowest point."""


@compiled
def along_normal(a):
    """The component along N, a · N.

    It is written out, because a compiler that follows IEEE rules also computes the products with the zeros of N.
    """
    return a.y


@compiled
def is_below(x, r, floor):
    """Eq 10: whether the point at the offset r from the centre x is below the floor, and not beyond an end of it."""
    return _is_below(x, r, floor.half_extents, floor.thickness)


@compiled
def _is_below(x, r, half_extents, thickness):
    height = x.y + along_normal(r)
    if half_extents is None:
        return height < 0.0
    within = (abs(x.x + r.x) <= half_extents[0]) & (abs(x.z + r.z) <= half_extents[1])
    return (height < 0.0) & (height >= -thickness) & within


@compiled
def contact_count(body):
    """The number of points at which the body can touch the floor."""
    return body.points.shape[0] * (RIM_POINTS if body.has_rims else 1)


@compiled
def block_count(many_points):
    """The number of blocks of contact points: one of all, or many of at most `BLOCK` vertices."""
    return 1 if many_points is None else (many_points.shape[1] + BLOCK - 1) // BLOCK


@compiled
def block_range(x, R, body, many_points, block):
    """The numbers of a block's contact points, as the first and the end of a range; it is empty if none of many can be below the floor."""
    if many_points is None:
        return 0, contact_count(body)
    first, end = block * BLOCK, min(block * BLOCK + BLOCK, many_points.shape[1])
    if end - first < BLOCK:
        return first, end
    x_of, y_of, z_of = many_points[0, first:end], many_points[1, first:end], many_points[2, first:end]
    a, b, c, limit = float32(R.row2.x), float32(R.row2.y), float32(R.row2.z), float32(SINGLE - x.y / body.reach)
    below = 0
    for i in range(BLOCK):  # of constant length and without a branch, so that the compiler computes it in SIMD registers
        below += a * x_of[i] + b * y_of[i] + c * z_of[i] < limit
    return first, end if below > 0 else first


@compiled
def contact_offset(R, body, i):
    """Offset from the centre of mass to point i at which the body can touch the floor: a vertex.

    Not in the lecture note: a vertex with an ellipsoid about it touches at the lowest point of this ellipsoid; with a disc, at the lowest
    point of the rim, and, so that the rim can carry the body, at the two points that divide it into three equal parts with the lowest.
    """
    if body.has_rims:
        return _surface(R @ row(body.points, i // RIM_POINTS), R, body.semi_axes, body.radius, i % RIM_POINTS)
    return _surface(R @ row(body.points, i), R, body.semi_axes, body.radius, 0)


@compiled
def _surface(r, R, semi_axes, radius, place):
    """The point of the surface near the vertex at r."""
    ball = Vec3(r.x, r.y - radius, r.z)
    if semi_axes is None:
        return ball
    if semi_axes.x == semi_axes.y and semi_axes.y == semi_axes.z:
        return ball
    # With S the semi-axes and n = Rᵀ N, the lowest point is at -R S e, e = S n / |S n|; where a disc is level, every e in it is one.
    stretched = Vec3(semi_axes.x * R.row2.x, semi_axes.y * R.row2.y, semi_axes.z * R.row2.z)
    length = math.sqrt(dot(stretched, stretched))
    e = stretched / length if length > 0.0 else Vec3(1.0, 0.0, 0.0)
    cosine, sine = PLACES[place]
    offset = R @ Vec3(semi_axes.x * (cosine * e.x + sine * e.z), semi_axes.y * e.y, semi_axes.z * (cosine * e.z - sine * e.x))
    return r - offset
