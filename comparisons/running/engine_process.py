"""What runs in an engine's process: the start of the process, and calls of functions with the engine.

The process drops the output of the engine, leaves interrupts to its parent, and ends when it exceeds its limits or its parent ends.
"""

import ctypes
import faulthandler
import os
import signal
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from dropspin.comparisons.engines.adapter_code import adapter_code
from dropspin.comparisons.engines.program_engine import limit_patience
from dropspin.comparisons.engines.registry import constructed
from dropspin.comparisons.engines.stand_in import StandIn
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import AnotherAdapter, classify
from dropspin.scenarios import DropspinError

PROCESSES = Path("/proc")
PR_SET_PDEATHSIG = 1

_shared: list["ctypes.Array[ctypes.c_long]"] = []
"""Numbers that the parent reads: the id of this process, the leader of its group, since it works; simulations done and to do."""
_entry: list[EngineEntry] = []
"""The engine of this process; empty in the parent."""


def share_progress(done: int, total: int) -> None:
    """Share the numbers of simulations done and to do with the parent, if this is the process of an engine."""
    for numbers in _shared:
        numbers[1:] = [done, total]


def start_process(entry: EngineEntry, memory: int, shared: "ctypes.Array[ctypes.c_long]") -> None:
    """Start a process: drop its output, leave interrupts to the parent, limit its memory."""
    _entry.append(entry)
    _shared.append(shared)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # by which the parent ends it, even if the parent handles its own
    faulthandler.disable()
    if hasattr(os, "setpgid"):
        os.setpgid(0, 0)
    null = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - as long as the process lives
    for stream in (1, 2):
        os.dup2(null.fileno(), stream)
    sys.stdout = sys.stderr = null
    if sys.platform == "linux":
        import resource

        # The system ends this process when its parent is killed: the processes of several engines would wait for each other.
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
        # Not the address space, of which libraries for GPUs and WebAssembly reserve far more than they use.
        resource.setrlimit(resource.RLIMIT_DATA, (memory_for_data(os.getpid()) + memory, resource.RLIM_INFINITY))


def memory_for_data(process: int) -> int:
    """The memory that a process has for data, which its limit counts [bytes].

    Raises:
        OSError: There is no such process, or the system is not Linux.
    """
    return int((PROCESSES / str(process) / "statm").read_text().split()[5]) * os.sysconf("SC_PAGE_SIZE")


def call(work: Callable[..., Any], given: Sequence[Any], processor_time: float) -> Any:
    """Call a function with this process's engine, within a limit of processor time [s]; what it or the construction raises is returned."""
    limit_patience(processor_time)
    _shared[0][0] = os.getpgrp() if hasattr(os, "getpgrp") else os.getpid()  # not a child that the engine forked
    if sys.platform == "linux":
        import resource

        used = resource.getrusage(resource.RUSAGE_SELF)
        until = int(used.ru_utime + used.ru_stime + processor_time) + 1
        resource.setrlimit(resource.RLIMIT_CPU, (until, resource.RLIM_INFINITY))
    try:
        _entry[0] = _constructed(_entry[0])
        return work(_entry[0], *given)
    except BaseException as error:  # sys.exit() or an interrupt that an engine raises is not the user's
        return classify(error)


def _constructed(entry: EngineEntry) -> EngineEntry:
    """An entry with its engine in place of a stand-in; the working directory comes last on Python's path, after all that is installed.

    Raises:
        AnotherAdapter: The engine cannot be imported or constructed, as it could be when it was described, or its code is another.
    """
    if entry.engine is not None and not isinstance(entry.engine, StandIn):
        return entry
    if (here := os.getcwd()) not in sys.path:
        sys.path.append(here)
    if entry.engine is None:
        return entry
    known, before = entry.engine.traits, frozenset(sys.modules)
    try:
        engine = constructed(known.source, entry.engine.options)
    except DropspinError as error:
        raise AnotherAdapter("crashed", str(error)) from None
    if adapter_code(type(engine), frozenset(sys.modules) - before, with_below=False) != known.modules:
        remedy = "give the command again, with the same code on all machines"
        raise AnotherAdapter("crashed", f"the code of {known.source} is not that with which the command began; {remedy}")
    return replace(entry, engine=engine)
