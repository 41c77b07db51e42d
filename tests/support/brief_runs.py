"""Runs that cost less: from few start phases, with few steps timed.

Of most scenes, tests need the results, not that their means are the exact ones to a 64th of a step; and no test asserts on a clock.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from unittest import mock

from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.running import start_phases, timing
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.scenarios import Scenario

FEW, OF_CATALOGUE, ALL = 4, 8, start_phases.START_PHASES
TIMED_STEPS = 20
MEANS_ARE_TESTED = ("drop-ball", "drop-ball-brisk", "drop-ball-dull", "drop-ball-lively", "drop-box-edge", "drop-box-flat")
"""Scenes whose means over start phases are compared with formulas, or with bounds that few starts miss."""


def phases_of(scene_name: str) -> int:
    """The number of start phases of a scene in `core_run`."""
    return ALL if scene_name in MEANS_ARE_TESTED else OF_CATALOGUE


@contextmanager
def all_starts() -> Iterator[None]:
    """Run scenes from as many start phases as outside tests."""
    with mock.patch.object(start_phases, "START_PHASES", ALL):
        yield


@contextmanager
def few_starts() -> Iterator[None]:
    """Run scenes of the catalogue from few start phases, but for those whose means are tested."""
    count = start_phases.number_of_phases

    def few(own: start_phases.StartPhase, dt: float) -> int:
        return min(count(own, dt), phases_of(own.scene.name))

    with all_starts(), mock.patch.object(start_phases, "number_of_phases", few):
        yield


time_wholly = timing.time_engine


def time_briefly(entry: EngineEntry, scene: Scenario, dt: float) -> timing.Timing:
    """As `time_engine`, by the first steps of a scene."""
    whole = timing.time_steps

    def first_steps(engine: Engine, scene: Scenario, dt: float, steps: int) -> timing.TimedSteps:
        return whole(engine, scene, dt, min(steps, TIMED_STEPS))

    with mock.patch.object(timing, "time_steps", first_steps):
        return time_wholly(entry, scene, dt)


@contextmanager
def whole_timings() -> Iterator[None]:
    """Time all steps of a scene, beside which the call is short."""
    with mock.patch.object(timing, "time_engine", time_wholly):
        yield
