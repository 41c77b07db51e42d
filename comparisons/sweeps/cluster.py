"""A sweep on a Dask cluster: a task for each part; who does it writes it where all can read.

Each worker keeps its engines in processes of their own, as a sweep on one machine does. A worker that is lost takes with it what it was
at; another does that again, and finds written what had been.
"""

import multiprocessing
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from comparisons.engines.base import EngineMissing
from comparisons.running.processes import EngineProcesses, ResourceLimits
from comparisons.sweeps.parts import Folder
from comparisons.sweeps.work import Part, Work, versions_here
from scenarios import DropspinError

AHEAD = 2  # parts for each thread of a worker: the next is there when one is done
TRIES = 20  # with so many workers lost over one part it is the part
PATIENCE, PATIENCE_FOR_WORKERS = 30.0, 120.0  # s, for a scheduler to answer, and for the first of its workers
TICK = 0.5  # s


@contextmanager
def connected(scheduler: str) -> Iterator[Any]:
    """A client of a scheduler; on leaving, the workers' engines end.

    Raises:
        EngineMissing: Dask is not installed.
        DropspinError: The scheduler does not answer.
    """
    if not re.fullmatch(r"[a-z]+://[^\s:]+:\d+", scheduler):
        raise DropspinError(
            f"--scheduler {scheduler}: is no address; it is what dask scheduler says when it starts, such as tcp://host:8786."
        )
    if find_spec("distributed") is None:
        raise EngineMissing("--scheduler needs Dask, which is not installed: pip install 'dropspin[cluster]'.")
    from distributed import Client

    try:
        client = Client(scheduler, timeout=PATIENCE, set_as_default=False)  # type: ignore[no-untyped-call]  # distributed's has no types
    except (OSError, ValueError) as error:
        raise DropspinError(f"--scheduler {scheduler}: no scheduler answers ({error}); start one with: dask scheduler.") from None
    with client, client.as_current():
        try:
            client.wait_for_workers(1, timeout=PATIENCE_FOR_WORKERS)
        except TimeoutError:
            said = f"has had no worker for {PATIENCE_FOR_WORKERS:g} s; start one with: dask worker {scheduler}"
            raise DropspinError(f"--scheduler {scheduler}: {said}.") from None
        try:
            yield client
        finally:
            client.run(_leave, on_error="ignore")


def run_on_cluster(client: Any, work: Work, parts: Iterator[Part], folder: Folder, on_progress: Callable[[int], None]) -> None:
    """Have parts done by the workers of a client's scheduler; the other arguments are those of `local.run_here`.

    Raises:
        DropspinError: A worker cannot do its part. The text says why, and what to do.
    """
    from distributed import KilledWorker, wait

    flying: dict[Any, Part] = {}
    tries: dict[Part, int] = {}

    def send(part: Part) -> None:
        flying[
            client.submit(_do, work, part, folder.address, key=f"{work.identity}-{part.first}-{tries.setdefault(part, 0)}", pure=False)
        ] = part

    while True:
        while len(flying) < AHEAD * max(1, sum(client.nthreads().values())) and (part := next(parts, None)) is not None:
            send(part)
        if not flying:
            return
        try:
            landed = wait(list(flying), timeout=TICK, return_when="FIRST_COMPLETED").done  # type: ignore[no-untyped-call]  # distributed's has no types
        except TimeoutError:
            landed = set()
        done = 0
        for one in landed:
            part = flying.pop(one)
            try:
                one.result()
            except KilledWorker as error:
                tries[part] += 1
                if tries[part] >= TRIES:
                    raise DropspinError(
                        f"jobs {part.first} to {part.last - 1}: {TRIES} times the workers that had them were lost ({error})."
                    ) from None
                send(part)
                continue
            if not folder.has(*part):
                raise DropspinError(
                    f"{folder.where}: a worker has written a part there that cannot be seen from here; give a folder that all share."
                )
            del tries[part]
            done += part.last - part.first
        on_progress(done)


Stamp = tuple[str, ResourceLimits]
_idle: dict[Stamp, list[EngineProcesses]] = {}
"""The engines' processes of this worker by the sweep they are for, as many sets as its threads have been at work at a time."""


def _do(work: Work, part: Part, where: str) -> None:
    """On a worker: do a part, unless another has."""
    folder = Folder(where, work.identity)
    if folder.has(*part):
        return
    if multiprocessing.current_process().daemon:
        raise DropspinError(
            "a worker may not start processes, in which engines are kept apart; "
            "set DASK_DISTRIBUTED__WORKER__DAEMON=False where workers are started, or start them with --no-nanny."
        )
    for package, version in versions_here().items():
        if version != work.versions[package]:
            raise DropspinError(f"a worker has {package} {version}, here it is {work.versions[package]}; install the same on both.")
    stamp = (work.identity, work.resources)
    _leave(but=stamp)  # a client that was killed has left its own
    at_rest = _idle.setdefault(stamp, [])
    processes = at_rest.pop() if at_rest else EngineProcesses(work.resources, start_method="spawn")
    try:
        folder.write(*part, work.table(part, processes, _go_on_unless_closing))
    finally:
        at_rest.append(processes)  # which nobody takes up if the sweep has been left meanwhile
        if _idle.get(stamp) is not at_rest:
            _end(at_rest)


def _go_on_unless_closing() -> None:
    """On a worker that is asked to end, its engines may have been ended already: that is no failure of theirs."""
    from distributed import Reschedule, Status, get_worker

    if get_worker().status != Status.running:
        raise Reschedule  # elsewhere


def _leave(but: Stamp | None = None) -> None:
    """On a worker: end the engines' processes that are at rest, of all sweeps but one; those at work end with their parts."""
    for stamp in [stamp for stamp in _idle if stamp != but]:
        _end(_idle.pop(stamp))


def _end(at_rest: list[EngineProcesses]) -> None:
    while at_rest:
        with at_rest.pop():
            pass
