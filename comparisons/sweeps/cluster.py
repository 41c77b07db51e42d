"""A sweep on a Dask cluster: one task for each part; the worker that runs it writes it to a folder that all machines share.

Each worker runs engines in processes of their own, as a sweep on one machine does. If a worker is lost, another one repeats its current
part; the parts that it had written are kept.
"""

import multiprocessing
from collections.abc import Callable, Iterator
from typing import Any

from dropspin.comparisons.running.processes import EngineProcesses, ResourceLimits
from dropspin.comparisons.sweeps.folder import SweepFolder
from dropspin.comparisons.sweeps.work import Part, Work, installed_versions
from dropspin.scenarios import DropspinError

PARTS_PER_THREAD = 2
"""Parts submitted for each thread of a worker, so that the next one is there when one is finished."""
MAX_ATTEMPTS = 20
"""Lost workers after which a part counts as their cause."""
POLL_INTERVAL = 0.5  # s


def run_on_cluster(client: Any, work: Work, parts: Iterator[Part], folder: SweepFolder, on_progress: Callable[[int], None]) -> None:
    """Run parts on the workers of a client's scheduler; the other arguments are those of `local.run_locally`.

    At the end, the engine processes of the workers end.

    Raises:
        DropspinError: A worker cannot run its part. The text gives the reason and the remedy.
    """
    try:
        _run_parts(client, work, parts, folder, on_progress)
    finally:
        client.run(_close_idle_processes, on_error="ignore")


def _run_parts(client: Any, work: Work, parts: Iterator[Part], folder: SweepFolder, on_progress: Callable[[int], None]) -> None:
    from distributed import KilledWorker, wait

    running: dict[Any, Part] = {}
    attempts: dict[Part, int] = {}

    def submit(part: Part) -> None:
        key = f"{work.identity}-{part.first}-{attempts.setdefault(part, 0)}"
        running[client.submit(_run_part, work, part, folder.address, key=key, pure=False)] = part

    while True:
        while len(running) < PARTS_PER_THREAD * max(1, sum(client.nthreads().values())) and (part := next(parts, None)) is not None:
            submit(part)
        if not running:
            return
        try:
            finished = wait(list(running), timeout=POLL_INTERVAL, return_when="FIRST_COMPLETED").done  # type: ignore[no-untyped-call]  # distributed has no types
        except TimeoutError:
            finished = set()
        completed_jobs = 0
        for future in finished:
            part = running.pop(future)
            try:
                future.result()
            except KilledWorker as error:
                attempts[part] += 1
                if attempts[part] >= MAX_ATTEMPTS:
                    raise DropspinError(
                        f"jobs {part.first} to {part.last - 1}: the worker was lost in each of {MAX_ATTEMPTS} attempts ({error})."
                    ) from None
                submit(part)
                continue
            if not folder.has(*part):
                raise DropspinError(
                    f"{folder.where}: a part that a worker wrote is not visible from here; give a folder that all machines share."
                )
            del attempts[part]
            completed_jobs += part.last - part.first
        on_progress(completed_jobs)


_Owner = tuple[str, ResourceLimits]
_idle: dict[_Owner, list[EngineProcesses]] = {}
"""On a worker: the engine processes that are not in use, by the sweep they belong to; at most one set for each thread of the worker."""


def _run_part(work: Work, part: Part, where: str) -> None:
    """On a worker: run a part, unless another worker has written it."""
    folder = SweepFolder(where, work.identity)
    if folder.has(*part):
        return
    if multiprocessing.current_process().daemon:
        raise DropspinError(
            "a worker may not start processes, in which engines are isolated; "
            "set DASK_DISTRIBUTED__WORKER__DAEMON=False where workers are started, or start them with --no-nanny."
        )
    for package, version in installed_versions().items():
        if version != work.versions[package]:
            raise DropspinError(f"a worker has {package} {version}, this machine has {work.versions[package]}; install the same on both.")
    owner = (work.identity, work.resources)
    _close_idle_processes(except_for=owner)  # those of a client that was killed
    idle = _idle.setdefault(owner, [])
    processes = idle.pop() if idle else EngineProcesses(work.resources, start_method="spawn")
    try:
        folder.write(*part, work.table(part, processes, _reschedule_if_closing))
    finally:
        idle.append(processes)
        if _idle.get(owner) is not idle:  # the sweep has been left in the meantime, and nothing else will close them
            _close(idle)


def _reschedule_if_closing() -> None:
    """On a worker that is closing, engine processes may have been ended already, which is not a failure of their engines."""
    from distributed import Reschedule, Status, get_worker

    if get_worker().status != Status.running:
        raise Reschedule  # on another worker


def _close_idle_processes(except_for: _Owner | None = None) -> None:
    """On a worker: end the engine processes that are not in use, of all sweeps but one; those in use end with their parts."""
    for owner in [owner for owner in _idle if owner != except_for]:
        _close(_idle.pop(owner))


def _close(idle: list[EngineProcesses]) -> None:
    while idle:
        with idle.pop():
            pass
