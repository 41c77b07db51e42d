"""The engine `mujoco-warp`: MuJoCo Warp, MuJoCo's algorithms in Warp, with the calibrated contacts of `mujoco`; in single precision.

A step is some forty kernels. Launching them from Python takes 15 ms; captured once and replayed as a graph, a step takes 0.02 ms on a
processor, with the same states.
"""

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
import warp as wp

from dropspin.comparisons.engines.base import Array, AsBuilt, BatchSimulation, KnownLimitation, OneWorld, Simulation
from dropspin.comparisons.engines.mapping import PROFILES, built
from dropspin.comparisons.engines.mujoco_limitations import limitations_met
from dropspin.comparisons.engines.mujoco_ports import Port, ported_model
from dropspin.comparisons.engines.mujoco_simulation import from_world, to_world
from dropspin.comparisons.engines.packages import version
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Vertices
from dropspin.scenarios.model import differ_in_start_alone, initial_states

wp.config.log_level = wp.LOG_ERROR  # before the import that starts Warp, which prints devices and each module that it compiles
import mujoco_warp as mjw  # noqa: E402


class MuJoCoWarp(Port):
    """MuJoCo Warp's free body and, where the scene has a floor, one contact pair."""

    name, precision, mixes_scenes = "mujoco-warp", np.float32, True
    choices: ClassVar = {"profile": PROFILES, "integrator": ("euler", "implicit", "implicitfast", "rk4")}

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return OneWorld(scene, Worlds([scene], dt, self))

    def prepare_batch(self, members: Sequence[Scenario], dt: float) -> BatchSimulation | None:
        if len({member.body.vertices.tobytes() for member in members if isinstance(member.body, Vertices)}) > 1:
            return None  # a model has one mesh
        return Worlds(members, dt, self)


class Worlds(BatchSimulation):
    """Worlds on Warp's default device, with their step as a graph."""

    def __init__(self, members: Sequence[Scenario], dt: float, engine: MuJoCoWarp) -> None:
        self.dt, self.velocity_lag = dt, 0.0 if engine.option("integrator") == "rk4" else 0.5 * dt
        self._is_calibrated = engine.is_calibrated
        model, settings = ported_model(members[0], dt, engine)
        device = wp.get_device()
        self.settings = {"version": version("mujoco-warp"), "warp": wp.config.version, "device": f"{device} ({device.name})"} | settings
        self.model, self._data = mjw.put_model(model), mjw.make_data(model, nworld=len(members))
        if not differ_in_start_alone(members):
            self._give_each_its_own([ported_model(member, dt, engine)[0] for member in members])
        rows = from_world(initial_states(members)).astype(np.float32)
        mjw.step(self.model, self._data)  # compiles; nothing may be loaded while a graph is captured
        with wp.ScopedCapture() as capture:
            mjw.step(self.model, self._data)
        self._graph = capture.graph
        mjw.reset_data(self.model, self._data)
        self._data.qpos.assign(rows[:, :7])
        self._data.qvel.assign(rows[:, 7:])

    def _give_each_its_own(self, models: Sequence[Any]) -> None:
        """Replace arrays of the model whose numbers differ among models by arrays with a row for each world."""
        ported = [mjw.put_model(model) for model in models]
        for owner, parts in ((self.model, ported), (self.model.opt, [model.opt for model in ported])):
            for name, array in vars(owner).items():
                rows = [getattr(part, name).numpy() for part in parts] if isinstance(array, wp.array) else []
                if any(not np.array_equal(rows[0], row) for row in rows):
                    setattr(owner, name, wp.array(np.concatenate(rows), dtype=array.dtype))

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            wp.capture_launch(self._graph)
        wp.synchronize()

    def coordinates(self) -> Array:
        """MuJoCo's coordinates of each world, shape (size, 13)."""
        return np.concatenate([self._data.qpos.numpy(), self._data.qvel.numpy()], axis=1, dtype=float)

    def states(self) -> Array:
        return to_world(self.coordinates())

    def record(self, steps: int, every: int = 1) -> Array:
        rows = [self.coordinates()]
        for _ in range(steps // every):
            self.advance(every)
            rows.append(self.coordinates())
        return to_world(np.concatenate(rows)).reshape(len(rows), -1, 13).swapaxes(0, 1)

    def limitations_of(self, scene: Scenario, states: Array) -> list[KnownLimitation]:
        return list(limitations_met(scene, states, self.dt, estimated=True)) if self._is_calibrated else []

    def as_built(self) -> AsBuilt:
        """The first world."""
        model = self.model
        mass, moments, axes = (part.numpy()[0, 1] for part in (model.body_mass, model.body_inertia, model.body_iquat))
        return built(mass, moments, np.roll(axes, -1), model.opt.gravity.numpy()[0])
