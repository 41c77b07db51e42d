"""Algorithms 1 and 2 of the note, transcribed plainly with NumPy and on purpose without a look at `reference_impl`.

Slow, unoptimised, one statement a line of the note: the yardstick that the compiled kernels are held to.
"""

import numpy as np

UP = np.array([0.0, 1.0, 0.0])


def rotation_matrix(q):
    x, y, z, w = q
    return np.array(
        [
            [w**2 + x**2 - y**2 - z**2, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w**2 - x**2 + y**2 - z**2, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w**2 - x**2 - y**2 + z**2],
        ]
    )


def quaternion_product(q1, q2):
    v1, w1, v2, w2 = q1[:3], q1[3], q2[:3], q2[3]
    return np.append(w1 * v2 + w2 * v1 + np.cross(v1, v2), w1 * w2 - v1 @ v2)


def cross_matrix(r):
    return np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])


def collision_handler(
    x, q, v, w, mass, inertia, points, mu, sticking, rest_speed, point=(0.0, 0.0, 0.0), normal=UP, carries=lambda at: True
):
    """Of the plane through `point`, at points that it `carries`."""
    R, N = rotation_matrix(q), normal
    r_sum, count = np.zeros(3), 0
    for p in points:
        r = R @ p
        if (x + r - point) @ N < 0 and carries(x + r) and (v + np.cross(w, r)) @ N < 0:
            r_sum = r_sum + r
            count = count + 1
    if count == 0:
        return v, w
    r = r_sum / count
    vi = v + np.cross(w, r)
    if abs(vi @ N) < rest_speed:
        mu = 0.0
    r_star = cross_matrix(r)
    inertia_inverse = np.linalg.inv(R @ inertia @ R.T)
    K = np.eye(3) / mass - r_star @ inertia_inverse @ r_star
    wanted = -vi - mu * (vi @ N) * N if sticking else -(mu + 1) * (vi @ N) * N
    j = np.linalg.solve(K, wanted)
    return v + j / mass, w + inertia_inverse @ np.cross(r, j)


def update(state, mass, inertia, points, dt, gravity, c_linear, c_angular, mu, sticking, rest_speed, planes=({},)):
    x, q, v, w = state[0:3], state[3:7], state[7:10], state[10:13]
    v = v + dt * gravity
    v = c_linear * v
    w = c_angular * w
    for plane in planes:
        v, w = collision_handler(x, q, v, w, mass, inertia, points, mu, sticking, rest_speed, **plane)
    x = x + dt * v
    q = q + dt / 2 * quaternion_product(np.append(w, 0.0), q)
    q = q / np.linalg.norm(q)
    return np.concatenate([x, q, v, w])
