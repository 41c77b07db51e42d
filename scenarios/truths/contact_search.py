"""The time at which a body in free flight next descends through the floor, found by time steps that cannot contain a contact.

A corner r of a free body has the upward acceleration g_y + (α × r + ω × (ω × r))_y. With Ω the largest |ω|, |α| <= Ω²/√3 for the moments
that a body can have, because |(I_j - I_k)/I_i| <= 1. So from its height h and its upward velocity v, for all s > 0,

    h(t + s) >= h + v s + (g_y - c) s²/2,   c = (1 + 1/√3) Ω² |r|,   or |ω_horizontal| |ω × r| where ω is constant

and there is no contact before the first zero of the right-hand side. The zeros approach a contact quadratically from before. Without
rotation c = 0, and the first zero is the contact.

A corner may be the centre of an ellipsoid with the semi-axes S, whose lowest point changes with time. With n the upward direction in the
body, n' = dn/dt, and c for the farthest of its points, the height of all its points is

    h(t + s) >= y + v_y s + (n + n' s) · r - |S (n + n' s)| + (g_y - c) s²/2
             >= h + v s + (g_y - c - |S n'|²/|S n|) s²/2, and
             >= h + (v_y + n'·r - |S n'|) s + (g_y - c) s²/2

where v is the velocity of the point that is lowest now.

The height of a corner that is on the floor at the start is computed from the integrals of v_y and n', at first by Gauss–Legendre
quadrature, so that it is as accurate as these are, relative to the height: flights that last a millionth of those before lose no digits.
The depth has changed by  |S n| - |S n₀| = S (n - n₀) · S (n + n₀) / (|S n| + |S n₀|),  which also holds where a disc passes its level
position, at which the derivative of the depth jumps.

Source: interval exclusion by Taylor's theorem with Lagrange's remainder; Euler's equations for |α|; C. F. Gauss (1814) for the quadrature.
Valid for: undamped flight. The search ends without a contact time in two cases: a corner comes within rounding of the floor without clearly
crossing it, so that double precision does not determine whether it touches the floor; or the search would take too many steps.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios.model import TOUCHING
from dropspin.scenarios.rotations import cross, dot, length, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, UP, VELOCITY, Array
from dropspin.scenarios.truths.flight import Flight

ANGULAR_ACCELERATION = 1.0 / math.sqrt(3.0)  # largest |α| over Ω²
FIRST_ANGLE = 0.5  # rad, between the times at which contacts are excluded first
HALVINGS = 6  # of the intervals in which none could be excluded, before they are searched step by step
MAX_INTERVALS = 250_000  # of the first kind, after which the search ends; or
MAX_HEIGHTS = 50_000_000  # of corners in them; and
MAX_STEPS = 10_000  # within one stretch where the body nearly touches
MAX_DESCENT = 100  # steps of a corner within rounding of the floor, until it crosses or ascends
FIRST_CHUNK = 32  # intervals at a time, doubled up to
LARGEST_CHUNK = 50_000  # heights of corners at a time
HEIGHT_ROUNDING = 1e-15  # of all terms of a height
ATTITUDE_ROUNDING = 1e-15  # rad, for each rad turned
SPEED_ROUNDING = 1e-14  # of all terms of the upward velocity of a corner
SHALLOWEST = 1e-12  # depth of a level disc, relative to the size of the body
NODES, WEIGHTS = np.polynomial.legendre.leggauss(10)  # exact to rounding for a turn of 2 `FIRST_ANGLE`


@dataclass(frozen=True)
class Contact:
    """The end of a search at a `time` [s]: a contact, or a time after which it is not known whether there is a contact."""

    time: float
    is_decided: bool


class ContactSearch:
    """The search in one flight.

    Args:
        flight: The flight.
        points: Corners of the body's convex hull, from the centre of mass in the body [m], shape (n, 3).
        semi_axes: Semi-axes of the ellipsoid about each corner [m], shape (3,).
    """

    def __init__(self, flight: Flight, points: Array, semi_axes: Array) -> None:
        self.flight, self.points, self.semi_axes = flight, points, semi_axes
        self._gravity = float(flight.acceleration[1])
        self._is_ball = np.ptp(semi_axes) == 0.0  # or a point
        self._arms = np.linalg.norm(points, axis=1) + (0.0 if self._is_ball else semi_axes.max())
        self._reach = float(self._arms.max())
        self._size = self._reach + (float(semi_axes[0]) if self._is_ball else 0.0)

    def next_contact(self, duration: float) -> Contact | None:
        """The next time at which a corner passes through the floor downwards; None if there is none within `duration` [s].

        Corners that touch the floor at the start must ascend, or be at rest while gravity accelerates them upwards.
        """
        searched = 0
        for begin, end in self._within_reach(duration):
            count = max(1, math.ceil(min((end - begin) * self.flight.rotor.largest_spin / FIRST_ANGLE, 1e15)))
            done, chunk = 0, FIRST_CHUNK
            while done < count:
                if searched > min(MAX_INTERVALS, MAX_HEIGHTS // len(self.points)):
                    return Contact(begin + (end - begin) * (done / count), False)
                numbers = np.arange(done, min(done + chunk, count) + 1)
                edges = np.minimum(begin + (end - begin) * (numbers / count), end)
                for first, last in self._suspects(edges):
                    contact = self._step_by_step(first, last)
                    if contact is not None:
                        return contact
                done, searched, chunk = int(numbers[-1]), searched + len(numbers), min(2 * chunk, max(1, LARGEST_CHUNK // len(self.points)))
        return None

    @cached_property
    def _curvature(self) -> Array:
        """Bound c on the acceleration of each corner without that of gravity [m/s²], shape (n,)."""
        rotor = self.flight.rotor
        if rotor.is_steady:
            spin = self.flight.start[SPIN]
            moving = cross(np.broadcast_to(spin, self.points.shape), rotate(self.flight.start[ORIENTATION], self.points))
            about = 0.0 if self._is_ball else np.linalg.norm(spin) * self.semi_axes.max()
            return math.hypot(spin[0], spin[2]) * (np.linalg.norm(moving, axis=1) + about)
        return (1.0 + ANGULAR_ACCELERATION) * rotor.largest_spin**2 * self._arms

    def _within_reach(self, duration: float) -> list[tuple[float, float]]:
        """The intervals [s] in which the centre of mass is low enough for a corner to touch the floor."""
        y, speed = self.flight.start[POSITION][1] - 1.001 * self._size, self.flight.start[VELOCITY][1]  # rounding may miss the size itself
        sinks = _zeros(y + 1.002 * self._size, speed, self._gravity)  # the centre of mass is below the floor, beyond rounding
        duration = min([duration, *sinks])
        edges = [0.0, *(t for t in _zeros(y, speed, self._gravity) if t < duration), duration]
        return [(a, b) for a, b in pairwise(edges) if y + 0.5 * (a + b) * (speed + 0.25 * (a + b) * self._gravity) < 0.0]

    def _suspects(self, edges: Array) -> Iterator[tuple[float, float]]:
        """The intervals between ascending times in which a contact could not be excluded, in order; adjacent intervals are joined."""
        begins, ends = edges[:-1], edges[1:]
        for _ in range(HALVINGS if len(edges) > 2 else 0):
            clear, is_below = self._excluded(begins, ends)
            known = np.logical_or.accumulate(is_below)  # a contact comes before
            begins, ends = begins[~clear & ~known], ends[~clear & ~known]
            middles = 0.5 * (begins + ends)
            begins, ends = np.column_stack([begins, middles]).ravel(), np.column_stack([middles, ends]).ravel()
        joined = np.flatnonzero(np.concatenate([[True], begins[1:] != ends[:-1]])) if len(begins) else np.empty(0, dtype=int)
        for first, after in pairwise([*joined, len(begins)]):
            yield float(begins[first]), float(ends[after - 1])

    def _excluded(self, begins: Array, ends: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Whether no corner can touch the floor in each interval, by the bounds from both of its ends up to its middle, shape (m,).

        Also whether the body is below the floor at the beginning of the interval, deeper than at any start.
        """
        half = 0.5 * (ends - begins)
        sag = 0.5 * max(float(self._curvature.max()) - self._gravity, 0.0) * half**2
        (first, from_first), (last, from_last) = self._lowest(begins, half), self._lowest(ends, -half)
        lowest = np.minimum(np.minimum(first, last), np.minimum(from_first, from_last) - sag)
        return lowest > self._tolerance(ends), first < -2.0 * TOUCHING * self._size

    def _lowest(self, times: Array, later: Array) -> tuple[Array, Array]:
        """The lowest height at given times [s], and the lowest height `later` [s] if each corner keeps its velocity; shapes (m,)."""
        height, speed, vertical, turning = self._vertical_motion(times)
        turned = vertical + later[:, None] * turning
        now = height + (vertical @ self.points.T).min(axis=1) - self._depth(vertical)
        return now, height + later * speed + (turned @ self.points.T).min(axis=1) - self._depth(turned)

    def _step_by_step(self, begin: float, end: float) -> Contact | None:
        """The first contact in an interval [s]."""
        now = begin
        for _ in range(MAX_STEPS):
            if now > end:
                return None
            heights, speeds, tolerance = self._corners_at(now)
            slowest, rolling = self._of_surface(now)
            lands = (heights <= tolerance if now > 0.0 else self._starts_on_floor) & (speeds <= 0.0)
            if now > 0.0 and lands.any():
                return self._landing(now, lands)
            if (lands & (self._curvature + rolling > self._gravity)).any():
                return Contact(0.0, False)
            above, acceleration = np.maximum(heights - 0.5 * tolerance, 0.0), self._gravity - self._curvature
            steps = _safe_steps(above, speeds, acceleration - rolling)
            if rolling:
                steps = np.maximum(steps, _safe_steps(above, slowest, acceleration))
            step = np.where(lands, np.inf, steps).min()  # gravity pulls those that rest on the floor upwards
            now += float(max(step, 4.0 * math.ulp(now)))
        return Contact(now, False)

    def _landing(self, now: float, lands: NDArray[np.bool_]) -> Contact:
        """The contact of descending corners within rounding of the floor; it is decided when one of them certainly crosses the floor.

        A step of |v| divided by the largest upward acceleration does not pass the lowest point of any corner.
        """
        upward = (self._gravity + self._curvature)[lands]
        later = now
        for _ in range(MAX_DESCENT):
            heights, speeds, tolerance = (values[lands] for values in self._corners_at(later))
            crosses = (speeds < 0.0) & (speeds**2 > 2.0 * upward * (np.maximum(heights, 0.0) + tolerance))
            if crosses.any():
                # Newton's last step; a corner that is below the floor, beyond rounding, passed through it since `now`.
                steps = np.maximum(heights, -tolerance)[crosses] / -speeds[crosses]
                return Contact(max(later + float(steps.min()), 0.0), True)
            steps = (-speeds / upward)[speeds < 0.0]
            if not len(steps) or later + steps.min() == later:
                break
            later += float(steps.min())
        return Contact(now, False)

    @cached_property
    def _starts_on_floor(self) -> NDArray[np.bool_]:
        """Whether each corner is on the floor at the start, shape (n,)."""
        return self._corners(np.zeros(1))[0][0] <= TOUCHING * self._size

    def _corners_at(self, now: float) -> tuple[Array, Array, Array]:
        """Heights above the floor [m], upward velocities [m/s] and rounding errors of the heights [m] at a time [s], each of shape (n,)."""
        largest_spin = self.flight.rotor.largest_spin
        integrates = bool(self._starts_on_floor.any()) and now * largest_spin <= 2.0 * FIRST_ANGLE
        times = np.append(0.5 * now * (1.0 + NODES), now) if integrates else np.array([now])
        motion = self._vertical_motion(times)
        heights, speeds = self._corners_in(motion)
        rounding = np.full(len(self.points), self._tolerance(np.array([now]))[0])
        if integrates:
            risen, error = (0.5 * now * (WEIGHTS @ speeds[:-1]), 0.0) if self._is_ball else self._risen(now, motion)
            fastest = abs(self.flight.start[VELOCITY][1]) + now * abs(self._gravity) + self._reach * largest_spin
            heights[-1] = np.where(self._starts_on_floor, risen, heights[-1])
            rounding = np.where(self._starts_on_floor, SPEED_ROUNDING * fastest * now + error, rounding)
        return heights[-1], speeds[-1], rounding

    def _risen(self, now: float, motion: tuple[Array, Array, Array, Array]) -> tuple[Array, float]:
        """How far points about the corners have risen since the start [m], shape (n,), and the error of the depth [m].

        `motion` is the vertical motion at the nodes of the quadrature and, last, now.
        """
        _, speed, vertical, turning = motion
        first, last, turned = unrotate(self.flight.start[ORIENTATION], UP), vertical[-1], 0.5 * now * (WEIGHTS @ turning[:-1])
        lengths = float(np.linalg.norm(self.semi_axes * first) + np.linalg.norm(self.semi_axes * last))
        moved = self.semi_axes * turned
        deeper = float(moved @ (self.semi_axes * (first + last))) / lengths
        error = ATTITUDE_ROUNDING * float(np.linalg.norm(moved)) * self._reach / lengths
        return 0.5 * now * float(WEIGHTS @ speed[:-1]) + self.points @ turned - deeper, error

    def _corners(self, times: Array) -> tuple[Array, Array]:
        """Heights above the floor [m] and upward velocities [m/s] of the corners, shapes (m, n), at times [s], shape (m,)."""
        return self._corners_in(self._vertical_motion(times))

    def _corners_in(self, motion: tuple[Array, Array, Array, Array]) -> tuple[Array, Array]:
        """The same from the vertical motion at these times."""
        height, speed, vertical, turning = motion
        depth = self._depth(vertical)
        rolled = np.zeros(len(height)) if self._is_ball else -dot(self.semi_axes**2 * vertical, turning) / depth
        heights = height[:, None] + vertical @ self.points.T - depth[:, None]
        return heights, speed[:, None] + turning @ self.points.T + rolled[:, None]

    def _depth(self, vertical: Array) -> Array:
        """Depth of the lowest points below the corners [m] in directions in the body, shape (m, 3); at least `SHALLOWEST`."""
        if self._is_ball:
            return np.full(len(vertical), self.semi_axes[0])
        return np.maximum(length(self.semi_axes * vertical), SHALLOWEST * self._size)

    def _of_surface(self, now: float) -> tuple[Array, float]:
        """The least upward velocity of any point about each corner [m/s], shape (n,), and the bound |S n'|²/|S n| [m/s²]; of a ball 0."""
        if self._is_ball:
            return np.zeros(len(self.points)), 0.0
        _, speed, vertical, turning = self._vertical_motion(np.array([now]))
        fastest = float(length(self.semi_axes * turning)[0])
        return speed[0] + self.points @ turning[0] - fastest, fastest**2 / float(self._depth(vertical)[0])

    def _vertical_motion(self, times: Array) -> tuple[Array, Array, Array, Array]:
        """Height and speed of the centre of mass, shape (m,), and the vectors in the body whose products with an arm add to them."""
        states = self.flight(times)
        up = np.broadcast_to(UP, (len(times), 3))
        turning = unrotate(states[:, ORIENTATION], cross(up, states[:, SPIN]))  # (ω × r)·UP = (UP × ω)·r
        return states[:, 1], states[:, 8], unrotate(states[:, ORIENTATION], up), turning

    def _tolerance(self, times: Array) -> Array:
        """Rounding error of the height of a corner [m] at times [s], shape (m,)."""
        y, speed = self.flight.start[POSITION][1], self.flight.start[VELOCITY][1]
        terms = abs(y) + times * (abs(speed) + 0.5 * times * abs(self._gravity)) + self._size
        return HEIGHT_ROUNDING * terms + ATTITUDE_ROUNDING * self._reach * self.flight.rotor.largest_spin * times


def _safe_steps(heights: Array, speeds: Array, acceleration: Array) -> Array:
    """The first positive zero [s] of h + v s + a s²/2 for h >= 0, infinite where there is none; if h is 0 and v > 0, the next zero."""
    discriminant = speeds * speeds - 2.0 * acceleration * heights
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(discriminant)
        falling = 2.0 * heights / (root - speeds)
        rising = np.where(acceleration < 0.0, (speeds + root) / -acceleration, np.inf)
    steps = np.where(speeds > 0.0, rising, np.where((discriminant >= 0.0) & (root > speeds), falling, np.inf))
    return np.where(np.isnan(steps), np.inf, steps)


def _zeros(height: float, speed: float, acceleration: float) -> list[float]:
    """The positive zeros [s] of h + v s + a s²/2, ascending."""
    discriminant = speed * speed - 2.0 * acceleration * height
    if discriminant < 0.0:
        return []
    pivot = -(speed + math.copysign(math.sqrt(discriminant), speed))
    candidates = [2.0 * height / pivot] if pivot != 0.0 else []
    candidates += [pivot / acceleration] if acceleration != 0.0 else []
    return sorted(t for t in candidates if 0.0 < t < math.inf)
