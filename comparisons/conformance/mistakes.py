"""The mistakes that adapters make, in words; of each, what is simulated then, and what is told of it.

A mistake is recognised by its motion: the exact motion of the scene that is simulated by mistake, told as the mistake tells it, is what the
engine gave. So mistakes are told apart as finely as a probe allows, and two at once are found as well.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import combinations, permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from comparisons.conformance.probes import Probe
from scenarios import DropspinError, Scenario, truth_for
from scenarios.body import Sphere
from scenarios.model import Gravity
from scenarios.rotations import about, conjugate, multiply, rotate, unrotate

Array = NDArray[np.float64]
Simulated = Callable[[Scenario], Scenario]
Told = Callable[[Array], Array]
Change = Callable[[Array, Array], Array]
"""From a part of states, and their orientations."""

POSITION, ORIENTATION, VELOCITY, SPIN = slice(0, 3), slice(3, 7), slice(7, 10), slice(10, 13)
STANDARD_GRAVITY = 9.81


@dataclass(frozen=True)
class Mistake:
    """One mistake.

    Attributes:
        said: What is wrong, in words.
        simulated: The scene that is simulated instead.
        told: What is told instead of states, shape (n, 13).
        is_a_trait: Whether this is the engine's own way rather than its adapter's mistake.
    """

    said: str
    simulated: Simulated = lambda scene: scene
    told: Told = lambda states: states
    is_a_trait: bool = False

    def motion(self, probe: Probe) -> Array | None:
        """What an engine with this mistake gives of a probe, shape (2, 13); None where no closed form can say."""
        try:
            truth = truth_for(self.simulated(probe.scene))
        except (DropspinError, ValueError):  # no such body, or one that starts below the floor
            return None
        return None if truth is None or not truth.covers(probe.times).all() else self.told(truth(probe.times).states)

    def start(self, scene: Scenario) -> Array:
        """The state at the start with this mistake, shape (13,)."""
        return self.told(self.simulated(scene).initial_state[None])[0]

    def and_also(self, other: "Mistake") -> "Mistake":
        """Both at once."""
        return Mistake(
            f"{self.said}; and {other.said}",
            lambda scene: other.simulated(self.simulated(scene)),
            lambda states: self.told(other.told(states)),  # the way back
            is_a_trait=self.is_a_trait and other.is_a_trait,
        )


def explained(probe: Probe, found: Array) -> Mistake | None:
    """The mistake, or the two, that give what an engine gave of a probe, shape (2, 13); None if there are none."""
    # The truth of a box on its corner takes long, too long for thousands of pairs.
    for candidates in (MISTAKES, _pairs() if probe.scene.floor is None or isinstance(probe.scene.body, Sphere) else ()):
        near = [(probe.off(found, motion), mistake) for mistake in candidates if (motion := mistake.motion(probe)) is not None]
        off, best = min(near, key=lambda one: one[0], default=(np.inf, None))
        if off <= 1.0:
            return best
    return None


def explained_start(scene: Scenario, state: Array, allowed: float) -> Mistake | None:
    """The mistake, or the two, that give this state at the start, to so much of its largest number."""
    for candidates in (MISTAKES, _pairs()):
        for mistake in candidates:
            if np.abs(mistake.start(scene) - state).max() <= allowed * np.abs(scene.initial_state).max():
                return mistake
    return None


def _pairs() -> Iterable[Mistake]:
    return (first.and_also(second) for first, second in combinations(MISTAKES, 2))


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
    told = _told(part, change)
    return lambda scene: scene.starting_at(told(scene.initial_state[None])[0])


def _told(part: slice, change: Change) -> Told:
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


def _convention(part: slice, words: tuple[str, str, str], wrong: Change, right: Change) -> list[Mistake]:
    """Three mistakes of one convention: in what is told, in what is set, and in both.

    Args:
        part: Which numbers of a state.
        words: What to say of each.
        wrong: What a sound part is made into, by mistake.
        right: The way back.
    """
    told, simulated = _told(part, wrong), _start(part, right)
    return [Mistake(words[0], told=told), Mistake(words[1], simulated), Mistake(words[2], simulated, told)]


def _orientation(words: tuple[str, str, str], wrong: Change, right: Change) -> list[Mistake]:
    """Mistakes of the orientation; also of engines whose spin is body-framed, where converting it takes the wrong orientation along."""

    def carried(change: Change) -> Told:
        def changed(states: Array) -> Array:
            spin = unrotate(states[:, ORIENTATION], states[:, SPIN])
            states = _told(ORIENTATION, change)(states)
            states[:, SPIN] = rotate(states[:, ORIENTATION], spin)
            return states

        return changed

    told, back = carried(wrong), carried(right)

    def simulated(scene: Scenario) -> Scenario:
        return scene.starting_at(back(scene.initial_state[None])[0])

    with_spin = [Mistake(words[0], told=told), Mistake(words[1], simulated), Mistake(words[2], simulated, told)]
    return _convention(ORIENTATION, words, wrong, right) + with_spin


def _three(what: str, ought: str) -> tuple[str, str, str]:
    return f"{what}; {ought}", f"{what} where it is set at the start; {ought}", f"{what}, set and read alike; {ought}"


def _turned(states: Array) -> Array:
    """States in a frame of which z is up: (x, y, z) is told as (x, -z, y)."""
    states = states.copy()
    for part in (POSITION, VELOCITY, SPIN):
        states[:, part] = states[:, part][:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    states[:, ORIENTATION] = multiply(about(np.array([1.0, 0.0, 0.0]), np.array(np.pi / 2)), states[:, ORIENTATION])
    return states


def _permuted_moments(order: tuple[int, ...]) -> Simulated:
    return _table("body", inertia=lambda given: tuple(given[axis] for axis in order) if isinstance(given, tuple) else given)


def _as_a_ball(scene: Scenario) -> Scenario:
    mean = float(np.trace(scene.body.inertia_tensor)) / 3.0
    return _table("body", inertia=(mean, mean, mean))(scene)


def _scaled_size(by: float) -> Simulated:
    def scaled(scene: Scenario) -> Scenario:
        fixed = tuple(float(moment) for moment in np.diag(scene.body.inertia_tensor))
        sizes = {"radius", "half_extents"} & set(type(scene.body).model_fields)
        return _table("body", inertia=fixed, **{size: lambda given: np.multiply(given, by).tolist() for size in sizes})(scene)

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
        slice(7, 13),
        _three("velocity and angular velocity look swapped", "velocity comes first"),
        wrong=lambda both, _: np.roll(both, 3, axis=1),
        right=lambda both, _: np.roll(both, 3, axis=1),
    ),
    Mistake("y and z look swapped; y is up", told=lambda states: states[:, [0, 2, 1, 3, 5, 4, 6, 7, 9, 8, 10, 12, 11]]),
    Mistake("states look to be in a frame in which z is up; y is up", told=_turned),
    Mistake("the position at the start is not set", simulated=_start(POSITION, lambda x, _: 0.0 * x)),
    Mistake("the orientation at the start is not set", simulated=_start(ORIENTATION, lambda q, _: np.eye(4)[[3]])),
    Mistake("the velocity at the start is not set", simulated=_start(VELOCITY, lambda v, _: 0.0 * v)),
    Mistake("the angular velocity at the start is not set", simulated=_start(SPIN, lambda w, _: 0.0 * w)),
    Mistake("velocity is told as 0", told=_told(VELOCITY, lambda v, _: 0.0 * v)),
    Mistake("angular velocity is told as 0", told=_told(SPIN, lambda w, _: 0.0 * w)),
)
FLIGHT = (
    Mistake("gravity is left out", simulated=_gravity(lambda g: 0.0 * g)),
    Mistake("gravity has the opposite sign; the scene's is an acceleration, y up", simulated=_gravity(lambda g: -g)),
    Mistake("gravity is 9.81 m/s² along -y, whatever the scene says", simulated=_standard(0.0, -1.0, 0.0)),
    Mistake("gravity is 9.81 m/s² along -z, whatever the scene says; y is up", simulated=_standard(0.0, 0.0, -1.0)),
    Mistake("gravity acts along -z; y is up", simulated=_size_along(0.0, 0.0, -1.0)),
    Mistake("only gravity's size counts, along -y; it is a vector", simulated=_size_along(0.0, -1.0, 0.0)),
    Mistake("gravity's y and z look swapped; y is up", simulated=_gravity(lambda g: g[[0, 2, 1]])),
    Mistake("gravity acts twice", simulated=_gravity(lambda g: 2.0 * g)),
    Mistake("damping is left out", simulated=lambda scene: scene.model_copy(update={"damping": None})),
    Mistake("angular damping is left out", simulated=_table("damping", angular=0.0)),
    Mistake("linear damping is left out", simulated=_table("damping", linear=0.0)),
    Mistake("linear damping acts on the spin as well", simulated=_angular_like_linear),
    Mistake(
        "angular velocity stays constant, as with the gyroscopic term left out or with the inertia of a ball",
        simulated=_as_a_ball,
        is_a_trait=True,
    ),
    *(
        Mistake(f"the moments of inertia look permuted to ({', '.join('xyz'[axis] for axis in order)})", simulated=_permuted_moments(order))
        for order in permutations(range(3))
        if order != (0, 1, 2)
    ),
    Mistake("inertia is the solid shape's, whatever the scene says", simulated=_table("body", inertia="solid")),
    Mistake("mass is 1 kg, whatever the scene says", simulated=_table("body", mass=1.0)),
)
IMPACT = (
    Mistake("the body falls through the floor", simulated=lambda scene: scene.model_copy(update={"floor": None})),
    Mistake("restitution is 0, whatever the scene says", simulated=_table("floor", restitution=0.0)),
    Mistake("restitution is 1, whatever the scene says", simulated=_table("floor", restitution=1.0)),
    Mistake(
        "restitution looks squared; an engine that multiplies two bodies' needs 1 for the floor", simulated=_restitution(lambda e: e**2)
    ),
    Mistake("restitution looks halved; an engine that takes the mean of two bodies' needs both", simulated=_restitution(lambda e: e / 2)),
    Mistake("restitution is the mean of the scene's and 1", simulated=_restitution(lambda e: (e + 1) / 2)),
    Mistake("friction is left out", simulated=_table("floor", friction="none")),
    Mistake("friction grips, whatever the scene says", simulated=_table("floor", friction="infinite")),
    Mistake("friction is 0.5, whatever the scene says", simulated=_table("floor", friction=0.5)),
    Mistake("friction is 1, whatever the scene says", simulated=_table("floor", friction=1.0)),
    Mistake("friction looks squared; an engine that multiplies two bodies' needs 1 for the floor", simulated=_friction(lambda mu: mu**2)),
    Mistake("friction looks halved; an engine that takes the mean of two bodies' needs both", simulated=_friction(lambda mu: mu / 2)),
    Mistake("the body is half as large; a sphere has a radius, a box half extents", simulated=_scaled_size(0.5)),
    Mistake("the body is twice as large; a sphere has a radius, a box half extents", simulated=_scaled_size(2.0)),
)
MISTAKES = (*CONVENTIONS, *FLIGHT, *IMPACT)
