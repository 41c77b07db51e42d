"""Start phases: the same drop from 32 starts, so that where in a time step the first impact falls is averaged out.

An engine detects an impact at the first step that ends below the floor, so its error depends on the phase of the impact within a step.
Starts that lie equal parts of a step further along the scene's motion draw that phase evenly (stratified sampling).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dropspin.scenarios import Scenario, Trajectory, Truth

Array = NDArray[np.float64]

START_PHASES, QUICK_START_PHASES = 32, 8
REST_SHARE = 0.1
"""A scene whose impacts are over in this share of its duration is about rest, not about impacts."""


class StartPhase(NamedTuple):
    """A scene from one start, and its exact solution, if it is known.

    Attributes:
        scene: The scene.
        truth: Its exact solution.
        quick: Whether the scene is to be run from few starts.
        delay: Time by which its start is later than the scene's own [s].
    """

    scene: Scenario
    truth: Truth | None
    quick: bool = False
    delay: float = 0.0


def number_of_phases(own: StartPhase, dt: float) -> int:
    """The number of start phases: 1 if no impact comes after the first step [s], or if all are over in a tenth of the duration."""
    scene, truth, quick, _ = own
    if truth is None or not truth.events or truth.events[0].time <= dt or truth.events[-1].time < REST_SHARE * scene.duration:
        return 1
    return QUICK_START_PHASES if quick else START_PHASES


def start_phases(scene: Scenario, truth: Truth | None, dt: float, *, quick: bool = False) -> list[StartPhase]:
    """The scene from starts that put its first impact at as many phases of a time step, or only the scene itself: `number_of_phases`."""
    count = number_of_phases(StartPhase(scene, truth, quick), dt)
    if truth is None or count == 1:
        return [StartPhase(scene, truth)]
    delays = (np.arange(count) + 0.5) / count * dt
    starts = zip(truth(delays).states, delays, strict=True)
    return [StartPhase(scene.starting_at(state), truth.after(delay), delay=delay) for state, delay in starts]


def exact_motions(truth: Truth, phases: Sequence[StartPhase], times: Array) -> list[Trajectory]:
    """The exact motions from start phases at times [s], as far as each is known: one call, with the exact solution of the scene itself."""
    known = [times[phase.truth.covers(times)] for phase in phases if phase.truth is not None]
    states = truth.states(np.concatenate([t + phase.delay for t, phase in zip(known, phases, strict=True)]))
    parts = np.split(states, np.cumsum([len(t) for t in known[:-1]]))
    return [Trajectory.from_states(t, part) for t, part in zip(known, parts, strict=True)]
