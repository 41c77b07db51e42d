"""A process for each engine, so that a crash, a hang or a leak affects only the rows of that engine.

A custom engine is imported and constructed only in its process, with the working directory on Python's path.
A segmentation fault ends the engine's process, not the run; an endless loop ends at a limit of processor time, which other load on the
machine does not use up; a leak ends at a limit of memory; output of an engine is dropped. A process that ended is replaced for the next
piece of work; each leads a process group, with which the engine's own children end.
"""

import ctypes
import math
import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from multiprocessing import current_process, get_all_start_methods, get_context
from typing import Self, TypeVar, TypeVarTuple

from pebble import ProcessExpired, ProcessPool

from dropspin.comparisons.engines.exceptions import described, ended_with
from dropspin.comparisons.judging.verdicts import Verdict
from dropspin.comparisons.results.interrupts import finished, interrupts_deferred
from dropspin.comparisons.running.arguments import EngineEntry, ignore
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.engine_process import PROCESSES, call, memory_for_data, start_process
from dropspin.comparisons.running.process_limits import COMPILATION, GIB, WALL_TIME_FACTOR, ResourceLimits
from dropspin.comparisons.running.progress import OnSimulations
from dropspin.scenarios import DropspinError

Given = TypeVarTuple("Given")
Result = TypeVar("Result")

POLL, GRACE = 0.5, 2.0  # s, between checks of a process, and for the pool to report its end
NEAR_LIMIT = 0.5
"""Share of the memory limit above which a crash mentions it."""


class Closed(Exception):
    """Another thread has abandoned this work."""


