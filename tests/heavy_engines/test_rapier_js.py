"""Node.js of the engine `rapier-js`: a process that breaks costs its simulation, and none is left behind."""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from dropspin import scenarios
from dropspin.comparisons.engines.rapier_js_node import node
from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.running.entries import engine_entry
from dropspin.comparisons.running.processes import EngineProcesses, ResourceLimits
from dropspin.comparisons.running.recording import Breakdown

DT = 2e-3


def prepared():
    return engine("rapier-js").prepare(scenarios.load("fall-spin"), DT)


def moved():
    """The state after ten steps."""
    with prepared() as simulation:
        simulation.advance(10)
        return simulation.state().tolist()


def stepped_while_it_is_killed(steps):
    with prepared() as simulation:
        threading.Timer(0.1, os.kill, [node().pid, signal.SIGKILL]).start()
        while True:
            simulation.advance(steps)


@pytest.mark.parametrize("steps", [1, 1_000_000])
def test_a_crash_is_named_and_the_next_simulation_has_another_process(steps):
    expected = moved()
    with pytest.raises(RuntimeError, match=r"^Node\.js ended with SIGKILL$"):
        stepped_while_it_is_killed(steps)
    assert moved() == expected


def test_an_error_of_the_driver_is_named():
    with pytest.raises(RuntimeError, match=r"^TypeError: "):
        node().ask("record", world=-1, steps=1, every=1)
    assert len(moved()) == 13


def stopped(entry):
    """Stop Node.js, then ask it for steps."""
    with prepared() as simulation:
        os.kill(node().pid, signal.SIGSTOP)
        simulation.advance(1)


def started(entry):
    moved()
    return node().pid


def test_a_hang_ends_at_the_limit_of_wall_time():
    limits = ResourceLimits(processor_time=0.2)
    with EngineProcesses(limits) as processes:
        found = processes.call(engine_entry("rapier-js"), stopped)
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


def test_node_ends_with_its_engine_process():
    with EngineProcesses(ResourceLimits()) as processes:
        process = processes.call(engine_entry("rapier-js"), started)
        assert is_running(process)
        assert processes.call(engine_entry("rapier-js"), started) == process
    wait_for_its_end(process)


@pytest.mark.parametrize("end", ["", "; os.kill(os.getpid(), 9)"])
def test_node_ends_with_python(end):
    program = f"import os, test_rapier_js as own; print(own.started(None), flush=True){end}"
    folder = Path(__file__).parent
    done = subprocess.run([sys.executable, "-W", "error", "-c", program], cwd=folder, stdout=subprocess.PIPE, text=True, check=False)
    assert done.returncode == (-9 if end else 0)
    wait_for_its_end(int(done.stdout))
