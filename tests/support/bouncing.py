"""A ball in exact flight, whose impacts follow any law: planted faults of contact that no change of the scene expresses."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dropspin.comparisons.engines.base import Engine
from dropspin.scenarios import Scenario
from dropspin.scenarios.rotations import about, multiply
from support.sampled import Sampled, undistorted

Array = np.ndarray
Law = Callable[[Scenario, Array, float, int], tuple[float, Array]]
"""From the scene, the slip [m/s], shape (2,), the impact speed [m/s] and the number of earlier impacts: the coefficient of restitution,
and the impulse of friction over the mass [m/s], shape (2,)."""
AT_REST = 1e-6  # m/s


def sticking(scene: Scenario, slip: Array) -> Array:
    """The impulse of friction over the mass that ends the slip of a ball."""
    body = scene.body
    return -slip / (1.0 + body.mass * body.radius**2 / body.inertia_tensor[0, 0])


def coulomb(scene: Scenario, slip: Array, speed: float, number: int, factor: float = 1.0) -> tuple[float, Array]:
    """The law of the exact solution, or with the coefficient times a factor."""
    e, needed = scene.floor.restitution, sticking(scene, slip)
    most, size = factor * scene.floor.coefficient * (1.0 + e) * speed, np.linalg.norm(needed)
    return e, needed if size <= most else needed * (most / size)


def pyramid(scene: Scenario, slip: Array, speed: float, number: int) -> tuple[float, Array]:
    """Friction of each horizontal axis alone."""
    e, needed = scene.floor.restitution, sticking(scene, slip)
    most = scene.floor.coefficient * (1.0 + e) * speed
    return e, np.clip(needed, -most, most)


@dataclass(frozen=True)
class Bouncing(Engine):
    """Balls on a level floor without damping, each impact by a law; scenes without a floor are exact."""

    title: str = "exact ball"
    law: Law = coulomb

    name = "bouncing"

    @property
    def label(self):
        return self.title

    def declines(self, scene):
        if scene.floor is None:
            return None
        fits = scene.body.shape == "sphere" and scene.damping is None and not scene.acceleration[[0, 2]].any() and scene.starts_above_floor
        return None if fits else "only balls that fall on a level floor"

    def prepare(self, scene, dt):
        if scene.floor is None:
            return Sampled(scene, dt, scene, undistorted)
        return Sampled(scene, dt, scene, lambda rows, times, dt, truth: bounced(scene, self.law, times))


def bounced(scene: Scenario, law: Law, times: Array) -> Array:
    """The states of a ball at some times [s], shape (n, 13)."""
    g, radius, state = -scene.acceleration[1], scene.body.radius, scene.initial_state
    rows, now, number, moves = np.tile(state, (len(times), 1)), 0.0, 0, True
    while True:
        here = times >= now
        since = (times[here] - now)[:, None]
        gravity = scene.acceleration if moves else np.zeros(3)
        rows[here, 0:3] = state[0:3] + since * state[7:10] + 0.5 * since**2 * gravity
        rows[here, 7:10], rows[here, 10:13] = state[7:10] + since * gravity, state[10:13]
        rows[here, 3:7] = _turned(state, since)
        fall = state[1] - radius
        wait = (state[8] + np.sqrt(state[8] ** 2 + 2.0 * g * max(fall, 0.0))) / g if moves else np.inf
        now += wait
        if now > times[-1]:
            return rows
        state = np.concatenate([state[0:3] + wait * state[7:10], _turned(state, np.array([[wait]]))[0], state[7:10], state[10:13]])
        state[1], state[8] = radius, state[8] - g * wait
        speed = -state[8]
        slip = np.array([state[7] + radius * state[12], state[9] - radius * state[10]])
        e, impulse = law(scene, slip, speed, number)
        state[8] = e * speed
        state[[7, 9]] += impulse
        turning = scene.body.mass * radius / scene.body.inertia_tensor[0, 0]
        state[12] += turning * impulse[0]
        state[10] -= turning * impulse[1]
        number += 1
        moves = e * speed > AT_REST
        state[8] *= moves


def _turned(state: Array, since: Array) -> Array:
    speed = np.linalg.norm(state[10:13])
    axis = state[10:13] / speed if speed else np.array([0.0, 1.0, 0.0])
    return multiply(about(axis, since[:, 0] * speed), state[3:7])


def with_restitution(function: Callable[[float, float], float]) -> Law:
    """Impacts whose restitution is a function of the scene's and of the impact speed [m/s]."""

    def law(scene: Scenario, slip: Array, speed: float, number: int) -> tuple[float, Array]:
        floor = scene.floor.model_copy(update={"restitution": function(scene.floor.restitution, speed)})
        return coulomb(scene.model_copy(update={"floor": floor}), slip, speed, number)

    return law
