"""Short runs of an engine for the checks: the choice of a scene that it accepts, and the states of a few steps."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dropspin.comparisons.conformance.outcomes import Declined
from dropspin.comparisons.conformance.probes import DT, PROBES
from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.running.recording import record
from dropspin.scenarios import Scenario, Trajectory, truth_for

Array = NDArray[np.float64]

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
            return _shortly_before_contact(scene) if scene.starts_above_floor else scene
    raise Declined(f"the engine declines {', '.join(preferred or RICHEST)}: {refusal}")


def _shortly_before_contact(scene: Scenario) -> Scenario:
    """The scene, started so late that a few steps reach the floor."""
    truth = truth_for(scene)
    assert truth is not None
    return scene.starting_at(truth(truth.events[0].time - 5.5 * DT).states[0])


def few_steps(engine: Engine, scene: Scenario, dt: float) -> Trajectory:
    """The motion of a few recorded steps."""
    few = scene.model_copy(update={"duration": (A_FEW_STEPS + 0.5) * dt})
    return record(engine, few, dt, verify=False).motion


def recorded(engine: Engine, scene: Scenario, dt: float = DT) -> Array:
    """The states of a few recorded steps, shape (1 + A_FEW_STEPS, 13)."""
    return few_steps(engine, scene, dt).states


def advanced(engine: Engine, scene: Scenario, between: Callable[[], None] = lambda: None) -> Array:
    """The state after a few steps in two calls, with something else between them, shape (13,)."""
    with engine.prepare(scene, DT) as simulation:
        simulation.advance(A_FEW_STEPS // 2)
        between()
        simulation.advance(A_FEW_STEPS - A_FEW_STEPS // 2)
        return simulation.state().copy()
