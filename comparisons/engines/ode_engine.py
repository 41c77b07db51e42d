"""The engine `ode`: a rigid body of the Open Dynamics Engine, in the library of the system, through the package ode-python.

ODE solves the contacts of a step together, with the limits of friction of the normal forces that there are without friction.
"""

from ctypes import byref, sizeof, string_at
from math import hypot
from typing import Any, ClassVar

import numpy as np
import odepy as ode

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.base import Array, AsBuilt, Engine, Simulation
from dropspin.comparisons.engines.packages import version
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Sphere
from dropspin.scenarios.state import PARTS
from dropspin.scenarios.surfaces import Floor

CONTACTS = 8
"""Points of a contact at most; a box on a plane has four."""
GRIPPING = 1e6
REASONS = {
    "mu": f"of the normal force, by default a force in N; {GRIPPING:g} where the floor grips, for infinity needs no normal force",
    "friction_direction": "along the slip; along the world's axes, as by default, a turning box errs by 0.23 in angular momentum",
    "soft_erp": "adds no velocity that corrects depth; 0.2 by default",
    "finite_rotation": "turns by ω dt; by 2 atan(ω dt/2) by default",
    "bounce_vel": "m/s, the scene's rest speed",
    "linear_damping": "1 - exp(-rate dt), of a step; angular_damping is the same",
}
"""Effects were measured at 1 ms without the one setting."""

ode.dInitODE2(0)


class ODE(Engine):
    """A rigid body of ODE, the Open Dynamics Engine."""

    name, order, reasons = "ode", 1.0, REASONS
    shapes: ClassVar = ("sphere", "box")
    choices: ClassVar = {"profile": mapping.PROFILES, "floor": ("plane", "box"), "beside": mapping.BESIDE}
    representations: ClassVar = ("floor", "beside")

    def declines(self, scene: Scenario) -> str | None:
        return mapping.refusal_of_floor(scene, self.option("floor"))

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return ODESimulation(scene, dt, self)


class ODESimulation(Simulation):
    """A world of ODE."""

    def __init__(self, scene: Scenario, dt: float, engine: ODE) -> None:
        self.velocity_lag, self._dt, self._calibrated = 0.5 * dt, dt, not engine.is_default
        self._world, self._joints, self._contacts = ode.dWorldCreate(), ode.dJointGroupCreate(0), (ode.dContact * CONTACTS)()
        cfm = 1e-10 / scene.body.mass
        ode.dWorldSetGravity(self._world, *scene.acceleration)
        ode.dWorldSetCFM(self._world, cfm if self._calibrated else 1e-10)
        rates = scene.damping.rates if scene.damping else {}
        self._damping = {f"{motion}_damping": float(-np.expm1(-rate * dt)) for motion, rate in rates.items()}
        options = {name: engine.option(name) for name in engine.choices}
        build = string_at(ode.dGetConfiguration()).decode()
        surface = self._set_surface(scene.floor) if scene.floor else {}
        self._floor = _floor(options["floor"]) if scene.floor else None
        self._bodies = [self._add(one) for one in mapping.bodies_in(scene, options["beside"])]
        rotation = {"finite_rotation": self._calibrated}
        self.settings = {"version": version("ode-python"), "build": build, **options, **rotation, **self._damping, **surface}

    def _set_surface(self, floor: Floor) -> dict[str, Any]:
        """Give the contacts the floor's restitution and friction; the settings."""
        given = {"mu": mapping.friction_of(floor, GRIPPING), "bounce": floor.restitution, "bounce_vel": floor.rest_speed}
        mode = ode.dContactSoftERP | ode.dContactApprox1 | ode.dContactFDir1 if self._calibrated else 0
        for contact in self._contacts:
            contact.fdir1[0] = 1.0
            contact.surface.mode = mode | ode.dContactBounce
            for name, value in given.items():
                setattr(contact.surface, name, value)
        return given | ({"soft_erp": 0.0, "friction_direction": "slip"} if self._calibrated else {})

    def _add(self, scene: Scenario) -> tuple[Any, Any]:
        """Add a scene's body; its handle, and that of its shape."""
        handle, mass, body = ode.dBodyCreate(self._world), ode.dMass(), scene.body
        mass.mass, mass.I[:] = body.mass, np.pad(body.inertia_tensor, ((0, 0), (0, 1))).ravel().tolist()
        ode.dBodySetMass(handle, byref(mass))
        x, q, v, w = (scene.initial_state[part] for part in PARTS.values())
        ode.dBodySetPosition(handle, *x)
        ode.dBodySetQuaternion(handle, ode.dQuaternion(*np.roll(q, 1)))
        ode.dBodySetLinearVel(handle, *v)
        ode.dBodySetAngularVel(handle, *w)
        ode.dBodySetFiniteRotationMode(handle, int(self._calibrated))
        if self._damping:
            ode.dBodySetDamping(handle, *self._damping.values())
            ode.dBodySetLinearDampingThreshold(handle, 0.0)
            ode.dBodySetAngularDampingThreshold(handle, 0.0)
        if scene.floor is None:
            return handle, None
        size = 2.0 * body.vertices.max(0)
        shape = ode.dCreateSphere(None, body.size) if isinstance(body, Sphere) else ode.dCreateBox(None, *size)
        ode.dGeomSetBody(shape, handle)
        return handle, shape

    def _touch(self, handle: Any, shape: Any) -> None:
        """Make the contacts of a body with the floor for the next step."""
        slip = ode.dVector3()
        count = ode.dCollide(shape, self._floor, CONTACTS, byref(self._contacts[0].geom), sizeof(ode.dContact))
        for contact in self._contacts[:count]:
            ode.dBodyGetPointVel(handle, *contact.geom.pos[:3], slip)
            speed = hypot(slip[0], slip[2])
            if speed > 0.0:
                contact.fdir1[0], contact.fdir1[2] = slip[0] / speed, slip[2] / speed
            ode.dJointAttach(ode.dJointCreateContact(self._world, self._joints, byref(contact)), handle, 0)

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            for handle, shape in self._bodies if self._floor else ():
                self._touch(handle, shape)
            ode.dWorldStep(self._world, self._dt)
            ode.dJointGroupEmpty(self._joints)

    def state(self) -> Array:
        handle, _ = self._bodies[0]
        x, q = ode.dBodyGetPosition(handle)[:3], ode.dBodyGetQuaternion(handle)[:4]
        return np.array([*x, *q[1:], q[0], *ode.dBodyGetLinearVel(handle)[:3], *ode.dBodyGetAngularVel(handle)[:3]])

    def as_built(self) -> AsBuilt:
        mass, gravity = ode.dMass(), ode.dVector3()
        ode.dBodyGetMass(self._bodies[0][0], byref(mass))
        ode.dWorldGetGravity(self._world, gravity)
        return AsBuilt(mass.mass, np.reshape(mass.I[:], (3, 4))[:, :3], np.array(gravity[:3]))

    def close(self) -> None:
        ode.dJointGroupDestroy(self._joints)
        for shape in (self._floor, *(shape for _, shape in self._bodies)):
            if shape:
                ode.dGeomDestroy(shape)
        ode.dWorldDestroy(self._world)


def _floor(kind: str) -> Any:
    """The shape of the floor."""
    half = mapping.FLOOR_HALF_SIZE
    if kind == "plane":
        return ode.dCreatePlane(None, 0.0, 1.0, 0.0, 0.0)
    box = ode.dCreateBox(None, 2.0 * half, 2.0 * half, 2.0 * half)
    ode.dGeomSetPosition(box, 0.0, -half, 0.0)
    return box
