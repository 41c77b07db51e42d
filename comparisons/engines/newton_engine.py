"""The engine `newton`: Newton's rigid body with one of its solvers, over a ground plane; in single precision.

Of these solvers XPBD alone has restitution; it acts on the velocity after gravity, hence v+ = e (u + g dt). Contacts of the others have
stiffness and damping.
"""

from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from typing import Any, ClassVar

import numpy as np
import warp as wp

from dropspin.comparisons.engines.base import Array, AsBuilt, BatchSimulation, Engine, KnownLimitation, OneWorld, Simulation
from dropspin.comparisons.engines.mapping import PROFILES, friction_of, refusal_of_rest_speed
from dropspin.comparisons.engines.newton_settings import SETTINGS, SHAPE, STICKING, settings_of
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.engines.settings import Setting, calibrated_values
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Box, Sphere
from dropspin.scenarios.model import differ_in_start_alone, initial_states
from dropspin.scenarios.rotations import length
from dropspin.scenarios.state import SPIN, VELOCITY

wp.config.log_level = wp.LOG_ERROR  # before the import that starts Warp, which prints devices and each module that it compiles
import newton  # noqa: E402

SOLVERS = {"xpbd": "SolverXPBD", "semi-implicit": "SolverSemiImplicit", "featherstone": "SolverFeatherstone", "mujoco": "SolverMuJoCo"}
SPIN_GAINED = 3e-7
"""Share of ω in a step, at most; measured 1.9e-7 to 2.4e-7 with steps of 10 to 0.25 ms, about a principal axis."""
TORQUE = 3.6e-7
"""Three ulp, times m v²: the torque that rounding gives a body of the speed v; measured 0.5 to 1 ulp."""
ENERGIES = ("energy_error", "energy_gain", "energy_drift")


class Newton(Engine):
    """Newton's rigid body."""

    name, order, compiles, precision, mixes_scenes = "newton", 1.0, True, np.float32, True
    shapes: ClassVar = ("sphere", "box")
    choices: ClassVar = {"solver": tuple(SOLVERS), "profile": PROFILES}

    @property
    def settings(self) -> Mapping[str, Setting]:  # type: ignore[override]  # they depend on the option
        """The settings of the solver, and those that need another one."""
        return settings_of(self.options.get("solver", "xpbd"))

    def declines(self, scene: Scenario) -> str | None:
        solver, floor = self.option("solver"), scene.floor
        if solver == "mujoco" and find_spec("mujoco_warp") is None:
            return "Newton's MuJoCo solver needs mujoco-warp; install newton[sim]"
        if scene.damping is not None:
            return "the adapter maps no damping"
        if floor is None or self.is_default or (solver != "xpbd" and self.given):
            return None
        if solver != "xpbd":
            return "this solver's contacts are springs and dampers without a restitution: a ball rebounds alike with 0.5 and with 0.9"
        if (fixed := refusal_of_rest_speed(scene, "Newton's XPBD", "it drops restitution below 2 g dt")) is not None:
            return fixed
        if floor.friction != "none" and floor.restitution > 0.0:
            return (
                "XPBD limits friction by the depth that a step removes, not by the impulse of the rebound, which acts later and without "
                "friction; at 1 ms a ball that slips loses 0.02 to 0.30 m/s of its course, not 0.47, and one with backspin that grips "
                "rebounds with 0.56, not 0.8, which vanishes with the step"
            )
        return None

    def chosen(self, scene: Scenario) -> dict[str, Any]:
        """The settings for a scene; those left out are Newton's own."""
        floor, chosen = scene.floor, dict[str, Any]()
        if not self.is_default:
            chosen = calibrated_values(self.settings) | {"enable_restitution": floor is not None and floor.restitution > 0.0}
        if floor is not None:
            chosen |= {"restitution": floor.restitution, "mu": friction_of(floor, STICKING)}
        return {name: value for name, value in (chosen | self.given).items() if self.unmet_need(name) is None}

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return OneWorld(scene, Worlds([scene], dt, self))

    def prepare_batch(self, members: Sequence[Scenario], dt: float) -> BatchSimulation | None:
        """None for floors of which some have a restitution and others not, as XPBD's restitution is on or off for all."""
        restitutions = {self.chosen(member).get("enable_restitution") for member in members}
        return Worlds(members, dt, self) if len(restitutions) == 1 else None


