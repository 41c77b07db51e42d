"""Motions are released as soon as they are measured, so that the main process of any run stays below 1 GiB."""

import subprocess
import sys
import time
import weakref

import pytest
from support.cli import DROPSPIN

import dropspin as ds
from dropspin.comparisons.judging.convergence import Claim
from dropspin.comparisons.running.arguments import MOST_ROWS
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.comparisons.running.engine_run import EngineRun, motions_from
from dropspin.comparisons.running.process_limits import FIVE_MINUTES
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.start_phases import StartPhase, compare, measure

BALL = ds.load("drop-ball")
BOUNCING = """
duration = {duration}
body = {{shape = "sphere", radius = 0.1, mass = 1.0}}
floor = {{restitution = 1.0, friction = "none"}}
gravity = {{acceleration = [0.0, -9.8, 0.0]}}
start = {{position = [0.0, 1.1, 0.0]}}
"""

MEASURED = """
import resource, subprocess, sys
subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL, check=True)
print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
"""
"""Runs a command, and prints the largest size of its processes [KiB]."""


def test_reason_why_a_metric_is_unresolved_keeps_no_motion():
    """Its traceback would, with the frames in which the motion was measured."""
    own, dt = StartPhase(BALL, ds.truth_for(BALL)), 0.2
    motion = ds.simulate(BALL, "wang", dt)
    cases = compare([motion], [own])
    points = measure(own, dt, EngineRun(Claim("wang"), motion=motion), cases, [])
    assert any(point.unresolved is not None for point in points.values())
    case = weakref.ref(cases[0])
    del cases
    assert case() is None


@pytest.mark.usefixtures("engine_processes")
def test_pool_of_processes_keeps_no_motion_that_it_returned():
    with EngineProcesses(FIVE_MINUTES) as processes:
        motion = weakref.ref(*processes.call(engine_entry("wang"), motions_from, [BALL], 0.01, None))
        for _ in range(100):  # the thread that received it may not have dropped it yet
            if motion() is None:
                break
            time.sleep(0.02)
        assert motion() is None


@pytest.mark.slow
def test_longest_run_stays_below_a_gibibyte(tmp_path):
    """A ball that bounces until the end, with as many steps as a run may have; the engine's process is smaller than the main one."""
    (tmp_path / "long.toml").write_text(BOUNCING.format(duration=1e-3 * MOST_ROWS))
    arguments = (DROPSPIN, "run", "long.toml", "-e", "wang", "--dt", "0.004", "--dt", "0.002", "--dt", "0.001")
    # In a small process: that of the tests may be larger than the limit, and what is started has at first the size of what starts it.
    measured = subprocess.run(
        [sys.executable, "-c", MEASURED, *arguments], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, check=True
    )
    assert int(measured.stdout) < 2**20  # KiB
