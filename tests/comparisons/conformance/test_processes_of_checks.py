"""Checks of `conform` in processes of their own: what one simulation leaves for another, and engines that end their process."""

import os

import numpy as np
import pytest
from support import breaking
from support import engines as made

from dropspin.comparisons.conformance.checks import AFTER_OTHERS, AFTER_SIMILAR, ANOTHER_PROCESS, CHECKS, conform
from dropspin.comparisons.running.process_limits import ResourceLimits

pytestmark = pytest.mark.usefixtures("engine_processes")


class Caching(made.Exact):
    """Keeps the floor of the first scene for all others, as a cache with too few keys does."""

    def __init__(self):
        super().__init__()
        self._floor = None

    def prepare(self, scene, dt):
        self._floor = self._floor or scene.floor
        return super().prepare(scene.model_copy(update={"floor": scene.floor and self._floor}), dt)


def test_state_that_other_scenes_leave_is_found():
    """Each scene gives the same bits in one process, whatever runs between; other orders differ, and a check that runs alone passes."""
    found = {one.check: one for one in conform(Caching(), ["bouncing ball", "repeats", "dull ball"])}
    assert [one.outcome for one in found.values()] == ["passed", "failed", "failed"]
    assert found["repeats"].message == AFTER_SIMILAR
    assert found["dull ball"].message.startswith(AFTER_OTHERS)


class Raising(made.Exact):
    """Raises for a second mass."""

    def __init__(self):
        super().__init__()
        self._mass = None

    def prepare(self, scene, dt):
        self._mass = self._mass or scene.body.mass
        if scene.body.mass != self._mass:
            raise RuntimeError("another mass")
        return super().prepare(scene, dt)


class ByProcess(made.Exact):
    """Depends on the number of its process."""

    def prepare(self, scene, dt):
        push = 1e-4 * (os.getpid() % 1000)
        return made.ExactSimulation(scene, dt, lambda row, time: row + push * np.eye(13)[0])


@pytest.mark.parametrize(("engine", "message"), [(Raising, AFTER_SIMILAR), (ByProcess, ANOTHER_PROCESS)])
def test_other_kinds_of_state_are_found(engine, message):
    """An exception after a similar scene; a motion that depends on the process is not said to depend on other scenes."""
    [found] = conform(engine(), ["repeats"])
    assert (found.outcome, found.message) == ("failed", message)


def test_engine_that_ends_its_process_in_a_later_check_costs_this_check_alone():
    class Exiting(made.Exact):
        def prepare(self, scene, dt):
            if scene.name == "dull-ball":
                os._exit(0)
            return super().prepare(scene, dt)

    found = {one.check: one.outcome for one in conform(Exiting(), ["coasting", "dull ball", "turning"])}
    assert found == {"coasting": "passed", "dull ball": "crashed", "turning": "passed"}


def test_an_engine_that_waits_for_ever_is_waited_for_twice():
    """A check that is named is run all the same."""

    class Waiting(made.Exact):
        name = "waiting"

        def prepare(self, scene, dt):
            breaking.sleep()

    limits = ResourceLimits(processor_time=0.05)
    found = conform(Waiting(), resources=limits)
    late = [result for result in found if result.outcome == "timed_out"]
    assert [result.check for result in found] == list(CHECKS)
    assert [result.message.startswith("not done after ") for result in late] == [True, True] + [False] * (len(late) - 2)
    why = f"not run, because {late[0].check} and {late[1].check} used up their time; run it with --check"
    assert {result.message for result in late[2:]} == {why}
    [named] = conform(Waiting(), ["repeats"], resources=limits)
    assert named.message.startswith("not done after ")
