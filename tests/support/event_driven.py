"""Event-driven integration of a body that falls and strikes the floor, by another route than the exact solutions take.

A flight is a Taylor series in time of the body's rates and of its quaternion, restarted every fraction of a radian; the height of each
point is then a polynomial, whose first descending zero is the impact. The height of a point that was just struck is 0 at the start of its
flight, so that its polynomial is divided by the time: short flights lose no digits.

It covers impacts of one point, in double precision: flights shorter than 1e-9 of the first one, and impacts that several points share, are
outside of it.
"""

import math
from dataclasses import dataclass

import numba
import numpy as np

TERMS = 22
ANGLE = 0.2  # rad, turned at most within one series
SAMPLES = 24  # of a height within one series, between which it has at most one minimum
SECTORS = 720  # of the directions of the slip that an impact leaves
LOWEST = 1e-9  # of the size: points at most this much higher than the lowest one have been struck too
NO_FRICTION, STICKING, COULOMB = range(3)


@dataclass(frozen=True)
class Events:
    """The impacts of a motion.

    `times` [s], shape (k,), the states `before` and `after` each, shape (k, 13), and the number of `points` that each struck.
    """

    times: np.ndarray
    before: np.ndarray
    after: np.ndarray
    points: np.ndarray

    @property
    def flights(self):
        """Durations of the flights that end with each impact [s], shape (k,)."""
        return np.diff(self.times, prepend=0.0)


def integrate(scene, most=200, shortest=1e-9):
    """The impacts of a scene without damping, until the scene ends, or the body does not rise after an impact.

    At most `most` impacts; the last one is that after a flight shorter than `shortest` of the first flight.
    """
    floor = scene.floor
    kind = {"none": NO_FRICTION, "infinite": STICKING}.get(floor.friction, COULOMB)
    friction = floor.friction if kind == COULOMB else 0.0
    body = scene.body
    rows = _integrate(
        np.ascontiguousarray(body.hull),
        body.semi_axes[0],
        body.size,
        body.mass,
        body.inertia_tensor,
        scene.initial_state,
        scene.acceleration,
        floor.restitution,
        floor.rest_speed,
        kind,
        float(friction),
        scene.duration,
        most,
        shortest,
    )
    return Events(rows[:, 0], rows[:, 1:14], rows[:, 14:27], rows[:, 27].astype(int))


@numba.njit(cache=True)
def _product(a, b, k):
    total = 0.0
    for i in range(k + 1):
        total += a[i] * b[k - i]
    return total


def _matrix(q):
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


@numba.njit(cache=True)
def _series(q, rates, inertia, inverse):
    """Taylor coefficients of the quaternion, (4, TERMS), and of the rates in the body, (3, TERMS)."""
    Q, W, L = np.zeros((4, TERMS)), np.zeros((3, TERMS)), np.zeros((3, TERMS))
    for i in range(4):
        Q[i, 0] = q[i]
    for i in range(3):
        W[i, 0] = rates[i]
    for k in range(TERMS - 1):
        for i in range(3):
            L[i, k] = inertia[i, 0] * W[0, k] + inertia[i, 1] * W[1, k] + inertia[i, 2] * W[2, k]
        torque = np.empty(3)
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            torque[i] = _product(L[a], W[b], k) - _product(L[b], W[a], k)
        for i in range(3):
            W[i, k + 1] = (inverse[i, 0] * torque[0] + inverse[i, 1] * torque[1] + inverse[i, 2] * torque[2]) / (k + 1)
        x, y, z, w = Q[0], Q[1], Q[2], Q[3]
        half = 0.5 / (k + 1)
        Q[0, k + 1] = half * (_product(w, W[0], k) + _product(y, W[2], k) - _product(z, W[1], k))
        Q[1, k + 1] = half * (_product(w, W[1], k) + _product(z, W[0], k) - _product(x, W[2], k))
        Q[2, k + 1] = half * (_product(w, W[2], k) + _product(x, W[1], k) - _product(y, W[0], k))
        Q[3, k + 1] = -half * (_product(x, W[0], k) + _product(y, W[1], k) + _product(z, W[2], k))
    return Q, W


@numba.njit(cache=True)
def _evaluate(polynomial, t):
    total = 0.0
    for k in range(len(polynomial) - 1, -1, -1):
        total = total * t + polynomial[k]
    return total


@numba.njit(cache=True)
def _slope(polynomial, t):
    total = 0.0
    for k in range(len(polynomial) - 1, 0, -1):
        total = total * t + k * polynomial[k]
    return total


@numba.njit(cache=True)
def _between(polynomial, low, high, slopes):
    """The change of sign of a polynomial, or of its slope, between two times, by bisection to the last digit."""
    sign = (_slope(polynomial, low) if slopes else _evaluate(polynomial, low)) > 0.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        if middle <= low or middle >= high:
            break
        if ((_slope(polynomial, middle) if slopes else _evaluate(polynomial, middle)) > 0.0) == sign:
            low = middle
        else:
            high = middle
    return high


@numba.njit(cache=True)
def _first_zero(polynomial, end):
    """The first time up to `end` at which a polynomial that is positive at 0 becomes negative; inf if it stays positive."""
    before = 0.0
    for n in range(1, SAMPLES + 1):
        now = end * n / SAMPLES
        if _evaluate(polynomial, now) < 0.0:
            return _between(polynomial, before, now, False)
        if _slope(polynomial, before) < 0.0 < _slope(polynomial, now):
            lowest = _between(polynomial, before, now, True)
            if _evaluate(polynomial, lowest) < 0.0:
                return _between(polynomial, before, lowest, False)
        before = now
    return np.inf


