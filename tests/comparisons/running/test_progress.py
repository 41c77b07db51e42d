"""Progress of a run within a scene, reported from the engine's process."""

import time
from itertools import pairwise

import pytest
from support import engines as made

import dropspin as ds
from dropspin.comparisons.running import processes
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.comparisons.running.engine_run import run_engine
from dropspin.comparisons.running.start_phases import START_PHASES, start_phases

DT = 0.01
BALL = ds.load("drop-ball")
STARTS = [phase.scene for phase in start_phases(BALL, ds.truth_for(BALL), DT)]


def test_every_simulation_is_reported():
    """The scene's own start, and its start phases, one by one or as a batch."""
    total = 1 + START_PHASES
    for engine, done in ((made.Exact(), range(1, 1 + total)), ("wang", (1, total))):
        reported = []
        run_engine(engine_entry(engine), BALL, DT, STARTS, False, lambda *counts, reported=reported: reported.append(counts))
        assert reported == [(number, total) for number in done]


class SlowSimulation(made.ExactSimulation):
    def record(self, steps, every=1):
        time.sleep(0.02)
        return super().record(steps, every)


class Slow(made.Exact):
    name = "slow"

    def prepare(self, scene, dt):
        return SlowSimulation(scene, dt)


@pytest.mark.usefixtures("all_start_phases")
def test_a_slow_engine_reports_progress_within_a_scene(monkeypatch):
    """Between the beginning and the end of a time step the numbers grow, and each time step is finished once."""
    monkeypatch.setattr(processes, "POLL", 0.01)
    reported = []
    ds.run(BALL, Slow(), [2 * DT, DT], on_progress=reported.append)
    for dt in (2 * DT, DT):
        mine = [one for one in reported if one.dt == dt and not one.added and not one.timing]
        assert (mine[0].done, mine[0].finished) == (0, False)
        assert [one.finished for one in mine].count(True) == mine[-1].finished == 1
        counts = [one.done for one in mine[:-1]]
        assert all(first <= second for first, second in pairwise(counts))
        assert any(0 < one.done < one.total == 1 + 32 for one in mine)


def test_scenes_of_an_earlier_run_are_finished_at_once():
    part = ds.run("fall-spin", "wang", DT)
    reported = []
    ds.run("fall-spin", "wang", DT, done=[part], on_progress=reported.append)
    assert [(one.scene, one.engine, one.dt, one.finished) for one in reported] == [("fall-spin", "wang", DT, True)]
