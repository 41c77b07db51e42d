"""Run a sweep, and read its table."""

from collections.abc import Callable, Iterator
from typing import Any

import pandas as pd
import pyarrow as pa

from dropspin.comparisons.running.cluster import connected
from dropspin.comparisons.running.inputs import ignore
from dropspin.comparisons.running.processes import ResourceLimits
from dropspin.comparisons.sweeps.cluster import run_on_cluster
from dropspin.comparisons.sweeps.folder import SweepFolder
from dropspin.comparisons.sweeps.jobs import Sweep
from dropspin.comparisons.sweeps.local import run_locally
from dropspin.comparisons.sweeps.work import Work
from dropspin.scenarios import DropspinError


def run_sweep(
    sweep: Sweep,
    where: str,
    *,
    resume: bool = False,
    scheduler: str | None = None,
    resources: ResourceLimits = ResourceLimits(processor_time=60.0),  # noqa: B008 - it is immutable
    on_progress: Callable[[int], None] | None = None,
) -> None:
    """Run the jobs of a sweep that a folder does not have yet.

    Args:
        sweep: The sweep, from `load_sweep`.
        where: The folder, or a URL that fsspec supports.
        resume: Whether the folder may hold parts of the same sweep, which are kept.
        scheduler: The address of a Dask scheduler; None: run on this machine.
        resources: The processor time [s] and memory [bytes] that an engine may use for one job.
        on_progress: Called with the number of jobs completed since the last call, first with those that the folder has; may raise to
            stop the sweep.

    Raises:
        DropspinError: The folder holds something else, or is not writable.
    """
    work = Work.of(sweep, resources)
    folder = SweepFolder(where, work.identity)
    earlier = folder.description()
    kept = 0
    if earlier is not None and folder.groups():  # a sweep that was refused or interrupted before its first job may be given again
        _verify_same_sweep(where, earlier, work)
        kept = count(where)
        if not resume:
            raise DropspinError(
                f"{where}: holds {kept:,} of {sweep.size:,} jobs of this sweep; resume it with --resume, or choose another folder with -o."
            )
    report = on_progress or ignore
    report(kept)
    parts = work.missing(folder)
    if scheduler is None:
        folder.begin(work.description)
        run_locally(work, parts, folder, report)
        return
    with connected(scheduler) as client:
        folder.begin(work.description)
        run_on_cluster(client, work, parts, folder, report)


def count(where: str) -> int:
    """The number of jobs that a folder has; 0 if it holds no sweep."""
    return sum(jobs for jobs, _ in _parts(where)) if SweepFolder(where).description() is not None else 0


def read_sweep(where: str) -> pd.DataFrame:
    """The table of a sweep, in the order of its jobs; of an unfinished sweep, the jobs that have been run.

    Args:
        where: The folder, or a URL that fsspec supports.

    Returns:
        One row a job.

    Raises:
        DropspinError: The folder does not hold a sweep, none of its jobs has been run, or a part is damaged.
    """
    tables = list(read_sweep_parts(where))
    if not tables:
        raise DropspinError(f"{where}: no job has been run yet; run the sweep with --resume.")
    return pa.concat_tables(tables).to_pandas()


def read_sweep_parts(where: str, columns: list[str] | None = None) -> Iterator[pa.Table]:
    """The table of a sweep part by part, for tables that are larger than memory.

    Args:
        where: The folder, or a URL that fsspec supports.
        columns: Names of the columns to read; None: all.

    Returns:
        An iterator over the parts, in the order of the jobs, each a PyArrow table.

    Raises:
        DropspinError: The folder does not hold a sweep, or a part is damaged.
    """
    folder, schema = SweepFolder(where), None
    for _, path in _parts(where):
        table = folder.read(path, columns)
        schema = schema or table.schema
        if table.schema != schema:
            raise DropspinError(f"{path}: has other columns than the parts before it; delete it, and run its jobs again with --resume.")
        yield table


def _parts(where: str) -> Iterator[tuple[int, str]]:
    """The number of jobs of each part in a folder, and its path."""
    about = SweepFolder(where).description()
    if about is None:
        raise DropspinError(f"{where}: does not hold a sweep; give the folder that dropspin sweep -o wrote.")
    folder, size = SweepFolder(where, about["identity"]), about["part_size"]
    for group in folder.groups():
        for first, path in folder.parts(group).items():
            yield min(size, about["jobs"] - first), path


def _verify_same_sweep(where: str, earlier: dict[str, Any], work: Work) -> None:
    """Raise `DropspinError` unless a folder holds this sweep, run with the installed versions."""
    if earlier["identity"] == work.identity:
        return
    then, now = earlier["provenance"]["versions"], work.versions
    changed = [f"{name} {then.get(name)}, now {now[name]}" for name in now if then.get(name) != now[name]]
    difference = f"a sweep that was run with {', '.join(changed)}" if changed else "another sweep: the specs differ"
    raise DropspinError(f"{where}: holds {difference}; choose another folder with -o.")
