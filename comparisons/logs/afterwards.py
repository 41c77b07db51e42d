"""What follows a flight: a body that is moved or thrown again, which gains energy, or a step that is longer than any impact allows."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from dropspin.comparisons.logs.flight import ACCELERATION, OFFSET, departures
from dropspin.comparisons.logs.rotors import Rotation
from dropspin.scenarios.bodies.shape import Shape
from dropspin.scenarios.rotations import angle_between_orientations, length, rotate, unrotate
from dropspin.scenarios.state import Array

SPAN, SMOOTHED = 0.2, 5
"""Length of the pieces of which energies are measured [s], and frames of the running median that leaves out wrong positions before."""
STILL, ERRORS = 0.02, 6.0
"""How far a body that rests moves in a piece, over its size, or turns [rad], at most, beside so many deviations of the noise."""
MUCH, HIGHER = 0.2, 0.1
"""Gain of energy that errors explain: a share of what the body had above its lowest position, and a height over its size."""
LEAP = 1.5
"""Speed of a step, over the largest one after any impact, from which on frames are missing in it."""


@dataclass(frozen=True, eq=False)
class Afterwards:
    """The frames from the end of a flight on. Energies are per mass [m²/s²].

    Attributes:
        rotor: The rotor of the flight.
        known: Acceleration and d, shape (6,).
        white: White noise of position [m] and orientation [rad].
        body: The body.
    """

    rotor: Rotation
    known: Array
    white: tuple[float, float]
    body: Shape

    @cached_property
    def centre(self) -> Array:
        """Positions of the centre of mass in all frames [m], shape (n, 3)."""
        toss = self.rotor.flight.toss
        return toss.position - rotate(toss.orientation, self.known[OFFSET])

    @cached_property
    def had(self) -> float:
        """The energy of the flight, with that of its spin."""
        samples = departures(self.rotor.flight, self.known)
        start, velocity = np.polynomial.polynomial.polyfit(samples.t, samples.values, 1)
        (orientation,), (spin,) = self.rotor(np.array([self.rotor.flight.duration]))
        turning = unrotate(orientation, spin)
        spinning = float(turning @ self.body.inertia_tensor @ turning) / self.body.mass
        return float(0.5 * (velocity @ velocity + spinning) + self.potential(start))

    def potential(self, position: Array) -> Array:
        """The potential energy at positions, shape (..., 3)."""
        return -(position @ self.known[ACCELERATION])


def leap(after: Afterwards) -> int | None:
    """The frame, of the first three after the flight, to which the step is longer than any impact allows: frames are missing before it."""
    flight, toss = after.rotor.flight, after.rotor.flight.toss
    frames = slice(flight.end - 1, flight.end + 3)
    t, centre, orientation = toss.t[frames], after.centre[frames], toss.orientation[frames]
    potential = after.potential(centre)
    way = np.maximum(length(np.diff(centre, axis=0)) - ERRORS * after.white[0], 0.0)
    turn = np.maximum(angle_between_orientations(orientation[:-1], orientation[1:]) - ERRORS * after.white[1], 0.0)
    least = float(np.linalg.eigvalsh(after.body.inertia_tensor)[0]) / after.body.mass
    allowed = 2.0 * np.maximum(after.had - np.minimum(potential[1:], potential[:-1]), 0.0)
    long = (way**2 + least * turn**2) / np.diff(t) ** 2 > LEAP**2 * allowed
    return flight.end + int(np.argmax(long)) if long.any() else None


def moved_again(after: Afterwards) -> int | None:
    """The frame from which on the body has more energy than a passive one that had that of its flight, or rested; None without one.

    The energy in a piece is at least that of its lowest position and of its mean velocity, also if the body strikes the floor in it. A body
    at rest has potential energy alone.
    """
    flight, toss, size = after.rotor.flight, after.rotor.flight.toss, after.body.size
    count, (white, turned) = max(SMOOTHED, round(SPAN / toss.time_step)), after.white
    if len(toss) <= flight.end + count:
        return None
    reach = SMOOTHED // 2
    path = np.median(sliding_window_view(np.pad(after.centre, ((reach, reach), (0, 0)), mode="edge"), SMOOTHED, axis=0), axis=2)
    heights = after.potential(path)
    pieces, turns, potential = (sliding_window_view(of[flight.end - 1 :], count + 1, axis=0) for of in (path, toss.orientation, heights))
    spans = toss.t[flight.end - 1 + count :] - toss.t[flight.end - 1 : -count]
    energy = potential.min(axis=1) + 0.5 * (length(pieces[..., -1] - pieces[..., 0]) / spans) ** 2
    error = float(length(after.known[ACCELERATION])) * (HIGHER * size + ERRORS * white) + 0.5 * (ERRORS * white / SPAN) ** 2
    still = np.ptp(pieces, axis=2).max(axis=1) < STILL * size + ERRORS * white
    still &= np.ptp(turns, axis=2).max(axis=1) < STILL + ERRORS * turned
    most = after.had + MUCH * (after.had - float(heights.min()))
    gains = energy > np.minimum.accumulate(np.where(still, np.minimum(potential.max(axis=1), most), most)) + error
    # Wrong positions that the median does not leave out are seldom in all pieces that begin in half of a span.
    lasting = sliding_window_view(gains, min(count // 2, len(gains))).all(axis=1)
    if not lasting.any():
        return None
    first = int(np.argmax(lasting))
    rested = np.flatnonzero(still[:first])
    return flight.end + first if not len(rested) else flight.end + int(rested[-1]) + count
