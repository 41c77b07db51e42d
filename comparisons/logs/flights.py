"""Free flights in a recording: where each begins and ends, and the state at its end.

    p(t) = x₀ + v₀ t + a t²/2 + R(t) d,    R(t) that of a free rotor

p is the tracked point, at d from the centre of mass in the body frame. Frames are of a flight as long as the next one is where the flight
predicts it, within the noise that the recording itself shows.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from dropspin.comparisons.logs.log import Log, Toss
from dropspin.comparisons.logs.noise import Noise, Regression, Samples, end_of, regression
from dropspin.scenarios.rotations import about, cross, length, multiply, rotate, rotation_vector
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY, Array
from dropspin.scenarios.truths.free_rotor import free_rotor

WINDOW = 0.05
"""Length of the pieces in which a fall is looked for [s]; at least `FEWEST_FRAMES` frames."""
FEWEST_FRAMES = 6
"""Of a flight; a parabola in three coordinates leaves half of the numbers of six frames."""
NEAR = 0.25
"""How far the acceleration of a piece of a fall may be from that of the falls, as a share."""
SURPRISING = 25.9
"""Squared distance over variance beyond which a frame is not of the flight: χ² with 3 degrees of freedom exceeds it once in 1e5."""
LONGEST = 200
"""Frames that a prediction uses, and that the regressions use of a flight, evenly chosen."""
TURN = 1e-4
"""Step of derivatives by a spin, as the angle by which it turns during the flight [rad], and by the logarithm of a moment of inertia."""
ITERATIONS = 8
"""Of the fit of a rotor with the derivatives of its first guess, each of which leaves about a tenth of the error."""


@dataclass(frozen=True, eq=False)
class Flight:
    """A part of a toss during which nothing touches the body.

    Attributes:
        toss: The toss.
        first: Its first frame.
        end: The frame after its last one.
    """

    toss: Toss
    first: int
    end: int

    def __len__(self) -> int:
        return self.end - self.first

    @cached_property
    def rows(self) -> "np.typing.NDArray[np.intp]":
        """Its frames, or `LONGEST` of them, with the first and the last one."""
        return np.unique(np.linspace(self.first, self.end - 1, min(len(self), LONGEST)).round().astype(int))

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


def positions(flight: Flight) -> Samples:
    """The tracked point as samples: own parameters x₀, v₀; shared ones the acceleration [m/s²], d [m] and the decay rate of v [1/s]."""
    t, eye = flight.t[:, np.newaxis, np.newaxis], np.eye(3)
    position, orientation = flight.toss.position[flight.rows], flight.toss.orientation[flight.rows]
    matrices = np.stack([rotate(orientation, axis) for axis in eye], axis=2)
    parabola = np.polynomial.polynomial.polyfit(flight.t, position, 2)
    slowed = -(parabola[1] * t[:, 0] ** 2 / 2.0 + parabola[2] * t[:, 0] ** 3 / 3.0)
    own = np.concatenate([np.broadcast_to(eye, (len(t), 3, 3)), t * eye], axis=2)
    shared = np.concatenate([t**2 / 2.0 * eye, matrices, slowed[..., np.newaxis]], axis=2)
    return Samples(flight.t, position, own, shared)


ACCELERATION, OFFSET, DRAG = slice(0, 3), slice(3, 6), slice(6, 7)
"""The shared parameters of `positions`."""


def without(samples: Samples, known: Array, *parts: slice) -> Samples:
    """The samples with some shared parameters known, shape (7,), and only `parts` of them to be found."""
    wanted = [index for part in parts for index in range(part.start, part.stop)]
    fixed = [index for index in range(samples.shared.shape[2]) if index not in wanted]
    values = samples.values - samples.shared[..., fixed] @ known[fixed]
    return Samples(samples.t, values, samples.own, samples.shared[..., wanted])


def falls(log: Log, acceleration: Array) -> list[Flight | None]:
    """Of each toss the first long part whose pieces all have about an acceleration [m/s²], shape (3,); None without such a part.

    Long is more than half as long as the longest one: later parts are between impacts.
    """
    found: list[Flight | None] = []
    for toss in log.tosses:
        size = window_size(toss)
        if len(toss.t) < size:
            found.append(None)
            continue
        near = length(accelerations(toss, size) - acceleration) < NEAR * length(acceleration)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], near.astype(int), [0]])))
        runs = [Flight(toss, int(first), int(end) + size - 1) for first, end in edges.reshape(-1, 2)]
        longest = max(map(len, runs), default=0)
        found.append(next((run for run in runs if 2 * len(run) > longest), None))
    return found


def window_size(toss: Toss) -> int:
    """Frames of the pieces in which a fall is looked for."""
    return max(FEWEST_FRAMES, round(WINDOW / float(np.median(np.diff(toss.t)))))


def accelerations(toss: Toss, size: int) -> Array:
    """Of the tracked point in each piece of some frames, by a parabola [m/s²], shape (pieces, 3)."""
    t = sliding_window_view(toss.t, size)
    t = t - t.mean(axis=1, keepdims=True)
    curved = t**2 - np.mean(t**2, axis=1, keepdims=True)
    curved -= t * (np.sum(t * curved, axis=1) / np.sum(t * t, axis=1))[:, np.newaxis]
    pieces = sliding_window_view(toss.position, size, axis=0)
    return 2.0 * np.einsum("wi,wki->wk", curved, pieces) / np.sum(curved**2, axis=1)[:, np.newaxis]


def grown(flights: Sequence[Flight], found: Regression) -> list[Flight]:
    """Flights from two frames less at both ends, as far as each next frame is where it is predicted."""
    return [_grown(flight, found.values, found.noise, weight) for flight, weight in zip(flights, found.weights, strict=True)]


def _grown(flight: Flight, shared: Array, noise: Noise, weight: float) -> Flight:
    own = Noise(noise.white / np.sqrt(min(weight, 1.0)), noise.slow / np.sqrt(min(weight, 1.0)))
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
    recent = Flight(flight.toss, max(flight.first, flight.end - LONGEST), flight.end)
    toss = recent.toss
    times = np.append(toss.t[recent.first : recent.end], toss.t[frame] + delay)
    rows = np.append(np.arange(recent.first, recent.end), frame)
    together = replace(toss, t=times, position=toss.position[rows], orientation=toss.orientation[rows])
    samples = without(positions(Flight(together, 0, len(rows))), shared)
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


@dataclass(frozen=True, eq=False)
class Rotation:
    """The free rotor of a flight.

    Attributes:
        flight: The flight.
        inertia: Inertia in the body frame, of any unit, shape (3, 3).
        orientation: At the middle one of the flight's rows, shape (4,).
        spin: At that time, in the world frame [rad/s], shape (3,).
    """

    flight: Flight
    inertia: Array
    orientation: Array
    spin: Array

    @property
    def middle(self) -> float:
        """Time of `orientation` and `spin` from the first frame on [s]."""
        return float(self.flight.t[len(self.flight.rows) // 2])

    def __call__(self, t: Array, faster: Array | None = None, inertia: Array | None = None) -> tuple[Array, Array]:
        """Orientations and spins at times from the first frame on [s]; `faster` is added to the spin [rad/s], shape (3,)."""
        spin = self.spin if faster is None else self.spin + faster
        return free_rotor(self.inertia if inertia is None else inertia, self.orientation, spin)(t - self.middle)

    def own_columns(self, t: Array) -> tuple[Array, Array]:
        """Derivatives of rotation vectors and spins, shape (n, 3, 6) each, by a turn of the whole motion [rad] and by the spin [rad/s]."""
        step = TURN / self.flight.duration
        spins = self(t)[1]
        turned, spun = [np.broadcast_to(axis, spins.shape) for axis in np.eye(3)], [cross(axis, spins) for axis in np.eye(3)]
        for faster in np.eye(3) * step:
            (late, fast), (early, slow) = self(t, faster), self(t, -faster)
            turned.append(rotation_vector(early, late) / (2.0 * step))
            spun.append((fast - slow) / (2.0 * step))
        return np.stack(turned, axis=2), np.stack(spun, axis=2)

    @cached_property
    def samples(self) -> Samples:
        """Rotations from the rotor to the record: shared parameters are the logarithms of I_x/I_y and I_z/I_y."""
        t = self.flight.t
        ratios = []
        for axis in (0, 2):
            turn = np.ones(3)
            turn[axis] = np.exp(0.5 * TURN)
            (late, _), (early, _) = (self(t, inertia=self.inertia * np.outer(f, f)) for f in (turn, 1.0 / turn))
            ratios.append(rotation_vector(early, late) / (2.0 * TURN))
        measured = rotation_vector(self(t)[0], self.flight.toss.orientation[self.flight.rows])
        return Samples(t, measured, self.own_columns(t)[0], np.stack(ratios, axis=2))


def _turned(vector: Array) -> Array:
    angle = float(np.linalg.norm(vector))
    return about(vector / angle if angle > 0.0 else np.zeros(3), np.asarray(angle))


def rotation(flight: Flight, inertia: Array) -> Rotation:
    """The rotor nearest to a flight: of its middle frames first, then of four times as many."""
    t, orientation = flight.t, flight.toss.orientation[flight.rows]
    middle, reach = len(t) // 2, min(2, len(t) // 2 - 1)
    vectors = rotation_vector(orientation[middle], orientation[middle - reach : middle + reach + 1])
    own = t[middle - reach : middle + reach + 1] - t[middle]
    found = Rotation(flight, inertia, orientation[middle], vectors.T @ own / float(own @ own))
    while True:
        near = slice(max(0, middle - reach), middle + reach + 1)
        columns = found.own_columns(t[near])[0].reshape(-1, 6)
        for _ in range(ITERATIONS):
            left = rotation_vector(found(t[near])[0], orientation[near]).ravel()
            step = np.asarray(np.linalg.lstsq(columns, left, rcond=None)[0], float)
            turn = _turned(step[:3])
            found = replace(found, orientation=multiply(turn, found.orientation), spin=rotate(turn, found.spin) + step[3:])
            if np.abs(step[:3]).max() + np.abs(step[3:]).max() * flight.duration < TURN:
                break
        if near.start == 0 and near.stop >= len(t):
            return found
        reach *= 4


@dataclass(frozen=True, eq=False)
class Start:
    """The state of the centre of mass at the end of a flight.

    Attributes:
        toss: The toss.
        first: The first frame of its flight.
        frame: The last one, at which the state is.
        state: Shape (13,).
        covariance: Of position [m], rotation vector in the world frame [rad], velocity and spin, shape (12, 12).
    """

    toss: Toss
    first: int
    frame: int
    state: Array
    covariance: Array

    def drawn(self, random: np.random.Generator, count: int) -> Array:
        """States from its distribution, shape (count, 13)."""
        return self.moved(random.multivariate_normal(np.zeros(12), self.covariance, count, method="eigh"))

    def moved(self, steps: Array) -> Array:
        """States that differ from its own by steps in the order of the covariance, shape (count, 12): (count, 13)."""
        states = np.tile(self.state, (len(steps), 1))
        states[:, POSITION] += steps[:, 0:3]
        states[:, ORIENTATION] = [multiply(_turned(step), self.state[ORIENTATION]) for step in steps[:, 3:6]]
        states[:, VELOCITY] += steps[:, 6:9]
        states[:, SPIN] += steps[:, 9:12]
        return states


@dataclass(frozen=True, eq=False)
class Flights:
    """All flights of a recording, with what they share.

    Attributes:
        log: The recording.
        flights: The flight of each toss, None where there is none.
        moving: Acceleration and d, with the noise of positions.
        rotations: The rotor of each flight.
        turning: Ratios of inertia, with the noise of orientations [rad].
    """

    log: Log
    flights: tuple[Flight | None, ...]
    moving: Regression
    rotations: tuple[Rotation, ...]
    turning: Regression

    @property
    def found(self) -> list[Flight]:
        """The flights without those that are None."""
        return [flight for flight in self.flights if flight is not None]

    def starts(self) -> list[Start]:
        """The state at the end of each flight, by the header's gravity and centre of mass."""
        header = self.log.header
        known = np.concatenate([[0.0, -header.gravity, 0.0], np.asarray(header.tracked_point) - header.body.centre, [0.0]])
        each = zip(self.found, self.rotations, self.moving.weights, self.turning.weights, strict=True)
        return [_start(flight, known, rotor, *self._noises(moved, turned)) for flight, rotor, moved, turned in each]

    def _noises(self, moved: float, turned: float) -> tuple[Noise, Noise]:
        of = (self.moving.noise, moved), (self.turning.noise, turned)
        position, orientation = (Noise(noise.white / np.sqrt(weight), noise.slow / np.sqrt(weight)) for noise, weight in of)
        return position, orientation


