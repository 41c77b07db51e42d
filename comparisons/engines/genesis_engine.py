"""The engine `genesis`: Genesis's rigid body on its default device, in single or double precision.

A free body turns by the implicit midpoint rule under `approximate_implicitfast`. Genesis's coordinates are MuJoCo's.
"""

import logging
from collections.abc import Sequence
from typing import Any, ClassVar

import genesis
import numpy as np

from dropspin.comparisons.engines.base import Array, AsBuilt, BatchSimulation, Engine, OneWorld, Simulation
from dropspin.comparisons.engines.genesis_settings import RIGID, SETTINGS, in_force, set_surfaces
from dropspin.comparisons.engines.mapping import (
    FLOOR_HALF_SIZE,
    PROFILES,
    refusal_of_damped_axes,
    refusal_of_floor,
    refusal_of_rest_speed,
)
from dropspin.comparisons.engines.mujoco_simulation import from_world, to_world
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.engines.settings import calibrated_values
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Sphere
from dropspin.scenarios.model import initial_states

INTEGRATORS = {"approximate_implicitfast": "approximate_implicitfast", "euler": "Euler"}
PRECISIONS = {"float32": "32", "float64": "64"}
LEAST_FRICTION, STICKING = 0.01, 1e4
MATERIAL_FRICTION = 5.0  # the largest that Genesis's materials allow; at 100, with its default pyramid, bodies fall through the floor


class Genesis(Engine):
    """Genesis's rigid body."""

    name, order, compiles = "genesis", 1.0, True
    shapes: ClassVar = ("sphere", "box")
    choices: ClassVar = {"profile": PROFILES, "precision": tuple(PRECISIONS), "integrator": tuple(INTEGRATORS)}
    settings: ClassVar = SETTINGS

    @property
    def precision(self) -> type:  # type: ignore[override]  # it depends on the option
        """Genesis's default is single precision."""
        return np.float64 if self.option("precision") == "float64" else np.float32

    def declines(self, scene: Scenario) -> str | None:
        floor = scene.floor
        unfit = refusal_of_damped_axes(scene) or refusal_of_floor(scene, "plane with edges")
        if unfit is not None or floor is None or not self.is_calibrated:
            return unfit
        if floor.coefficient < LEAST_FRICTION:
            return "Genesis raises a contact's coefficient of friction to 0.01: a body that slides without friction loses 0.098 m/s in 1 s"
        if floor.restitution > 0.0:
            return (
                "the adapter stops a body in one step with a contact's damper; Genesis raises its time constant to 2 dt, with which a ball "
                "that falls 0.5 m does not rebound"
            )
        return refusal_of_rest_speed(scene, "Genesis")

    def chosen(self, scene: Scenario, dt: float) -> dict[str, Any]:
        """The settings for a scene at a time step [s]; those left out are Genesis's own."""
        floor, chosen = scene.floor, dict[str, Any]()
        if floor is None:
            return self.given
        if not self.is_default:
            chosen |= calibrated_values(SETTINGS) | {"constraint_timeconst": 2.0 * dt / self.given.get("substeps", 1)}
        friction = min(floor.coefficient, MATERIAL_FRICTION if self.is_default else STICKING)
        return chosen | {"friction": friction, "floor_friction": friction} | self.given

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return OneWorld(scene, self.prepare_batch([scene], dt))

    def prepare_batch(self, members: Sequence[Scenario], dt: float) -> "Worlds":
        start(self.option("precision"))
        return Worlds(members, dt, self)


def start(precision: str) -> None:
    """Start Genesis in a precision, which is that of the whole process."""
    if genesis.backend is not None and genesis.np_float is not np.dtype(precision).type:
        genesis.destroy()
    if not genesis._initialized:
        genesis.init(precision=PRECISIONS[precision], logging_level=logging.CRITICAL)


class Worlds(BatchSimulation):
    """Worlds of one scene with a body each."""

    def __init__(self, members: Sequence[Scenario], dt: float, engine: Genesis) -> None:
        morphs, options = genesis.morphs, genesis.options
        scene, body, floor = members[0], members[0].body, members[0].floor
        chosen = engine.chosen(scene, dt)
        substeps = chosen.get("substeps", 1)
        self.velocity_lag = 0.5 * dt / substeps
        words = {name: chosen[name] for name in RIGID if name in chosen} | {"integrator": INTEGRATORS[engine.option("integrator")]}
        solver = {name: getattr(getattr(genesis, name), word) if isinstance(word, str) else word for name, word in words.items()}
        rigid = options.RigidOptions(enable_collision=floor is not None, disable_constraint=floor is None, **solver)
        world = options.SimOptions(dt=dt, gravity=tuple(scene.acceleration), substeps=substeps)
        self._scene = genesis.Scene(sim_options=world, rigid_options=rigid, show_viewer=False)
        self._body: Any = self._scene.add_entity(morphs.MJCF(file=description(scene), align=False))
        ground = (
            None if floor is None else self._scene.add_entity(morphs.Plane(normal=(0.0, 1.0, 0.0), plane_size=(2.0 * FLOOR_HALF_SIZE,) * 2))
        )
        self._scene.build(n_envs=len(members))
        self._body.links[0].set_mass(body.mass)
        self._body.links[0].set_inertia(body.inertia_tensor)
        made = {"version": version("genesis-world"), "torch": version("torch"), "quadrants": version("quadrants")}
        self.settings = made | {"device": str(genesis.device), "substeps": self._scene.sim.substeps} | engine.options_in_force
        if ground is not None:
            set_surfaces(self._body.geoms[0], ground.geoms[0], chosen)
            found = in_force(self._scene.rigid_solver, self._body.geoms[0], ground.geoms[0])
            self.settings |= {name: value for name, value in found.items() if engine.unmet_need(name) is None}
        if scene.damping is not None:
            rates = np.repeat([scene.damping.linear, scene.damping.angular], 3)
            self.settings["damping"] = (rates * [*np.full(3, body.mass), *np.diag(body.inertia_tensor)]).tolist()
            self._body.set_dofs_damping(np.array(self.settings["damping"]))
        rows: Array = from_world(initial_states(members)).astype(engine.precision)
        self._body.set_qpos(rows[:, :7])
        self._body.set_dofs_velocity(rows[:, 7:])

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self._scene.step()

    def states(self) -> Array:
        position, velocity = self._body.get_qpos(), self._body.get_dofs_velocity()
        return to_world(np.concatenate([position.cpu().numpy(), velocity.cpu().numpy()], axis=1, dtype=float))

    def as_built(self) -> AsBuilt:
        mass, inertia, gravity = self._body.get_mass(), self._body.get_links_inertia(), self._scene.rigid_solver.get_gravity()
        tensor, first = inertia.cpu().numpy().reshape(3, 3), gravity.cpu().numpy().reshape(-1, 3)[0]
        return AsBuilt(float(mass), tensor.astype(float), first.astype(float))

    def close(self) -> None:
        self._scene.destroy()


def description(scene: Scenario) -> str:
    """A body as MJCF; Genesis's own shapes refuse a moment of inertia that is not that of the shape."""
    body, size = scene.body, "1"  # of a shape that touches nothing
    if scene.floor is not None:
        size = repr(body.radius) if isinstance(body, Sphere) else " ".join(map(repr, body.vertices.max(0).tolist()))
    shape = "sphere" if " " not in size else "box"
    parts = f'<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><geom type="{shape}" size="{size}"/>'  # mass and inertia are set later
    return f'<mujoco><worldbody><body name="body"><freejoint/>{parts}</body></worldbody></mujoco>'
