"""The geometry of the floor y = 0: its normal, components along it, and the points at which a body can touch it."""

from dropspin.reference_impl.vectors import Vec3, compiled, row

N = Vec3(0.0, 1.0, 0.0)
"""The floor's unit normal, upwards."""


@compiled
def along_normal(a):
    """The component along N, a · N.

    It is written out, because a compiler that follows IEEE rules also computes the products with the zeros of N.
    """
    return a.y


@compiled
def vertex(R, body, i):
    """Offset from the centre of mass to vertex i. A rounded vertex touches at its lowest point (for balls; not in the lecture note)."""
    r = R @ row(body.points, i)
    return Vec3(r.x, r.y - body.radius, r.z)
