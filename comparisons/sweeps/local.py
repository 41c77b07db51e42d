"""A sweep on this machine: one part at a time on each processor."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack

from dropspin.comparisons.running.parallel import work_in_parallel
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.sweeps.folder import SweepFolder
from dropspin.comparisons.sweeps.work import Part, Work
from dropspin.reference_impl.threads import usable_cores


def run_locally(work: Work, parts: Iterator[Part], folder: SweepFolder, on_progress: Callable[[int], None]) -> None:
    """Run parts and write them.

    Args:
        work: The sweep.
        parts: The parts to run; the next one is requested when a processor is free.
        folder: The folder to write to.
        on_progress: Called with the number of jobs completed since the last call, at least twice a second; may raise to stop the sweep.
    """

    def run_part(part: Part, processes: EngineProcesses, raise_if_stopping: Callable[[], None]) -> None:
        folder.write(*part, work.table(part, processes, raise_if_stopping))

    def on_done(part: Part, result: None) -> None:
        on_progress(part.last - part.first)

    with ExitStack() as stack:
        crews = [stack.enter_context(EngineProcesses(work.resources)) for _ in range(usable_cores())]
        work_in_parallel(parts, run_part, crews, on_done, lambda: on_progress(0))
