"""Faults of conventions: frames, orders, signs and units of states, and parts of the start that are not set."""

import numpy as np

from dropspin.comparisons.faults.fault_model import Change, FaultModel, Reported, changed_part, changed_start
from dropspin.scenarios.rotations import about as rotation_about
from dropspin.scenarios.rotations import conjugate, multiply, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, RATES, SPIN, VELOCITY, Array


def _convention(part: slice, fault: str, expected: str, wrong: Change, right: Change) -> list[FaultModel]:
    """Three faults of one convention: in what is read, in what is set at the start, and in both.

    Args:
        part: The part of a state that has the convention.
        fault: The fault in what is read.
        expected: The convention of a state.
        wrong: Function from the part in the correct convention to the part in the faulty one.
        right: The inverse function.
    """
    return _read_set_both(part, fault, expected, changed_part(part, wrong), changed_part(part, right))


def _read_set_both(part: slice, fault: str, expected: str, reported: Reported, inverse: Reported) -> list[FaultModel]:
    simulated, about = changed_start(inverse), str(part)
    return [
        FaultModel(f"{fault}; {expected}", reported=reported, about=about),
        FaultModel(f"{fault} where it is set at the start; {expected}", simulated, about=about),
        FaultModel(f"{fault}, both set and read; {expected}", simulated, reported, about=about),
    ]


def _orientation(fault: str, wrong: Change, right: Change) -> list[FaultModel]:
    """Faults of the orientation, also where an adapter converts the angular velocity from the body frame by the wrong orientation."""

    def with_spin(change: Change) -> Reported:
        def changed(states: Array) -> Array:
            spin = unrotate(states[:, ORIENTATION], states[:, SPIN])
            states = changed_part(ORIENTATION, change)(states)
            states[:, SPIN] = rotate(states[:, ORIENTATION], spin)
            return states

        return changed

    expected = "a state has [x, y, z, w], body to world"
    both = _read_set_both(ORIENTATION, fault, expected, with_spin(wrong), with_spin(right))
    return _convention(ORIENTATION, fault, expected, wrong, right) + both


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


def _scalar_first(q: Array, _: Array) -> Array:
    return np.roll(q, 1, axis=1)


def _scalar_last(q: Array, _: Array) -> Array:
    return np.roll(q, -1, axis=1)


def _inverted(q: Array, _: Array) -> Array:
    return conjugate(q)


def _in_body(vectors: Array, orientation: Array) -> Array:
    return unrotate(orientation, vectors)


def _in_world(vectors: Array, orientation: Array) -> Array:
    return rotate(orientation, vectors)


def _negative(vectors: Array, _: Array) -> Array:
    return -vectors


def _swapped(rates: Array, _: Array) -> Array:
    return np.roll(rates, 3, axis=1)


def _zero(values: Array, _: Array) -> Array:
    return 0.0 * values


def _identity(values: Array, _: Array) -> Array:
    return np.eye(4)[[3]]


def _not_set(name: str, part: slice, default: Change = _zero) -> FaultModel:
    return FaultModel(f"the {name} at the start is not set", changed_start(changed_part(part, default)), about="start")


WORLD = "a state has it in the world frame"
SPIN_FROM_BODY = "angular velocity appears to be converted from the body frame, in which it was not"
CONVENTIONS = (
    *_orientation("the quaternion appears to be ordered [w, x, y, z]", _scalar_first, _scalar_last),
    *_orientation("the quaternion appears to be reordered from [w, x, y, z], which was not its order", _scalar_last, _scalar_first),
    *_orientation("the orientation appears to be inverted, world to body", _inverted, _inverted),
    *_convention(SPIN, "angular velocity appears to be in the body frame", WORLD, _in_body, _in_world),
    *_convention(SPIN, SPIN_FROM_BODY, WORLD, _in_world, _in_body),
    *_convention(VELOCITY, "velocity appears to be in the body frame", WORLD, _in_body, _in_world),
    *_convention(
        SPIN,
        "angular velocity appears to be in degrees per second",
        "a state has rad/s",
        wrong=lambda w, _: np.rad2deg(w),
        right=lambda w, _: np.deg2rad(w),
    ),
    *_convention(SPIN, "angular velocity has the opposite sign", "it is right-handed", _negative, _negative),
    *_convention(VELOCITY, "velocity has the opposite sign", "it is the rate of the position", _negative, _negative),
    *_convention(RATES, "velocity and angular velocity appear to be swapped", "velocity comes first", _swapped, _swapped),
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
    _not_set("position", POSITION),
    _not_set("orientation", ORIENTATION, _identity),
    _not_set("velocity", VELOCITY),
    _not_set("angular velocity", SPIN),
    FaultModel("velocity is reported as 0", reported=changed_part(VELOCITY, _zero)),
    FaultModel("angular velocity is reported as 0", reported=changed_part(SPIN, _zero)),
)
