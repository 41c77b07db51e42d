"""The engine `drake`: Drake's discrete plant, a body's corners over a half-space. Its contacts are damped so that restitution is 0."""

import logging
from itertools import product
from typing import Any, ClassVar

import numpy as np
from pydrake.geometry import AddContactMaterial, Box, Convex, HalfSpace, ProximityProperties, Shape, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, DiscreteContactApproximation, MultibodyPlant
from pydrake.multibody.tree import QuaternionFloatingJoint, RotationalInertia, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.base import AsBuilt, Diverged, Engine, Simulation
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.engines.settings import calibrated_values, settings_beside
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.state import ORIENTATION, Array
from dropspin.scenarios.surfaces import Floor

logging.getLogger("drake").addFilter(lambda record: "half spaces" not in record.getMessage())  # a warning about deformable bodies

LONGEST = 1e150
PLANT, SURFACE = settings_beside(__file__).values()


class Drake(Engine):
    """Drake's rigid body in its discrete plant."""

    name, order = "drake", 1.0
    choices: ClassVar = {"profile": mapping.PROFILES, "floor": ("plane", "box", "mesh"), "beside": mapping.BESIDE}
    representations: ClassVar = ("floor", "beside")
    settings: ClassVar = PLANT | SURFACE

    def discretisation(self, scene: Scenario) -> str | None:
        """Semi-implicit Euler without spin; else ω is as in MuJoCo's Euler, but a step turns by 2 atan(|ω| dt/2), as in Wang's method."""
        falls = scene.floor is None and scene.damping is None and not any(scene.start.angular_velocity)
        return mapping.SEMI_IMPLICIT_EULER if falls else None

    def declines(self, scene: Scenario) -> str | None:
        unfit = mapping.refusal_of_unequal_damping(scene)
        if unfit is None and scene.floor is not None and scene.floor.restitution > 0.0:
            return "Drake has no coefficient of restitution; its contacts are springs with dissipation"
        return unfit or mapping.refusal_of_floor(scene, self.option("floor"))

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return DrakeSimulation(scene, dt, self)

    def chosen(self, scene: Scenario, floor: Floor) -> dict[str, Any]:
        """The settings for a scene's floor; those left out are Drake's own."""
        friction = mapping.friction_of(floor, gripping=1e6)
        chosen: dict[str, Any] = {"friction": friction, "floor_friction": friction}
        if not self.is_default:
            chosen |= calibrated_values(self.settings)
            chosen["discrete_contact_approximation"] = "sap" if isinstance(floor.friction, str) else "tamsi"
            chosen["stiffness"] = (1e9 * scene.body.mass, 1e12 * scene.body.mass)
        return chosen | self.given


