"""A sweep on this machine: one part at a time on each processor, with engine processes of its own."""

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack
from threading import Event

from comparisons.running.processes import Closed, EngineProcesses
from comparisons.sweeps.folder import SweepFolder
from comparisons.sweeps.work import Part, Work
from reference_impl.threads import usable_cores

POLL_INTERVAL = 0.5  # s


def run_locally(work: Work, parts: Iterator[Part], folder: SweepFolder, on_progress: Callable[[int], None]) -> None:
    """Run parts and write them.

    Args:
        work: The sweep.
        parts: The parts to run; the next one is requested when a processor is free.
        folder: The folder to write to.
        on_progress: Called with the number of jobs completed since the last call, at least twice a second; may raise to stop the sweep.
    """
    stopping = Event()

    def run_part(part: Part, processes: EngineProcesses) -> None:
        folder.write(*part, work.table(part, processes, lambda: _raise_if_set(stopping)))

    with ExitStack() as stack:
        idle = [stack.enter_context(EngineProcesses(work.resources)) for _ in range(usable_cores())]
        threads = stack.enter_context(ThreadPoolExecutor(usable_cores()))
        # On leaving, the engine processes end first, then the threads that wait for them.
        stack.callback(_abandon, list(idle), stopping)
        running: dict[Future[None], tuple[Part, EngineProcesses]] = {}
        while True:
            while idle and (part := next(parts, None)) is not None:
                processes = idle.pop()
                running[threads.submit(run_part, part, processes)] = part, processes
            if not running:
                return
            finished, _ = wait(running, timeout=POLL_INTERVAL, return_when=FIRST_COMPLETED)
            completed_jobs = 0
            for future in finished:
                part, processes = running.pop(future)
                future.result()
                idle.append(processes)
                completed_jobs += part.last - part.first
            on_progress(completed_jobs)


def _abandon(all_processes: list[EngineProcesses], stopping: Event) -> None:
    """End all running work; a process that ends with the sweep does not count as a failure of its engine."""
    stopping.set()
    for processes in all_processes:
        processes.abandon()


def _raise_if_set(stopping: Event) -> None:
    if stopping.is_set():
        raise Closed
