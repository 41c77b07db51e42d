"""Sound engines whose accuracy is not set by the time step alone: an adaptive integrator, an inner step of fixed length, sub-steps."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.integrate import solve_ivp

from dropspin.comparisons.engines.base import Engine, Simulation
from dropspin.comparisons.engines.options import NumericOption
from dropspin.comparisons.engines.wang import Wang
from dropspin.scenarios.rotations import cross, multiply, rotate, unrotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY

LEAST_REBOUND = 1e-6
"""Rebounds below this speed [m/s] end on the floor."""


class AdaptiveSimulation(Simulation):
    """The equations of motion, solved between impacts by a Runge–Kutta method of order 5(4) with an error estimate."""

    settings: ClassVar = {"version": "1"}

    def __init__(self, scene, dt, rtol, restitution):
        self._scene, self._dt, self._rtol, self._restitution = scene, dt, rtol, restitution
        self._state, self._resting = scene.initial_state, False
        self._inertia, self._inverse = scene.body.inertia_tensor, np.linalg.inv(scene.body.inertia_tensor)

    def advance(self, steps):
        self.record(steps, max(steps, 1))

    def state(self):
        return self._state.copy()

    def record(self, steps, every=1):
        times = self._dt * every * np.arange(1 + steps // every)
        rows, now = np.tile(self._state, (len(times), 1)), 0.0
        y = self._state.copy()
        y[SPIN] = unrotate(y[ORIENTATION], y[SPIN])
        landing = self._landing()
        while now < times[-1] and not self._resting:
            solved = solve_ivp(
                self._rates, (now, times[-1]), y, "RK45", dense_output=True, events=landing, rtol=self._rtol, atol=1e-3 * self._rtol
            )
            end = solved.t[-1]
            here = (times >= now) & (times <= end) & (times > 0.0)
            if here.any():
                rows[here] = self._in_world(solved.sol(times[here]).T)
            y, now = solved.y[:, -1].copy(), end
            if solved.status == 1:
                y[VELOCITY][1] *= -self._restitution
                if abs(y[8]) < LEAST_REBOUND:
                    self._resting, y[8] = True, 0.0
                    rows[times > now] = self._in_world(y[None])[0]
        self._state = rows[-1].copy()
        return rows

    def _landing(self):
        floor = self._scene.floor
        if floor is None:
            return None

        def height(t, y):
            return y[1] - self._scene.body.radius

        height.terminal, height.direction = True, -1
        return height

    def _rates(self, t, y):
        damping = self._scene.damping
        k, kappa = (damping.linear, damping.angular) if damping else (0.0, 0.0)
        turning = 0.5 * multiply(y[ORIENTATION], np.array([*y[SPIN], 0.0]))
        torque = self._inverse @ cross(self._inertia @ y[SPIN], y[SPIN])
        return np.concatenate([y[VELOCITY], turning, self._scene.acceleration - k * y[VELOCITY], torque - kappa * y[SPIN]])

    @staticmethod
    def _in_world(y):
        q = y[:, ORIENTATION] / np.linalg.norm(y[:, ORIENTATION], axis=1, keepdims=True)
        return np.hstack([y[:, POSITION], q, y[:, VELOCITY], rotate(q, y[:, SPIN])])


class Adaptive(Engine):
    """An adaptive Runge–Kutta integrator; balls on frictionless floors."""

    name = "adaptive"
    numbers: ClassVar = {"rtol": NumericOption(1e-6, 1e-13, 1e-2)}
    accuracy: ClassVar = {"rtol": (1e-4, 1e-6, 1e-8)}
    restitution_factor = 1.0

    def declines(self, scene):
        if scene.floor is not None and (scene.body.shape != "sphere" or scene.floor.friction != "none"):
            return "only balls on frictionless floors"
        return None

    def prepare(self, scene, dt):
        restitution = self.restitution_factor * scene.floor.restitution if scene.floor else 0.0
        return AdaptiveSimulation(scene, dt, float(self.option("rtol")), restitution)


class Substepped(Simulation):
    """A simulation that takes several steps for one."""

    def __init__(self, inner, substeps):
        self._inner, self._substeps, self.velocity_lag, self.settings = inner, substeps, inner.velocity_lag, inner.settings

    def advance(self, steps):
        self._inner.advance(self._substeps * steps)

    def state(self):
        return self._inner.state()

    def record(self, steps, every=1):
        return self._inner.record(self._substeps * steps, self._substeps * every)


@dataclass(frozen=True)
class Substeps(Wang):
    """A fixed number of sub-steps a step, by methods without a model error in scenes that do not need an exact impact."""

    name = "substeps"
    choices: ClassVar = {"rotation": ("rk4",), "law": ("coulomb",), "contact": ("sequential",)}
    numbers: ClassVar = {"substeps": NumericOption(8, 1, 64)}
    restitution_factor = 1.0

    def discretisation(self, scene):
        return None

    def predicted_error(self, scene, truth, metric, dt):
        return None

    def substeps(self, dt):
        return int(self.option("substeps"))

    def prepare(self, scene, dt):
        if scene.floor is not None and self.restitution_factor != 1.0:
            floor = scene.floor.model_copy(update={"restitution": self.restitution_factor * scene.floor.restitution})
            scene = scene.model_copy(update={"floor": floor})
        substeps = self.substeps(dt)
        return Substepped(super().prepare(scene, dt / substeps), substeps)

    def prepare_batch(self, members, dt):
        return None


@dataclass(frozen=True)
class InnerStep(Substeps):
    """Wang's method with steps of at most 1/960 s, whatever the step that is asked for."""

    name = "inner-step"
    numbers: ClassVar = {"inner_step": NumericOption(1 / 960, 1e-5, 1.0)}
    accuracy: ClassVar = {"inner_step": (1 / 240, 1 / 480, 1 / 960)}

    def substeps(self, dt):
        return max(1, int(np.ceil(dt / float(self.option("inner_step")) - 1e-9)))
