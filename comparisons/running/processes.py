"""Engines kept apart: each runs in a process of its own, so that whatever it does costs its own row and nothing else.

A segmentation fault ends the engine's process, not the run; an endless loop ends at a limit of processor time, which a loaded machine does
not use up; a leak ends at a limit of memory; what an engine prints is dropped. A process that has ended is replaced for the next piece of
work. One engine works at a time, so that nobody's timing is disturbed.
"""

import ctypes
import faulthandler
import os
import signal
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import TimeoutError as OutOfTime
from concurrent.futures import wait
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_all_start_methods, get_context
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar, TypeVarTuple

from pebble import ProcessExpired, ProcessPool

from comparisons.judging.verdicts import Verdict
from comparisons.running.engine_run import EngineRun, run_engine
from comparisons.running.recording import Breakdown, EngineEntry
from scenarios import Scenario

Given = TypeVarTuple("Given")
Result = TypeVar("Result")

PROCESSES = Path("/proc")
POLL, GRACE = 0.5, 2.0  # s, between looks at a process, and for the pool to tell of its end
BACKSTOP = 10.0
"""Wall time over processor time: an engine that sleeps for ever uses no processor."""


@dataclass(frozen=True)
class ResourceLimits:
    """What an engine may use for one scene at one step, start phases and ensemble included.

    Attributes:
        processor_time: [s]; ten times as much by the clock on the wall.
        memory: Beyond what its process takes when it starts [bytes].
    """

    processor_time: float = 300.0
    memory: int = 8 * 2**30


class Failed(Exception):
    """Work that did not come to an end; its verdict, and why."""

    def __init__(self, verdict: Verdict, reason: str) -> None:
        super().__init__(verdict, reason)
        self.verdict, self.reason = verdict, reason

    def __str__(self) -> str:
        return self.reason


class Closed(Exception):
    """Nobody waits for this work any more."""