class Worlds(BatchSimulation):
    """Worlds with a body each on Warp's default device, with their step as a graph."""

    def __init__(self, members: Sequence[Scenario], dt: float, engine: Newton) -> None:
        self.velocity_lag, scene = 0.5 * dt, members[0]
        solver, chosen = engine.option("solver"), engine.chosen(scene)
        builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=tuple(scene.acceleration))
        if differ_in_start_alone(members):
            builder.replicate(_world(scene, chosen), len(members))
        else:
            for member in members:
                builder.add_world(_world(member, engine.chosen(member)))
        self.model: Any = builder.finalize()
        options = {name: value for name, value in chosen.items() if name not in SHAPE}
        self._solver: Any = getattr(newton.solvers, SOLVERS[solver])(self.model, **options)
        self._now, self._next, self._control = self.model.state(), self.model.state(), self.model.control()
        self._pipeline = None if scene.floor is None else newton.CollisionPipeline(self.model)
        self._contacts = self._pipeline.contacts() if self._pipeline else None
        self._step(dt)  # compiles; nothing may be loaded while a graph is captured
        with wp.ScopedCapture() as capture:
            self._step(dt)
        self._graph = capture.graph
        rows = initial_states(members).astype(np.float32)
        self._now.assign(self.model.state())
        self._now.body_q.assign(rows[:, :7])
        self._now.body_qd.assign(rows[:, 7:])
        newton.eval_ik(self.model, self._now, self._now.joint_q, self._now.joint_qd)
        made = {"version": version("newton"), "warp": wp.config.version, "device": f"{wp.get_device()} ({wp.get_device().name})"}
        self.settings = made | engine.options_in_force | self._in_force(solver)

    def _in_force(self, solver: str) -> dict[str, Any]:
        """The settings as Newton has them; those of shapes are the first one's."""
        options, found = self._solver.mj_model.opt if solver == "mujoco" else self._solver, dict[str, Any]()
        for name, setting in SETTINGS[solver].items():
            if name not in SHAPE:
                value = getattr(options, name)
                found[name] = setting.values[value] if setting.values else value
            elif self.model.shape_count:
                found[name] = float(str(getattr(self.model, SHAPE[name]).numpy()[0]))  # with the digits of single precision
        return found

    def _step(self, dt: float) -> None:
        self._now.clear_forces()
        if self._pipeline is not None:
            self._pipeline.collide(self._now, self._contacts)
        self._solver.step(self._now, self._next, self._control, self._contacts, dt)
        self._now.assign(self._next)

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            wp.capture_launch(self._graph)
        wp.synchronize()

    def states(self) -> Array:
        return np.concatenate([self._now.body_q.numpy(), self._now.body_qd.numpy()], axis=1, dtype=float)

    def limitations_of(self, scene: Scenario, states: Array) -> list[KnownLimitation]:
        """The effect of rounding on the spin, if the body turns: it grows with the number of steps, or with the speed."""
        steps = len(states) - 1
        duration = 2.0 * self.velocity_lag * steps
        fastest, speed = (float(length(states[:, part]).max()) for part in (SPIN, VELOCITY))
        if self.settings["solver"] == "featherstone":
            torque = TORQUE * scene.body.mass * speed**2
            spin = torque * duration / float(np.linalg.eigvalsh(scene.body.inertia_tensor)[0])
            why = "featherstone adds the torque v × m v, which is 0 in exact arithmetic"
        else:
            spin, why = SPIN_GAINED * steps * fastest, "the solver turns ω to the body's axes and back in each step"
        if not (spin > 0.0 and fastest > 0.0):
            return []
        share = spin / fastest
        errors = {"orientation_error": 0.5 * spin * duration, "angular_momentum_error": share} | dict.fromkeys(ENERGIES, 2.0 * share)
        return [KnownLimitation(f"{why}; rounding then changes ω by up to {spin:.2g} rad/s", errors)]

    def as_built(self) -> AsBuilt:
        """The first world."""
        mass, inertia, gravity = (part.numpy()[0] for part in (self.model.body_mass, self.model.body_inertia, self.model.gravity))
        return AsBuilt(float(mass), np.array(inertia, dtype=float), np.array(gravity, dtype=float))


def _world(scene: Scenario, chosen: Mapping[str, Any]) -> Any:
    """A scene's body, over a plane where it has a floor."""
    world, body = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=tuple(scene.acceleration)), scene.body
    inertia = wp.mat33(*body.inertia_tensor.ravel().tolist())
    moving = world.add_body(mass=body.mass, inertia=inertia, lock_inertia=True)
    if scene.floor is None:
        return world
    config = newton.ModelBuilder.ShapeConfig(density=0.0, **{name: value for name, value in chosen.items() if name in SHAPE})
    world.add_ground_plane(cfg=config)
    if isinstance(body, Sphere):
        world.add_shape_sphere(moving, radius=body.radius, cfg=config)
    elif isinstance(body, Box):
        world.add_shape_box(moving, cfg=config, **dict(zip(("hx", "hy", "hz"), body.half_extents, strict=True)))
    return world
