"""The free rotor that is nearest to the orientations of a flight."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from dropspin.comparisons.logs.flight import Flight
from dropspin.comparisons.logs.noise import Samples
from dropspin.scenarios.rotations import about, cross, length, multiply, rotate, rotation_vector
from dropspin.scenarios.state import Array
from dropspin.scenarios.truths.free_rotor import free_rotor

TURN = 1e-4
"""Step of derivatives by a spin, as the angle by which it turns during the flight [rad], and by the logarithm of a moment of inertia."""
ITERATIONS = 8
"""Of the fit of a rotor with the derivatives of its first guess, each of which leaves about a tenth of the error."""
NEAREST, FEWEST_ROWS = 8, 7
"""Frames beside another one with which its orientation is compared, and frames of a flight that are not left out."""
MISREAD, SPIKE = 0.05, 5.0
"""Difference of a wrong orientation from those beside it [rad], and its multiple of the median difference, at least."""


@dataclass(frozen=True, eq=False)
class Rotation:
    """The free rotor of a flight.

    Attributes:
        flight: The flight.
        inertia: Inertia in the body frame, of any unit, shape (3, 3).
        orientation: At the middle one of the flight's rows, shape (4,).
        spin: At that time, in the world frame [rad/s], shape (3,).
        decay: Rate at which the angular momentum decays [1/s].
    """

    flight: Flight
    inertia: Array
    orientation: Array
    spin: Array
    decay: float = 0.0

    @property
    def middle(self) -> float:
        """Time of `orientation` and `spin` from the first frame on [s]."""
        return float(self.flight.t[len(self.flight.rows) // 2])

    def __call__(self, t: Array, faster: Array | None = None, inertia: Array | None = None) -> tuple[Array, Array]:
        """Orientations and spins at times from the first frame on [s]; `faster` is added to the spin [rad/s], shape (3,)."""
        spin = self.spin if faster is None else self.spin + faster
        free = free_rotor(self.inertia if inertia is None else inertia, self.orientation, spin)
        if self.decay == 0.0:
            return free(t - self.middle)
        # Euler's equations are of second degree in the spin, so that one that decays by exp(-kt) is a free one at the time ∫ exp(-kt) dt.
        lost = -np.expm1(-self.decay * (t - self.middle))
        orientations, spins = free(lost / self.decay)
        return orientations, spins * (1.0 - lost)[:, np.newaxis]

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

    @cached_property
    def samples_with_decay(self) -> Samples:
        """The same with a third shared parameter, the decay [1/s]."""
        t, step = self.flight.t, TURN / self.flight.duration
        (late, _), (early, _) = (replace(self, decay=self.decay + change)(t) for change in (step, -step))
        decayed = rotation_vector(early, late) / (2.0 * step)
        return replace(self.samples, shared=np.concatenate([self.samples.shared, decayed[..., np.newaxis]], axis=2))


def misread(rotor: Rotation) -> tuple[int, ...]:
    """The frames of a flight whose orientations are off the smooth difference of the others from its rotor."""
    samples, kept = rotor.samples, np.ones(len(rotor.flight.rows), dtype=bool)
    while kept.sum() > FEWEST_ROWS:
        rows = np.flatnonzero(kept)
        left, errors = _from_others(samples.t[rows], samples.values[rows])
        worst = int(np.argmax(left / errors))
        if left[worst] < MISREAD or left[worst] / errors[worst] < SPIKE * float(np.median(left / errors)):
            break
        kept[rows[worst]] = False
    return tuple(rotor.flight.rows[~kept].tolist())


def _from_others(t: Array, values: Array) -> tuple[Array, Array]:
    """How far each vector is from the parabola through those beside it, and its standard error over that of a vector, shape (n,) each."""
    count, width = len(t), min(NEAREST + 1, len(t))
    near = np.clip(np.arange(count) - width // 2, 0, count - width)[:, np.newaxis] + np.arange(width)
    is_other = near != np.arange(count)[:, np.newaxis]
    times = (t[near] - t[:, np.newaxis]) * (count / t[-1])
    weights = np.linalg.pinv(np.stack([is_other, times * is_other, times**2 * is_other], axis=2))[:, 0]
    left = length(values - np.einsum("nw,nwk->nk", weights, values[near]))
    return left, np.sqrt(1.0 + np.sum(weights**2, axis=1))


def turn_by(vector: Array) -> Array:
    """The rotation by a rotation vector [rad], shape (3,), as a quaternion."""
    angle = float(np.linalg.norm(vector))
    return about(vector / (angle or 1.0), np.asarray(angle))


def rotation(flight: Flight, inertia: Array, decay: float = 0.0) -> Rotation:
    """The rotor nearest to a flight, with a decay [1/s]: of its middle frames first, then of four times as many."""
    t, orientation = flight.t, flight.toss.orientation[flight.rows]
    middle, reach = len(t) // 2, min(2, len(t) // 2 - 1)
    vectors = rotation_vector(orientation[middle], orientation[middle - reach : middle + reach + 1])
    own = t[middle - reach : middle + reach + 1] - t[middle]
    found = Rotation(flight, inertia, orientation[middle], vectors.T @ own / float(own @ own), decay)
    while True:
        near = slice(max(0, middle - reach), middle + reach + 1)
        columns = found.own_columns(t[near])[0].reshape(-1, 6)
        for _ in range(ITERATIONS):
            left = rotation_vector(found(t[near])[0], orientation[near]).ravel()
            step = np.asarray(np.linalg.lstsq(columns, left, rcond=None)[0], float)
            turn = turn_by(step[:3])
            found = replace(found, orientation=multiply(turn, found.orientation), spin=rotate(turn, found.spin) + step[3:])
            if np.abs(step[:3]).max() + np.abs(step[3:]).max() * flight.duration < TURN:
                break
        if near.start == 0 and near.stop >= len(t):
            return found
        reach *= 4
