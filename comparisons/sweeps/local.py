"""A sweep on this machine: as many parts at a time as processors, each with the engines in processes of its own."""

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack
from threading import Event

from comparisons.running.processes import Closed, EngineProcesses
from comparisons.sweeps.parts import Folder
from comparisons.sweeps.work import Part, Work
from reference_impl.threads import usable_cores

TICK = 0.5  # s


def run_here(work: Work, parts: Iterator[Part], folder: Folder, on_progress: Callable[[int], None]) -> None:
    """Do parts and write them.

    Args:
        work: The sweep.
        parts: Which; no more are asked for than are at work.
        folder: Where to.
        on_progress: Called with the number of jobs done since the last call, twice a second at least; may raise to end it all.
    """
    stopping = Event()

    def do(part: Part, processes: EngineProcesses) -> None:
        folder.write(*part, work.table(part, processes, lambda: _go_on_unless(stopping)))

    with ExitStack() as homes:
        idle = [homes.enter_context(EngineProcesses(work.resources)) for _ in range(usable_cores())]
        threads = homes.enter_context(ThreadPoolExecutor(usable_cores()))
        # First the engines end, then the threads that wait for them, then what is left.
        homes.callback(_abandon, list(idle), stopping)
        flying: dict[Future[None], tuple[Part, EngineProcesses]] = {}
        while True:
            while idle and (part := next(parts, None)) is not None:
                processes = idle.pop()
                flying[threads.submit(do, part, processes)] = part, processes
            if not flying:
                return
            landed, _ = wait(flying, timeout=TICK, return_when=FIRST_COMPLETED)
            done = 0
            for one in landed:
                part, processes = flying.pop(one)
                one.result()
                idle.append(processes)
                done += part.last - part.first
            on_progress(done)


def _abandon(all_processes: list[EngineProcesses], stopping: Event) -> None:
    """End all that is at work; what ends with the sweep is no engine's failure."""
    stopping.set()
    for processes in all_processes:
        processes.abandon()


def _go_on_unless(stopping: Event) -> None:
    if stopping.is_set():
        raise Closed
