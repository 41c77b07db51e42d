"""Interrupts where they would leave a lock or a folder behind: they are raised afterwards, and the work ends."""

import signal
import subprocess
import sys

import pytest
from filelock import FileLock

from dropspin.comparisons.results.complete_folders import unfinished_folder
from dropspin.comparisons.results.interrupts import interrupts_deferred

PLANTED = """
import os, signal, time
from concurrent.futures import _base

from dropspin.comparisons.running.parallel import work_in_parallel
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.running.process_limits import ResourceLimits

signal.signal(signal.SIGINT, signal.default_int_handler)  # which jobs in the background of a shell ignore
take = _base._AcquireFutures.__enter__

def taken_and_interrupted(futures):
    take(futures)
    os.kill(os.getpid(), signal.SIGINT)  # the locks of the futures are taken; without the statement that releases them, for ever

_base._AcquireFutures.__enter__ = taken_and_interrupted

def work(piece, processes):
    time.sleep(0.2)
    return piece

try:
    work_in_parallel(iter(range(100)), work, [EngineProcesses(ResourceLimits())], lambda piece, result: None)
except KeyboardInterrupt:
    print("interrupted")
"""


@pytest.mark.extended
def test_an_interrupt_while_locks_are_taken_ends_the_work():
    done = subprocess.run([sys.executable, "-c", PLANTED], check=False, capture_output=True, text=True, timeout=60)
    assert done.stdout == "interrupted\n", done.stderr


def test_deferred_interrupts_reach_their_handlers_at_the_end():
    reached = []
    handlers = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: lambda number, frame: reached.append("SIGTERM")}
    before = {number: signal.signal(number, handler) for number, handler in handlers.items()}
    try:
        with pytest.raises(KeyboardInterrupt):
            interrupted_work(reached)
        assert {number: signal.getsignal(number) for number in handlers} == handlers
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    assert reached == ["end of the context", "SIGTERM"]


def interrupted_work(reached):
    with interrupts_deferred():
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)
        reached.append("end of the context")


@pytest.mark.parametrize("moment", ["acquire", "release"])
def test_unfinished_folder_is_removed_if_an_interrupt_comes_while_it_is_made_or_removed(moment, tmp_path, monkeypatch):
    original = getattr(FileLock, moment)

    def interrupted(*given, **options):
        found = original(*given, **options)
        signal.raise_signal(signal.SIGINT)
        return found

    monkeypatch.setattr(FileLock, moment, interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt), unfinished_folder(tmp_path) as folder:
            assert folder.is_dir()
    finally:
        signal.signal(signal.SIGINT, before)
    assert list(tmp_path.iterdir()) == []
