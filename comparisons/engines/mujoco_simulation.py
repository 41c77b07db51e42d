"""Simulations with MuJoCo, of one start and of many: states in the project's order and frame, errors raised, limitations reported."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import mujoco
import numpy as np
from mujoco import rollout

from dropspin.comparisons.engines.base import Array, AsBuilt, BatchSimulation, Diverged, KnownLimitation, Simulation
from dropspin.comparisons.engines.mapping import built, principal_frame
from dropspin.comparisons.engines.mujoco_limitations import limitations_met
from dropspin.comparisons.engines.mujoco_model import damped_axes
from dropspin.comparisons.engines.mujoco_settings import in_force, set_in
from dropspin.reference_impl.threads import usable_cores
from dropspin.scenarios import Scenario
from dropspin.scenarios.model import initial_states
from dropspin.scenarios.rotations import conjugate, multiply, rotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY
from dropspin.scenarios.variations import heavy_neighbour

FULL_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS
BAD_STATE = (mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL, mujoco.mjtWarning.mjWARN_BADQACC)
CHUNK = 8192
"""Number of states that a thread records at once: 0.9 MB, which fits a processor's cache."""


class MuJoCoSimulation(Simulation):
    """A compiled model and its data.

    Attributes:
        model: The model.
        axes: The axes of the free body in the frame of the scene's body, a quaternion; None where they are the same (`damped_axes`).
    """

    def __init__(self, scene: Scenario, specification: Any, settings: Mapping[str, Any], given: Mapping[str, Any]) -> None:
        """Compile a specification, and set the settings that were given in the model."""
        self._scene = scene
        self.model = specification.compile()
        self.axes = damped_axes(scene)
        self.velocity_lag = 0.0 if settings["integrator"] == "rk4" else 0.5 * self.model.opt.timestep
        set_damping(self.model, scene)
        set_in(self.model, given)
        of_model = in_force(self.model, len(scene.surfaces) - 1)
        self.settings = {"version": mujoco.__version__, **settings, "autoreset": "disable", **of_model}
        self._is_calibrated = settings["profile"] == "calibrated" and not given
        self._data = mujoco.MjData(self.model)
        start = _starts(self.model, [scene])[0]
        self._data.qpos[:], self._data.qvel[:] = np.split(start, [self.model.nq])
        self._steps = 0

    def advance(self, steps: int) -> None:
        with quiet():
            mujoco.mj_step(self.model, self._data, steps)
        self._steps += steps
        _raise_if_bad([self._data], f"within the first {self._steps} steps")

    def state(self) -> Array:
        return to_world(np.concatenate([self._data.qpos[:7], self._data.qvel[:6]])[None], self.axes)[0]

    def record(self, steps: int, every: int = 1) -> Array:
        with quiet():
            rows = self._each_step(steps) if every == 1 and steps else self._some_steps(steps, every)
        _raise_if_bad([self._data], f"in step {self._steps + _last_good_row(rows) * every + 1}")
        self._steps += (len(rows) - 1) * every
        states = to_world(rows, self.axes)
        self.known_limitations = self.limitations_of(self._scene, states) if every == 1 else []
        return states

    def limitations_of(self, scene: Scenario, states: Array) -> list[KnownLimitation]:
        """The limitations that a motion met, given its states after each step, shape (n, 13)."""
        return list(limitations_met(scene, states, self.model.opt.timestep)) if self._is_calibrated else []

    def _each_step(self, steps: int) -> Array:
        """Record with MuJoCo's rollout, which takes a fifth to a quarter less time than a Python loop and gives the same bits."""
        now = full_state(self.model, self._data)
        warm = self._data.qacc_warmstart.copy()
        states, _ = rollout.rollout(self.model, self._data, now, nstep=steps, initial_warmstart=warm)
        return np.vstack([now, states[0]])[:, _columns(self.model)]

    def _some_steps(self, steps: int, every: int) -> Array:
        rows, data = np.empty((1 + steps // every, 13)), self._data
        for number, row in enumerate(rows):
            if number:
                mujoco.mj_step(self.model, data, every)
            row[:7], row[7:] = data.qpos[:7], data.qvel[:6]
        return rows

    def as_built(self) -> AsBuilt:
        model, body = self.model, int(np.argmax(self.model.body_mass > 0.0))  # the free body, or its child
        return built(model.body_mass[body], model.body_inertia[body], np.roll(model.body_iquat[body], -1), model.opt.gravity)


class MuJoCoBatch(BatchSimulation):
    """Worlds that MuJoCo's rollout steps together, in threads.

    The rollout records the full state of every world after every step. All of them at once do not fit a processor's cache, so the worlds
    are stepped in chunks, and the thread that stepped a chunk converts it; the motions are the same, bit for bit.
    """

    def __init__(self, first: MuJoCoSimulation, models: Sequence[Any], members: Sequence[Scenario]) -> None:
        """Worlds of models, which have the sizes of the first."""
        self.velocity_lag = first.velocity_lag
        self._first, self._models = first, models
        model, data = first.model, first._data
        self._columns = _columns(model)
        self._datas = [data, *(mujoco.MjData(model) for _ in range(usable_cores() - 1))]
        self._now = np.empty((len(members), mujoco.mj_stateSize(model, FULL_STATE)))
        self._now[:] = full_state(model, data)
        self._now[:, 1 : 1 + model.nq + model.nv] = _starts(model, members)

    def advance(self, steps: int) -> None:
        self._roll_out(steps, lambda worlds, states: None)

    def states(self) -> Array:
        return to_world(self._now[:, self._columns], self._first.axes)

    def record(self, steps: int, every: int = 1) -> Array:
        rows = np.empty((len(self._now), 1 + steps // every, 13))
        rows[:, 0] = self.states()

        def keep(worlds: slice, states: Array) -> None:
            rows[worlds, 1:] = to_world(states[:, every - 1 :: every, self._columns], self._first.axes)

        self._roll_out(steps, keep)
        return rows

    def limitations_of(self, scene: Scenario, states: Array) -> list[KnownLimitation]:
        return self._first.limitations_of(scene, states)

    def _roll_out(self, steps: int, keep: Callable[[slice, Array], None]) -> None:
        """Step all worlds; `keep` gets the full states of a chunk of worlds after each step, shape (worlds, steps, n)."""
        if not steps:
            return
        size, threads = len(self._now), len(self._datas)
        each = min(max(1, CHUNK // steps), -(-size // threads))

        def run(first: int) -> None:
            worlds, data = slice(first, first + each), self._datas.pop()
            states, _ = rollout.rollout(self._models[worlds], data, self._now[worlds], nstep=steps)
            keep(worlds, states)
            self._now[worlds] = states[:, -1]
            self._datas.append(data)

        with quiet(), ThreadPoolExecutor(threads) as pool:
            list(pool.map(run, range(0, size, each)))
        _raise_if_bad(self._datas, f"within {steps} steps of a batch")


def _starts(model: Any, scenes: Sequence[Scenario]) -> Array:
    """The positions of the free body and of the body far away if there is one, followed by their velocities, of each scene at the start."""
    bodies = [scenes]
    if model.nq > 7:
        bodies.append([heavy_neighbour(scene) for scene in scenes])
    starts = [from_world(initial_states(one), damped_axes(scenes[0])) for one in bodies]
    return np.concatenate([start[:, :7] for start in starts] + [start[:, 7:] for start in starts], axis=1)


def _columns(model: Any) -> Any:
    """Where a full state, which begins with the time, has the position, the quaternion and the velocities of the scene's body."""
    return np.r_[1:8, 1 + model.nq : 7 + model.nq]


def full_state(model: Any, data: Any) -> Array:
    """The state in the layout of MuJoCo's rollout."""
    now = np.empty(mujoco.mj_stateSize(model, FULL_STATE))
    mujoco.mj_getState(model, data, now, FULL_STATE)
    return now


def _raise_if_bad(datas: Sequence[Any], when: str) -> None:
    for kind in BAD_STATE:
        if any(data.warning[kind].number > 0 for data in datas):
            raise Diverged(f"MuJoCo's {kind.name} (a number is NaN or exceeds {mujoco.mjMAXVAL:g}) {when}")


def _last_good_row(rows: Array) -> int:
    """The last row before a number exceeds MuJoCo's limit, or before its recording stops and repeats the last state."""
    bad = ~(np.abs(rows) < mujoco.mjMAXVAL).all(axis=1) | (rows == rows[-1]).all(axis=1)
    return max(0, int(np.argmax(bad)) - 1)


def set_damping(model: Any, scene: Scenario) -> None:
    """Give each body of a compiled model the scene's damping.

    All integrators but RK4 divide a velocity by 1 + d dt for a damper d; the d of factors of a step is such that it is the scene's decay.
    """
    if scene.damping is not None:
        linear, angular = scene.damping.rates.values()
        if scene.damping.factors and model.opt.integrator != mujoco.mjtIntegrator.mjINT_RK4:
            linear, angular = np.expm1(model.opt.timestep * np.array([linear, angular])) / model.opt.timestep
        rates = np.repeat([linear * scene.body.mass, angular], 3)
        rates[3:] *= principal_frame(scene.body.inertia_tensor)[0]
        model.dof_damping[:] = np.outer(model.body_mass[model.body_mass > 0.0] / scene.body.mass, rates).ravel()


def from_world(states: Array, axes: Array | None = None) -> Array:
    """MuJoCo's coordinates, [position, quaternion w x y z, velocity, angular velocity in the body frame], of states, shape (..., 13).

    With `axes`, the body frame is that of these axes in the frame of the scene's body.
    """
    orientation = states[..., ORIENTATION] if axes is None else multiply(states[..., ORIENTATION], axes)
    spins = rotate(conjugate(orientation), states[..., SPIN])
    return np.concatenate([states[..., POSITION], orientation[..., [3, 0, 1, 2]], states[..., VELOCITY], spins], axis=-1)


def to_world(rows: Array, axes: Array | None = None) -> Array:
    """States from MuJoCo's coordinates, as `from_world` returns them, shape (..., 13)."""
    states = np.empty_like(rows)
    states[..., POSITION] = rows[..., 0:3]
    states[..., 3:6] = rows[..., 4:7]
    states[..., 6] = rows[..., 3]
    states[..., VELOCITY] = rows[..., 7:10]
    states[..., SPIN] = rotate(states[..., ORIENTATION], rows[..., 10:13])
    if axes is not None:
        states[..., ORIENTATION] = multiply(states[..., ORIENTATION], conjugate(axes))
    return states


@contextmanager
def quiet() -> Iterator[None]:
    """Discard MuJoCo's warnings, which it else appends to a file in the working directory; its warning counters are read instead."""
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(None)
