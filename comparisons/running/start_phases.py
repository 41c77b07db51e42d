"""Start phases: the same drop from 32 starts, so that where in a time step the first impact falls is averaged out.

An engine detects an impact at the first step that ends below the floor, so its error depends on the phase of the impact within a step.
Starts that lie equal parts of a step further along the scene's motion draw that phase evenly (stratified sampling).
"""

from typing import NamedTuple

import numpy as np

from dropspin.scenarios import Scenario, Truth

START_PHASES, QUICK_START_PHASES = 32, 8
REST_SHARE = 0.1
"""A scene whose impacts are over in this share of its duration is about rest, not about impacts."""


class StartPhase(NamedTuple):
    """A scene from one start, and its exact solution, if it is known; `quick` if the scene is to be run from few starts."""

    scene: Scenario
    truth: Truth | None
    quick: bool = False


def number_of_phases(own: StartPhase, dt: float) -> int:
    """The number of start phases: 1 if no impact comes after the first step [s], or if all are over in a tenth of the duration."""
    scene, truth, quick = own
    if truth is None or not truth.events or truth.events[0].time <= dt or truth.events[-1].time < REST_SHARE * scene.duration:
        return 1
    return QUICK_START_PHASES if quick else START_PHASES


def start_phases(scene: Scenario, truth: Truth | None, dt: float, *, quick: bool = False) -> list[StartPhase]:
    """The scene from starts that put its first impact at as many phases of a time step, or only the scene itself: `number_of_phases`."""
    count = number_of_phases(StartPhase(scene, truth, quick), dt)
    if truth is None or count == 1:
        return [StartPhase(scene, truth)]
    delays = (np.arange(count) + 0.5) / count * dt
    return [StartPhase(scene.starting_at(state), truth.after(delay)) for state, delay in zip(truth(delays).states, delays, strict=True)]
