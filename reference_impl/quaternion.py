"""Orientation: the quaternion algebra of the note's section 2.1 (eq 3 to 5)."""

import math

from reference_impl.vectors import Mat3, Quat, Vec3, compiled


@compiled
def product(a, b):
    """Eq 5: the rotation by b, then by a."""
    return Quat(
        a.w * b.x + b.w * a.x + (a.y * b.z - a.z * b.y),
        a.w * b.y + b.w * a.y + (a.z * b.x - a.x * b.z),
        a.w * b.z + b.w * a.z + (a.x * b.y - a.y * b.x),
        a.w * b.w - (a.x * b.x + a.y * b.y + a.z * b.z),
    )


@compiled
def normalise(q):
    """Eq 3: back to unit length."""
    return q / math.sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w)


@compiled
def rotation_matrix(q):
    """Eq 4: R, from body to world."""
    x, y, z, w = q.x, q.y, q.z, q.w
    return Mat3(
        Vec3(w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)),
        Vec3(2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)),
        Vec3(2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z),
    )