class EngineProcesses:
    """One process for each engine; a context manager.

    Args:
        limits: What each may use.
        start_method: How processes start, a word of `multiprocessing`. None: forked, if the system can do that.
    """

    def __init__(self, limits: ResourceLimits, start_method: str | None = None) -> None:
        # A forked process has the engine already, whatever it is made of; and no script of a user's is run again.
        self._start_method = start_method or ("fork" if "fork" in get_all_start_methods() else "spawn")
        self._limits = limits
        self._pools: dict[str, ProcessPool] = {}
        self._processes: dict[str, ctypes.c_long] = {}
        self._closed = False

    def run_engine(self, entry: EngineEntry, scene: Scenario, dt: float, starts: Sequence[Scenario]) -> EngineRun:
        """Run a scene with an engine in its process; failures are part of the result."""
        if entry.engine is None:
            return run_engine(entry, scene, dt, starts)
        try:
            return self.call(entry, run_engine, scene, dt, starts)
        except Failed as failure:
            return EngineRun(entry.label, Breakdown(failure.verdict, failure.reason))

    def call(self, entry: EngineEntry, work: Callable[[EngineEntry, *Given], Result], *given: *Given) -> Result:
        """Do some work in an engine's process; `work` gets the entry first.

        Raises:
            Failed: It ended the process, ran out of time or memory, or raised.
            Closed: Another thread has abandoned it meanwhile.
        """
        if self._closed:
            raise Closed
        if entry.label not in self._pools:
            self._pools[entry.label] = self._pool(entry)
        self._processes[entry.label].value = 0
        task = self._pools[entry.label].schedule(
            _work_here, args=[work, given, self._limits.processor_time], timeout=BACKSTOP * self._limits.processor_time
        )
        try:
            while not wait([task], timeout=POLL).done:
                if self._closed:
                    raise Closed
                if self._has_left(entry.label) and not wait([task], timeout=GRACE).done:
                    self.renew(entry)
                    raise Failed("crashed", "its process ended by itself, as if all were well")
            result: Result = task.result()
        except OutOfTime:
            raise Failed("timed_out", f"not done after {BACKSTOP * self._limits.processor_time:g} s of wall time") from None
        except ProcessExpired as end:
            raise Failed(*self._verdict(end.exitcode)) from None
        return result

    def _has_left(self, label: str) -> bool:
        """Whether the process that took up the work has ended; one that says all is well on its way out is not told of by the pool."""
        process = self._processes[label].value
        if not process or not PROCESSES.exists():
            return False
        try:
            return (PROCESSES / str(process) / "stat").read_text().rpartition(")")[2].split()[0] == "Z"
        except OSError:
            return True

    def renew(self, entry: EngineEntry) -> None:
        """Give an engine a new process for its next piece of work."""
        pool = self._pools.pop(entry.label)
        pool.stop()  # type: ignore[no-untyped-call]  # pebble's has no types
        pool.join()

    def _verdict(self, exit_code: int | None) -> tuple[Verdict, str]:
        """The verdict on an engine whose process has ended, and the reason."""
        if exit_code == -signal.SIGXCPU:
            return "timed_out", f"not done after {self._limits.processor_time:g} s of processor time"
        if exit_code is not None and exit_code < 0:
            return "crashed", f"its process was ended by {signal.Signals(-exit_code).name}"
        return "crashed", f"its process ended with exit code {exit_code}"

    def _pool(self, entry: EngineEntry) -> ProcessPool:
        context = get_context(self._start_method)
        # Without a lock: a process that is killed while it holds one would have the parent wait for ever.
        self._processes[entry.label] = process = context.RawValue("l", 0)
        return ProcessPool(max_workers=1, initializer=_move_in, initargs=[entry, self._limits.memory, process], context=context)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.abandon()
        for pool in self._pools.values():
            pool.stop()  # type: ignore[no-untyped-call]  # pebble's has no types
        for pool in self._pools.values():
            pool.join()

    def abandon(self) -> None:
        """End the engines' processes at once, and any call that waits for them in another thread."""
        self._closed = True
        for process in list(self._processes.values()):
            if process.value:
                with suppress(ProcessLookupError):
                    os.kill(process.value, signal.SIGKILL)


_at_work: list["ctypes.c_long"] = []
"""Where this process says that it is at work."""
_residents: list[EngineEntry] = []
"""The engine whose process this is; empty in the parent."""


def _move_in(entry: EngineEntry, memory: int, process: "ctypes.c_long") -> None:
    """Begin a process's life: keep quiet, leave interrupts to the parent, and take no more memory than allowed."""
    _residents.append(entry)
    _at_work.append(process)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # by which the parent ends it, whatever the parent does at one itself
    faulthandler.disable()
    nowhere = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - as long as the process lives
    for stream in (1, 2):
        os.dup2(nowhere.fileno(), stream)
    sys.stdout = sys.stderr = nowhere
    if sys.platform == "linux":
        import resource

        _end_with_parent()
        with open("/proc/self/statm", encoding="ascii") as file:
            taken = int(file.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (taken + memory, resource.RLIM_INFINITY))


PR_SET_PDEATHSIG = 1


def _end_with_parent() -> None:
    """Have the system end this process when the one that started it is killed: processes of many engines would keep each other waiting."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def _work_here(work: Callable[..., Any], given: Sequence[Any], processor_time: float) -> Any:
    _at_work[0].value = os.getpid()
    if sys.platform == "linux":
        import resource

        used = resource.getrusage(resource.RUSAGE_SELF)
        until = int(used.ru_utime + used.ru_stime + processor_time) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (until, resource.RLIM_INFINITY))
    try:
        return work(_residents[0], *given)
    except Exception as error:  # an engine is somebody else's code
        raise Failed("crashed", f"{type(error).__name__}: {error}") from None
    except BaseException as error:  # one that says sys.exit() or raises an interrupt is none of the user's
        raise Failed("crashed", type(error).__name__) from None
