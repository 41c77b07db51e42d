"""All flights of a recording: what they share, and the state at the end of each."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.logs.afterwards import Afterwards, moved_again
from dropspin.comparisons.logs.flight import ACCELERATION, OFFSET, Flight, departures, falls, grown, positions
from dropspin.comparisons.logs.header import Header
from dropspin.comparisons.logs.log import Log, Toss
from dropspin.comparisons.logs.noise import Noise, Regression, end_of, regression
from dropspin.comparisons.logs.rotors import Rotation, misread, rotation, turn_by
from dropspin.comparisons.running.arguments import ignore
from dropspin.scenarios.bodies.surface import clearances
from dropspin.scenarios.rotations import multiply, rotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY, Array

HIGH = 0.01
"""Of the size of the body: how far it gets above the floor in a flight, at least."""
NEAR_FLOOR = 0.1
"""Height of the lowest point, over the size of the body, below which a frame may be one of a contact, which may be between two frames."""
HIDDEN = 0.1
"""Component, along an axis, of a direction that flights do not show, from which on they do not show that axis."""

SURELY, ROUNDS, LARGEST_STEP = 1e-3, 5, 0.7
"""Probability with which ratios of inertia differ as much by noise, rounds of a fit of others, and largest logarithm of a step."""


@dataclass(frozen=True, eq=False)
class Start:
    """The state of the centre of mass at the end of a flight.

    Attributes:
        toss: The toss, up to where the body is moved again.
        first: The first frame of its flight.
        frame: The last one, at which the state is.
        state: Shape (13,).
        covariance: Of position [m], rotation vector in the world frame [rad], velocity and spin, shape (12, 12).
        white: Standard deviations of the white noise of a frame of the toss: of position [m] and rotation vector [rad], shape (6,).
    """

    toss: Toss
    first: int
    frame: int
    state: Array
    covariance: Array
    white: Array

    @cached_property
    def deviations(self) -> Array:
        """Independent steps of one standard deviation each, shape (12, 12): rows whose outer products add up to the covariance.

        By Cholesky, which rounding does not change: the eigenvectors of equal eigenvalues, as of white noise, are arbitrary.
        """
        return np.asarray(np.linalg.cholesky(self.covariance).T, dtype=float)

    def drawn(self, random: np.random.Generator, count: int) -> Array:
        """States from its distribution, shape (count, 13)."""
        return self.moved(random.standard_normal((count, 12)) @ self.deviations)

    def moved(self, steps: Array) -> Array:
        """States that differ from its own by steps in the order of the covariance, shape (count, 12): (count, 13)."""
        states = np.tile(self.state, (len(steps), 1))
        states[:, POSITION] += steps[:, 0:3]
        states[:, ORIENTATION] = [multiply(turn_by(step), self.state[ORIENTATION]) for step in steps[:, 3:6]]
        states[:, VELOCITY] += steps[:, 6:9]
        states[:, SPIN] += steps[:, 9:12]
        return states


@dataclass(frozen=True, eq=False)
class Flights:
    """All flights of a recording, with what they share.

    Attributes:
        log: The recording.
        moving: Acceleration and d, with the noise of positions.
        rotations: The rotor of each flight; some tosses may have no flight.
        turning: Ratios of inertia, with the noise of orientations [rad].
    """

    log: Log
    moving: Regression
    rotations: tuple[Rotation, ...]
    turning: Regression

    @property
    def found(self) -> list[Flight]:
        """The flights, at most one of each toss."""
        return [rotor.flight for rotor in self.rotations]

    @cached_property
    def show_offset(self) -> NDArray[np.bool_]:
        """Whether they show d along each axis, shape (3,): not if most of the information is the noise of orientations, as without spin."""
        whole, noise = self.moving.information.sum(axis=0), self.moving.noise
        along = whole[OFFSET, ACCELERATION]
        own = whole[OFFSET, OFFSET] - along @ np.linalg.solve(whole[ACCELERATION, ACCELERATION], along.T)
        values = sum(weight * rotor.samples.freedom for weight, rotor in zip(self.moving.weights, self.rotations, strict=True))
        # White noise of a rotation vector moves each coordinate of a body axis by 2/3 of its variance, in the mean over orientations.
        by_noise = 2.0 / 3.0 * (self.turning.noise.white / noise.white) ** 2 * values
        sizes, axes = np.linalg.eigh(own)
        return np.linalg.norm(axes[:, sizes < 2.0 * by_noise], axis=1) < HIDDEN

    @cached_property
    def spinning(self) -> Regression:
        """Ratios of inertia, and the rate at which the spin decays [1/s]."""
        return _turning(self.rotations, ignore, with_decay=True)

    @cached_property
    def afterwards(self) -> list[Afterwards]:
        """What follows each flight; its centre of mass is the header's along axes that flights do not show."""
        values, white = self.moving.values.copy(), (self.moving.noise.white, self.turning.noise.white)
        values[OFFSET] = np.where(self.show_offset, values[OFFSET], self.log.header.tracked_from_centre)
        return [Afterwards(rotor, values, white, self.log.header.body) for rotor in self.rotations]

    @cached_property
    def moved_again(self) -> list[int | None]:
        """From which frame on the body is moved or thrown again after each flight, if it is."""
        return list(map(moved_again, self.afterwards))

    def starts(self) -> list[Start]:
        """The state at the end of each flight, by the header's gravity and centre of mass; tosses end where the body is moved again."""
        header = self.log.header
        known = np.concatenate([header.acceleration, header.tracked_from_centre])
        each = zip(self.rotations, self.moving.weights, self.turning.weights, strict=True)
        position, orientation = self.moving.noise, self.turning.noise
        starts = [_start(rotor, known, position.of_weight(moved), orientation.of_weight(turned)) for rotor, moved, turned in each]
        return [replace(start, toss=start.toss.until(end)) for start, end in zip(starts, self.moved_again, strict=True)]