class EngineProcesses:
    """One process for each engine; a context manager.

    Args:
        resources: What each may use.
        start_method: A start method of `multiprocessing`; None to fork where the system can.

    Raises:
        DropspinError: This process may not start others.
    """

    def __init__(self, resources: ResourceLimits, start_method: str | None = None) -> None:
        if current_process().daemon:
            raise DropspinError(
                "a worker of multiprocessing.Pool may not start processes, in which engines are isolated; use "
                "concurrent.futures.ProcessPoolExecutor."
            )
        # A forked process has the engine already, even one that cannot be pickled, and does not run the user's script again.
        self._start_method = start_method or ("fork" if "fork" in get_all_start_methods() else "spawn")
        self._resources = resources
        self._pools: dict[str, ProcessPool] = {}
        self._shared: dict[str, ctypes.Array[ctypes.c_long]] = {}
        self._closed = False

    def start(self, entries: Sequence[EngineEntry]) -> None:
        """Start the processes of engines: a process that is forked while another thread compiles or imports may wait for it forever."""
        for entry in entries:
            with _system_errors_named(entry), interrupts_deferred():
                started = self._ready(entry).schedule(int)
            while not finished([started], POLL):
                pass

    def call(
        self, entry: EngineEntry, work: Callable[[EngineEntry, *Given], Result], *given: *Given, on_simulations: OnSimulations = ignore
    ) -> Result | Breakdown:
        """The result of a function that is called in an engine's process with the entry, or why there is none.

        There is none if the engine cannot take part, or if the call ended the process, ran out of time or memory, or raised.

        Args:
            entry: The engine.
            work: The function.
            given: Its other arguments.
            on_simulations: Called twice a second until the work is done, with the numbers of simulations that it counts.

        Raises:
            Closed: Another thread has abandoned it.
        """
        if entry.absence:
            return Breakdown(entry.absence, entry.reason)
        if self._closed:
            raise Closed
        pool = self._ready(entry)
        allowed = self._resources.processor_time + (COMPILATION if entry.engine is not None and entry.engine.compiles else 0.0)
        with _system_errors_named(entry), interrupts_deferred():
            task = pool.schedule(call, args=[work, given, allowed])
        largest, start = 0, math.inf
        while not finished([task], POLL):
            if self._closed:
                raise Closed
            if self._has_exited(entry.label) and not finished([task], GRACE):
                return self._of_exit(entry)
            if self._shared[entry.label][0]:
                start = min(start, time.monotonic())  # of a clock that nobody sets
            if time.monotonic() - start > WALL_TIME_FACTOR * allowed:
                self._end_group(entry.label)
                self.renew(entry)
                return Breakdown("timed_out", f"not done after {WALL_TIME_FACTOR * allowed:g} s of wall time")
            largest = max(largest, self._memory(entry.label))
            on_simulations(*self._shared[entry.label][1:])
        if self._closed:  # a process that ended with the work has not failed
            raise Closed
        try:
            result: Result | Breakdown = task.result()
        except ProcessExpired as end:
            self._end_group(entry.label)
            verdict, reason = _verdict(end.exitcode, allowed)
            if largest > NEAR_LIMIT * self._resources.memory:
                reason += f"; it used {largest / GIB:.1f} GiB of memory, and its limit is {self._resources.memory / GIB:g} GiB"
            return Breakdown(verdict, reason)
        except Exception as error:  # what the adapter returns cannot be sent to this process
            return Breakdown("crashed", f"its result cannot be returned: {described(error)}")
        vars(task)["_result"] = None  # pebble keeps the last task of each process, and with it many motions
        return result

    def _of_exit(self, entry: EngineEntry) -> Breakdown:
        """The breakdown of a process that exited before its work was done, unless the work was abandoned."""
        if self._closed:
            raise Closed
        self.renew(entry)
        return Breakdown("crashed", "its process exited with code 0 before the work was done")

    def _ready(self, entry: EngineEntry) -> ProcessPool:
        """The pool of an engine's process, with another process if the engine broke the one of its last work."""
        if entry.label in self._pools and not self._pools[entry.label].active:
            self.renew(entry)
        if entry.label not in self._pools:
            context = get_context(self._start_method)
            with _system_errors_named(entry):
                # Without a lock: the parent would wait forever for a process that is killed while it holds one.
                self._shared[entry.label] = context.RawArray("l", 3)
                given = [entry, self._resources.memory, self._shared[entry.label]]
                self._pools[entry.label] = ProcessPool(max_workers=1, initializer=start_process, initargs=given, context=context)
        self._shared[entry.label][:] = [0, 0, 0]
        return self._pools[entry.label]

    def _memory(self, label: str) -> int:
        """The memory that an engine's process has for data [bytes], which is limited; 0 where the system does not say."""
        with suppress(OSError):
            return memory_for_data(self._shared[label][0])
        return 0

    def _end_group(self, label: str) -> None:
        """End the processes that an engine started and left."""
        if self._shared[label][0]:
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(self._shared[label][0], signal.SIGKILL)

    def _has_exited(self, label: str) -> bool:
        """Whether the process that does the work has ended; the pool does not report one that exits with code 0."""
        process = self._shared[label][0]
        if not process or not PROCESSES.exists():
            return False
        with suppress(OSError):
            return (PROCESSES / str(process) / "stat").read_text().rpartition(")")[2].split()[0] == "Z"
        return True

    def renew(self, entry: EngineEntry) -> None:
        """Start a new process for an engine's next piece of work."""
        pool = self._pools.pop(entry.label, None)
        if pool is None:  # its last piece of work ended it
            return
        pool.stop()  # type: ignore[no-untyped-call]  # pebble's has no types
        pool.join()
        self._end_group(entry.label)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.abandon()
        for pool in self._pools.values():
            pool.stop()  # type: ignore[no-untyped-call]  # pebble's has no types
        for pool in self._pools.values():
            pool.join()

    def abandon(self) -> None:
        """End the engines' processes at once, and with them any call that waits for them in another thread."""
        self._closed = True
        for label in list(self._shared):
            self._end_group(label)


@contextmanager
def _system_errors_named(entry: EngineEntry) -> Iterator[None]:
    """Raise `DropspinError` for an error of the system while a process is started, which is none of a file that is being written."""
    try:
        yield
    except (OSError, BrokenProcessPool) as error:
        cause = error.__cause__ or error  # of a pool that could not start its process
        reason = getattr(cause, "strerror", None) or cause
        raise DropspinError(
            f"the system cannot start a process for {entry.label}: {reason}; shared memory (/dev/shm) must be writable and not full, and "
            "the limits of processes and open files must not be reached (ulimit -u, ulimit -n)."
        ) from None


def _verdict(exit_code: int | None, allowed: float) -> tuple[Verdict, str]:
    """The verdict and the reason for an engine whose process ended, which was allowed some processor time [s]."""
    if exit_code == -signal.SIGXCPU:
        return "timed_out", f"not done after {allowed:g} s of processor time"
    if exit_code is not None and exit_code < 0:
        return "crashed", f"its process was ended by {ended_with(exit_code)}"
    return "crashed", f"its process ended with exit code {exit_code}"
