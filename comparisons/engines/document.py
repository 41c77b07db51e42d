"""The engine `document`: the note, literally."""

from typing import Any

import numpy as np

import reference_impl
from comparisons.engines.base import Array, AsBuilt, Engine, Simulation, version
from scenarios import Scenario
from scenarios.body import Body, Box, Sphere, Vertices


class Document(Engine):
    """Algorithms 1 and 2 of the note."""

    name = "document"

    def declines(self, scene: Scenario) -> str | None:
        """The note knows no friction between none and infinite."""
        if scene.floor is not None and not isinstance(scene.floor.friction, str):
            return f"the note has no law for a Coulomb coefficient ({scene.floor.friction:g}); friction is 'none' or 'infinite'"
        return None

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return DocumentSimulation(scene, dt)


class DocumentSimulation(Simulation):
    """A state that `reference_impl.simulate` moves on."""

    staggered = True

    def __init__(self, scene: Scenario, dt: float) -> None:
        self._body = _body(scene.body)
        self._world = _world(scene)
        self._dt = dt
        self._state = scene.initial_state
        self.settings = {"integrator": "semi-implicit Euler (Algorithm 1)", "numba": version("numba")} | _floor_settings(scene)

    def advance(self, steps: int) -> None:
        self._state = reference_impl.simulate(self._state, self._body, self._world, self._dt, steps, max(steps, 1))[-1]

    def state(self) -> Array:
        return self._state.copy()

    def record(self, steps: int, every: int = 1) -> Array:
        rows = reference_impl.simulate(self._state, self._body, self._world, self._dt, steps - steps % every, every)
        self._state = rows[-1].copy()
        return rows

    def as_built(self) -> AsBuilt:
        gravity = np.zeros(3) if self._world.gravity is None else self._world.gravity
        return AsBuilt(self._body.mass, self._body.inertia, gravity)


def _body(body: Body) -> reference_impl.Body:
    return reference_impl.Body(body.mass, _inertia(body), body.vertices, body.rounding)


def _inertia(body: Body) -> Array:
    """From the scene's words by the note's own formulas; the scene's tensor is computed apart from this one."""
    if isinstance(body.inertia, tuple):
        return np.diag(body.inertia)
    if body.inertia == "note":
        return reference_impl.vertex_inertia(body.vertices, np.ones(len(body.vertices)))
    if isinstance(body, Sphere):
        return reference_impl.solid_sphere_inertia(body.mass, body.radius)
    if isinstance(body, Box) and body.inertia == "solid":
        return reference_impl.solid_box_inertia(body.mass, np.array(body.half_extents))
    masses = body.masses if isinstance(body, Vertices) else None
    share = np.full(len(body.vertices), body.mass / len(body.vertices)) if masses is None else np.array(masses)
    return reference_impl.vertex_inertia(body.vertices, share)


def _world(scene: Scenario) -> reference_impl.World:
    floor = scene.floor
    return reference_impl.World(
        gravity=None if scene.gravity is None else scene.acceleration,
        floor=None if floor is None else reference_impl.Floor(floor.restitution, floor.friction == "infinite", floor.rest_speed),
        damping=None if scene.damping is None else (scene.damping.linear, scene.damping.angular),
    )


def _floor_settings(scene: Scenario) -> dict[str, Any]:
    if scene.floor is None:
        return {}
    return {
        "impulse": "eq 17 (sticking)" if scene.floor.friction == "infinite" else "eq 15 (frictionless)",
        "contact": "mean point",
    }
