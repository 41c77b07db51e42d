"""Whether a motion that was recorded elsewhere is one of a scene: from its start, in its frame, units and times. A mismatch is named.

An engine may be wrong by any amount. So a motion is refused only if its times or its start cannot be the scene's, or if a known fault of
conventions, such as another order of the quaternion, explains almost all of its difference from the exact solution in the first flight.
"""

from collections.abc import Iterator
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.faults.conventions import CONVENTIONS
from dropspin.comparisons.faults.fault_model import unchanged
from dropspin.scenarios import DropspinError, Scenario, Trajectory, Truth
from dropspin.scenarios.rotations import angle_between_orientations, length, rotation_vector
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY, Array
from dropspin.scenarios.text import counted

UNEVEN = 0.01
"""Largest difference between two time steps, as a share of the mean; times in text files are rounded."""
GAP = 1.5
"""Usual steps of time from which a step has a missing state: the nearest whole number of steps is then above 1."""
GROSS = 0.1
"""Difference, of angles [rad] and relative to sizes and speeds, that a fault of conventions exceeds."""
EXPLAINED = 0.1
"""Largest share of a difference that is left where a fault explains it."""
AT_START = 1e-3
"""Largest difference of the first state from the start; a velocity may also be a time step early or late."""
PROPORTIONAL = 0.02
"""Largest share of the movements, in the median, by which they differ from velocities that they are proportional to."""
STAYS = 1e-6
"""A body that moves by at most this share of its size stays, up to rounding: its positions do not determine its velocities."""
UNITS_OF_TIME = {1e3: "ms", 1e6: "µs", 1e9: "ns", 1.0 / 60.0: "minutes"}
LONGEST = 2000  # rows that are compared


@np.errstate(all="ignore")  # of an engine that blows up, squares are infinite
def verify_motion(scene: Scenario, truth: Truth | None, motion: Trajectory) -> None:
    """Raise `DropspinError` if a motion is not one of a scene; the message says what was recognised, and what to do."""
    states = _of_states(scene, truth, motion)
    for problem in chain(_of_shapes(motion), _of_times(motion), _of_numbers(motion), _of_rates(scene, motion), states, _of_ratios(motion)):
        raise DropspinError(f"motion: {problem}.")


def _of_shapes(motion: Trajectory) -> Iterator[str]:
    """Of fields that are no arrays of one row for each time."""
    count = np.size(motion.t)
    for name, row in {"t": (), "position": (3,), "orientation": (4,), "velocity": (3,), "angular_velocity": (3,)}.items():
        found = getattr(motion, name)
        if not isinstance(found, np.ndarray) or found.shape != (count, *row):
            yield f"{name} is {type(found).__name__} of shape {np.shape(found)}; give an array of shape {(count, *row)}"


def problems_of_order(t: Array) -> Iterator[str]:
    """What is wrong with the number and the order of the times [s] of a motion, shape (n,)."""
    if len(t) < 2:
        yield f"got {counted(len(t), 'state')}; give at least two"
        return
    steps = np.diff(t)
    if not (steps > 0.0).all():
        row = int(np.argmin(steps > 0.0))
        remedy = "leave out one of the two states, or give more digits" if steps[row] == 0.0 else "give the states in the order of time"
        yield f"the times do not increase: {t[row + 1]:.6g} s is after {t[row]:.6g} s; {remedy}"


def is_uneven(steps: Array) -> bool:
    """Whether steps of time [s], shape (n,), differ by more than the rounding of a text explains."""
    return bool(len(steps)) and float(np.ptp(steps)) > UNEVEN * float(steps.mean())


def missing_frames(steps: Array) -> NDArray[np.int64]:
    """How many frames are missing within each step of time [s], shape (n,): steps that are longer than the usual one."""
    shares = steps / np.median(steps)
    return np.where(shares > GAP, np.rint(shares).astype(int) - 1, 0)


def _of_times(motion: Trajectory) -> Iterator[str]:
    yield from problems_of_order(motion.t)
    steps = np.diff(motion.t)
    missing = missing_frames(steps)
    if missing.any() and not is_uneven(steps[missing == 0]):
        states = counted(int(missing.sum()), "state is", "states are")
        yield f"{states} missing between equal steps, the first after {motion.t[np.argmax(missing > 0)]:.4g} s; give all of them"
    if is_uneven(steps):
        yield (
            f"the times are not equally spaced: steps are {steps.min():.4g} to {steps.max():.4g} s long; interpolate the states at equal "
            "steps, or give times without rounding"
        )
    elif abs(motion.t[0]) > UNEVEN * steps.mean():
        yield f"the times begin at {motion.t[0]:.4g} s; give the motion from the scene's start on, at time 0"


def _of_numbers(motion: Trajectory) -> Iterator[str]:
    """Of states that are no numbers, or whose quaternions are no rotations."""
    lengths = length(motion.orientation)
    if (bad := motion.first_bad_row) is not None:
        yield f"the state at {motion.t[bad]:.4g} s is not finite; give the motion up to there, and a scene that is as long"
    elif (off := np.abs(lengths - 1.0) > AT_START).any():
        row = int(np.argmax(off))
        yield f"the quaternion at {motion.t[row]:.4g} s has length {lengths[row]:.4g}; give unit quaternions"


