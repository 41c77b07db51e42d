"""The engine `drake`: Drake's discrete plant, a body's corners over a half-space. Its contacts only dissipate: restitution is 0."""

import logging
from typing import Any

import numpy as np
from pydrake.geometry import AddContactMaterial, HalfSpace, ProximityProperties, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction, DiscreteContactApproximation, MultibodyPlant
from pydrake.multibody.tree import QuaternionFloatingJoint, RotationalInertia, SpatialInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from comparisons.engines.base import SEMI_IMPLICIT_EULER, AsBuilt, Diverged, Engine, Simulation, version
from scenarios.body import Array
from scenarios.model import Floor, Scenario
from scenarios.state import ORIENTATION

logging.getLogger("drake").addFilter(lambda record: "half spaces" not in record.getMessage())  # a warning about deformable bodies

STICKING = 1e6
LONGEST = 1e150
REASONS = {
    "discrete_contact_approximation": "tamsi for a coefficient, else sap; the default, lagged, stops a sliding box at once",
    "sap_near_rigid_threshold": "at the default 1, a flat box rests 0.3 mm deep instead of 0.014, and a rocking block's error doubles",
    "relaxation_time": "s, for sap; a body leaves the floor at depth over this; at the default 0.1 a ball rebounds at 10 mm/s instead of 1",
    "dissipation": "s/m, for tamsi; the remaining rebound speed is 1 over this; at the default it is 20 mm/s, at any step",
    "stiffness": "N/m, floor and body; contacts lie on the stiffer; if equal, half a depth inside, and a gripped ball errs by 13 mm/s",
    "friction": "the scene's coefficient; 1e6 where the floor grips (1e3 gives the same)",
}
"""Effects were measured at 1 ms on boxes and a ball with backspin that lands at 3 m/s, without the one setting."""


class Drake(Engine):
    """Drake's rigid body, in the discrete plant that contacts need, in free flight too."""

    name = "drake"
    order = 1.0
    reasons = REASONS

    def discretisation(self, scene: Scenario) -> str | None:
        """Semi-implicit Euler without spin; else ω is as in MuJoCo's Euler, but a step turns by 2 atan(|ω| dt/2), as in Wang's method."""
        falls = scene.floor is None and scene.damping is None and not any(scene.start.angular_velocity)
        return SEMI_IMPLICIT_EULER if falls else None

    def declines(self, scene: Scenario) -> str | None:
        moments = np.linalg.eigvalsh(scene.body.inertia_tensor)
        if scene.damping is not None and scene.damping.angular > 0.0 and np.ptp(moments) > 1e-12 * moments[-1]:
            return "Drake damps a free joint's rotation with one coefficient; angular damping needs a body of equal moments of inertia"
        if scene.floor is not None and scene.floor.restitution > 0.0:
            return "Drake's contacts only dissipate; it has no coefficient of restitution"
        return None

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return DrakeSimulation(scene, dt)


class DrakeSimulation(Simulation):
    """A plant in a simulator, with a scene graph if the scene has a floor."""

    def __init__(self, scene: Scenario, dt: float) -> None:
        self.velocity_lag = 0.5 * dt
        builder: Any = DiagramBuilder()
        inertia, self._dt, self._steps = scene.body.inertia_tensor, dt, 0
        self._plant = builder.AddSystem(MultibodyPlant(dt)) if scene.floor is None else AddMultibodyPlantSceneGraph(builder, dt)[0]
        about_centre = RotationalInertia(*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2])
        self._body = self._plant.AddRigidBody("body", SpatialInertia.MakeFromCentralInertia(scene.body.mass, np.zeros(3), about_centre))
        self._plant.mutable_gravity_field().set_gravity_vector(scene.acceleration)
        self.settings = {"version": version("drake")} | ({} if scene.floor is None else self._add_floor(scene, scene.floor))
        if scene.damping is not None:
            frames = self._plant.world_frame(), self._body.body_frame()
            rates = scene.damping.angular * inertia[0, 0], scene.damping.linear * scene.body.mass
            self._plant.AddJoint(QuaternionFloatingJoint("free", *frames, *rates))
        self._plant.Finalize()
        self._simulator = Simulator(builder.Build())
        self._context = self._plant.GetMyMutableContextFromRoot(self._simulator.get_mutable_context())
        self._plant.SetPositionsAndVelocities(self._context, scene.initial_state[[6, 3, 4, 5, 0, 1, 2, 10, 11, 12, 7, 8, 9]])
        self._simulator.Initialize()

    def _add_floor(self, scene: Scenario, floor: Floor) -> dict[str, Any]:
        plant, body, approximation = self._plant, scene.body, "sap" if isinstance(floor.friction, str) else "tamsi"
        friction = {"none": 0.0, "infinite": STICKING}[floor.friction] if isinstance(floor.friction, str) else floor.friction
        chosen = {"sap_near_rigid_threshold": 0.01, "relaxation_time": 1.0, "dissipation": 1e7, "friction": friction}
        plant.set_discrete_contact_approximation(getattr(DiscreteContactApproximation, f"k{approximation.capitalize()}"))
        plant.set_sap_near_rigid_threshold(chosen["sap_near_rigid_threshold"])
        stiffness, surfaces = [1e9 * body.mass, 1e12 * body.mass], [ProximityProperties(), ProximityProperties()]
        for surface, spring in zip(surfaces, stiffness, strict=True):
            AddContactMaterial(surface, chosen["dissipation"], spring, CoulombFriction(friction, friction))
            surface.AddProperty("material", "relaxation_time", chosen["relaxation_time"])
        upward = RigidTransform(RotationMatrix.MakeXRotation(-np.pi / 2))
        plant.RegisterCollisionGeometry(plant.world_body(), upward, HalfSpace(), "floor", surfaces[0])
        # One shape would have one contact with the floor; balls of radius 0 give each corner its own.
        for number, corner in enumerate(body.vertices):
            plant.RegisterCollisionGeometry(self._body, RigidTransform(corner), Sphere(body.rounding), f"corner {number}", surfaces[1])
        return {"discrete_contact_approximation": approximation, "stiffness": stiffness} | chosen

    def advance(self, steps: int) -> None:
        self._steps += steps
        try:
            self._simulator.AdvanceTo(self._steps * self._dt)
        except RuntimeError as error:
            raise Diverged(str(error).splitlines()[0]) from error
        if not np.abs(self._plant.GetPositions(self._context)[:4]).max() < LONGEST:
            raise Diverged(f"the quaternion is longer than {LONGEST:g}; a step makes it sqrt(1 + (|ω| dt/2)²) times as long")

    def state(self) -> Array:
        state = self._plant.GetPositionsAndVelocities(self._context)[[4, 5, 6, 1, 2, 3, 0, 10, 11, 12, 7, 8, 9]]
        state[ORIENTATION] /= np.linalg.norm(state[ORIENTATION])  # Drake normalises where it uses the quaternion, not in its state
        return state

    def as_built(self) -> AsBuilt:
        built, gravity = self._body.CalcSpatialInertiaInBodyFrame(self._context), self._plant.gravity_field().gravity_vector()
        return AsBuilt(built.get_mass(), built.CalcRotationalInertia().CopyToFullMatrix3(), gravity)
