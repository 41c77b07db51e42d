"""The engine `drake`: Drake's discrete plant, a body's corners over a half-space. Its contacts are damped so that restitution is 0."""

import logging
from collections.abc import Mapping
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
from dropspin.scenarios.model import Scenario
from dropspin.scenarios.state import ORIENTATION, Array
from dropspin.scenarios.surfaces import Floor

logging.getLogger("drake").addFilter(lambda record: "half spaces" not in record.getMessage())  # a warning about deformable bodies

LONGEST = 1e150
REASONS = {
    "discrete_contact_approximation": "tamsi for a coefficient, else sap; the default, lagged, with this dissipation stops a sliding box",
    "sap_near_rigid_threshold": "at the default 1, a flat box rests 0.3 mm deep instead of 0.014, and a rocking block's error doubles",
    "relaxation_time": "s, for sap; a body leaves the floor at depth over this; at the default 0.1 a ball rebounds at 10 mm/s instead of 1",
    "dissipation": "s/m, for tamsi; the remaining rebound speed is 1 over this; at the default it is 20 mm/s, at any step",
    "stiffness": "N/m, floor and body; contacts lie on the stiffer; if equal, half a depth inside, and a gripped ball errs by 13 mm/s",
    "friction": "the scene's coefficient; 1e6 where the floor grips (1e3 gives the same)",
}
"""Effects were measured at 1 ms on boxes and a ball with backspin that lands at 3 m/s, without the one setting."""


class Drake(Engine):
    """Drake's rigid body in its discrete plant."""

    name = "drake"
    order = 1.0
    reasons = REASONS
    choices: ClassVar = {"profile": mapping.PROFILES, "floor": ("plane", "box", "mesh"), "beside": mapping.BESIDE}
    representations: ClassVar = ("floor", "beside")

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
        return DrakeSimulation(scene, dt, {name: self.option(name) for name in self.choices})


class DrakeSimulation(Simulation):
    """A plant in a simulator, with a scene graph if the scene has a floor."""

    def __init__(self, scene: Scenario, dt: float, form: Mapping[str, str]) -> None:
        self.velocity_lag = 0.5 * dt
        builder: Any = DiagramBuilder()
        self._dt, self._steps = dt, 0
        self._plant = builder.AddSystem(MultibodyPlant(dt)) if scene.floor is None else AddMultibodyPlantSceneGraph(builder, dt)[0]
        scenes = mapping.bodies_in(scene, form["beside"])
        bodies = [self._add_body(one, self._plant.AddModelInstance(f"body {number}")) for number, one in enumerate(scenes)]
        self._body = bodies[0]
        self._plant.mutable_gravity_field().set_gravity_vector(scene.acceleration)
        self.settings = {"version": version("drake"), **form}
        if scene.floor is not None:
            self.settings |= self._add_floor(scene, scene.floor, form, bodies)
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

    def _add_floor(self, scene: Scenario, floor: Floor, form: Mapping[str, str], bodies: list[Any]) -> dict[str, Any]:
        plant, body, approximation = self._plant, scene.body, "sap" if isinstance(floor.friction, str) else "tamsi"
        friction = mapping.friction_of(floor, gripping=1e6)
        surfaces, found = [ProximityProperties(), ProximityProperties()], dict[str, Any](friction=friction)
        if form["profile"] == "calibrated":
            found |= {"sap_near_rigid_threshold": 0.01, "relaxation_time": 1.0, "dissipation": 1e7}
            found |= {"discrete_contact_approximation": approximation, "stiffness": [1e9 * body.mass, 1e12 * body.mass]}
            plant.set_discrete_contact_approximation(getattr(DiscreteContactApproximation, f"k{approximation.capitalize()}"))
            plant.set_sap_near_rigid_threshold(found["sap_near_rigid_threshold"])
        for number, surface in enumerate(surfaces):
            spring = (found["dissipation"], found["stiffness"][number]) if "stiffness" in found else (None, None)
            AddContactMaterial(surface, *spring, CoulombFriction(friction, friction))
            if "relaxation_time" in found:
                surface.AddProperty("material", "relaxation_time", found["relaxation_time"])
        plant.RegisterCollisionGeometry(plant.world_body(), *_floor(form["floor"]), "floor", surfaces[0])
        # One shape would have one point contact with the floor; balls of radius 0 give each corner its own.
        for (number, corner), one in product(enumerate(body.vertices), bodies):
            plant.RegisterCollisionGeometry(one, RigidTransform(corner), Sphere(body.semi_axes[0]), f"corner {number}", surfaces[1])
        return found

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
