"""Record releases: those that the record does not have yet, several at a time."""

from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from itertools import chain
from pathlib import Path
from threading import Event
from typing import Any

from dropspin.comparisons.engines import registry
from dropspin.comparisons.engines.adapter_code import built_in_code
from dropspin.comparisons.engines.registry import BUILT_IN
from dropspin.comparisons.record.environments import measured, prereleases, releases
from dropspin.comparisons.record.plan import Plan
from dropspin.comparisons.record.store import Record, machine
from dropspin.comparisons.running.cluster import connected
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.parallel import as_done
from dropspin.scenarios.errors import verify_known


def record(
    record: Record,
    plan: Plan,
    engines: Collection[str] = (),
    chosen: Collection[str] = (),
    *,
    pre: bool = False,
    jobs: int,
    scheduler: str | None = None,
    time_limit: float,
    on_done: Callable[[str, int], None],
) -> dict[str, list[str]]:
    """Measure releases that the record does not have, and write each into it when it is measured.

    Args:
        record: The record.
        plan: What to measure.
        engines: Names of engines; all by default.
        chosen: Releases; all by default.
        pre: Whether prereleases may be chosen too. The default is then the newest release and the newest prerelease after it, of
            engines that have one.
        jobs: How many to measure at a time on this machine.
        scheduler: The address of a Dask scheduler, on whose workers to measure instead.
        time_limit: Processor time that an engine may use for one simulation [s].
        on_done: Called after each release with its name and what became of it, and with the number that is left.

    Returns:
        The releases that were asked for of each engine, oldest first.

    Raises:
        DropspinError: There is no such engine or release, an index cannot be asked, the record cannot be written, or the scheduler does
            not answer or is lost.
    """
    verify_known("engine of the record", engines, plan.engines)
    listed = {engine: releases(own.package, own.oldest) for engine, own in plan.engines.items() if engine in (engines or plan.engines)}
    after = {engine: prereleases(plan.engines[engine].package, names[-1]) if pre else [] for engine, names in listed.items()}
    verify_known("release", chosen, list(chain(*listed.values(), *after.values())))
    record.write_releases(listed)
    asked = {engine: _asked(names, after[engine], chosen, pre=pre) for engine, names in listed.items()}
    common = {engine: {"plan": plan.digest(engine), "adapter": _code(engine)} for engine in listed}
    with _workers(jobs, scheduler) as (workers, machines):
        pending = [
            (engine, release)
            for engine, names in asked.items()
            for release in names
            if not any(record.has(engine, release, common[engine] | one) for one in machines)
        ]
        stopping, left = None if scheduler else Event(), len(pending)
        work = partial(_measured, plan, time_limit, stopping)
        try:
            for (engine, release), (rows, measured_on) in filter(None, as_done(workers, work, iter(pending), lambda: len(pending))):
                stays = "" if record.write(engine, release, rows, common[engine] | measured_on) else "; the earlier file stays"
                left -= 1
                results = sum(bool(row.get("metric")) for row in rows)
                on_done(f"{engine} {release}: {f'{results} results' if results else rows[0]['reason']}{stays}", left)
        finally:
            if stopping is not None:
                stopping.set()
    return asked


def _asked(names: Sequence[str], after: Sequence[str], chosen: Collection[str], *, pre: bool) -> list[str]:
    """The releases to measure, of the releases of an engine and the prereleases after them."""
    if chosen:
        return [release for release in (*names, *after) if release in chosen]
    return [names[-1], after[-1]] if after else [] if pre else list(names)


@contextmanager
def _workers(jobs: int, scheduler: str | None) -> Iterator[tuple[Executor, list[dict[str, str]]]]:
    """What runs the work, threads of this process or the workers of a Dask scheduler, and the machines on which it runs."""
    if scheduler is None:
        with ThreadPoolExecutor(jobs) as threads:
            yield threads, [machine()]
        return
    with connected(scheduler) as client:
        yield client.get_executor(pure=False), list(client.run(machine).values())


def _measured(plan: Plan, time_limit: float, stopping: Event | None, asked: tuple[str, str]) -> tuple[list[dict[str, Any]], dict[str, str]]:
    """Measure a release, on a worker: its rows, or one with the reason why it has no results; the machine, and the versions of packages."""
    try:
        found = measured(plan, *asked, time_limit, stopping or Event())
    except Breakdown as failure:
        return [{"verdict": failure.verdict, "reason": str(failure)}], machine()
    return found["rows"], machine() | {"versions": found["versions"]}


def _code(engine: str) -> str:
    """The hash of an adapter's code, whose engine need not be installed here."""
    return built_in_code(Path(registry.__file__).with_name(f"{BUILT_IN[engine].module.rpartition('.')[2]}.py"))
