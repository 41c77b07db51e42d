"""Rotations by quaternions [x, y, z, w], body to world, for arrays with any leading axes."""

import numpy as np

from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY, Array


def cross(a: Array, b: Array) -> Array:
    """A × b over the last axis; for few vectors, as in a root search, numpy.cross takes four times as long."""
    product = np.empty(np.broadcast(a, b).shape)
    product[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    product[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    product[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return product


def crossing(a: Array) -> Array:
    """The matrix of a ×, shape (3, 3), of one vector."""
    x, y, z = a.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def dot(a: Array, b: Array) -> Array:
    """A · b over the last axis; np.sum over so short an axis takes three times as long."""
    return np.einsum("...i,...i->...", a, b)


def length(a: Array) -> Array:
    """|a| over the last axis."""
    return np.sqrt(dot(a, a))


def multiply(a: Array, b: Array) -> Array:
    """The rotation by b followed by that by a; shapes (..., 4)."""
    av, aw = a[..., :3], a[..., 3:]
    bv, bw = b[..., :3], b[..., 3:]
    vector = aw * bv + bw * av + cross(av, bv)
    scalar = aw * bw - dot(av, bv)[..., None]
    return np.concatenate([vector, scalar], axis=-1)


def conjugate(q: Array) -> Array:
    """The inverse of a unit quaternion, shape (..., 4)."""
    return q * np.array([-1.0, -1.0, -1.0, 1.0])


def rotate(q: Array, vectors: Array) -> Array:
    """Body-frame vectors, shape (..., 3), in the world frame."""
    axis, w = q[..., :3], q[..., 3:]
    twice = 2.0 * cross(axis, vectors)
    return vectors + w * twice + cross(axis, twice)


def unrotate(q: Array, vectors: Array) -> Array:
    """World-frame vectors, shape (..., 3), in the body frame."""
    return rotate(conjugate(q), vectors)


def turned_states(states: Array, rotation: Array) -> Array:
    """States, shape (..., 13), turned about the origin by a rotation, a unit quaternion."""
    parts = [rotate(rotation, states[..., part]) for part in (POSITION, VELOCITY, SPIN)]
    return np.concatenate([parts[0], multiply(rotation, states[..., ORIENTATION]), *parts[1:]], axis=-1)


def about(axis: Array, angle: Array) -> Array:
    """The rotation about a unit axis, (3,), by angles [rad], (...): shape (..., 4)."""
    half = 0.5 * np.asarray(angle)[..., None]
    return np.concatenate([np.sin(half) * axis, np.cos(half)], axis=-1)


def angle_between_orientations(a: Array, b: Array) -> Array:
    """The angle [rad] of the rotation from a to b; q and -q are the same orientation.

    The arctangent of the half angle's sine and cosine resolves 1e-16 rad and is accurate at π (W. Kahan).
    """
    difference = multiply(conjugate(a), b)
    return 2.0 * np.arctan2(length(difference[..., :3]), np.abs(difference[..., 3]))


def rotation_vector(a: Array, b: Array) -> Array:
    """The rotation from orientation a to b as its axis, in the world frame, times its angle of up to π [rad], shape (..., 3)."""
    difference = multiply(b, conjugate(a))
    difference = np.where(difference[..., 3:] < 0.0, -difference, difference)
    sine = length(difference[..., :3])[..., None]
    with np.errstate(invalid="ignore"):
        return np.where(sine > 0.0, difference[..., :3] * (2.0 * np.arctan2(sine, difference[..., 3:]) / sine), 0.0)


def angle_between_vectors(a: Array, b: Array) -> Array:
    """The angle [rad] between vectors, (..., 3)."""
    return np.arctan2(length(cross(a, b)), dot(a, b))
