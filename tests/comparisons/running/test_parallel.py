"""Scenes on several processors: the same results bit for bit, and failures that cost their own rows."""

import os
import signal
import threading
import time

import pandas as pd
import pytest
from support import engines as made

import dropspin as ds
from dropspin.comparisons.running import processes
from dropspin.comparisons.running.engine_run import run_engine
from dropspin.comparisons.running.parallel import results_in_parallel

SCENES = ["drop-ball", "spin-dzhanibekov", "fall-tilted"]
DTS = [8e-3, 4e-3, 2e-3]


def test_results_do_not_depend_on_the_number_of_jobs():
    one, several = (ds.run(SCENES, ["wang", "mujoco"], DTS, jobs=jobs) for jobs in (1, 3))
    for name in ("table", "agreements", "predictions"):
        first, second = (getattr(results, name).drop(columns="time_per_step") for results in (one, several))
        pd.testing.assert_frame_equal(first, second, check_exact=True)
    assert list(one.scenes) == list(several.scenes) == SCENES
    assert (several.measurements["time_per_step"] > 0.0).all()
    for key, motion in one.trajectories.items():
        assert (motion.states == several.trajectories[key].states).all()


def test_results_of_pieces_are_in_their_order_and_pieces_run_at_the_same_time():
    later, shares = threading.Event(), []

    def work(piece, crew, report):
        report(f"piece {piece}")
        if piece == "first":
            assert later.wait(20.0)
        else:
            later.set()
        return piece.upper()

    crews = [processes.EngineProcesses(ds.ResourceLimits()) for _ in range(2)]
    assert results_in_parallel(["first", "second"], work, crews, lambda what, share: shares.append(share)) == ["FIRST", "SECOND"]
    assert shares == [0.0, 0.0]


@pytest.mark.parametrize("jobs", [0, -1, 1.5, True, "2"])
def test_number_of_jobs_that_is_none_is_refused(jobs):
    with pytest.raises(ds.DropspinError, match=r"jobs: got .*; give a whole number above 0"):
        ds.run("fall-spin", "wang", 0.01, jobs=jobs)


class Killed(made.Exact):
    """Ends its process in one scene."""

    name = "killed"

    def prepare(self, scene, dt):
        if scene.name == "fall-spin":
            os.kill(os.getpid(), signal.SIGKILL)
        return super().prepare(scene, dt)


@pytest.mark.extended
@pytest.mark.usefixtures("engine_processes")
def test_engine_that_ends_its_process_costs_its_own_rows_and_is_tried_once(monkeypatch):
    called, call = [], processes.EngineProcesses.call

    def noted(self, entry, work, *given, **named):
        called.extend([entry.label] if work is run_engine else [])
        return call(self, entry, work, *given, **named)

    monkeypatch.setattr(processes.EngineProcesses, "call", noted)
    table = ds.run(["fall-spin", "spin-principal"], [Killed(), "wang"], 0.01, jobs=2).table
    broken = table[table["verdict"] == "crashed"]
    assert list(zip(broken["scene"], broken["engine"], strict=True)) == [("fall-spin", "killed")]
    assert "ended by SIGKILL" in broken["reason"].iloc[0]
    assert sorted(called) == ["killed", "wang", "wang"]


class Compiling(made.Exact):
    """Compiles when its process first simulates."""

    name = "compiling"
    compiles = True
    compiled = False

    def prepare(self, scene, dt):
        if not Compiling.compiled:
            until = time.process_time() + 1.5
            while time.process_time() < until:
                pass
            Compiling.compiled = True
        return super().prepare(scene, dt)


class SlowAtFirst(Compiling):
    """The same without saying so."""

    name = "slow-at-first"
    compiles = False


@pytest.mark.extended
@pytest.mark.usefixtures("engine_processes")
def test_compilation_is_measured_apart_and_not_limited():
    """It takes longer than the limit, which ends an engine that does not say that it compiles."""
    limit = ds.ResourceLimits(processor_time=0.5)
    results = ds.run("fall-spin", [Compiling(), SlowAtFirst()], 0.01, resources=limit)
    assert results.provenance["compilation"].keys() == {"compiling"}
    assert results.provenance["compilation"]["compiling"] > 1.0
    of = results.table.set_index("engine")
    assert set(of.loc["compiling", "verdict"]) == {"passed", "measured"}
    assert of.loc["slow-at-first", "verdict"] == "timed_out"