def _start(rotor: Rotation, known: Array, position_noise: Noise, orientation_noise: Noise) -> Start:
    flight, end = rotor.flight, np.array([rotor.flight.duration])
    samples = departures(flight, known)
    moved, moved_covariance = end_of(samples, np.concatenate([np.zeros((3, 3)), np.eye(3)], axis=1), position_noise)
    moved[:3] += 0.5 * known[ACCELERATION] * end**2
    moved[3:] += known[ACCELERATION] * end
    turned, turned_covariance = end_of(rotor.samples, rotor.own_columns(end)[1][0], orientation_noise)
    (orientation,), (spin,) = rotor(end)
    state = np.concatenate([moved[:3], multiply(turn_by(turned[:3]), orientation), moved[3:], spin + turned[3:]])
    covariance = np.zeros((12, 12))
    for part, block in ((moved_covariance, (0, 6)), (turned_covariance, (3, 9))):
        rows = np.concatenate([np.arange(start, start + 3) for start in block])
        covariance[np.ix_(rows, rows)] = part
    white = np.repeat([position_noise.white, orientation_noise.white], 3)
    return Start(flight.toss, flight.first, int(flight.rows[-1]), state, covariance, white)


def flights_of(log: Log, acceleration: Array, report: Callable[[str, float], None] = ignore) -> Flights | None:
    """The flights of a recording whose free acceleration is about a given one [m/s²], shape (3,); None if no toss has one.

    `report` is called with a description of the work and the fraction of it that is done.
    """
    flights = _above_floor(log.header, falls(log, acceleration))
    if not flights:
        return None
    for _ in range(2):
        moving = regression(list(map(positions, flights)))
        flights = [grown(flight, moving, weight) for flight, weight in zip(flights, moving.weights, strict=True)]
    rotations = tuple(map(_sound, _rotors(flights, log.header.body.inertia_tensor, report)))
    moving = regression([positions(rotor.flight) for rotor in rotations])
    return Flights(log, moving, rotations, _turning(rotations, report))


def _rotors(
    flights: Sequence[Flight], inertia: Array, report: Callable[[str, float], None], done: float = 0.0, decay: float = 0.0
) -> Iterator[Rotation]:
    """The rotor of each flight; the first ones take half of the work that is not done, because further ones may follow."""
    for number, flight in enumerate(flights, 1):
        yield rotation(flight, inertia, decay)
        report(f"rotation of {number} of {len(flights)} flights", done + 0.5 * (1.0 - done) * number / len(flights))


def _sound(rotor: Rotation) -> Rotation:
    """The rotor of a flight without its wrong orientations."""
    wrong = misread(rotor)
    return rotation(replace(rotor.flight, misread=wrong), rotor.inertia) if wrong else rotor


def _turning(rotations: Sequence[Rotation], report: Callable[[str, float], None], *, with_decay: bool = False) -> Regression:
    """Ratios of inertia, by derivatives at those that the flights show, if these are not those of the rotors; and a decay of the spin."""

    def fitted(rotors: Iterable[Rotation]) -> Regression:
        return regression([rotor.samples_with_decay if with_decay else rotor.samples for rotor in rotors])

    largest = np.array([LARGEST_STEP, LARGEST_STEP, LARGEST_STEP / max(rotor.flight.duration for rotor in rotations)])[: 2 + with_decay]
    turning, moved = fitted(rotations), np.zeros(3)
    for number in range(1, ROUNDS + 1):
        is_off = np.abs(turning.values) > turning.half_widths(SURELY)
        moved[: 2 + with_decay] += np.where(is_off, np.clip(turning.values, -largest, largest), 0.0)
        if not is_off.any():
            break
        stretched = np.exp(0.5 * np.array([moved[0], 0.0, moved[1]]))
        inertia = rotations[0].inertia * np.outer(stretched, stretched)
        turning = fitted(_rotors([rotor.flight for rotor in rotations], inertia, report, 1.0 - 0.5**number, moved[2]))
    return replace(turning, values=turning.values + moved[: 2 + with_decay])


def _above_floor(header: Header, flights: list[Flight]) -> list[Flight]:
    """The flights without those of bodies that stay on the floor or below it; all, if these are half: the floor is elsewhere then."""
    if header.floor is None:
        return flights
    high = [flight for flight in flights if heights_in(header, flight).max() > HIGH * header.body.size]
    return high if 2 * len(high) > len(flights) else flights


def heights_in(header: Header, flight: Flight) -> Array:
    """Heights of the body's lowest point above the floor in the frames of a flight [m], shape (n,)."""
    frames = slice(flight.first, flight.end)
    return heights(header, flight.toss.position[frames], flight.toss.orientation[frames])


def heights(header: Header, position: Array, orientation: Array) -> Array:
    """Heights of the body's lowest point above the floor [m], shape (n,), from poses of the tracked point, shapes (n, 3) and (n, 4)."""
    poses = np.hstack([position - rotate(orientation, header.tracked_from_centre), orientation])
    return clearances(poses, header.body.vertices, header.body.semi_axes)
