"""Free flights in a recording: where each begins and ends.

    p(t) = x₀ + v₀ t + a t²/2 + R(t) d,    R(t) that of a free rotor

p is the tracked point, at d from the centre of mass in the body frame. Frames are of a flight as long as the next one is where the flight
predicts it, within the noise that the recording itself shows.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from dropspin.comparisons.logs.log import Log, Toss
from dropspin.comparisons.logs.noise import Noise, Regression, Samples
from dropspin.scenarios.rotations import length, rotate
from dropspin.scenarios.state import Array

WINDOW = 0.05
"""Length of the pieces in which a fall is looked for [s]; at least `FEWEST_FRAMES` frames, and as many as the noise needs."""
FEWEST_FRAMES = 6
"""Of a flight; a parabola in three coordinates leaves half of the numbers of six frames."""
NEAR = 0.25
"""How far the acceleration of a piece of a fall may be from that of the falls, as a share; farther if the noise needs it."""
JOINED, FARTHER = 0.5, 2.0
"""Share of the frames of a piece, and multiple of what is far: so many pieces in succession may be so far off by noise. An impact is in
nearly as many pieces as one has frames, and a bad frame moves some farther.
"""
QUIET = 0.25
"""Share of the pieces of a toss that have no impact, at least: what parabolas leave of these is noise."""
MOST_FRAMES = 1e9
"""Of a piece: more than a recording has."""
ERRORS = 4.6
"""Standard errors by which it may be: χ with 3 degrees of freedom exceeds it once in 10,000."""
FARTHEST = 0.6
"""Share to which these may add up; pieces have as many frames as that needs. A body at rest is at 1."""
SURPRISING = 25.9
"""Squared distance over variance beyond which a frame is not of the flight: χ² with 3 degrees of freedom exceeds it once in 1e5."""
LONGEST = 200
"""Frames that a prediction uses with its own one, and that the regressions use of a flight, evenly chosen."""


@dataclass(frozen=True, eq=False)
class Flight:
    """A part of a toss during which nothing touches the body.

    Attributes:
        toss: The toss.
        first: Its first frame.
        end: The frame after its last one.
        misread: Frames of it whose orientations are wrong.
    """

    toss: Toss
    first: int
    end: int
    misread: tuple[int, ...] = ()

    def __len__(self) -> int:
        return self.end - self.first

    @cached_property
    def rows(self) -> NDArray[np.intp]:
        """Its frames without those that are misread, or `LONGEST` of them, with the first and the last one."""
        frames = np.linspace(self.first, self.end - 1, min(len(self), LONGEST)).round().astype(int)
        return np.setdiff1d(frames, np.array(self.misread, dtype=int))

    @property
    def t(self) -> Array:
        """Times of `rows` from the first frame on [s]."""
        return self.toss.t[self.rows] - self.toss.t[self.first]

    @property
    def duration(self) -> float:
        """[s]."""
        return float(self.t[-1])

    def backwards(self) -> "Flight":
        """The same frames in reverse."""
        toss = self.toss
        turned = replace(toss, t=toss.t[-1] - toss.t[::-1], position=toss.position[::-1], orientation=toss.orientation[::-1])
        return Flight(turned, len(toss.t) - self.end, len(toss.t) - self.first)


def positions(flight: Flight, *, with_drag: bool = False) -> Samples:
    """The tracked point as samples: own parameters x₀, v₀; shared ones the acceleration [m/s²], d [m], and the decay rate of v [1/s]."""
    t, eye = flight.t[:, np.newaxis, np.newaxis], np.eye(3)
    position, orientation = flight.toss.position[flight.rows], flight.toss.orientation[flight.rows]
    shared = [t**2 / 2.0 * eye, np.stack([rotate(orientation, axis) for axis in eye], axis=2)]
    if with_drag:
        parabola = np.polynomial.polynomial.polyfit(flight.t, position, 2)
        slowed = -(parabola[1] * t[:, 0] ** 2 / 2.0 + parabola[2] * t[:, 0] ** 3 / 3.0)
        shared.append(slowed[..., np.newaxis])
    return Samples(flight.t, position, _lines(t), np.concatenate(shared, axis=2))


ACCELERATION, OFFSET = slice(0, 3), slice(3, 6)
"""The shared parameters of `positions`."""


def departures(flight: Flight, known: Array) -> Samples:
    """What the tracked point departs by from the motion of known shared parameters, shape (6,): samples of x₀ and v₀ alone."""
    t, rows = flight.t[:, np.newaxis, np.newaxis], flight.rows
    motion = t[:, 0] ** 2 / 2.0 * known[ACCELERATION] + rotate(flight.toss.orientation[rows], known[OFFSET])
    return Samples(flight.t, flight.toss.position[rows] - motion, _lines(t), np.empty((len(t), 3, 0)))


def _lines(t: Array) -> Array:
    """Derivatives by x₀ and v₀, shape (n, 3, 6), at times of shape (n, 1, 1)."""
    return np.concatenate([np.broadcast_to(np.eye(3), (len(t), 3, 3)), t * np.eye(3)], axis=2)


def falls(log: Log, acceleration: Array) -> list[Flight]:
    """Of each toss the first long part, if any, whose pieces all have about an acceleration [m/s²], shape (3,).

    Long is more than half as long as the longest one: later parts are between impacts.
    """
    noise, offset = noise_of(log), log.header.tracked_from_centre
    pieces, parts = partial(accelerations, offset=offset), []
    for toss in log.tosses:
        left = _left(toss, offset)
        noisier = math.sqrt(float(np.quantile(left, QUIET))) if len(left) else 0.0
        parts.append(falling_parts(toss, max(noise, noisier), acceleration, pieces))
    return [next(part for part in of_toss if 2 * len(part) > max(map(len, of_toss))) for of_toss in parts if of_toss]


def falling_parts(toss: Toss, noise: float, acceleration: Array, pieces: Callable[[Toss, int], Array]) -> list[Flight]:
    """The parts of a toss whose pieces, but for a few in succession, have about an acceleration [m/s²], shape (3,).

    `noise` is that of positions [m]; `pieces` gives the accelerations of all pieces of a toss that have some frames, shape (pieces, 3).
    """
    size = window_size(toss, noise, acceleration)
    farthest = max(NEAR * float(length(acceleration)), ERRORS * standard_error(toss, size, noise))
    off = length(pieces(toss, size) - acceleration)
    edges = np.flatnonzero(np.diff(np.pad(off < farthest, 1)))
    gaps = edges[1:-1].reshape(-1, 2)
    is_impact = [end - first > JOINED * size or off[first:end].max() > FARTHER * farthest for first, end in gaps]
    apart = np.concatenate([edges[:1], gaps[np.array(is_impact, dtype=bool)].ravel(), edges[-1:]]).reshape(-1, 2)
    return [Flight(toss, int(first), int(end) + size - 1) for first, end in apart]


def standard_error(toss: Toss, size: int, noise: float) -> float:
    """Of the acceleration of a parabola through so many frames with a noise of positions [m], about, in m/s²."""
    return noise * math.sqrt(720.0 / size**5) / toss.time_step**2


def window_size(toss: Toss, noise: float = 0.0, acceleration: Array | None = None) -> int:
    """Frames of the pieces in which a fall of an acceleration [m/s²], shape (3,), is looked for with a noise of positions [m]."""
    fewest = max(FEWEST_FRAMES, round(WINDOW / toss.time_step))
    if acceleration is None:
        return fewest
    allowed = FARTHEST * float(np.linalg.norm(acceleration))
    ratio = ERRORS * standard_error(toss, 1, noise) / allowed if allowed > 0.0 else math.inf
    return max(fewest, math.ceil(min(ratio**0.4, MOST_FRAMES)))


def noise_of(log: Log) -> float:
    """The noise of positions [m]: what parabolas leave of the pieces, in the median."""
    left = np.concatenate([_left(toss, log.header.tracked_from_centre) for toss in log.tosses])
    return math.sqrt(float(np.median(left))) if len(left) else 0.0


def _left(toss: Toss, offset: Array) -> Array:
    """The mean square that parabolas leave of each piece of a toss [m²]; `offset` is d [m]."""
    t, pieces, curved = _pieces(toss, size := window_size(toss), offset, size)
    for column in (np.ones_like(t), t, curved):
        share = np.einsum("wi,wki->wk", column, pieces) / np.sum(column**2, axis=1)[:, np.newaxis]
        pieces = pieces - share[..., np.newaxis] * column[:, np.newaxis]
    return np.asarray(np.sum(pieces**2, axis=(1, 2)) / (3 * (size - 3)))


def accelerations(toss: Toss, size: int, offset: Array) -> Array:
    """Of the centre of mass in each piece of some frames, by a parabola [m/s²], shape (pieces, 3); `offset` is d [m], shape (3,)."""
    _, pieces, curved = _pieces(toss, size, offset)
    return 2.0 * np.einsum("wi,wki->wk", curved, pieces) / np.sum(curved**2, axis=1)[:, np.newaxis]


def _pieces(toss: Toss, size: int, offset: Array, step: int = 1) -> tuple[Array, Array, Array]:
    """Of every step-th piece of some frames the times from its middle, the centres of mass, and squares of times less their line."""
    if len(toss) < size:
        return np.empty((0, size)), np.empty((0, 3, size)), np.empty((0, size))
    t = sliding_window_view(toss.t, size)[::step]
    t = t - t.mean(axis=1, keepdims=True)
    curved = t**2 - np.mean(t**2, axis=1, keepdims=True)
    curved -= t * (np.sum(t * curved, axis=1) / np.sum(t * t, axis=1))[:, np.newaxis]
    centre = toss.position - rotate(toss.orientation, offset) if offset.any() else toss.position
    return t, sliding_window_view(centre, size, axis=0)[::step], curved


def grown(flight: Flight, found: Regression, weight: float) -> Flight:
    """A flight from two frames less at both ends, as far as each next frame is where it is predicted."""
    shared, own = found.values, found.noise.of_weight(min(weight, 1.0))
    less = min(2, (len(flight) - FEWEST_FRAMES) // 2)
    if less > 0:
        flight = replace(flight, first=flight.first + less, end=flight.end - less)
    end = _end(flight, shared, own)
    first = len(flight.toss.t) - _end(flight.backwards(), shared, own)
    # What touches the body begins softly, and before the frame that it moves visibly.
    return replace(flight, first=first + (first > 0), end=end - (end < len(flight.toss.t)))


def _end(flight: Flight, shared: Array, noise: Noise) -> int:
    """The frame from which on the positions are not those of the flight."""
    while flight.end < len(flight.toss.t) and surprise(flight, flight.end, shared, noise) < SURPRISING:
        flight = replace(flight, end=flight.end + 1)
    return flight.end


def surprise(flight: Flight, frame: int, shared: Array, noise: Noise, delay: float = 0.0) -> float:
    """Squared distance of a later frame from its prediction, over the variance; `delay` is added to its time [s]."""
    recent = Flight(flight.toss, max(flight.first, flight.end + 1 - LONGEST), flight.end)  # with the later frame, at most LONGEST rows
    toss = recent.toss
    times = np.append(toss.t[recent.first : recent.end], toss.t[frame] + delay)
    rows = np.append(np.arange(recent.first, recent.end), frame)
    together = replace(toss, t=times, position=toss.position[rows], orientation=toss.orientation[rows])
    samples = departures(Flight(together, 0, len(rows)), shared)
    covariance = noise.covariance(samples.t)
    line = np.stack([np.ones(len(rows)), samples.t], axis=1)
    before = np.linalg.solve(covariance[:-1, :-1], np.column_stack([line[:-1], samples.values[:-1], covariance[:-1, -1]]))
    normal = np.linalg.inv(line[:-1].T @ before[:, :2])
    beta = normal @ (line[:-1].T @ before[:, 2:5])
    gain = before[:, 5]
    left = line[-1] - gain @ line[:-1]
    predicted = left @ beta + gain @ samples.values[:-1]
    variance = float(covariance[-1, -1] - gain @ covariance[:-1, -1] + left @ normal @ left)
    return float(np.sum((samples.values[-1] - predicted) ** 2)) / variance
