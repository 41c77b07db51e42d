"""Faults of conventions: frames, orders, signs and units of states, and parts of the start that are not set."""

from collections.abc import Iterator
from functools import partial

import numpy as np

from dropspin.comparisons.faults.fault_model import Change, FaultModel, Reported, Simulated, changed_part, changed_start
from dropspin.scenarios.rotations import about as rotation_about
from dropspin.scenarios.rotations import conjugate, multiply, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, PARTS, POSITION, RATES, SPIN, VELOCITY, Array


def _convention(part: slice, fault: str, expected: str, wrong: Change, right: Change) -> Iterator[FaultModel]:
    """Three faults of one convention: in what is read, in what is set at the start, and in both; of the orientation, six.

    An adapter may also convert the angular velocity from the body frame by the wrong orientation.

    Args:
        part: The part of a state that has the convention.
        fault: The fault.
        expected: The correct convention.
        wrong: Function from the part in the correct convention to the part in the faulty one.
        right: The inverse function.
    """
    changes: list[tuple[Reported, Reported]] = [(changed_part(part, wrong), changed_part(part, right))]
    if part == ORIENTATION:
        changes.append((partial(_with_spin, wrong), partial(_with_spin, right)))
    for reported, inverse in changes:
        simulated, about = changed_start(inverse), str(part)
        yield FaultModel(f"{fault}; {expected}", reported=reported, about=about)
        yield FaultModel(f"{fault} where it is set at the start; {expected}", simulated, about=about)
        yield FaultModel(f"{fault}, both set and read; {expected}", simulated, reported, about=about)


def _with_spin(change: Change, states: Array) -> Array:
    """States with a changed orientation, by which the angular velocity is converted from the body frame too."""
    spin = unrotate(states[:, ORIENTATION], states[:, SPIN])
    states = changed_part(ORIENTATION, change)(states)
    states[:, SPIN] = rotate(states[:, ORIENTATION], spin)
    return states


def _rolled(by: int) -> Change:
    return lambda _, part: np.roll(part, by, axis=1)


def _times(factor: float | Array) -> Change:
    return lambda _, part: factor * part


def _inverted(_: Array, orientation: Array) -> Array:
    return conjugate(orientation)


def _z_up(sign: float, but: slice | None, states: Array) -> Array:
    """States in a frame with z up, (x, y, z) reported as (x, -z, y) or (x, z, -y), except for one part of them."""
    states = states.copy()
    for part in (POSITION, VELOCITY, SPIN):
        if part != but:
            states[:, part] = states[:, part][:, [0, 2, 1]] * [1.0, -sign, sign]
    if but != ORIENTATION:
        states[:, ORIENTATION] = multiply(rotation_about(np.array([1.0, 0.0, 0.0]), np.array(sign * np.pi / 2)), states[:, ORIENTATION])
    return states


def _left_handed(states: Array) -> Array:
    """States in a left-handed frame with z reversed: lengths along z change sign, and rotations about x and y."""
    return states * [1.0, 1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 1.0]


def _not_set(part: slice) -> Simulated:
    """The scene with a part of its start at the origin, not turned, or at rest."""
    return changed_start(changed_part(part, lambda _, values: np.eye(13)[[6], part]))


REORDERED = "the quaternion appears to be reordered from [w, x, y, z], which was not its order"
CONVERTED = "angular velocity appears to be converted from the body frame, in which it was not"
BODY_TO_WORLD = "a state has [x, y, z, w], body to world"
IN_WORLD = "a state has it in the world frame"
IN_DEGREES = "angular velocity appears to be in degrees per second"
CONVENTIONS = (
    *_convention(ORIENTATION, "the quaternion appears to be ordered [w, x, y, z]", BODY_TO_WORLD, _rolled(1), _rolled(-1)),
    *_convention(ORIENTATION, REORDERED, BODY_TO_WORLD, _rolled(-1), _rolled(1)),
    *_convention(ORIENTATION, "the orientation appears to be inverted, world to body", BODY_TO_WORLD, _inverted, _inverted),
    *_convention(SPIN, "angular velocity appears to be in the body frame", IN_WORLD, unrotate, rotate),
    *_convention(SPIN, CONVERTED, IN_WORLD, rotate, unrotate),
    *_convention(VELOCITY, "velocity appears to be in the body frame", IN_WORLD, unrotate, rotate),
    *_convention(SPIN, IN_DEGREES, "a state has rad/s", _times(np.rad2deg(1.0)), _times(np.deg2rad(1.0))),
    *_convention(SPIN, "angular velocity has the opposite sign", "it is right-handed", _times(-1.0), _times(-1.0)),
    *_convention(VELOCITY, "velocity has the opposite sign", "it is the rate of the position", _times(-1.0), _times(-1.0)),
    *_convention(RATES, "velocity and angular velocity appear to be swapped", "velocity comes first", _rolled(3), _rolled(3)),
    FaultModel(
        "y and z appear to be swapped; y is up",
        reported=lambda states: states[:, [0, 2, 1, 3, 5, 4, 6, 7, 9, 8, 10, 12, 11]],
        about="frame",
    ),
    *(
        FaultModel(f"states appear to be in a frame with z up{but}; y is up", reported=partial(_z_up, sign, part), about="frame")
        for sign in (1.0, -1.0)
        for part, but in ((None, ""), (ORIENTATION, ", except for the orientation"), (SPIN, ", except for the angular velocity"))
    ),
    FaultModel("states appear to be in a left-handed frame; a state is right-handed", reported=_left_handed, about="frame"),
    FaultModel("lengths appear to be in millimetres; a state has m", reported=changed_part(POSITION, _times(1e3)), about="frame"),
    *(
        FaultModel(f"the {name.replace('_', ' ')} at the start is not set", simulated=_not_set(part), about="start")
        for name, part in PARTS.items()
    ),
    FaultModel("velocity is reported as 0", reported=changed_part(VELOCITY, _times(0.0))),
    FaultModel("angular velocity is reported as 0", reported=changed_part(SPIN, _times(0.0))),
)