def _of_rates(scene: Scenario, motion: Trajectory) -> Iterator[str]:
    """Of velocities that are 0, or whose times have another unit, by the change of the positions, of a body that stays by its rotation."""
    by, (_, expected, ratio) = "the velocities and the change of the position", _movements(motion)
    if np.ptp(motion.position, axis=0).max() <= STAYS * scene.body.size:
        turned = rotation_vector(motion.orientation[:-1], motion.orientation[1:])
        by, ratio = "the angular velocities and the rotation", _ratio(turned, _expected(motion.t, motion.angular_velocity))
    elif not expected.any():
        yield "velocities are 0 while the position changes; give the velocity of the centre of mass [m/s]"
    for factor, unit in UNITS_OF_TIME.items():
        if abs(ratio * factor - 1.0) < GROSS:
            yield f"the times appear to be in {unit}, by {by}; give them in s"


def _of_ratios(motion: Trajectory) -> Iterator[str]:
    """Of velocities that are proportional to the change of the positions, but not equal to it."""
    moved, expected, ratio = _movements(motion)
    left = float(np.median(length(moved - ratio * expected)))  # impacts within a step apart
    if ratio > 0.0 and abs(ratio - 1.0) > GROSS and left < PROPORTIONAL * float(np.median(length(moved))):
        yield f"velocities are {1.0 / ratio:.3g} times the change of the position in a second; give both in metres and seconds"


def _movements(motion: Trajectory) -> tuple[Array, Array, float]:
    """The change of the position in each step, that by the velocities [m], shape (n - 1, 3), and the ratio of the two; NaN without any."""
    moved, expected = np.diff(motion.position, axis=0), _expected(motion.t, motion.velocity)
    return moved, expected, _ratio(moved, expected)


def _expected(t: Array, rates: Array) -> Array:
    """The movement in each step, shape (n - 1, 3), by the rates at its ends, shape (n, 3)."""
    return 0.5 * np.diff(t)[:, None] * (rates[1:] + rates[:-1])


def _ratio(moved: Array, expected: Array) -> float:
    return float(np.sum(moved * expected) / np.sum(expected**2))


def _of_states(scene: Scenario, truth: Truth | None, motion: Trajectory) -> Iterator[str]:
    """Of states in another convention or from another start."""
    first = truth.events[0].time if truth is not None and truth.events else np.inf
    known = np.array([0.0]) if truth is None else motion.t[(motion.t < first) & truth.covers(motion.t)][:LONGEST]
    exact = scene.initial_state[None] if truth is None or not len(known) else truth(known).states
    found = motion.states[: len(exact)]
    speed = _speed(scene, exact) or 1.0
    dt, lag = float(motion.t[1] - motion.t[0]), abs(motion.velocity_lag)
    plain = _difference(scene, found, exact, speed)
    if plain > GROSS:
        read = [fault for fault in CONVENTIONS if fault.simulated is unchanged]
        left = [_difference(scene, found, fault.reported(exact), speed) for fault in read]
        if min(left) <= EXPLAINED * plain:
            yield f"{read[int(np.argmin(left))].message}; convert the states"
            return
    early = (dt + lag) * max(float(np.linalg.norm(scene.acceleration)), float(np.linalg.norm(scene.start.angular_velocity)) ** 2)
    off = _difference(scene, found[:1], scene.initial_state[None], speed)
    if off > AT_START + early / speed:
        own, other = (
            f"{_listed(state[POSITION])} m with velocity {_listed(state[VELOCITY])} m/s and angular velocity {_listed(state[SPIN])} rad/s"
            for state in (found[0], scene.initial_state)
        )
        [turned] = angle_between_orientations(found[:1, ORIENTATION], scene.initial_state[None, ORIENTATION])
        begins = f"it begins at {own}, the scene at {other}, turned by {turned:.3g} rad"
        yield f"{begins}; give the motion of this scene, or a scene with this start"


def _speed(scene: Scenario, exact: Array) -> float:
    size, g = scene.body.size, float(np.linalg.norm(scene.acceleration))
    speed, spin = (float(np.linalg.norm(exact[:, part], axis=1).max()) for part in (VELOCITY, SPIN))
    return max(speed, size * spin, float(np.sqrt(g * size)))


def _difference(scene: Scenario, found: Array, exact: Array, speed: float) -> float:
    """The largest difference of states, of angles [rad], and relative to the body's size and a speed [m/s]."""
    scales = ((POSITION, scene.body.size), (VELOCITY, speed), (SPIN, speed / scene.body.size))
    lengths = [float(np.linalg.norm(found[:, part] - exact[:, part], axis=1).max()) / scale for part, scale in scales]
    return max(*lengths, float(angle_between_orientations(found[:, ORIENTATION], exact[:, ORIENTATION]).max()))


def _listed(values: Array) -> str:
    return f"({', '.join(f'{value:.4g}' for value in values)})"
