"""The faults that adapters make, in words; of each, what is simulated then, and what is reported of it.

A fault is recognised by its motion: the exact motion of the scene that is simulated by fault, reported as the fault tells it, is what the
engine gave. So faults are reported apart as finely as a probe allows, and two at once are found as well.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import combinations, permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparisons.conformance.probes import Probe
from scenarios import DropspinError, Scenario, truth_for
from scenarios.body import Box, Sphere
from scenarios.model import Gravity
from scenarios.rotations import about as rotation_about
from scenarios.rotations import conjugate, multiply, rotate, unrotate
from scenarios.state import ORIENTATION, POSITION, RATES, SPIN, VELOCITY

Array = NDArray[np.float64]
Simulated = Callable[[Scenario], Scenario]
Reported = Callable[[Array], Array]
Change = Callable[[Array, Array], Array]
"""From a part of states, and their orientations."""
Exact = dict[Scenario, Array | None]
"""The states of scenes at a probe's times, shape (2, 13); None where no closed form has them."""

STANDARD_GRAVITY = 9.81
SLOW = 0.2  # m/s; Bullet drops restitution below it


def _as_it_is(scene: Scenario) -> Scenario:
    return scene


def _as_reported(states: Array) -> Array:
    return states


@dataclass(frozen=True)
class FaultModel:
    """One fault.

    Attributes:
        message: What is wrong, in words.
        simulated: The scene that is simulated instead.
        reported: What is reported instead of states, shape (n, 13).
        is_peculiarity: Whether this is the engine's own way rather than its adapter's fault.
        about: What it is a fault of; two of the same thing are not looked for.
    """

    message: str
    simulated: Simulated = _as_it_is
    reported: Reported = _as_reported
    is_peculiarity: bool = False
    about: str = ""

    def motion(self, probe: Probe, known: Exact) -> Array | None:
        """What an engine with this fault gives of a probe, shape (2, 13); None where no closed form can say.

        Many faults simulate the same: `known` has what was found before, and gets what is found now.
        """
        try:
            scene = self.simulated(probe.scene)
            if scene not in known:
                known[scene] = _exactly(scene, probe.times)
        except (DropspinError, ValueError):  # no such body, or one that starts below the floor
            return None
        states = known[scene]
        return None if states is None else self.reported(states)

    def start(self, scene: Scenario) -> Array:
        """The state at the start with this fault, shape (13,)."""
        return self.reported(self.simulated(scene).initial_state[None])[0]

    def and_also(self, other: "FaultModel") -> "FaultModel":
        """Both at once."""
        return FaultModel(
            f"{self.message}; and {other.message}",
            lambda scene: other.simulated(self.simulated(scene)),
            lambda states: self.reported(other.reported(states)),  # the way back
            is_peculiarity=self.is_peculiarity and other.is_peculiarity,
        )


def explained(probe: Probe, found: Array) -> FaultModel | None:
    """The fault, or the two, that give what an engine gave of a probe, shape (2, 13); None if there are none."""
    # The truth of a box on its corner takes long, too long for thousands of pairs.
    singly = [fault for fault in FAULT_MODELS if fault.about != "start"]  # which is looked at by itself
    known: Exact = {}
    for candidates in (singly, _pairs() if probe.scene.floor is None or isinstance(probe.scene.body, Sphere) else ()):
        near = [(fault, motion) for fault in candidates if (motion := fault.motion(probe, known)) is not None]
        if not near:
            continue
        off = np.round(probe.off(found, np.array([motion for _, motion in near])), 3)
        if off.min() <= 1.0:
            return near[int(np.argmin(off))][0]
    return None


def _exactly(scene: Scenario, times: Array) -> Array | None:
    """States at some times, shape (2, 13); None where no closed form has all of them."""
    truth = truth_for(scene)
    return None if truth is None or not truth.covers(times).all() else truth(times).states


