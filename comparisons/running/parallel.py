"""Pieces of work on all processors: one at a time on each, with engine processes of its own."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from threading import Lock
from typing import TypeVar

from dropspin.comparisons.results.interrupts import finished, interrupts_deferred
from dropspin.comparisons.running.arguments import EngineEntry, ignore
from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.reference_impl.threads import usable_cores
from dropspin.scenarios import DropspinError

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


def as_done(
    workers: Executor, work: Callable[[Piece], Result], pieces: Iterator[Piece], at_a_time: Callable[[], int]
) -> Iterator[tuple[Piece, Result] | None]:
    """Do pieces of work, several at a time, and yield each with its result when it is done; at least twice a second, yield None.

    Args:
        workers: What runs them.
        work: The work.
        pieces: The pieces; the next one is requested when it can be submitted.
        at_a_time: How many may be submitted and not done.
    """
    running: dict[Future[Result], Piece] = {}
    try:
        while True:
            while len(running) < at_a_time() and (piece := next(pieces, None)) is not None:
                with interrupts_deferred():
                    running[workers.submit(work, piece)] = piece
            if not running:
                return
            done = finished(running, POLL_INTERVAL)
            yield None
            for future in done:
                yield running.pop(future), future.result()
    finally:
        for future in running:
            future.cancel()


def work_in_parallel(
    pieces: Iterator[Piece],
    work: Callable[[Piece, EngineProcesses], Result],
    crews: Sequence[EngineProcesses],
    on_done: Callable[[Piece, Result], None],
    on_wait: Callable[[], None] = ignore,
) -> None:
    """Do pieces of work, several at a time.

    Args:
        pieces: The pieces; the next one is requested when a processor is free.
        work: Called in a thread, with a piece, and engine processes that no other piece uses at that time.
        crews: Engine processes for each of the pieces that are done at a time; they are abandoned if the work stops before its end.
        on_done: Called with each piece and its result, in the order in which they are done; may raise to stop.
        on_wait: Called at least twice a second; may raise to stop.
    """
    idle = list(crews)

    def work_with_processes(piece: Piece) -> Result:
        processes = idle.pop()
        found = work(piece, processes)
        idle.append(processes)
        return found

    with ThreadPoolExecutor(len(crews)) as threads:
        try:
            for done in as_done(threads, work_with_processes, pieces, lambda: len(crews)):
                if done is None:
                    on_wait()
                else:
                    on_done(*done)
        except BaseException:
            # The engine processes end first, then the threads that wait for them; such an end is no failure of an engine.
            for processes in crews:
                processes.abandon()
            raise


@contextmanager
def started_crews(
    jobs: int | None, pieces: int, entries: Sequence[EngineEntry], resources: ResourceLimits
) -> Iterator[list[EngineProcesses]]:
    """Engine processes for each of the pieces of work that are done at a time, all of them started, if there is any work.

    Args:
        jobs: Number of pieces to do at a time, as for `as_jobs`.
        pieces: Number of pieces.
        entries: The engines.
        resources: What each engine may use.
    """
    with ExitStack() as stack:
        crews = [stack.enter_context(EngineProcesses(resources)) for _ in range(min(as_jobs(jobs), max(pieces, 1)))]
        for processes in crews if pieces else ():
            processes.start([entry for entry in entries if not entry.absence])
        yield crews


def results_in_parallel(
    pieces: Sequence[Piece],
    work: Callable[[Piece, EngineProcesses, Callable[[str], None]], Result],
    crews: Sequence[EngineProcesses],
    on_progress: Callable[[str, float], None],
) -> list[Result]:
    """Do the pieces of a study, several at a time.

    Args:
        pieces: The pieces.
        work: Called in a thread, with a piece, engine processes as in `work_in_parallel`, and a function to call with what is being done.
        crews: Engine processes as in `work_in_parallel`.
        on_progress: Called with what is being done and the share of the pieces that are done, in any thread, but in one at a time; may
            raise to stop.

    Returns:
        The result of each piece.
    """
    found: dict[int, Result] = {}
    lock = Lock()

    def do(number: int, processes: EngineProcesses) -> Result:
        def report(what: str) -> None:
            with lock:
                on_progress(what, len(found) / len(pieces))

        return work(pieces[number], processes, report)

    work_in_parallel(iter(range(len(pieces))), do, crews, found.__setitem__)
    return [found[number] for number in range(len(pieces))]
