"""The engine `ode`: a rigid body of the Open Dynamics Engine, a system library, called through the package ode-python.

ODE solves the contacts of a step together, with the limits of friction of the normal forces that there are without friction.
"""

from collections.abc import Mapping
from ctypes import byref, sizeof, string_at
from math import hypot, inf
from typing import Any, ClassVar

import numpy as np
import odepy as ode

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.base import Array, AsBuilt, Engine, Simulation
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.engines.settings import Setting, calibrated_values, settings_beside
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Sphere
from dropspin.scenarios.state import PARTS

GRIPPING = 1e6
CONTACTS = 8  # points of a contact at most; a box on a plane has four
WORLD, BODY, SURFACE = settings_beside(__file__).values()
ode.dInitODE2(0)


class ODE(Engine):
    """A rigid body of ODE, the Open Dynamics Engine."""

    name, order = "ode", 1.0
    shapes: ClassVar = ("sphere", "box")
    choices: ClassVar = {"profile": mapping.PROFILES, "floor": ("plane", "box"), "beside": mapping.BESIDE, "solver": ("step", "quick")}
    representations: ClassVar = ("floor", "beside")
    settings: ClassVar = WORLD | BODY | SURFACE

    def declines(self, scene: Scenario) -> str | None:
        return mapping.refusal_of_floor(scene, self.option("floor"))

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return ODESimulation(scene, dt, self)


class ODESimulation(Simulation):
    """A world of ODE."""

    def __init__(self, scene: Scenario, dt: float, engine: ODE) -> None:
        self.velocity_lag, self._dt = 0.5 * dt, dt
        self._world, self._joints, self._contacts = ode.dWorldCreate(), ode.dJointGroupCreate(0), (ode.dContact * CONTACTS)()
        rates, options = scene.damping.rates if scene.damping else {}, engine.options_in_force
        chosen: dict[str, Any] = {f"{motion.title()}Damping": float(-np.expm1(-rate * dt)) for motion, rate in rates.items()}
        if floor := scene.floor:
            chosen |= {"mu": mapping.friction_of(floor, GRIPPING), "bounce": floor.restitution, "bounce_vel": floor.rest_speed}
        if not engine.is_default:
            chosen |= calibrated_values(engine.settings) | {"CFM": 1e-10 / scene.body.mass}
        chosen |= engine.given
        ode.dWorldSetGravity(self._world, *scene.acceleration)
        _set("World", self._world, WORLD, chosen)
        self._step = ode.dWorldStep if options["solver"] == "step" else ode.dWorldQuickStep
        surface = self._set_surface(chosen) if floor else {}
        self._floor = _floor(options["floor"]) if floor else None
        self._bodies = [self._add(one, chosen) for one in mapping.bodies_in(scene, options["beside"])]
        build = {"version": version("ode-python"), "build": string_at(ode.dGetConfiguration()).decode()}
        self.settings = build | options | _in_force("World", self._world, WORLD) | _in_force("Body", self._bodies[0][0], BODY) | surface

    def _set_surface(self, chosen: Mapping[str, Any]) -> dict[str, Any]:
        """Give the contacts the settings of a surface; those in force, but for what ODE takes from the world."""
        values = {"Approx1": False, "FDir1": False} | {name: value for name, value in chosen.items() if name in SURFACE}
        self._follows_slip, mode = values["FDir1"], ode.dContactBounce
        for name, flag in (("Approx1", "Approx1"), ("FDir1", "FDir1"), ("soft_erp", "SoftERP"), ("soft_cfm", "SoftCFM")):
            mode |= getattr(ode, f"dContact{flag}") if values.get(name, False) is not False else 0
        for contact in self._contacts:
            contact.fdir1[0], contact.surface.mode = 1.0, mode
            for name in values.keys() - {"Approx1", "FDir1"}:
                setattr(contact.surface, name, values[name])
        return values

    def _add(self, scene: Scenario, chosen: Mapping[str, Any]) -> tuple[Any, Any]:
        """Add a scene's body with its settings; its handle, and that of its shape."""
        handle, mass, body = ode.dBodyCreate(self._world), ode.dMass(), scene.body
        mass.mass, mass.I[:] = body.mass, np.pad(body.inertia_tensor, ((0, 0), (0, 1))).ravel().tolist()
        ode.dBodySetMass(handle, byref(mass))
        x, q, v, w = (scene.initial_state[part] for part in PARTS.values())
        ode.dBodySetPosition(handle, *x)
        ode.dBodySetQuaternion(handle, ode.dQuaternion(*np.roll(q, 1)))
        ode.dBodySetLinearVel(handle, *v)
        ode.dBodySetAngularVel(handle, *w)
        _set("Body", handle, BODY, chosen)
        if scene.floor is None:
            return handle, None
        shape = ode.dCreateSphere(None, body.size) if isinstance(body, Sphere) else ode.dCreateBox(None, *2.0 * body.vertices.max(0))
        ode.dGeomSetBody(shape, handle)
        return handle, shape

    def _touch(self, handle: Any, shape: Any) -> None:
        """Make the contacts of a body with the floor for the next step."""
        slip = ode.dVector3()
        count = ode.dCollide(shape, self._floor, CONTACTS, byref(self._contacts[0].geom), sizeof(ode.dContact))
        for contact in self._contacts[:count]:
            ode.dBodyGetPointVel(handle, *contact.geom.pos[:3], slip)
            speed = hypot(slip[0], slip[2])
            if self._follows_slip and speed > 0.0:
                contact.fdir1[0], contact.fdir1[2] = slip[0] / speed, slip[2] / speed
            ode.dJointAttach(ode.dJointCreateContact(self._world, self._joints, byref(contact)), handle, 0)

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            for handle, shape in self._bodies if self._floor else ():
                self._touch(handle, shape)
            self._step(self._world, self._dt)
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


def _set(kind: str, handle: Any, settings: Mapping[str, Setting], chosen: Mapping[str, Any]) -> None:
    """Give a world or a body those of its settings that are chosen."""
    for name in settings.keys() & chosen.keys():
        getattr(ode, f"d{kind}Set{name}")(handle, chosen[name])


def _in_force(kind: str, handle: Any, settings: Mapping[str, Setting]) -> dict[str, Any]:
    """The finite settings of a world or a body, as ODE has them."""
    values = ((name, getattr(ode, f"d{kind}Get{name}")(handle)) for name in settings)
    return {name: type(settings[name].default)(value) for name, value in values if value < inf}


def _floor(kind: str) -> Any:
    """The shape of the floor."""
    if kind == "plane":
        return ode.dCreatePlane(None, 0.0, 1.0, 0.0, 0.0)
    box = ode.dCreateBox(None, *[2.0 * mapping.FLOOR_HALF_SIZE] * 3)
    ode.dGeomSetPosition(box, 0.0, -mapping.FLOOR_HALF_SIZE, 0.0)
    return box
