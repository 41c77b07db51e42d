"""Sweeps from beginning to end, and their tables read back."""

from collections.abc import Callable, Iterator
from typing import Any

import pandas as pd
import pyarrow as pa

from comparisons.running.processes import ResourceLimits
from comparisons.sweeps.cluster import connected, run_on_cluster
from comparisons.sweeps.jobs import Sweep
from comparisons.sweeps.local import run_here
from comparisons.sweeps.parts import Folder
from comparisons.sweeps.work import Work
from scenarios import DropspinError


def run_sweep(
    sweep: Sweep,
    where: str,
    *,
    resume: bool = False,
    scheduler: str | None = None,
    resources: ResourceLimits = ResourceLimits(processor_time=60.0),  # noqa: B008 - it is immutable
    on_progress: Callable[[int], None] = lambda done: None,
) -> None:
    """Run what a folder has not yet of a sweep.

    Args:
        sweep: The sweep.
        where: The folder, or a URL that fsspec knows.
        resume: Go on where an earlier run of the same sweep ended, however it ended.
        scheduler: The address of a Dask scheduler; None: on this machine.
        resources: What an engine may use for one job.
        on_progress: Called with the number of jobs done since the last call, those that were there first; may raise to end it all.

    Raises:
        DropspinError: The folder holds something else, or cannot be written.
    """
    work = Work.of(sweep, resources)
    folder = Folder(where, work.identity)
    earlier = folder.about()
    if earlier is not None:
        _assert_the_same(where, earlier, work)
        kept = count(where)
        if not resume:
            raise DropspinError(
                f"{where}: holds {kept:,} of {sweep.size:,} jobs of this sweep; --resume goes on, or choose another folder with -o."
            )
    else:
        kept = 0
    on_progress(kept)
    parts = work.missing(folder)
    if scheduler is None:
        folder.begin(work.about)
        run_here(work, parts, folder, on_progress)
        return
    with connected(scheduler) as client:
        folder.begin(work.about)
        run_on_cluster(client, work, parts, folder, on_progress)


def count(where: str) -> int:
    """How many jobs a folder has; 0 if no sweep has begun there."""
    return sum(jobs for jobs, _ in _parts(where)) if Folder(where).about() is not None else 0


def read_sweep(where: str) -> pd.DataFrame:
    """The table of a sweep, in the order of its jobs; of one that has not come to its end, what there is.

    Raises:
        DropspinError: The folder holds no sweep.
    """
    return pa.concat_tables(read_parts(where)).to_pandas()


def read_parts(where: str, columns: list[str] | None = None) -> Iterator[pa.Table]:
    """The same part by part, for tables that are larger than memory."""
    folder = Folder(where)
    for _, path in _parts(where):
        yield folder.read(path, columns)


def _parts(where: str) -> Iterator[tuple[int, str]]:
    """How many jobs are in each part that is there, and its path."""
    about = Folder(where).about()
    if about is None:
        raise DropspinError(f"{where}: no sweep is there; give the folder that dropspin sweep -o wrote.")
    folder, size = Folder(where, about["identity"]), about["part_size"]
    for group in folder.groups():
        for first, path in folder.listed(group).items():
            yield min(size, about["jobs"] - first), path


def _assert_the_same(where: str, earlier: dict[str, Any], work: Work) -> None:
    """Raise `DropspinError` unless a folder's sweep is this one, of these versions."""
    if earlier["identity"] == work.identity:
        return
    then, now = earlier["provenance"]["versions"], work.versions
    changed = [f"{name} {then.get(name)}, now {now[name]}" for name in now if then.get(name) != now[name]]
    why = f"made with {', '.join(changed)}" if changed else "asked for differently"
    raise DropspinError(f"{where}: holds a sweep that was {why}; choose another folder with -o.")
