"""Sweeps on a Dask cluster: workers that are lost cost nothing but their jobs' retries."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from comparisons.engines.base import EngineMissing
from comparisons.sweeps import cluster, load_sweep, read, run_sweep
from scenarios import DropspinError

pytest.importorskip("distributed")

SPEC = {
    "scenes": ["bounce-95"],
    "engines": ["document", "mujoco"],
    "dts": [4e-3],
    "random": {"count": 40, "seed": 1, "floor.restitution": {"from": 0.5, "to": 1.0}},
}
CLUSTER = """
import sys, dask
from distributed import LocalCluster

if __name__ == "__main__":
    dask.config.set({"distributed.worker.daemon": sys.argv[2] == "daemonic"})
    with LocalCluster(n_workers=int(sys.argv[1]), threads_per_worker=1, dashboard_address=None) as here:
        print(here.scheduler_address, *(worker.pid for worker in here.workers.values()), flush=True)
        sys.stdin.read()
"""


@pytest.fixture
def workers(tmp_path, request):
    """A cluster in processes of its own, as a user has it: its address, and the processes of its workers."""
    count, kind = request.param
    (tmp_path / "cluster.py").write_text(CLUSTER)
    words = [sys.executable, tmp_path / "cluster.py", str(count), kind]
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=tmp_path)
    address, *pids = process.stdout.readline().split()
    try:
        yield address, [int(pid) for pid in pids]
    finally:
        process.communicate()


def table(where):
    return read(str(where)).drop(columns="time_per_step")


@pytest.mark.parametrize("workers", [(2, "free")], indirect=True)
def test_a_worker_that_is_killed_is_not_missed(workers, tmp_path):
    """Two workers, one killed when the first part is there: the table of a sweep on this machine, bit for bit."""
    address, pids = workers
    sweep = load_sweep(SPEC)
    done = []

    def told(jobs):
        if jobs and len(done) == 1:
            os.kill(pids[0], signal.SIGKILL)
        done.extend([jobs] if jobs else [])

    run_sweep(sweep, str(tmp_path / "cluster"), scheduler=address, told=told)
    assert len(done) > 2
    run_sweep(sweep, str(tmp_path / "here"))
    pd.testing.assert_frame_equal(table(tmp_path / "cluster"), table(tmp_path / "here"), check_exact=True)
    assert engines_of(pids[0]) == []


def engines_of(worker):
    """Processes that a worker has started and that are left."""
    stats = [path.read_text().rpartition(")")[2].split() for path in Path("/proc").glob("[0-9]*/stat")]
    return [stat for stat in stats if stat[1] == str(worker)]


@pytest.mark.parametrize("workers", [(1, "daemonic")], indirect=True)
def test_workers_that_cannot_keep_engines_apart(workers, tmp_path):
    """One line that says what to set."""
    with pytest.raises(DropspinError, match="set DASK_DISTRIBUTED__WORKER__DAEMON=False where workers are started"):
        run_sweep(load_sweep(SPEC), str(tmp_path / "out"), scheduler=workers[0])


def test_what_a_cluster_lacks(tmp_path, monkeypatch):
    """No scheduler, no Dask."""
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    with pytest.raises(DropspinError, match=r"--scheduler tcp://127.0.0.1:1: no scheduler answers .*; start one with: dask scheduler"):
        run_sweep(load_sweep(SPEC), str(tmp_path / "out"), scheduler="tcp://127.0.0.1:1")
    monkeypatch.setattr(cluster, "find_spec", lambda name: None)
    with pytest.raises(EngineMissing, match=r"pip install 'dropspin\[cluster\]'"):
        run_sweep(load_sweep(SPEC), str(tmp_path / "other"), scheduler="tcp://127.0.0.1:1")


def test_a_worker_of_other_versions_declines(tmp_path):
    """Figures of two versions do not go into one table."""
    from dataclasses import replace

    from comparisons.running.processes import ResourceLimits
    from comparisons.sweeps.work import Work

    work = Work.of(load_sweep(SPEC), ResourceLimits())
    other = replace(work, versions=work.versions | {"mujoco": "3.1"})
    with pytest.raises(DropspinError, match=r"a worker has mujoco \d.*, here it is 3.1; install the same on both"):
        cluster._do(other, next(other.parts), str(tmp_path))


@pytest.mark.parametrize("workers", [(0, "free")], indirect=True)
def test_a_scheduler_without_workers(workers, tmp_path, monkeypatch):
    """Says so, after a while, and makes nothing."""
    monkeypatch.setattr(cluster, "PATIENCE_FOR_WORKERS", 0.5)
    with pytest.raises(DropspinError, match=r"has had no worker for 0.5 s; start one with: dask worker tcp://"):
        run_sweep(load_sweep(SPEC), str(tmp_path / "out"), scheduler=workers[0])
    assert not (tmp_path / "out").exists()


def test_engines_of_one_sweep_are_none_of_the_next(tmp_path, monkeypatch):
    """A worker that has served another sweep, or other limits, ends that one's engines first."""
    from comparisons.running.processes import ResourceLimits
    from comparisons.sweeps.work import Work

    monkeypatch.setattr(cluster, "_go_on_unless_closing", lambda: None)
    used = []
    for seconds in (5.0, 6.0):
        work = Work.of(load_sweep(SPEC | {"engines": ["document"]}), ResourceLimits(processor_time=seconds))
        cluster._do(work, next(work.parts), str(tmp_path / str(seconds)))
        [(stamp, [processes])] = cluster._idle.items()
        used.append(processes)
        assert stamp == (work.identity, work.limits)
    assert used[0] is not used[1]
    assert used[0]._closed
    cluster._leave()
    assert used[1]._closed