class DrakeSimulation(Simulation):
    """A plant in a simulator, with a scene graph if the scene has a floor."""

    def __init__(self, scene: Scenario, dt: float, engine: Drake) -> None:
        self.velocity_lag = 0.5 * dt
        builder: Any = DiagramBuilder()
        self._dt, self._steps = dt, 0
        self._plant = builder.AddSystem(MultibodyPlant(dt)) if scene.floor is None else AddMultibodyPlantSceneGraph(builder, dt)[0]
        scenes = mapping.bodies_in(scene, engine.option("beside"))
        bodies = [self._add_body(one, self._plant.AddModelInstance(f"body {number}")) for number, one in enumerate(scenes)]
        self._body = bodies[0]
        self._plant.mutable_gravity_field().set_gravity_vector(scene.acceleration)
        self.settings = {"version": version("drake"), **engine.options_in_force}
        if scene.floor is not None:
            self.settings |= engine.chosen(scene, scene.floor)
            self._add_floor(scene, engine.option("floor"), bodies)
        self._plant.Finalize()
        self._simulator = Simulator(builder.Build())
        self._context = self._plant.GetMyMutableContextFromRoot(self._simulator.get_mutable_context())
        for one, body in zip(scenes, bodies, strict=True):
            start = one.initial_state[[6, 3, 4, 5, 0, 1, 2, 10, 11, 12, 7, 8, 9]]
            self._plant.SetPositionsAndVelocities(self._context, body.model_instance(), start)
        self._simulator.Initialize()

    def _add_body(self, scene: Scenario, instance: Any) -> Any:
        inertia = scene.body.inertia_tensor
        about_centre = RotationalInertia(*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2])
        spatial = SpatialInertia.MakeFromCentralInertia(scene.body.mass, np.zeros(3), about_centre)
        body = self._plant.AddRigidBody("body", instance, spatial)
        if scene.damping is not None:
            frames = self._plant.world_frame(), body.body_frame()
            rates = scene.damping.angular * inertia[0, 0], scene.damping.linear * scene.body.mass
            self._plant.AddJoint(QuaternionFloatingJoint("free", *frames, *rates))
        return body

    def _add_floor(self, scene: Scenario, kind: str, bodies: list[Any]) -> None:
        plant, body, chosen = self._plant, scene.body, self.settings
        for name in PLANT.keys() & chosen.keys():
            value = chosen[name]
            enumerated = getattr(DiscreteContactApproximation, f"k{value.capitalize()}") if isinstance(value, str) else value
            getattr(plant, f"set_{name}")(enumerated)
        surfaces = [ProximityProperties(), ProximityProperties()]
        for number, (surface, prefix) in enumerate(zip(surfaces, ("floor_", ""), strict=True)):
            friction, stiffness = chosen[f"{prefix}friction"], chosen["stiffness"][number] if "stiffness" in chosen else None
            AddContactMaterial(surface, chosen.get("dissipation"), stiffness, CoulombFriction(friction, friction))
            if "relaxation_time" in chosen:
                surface.AddProperty("material", "relaxation_time", chosen["relaxation_time"])
        plant.RegisterCollisionGeometry(plant.world_body(), *_floor(kind), "floor", surfaces[0])
        # One shape would have one point contact with the floor; balls of radius 0 give each corner its own.
        for (number, corner), one in product(enumerate(body.vertices), bodies):
            plant.RegisterCollisionGeometry(one, RigidTransform(corner), Sphere(body.semi_axes[0]), f"corner {number}", surfaces[1])

    def advance(self, steps: int) -> None:
        self._steps += steps
        try:
            self._simulator.AdvanceTo(self._steps * self._dt)
        except RuntimeError as error:
            raise Diverged(str(error).splitlines()[0]) from error
        if not np.abs(self._plant.GetPositions(self._context, self._body.model_instance())[:4]).max() < LONGEST:
            raise Diverged(f"the quaternion is longer than {LONGEST:g}; a step makes it sqrt(1 + (|ω| dt/2)²) times as long")

    def state(self) -> Array:
        state = self._plant.GetPositionsAndVelocities(self._context, self._body.model_instance())[
            [4, 5, 6, 1, 2, 3, 0, 10, 11, 12, 7, 8, 9]
        ]
        state[ORIENTATION] /= np.linalg.norm(state[ORIENTATION])  # Drake normalises where it uses the quaternion, not in its state
        return state

    def as_built(self) -> AsBuilt:
        built, gravity = self._body.CalcSpatialInertiaInBodyFrame(self._context), self._plant.gravity_field().gravity_vector()
        return AsBuilt(built.get_mass(), built.CalcRotationalInertia().CopyToFullMatrix3(), gravity)


def _floor(kind: str) -> tuple[RigidTransform, Shape]:
    """The pose and the shape of the floor."""
    if kind == "plane":
        return RigidTransform(RotationMatrix.MakeXRotation(-np.pi / 2)), HalfSpace()
    half = mapping.FLOOR_HALF_SIZE
    corners = np.array(list(product((-half, half), repeat=3))).T
    return RigidTransform([0.0, -half, 0.0]), Box([2.0 * half] * 3) if kind == "box" else Convex(corners, "floor")