def _start(flight: Flight, known: Array, rotor: Rotation, position_noise: Noise, orientation_noise: Noise) -> Start:
    end = np.array([flight.duration])
    samples = without(positions(flight), known)
    moved, moved_covariance = end_of(samples, np.concatenate([np.zeros((3, 3)), np.eye(3)], axis=1), position_noise)
    moved[:3] += 0.5 * known[ACCELERATION] * end**2
    moved[3:] += known[ACCELERATION] * end
    turned, turned_covariance = end_of(rotor.samples, rotor.own_columns(end)[1][0], orientation_noise)
    (orientation,), (spin,) = rotor(end)
    state = np.concatenate([moved[:3], multiply(_turned(turned[:3]), orientation), moved[3:], spin + turned[3:]])
    covariance = np.zeros((12, 12))
    for part, block in ((moved_covariance, (0, 6)), (turned_covariance, (3, 9))):
        rows = np.concatenate([np.arange(start, start + 3) for start in block])
        covariance[np.ix_(rows, rows)] = part
    return Start(flight.toss, flight.first, flight.end - 1, state, covariance)


def flights_of(log: Log, acceleration: Array) -> Flights | None:
    """The flights of a recording whose free acceleration is about a given one [m/s²], shape (3,); None if no toss has one."""
    flights = falls(log, acceleration)
    for _ in range(2):
        found = [flight for flight in flights if flight is not None]
        if not found:
            return None
        moving = shared_motion(found)
        regrown = iter(grown(found, moving))
        flights = [None if flight is None else next(regrown) for flight in flights]
    found = [flight for flight in flights if flight is not None]
    rotations = tuple(rotation(flight, log.header.body.inertia_tensor) for flight in found)
    return Flights(log, tuple(flights), shared_motion(found), rotations, regression([rotor.samples for rotor in rotations]))


def shared_motion(flights: Sequence[Flight]) -> Regression:
    """Acceleration and d of flights, shape (7,) with a drag of 0."""
    known = np.zeros(7)
    found = regression([without(positions(flight), known, ACCELERATION, OFFSET) for flight in flights])
    return replace(found, values=np.append(found.values, 0.0))
