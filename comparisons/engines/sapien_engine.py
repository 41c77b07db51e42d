"""The engine `sapien`: SAPIEN's PhysX 5 on the processor, in single precision.

PhysX applies gravity before it solves contacts, hence v+ = e (u + g dt). A step's gyroscopic term is explicit, and keeps |L|.
"""

import warnings
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from dropspin.comparisons.engines.base import AsBuilt, Diverged, Engine, Simulation
from dropspin.comparisons.engines.mapping import SEMI_IMPLICIT_EULER, built, friction_of, may_tumble, principal_frame
from dropspin.comparisons.engines.packages import version
from dropspin.scenarios.bodies import Body, Sphere
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.state import Array
from dropspin.scenarios.surfaces import Floor

with warnings.catch_warnings():
    warnings.filterwarnings("ignore", message="Failed to find system libvulkan")  # of the renderer, which is not used
    import sapien
    from sapien import physx

TOLERANCE_LENGTH = 1e-3  # m
ENGINE = physx.PhysxEngine(TOLERANCE_LENGTH, 0.2)  # the one of this process, as long as this holds it
GRIPPING = 1e6
UPWARD = np.sqrt([0.5, 0.0, 0.0, 0.5])  # turns the plane's normal from x to y; w first, as in all poses here
FASTEST = 1e16  # m/s and rad/s
REASONS = {
    "tolerance_length": "m; a box's contacts stay while it moves less than 1/20 of it; at SAPIEN's 0.1 a box gains 8% energy at impacts",
    "enable_tgs": "for a coefficient: a cone; PGS has a pyramid, up to 1.41 times as strong; else PGS: TGS gains 1.3e-3 energy at impacts",
    "bounce_threshold": "the scene's rest speed, but not 0; by default impacts below 2 m/s do not rebound",
    "contact_offset": "a step's fall; at the default 1 cm a ball rebounds up to 1 mm above the floor; at 0 a tipping box errs fivefold",
    "solver_position_iterations": "for PGS; at 4 a gripping corner errs by 1.3e-2 in angular momentum, not 4e-3; for TGS, 100 add rounding",
    "sleep_threshold": "never falls asleep; by default drop-box-corner, in metres per millisecond, stops in the air after one step",
    "max_angular_velocity": "rad/s; no clamp, by default at 100",
    "linear_damping": "(1 - exp(-rate dt))/dt: PhysX multiplies by 1 - c dt, which gives the scene's decay; angular_damping is the same",
    "friction": f"{GRIPPING:g} where the floor grips; on both surfaces, as restitution: in SAPIEN, PhysX takes the average",
}
"""Effects were measured at 1 ms on the core catalogue and on a ball that slides with spin about its path, without the one setting."""


class Sapien(Engine):
    """PhysX's rigid body on a plane."""

    name, order, precision, reasons = "sapien", 1.0, np.float32, REASONS
    shapes: ClassVar = ("sphere", "box")

    def discretisation(self, scene: Scenario) -> str | None:
        return SEMI_IMPLICIT_EULER if scene.floor is None and scene.damping is None and not may_tumble(scene) else None

    def declines(self, scene: Scenario) -> str | None:
        floor = scene.floor
        if floor is not None and floor.restitution > 0.0 and not isinstance(floor.friction, str) and not isinstance(scene.body, Sphere):
            return "of SAPIEN's two solvers TGS alone has a cone of friction, and with TGS a box that bounces flat turns by 0.1 rad or more"
        return None

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return SapienSimulation(scene, dt)


def assign(target: Any, values: Mapping[str, Any]) -> None:
    """Set attributes."""
    for name, value in values.items():
        setattr(target, name, value)


class SapienSimulation(Simulation):
    """A SAPIEN scene with a PhysX system and no renderer."""

    def __init__(self, scene: Scenario, dt: float) -> None:
        self.velocity_lag = 0.5 * dt
        body, floor, damping = scene.body, scene.floor, scene.damping
        has_coefficient = floor is not None and not isinstance(floor.friction, str)
        world = {"enable_tgs": has_coefficient, "bounce_threshold": max(floor.rest_speed if floor else 0.0, 1e-9)}
        dynamics = {"sleep_threshold": 0.0, "max_angular_velocity": FASTEST, "solver_position_iterations": 4 if has_coefficient else 100}
        for motion in ("linear", "angular"):
            dynamics[f"{motion}_damping"] = -float(np.expm1(-getattr(damping, motion) * dt)) / dt if damping else 0.0
        before, config = physx.get_scene_config(), physx.PhysxSceneConfig()
        assign(config, world | {"gravity": scene.acceleration})
        physx.set_scene_config(config)  # of the systems that are created from here on
        self._system, self._entity, self._body = physx.PhysxCpuSystem(), sapien.Entity(), physx.PhysxRigidDynamicComponent()
        physx.set_scene_config(before)
        self._system.timestep = dt
        self._scene = sapien.Scene([self._system])
        offset = float(np.linalg.norm(scene.acceleration)) * dt**2 + 1e-6 * body.size
        surface = {} if floor is None else self._add_floor(floor, body, offset)
        moments, axes = principal_frame(body.inertia_tensor)
        frame = sapien.Pose(q=np.roll(axes, 1))
        assign(self._body, dynamics | {"mass": body.mass, "cmass_local_pose": frame, "inertia": moments})
        self._entity.add_component(self._body)
        self._entity.pose = sapien.Pose(scene.start.position, np.roll(scene.start.orientation, 1))
        self._scene.add_entity(self._entity)
        assign(self._body, {"linear_velocity": scene.start.velocity, "angular_velocity": scene.start.angular_velocity})
        versions = {"version": version("sapien"), "physx": physx.version()}
        self.settings = versions | {"timestep": dt, "tolerance_length": TOLERANCE_LENGTH} | world | dynamics | surface

    def _add_floor(self, floor: Floor, body: Body, offset: float) -> dict[str, float]:
        friction = friction_of(floor, GRIPPING)
        material = physx.PhysxMaterial(friction, friction, floor.restitution)
        ball, box = physx.PhysxCollisionShapeSphere, physx.PhysxCollisionShapeBox
        shape = ball(body.radius, material) if isinstance(body, Sphere) else box(body.vertices.max(0), material)
        plane, ground, fixed = physx.PhysxCollisionShapePlane(material), sapien.Entity(), physx.PhysxRigidStaticComponent()
        plane.local_pose = sapien.Pose(q=UPWARD)
        plane.contact_offset = shape.contact_offset = offset
        self._body.attach(shape)
        fixed.attach(plane)
        ground.add_component(fixed)
        self._scene.add_entity(ground)
        return {"restitution": floor.restitution, "friction": friction, "contact_offset": offset}

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self._system.step()
        if not np.isfinite([*self._entity.pose.p, *self._body.angular_velocity]).all():
            raise Diverged("the state is not finite")

    def state(self) -> Array:
        pose, body = self._entity.pose, self._body
        return np.concatenate([pose.p, np.roll(pose.q, -1), body.linear_velocity, body.angular_velocity], dtype=float)

    def as_built(self) -> AsBuilt:
        axes = np.roll(self._body.cmass_local_pose.q, -1)
        return built(self._body.mass, self._body.inertia, axes, self._system.config.gravity)
