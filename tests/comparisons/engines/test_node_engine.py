"""The bridge to engines in JavaScript, with a tiny one: steps, a process that breaks costs its simulation, and none is left behind."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from support.tiny_engine import PACKAGE, TinyEngine, install

from dropspin import scenarios
from dropspin.comparisons.engines.base import Diverged
from dropspin.comparisons.engines.node_process import node
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses

DT = 2e-3
DRIVER = Path(__file__).parents[2] / "support" / "tiny_engine.cjs"
SCENE = {"duration": 1.0, "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0}, "start": {"velocity": [1.0, 2.0, 3.0]}}


@pytest.fixture(autouse=True)
def _installed(tmp_path, monkeypatch):
    install(tmp_path)
    monkeypatch.chdir(tmp_path)


def prepared(gravity=-9.8):
    return TinyEngine().prepare(scenarios.load(SCENE | {"gravity": {"acceleration": [0.0, gravity, 0.0]}}), DT)


def moved():
    """The state after ten steps."""
    with prepared() as simulation:
        simulation.advance(10)
        return simulation.state().tolist()


def this_node():
    return node(DRIVER, PACKAGE)


def test_steps_are_those_of_the_driver():
    """Semi-implicit Euler: after n steps the height is v t + g dt² n (n + 1)/2, and every state is returned."""
    with prepared() as simulation:
        rows = simulation.record(20, every=5)
        assert simulation.settings == {"version": "1.2.3", "profile": "calibrated", "beside": "none", "lowest": -1e6}
        assert simulation.velocity_lag == 0.5 * DT
        assert simulation.as_built() is None
    n = np.arange(0, 21, 5)
    np.testing.assert_allclose(rows[:, 1], 2.0 * n * DT - 9.8 * DT**2 * n * (n + 1) / 2.0, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(rows[-1], moved_by(20))


def moved_by(steps):
    with prepared() as simulation:
        simulation.advance(steps)
        return simulation.state()


def test_two_worlds_of_a_process_do_not_disturb_each_other():
    with prepared() as first, prepared(gravity=-1.0) as second:
        first.advance(5)
        second.advance(10)
        first.advance(5)
        assert first.state().tolist() == moved()


def test_a_breakdown_that_the_driver_states_is_raised():
    with prepared(gravity=-1e12) as simulation, pytest.raises(Diverged, match=r"^below the lowest height$"):
        simulation.advance(1000)


def stepped_while_it_is_killed(steps):
    with prepared() as simulation:
        threading.Timer(0.1, os.kill, [this_node().pid, signal.SIGKILL]).start()
        while True:
            simulation.advance(steps)


@pytest.mark.parametrize("steps", [1, 100_000_000])
def test_a_crash_is_named_and_the_next_simulation_has_another_process(steps):
    expected = moved()
    with pytest.raises(RuntimeError, match=r"^Node\.js ended with SIGKILL$"):
        stepped_while_it_is_killed(steps)
    assert moved() == expected


def test_a_process_that_ended_between_two_requests_is_named():
    with prepared() as simulation:
        process = this_node()._process
        process.kill()
        process.wait()
        with pytest.raises(RuntimeError, match=r"^Node\.js ended with SIGKILL$"):
            simulation.advance(1)


def test_an_error_of_the_driver_is_named():
    with pytest.raises(RuntimeError, match=r"^TypeError: "):
        this_node().ask("record", world=-1, steps=1, every=1)
    assert len(moved()) == 13


def stopped(entry):
    """Stop Node.js, then ask it for steps."""
    with prepared() as simulation:
        os.kill(this_node().pid, signal.SIGSTOP)
        simulation.advance(1)


def started(entry):
    moved()
    return this_node().pid


def test_a_hang_ends_at_the_limit_of_wall_time(engine_processes):
    with EngineProcesses(ResourceLimits(processor_time=0.2)) as processes:
        found = processes.call(engine_entry(TinyEngine()), stopped)
    assert isinstance(found, Breakdown)
    assert found.reason.startswith("not done after 2 s of wall time")


def is_running(process):
    try:
        return (Path("/proc") / str(process) / "stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_for_its_end(process):
    while is_running(process):
        time.sleep(0.01)


def test_node_ends_with_its_engine_process(engine_processes):
    with EngineProcesses(ResourceLimits()) as processes:
        process = processes.call(engine_entry(TinyEngine()), started)
        assert is_running(process)
        assert processes.call(engine_entry(TinyEngine()), started) == process
    wait_for_its_end(process)


@pytest.mark.extended
@pytest.mark.parametrize("end", ["", "; os.kill(os.getpid(), 9)"])
def test_node_ends_with_python(end, tmp_path):
    program = f"import os, test_node_engine as own; print(own.started(None), flush=True){end}"
    paths = os.pathsep.join([str(Path(__file__).parent), str(Path(__file__).parents[2])])
    command = [sys.executable, "-W", "error", "-c", program]
    done = subprocess.run(command, cwd=tmp_path, env={**os.environ, "PYTHONPATH": paths}, stdout=subprocess.PIPE, text=True, check=False)
    assert done.returncode == (-9 if end else 0)
    wait_for_its_end(int(done.stdout))
