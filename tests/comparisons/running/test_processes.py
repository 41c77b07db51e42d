"""Engines that break cost their own rows and leave no process behind."""

import errno
import os
import signal
import subprocess
import sys
import textwrap
import threading
import time
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import current_process
from pathlib import Path
from unittest import mock

import psutil
import pytest
from support import breaking
from support import engines as made
from support.cli import dropspin

import dropspin as ds
from dropspin.comparisons.running.engine_entries import engine_entry
from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.comparisons.running.processes import Closed, EngineProcesses

BALL, SPIN, TIGHT = breaking.BALL, breaking.SPIN, breaking.TIGHT
TESTS = Path(__file__).parents[2]

pytestmark = pytest.mark.usefixtures("engine_processes")


@pytest.fixture(autouse=True, scope="module")
def _compiled():
    """Compile before the tight limits below apply."""
    ds.simulate(BALL, "wang", 4e-3)
    ds.simulate(SPIN, "wang", 4e-3)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("what", "verdict", "reason"),
    [
        (breaking.segfault, "crashed", "its process was ended by SIGSEGV"),
        (breaking.loop, "timed_out", "not done after"),  # of processor time, or of wall time on a machine that is busy
        (breaking.allocate, "crashed", "MemoryError"),
        (breaking.leave, "crashed", "its process ended with exit code 7"),
        (breaking.leave_well, "crashed", "its process exited with code 0 before the work was done"),
        (breaking.interrupt, "crashed", "KeyboardInterrupt"),
        (breaking.fail, "crashed", "RuntimeError: no"),
    ],
)
def test_broken_engine_costs_its_own_row(what, verdict, reason):
    """Of two engines and two scenes only the broken engine's broken scene is lost."""
    found = ds.run([BALL, SPIN], [breaking.breaking(what), "wang"], [4e-3], resources=TIGHT).table
    bad = found[(found["engine"] == "breaking") & (found["scene"] == "drop-ball")]
    [row] = bad.to_dict("records")
    assert row["verdict"] == verdict
    assert reason in row["reason"]
    sound = found[(found["engine"] == "wang") | (found["scene"] == "fall-spin")]
    assert not sound["verdict"].isin(["crashed", "timed_out", "diverged", "failed"]).any()
    assert {("wang", "drop-ball"), ("wang", "fall-spin"), ("breaking", "fall-spin")} == set(
        zip(sound["engine"], sound["scene"], strict=True)
    )


def test_addresses_that_are_reserved_and_not_used_are_no_memory():
    """Libraries for GPUs reserve far more than the limit."""
    found = ds.run([BALL], [breaking.breaking(breaking.reserve)], [4e-3], resources=TIGHT).table
    assert not found["verdict"].isin(["crashed", "timed_out"]).any()


def end_by_a_signal_without_a_name(entry):
    os.kill(os.getpid(), signal.SIGRTMIN + 3)


@pytest.mark.skipif(not hasattr(signal, "SIGRTMIN"), reason="the system has no real-time signals")
def test_signal_without_a_name_is_told_by_its_number():
    with EngineProcesses(TIGHT) as processes:
        found = processes.call(engine_entry(made.Exact()), end_by_a_signal_without_a_name)
    assert (found.verdict, found.reason) == ("crashed", f"its process was ended by signal {signal.SIGRTMIN + 3}")


def test_sleeping_engine_is_ended_by_the_wall_clock():
    """It uses no processor time; the wall time allowed is ten times the processor time."""
    found = ds.run([BALL], [breaking.breaking(breaking.sleep)], [4e-3], resources=ResourceLimits(processor_time=0.1)).table
    [row] = found.to_dict("records")
    assert (row["verdict"], row["reason"]) == ("timed_out", "not done after 1 s of wall time")


@pytest.mark.parametrize(
    "where", ["dropspin.comparisons.running.processes.ProcessPool", "dropspin.comparisons.running.processes.ProcessPool.schedule"]
)
@pytest.mark.parametrize(("code", "of_pool"), [(errno.ENOSPC, False), (errno.EROFS, False), (errno.EAGAIN, False), (errno.EMFILE, True)])
def test_system_that_starts_no_process_is_not_blamed_on_the_output_folder(where, code, of_pool, tmp_path, monkeypatch):
    """Such as shared memory that is full or read-only, and limits of processes and of open files."""
    error = OSError(code, os.strerror(code))
    broken = BrokenProcessPool()
    broken.__cause__ = error
    monkeypatch.setattr(where, mock.Mock(side_effect=broken if of_pool else error))
    done = dropspin("run", "drop-ball", "-e", "wang", "--dt", "0.01", "-o", "out", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].startswith(f"dropspin: the system cannot start a process for wang: {os.strerror(code)}; shared ")
    assert not list(tmp_path.iterdir())


def test_worker_that_may_start_no_process_is_named(monkeypatch):
    """As one of a pool of multiprocessing."""
    monkeypatch.setattr(current_process(), "_config", {"daemon": True})
    with pytest.raises(ds.DropspinError, match=r"use concurrent\.futures\.ProcessPoolExecutor"):
        ds.run([BALL], "wang", [4e-3])


def _work_for_two_seconds(entry):
    time.sleep(2.0)
    return "done"


def test_process_that_ends_with_abandoned_work_is_no_failure():
    with EngineProcesses(ResourceLimits()) as processes, pytest.raises(Closed):
        processes.call(engine_entry("wang"), _work_for_two_seconds, on_simulations=lambda *_: processes.abandon())


