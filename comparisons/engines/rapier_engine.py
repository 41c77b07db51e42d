"""The engine `rapier`: settings that reproduce the scene, which are not Rapier's defaults; in single precision.

Rapier solves the contacts of a step without restitution; one pass over them then turns each new contact's normal velocity v into -e v.
So a single contact rebounds exactly, several at once undo one another, and friction does not respond to the rebound.
"""

import os
from collections.abc import Mapping
from functools import cache
from typing import Any, ClassVar

import numpy as np
import rapier3d

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.base import Array, AsBuilt, Diverged, Engine, Simulation
from dropspin.comparisons.engines.packages import version
from dropspin.comparisons.engines.rapier_scenes import damping_of, refusal, surface_of
from dropspin.comparisons.engines.settings import calibrated_values, settings_beside
from dropspin.comparisons.measuring.predictions import spins_steadily
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Sphere
from dropspin.scenarios.state import PARTS

WORLD, BODY, SURFACE = settings_beside(__file__).values()
FLOOR = {f"floor_{name}": setting._replace(what="of the floor") for name, setting in SURFACE.items()}
FIRST_PROCESS = cache(os.getpid)  # the first one that simulates; it starts Rapier's threads, which all worlds share


class Rapier(Engine):
    """Rapier's rigid body on a half-space, a box or a mesh."""

    name, order, precision = "rapier", 1.0, np.float32
    shapes: ClassVar = ("sphere", "box")
    choices: ClassVar = {"profile": mapping.PROFILES, "floor": ("plane", "box", "mesh"), "beside": mapping.BESIDE}
    representations: ClassVar = ("floor", "beside")
    settings: ClassVar = WORLD | BODY | SURFACE | FLOOR

    def declines(self, scene: Scenario) -> str | None:
        return refusal(scene, self.option("floor"))

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return RapierSimulation(scene, dt, self)


class RapierSimulation(Simulation):
    """A Rapier world."""

    def __init__(self, scene: Scenario, dt: float, engine: Rapier) -> None:
        self._world = rapier3d.PhysicsWorld(gravity=scene.acceleration)
        if FIRST_PROCESS() != os.getpid():  # a forked process has none of those threads and would wait for them forever
            self._world.set_num_threads(1)
        given = engine.given
        gyroscopic = mapping.may_tumble(scene) and (scene.floor is not None or not spins_steadily(scene))
        damping = {f"{motion}_damping": rate for motion, rate in damping_of(scene, dt).items()}
        parameters: dict[str, Any] = {"dt": dt}
        dynamics: dict[str, Any] = {f"{motion}_damping": rate for motion, rate in scene.damping.rates.items()} if scene.damping else {}
        if not engine.is_default:
            parameters |= calibrated_values(WORLD) | {"normalized_prediction_distance": float(np.linalg.norm(scene.acceleration)) * dt**2}
            dynamics = {"can_sleep": False, "allow_fast_rotation": True, "gyroscopic_forces": gyroscopic} | damping
        parameters |= engine.given_of(WORLD)
        dynamics |= engine.given_of(BODY)
        for name, value in parameters.items():
            setattr(self._world.integration_parameters, name, rapier3d.SpringCoefficients(*value) if isinstance(value, tuple) else value)
        self.velocity_lag = 0.5 * dt / self._world.integration_parameters.num_solver_iterations
        surfaces = [surface_of(scene), surface_of(scene)]
        for surface, prefix in zip(surfaces, ("", "floor_"), strict=True):
            surface |= {name: given[prefix + name] for name in surface if prefix + name in given}
        self._body, *_ = [self._add_body(one, dynamics, surfaces[0]) for one in mapping.bodies_in(scene, engine.option("beside"))]
        if scene.floor:
            self._world.add_collider(_floor(engine.option("floor"), surfaces[1]))
        of_floor = {f"floor_{name}": value for name, value in surfaces[1].items()}
        self.settings = {"version": version("rapier3d"), **engine.options_in_force, **parameters, **dynamics, **surfaces[0], **of_floor}

    def _add_body(self, scene: Scenario, dynamics: Mapping[str, Any], surface: Mapping[str, Any]) -> Any:
        """Add a scene's body with its collider, if the scene has a floor."""
        body, world = scene.body, self._world
        inertia = rapier3d.MassProperties(np.zeros(3), body.mass, *mapping.principal_frame(body.inertia_tensor))
        x, q, v, w = (scene.initial_state[part] for part in PARTS.values())
        moving = rapier3d.RigidBody.dynamic(**dynamics).position((x, q)).linvel(v).angvel(w).additional_mass_properties(inertia)
        handle = world.add_body(moving)
        if surface:
            shape = rapier3d.SharedShape.ball(body.size) if isinstance(body, Sphere) else rapier3d.SharedShape.cuboid(*body.vertices.max(0))
            world.add_collider(rapier3d.Collider.new(shape, density=0.0, **surface), handle)
        added = world.rigid_bodies[handle]
        added.recompute_mass_properties_from_colliders(world.colliders)  # else it has none before the first step
        return added

    def advance(self, steps: int) -> None:
        for _ in range(steps):
            self._world.step()
        if not self._body.is_enabled:
            raise Diverged("Rapier disabled the body: its state is not finite")

    def state(self) -> Array:
        x, q, v, w = self._body.translation, self._body.rotation, self._body.linvel, self._body.angvel
        return np.array([x.x, x.y, x.z, q.i, q.j, q.k, q.w, v.x, v.y, v.z, w.x, w.y, w.z])

    def as_built(self) -> AsBuilt:
        found = self._body.mass_properties
        inertia = found.principal_inertia.to_tuple(), found.principal_inertia_local_frame.to_tuple()
        return mapping.built(found.mass, *inertia, self._world.gravity.to_tuple())


def _floor(kind: str, surface: Mapping[str, Any]) -> Any:
    """The collider of the floor."""
    if kind == "box":
        return rapier3d.Collider.cuboid(mapping.FLOOR_HALF_SIZE, 1.0, mapping.FLOOR_HALF_SIZE, **surface).translation((0.0, -1.0, 0.0))
    if kind == "mesh":
        return rapier3d.Collider.trimesh(mapping.SQUARE, mapping.TRIANGLES, **surface)
    return rapier3d.Collider.halfspace((0.0, 1.0, 0.0), **surface)