def explained_start(scene: Scenario, state: Array, allowed: float) -> FaultModel | None:
    """The fault, or the two, that give this state at the start, to so much of its largest number."""
    for candidates in (FAULT_MODELS, _pairs()):
        for fault in candidates:
            start, close = fault.start(scene), allowed * np.abs(scene.initial_state).max()
            # One that sets and reads alike leaves the start as it is, and explains nothing there.
            if np.abs(start - state).max() <= close < np.abs(start - scene.initial_state).max():
                return fault
    return None


def _pairs() -> Iterable[FaultModel]:
    return (first.and_also(second) for first, second in combinations(FAULT_MODELS, 2) if first.about != second.about)


def _table(part: str, **values: Any) -> Simulated:
    """The scene with some values of a table changed, where it has that table."""

    def changed(scene: Scenario) -> Scenario:
        table = getattr(scene, part)
        if table is None:
            return scene
        given = table.model_dump() | {key: value(getattr(table, key)) if callable(value) else value for key, value in values.items()}
        return scene.model_copy(update={part: type(table).model_validate(given)})

    return changed


def _start(part: slice, change: Change) -> Simulated:
    """The scene with a part of the start changed, by a function of its values and of the orientation."""
    return _started(_reported(part, change))


def _started(change: Reported) -> Simulated:
    """The scene with its start changed as states are."""
    return lambda scene: scene.starting_at(change(scene.initial_state[None])[0])


def _reported(part: slice, change: Change) -> Reported:
    """States with a part changed, by a function of its values and of the orientations."""

    def changed(states: Array) -> Array:
        states = states.copy()
        states[:, part] = change(states[:, part], states[:, ORIENTATION])
        return states

    return changed


def _gravity(change: Callable[[Array], Array]) -> Simulated:
    def changed(scene: Scenario) -> Scenario:
        acceleration = tuple(float(value) for value in change(scene.acceleration))
        return scene.model_copy(update={"gravity": Gravity(acceleration=acceleration)})

    return changed


def _convention(part: slice, words: tuple[str, str, str], wrong: Change, right: Change) -> list[FaultModel]:
    """Three faults of one convention: in what is reported, in what is set, and in both.

    Args:
        part: Which numbers of a state.
        words: What to say of each.
        wrong: What a sound part is made into, by fault.
        right: The way back.
    """
    return _read_set_both(part, words, _reported(part, wrong), _reported(part, right))


def _read_set_both(part: slice, words: tuple[str, str, str], reported: Reported, back: Reported) -> list[FaultModel]:
    simulated = _started(back)
    ways: list[tuple[Simulated, Reported]] = [(_as_it_is, reported), (simulated, _as_reported), (simulated, reported)]
    return [FaultModel(message, *way, about=str(part)) for message, way in zip(words, ways, strict=True)]


def _orientation(words: tuple[str, str, str], wrong: Change, right: Change) -> list[FaultModel]:
    """Mistakes of the orientation; also of engines whose spin is body-framed, where converting it takes the wrong orientation along."""

    def carried(change: Change) -> Reported:
        def changed(states: Array) -> Array:
            spin = unrotate(states[:, ORIENTATION], states[:, SPIN])
            states = _reported(ORIENTATION, change)(states)
            states[:, SPIN] = rotate(states[:, ORIENTATION], spin)
            return states

        return changed

    return _convention(ORIENTATION, words, wrong, right) + _read_set_both(ORIENTATION, words, carried(wrong), carried(right))


def _three(what: str, ought: str) -> tuple[str, str, str]:
    return f"{what}; {ought}", f"{what} where it is set at the start; {ought}", f"{what}, set and read alike; {ought}"


