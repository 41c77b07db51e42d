"""Run a sweep: one part at a time on each processor of this machine, or one task for each part on a Dask cluster.

On a cluster, the worker that runs a part writes it to a folder that all machines share. Each worker runs engines in processes of their own,
as a sweep on one machine does. If a worker is lost, another one repeats its current part; the parts that it had written are kept.
"""

import multiprocessing
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from dropspin.comparisons.running.arguments import described_value, ignore
from dropspin.comparisons.running.cluster import connected
from dropspin.comparisons.running.parallel import as_done, started_crews, work_in_parallel
from dropspin.comparisons.running.process_limits import ONE_MINUTE, ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses
from dropspin.comparisons.sweeps.folder import SweepFolder
from dropspin.comparisons.sweeps.jobs import Sweep
from dropspin.comparisons.sweeps.parts import Work, installed_versions
from dropspin.reference_impl.threads import usable_cores
from dropspin.scenarios import DropspinError

PARTS_PER_THREAD = 2
"""Parts submitted for each thread of a worker, so that the next one is there when one is finished."""


def run_sweep(
    sweep: Sweep,
    where: str,
    *,
    resume: bool = False,
    scheduler: str | None = None,
    resources: ResourceLimits = ONE_MINUTE,
    on_progress: Callable[[int], None] | None = None,
) -> None:
    """Run the jobs of a sweep whose results are not yet in a folder.

    Args:
        sweep: The sweep, from `load_sweep`.
        where: The folder, or a URL that fsspec supports.
        resume: Whether the folder may already have parts of the same sweep, which are then kept.
        scheduler: The address of a Dask scheduler; None to run on this machine.
        resources: The processor time [s] and memory [bytes] that an engine may use for one job.
        on_progress: Called with the number of jobs completed since the last call; the first call counts those already in the folder. It may
            raise an exception to stop the sweep.

    Raises:
        DropspinError: The folder contains other files or another sweep, or is not writable, or `sweep` is not from `load_sweep`.
    """
    if not isinstance(sweep, Sweep):
        raise DropspinError(
            f"sweep: got {described_value(sweep)}; give the result of dropspin.load_sweep, which takes a file or a mapping."
        )
    work = Work.of(sweep, resources)
    folder = SweepFolder(where, work.identity, work.part_size)
    earlier, present = folder.description(), folder.parts()
    kept = sum(map(len, present))
    if earlier is not None and SweepFolder(where).parts():  # without a part, the sweep may be given again
        another = "choose another folder with -o"
        if earlier.identity != work.identity:
            then, now = earlier.versions, work.versions
            changed = [f"{name} {then.get(name)}, now {now[name]}" for name in now if then.get(name) != now[name]]
            difference = (
                f"a sweep that was run with {', '.join(changed)}" if changed else "another sweep: the specs or the time limits differ"
            )
            raise DropspinError(f"{where}: holds {difference}; {another}.")
        if not resume:
            raise DropspinError(f"{where}: holds {kept:,} of {sweep.size:,} jobs of this sweep; resume it with --resume, or {another}.")
    report = on_progress or ignore
    report(kept)
    missing = (part for part in work.parts if part not in present)
    if scheduler is None:
        folder.begin(work.description)

        def run_part(part: range, processes: EngineProcesses) -> None:
            folder.write(part, work.table(part, processes))

        with started_crews(None, usable_cores(), [], work.resources) as crews:
            work_in_parallel(missing, run_part, crews, lambda part, _: report(len(part)), lambda: report(0))
        return
    with connected(scheduler) as client:
        folder.begin(work.description)
        _run_on_cluster(client, work, missing, folder, report)


def _run_on_cluster(client: Any, work: Work, parts: Iterator[range], folder: SweepFolder, on_progress: Callable[[int], None]) -> None:
    """Run parts on the workers of a client's scheduler, and end the engine processes of the workers.

    Raises:
        DropspinError: A worker cannot run its part. The text gives the reason and the remedy.
    """
    run_part = partial(_run_on_worker, work, folder.address)
    workers = client.get_executor(pure=False)
    try:
        for done in as_done(workers, run_part, parts, lambda: PARTS_PER_THREAD * max(1, sum(client.nthreads().values()))):
            if done is None:
                on_progress(0)
                continue
            part, _ = done
            on_progress(len(part))
            if not folder.has(part):
                raise DropspinError(
                    f"{folder.where}: a part that a worker wrote is not visible from here; give a folder that all machines share."
                )
    finally:
        if client.status == "running":  # else the scheduler is lost, and with it the way to its workers
            client.run(_close_idle_processes, on_error="ignore")


_Owner = tuple[str, ResourceLimits]
_idle: dict[_Owner, list[EngineProcesses]] = {}
"""On a worker: the engine processes that are not in use, by the sweep they belong to; at most one set for each thread of the worker."""


def _run_on_worker(work: Work, where: str, part: range) -> None:
    """On a worker: run a part, unless another worker has written it."""
    folder = SweepFolder(where, work.identity, work.part_size)
    if folder.has(part):
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
        folder.write(part, work.table(part, processes, _reschedule_if_closing))
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
