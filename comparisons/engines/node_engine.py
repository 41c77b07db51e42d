"""Engines in JavaScript, in a process of Node.js: what their adapters share.

An adapter is a subclass of `NodeEngine` and a driver, a file of the same name that ends in .cjs: it builds a world of a scene.
"""

import inspect
from abc import abstractmethod
from collections.abc import Mapping
from itertools import count
from pathlib import Path
from typing import Any, ClassVar

from dropspin.comparisons.engines import mapping
from dropspin.comparisons.engines.base import Array, AsBuilt, Diverged, Engine, Simulation
from dropspin.comparisons.engines.node_process import node
from dropspin.comparisons.engines.settings import Setting
from dropspin.scenarios import Scenario
from dropspin.scenarios.bodies import Sphere
from dropspin.scenarios.errors import DropspinError
from dropspin.scenarios.state import PARTS

NUMBERS = count()
"""Of the worlds in Node.js."""


class NodeEngine(Engine):
    """An engine in JavaScript; a subclass gives its `name`, its `package` of npm, its `world_settings`, and a driver."""

    package: ClassVar[str]
    shapes: ClassVar = ("sphere", "box")
    choices: ClassVar = {"profile": mapping.PROFILES, "beside": mapping.BESIDE}
    representations: ClassVar[tuple[str, ...]] = ("beside",)
    groups: ClassVar[Mapping[str, Mapping[str, Setting]]] = {}
    """The settings that can be given, by the part of `world_settings` that has them."""

    @abstractmethod
    def world_settings(self, scene: Scenario, dt: float) -> dict[str, Any]:
        """The engine's settings for a scene at a time step [s], as the driver takes them, but for those that are given."""

    def chosen(self, scene: Scenario, dt: float) -> dict[str, Any]:
        """The settings with those that are given."""
        chosen = self.world_settings(scene, dt)
        for group, settings in self.groups.items():
            chosen[group] |= self.given_of(settings)
        return chosen

    def prepare(self, scene: Scenario, dt: float) -> Simulation:
        return NodeSimulation(self, scene, dt)


class NodeSimulation(Simulation):
    """A world of an engine in Node.js."""

    def __init__(self, engine: NodeEngine, scene: Scenario, dt: float) -> None:
        options = engine.options_in_force
        self._node = node(Path(inspect.getfile(type(engine))).with_suffix(".cjs"), engine.package)
        self._world = next(NUMBERS)
        floor = {"kind": options.get("floor", "plane"), "halfSize": mapping.FLOOR_HALF_SIZE} if scene.floor else None
        bodies = [_body(one) for one in mapping.bodies_in(scene, options["beside"])]
        given = {"dt": dt, "gravity": scene.acceleration.tolist(), "floor": floor, "bodies": bodies}
        answer, _ = self._node.ask("open", world=self._world, settings=engine.chosen(scene, dt), **given)
        self._built, self.velocity_lag = answer.get("built"), 0.5 * dt / answer["substeps"]
        self._state = self.record(0)[0]
        self.settings = {"version": self._node.version, **options, **answer["settings"]}
        if unknown := engine.given.keys() - self.settings.keys():
            raise DropspinError(f"{engine.name} {self._node.version} has no {', '.join(sorted(unknown))}.")

    def advance(self, steps: int) -> None:
        self.record(steps, max(steps, 1))

    def record(self, steps: int, every: int = 1) -> Array:
        answer, states = self._node.ask("record", world=self._world, steps=steps, every=every)
        if "broken" in answer:
            raise Diverged(answer["broken"])
        self._state = states[-1]
        return states

    def state(self) -> Array:
        return self._state

    def as_built(self) -> AsBuilt | None:
        return None if self._built is None else mapping.built(**self._built)

    def close(self) -> None:
        if not self._node.has_ended:
            self._node.ask("close", world=self._world)


def _body(scene: Scenario) -> dict[str, Any]:
    """A scene's body, as drivers take it."""
    body = scene.body
    moments, axes = mapping.principal_frame(body.inertia_tensor)
    shape = {"radius": body.size} if isinstance(body, Sphere) else {"halfExtents": body.vertices.max(0).tolist()}
    inertia = {"mass": body.mass, "moments": moments.tolist(), "axes": axes.tolist()}
    return shape | inertia | {name: scene.initial_state[part].tolist() for name, part in PARTS.items()}