def _turned(sign: float, but: slice | None = None) -> Reported:
    """States in a frame of which z is up, (x, y, z) reported as (x, -z, y) or (x, z, -y); all but one part of them."""

    def turned(states: Array) -> Array:
        states = states.copy()
        for part in (POSITION, VELOCITY, SPIN):
            if part != but:
                states[:, part] = states[:, part][:, [0, 2, 1]] * [1.0, -sign, sign]
        if but != ORIENTATION:
            states[:, ORIENTATION] = multiply(rotation_about(np.array([1.0, 0.0, 0.0]), np.array(sign * np.pi / 2)), states[:, ORIENTATION])
        return states

    return turned


def _mirrored(states: Array) -> Array:
    """States in a left-handed frame, z the other way: lengths along z change sign, rotations about x and y."""
    return states * [1.0, 1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 1.0]


def _moments(scene: Scenario) -> tuple[float, ...]:
    """Moments of inertia about the body's own axes; products are left out."""
    return tuple(np.diag(scene.body.inertia_tensor).tolist())


def _scaled_inertia(by: Callable[[float], float]) -> Simulated:
    """Moments of inertia times a function of the mass."""

    def scaled(scene: Scenario) -> Scenario:
        return _table("body", inertia=tuple(by(scene.body.mass) * moment for moment in _moments(scene)))(scene)

    return scaled


def _permuted_extents(order: tuple[int, ...]) -> Simulated:
    def permuted(scene: Scenario) -> Scenario:
        if not isinstance(scene.body, Box):
            return scene
        extents = [scene.body.half_extents[axis] for axis in order]
        return _table("body", half_extents=extents, inertia=_moments(scene))(scene)

    return permuted


def _gravity_by_mass(power: float) -> Simulated:
    def changed(scene: Scenario) -> Scenario:
        return _gravity(lambda g: g * scene.body.mass**power)(scene)

    return changed


def _permuted_moments(order: tuple[int, ...]) -> Simulated:
    return _table("body", inertia=lambda given: tuple(given[axis] for axis in order) if isinstance(given, tuple) else given)


def _as_a_ball(scene: Scenario) -> Scenario:
    mean = float(np.trace(scene.body.inertia_tensor)) / 3.0
    return _table("body", inertia=(mean, mean, mean))(scene)


def _scaled_size(by: float) -> Simulated:
    def scaled(scene: Scenario) -> Scenario:
        if scene.floor is None:
            return scene
        sizes = {"radius", "half_extents"} & set(type(scene.body).model_fields)
        return _table("body", inertia=_moments(scene), **{size: lambda given: np.multiply(given, by).tolist() for size in sizes})(scene)

    return scaled


def _standard(*direction: float) -> Simulated:
    return _gravity(lambda g: STANDARD_GRAVITY * np.array(direction))


def _size_along(*direction: float) -> Simulated:
    return _gravity(lambda g: np.linalg.norm(g) * np.array(direction))


def _restitution(change: Callable[[float], float]) -> Simulated:
    return _table("floor", restitution=change)


def _friction(change: Callable[[float], float]) -> Simulated:
    """Coefficients changed; none and infinite left as they are."""
    return _table("floor", friction=lambda mu: mu if isinstance(mu, str) else change(mu))


def _angular_like_linear(scene: Scenario) -> Scenario:
    return scene if scene.damping is None else _table("damping", angular=scene.damping.linear)(scene)


def _of(about: str, *faults: tuple[str, Simulated]) -> list[FaultModel]:
    """Mistakes of one thing, in what is simulated."""
    return [FaultModel(message, simulated, about=about) for message, simulated in faults]


def _axes(order: tuple[int, ...]) -> str:
    """Axes in an order, in words."""
    return ", ".join("xyz"[axis] for axis in order)


