"""Start phases: a bounce from one height is luck, from many it is a measurement.

An engine notices an impact at the first step that ends below the floor, so its error depends on where in a step the impact
falls. Raising the start by equal parts of one step's fall draws that phase evenly (stratified sampling).
"""

import numpy as np

from scenarios import Scenario, Truth

PHASES = 32


def start_phases(scene: Scenario, truth: Truth | None, dt: float) -> list[Scenario]:
    """The scene from 32 start heights within one step's fall, or the scene alone where nothing hits the floor."""
    if truth is None or not truth.events or scene.clearance <= 0.0:
        return [scene]
    fall = -float(truth.events[0].before[8]) * dt
    start = scene.initial_state
    up = np.zeros(13)
    up[1] = fall
    return [scene.starting_at(start + (phase + 0.5) / PHASES * up) for phase in range(PHASES)]
