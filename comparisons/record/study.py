"""Record releases: those that the record does not have yet, several at a time."""

from collections.abc import Callable, Collection
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from importlib.util import find_spec
from pathlib import Path
from threading import Event
from typing import NamedTuple

from comparisons.engines.adapter_code import built_in_code
from comparisons.engines.registry import BUILT_IN
from comparisons.record.environments import NOT_INSTALLABLE, POLL, NotMeasured, measured, releases
from comparisons.record.plan import Plan
from comparisons.record.store import Record, machine
from scenarios import UnknownName


class Release(NamedTuple):
    """A release of an engine, and what became of it: the number of its results, or why there are none."""

    engine: str
    release: str
    results: int = 0
    reason: str = ""


def record(
    record: Record,
    plan: Plan,
    engines: Collection[str] = (),
    chosen: Collection[str] = (),
    *,
    jobs: int,
    time_limit: float,
    on_done: Callable[[Release, int], None],
) -> None:
    """Measure releases that the record does not have, and write each into it when it is measured.

    Args:
        record: The record.
        plan: What to measure.
        engines: Names of engines; all by default.
        chosen: Releases; all by default.
        jobs: How many to measure at a time.
        time_limit: Processor time that an engine may use for one simulation [s].
        on_done: Called after each release with what became of it, and with the number that is left.

    Raises:
        DropspinError: There is no such engine or release, pip's index cannot be asked, or the record cannot be written.
    """
    for engine in engines:
        if engine not in plan.engines:
            raise UnknownName("engine of the record", engine, plan.engines)
    listed = {engine: releases(own.package, own.oldest) for engine, own in plan.engines.items() if engine in (engines or plan.engines)}
    for release in chosen:
        if release not in (known := [one for names in listed.values() for one in names]):
            raise UnknownName("release", release, known)
    record.write_releases(listed)
    common = {engine: {"plan": plan.digest(engine), "adapter": _code(engine)} | machine() for engine in listed}
    pending = [
        Release(engine, release)
        for engine, names in listed.items()
        for release in names
        if (not chosen or release in chosen) and not record.has(engine, release, common[engine])
    ]
    stopping = Event()

    def work(one: Release) -> Release:
        reason, versions = "", ""
        try:
            found = measured(plan, one.engine, one.release, time_limit, stopping)
            rows, versions = found["rows"], found["versions"]
        except NotMeasured as failure:
            reason = str(failure)
            rows = [{"verdict": "missing" if reason.startswith(NOT_INSTALLABLE) else "broken", "reason": reason}]
        record.write(one.engine, one.release, rows, common[one.engine] | {"versions": versions})
        count = sum(bool(row.get("metric")) for row in rows)
        return one._replace(results=count, reason=reason or ("" if count else rows[0]["reason"]))

    with ThreadPoolExecutor(jobs) as threads:
        running: set[Future[Release]] = {threads.submit(work, one) for one in pending}
        try:
            while running:
                finished, running = wait(running, timeout=POLL, return_when=FIRST_COMPLETED)
                for future in finished:
                    on_done(future.result(), len(running))
        finally:
            stopping.set()
            threads.shutdown(cancel_futures=True)


def _code(engine: str) -> str:
    """The hash of an adapter's code, whose engine need not be installed here."""
    spec = find_spec(BUILT_IN[engine].module)
    assert spec is not None
    assert spec.origin is not None
    return built_in_code(Path(spec.origin))