ORDERS = [order for order in permutations(range(3)) if order != (0, 1, 2)]
BODY_TO_WORLD = "the state's is [x, y, z, w], body to world"
IN_WORLD = "the state's is in the world frame"
CONVENTIONS = (
    *_orientation(
        _three("the quaternion looks ordered [w, x, y, z]", BODY_TO_WORLD),
        wrong=lambda q, _: np.roll(q, 1, axis=1),
        right=lambda q, _: np.roll(q, -1, axis=1),
    ),
    *_orientation(
        _three("the quaternion looks reordered from [w, x, y, z], though it is none", BODY_TO_WORLD),
        wrong=lambda q, _: np.roll(q, -1, axis=1),
        right=lambda q, _: np.roll(q, 1, axis=1),
    ),
    *_orientation(
        _three("the orientation looks inverted, world to body", BODY_TO_WORLD),
        wrong=lambda q, _: conjugate(q),
        right=lambda q, _: conjugate(q),
    ),
    *_convention(
        SPIN, _three("angular velocity looks body-framed", IN_WORLD), wrong=lambda w, q: unrotate(q, w), right=lambda w, q: rotate(q, w)
    ),
    *_convention(
        SPIN,
        _three("angular velocity looks turned from a body frame in which it is not", IN_WORLD),
        wrong=lambda w, q: rotate(q, w),
        right=lambda w, q: unrotate(q, w),
    ),
    *_convention(
        VELOCITY, _three("velocity looks body-framed", IN_WORLD), wrong=lambda v, q: unrotate(q, v), right=lambda v, q: rotate(q, v)
    ),
    *_convention(
        SPIN,
        _three("angular velocity looks to be in degrees a second", "the state's is in rad/s"),
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
        _three("velocity and angular velocity look swapped", "velocity comes first"),
        wrong=lambda both, _: np.roll(both, 3, axis=1),
        right=lambda both, _: np.roll(both, 3, axis=1),
    ),
    FaultModel(
        "y and z look swapped; y is up", reported=lambda states: states[:, [0, 2, 1, 3, 5, 4, 6, 7, 9, 8, 10, 12, 11]], about="frame"
    ),
    *(
        FaultModel(
            f"states look to be in a frame in which z is up{but}; y is up, for all of them", reported=_turned(sign, part), about="frame"
        )
        for sign in (1.0, -1.0)
        for part, but in ((None, ""), (ORIENTATION, ", but for the orientation"), (SPIN, ", but for the angular velocity"))
    ),
    FaultModel("states look to be in a left-handed frame", reported=_mirrored, about="frame"),
    FaultModel(
        "lengths look to be in millimetres; they are in m",
        reported=_reported(POSITION, lambda x, _: 1e3 * x),
        about="frame",
    ),
    FaultModel("the position at the start is not set", simulated=_start(POSITION, lambda x, _: 0.0 * x), about="start"),
    FaultModel("the orientation at the start is not set", simulated=_start(ORIENTATION, lambda q, _: np.eye(4)[[3]]), about="start"),
    FaultModel("the velocity at the start is not set", simulated=_start(VELOCITY, lambda v, _: 0.0 * v), about="start"),
    FaultModel("the angular velocity at the start is not set", simulated=_start(SPIN, lambda w, _: 0.0 * w), about="start"),
    FaultModel("velocity is reported as 0", reported=_reported(VELOCITY, lambda v, _: 0.0 * v)),
    FaultModel("angular velocity is reported as 0", reported=_reported(SPIN, lambda w, _: 0.0 * w)),
)
FLIGHT = (
    *_of(
        "gravity",
        ("gravity is left out", _gravity(lambda g: 0.0 * g)),
        ("gravity has the opposite sign; the scene's is an acceleration, y up", _gravity(lambda g: -g)),
        ("gravity is 9.81 m/s² along -y, whatever the scene says", _standard(0.0, -1.0, 0.0)),
        ("gravity is 9.81 m/s² along -z, whatever the scene says; y is up", _standard(0.0, 0.0, -1.0)),
        ("gravity acts along -z; y is up", _size_along(0.0, 0.0, -1.0)),
        ("only gravity's size counts, along -y; it is a vector", _size_along(0.0, -1.0, 0.0)),
        ("gravity's y and z look swapped; y is up", _gravity(lambda g: g[[0, 2, 1]])),
        ("gravity looks left in a frame in which z is up; y is up", _gravity(lambda g: g[[0, 2, 1]] * [1, 1, -1])),
        ("gravity looks turned to a frame in which z is up; y is up", _gravity(lambda g: g[[0, 2, 1]] * [1, -1, 1])),
        ("gravity is multiplied by the mass; it is an acceleration, not a force", _gravity_by_mass(1.0)),
        ("gravity is divided by the mass; it is an acceleration, not a force", _gravity_by_mass(-1.0)),
        ("gravity acts twice", _gravity(lambda g: 2.0 * g)),
    ),
    *_of(
        "damping",
        ("damping is left out", lambda scene: scene.model_copy(update={"damping": None})),
        ("angular damping is left out", _table("damping", angular=0.0)),
        ("linear damping is left out", _table("damping", linear=0.0)),
        ("linear damping acts on the spin as well", _angular_like_linear),
    ),
    *_of("mass", ("mass is 1 kg, whatever the scene says", _table("body", mass=1.0))),
    FaultModel(
        "angular velocity stays constant, as with the gyroscopic term left out or with the inertia of a ball",
        simulated=_as_a_ball,
        is_peculiarity=True,
        about="inertia",
    ),
    *_of(
        "inertia",
        *((f"the moments of inertia look permuted to ({_axes(order)})", _permuted_moments(order)) for order in ORDERS),
        ("products of inertia are left out: the body's own axes are not principal", _scaled_inertia(lambda mass: 1.0)),
        ("inertia is twice as large", _scaled_inertia(lambda mass: 2.0)),
        ("inertia is half as large", _scaled_inertia(lambda mass: 0.5)),
        ("inertia is multiplied by the mass", _scaled_inertia(lambda mass: mass)),
        ("inertia is divided by the mass", _scaled_inertia(lambda mass: 1.0 / mass)),
        ("inertia is the solid shape's, whatever the scene says", _table("body", inertia="solid")),
    ),
)
IMPACT = (
    *_of("floor", ("the body falls through the floor", lambda scene: scene.model_copy(update={"floor": None}))),
    *_of(
        "restitution",
        ("restitution is 0, whatever the scene says", _table("floor", restitution=0.0)),
        ("restitution is 1, whatever the scene says", _table("floor", restitution=1.0)),
        ("restitution looks squared; an engine that multiplies two bodies' needs 1 for the floor", _restitution(lambda e: e**2)),
        ("restitution looks halved; an engine that takes the mean of two bodies' needs both", _restitution(lambda e: e / 2)),
        ("restitution is the mean of the scene's and 1", _restitution(lambda e: (e + 1) / 2)),
        (
            "restitution is 0 below a speed of the engine's own; the scene's rest_speed is 0",
            _table("floor", rest_speed=SLOW),
        ),
    ),
    *_of(
        "friction",
        ("friction is left out", _table("floor", friction="none")),
        ("friction grips, whatever the scene says", _table("floor", friction="infinite")),
        ("friction is 0.5, whatever the scene says", _table("floor", friction=0.5)),
        ("friction is 1, whatever the scene says", _table("floor", friction=1.0)),
        ("friction looks squared; an engine that multiplies two bodies' needs 1 for the floor", _friction(lambda mu: mu**2)),
        ("friction looks halved; an engine that takes the mean of two bodies' needs both", _friction(lambda mu: mu / 2)),
    ),
    *_of(
        "size",
        *((f"the box's extents look permuted to ({_axes(order)})", _permuted_extents(order)) for order in ORDERS),
        ("the body is half as large; a sphere has a radius, a box half extents", _scaled_size(0.5)),
        ("the body is twice as large; a sphere has a radius, a box half extents", _scaled_size(2.0)),
    ),
)
FAULT_MODELS = (*CONVENTIONS, *FLIGHT, *IMPACT)
