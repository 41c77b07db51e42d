"""Start phases: a bounce from one height is luck, from many it is a measurement.

An engine notices an impact at the first step that ends below the floor, so its error depends on where in a step the impact
falls. Raising the start by equal parts of one step's fall draws that phase evenly (stratified sampling). A body that starts on
the floor cannot be raised; it starts by equal parts of a step farther on its way instead.
"""

import numpy as np

from scenarios import Scenario, Truth

PHASES = 32


def start_phases(scene: Scenario, truth: Truth | None, dt: float) -> list[Scenario]:
    """The scene from 32 starts that put its first impact at 32 places in a step, or the scene alone if none comes after the first step."""
    if truth is None or not truth.events or truth.events[0].time <= dt:
        return [scene]
    shares = (np.arange(PHASES) + 0.5) / PHASES
    if not scene.starts_above_floor:
        return [scene.starting_at(state) for state in truth(shares * dt).states]
    starts = np.tile(scene.initial_state, (PHASES, 1))
    starts[:, 1] += shares * -float(truth.events[0].before[8]) * dt
    return [scene.starting_at(state) for state in starts]
