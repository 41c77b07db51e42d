"""The engine `mjx`: MJX, MuJoCo's algorithms in JAX, with the calibrated contacts of `mujoco`; compiled for each kind of scene.

Models are arguments of the compiled functions, not constants in them: scenes that differ in numbers alone, such as sizes, time steps and
starts, share one compilation.
"""

from collections.abc import Sequence
from contextlib import redirect_stdout
from io import StringIO
from typing import Any, ClassVar

import jax
import numpy as np
from jax import numpy as jnp

from dropspin.comparisons.engines.base import Array, AsBuilt, BatchSimulation, KnownLimitation, Simulation
from dropspin.comparisons.engines.mapping import PROFILES, built
from dropspin.comparisons.engines.mujoco_engine import MuJoCo, flight_of
from dropspin.comparisons.engines.mujoco_limitations import limitations_met
from dropspin.comparisons.engines.mujoco_ports import SETTINGS, Port, ported_model
from dropspin.comparisons.engines.mujoco_simulation import from_world, to_world
from dropspin.comparisons.engines.packages import numbers_of, version
from dropspin.scenarios import Scenario
from dropspin.scenarios.model import differ_in_start_alone, initial_states

with redirect_stdout(StringIO()):  # it prints that Warp is not installed, which it does not need
    from mujoco import mjx

CHUNK = 1000
"""States that one call of the compiled function records at most."""


class MJX(Port):
    """MJX's free body and, where the scene has a floor, one contact pair."""

    name, mixes_scenes = "mjx", True
    choices: ClassVar = {"profile": PROFILES, "precision": ("float32", "float64"), "integrator": ("euler", "implicitfast", "rk4")}

    @property
    def precision(self) -> type:  # type: ignore[override]  # it depends on the option
        """JAX's default is single precision."""
        return np.float64 if self.option("precision") == "float64" else np.float32

    def discretisation(self, scene: Scenario) -> str | None:
        """MuJoCo's, but the gyroscopic term is explicit in `implicitfast` too, and RK4's rotations are those of MuJoCo before 4.0."""
        if self.option("integrator") == "rk4":
            return flight_of("rk4", numbers_of(version("mujoco-mjx"))) if self.is_calibrated else None
        return MuJoCo({name: text for name, text in self.options.items() if name in ("profile", *SETTINGS)}).discretisation(scene)

    def declines(self, scene: Scenario) -> str | None:
        recomputed = self.option("integrator") == "implicitfast" or scene.damping is not None
        if scene.floor is not None and recomputed and self.precision is np.float32 and not self.is_default:
            return (
                "with damping or implicitfast, MJX computes accelerations from contact forces, whose rounding errors in single precision "
                "change a rebound by up to 2e-3; use precision=float64"
            )
        return super().declines(scene)

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return MJXSimulation(scene, dt, self)

    def prepare_batch(self, members: Sequence[Scenario], dt: float) -> BatchSimulation:
        models = members[:1] if differ_in_start_alone(members) else members
        return MJXBatch([MJXSimulation(member, dt, self) for member in models], members)


class MJXSimulation(Simulation):
    """A model and its data on JAX's default device."""

    def __init__(self, scene: Scenario, dt: float, engine: MJX) -> None:
        jax.config.update("jax_enable_x64", engine.precision is np.float64)  # for the whole process; each engine has one of its own
        self.velocity_lag = 0.0 if engine.option("integrator") == "rk4" else 0.5 * dt
        self._scene, self._dt, self._is_calibrated = scene, dt, engine.is_calibrated
        model, settings = ported_model(scene, dt, engine)
        self.model = mjx.put_model(model)
        # The radii are a constant of the compiled functions, which use them for height fields alone.
        radii = "_impl.geom_rbound_hfield" if hasattr(self.model, "_impl") else "geom_rbound_hfield"  # up to MJX 3.3.2
        self.model = self.model.tree_replace({radii: np.zeros(model.ngeom)})
        device = jax.devices()[0]
        row = jax.device_put(from_world(scene.initial_state), device)  # placed as results are, else the second call compiles again
        self.data = mjx.make_data(self.model).replace(qpos=row[:7], qvel=row[7:])
        name = f"{device.platform} ({device.device_kind})"
        self.settings = {"version": version("mujoco-mjx"), "jax": jax.__version__, "device": name} | settings

    def advance(self, steps: int) -> None:
        self.data, _ = _recorded(self.model, self.data, 1, steps)
        self.data.qpos.block_until_ready()

    def state(self) -> Array:
        return to_world(np.concatenate([self.data.qpos, self.data.qvel], dtype=float)[None])[0]

    def record(self, steps: int, every: int = 1) -> Array:
        found, left = [self.state()[None]], steps // every
        while left:
            self.data, rows = _recorded(self.model, self.data, min(left, CHUNK), every)
            found.append(to_world(np.asarray(rows[: min(left, CHUNK)], dtype=float)))
            left -= min(left, CHUNK)
        states = np.concatenate(found)
        self.known_limitations = self.limitations_of(self._scene, states) if every == 1 else []
        return states

    def limitations_of(self, scene: Scenario, states: Array) -> list[KnownLimitation]:
        """The limitations that a motion met, given its states after each step, shape (n, 13)."""
        return list(limitations_met(scene, states, self._dt, estimated=True)) if self._is_calibrated else []

    def as_built(self) -> AsBuilt:
        model = self.model
        return built(model.body_mass[1], model.body_inertia[1], np.roll(model.body_iquat[1], -1), model.opt.gravity)


class MJXBatch(BatchSimulation):
    """Worlds that one vectorised program steps together."""

    def __init__(self, alone: Sequence[MJXSimulation], members: Sequence[Scenario]) -> None:
        """Worlds with one model, or with as many models as there are members."""
        self._first = first = alone[0]
        self.velocity_lag, self._is_mixed = first.velocity_lag, len(alone) > 1
        self._model = jax.tree.map(lambda *rows: jnp.stack(rows), *(one.model for one in alone)) if self._is_mixed else first.model
        rows = jax.device_put(from_world(initial_states(members)), jax.devices()[0])
        self._data = jax.vmap(lambda row: first.data.replace(qpos=row[:7], qvel=row[7:]))(rows)

    def advance(self, steps: int) -> None:
        self._data = (_advanced_mixed if self._is_mixed else _advanced_together)(self._model, self._data, steps)
        self._data.qpos.block_until_ready()

    def limitations_of(self, scene: Scenario, states: Array) -> list[KnownLimitation]:
        return self._first.limitations_of(scene, states)

    def states(self) -> Array:
        return to_world(np.concatenate([self._data.qpos, self._data.qvel], axis=1, dtype=float))


def _advanced(model: Any, data: Any, steps: Any) -> Any:
    return jax.lax.fori_loop(0, steps, lambda _, now: mjx.step(model, now), data)


_advanced_together, _advanced_mixed = (jax.jit(jax.vmap(_advanced, in_axes=(axis, 0, None))) for axis in (None, 0))


def _recording(model: Any, data: Any, count: Any, every: Any) -> tuple[Any, Any]:
    """The data after `count` times `every` steps, and the coordinates after each `every`, in the first rows of an array (CHUNK, 13)."""

    def step(row: Any, found: Any) -> Any:
        now = _advanced(model, found[0], every)
        return now, found[1].at[row].set(jnp.concatenate([now.qpos, now.qvel]))

    return jax.lax.fori_loop(0, count, step, (data, jnp.zeros((CHUNK, 13))))


_recorded = jax.jit(_recording)