def test_wall_clock_that_is_set_times_no_engine_out(monkeypatch):
    """By two hours, as by a time service or after a standby, while an engine works that may use 1000 s."""
    real, start = time.time, time.monotonic()
    monkeypatch.setattr(time, "time", lambda: real() + (7200.0 if time.monotonic() > start + 0.7 else 0.0))
    with EngineProcesses(ResourceLimits(processor_time=100.0)) as processes:
        assert processes.call(engine_entry("mujoco"), _work_for_two_seconds) == "done"


def test_output_of_an_engine_is_dropped(capfd):
    """An engine that prints is measured like any other."""
    found = ds.run([BALL], [breaking.breaking(breaking.shout)], [4e-3]).table
    assert "garbage" not in "".join(capfd.readouterr())
    assert not found["verdict"].isin(["crashed", "failed"]).any()


def leave_soon(entry):
    threading.Timer(0.1, os._exit, [1]).start()


def process_of(entry):
    return os.getpid()


def test_engine_that_ends_its_process_between_two_pieces_of_work_gets_another():
    """As one does that closed the pipes to its parent."""
    entry = engine_entry(made.Exact())
    with EngineProcesses(TIGHT) as processes:
        first = processes.call(entry, process_of)
        processes.call(entry, leave_soon)
        while processes._pools[entry.label].active:
            time.sleep(0.05)
        assert processes.call(entry, process_of) != first


def go_on_in_a_child(entry):
    if os.fork():
        time.sleep(1000.0)


def leave_a_child(entry):
    child = os.fork()
    if not child:
        time.sleep(1000.0)
    return child


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the engine forks")
def test_children_that_an_engine_forks_end_with_it():
    """Also those of a child that has taken the place of the process that was started for the engine."""
    entry = engine_entry(made.Exact())
    with EngineProcesses(TIGHT) as processes:
        processes.call(entry, go_on_in_a_child)
        child = psutil.Process(processes.call(entry, leave_a_child))
    _, alive = psutil.wait_procs([child], timeout=10.0)
    for one in alive:
        one.kill()
    assert not alive


@pytest.mark.extended
def test_processor_time_is_counted_per_piece_of_work():
    """Six pieces of work of .4 s each pass a limit of 1 s, which the system counts in whole seconds."""

    class Busy(made.Exact):
        name = "busy"

        def prepare(self, scene, dt):
            until = time.process_time() + 0.1
            while time.process_time() < until:
                pass
            return super().prepare(scene, dt)

    found = ds.run([SPIN, "spin-principal"], [Busy()], [8e-3, 4e-3, 2e-3], resources=TIGHT).table
    assert not found["verdict"].isin(["crashed", "timed_out"]).any()


@pytest.mark.extended
def test_runs_with_broken_engines_leave_no_process_and_no_file():
    """Seven runs in an interpreter of its own, whose children and temporary files are counted."""
    script = textwrap.dedent("""
        import os, sys, tempfile
        import dropspin as ds
        from support import breaking as t
        kinds = (t.segfault, t.leave, t.allocate, t.loop, t.shout, t.fail, t.interrupt)
        for kind in kinds:
            scenes = [t.SPIN] if kind in (t.allocate, t.loop) else [t.BALL, t.SPIN]  # these two take a second in each
            ds.run(scenes, [t.breaking(kind), "wang"], [4e-3], resources=t.TIGHT)
        parents = {p: open(f"/proc/{p}/stat").read().split(") ")[1].split()[1] for p in os.listdir("/proc") if p.isdigit()}
        print([p for p, parent in parents.items() if parent == str(os.getpid())], os.listdir(tempfile.gettempdir()))
    """)
    folder = Path(os.environ.get("PYTEST_TMP", "/tmp")) / f"dropspin-isolation-{os.getpid()}"
    folder.mkdir()
    try:
        done = subprocess.run(
            [sys.executable, "-c", script],
            capture_output=True,
            text=True,
            check=True,
            env=os.environ | {"TMPDIR": str(folder), "PYTHONPATH": str(TESTS)},
            timeout=300,
        )
    finally:
        left = list(folder.iterdir())
        for path in left:
            path.unlink()
        folder.rmdir()
    assert done.stdout.strip() == "[] []"
    assert left == []


@pytest.mark.sample(1)
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_interrupt_and_kill_end_the_engines_too(how):
    """Ctrl-C, or a kill, while an engine loops forever ends the run at once, and the engine's process with it."""
    script = textwrap.dedent("""
        import os, signal, sys
        signal.signal(signal.SIGINT, signal.default_int_handler)  # what starts the tests may ignore it, which is inherited
        import dropspin as ds
        from support import breaking as t
        def hang():
            with open(sys.argv[1], "w") as file:
                file.write(str(os.getpid()))
            t.loop()
        ds.run([t.BALL], [t.breaking(hang)], [4e-3])
    """)
    note = Path(f"/tmp/dropspin-interrupt-{os.getpid()}")
    process = subprocess.Popen(
        [sys.executable, "-c", script, str(note)], stderr=subprocess.PIPE, text=True, env=os.environ | {"PYTHONPATH": str(TESTS)}
    )
    try:
        while not (note.exists() and note.read_text()):
            assert process.poll() is None
            time.sleep(0.05)
        worker = int(note.read_text())
        process.send_signal(how)
        _, errors = process.communicate(timeout=60)
    finally:
        note.unlink(missing_ok=True)
        process.kill()
    assert ("KeyboardInterrupt" in errors) == (how == signal.SIGINT)
    for _ in range(100):  # a killed process stays a zombie until its new parent has waited for it
        stat = Path(f"/proc/{worker}/stat")
        if not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] == "Z":
            return
        time.sleep(0.05)
    pytest.fail("the engine's process is still running")
