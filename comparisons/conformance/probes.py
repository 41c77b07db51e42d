"""Probes: scenes built to distinguish the faults of adapters, which `probes.toml` defines, and short runs of them."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from dropspin.comparisons.conformance.outcomes import Declined
from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.running.driving import record
from dropspin.scenarios import Scenario, Trajectory
from dropspin.scenarios.loading import from_mapping, read_toml
from dropspin.scenarios.rotations import angle_between_orientations
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN, VELOCITY, Array
from dropspin.scenarios.truths import exact_solution

FILE = Path(__file__).with_name("probes.toml")
DT = 2.5e-4
"""The time step [s]; so short that the discretisation error of any engine is small beside the error of a fault."""


class Probe(NamedTuple):
    """A scene, and the errors that an engine may have.

    Attributes:
        name: The name of its check.
        scene: The scene.
        allowed: The largest errors of position [m], attitude [rad], velocity [m/s], angular velocity [rad/s]; inf where not compared.
    """

    name: str
    scene: Scenario
    allowed: tuple[float, ...]

    @property
    def times(self) -> Array:
        """The times of comparison [s]: half of the duration and the end."""
        return DT * self.rows

    @property
    def rows(self) -> Array:
        """The steps after which states are compared."""
        steps = self.scene.steps(DT)
        return np.array([steps // 2, steps])

    @property
    def exact(self) -> Array:
        """The states of the exact solution at these times, shape (2, 13)."""
        return exact_solution(self.scene)(self.times).states

    def off(self, states: Array, expected: Array) -> Array:
        """The largest difference of states, shape (2, 13), from others, shape (..., 2, 13), over the allowed one; inf if not finite."""
        worst = np.max(differences(states, expected) / np.array(self.allowed), axis=-1)
        return np.where(np.isfinite(worst), worst, np.inf)


def differences(states: Array, expected: Array) -> Array:
    """The largest differences of position [m], attitude [rad], velocity [m/s], angular velocity [rad/s], shape (..., 4)."""
    position, velocity, spin = (np.linalg.norm(states[..., part] - expected[..., part], axis=-1) for part in (POSITION, VELOCITY, SPIN))
    turned = angle_between_orientations(states[..., ORIENTATION], expected[..., ORIENTATION])
    return np.stack([position, turned, velocity, spin], axis=-1).max(axis=-2)


def _probe(name: str, allowed: Sequence[float], **tables: Any) -> Probe:
    return Probe(name, from_mapping({"name": name.replace(" ", "-"), **tables}), tuple(allowed))


PROBES = tuple(_probe(name, **content) for name, content in read_toml(FILE, FILE.name).items())

A_FEW_STEPS = 24
FLIGHTS = ("tumbling", "turning", "falling straight", "coasting")
RICHEST = ("corner", "bouncing ball", *FLIGHTS)
"""Names of probes, those that involve most of an engine first."""


def accepted_scene(engine: Engine, *preferred: str) -> Scenario:
    """The first of some probes' scenes that an engine accepts, by default of `RICHEST`; one above a floor begins shortly before an impact.

    Raises:
        Declined: The engine accepts none of them.
    """
    probes = {probe.name: probe for probe in PROBES}
    refusal = None
    for name in preferred or RICHEST:
        scene = probes[name].scene
        refusal = engine.refusal(scene)
        if refusal is None:
            if not scene.starts_above_floor:
                return scene
            exact = exact_solution(scene)
            return scene.starting_at(exact(exact.events[0].time - 5.5 * DT).states[0])
    raise Declined(f"the engine declines {', '.join(preferred or RICHEST)}: {refusal}")


def few_steps(engine: Engine, scene: Scenario, dt: float) -> Trajectory:
    """The motion of a few recorded steps."""
    few = scene.model_copy(update={"duration": (A_FEW_STEPS + 0.5) * dt})
    return record(engine, few, dt, verify=False).motion


def recorded(engine: Engine, scene: Scenario, dt: float = DT) -> Array:
    """The states of a few recorded steps, shape (1 + A_FEW_STEPS, 13)."""
    return few_steps(engine, scene, dt).states


def state_after(engine: Engine, scene: Scenario, calls: Iterable[int], before: Callable[[], None] = lambda: None) -> Array:
    """The state after calls of `advance` with some steps each, with something else before each of them, shape (13,)."""
    with engine.prepare(scene, DT) as simulation:
        for steps in calls:
            before()
            simulation.advance(steps)
        return simulation.state().copy()
