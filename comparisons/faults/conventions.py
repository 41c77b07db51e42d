"""Faults of conventions: frames, orders, signs and units of states, and parts of the start that are not set."""

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.faults.fault_model import (
    Change,
    FaultModel,
    Reported,
    Simulated,
    changed_part,
    changed_start,
    unchanged_scene,
    unchanged_states,
)
from dropspin.scenarios.rotations import about as rotation_about
from dropspin.scenarios.rotations import conjugate, multiply, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, RATES, SPIN, VELOCITY

Array = NDArray[np.float64]
Messages = tuple[str, str, str]
"""For a fault in what is read from the engine, in what is set at the start, and in both."""


def _convention(part: slice, messages: Messages, wrong: Change, right: Change) -> list[FaultModel]:
    """Three faults of one convention: in what is read, in what is set, and in both.

    Args:
        part: The part of a state that has the convention.
        messages: The message of each fault.
        wrong: Function from the part in the correct convention to the part in the faulty one.
        right: The inverse function.
    """
    return _read_set_both(part, messages, changed_part(part, wrong), changed_part(part, right))


def _read_set_both(part: slice, messages: Messages, reported: Reported, inverse: Reported) -> list[FaultModel]:
    simulated = changed_start(inverse)
    changes: list[tuple[Simulated, Reported]] = [(unchanged_scene, reported), (simulated, unchanged_states), (simulated, reported)]
    return [FaultModel(message, *change, about=str(part)) for message, change in zip(messages, changes, strict=True)]


def _orientation(messages: Messages, wrong: Change, right: Change) -> list[FaultModel]:
    """Faults of the orientation, also where an adapter converts the angular velocity from the body frame by the wrong orientation."""

    def with_spin(change: Change) -> Reported:
        def changed(states: Array) -> Array:
            spin = unrotate(states[:, ORIENTATION], states[:, SPIN])
            states = changed_part(ORIENTATION, change)(states)
            states[:, SPIN] = rotate(states[:, ORIENTATION], spin)
            return states

        return changed

    return _convention(ORIENTATION, messages, wrong, right) + _read_set_both(ORIENTATION, messages, with_spin(wrong), with_spin(right))


def _three(fault: str, expected: str) -> Messages:
    return f"{fault}; {expected}", f"{fault} where it is set at the start; {expected}", f"{fault}, both set and read; {expected}"


def _z_up(sign: float, but: slice | None = None) -> Reported:
    """States in a frame with z up, (x, y, z) reported as (x, -z, y) or (x, z, -y), except for one part of them."""

    def turned(states: Array) -> Array:
        states = states.copy()
        for part in (POSITION, VELOCITY, SPIN):
            if part != but:
                states[:, part] = states[:, part][:, [0, 2, 1]] * [1.0, -sign, sign]
        if but != ORIENTATION:
            states[:, ORIENTATION] = multiply(rotation_about(np.array([1.0, 0.0, 0.0]), np.array(sign * np.pi / 2)), states[:, ORIENTATION])
        return states

    return turned


def _left_handed(states: Array) -> Array:
    """States in a left-handed frame with z reversed: lengths along z change sign, and rotations about x and y."""
    return states * [1.0, 1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 1.0]


def _start(part: slice, change: Change) -> Simulated:
    """The scene with a part of its start changed."""
    return changed_start(changed_part(part, change))


BODY_TO_WORLD = "a state has [x, y, z, w], body to world"
IN_WORLD = "a state has it in the world frame"
CONVENTIONS = (
    *_orientation(
        _three("the quaternion appears to be ordered [w, x, y, z]", BODY_TO_WORLD),
        wrong=lambda q, _: np.roll(q, 1, axis=1),
        right=lambda q, _: np.roll(q, -1, axis=1),
    ),
    *_orientation(
        _three("the quaternion appears to be reordered from [w, x, y, z], which was not its order", BODY_TO_WORLD),
        wrong=lambda q, _: np.roll(q, -1, axis=1),
        right=lambda q, _: np.roll(q, 1, axis=1),
    ),
    *_orientation(
        _three("the orientation appears to be inverted, world to body", BODY_TO_WORLD),
        wrong=lambda q, _: conjugate(q),
        right=lambda q, _: conjugate(q),
    ),
    *_convention(
        SPIN,
        _three("angular velocity appears to be in the body frame", IN_WORLD),
        wrong=lambda w, q: unrotate(q, w),
        right=lambda w, q: rotate(q, w),
    ),
    *_convention(
        SPIN,
        _three("angular velocity appears to be converted from the body frame, in which it was not", IN_WORLD),
        wrong=lambda w, q: rotate(q, w),
        right=lambda w, q: unrotate(q, w),
    ),
    *_convention(
        VELOCITY,
        _three("velocity appears to be in the body frame", IN_WORLD),
        wrong=lambda v, q: unrotate(q, v),
        right=lambda v, q: rotate(q, v),
    ),
    *_convention(
        SPIN,
        _three("angular velocity appears to be in degrees per second", "a state has rad/s"),
        wrong=lambda w, _: np.rad2deg(w),
        right=lambda w, _: np.deg2rad(w),
    ),
    *_convention(
        SPIN, _three("angular velocity has the opposite sign", "it is right-handed"), wrong=lambda w, _: -w, right=lambda w, _: -w
    ),
    *_convention(
        VELOCITY, _three("velocity has the opposite sign", "it is the rate of the position"), wrong=lambda v, _: -v, right=lambda v, _: -v
    ),
    *_convention(
        RATES,
        _three("velocity and angular velocity appear to be swapped", "velocity comes first"),
        wrong=lambda both, _: np.roll(both, 3, axis=1),
        right=lambda both, _: np.roll(both, 3, axis=1),
    ),
    FaultModel(
        "y and z appear to be swapped; y is up",
        reported=lambda states: states[:, [0, 2, 1, 3, 5, 4, 6, 7, 9, 8, 10, 12, 11]],
        about="frame",
    ),
    *(
        FaultModel(f"states appear to be in a frame with z up{but}; y is up", reported=_z_up(sign, part), about="frame")
        for sign in (1.0, -1.0)
        for part, but in ((None, ""), (ORIENTATION, ", except for the orientation"), (SPIN, ", except for the angular velocity"))
    ),
    FaultModel("states appear to be in a left-handed frame; a state is right-handed", reported=_left_handed, about="frame"),
    FaultModel(
        "lengths appear to be in millimetres; a state has m",
        reported=changed_part(POSITION, lambda x, _: 1e3 * x),
        about="frame",
    ),
    FaultModel("the position at the start is not set", simulated=_start(POSITION, lambda x, _: 0.0 * x), about="start"),
    FaultModel("the orientation at the start is not set", simulated=_start(ORIENTATION, lambda q, _: np.eye(4)[[3]]), about="start"),
    FaultModel("the velocity at the start is not set", simulated=_start(VELOCITY, lambda v, _: 0.0 * v), about="start"),
    FaultModel("the angular velocity at the start is not set", simulated=_start(SPIN, lambda w, _: 0.0 * w), about="start"),
    FaultModel("velocity is reported as 0", reported=changed_part(VELOCITY, lambda v, _: 0.0 * v)),
    FaultModel("angular velocity is reported as 0", reported=changed_part(SPIN, lambda w, _: 0.0 * w)),
)