def _impulse(response, u, e, kind, friction):
    if kind == NO_FRICTION:
        return np.array([0.0, -(1.0 + e) * u[1] / response[1, 1], 0.0])
    sticking = np.linalg.solve(response, np.array([-u[0], -u[1] - e * u[1], -u[2]]))
    if kind == STICKING or math.hypot(sticking[0], sticking[2]) <= friction * sticking[1]:
        return sticking
    # The cone law, by bisection of the direction of the remaining slip: of all directions, the one that it has itself.
    angles = np.linspace(0.0, 2.0 * np.pi, SECTORS + 1)
    turned = _slip(response, u, e, friction, angles)[0] > 0.0
    for n in np.flatnonzero(turned[1:] != turned[:-1]):
        low, high = angles[n], angles[n + 1]
        for _ in range(60):
            middle = 0.5 * (low + high)
            if (_slip(response, u, e, friction, middle)[0] > 0.0) == turned[n]:
                low = middle
            else:
                high = middle
        if _slip(response, u, e, friction, high)[1] > 0.0:
            direction = np.array([-friction * math.cos(high), 1.0, -friction * math.sin(high)])
            return -(1.0 + e) * u[1] / (response[1] @ direction) * direction
    return np.full(3, np.nan)


def _slip(response, u, e, friction, angle):
    """The slip that friction in a direction leaves: its parts across this direction and along it. `angle` may be an array."""
    c, s = np.cos(angle), np.sin(angle)
    along = [response[i, 1] - friction * (response[i, 0] * c + response[i, 2] * s) for i in range(3)]
    normal = (1.0 + e) * u[1] / along[1]
    left_x, left_z = u[0] - normal * along[0], u[2] - normal * along[2]
    return c * left_z - s * left_x, c * left_x + s * left_z


@numba.njit(cache=True)
def _second_row(Q):
    """Taylor coefficients of the second row of the rotation matrix, shape (3, TERMS)."""
    row = np.zeros((3, TERMS))
    for k in range(TERMS):
        row[0, k] = 2.0 * (_product(Q[0], Q[1], k) + _product(Q[2], Q[3], k))
        row[1, k] = -2.0 * (_product(Q[0], Q[0], k) + _product(Q[2], Q[2], k))
        row[2, k] = 2.0 * (_product(Q[1], Q[2], k) - _product(Q[0], Q[3], k))
    row[1, 0] += 1.0
    return row


def _heights(points, rounding, struck, Q, x, v, g):
    """Taylor coefficients of the height of each point, shape (n, TERMS), for a struck point of its height over the time."""
    heights = points @ _second_row(Q)
    heights[:, 0] += x[1] - rounding
    heights[:, 1] += v[1]
    heights[:, 2] += 0.5 * g[1]
    heights[struck, :-1] = heights[struck, 1:]
    heights[struck, -1] = 0.0
    return heights


def _struck(R, arm, v, w, mass, inverse, e, rest_speed, kind, friction):
    """The velocity and the rates in the body after the impact of a point, and the point's upward velocity."""
    u = v + np.cross(R @ w, arm)
    skew = np.array([[0.0, -arm[2], arm[1]], [arm[2], 0.0, -arm[0]], [-arm[1], arm[0], 0.0]])
    response = np.eye(3) / mass - skew @ (R @ inverse @ R.T) @ skew
    impulse = _impulse(response, u, e if -u[1] >= rest_speed else 0.0, kind, friction)
    v = v + impulse / mass
    w = w + inverse @ (R.T @ np.cross(arm, impulse))
    return v, w, (v + np.cross(R @ w, arm))[1]


def _integrate(points, rounding, size, mass, inertia, start, g, e, rest_speed, kind, friction, duration, most, shortest):
    inverse, moments = np.linalg.inv(inertia), np.linalg.eigvalsh(inertia)
    rows = np.empty((most, 28))
    count, now, took_off = 0, 0.0, 0.0
    x, q, v = start[0:3].copy(), start[3:7].copy(), start[7:10].copy()
    w = _matrix(q).T @ start[10:13]
    struck = np.zeros(len(points), dtype=np.bool_)
    while count < most and now < duration:
        # The energy is constant, so that |ω| is never larger than now by more than this factor.
        fastest = np.sqrt(np.sum(w * w) * moments[2] / moments[0])
        step, which = min(duration - now, ANGLE / (fastest + 1e-300), 0.25 * duration), -1
        Q, W = _series(q, w, inertia, inverse)
        heights = _heights(points, rounding, struck, Q, x, v, g)
        for i in range(len(points)):
            contact = _first_zero(heights[i], step)
            if contact < step:
                step, which = contact, i
        turned = np.array([_evaluate(Q[k], step) for k in range(4)])
        q = turned / np.sqrt(np.sum(turned * turned))
        w = np.array([_evaluate(W[k], step) for k in range(3)])
        x, v, now = x + step * v + 0.5 * step * step * g, v + step * g, now + step
        struck[:] = False
        if which < 0:
            continue
        R = _matrix(q)
        rows[count, 0] = now
        rows[count, 1:4], rows[count, 4:8], rows[count, 8:11], rows[count, 11:14] = x, q, v, R @ w
        arm = R @ points[which] - rounding * np.array([0.0, 1.0, 0.0])
        v, w, rises = _struck(R, arm, v, w, mass, inverse, e, rest_speed, kind, friction)
        rows[count, 14:17], rows[count, 17:21], rows[count, 21:24], rows[count, 24:27] = x, q, v, R @ w
        low = points @ R[1]
        struck[:] = low <= low.min() + LOWEST * size
        rows[count, 27] = np.sum(struck)
        count += 1
        if rises <= 1e-12 * np.sqrt(np.sum(v * v)) or (count > 1 and now - took_off < shortest * rows[0, 0]):
            break
        took_off = now
    return rows[:count]
