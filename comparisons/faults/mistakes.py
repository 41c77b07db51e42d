"""Mistakes in the equations of flight, which no change of a scene gives: their motions, integrated numerically.

    x' = v,  v' = g - k v,  q' = 1/2 (ω, 0) q,  ω' = I⁻¹ (I ω × ω) - κ ω,  I = R I_body Rᵀ

Each mistake replaces a part of these equations. One of the rotation is made with the gyroscopic term, and without it, as in Wang's method.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from dropspin.scenarios import Scenario
from dropspin.scenarios.rotations import cross, multiply, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY, Array

NOT_ROTATED = "the inertia is not rotated into the world frame: there it is R I Rᵀ, and its inverse R I⁻¹ Rᵀ"
ROTATED_BACK = "the inertia is rotated in the wrong direction: in the world frame it is R I Rᵀ, not Rᵀ I R"
NOT_INVERTED = "the inverse of the inertia is not taken: a torque changes the angular velocity by I⁻¹ times it"
ORDER = "the quaternion product is taken in the wrong order: with the angular velocity in the world frame, q' = 1/2 (ω, 0) q"
SQUARE = "the square of the speed is used in place of the speed"
ACCURACY = 1e-9
FARTHEST = 100.0  # rad


def _gyroscopic(q: Array, w: Array, inertia: Array) -> Array:
    return rotate(q, _not_rotated(q, unrotate(q, w), inertia))


def _not_rotated(q: Array, w: Array, inertia: Array) -> Array:
    return np.asarray(np.linalg.solve(inertia, cross(inertia @ w, w)))


def _not_inverted(q: Array, w: Array, inertia: Array) -> Array:
    spin = unrotate(q, w)
    return rotate(q, inertia @ cross(inertia @ spin, spin))


@dataclass(frozen=True)
class Mistake:
    """One mistake.

    Attributes:
        message: The mistake, and what is right.
        acceleration: Function of orientation, angular velocity and inertia that returns the angular acceleration.
        swapped: Whether the factors of the quaternion product are swapped.
        turning: Factor by which the orientation turns too fast; None for the angular speed itself.
        squares: Whether damping is too strong by the speed, of the velocity and of the angular velocity.
        is_peculiarity: Never, as in a `FaultModel` of an adapter.
    """

    message: str
    acceleration: Callable[[Array, Array, Array], Array] = _gyroscopic
    swapped: bool = False
    turning: float | None = 1.0
    squares: tuple[bool, bool] = (False, False)
    is_peculiarity: ClassVar[bool] = False

    def motion(self, scene: Scenario, times: Array) -> Array | None:
        """The states of a scene with this mistake at some times [s], shape (n, 13).

        None with a floor, if the body turns too often, and for a mistake of damping without damping, as it then is none.
        """
        spin = float(np.linalg.norm(scene.start.angular_velocity))
        if scene.damping is None and any(self.squares):
            return None
        if scene.floor is not None or (self.turning or spin) * spin * times[-1] > FARTHEST:
            return None
        return _integrated(self, scene, tuple(times.tolist()))

    def rates(self, scene: Scenario, state: Array) -> Array:
        """The rates of change of a state, shape (13,)."""
        q, v, w = state[ORIENTATION], state[VELOCITY], state[SPIN]
        linear, angular = (scene.damping.linear, scene.damping.angular) if scene.damping else (0.0, 0.0)
        factors = [float(np.linalg.norm(rate)) if square else 1.0 for rate, square in zip((v, w), self.squares, strict=True)]
        turning = float(np.linalg.norm(w)) if self.turning is None else self.turning
        change, spin = np.empty(13), np.append(0.5 * turning * w, 0.0)
        change[POSITION], change[VELOCITY] = v, scene.acceleration - linear * factors[0] * v
        change[ORIENTATION] = multiply(q, spin) if self.swapped else multiply(spin, q)
        unit = q / np.linalg.norm(q)
        change[SPIN] = self.acceleration(unit, w, scene.body.inertia_tensor) - angular * factors[1] * w
        return change


@lru_cache(maxsize=1024)
def _integrated(mistake: Mistake, scene: Scenario, times: tuple[float, ...]) -> Array:
    from scipy.integrate import solve_ivp

    rates, span = lambda _, state: mistake.rates(scene, state), (0.0, times[-1])
    states = solve_ivp(rates, span, scene.initial_state, "DOP853", times, rtol=ACCURACY, atol=ACCURACY).y.T
    states[:, ORIENTATION] /= np.linalg.norm(states[:, ORIENTATION], axis=1, keepdims=True)
    return np.asarray(states)


MISTAKES = (
    *(
        mistake
        for torque in (lambda *_: np.zeros(3), _gyroscopic)
        for mistake in (
            Mistake(ORDER, torque, swapped=True),
            Mistake(f"{SQUARE}: a step turns the body by |ω| dt about ω", torque, turning=None),
            Mistake("the body turns twice as fast as its angular velocity says: q' = 1/2 (ω, 0) q", torque, turning=2.0),
            Mistake("the body turns half as fast as its angular velocity says: q' = 1/2 (ω, 0) q", torque, turning=0.5),
            Mistake(f"{SQUARE}: damping is in proportion to the velocity", torque, squares=(True, False)),
            Mistake(f"{SQUARE}: damping is in proportion to the angular velocity", torque, squares=(False, True)),
            Mistake(f"{SQUARE}: damping is in proportion to the velocity, and to the angular velocity", torque, squares=(True, True)),
        )
    ),
    Mistake(NOT_ROTATED, _not_rotated),
    Mistake(ROTATED_BACK, lambda q, w, inertia: unrotate(q, _not_rotated(q, rotate(q, w), inertia))),
    Mistake(NOT_INVERTED, _not_inverted),
    Mistake("the gyroscopic term has the opposite sign: ω' = I⁻¹ (I ω × ω) without torque", lambda *args: -_gyroscopic(*args)),
)
