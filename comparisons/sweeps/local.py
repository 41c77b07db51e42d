"""A sweep on this machine: as many parts at a time as processors, each with the engines in processes of its own."""

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack
from threading import Event

from comparisons.isolation import Cells, Closed
from comparisons.sweeps.parts import Folder
from comparisons.sweeps.work import Part, Work
from reference_impl.simulate import usable_cores

TICK = 0.5  # s


def run_here(work: Work, parts: Iterator[Part], folder: Folder, told: Callable[[int], None]) -> None:
    """Do parts and write them.

    Args:
        work: The sweep.
        parts: Which; no more are asked for than are at work.
        folder: Where to.
        told: Called with the number of jobs done since the last call, twice a second at least; may raise to end it all.
    """
    stopping = Event()

    def do(part: Part, cells: Cells) -> None:
        folder.write(*part, work.table(part, cells, lambda: _go_on_unless(stopping)))

    with ExitStack() as homes:
        idle = [homes.enter_context(Cells(work.limits)) for _ in range(usable_cores())]
        threads = homes.enter_context(ThreadPoolExecutor(usable_cores()))
        # First the engines end, then the threads that wait for them, then what is left.
        homes.callback(_abandon, list(idle), stopping)
        flying: dict[Future[None], tuple[Part, Cells]] = {}
        while True:
            while idle and (part := next(parts, None)) is not None:
                cells = idle.pop()
                flying[threads.submit(do, part, cells)] = part, cells
            if not flying:
                return
            landed, _ = wait(flying, timeout=TICK, return_when=FIRST_COMPLETED)
            done = 0
            for one in landed:
                part, cells = flying.pop(one)
                one.result()
                idle.append(cells)
                done += part.last - part.first
            told(done)


def _abandon(cells_of_all: list[Cells], stopping: Event) -> None:
    """End all that is at work; what ends with the sweep is no engine's failure."""
    stopping.set()
    for cells in cells_of_all:
        cells.abandon()


def _go_on_unless(stopping: Event) -> None:
    if stopping.is_set():
        raise Closed
