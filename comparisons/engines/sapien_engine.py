"""The engine `sapien`: SAPIEN's PhysX 5 on the processor, in single precision.

PhysX applies gravity before it solves contacts, hence v+ = e (u + g dt). A step's gyroscopic term is explicit, and keeps |L|.
"""

import warnings
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import numpy as np

from dropspin.comparisons.engines.base import AsBuilt, Diverged, Engine, Simulation
from dropspin.comparisons.engines.mapping import PROFILES, SEMI_IMPLICIT_EULER, built, friction_of, may_tumble, principal_frame
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.engines.settings import calibrated_values, settings_beside
from dropspin.scenarios.bodies import Body, Sphere
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.state import Array

with warnings.catch_warnings():
    warnings.filterwarnings("ignore", message="Failed to find system libvulkan")  # of the renderer, which is not used
    import sapien
    from sapien import physx

WORLD, BODY, SURFACE = settings_beside(__file__).values()
SETTINGS = WORLD | BODY | SURFACE
TOLERANCE = "m; a box's contacts stay while it moves less than 1/20 of it; at SAPIEN's 0.1 a box gains 8 % energy at impacts"
REASONS = {"tolerance_length": TOLERANCE} | {name: setting.why for name, setting in SETTINGS.items() if setting.why}
GRIPPING = 1e6
TOLERANCE_LENGTH = 1e-3  # m
ENGINE = physx.PhysxEngine(TOLERANCE_LENGTH, 0.2)  # the one of this process, as long as this holds it
UPWARD = np.sqrt([0.5, 0.0, 0.0, 0.5])  # turns the plane's normal from x to y; w first, as in all poses here


class Sapien(Engine):
    """PhysX's rigid body on a plane."""

    name, order, precision, reasons = "sapien", 1.0, np.float32, REASONS
    shapes: ClassVar = ("sphere", "box")
    choices: ClassVar = {"profile": PROFILES}
    settings: ClassVar = SETTINGS

    def discretisation(self, scene: Scenario) -> str | None:
        falls = scene.floor is None and scene.damping is None and not may_tumble(scene)
        return SEMI_IMPLICIT_EULER if falls and self.is_calibrated else None

    def declines(self, scene: Scenario) -> str | None:
        floor = scene.floor
        if floor is not None and floor.restitution > 0.0 and not isinstance(floor.friction, str) and not isinstance(scene.body, Sphere):
            return "of SAPIEN's two solvers TGS alone has a cone of friction, and with TGS a box that bounces flat turns by 0.1 rad or more"
        return None

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return SapienSimulation(scene, dt, self)

    def chosen(self, scene: Scenario, dt: float) -> dict[str, Any]:
        """The settings for a scene at a time step [s]; those left out are SAPIEN's own."""
        floor, damping, chosen = scene.floor, scene.damping, dict[str, Any]()
        if not self.is_default:
            has_coefficient = floor is not None and not isinstance(floor.friction, str)
            chosen |= {"enable_tgs": has_coefficient, "bounce_threshold": max(floor.rest_speed if floor else 0.0, 1e-9)}
            chosen |= calibrated_values(SETTINGS)
            chosen["solver_position_iterations"] = 4 if has_coefficient else 100
        if damping is not None or not self.is_default:
            for motion in ("linear", "angular"):
                chosen[f"{motion}_damping"] = -float(np.expm1(-getattr(damping, motion) * dt)) / dt if damping else 0.0
        if floor is not None:
            surface = {"restitution": floor.restitution, "friction": friction_of(floor, GRIPPING)}
            offset = float(np.linalg.norm(scene.acceleration)) * dt**2 + 1e-6 * scene.body.size
            chosen |= surface | {f"floor_{name}": value for name, value in surface.items()}
            chosen |= {} if self.is_default else {"contact_offset": offset}
        return chosen | self.given


def assign(target: Any, chosen: Mapping[str, Any], names: Iterable[str]) -> None:
    """Set attributes of the names that are among the settings."""
    for name in names:
        if name in chosen:
            setattr(target, name, chosen[name])


class SapienSimulation(Simulation):
    """A SAPIEN scene with a PhysX system and no renderer."""

    def __init__(self, scene: Scenario, dt: float, engine: Sapien) -> None:
        self.velocity_lag = 0.5 * dt
        body, chosen = scene.body, engine.chosen(scene, dt)
        before, config = physx.get_scene_config(), physx.PhysxSceneConfig()
        config.gravity = scene.acceleration
        assign(config, chosen, WORLD)
        physx.set_scene_config(config)  # of the systems that are created from here on
        self._system, self._entity, self._body = physx.PhysxCpuSystem(), sapien.Entity(), physx.PhysxRigidDynamicComponent()
        physx.set_scene_config(before)
        self._system.timestep = dt
        self._scene = sapien.Scene([self._system])
        if scene.floor is not None:
            self._add_floor(body, chosen)
        moments, axes = principal_frame(body.inertia_tensor)
        frame = sapien.Pose(q=np.roll(axes, 1))
        assign(self._body, chosen, BODY)
        self._body.mass, self._body.cmass_local_pose, self._body.inertia = body.mass, frame, moments
        self._entity.add_component(self._body)
        self._entity.pose = sapien.Pose(scene.start.position, np.roll(scene.start.orientation, 1))
        self._scene.add_entity(self._entity)
        self._body.linear_velocity, self._body.angular_velocity = scene.start.velocity, scene.start.angular_velocity
        versions = {"version": version("sapien"), "physx": physx.version(), "profile": engine.option("profile")}
        self.settings = versions | {"timestep": dt, "tolerance_length": TOLERANCE_LENGTH} | chosen

    def _add_floor(self, body: Body, chosen: Mapping[str, Any]) -> None:
        materials = []
        for prefix in ("", "floor_"):
            friction = chosen[f"{prefix}friction"]
            materials.append(physx.PhysxMaterial(friction, friction, chosen[f"{prefix}restitution"]))
        ball, box = physx.PhysxCollisionShapeSphere, physx.PhysxCollisionShapeBox
        shape = ball(body.radius, materials[0]) if isinstance(body, Sphere) else box(body.vertices.max(0), materials[0])
        plane, ground, fixed = physx.PhysxCollisionShapePlane(materials[1]), sapien.Entity(), physx.PhysxRigidStaticComponent()
        plane.local_pose = sapien.Pose(q=UPWARD)
        for surface in (plane, shape):
            assign(surface, chosen, ["contact_offset"])
        self._body.attach(shape)
        fixed.attach(plane)
        ground.add_component(fixed)
        self._scene.add_entity(ground)

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
