"""Start phases: a bounce from one start is luck, from many it is a measurement.

An engine notices an impact at the first step that ends below the floor, so its error depends on where in a step the impact
falls. Starting by equal parts of a step farther on the scene's way draws that phase evenly (stratified sampling).
"""

from typing import NamedTuple

import numpy as np

from scenarios import Scenario, Truth

PHASES = 32
MOSTLY_REST = 0.1


class Phase(NamedTuple):
    """A scene from one start, and its exact motion, if that is known."""

    scene: Scenario
    truth: Truth | None


def start_phases(scene: Scenario, truth: Truth | None, dt: float) -> list[Phase]:
    """The scene from 32 starts that put its first impact at 32 places in a step.

    The scene alone if no impact comes after the first step, and if all are over in a tenth of the scene: what it is about is rest.
    """
    if truth is None or not truth.events or truth.events[0].time <= dt or truth.events[-1].time < MOSTLY_REST * scene.duration:
        return [Phase(scene, truth)]
    delays = (np.arange(PHASES) + 0.5) / PHASES * dt
    return [Phase(scene.starting_at(state), truth.after(delay)) for state, delay in zip(truth(delays).states, delays, strict=True)]
