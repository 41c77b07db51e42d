"""The engine `brax`: a free body in one of brax's pipelines, in double precision; scenes that differ in numbers alone compile once."""

import warnings
from collections.abc import Sequence
from contextlib import redirect_stdout
from functools import partial
from io import StringIO
from typing import Any, ClassVar

import jax
import numpy as np
from jax import numpy as jnp

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.base import Array, AsBuilt, BatchSimulation, Engine, OneWorld, Simulation
from dropspin.comparisons.engines.brax_settings import FLIGHT, OF_SHAPES, SETTINGS, description
from dropspin.comparisons.engines.mujoco_simulation import from_world
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.engines.settings import calibrated_values
from dropspin.scenarios import Scenario
from dropspin.scenarios.model import initial_states

# MJX prints that Warp is not installed, which it does not need, and JAXopt warns that it is no longer maintained.
with redirect_stdout(StringIO()), warnings.catch_warnings(action="ignore"):
    from brax.base import Inertia, Transform
    from brax.generalized import pipeline as generalized
    from brax.io import mjcf
    from brax.spring import pipeline as spring

jax.config.update("jax_enable_x64", True)  # for the whole process; each engine has one of its own
PIPELINES = {"spring": spring, "generalized": generalized}
CHUNK = 1000  # states that one call of the compiled function records at most
STRONGEST = 1e6


class Brax(Engine):
    """brax's free body, on a plane where the scene has a floor."""

    name, compiles, order = "brax", True, 1.0
    shapes: ClassVar = ("sphere", "box")
    choices: ClassVar = {"profile": mapping.PROFILES, "pipeline": tuple(PIPELINES)}
    settings: ClassVar = SETTINGS

    def declines(self, scene: Scenario) -> str | None:
        is_soft, floor = self.option("pipeline") == "generalized", scene.floor
        unfit = mapping.refusal_of_damped_axes(scene) if is_soft else None
        if unfit is not None or floor is None or not self.is_calibrated:
            return unfit
        if is_soft:
            return "contacts of brax's pipeline generalized are soft and have no coefficient of restitution"
        if scene.body.shape == "box":
            return "brax's pipeline spring divides an impulse by the number of contacts: a cube that lands flat does not rebound"
        return mapping.refusal_of_rest_speed(scene, "brax")

    def chosen(self, scene: Scenario) -> dict[str, Any]:
        """The settings for a scene; those left out are brax's own."""
        floor, chosen = scene.floor, {} if self.is_default else calibrated_values(SETTINGS)
        if scene.damping is not None:
            chosen |= {"vel_damping": -scene.damping.linear, "ang_damping": -scene.damping.angular}
        if floor is not None:
            for prefix in ("", "floor_"):
                chosen |= {f"{prefix}elasticity": floor.restitution, f"{prefix}friction": min(floor.coefficient, STRONGEST)}
        return chosen | self.given

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return OneWorld(scene, self.prepare_batch([scene], dt))

    def prepare_batch(self, members: Sequence[Scenario], dt: float) -> "Worlds":
        return Worlds(members, dt, self)


class Worlds(BatchSimulation):
    """Worlds of one scene that one program steps together."""

    def __init__(self, members: Sequence[Scenario], dt: float, engine: Brax) -> None:
        self.velocity_lag, self._pipeline, scene = 0.5 * dt, engine.option("pipeline"), members[0]
        with warnings.catch_warnings(action="ignore"):  # brax says that its pipelines are no longer maintained
            system = mjcf.loads(description(scene, dt, engine.chosen(scene)))
        moments, axes = mapping.principal_frame(scene.body.inertia_tensor)
        frame, mass = Transform(pos=np.zeros((1, 3)), rot=np.roll(axes, 1)[None]), np.array([scene.body.mass])
        linear, angular = mapping.decay_rates(scene).values()
        damping = np.repeat([linear * scene.body.mass, angular], 3) * [1.0, 1.0, 1.0, *moments]
        link = system.link.replace(inertia=Inertia(frame, np.diag(moments)[None], mass))
        parts = {"link": link, "dof": system.dof.replace(damping=damping), "mj_model": None}
        self._system = _typed(system.replace(**parts))
        with warnings.catch_warnings(action="ignore"):  # of MJX, about its data that brax reads
            self._state = _typed(_started(self._pipeline, self._system, from_world(initial_states(members))))
            self._run(0, 0)  # compiles
        made = {"version": version("brax"), "jax": jax.__version__, "mujoco-mjx": version("mujoco-mjx")}
        made |= {"device": jax.devices()[0].device_kind} | engine.options_in_force
        names = (name for name in (SETTINGS if scene.floor else FLIGHT) if engine.unmet_need(name) is None)
        self.settings = made | {name: _in_force(self._system, name) for name in names}

    def _run(self, count: int, every: int) -> Array:
        """Take `count` times `every` steps; the states after each `every`, shape (count, size, 13)."""
        self._state, rows = _recorded(self._pipeline, self._system, self._state, count, every)
        return np.asarray(rows[:count], dtype=float)

    def advance(self, steps: int) -> None:
        self._run(1, steps)

    def states(self) -> Array:
        return np.asarray(_world(self._state), dtype=float)

    def record(self, steps: int, every: int = 1) -> Array:
        count, start = steps // every, self.states()
        chunks = [self._run(min(CHUNK, count - done), every) for done in range(0, count, CHUNK)]
        return np.concatenate([start[None], *chunks]).swapaxes(0, 1)

    def as_built(self) -> AsBuilt:
        inertia = self._system.link.inertia
        return mapping.built(inertia.mass[0], np.diag(inertia.i[0]), np.roll(inertia.transform.rot[0], -1), self._system.gravity)


def _in_force(system: Any, name: str) -> Any:
    """The value of a setting in a system, whose shapes are the floor and the body."""
    bare = name.removeprefix("floor_")
    value = getattr(system, OF_SHAPES.get(bare, bare))
    if bare in OF_SHAPES:
        value = value[1 if bare == name else 0]
    return np.asarray(value[0] if bare == "friction" else value).tolist()


def _typed(tree: Any) -> Any:
    """A tree of arrays with the types and the place of those that the compiled function returns, else its second call compiles again."""
    return jax.device_put(jax.tree.map(np.asarray, tree), jax.devices()[0])


@partial(jax.jit, static_argnums=0)
def _started(pipeline: str, system: Any, rows: Any) -> Any:
    return jax.vmap(lambda row: PIPELINES[pipeline].init(system, row[:7], row[7:]))(rows)


def _world(state: Any) -> Any:
    """States in the layout of dropspin, shape (size, 13)."""
    return jnp.concatenate([state.x.pos, jnp.roll(state.x.rot, -1, axis=-1), state.xd.vel, state.xd.ang], axis=-1)[:, 0]


@partial(jax.jit, static_argnums=0)
def _recorded(pipeline: str, system: Any, state: Any, count: Any, every: Any) -> tuple[Any, Any]:
    """The state after `count` times `every` steps, and the states after each `every`, in the first rows of (CHUNK, size, 13)."""
    step = jax.vmap(partial(PIPELINES[pipeline].step, system, act=jnp.zeros(0)))

    def advanced(row: Any, carried: Any) -> Any:
        now = jax.lax.fori_loop(0, every, lambda _, state: step(state), carried[0])
        return now, carried[1].at[row].set(_world(now))

    start = _world(state)
    return jax.lax.fori_loop(0, count, advanced, (state, jnp.zeros((CHUNK, *start.shape), start.dtype)))
