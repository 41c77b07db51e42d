"""A simulation of one scene by an engine that steps worlds together: a batch of one."""

from collections.abc import Mapping
from typing import Any

from dropspin.comparisons.engines.base import Array, AsBuilt, BatchSimulation, Simulation, numpy_array
from dropspin.scenarios import Scenario


class OneWorld(Simulation):
    """A batch of one world, with its settings and what was built."""

    def __init__(self, scene: Scenario, worlds: BatchSimulation, settings: Mapping[str, Any], built: AsBuilt) -> None:
        self.velocity_lag, self.settings = worlds.velocity_lag, settings
        self._scene, self._worlds, self._built = scene, worlds, built

    def advance(self, steps: int) -> None:
        self._worlds.advance(steps)

    def state(self) -> Array:
        [state] = numpy_array(self._worlds.states())
        return state

    def record(self, steps: int, every: int = 1) -> Array:
        [states] = self._worlds.record(steps, every)
        self.known_limitations = self._worlds.limitations_of(self._scene, states) if every == 1 else []
        return states

    def as_built(self) -> AsBuilt:
        return self._built

    def close(self) -> None:
        self._worlds.close()
