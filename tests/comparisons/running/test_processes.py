"""Engines that break: each costs its own rows, whatever it does, and leaves no process behind."""

import ctypes
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest
from support import engines as made

import comparisons
from comparisons.running.processes import ResourceLimits
from scenarios import load

BALL = load("drop-ball")
SPIN = load("fall-spin")
TIGHT = ResourceLimits(processor_time=1.0, memory=300 * 2**20)


@pytest.fixture(autouse=True, scope="module")
def _compiled():
    """What the limits below are too tight for."""
    comparisons.simulate(BALL, "document", 4e-3)
    comparisons.simulate(SPIN, "document", 4e-3)


def segfault():
    ctypes.string_at(0)


def loop():
    while True:
        pass


def sleep():
    time.sleep(1000.0)


def allocate():
    hoard = []
    while True:
        hoard.append(np.ones(2**20))


def leave():
    os._exit(7)


def leave_well():
    os._exit(0)


def shout():
    for stream in (1, 2):
        os.write(stream, b"garbage")
    sys.stdout.write("garbage")


def fail():
    raise RuntimeError("no")


def interrupt():
    raise KeyboardInterrupt


def breaking(what):
    """The exact engine, but that on a floor it does something on the way."""

    class Breaking(made.Exact):
        name = "breaking"

        def prepare(self, scene, dt):
            if scene.floor is not None:
                what()
            return super().prepare(scene, dt)

    return Breaking()


@pytest.mark.parametrize(
    ("what", "verdict", "reason"),
    [
        (segfault, "crashed", "its process was ended by SIGSEGV"),
        (loop, "timed_out", "not done after 1 s of processor time"),
        (allocate, "crashed", "MemoryError"),
        (leave, "crashed", "its process ended with exit code 7"),
        (leave_well, "crashed", "its process ended by itself, as if all were well"),
        (interrupt, "crashed", "KeyboardInterrupt"),
        (fail, "crashed", "RuntimeError: no"),
    ],
)
def test_whatever_an_engine_does_costs_its_own_row(what, verdict, reason):
    """Two engines, two scenes: the bad engine's bad scene is lost, all else is there."""
    found = comparisons.run([BALL, SPIN], [breaking(what), "document"], [4e-3], limits=TIGHT).table
    bad = found[(found["engine"] == "breaking") & (found["scene"] == "drop-ball")]
    [row] = bad.to_dict("records")
    assert row["verdict"] == verdict
    assert reason in row["reason"]
    sound = found[(found["engine"] == "document") | (found["scene"] == "fall-spin")]
    assert not sound["verdict"].isin(["crashed", "timed_out", "diverged", "failed"]).any()
    assert {("document", "drop-ball"), ("document", "fall-spin"), ("breaking", "fall-spin")} == set(
        zip(sound["engine"], sound["scene"], strict=True)
    )


def test_an_engine_that_sleeps_is_ended_by_the_clock():
    """It uses no processor time; the wall clock is ten times more patient."""
    found = comparisons.run([BALL], [breaking(sleep)], [4e-3], limits=ResourceLimits(processor_time=0.1)).table
    [row] = found.to_dict("records")
    assert (row["verdict"], row["reason"]) == ("timed_out", "not done after 1 s by the clock")


def test_what_an_engine_prints_is_dropped(capfd):
    """And costs nothing."""
    found = comparisons.run([BALL], [breaking(shout)], [4e-3]).table
    assert "garbage" not in "".join(capfd.readouterr())
    assert not found["verdict"].isin(["crashed", "failed"]).any()


def test_processor_time_is_counted_anew_for_each_piece_of_work():
    """Six pieces of .4 s each under a limit of 1 s."""

    class Busy(made.Exact):
        name = "busy"

        def prepare(self, scene, dt):
            until = time.process_time() + 0.1
            while time.process_time() < until:
                pass
            return super().prepare(scene, dt)

    scenes = [SPIN, load("spin-principal")]
    found = comparisons.run(scenes, [Busy()], [8e-3, 4e-3, 2e-3], limits=TIGHT).table
    assert not found["verdict"].isin(["crashed", "timed_out"]).any()


def test_runs_of_good_and_bad_leave_nothing_behind():
    """Twenty-one runs: no process, and no file where temporary files go; in an interpreter of its own, whose children can be counted."""
    script = textwrap.dedent(f"""
        import os, sys, tempfile
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        import comparisons, test_isolation as t
        kinds = (t.segfault, t.leave, t.allocate, t.loop, t.shout, t.fail, t.interrupt)
        for number in range(21):
            comparisons.run([t.BALL, t.SPIN], [t.breaking(kinds[number % len(kinds)]), "document"], [4e-3], limits=t.TIGHT)
        parents = {{p: open(f"/proc/{{p}}/stat").read().split(") ")[1].split()[1] for p in os.listdir("/proc") if p.isdigit()}}
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
            env=os.environ | {"TMPDIR": str(folder)},
            timeout=300,
        )
    finally:
        left = list(folder.iterdir())
        for path in left:
            path.unlink()
        folder.rmdir()
    assert done.stdout.strip() == "[] []"
    assert left == []


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_what_ends_a_run_ends_its_engines_with_it(how):
    """Ctrl-C, or a kill, while an engine loops for ever: the run ends at once, and so does the engine's process."""
    script = textwrap.dedent(f"""
        import os, signal, sys
        signal.signal(signal.SIGINT, signal.default_int_handler)  # what starts the tests may ignore it, which is inherited
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        import comparisons, test_isolation as t
        def told():
            with open(sys.argv[1], "w") as file:
                file.write(str(os.getpid()))
            t.loop()
        comparisons.run([t.BALL], [t.breaking(told)], [4e-3])
    """)
    note = Path(f"/tmp/dropspin-interrupt-{os.getpid()}")
    process = subprocess.Popen([sys.executable, "-c", script, str(note)], stderr=subprocess.PIPE, text=True)
    try:
        while not (note.exists() and note.read_text()):
            assert process.poll() is None
            time.sleep(0.05)
        worker = int(note.read_text())
        process.send_signal(how)
        _, said = process.communicate(timeout=60)
    finally:
        note.unlink(missing_ok=True)
        process.kill()
    assert ("KeyboardInterrupt" in said) == (how == signal.SIGINT)
    for _ in range(100):  # one that is killed is still there until whoever inherits it has looked
        stat = Path(f"/proc/{worker}/stat")
        if not stat.exists() or stat.read_text().rpartition(")")[2].split()[0] == "Z":
            return
        time.sleep(0.05)
    pytest.fail("the engine's process goes on")
