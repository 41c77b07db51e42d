"""Pieces of work on all processors: one at a time on each, with engine processes of its own."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack
from threading import Event
from typing import TypeVar

from comparisons.running.inputs import ignore
from comparisons.running.processes import Closed, EngineProcesses
from reference_impl.threads import usable_cores
from scenarios import DropspinError

POLL_INTERVAL = 0.5  # s
Piece = TypeVar("Piece")
Result = TypeVar("Result")


def as_jobs(jobs: int | None) -> int:
    """A number of pieces of work to do at a time; by default, the number of processors that this process may use.

    Raises:
        DropspinError: It is not a whole number above 0.
    """
    if jobs is None:
        return usable_cores()
    if isinstance(jobs, bool) or not isinstance(jobs, int) or jobs < 1:
        raise DropspinError(f"jobs: got {jobs!r}; give a whole number above 0.")
    return jobs


def work_in_parallel(
    pieces: Iterator[Piece],
    work: Callable[[Piece, EngineProcesses, Callable[[], None]], Result],
    crews: Sequence[EngineProcesses],
    on_done: Callable[[Piece, Result], None],
    on_wait: Callable[[], None] = ignore,
) -> None:
    """Do pieces of work, several at a time.

    Args:
        pieces: The pieces; the next one is requested when a processor is free.
        work: Called in a thread, with a piece, engine processes that no other piece uses at that time, and a function that raises once all
            work is to stop.
        crews: Engine processes for each of the pieces that are done at a time; they are abandoned at the end.
        on_done: Called with each piece and its result, in the order in which they are done; may raise to stop.
        on_wait: Called at least twice a second; may raise to stop.
    """
    stopping = Event()

    def raise_if_stopping() -> None:
        if stopping.is_set():
            raise Closed

    with ExitStack() as stack:
        idle = list(crews)
        threads = stack.enter_context(ThreadPoolExecutor(len(crews)))
        # On leaving, the engine processes end first, then the threads that wait for them.
        stack.callback(_abandon, crews, stopping)
        running: dict[Future[Result], tuple[Piece, EngineProcesses]] = {}
        while True:
            while idle and (piece := next(pieces, None)) is not None:
                processes = idle.pop()
                running[threads.submit(work, piece, processes, raise_if_stopping)] = piece, processes
            if not running:
                return
            finished, _ = wait(running, timeout=POLL_INTERVAL, return_when=FIRST_COMPLETED)
            on_wait()
            for future in finished:
                piece, processes = running.pop(future)
                on_done(piece, future.result())
                idle.append(processes)


def _abandon(crews: Sequence[EngineProcesses], stopping: Event) -> None:
    """End all running work; a process that ends with the work does not count as a failure of its engine."""
    stopping.set()
    for processes in crews:
        processes.abandon()
