"""Orientation: the quaternion algebra of section 2.1 of the lecture note (eq 3 to 5)."""

import math

from dropspin.reference_impl.vectors import Mat3, Quat, Vec3, compiled, transpose


@compiled
def product(a, b):
    """Eq 5: the rotation by b followed by that by a."""
    return Quat(
        a.w * b.x + b.w * a.x + (a.y * b.z - a.z * b.y),
        a.w * b.y + b.w * a.y + (a.z * b.x - a.x * b.z),
        a.w * b.z + b.w * a.z + (a.x * b.y - a.y * b.x),
        a.w * b.w - (a.x * b.x + a.y * b.y + a.z * b.z),
    )


@compiled
def conjugate(q):
    """The inverse rotation, for a unit quaternion."""
    return Quat(-q.x, -q.y, -q.z, q.w)


@compiled
def normalise(q):
    """Eq 3: the quaternion of unit length."""
    return q / math.sqrt(_square(q))


@compiled
def from_matrix(m):
    """The unit quaternion of a rotation matrix, by its largest component (S. W. Shepperd, J. Guidance and Control 1, 1978)."""
    trace = m.row1.x + m.row2.y + m.row3.z
    largest = max(trace, m.row1.x, m.row2.y, m.row3.z)
    if largest == trace:
        q = Quat(m.row3.y - m.row2.z, m.row1.z - m.row3.x, m.row2.x - m.row1.y, 1.0 + trace)
    elif largest == m.row1.x:
        q = Quat(1.0 + 2.0 * m.row1.x - trace, m.row2.x + m.row1.y, m.row1.z + m.row3.x, m.row3.y - m.row2.z)
    elif largest == m.row2.y:
        q = Quat(m.row2.x + m.row1.y, 1.0 + 2.0 * m.row2.y - trace, m.row3.y + m.row2.z, m.row1.z - m.row3.x)
    else:
        q = Quat(m.row1.z + m.row3.x, m.row3.y + m.row2.z, 1.0 + 2.0 * m.row3.z - trace, m.row2.x - m.row1.y)
    return normalise(q)


@compiled
def rotation_matrix(q):
    """Eq 4: R, from body to world."""
    x, y, z, w = q.x, q.y, q.z, q.w
    return Mat3(
        Vec3(w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)),
        Vec3(2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)),
        Vec3(2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z),
    )


@compiled
def to_world(q, a):
    """R a, from the body frame to the world frame.

    The result is divided by q·q, which differs from 1 by rounding, always with the same sign. Without the division, an angular velocity
    that is transformed to the body frame and back at every step would drift.
    """
    return (rotation_matrix(q) @ a) / _square(q)


@compiled
def to_body(q, a):
    """Rᵀ a, from the world frame to the body frame."""
    return (transpose(rotation_matrix(q)) @ a) / _square(q)


@compiled
def _square(q):
    return (q.x * q.x + q.y * q.y) + (q.z * q.z + q.w * q.w)
