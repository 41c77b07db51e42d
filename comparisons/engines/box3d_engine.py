"""The engine `box3d`: a rigid body of Box3D, in the library that comes with the package robox3d; in single precision."""

from typing import Any, ClassVar

import numpy as np
from robox3d._ffi import ffi, lib

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.base import Array, AsBuilt, Engine, Simulation
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.engines.rapier_scenes import damping_of, refusal, surface_of
from dropspin.comparisons.engines.settings import calibrated_values, settings_beside
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Sphere
from dropspin.scenarios.state import PARTS

STEP, WORLD, BODY, SURFACE = settings_beside(__file__).values()


class Box3D(Engine):
    """A rigid body of Box3D on a box."""

    name, order, precision = "box3d", 1.0, np.float32
    shapes: ClassVar = ("sphere", "box")
    choices: ClassVar = {"profile": mapping.PROFILES, "beside": mapping.BESIDE}
    representations: ClassVar = ("beside",)
    settings: ClassVar = STEP | WORLD | BODY | SURFACE

    def declines(self, scene: Scenario) -> str | None:
        return refusal(scene, "box", "Box3D")

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return Box3DSimulation(scene, dt, self)


class Box3DSimulation(Simulation):
    """A world of Box3D."""

    def __init__(self, scene: Scenario, dt: float, engine: Box3D) -> None:
        self._dt, self._substeps = dt, engine.given.get("substeps", STEP["substeps"].default)
        self.velocity_lag = 0.5 * dt / self._substeps
        world, self._made, surface = lib.b3DefaultWorldDef(), lib.b3DefaultBodyDef(), lib.b3DefaultShapeDef()
        chosen = {f"{motion}Damping": rate for motion, rate in damping_of(scene, dt / self._substeps).items()} | surface_of(scene)
        chosen |= ({} if engine.is_default else calibrated_values(engine.settings)) | engine.given
        in_force: dict[str, Any] = {"substeps": self._substeps}
        for made, settings in ((world, WORLD), (self._made, BODY), (surface.baseMaterial, SURFACE)):
            for name in settings.keys() & chosen.keys():
                setattr(made, name, chosen[name])
            found = {name: getattr(made, name) for name in settings}
            in_force |= {name: value if isinstance(value, bool) else float(str(np.float32(value))) for name, value in found.items()}
        self._surface = surface
        world.gravity = tuple(scene.acceleration)
        self._world, half = lib.b3CreateWorld(ffi.addressof(world)), mapping.FLOOR_HALF_SIZE
        if scene.floor:
            floor = lib.b3DefaultBodyDef()
            floor.position = (0.0, -half, 0.0)
            self._add_shape(lib.b3CreateBody(self._world, ffi.addressof(floor)), (half, half, half))
        self._body, *_ = [self._add(one) for one in mapping.bodies_in(scene, engine.option("beside"))]
        library = ".".join(str(getattr(lib.b3GetVersion(), part)) for part in ("major", "minor", "revision"))
        self.settings = {"version": version("robox3d"), "library": library, **engine.options_in_force, **in_force}

    def _add_shape(self, body: Any, size: float | tuple[float, ...]) -> None:
        """Add a ball of a radius, or a box of half extents."""
        made = self._surface
        if isinstance(size, tuple):
            hull = lib.b3MakeBoxHull(*size)
            lib.b3CreateHullShape(body, ffi.addressof(made), ffi.addressof(hull, "base"))
        else:
            lib.b3CreateSphereShape(body, ffi.addressof(made), ffi.new("b3Sphere*", {"radius": size}))

    def _add(self, scene: Scenario) -> Any:
        x, q, v, w = (tuple(scene.initial_state[part]) for part in PARTS.values())
        self._made.type, self._made.position, self._made.rotation = lib.b3_dynamicBody, x, {"v": q[:3], "s": q[3]}
        self._made.linearVelocity, self._made.angularVelocity = v, w
        handle, body = lib.b3CreateBody(self._world, ffi.addressof(self._made)), scene.body
        if scene.floor:
            self._add_shape(handle, body.size if isinstance(body, Sphere) else tuple(body.vertices.max(0)))
        columns = dict(zip(("cx", "cy", "cz"), map(tuple, body.inertia_tensor), strict=True))
        lib.b3Body_SetMassData(handle, {"mass": body.mass, "center": (0.0, 0.0, 0.0), "inertia": columns})
        return handle

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            lib.b3World_Step(self._world, self._dt, self._substeps)

    def state(self) -> Array:
        x, q = lib.b3Body_GetPosition(self._body), lib.b3Body_GetRotation(self._body)
        v, w = lib.b3Body_GetLinearVelocity(self._body), lib.b3Body_GetAngularVelocity(self._body)
        return np.array([x.x, x.y, x.z, q.v.x, q.v.y, q.v.z, q.s, v.x, v.y, v.z, w.x, w.y, w.z])

    def as_built(self) -> AsBuilt:
        mass, gravity = lib.b3Body_GetMassData(self._body), lib.b3World_GetGravity(self._world)
        columns = (mass.inertia.cx, mass.inertia.cy, mass.inertia.cz)
        return AsBuilt(mass.mass, np.array([[c.x, c.y, c.z] for c in columns]), np.array([gravity.x, gravity.y, gravity.z]))

    def close(self) -> None:
        lib.b3DestroyWorld(self._world)
