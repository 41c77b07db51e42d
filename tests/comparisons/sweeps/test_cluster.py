"""Sweeps on a Dask cluster: a lost worker changes nothing in the table."""

import multiprocessing
import os
import signal
import socket
import subprocess
import sys
import threading
from contextlib import nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import pandas as pd
import pytest

from dropspin.comparisons.engines.base import EngineMissing
from dropspin.comparisons.running import cluster as connection
from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.comparisons.sweeps import running
from dropspin.comparisons.sweeps.folder import read_sweep
from dropspin.comparisons.sweeps.parts import Work
from dropspin.comparisons.sweeps.running import run_sweep
from dropspin.comparisons.sweeps.spec import load_sweep
from dropspin.scenarios import DropspinError

pytest.importorskip("distributed")

SPEC = {
    "scenes": ["bounce-95"],
    "engines": ["mujoco"],
    "dts": [4e-3],
    "random": {"count": 12, "seed": 1, "floor.restitution": {"from": 0.5, "to": 1.0}},
}
CLUSTER = """
import sys, dask
from distributed import LocalCluster

if __name__ == "__main__":
    dask.config.set({"distributed.worker.daemon": False})
    with LocalCluster(n_workers=int(sys.argv[1]), threads_per_worker=1, dashboard_address=None) as here:
        print(here.scheduler_address, *(worker.pid for worker in here.workers.values()), flush=True)
        sys.stdin.read()
"""


@pytest.fixture
def workers(tmp_path, request):
    """A cluster in processes of its own, as a user has it: its address, and the processes of its workers."""
    (tmp_path / "cluster.py").write_text(CLUSTER)
    words = [sys.executable, tmp_path / "cluster.py", str(request.param)]
    process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=tmp_path)
    address, *pids = process.stdout.readline().split()
    try:
        yield address, [int(pid) for pid in pids]
    finally:
        process.communicate()


def table(where):
    return read_sweep(str(where)).drop(columns="time_per_step")


def children_of(worker):
    stats = [path.read_text().rpartition(")")[2].split() for path in Path("/proc").glob("[0-9]*/stat")]
    return [stat for stat in stats if stat[1] == str(worker)]


@pytest.mark.extended
@pytest.mark.parametrize("workers", [2], indirect=True)
def test_table_is_the_same_after_a_worker_is_killed(workers, tmp_path):
    """Two workers, one killed when the first part is there: the table of a sweep on this machine, bit for bit."""
    address, pids = workers
    sweep, completed = load_sweep(SPEC), []

    def on_progress(jobs):
        if jobs and len(completed) == 1:
            os.kill(pids[0], signal.SIGKILL)
        completed.extend([jobs] if jobs else [])

    run_sweep(sweep, str(tmp_path / "cluster"), scheduler=address, on_progress=on_progress)
    assert len(completed) > 2
    run_sweep(sweep, str(tmp_path / "here"))
    pd.testing.assert_frame_equal(table(tmp_path / "cluster"), table(tmp_path / "here"), check_exact=True)
    assert children_of(pids[0]) == []


@pytest.mark.extended
@pytest.mark.parametrize("workers", [1], indirect=True)
def test_scheduler_that_is_killed_is_reported_with_the_remedy(workers, tmp_path, monkeypatch, capfd):
    """In one line: distributed prints exceptions of its own."""
    address, [worker] = workers
    scheduler = int(Path(f"/proc/{worker}/stat").read_text().rpartition(")")[2].split()[1])
    monkeypatch.setattr(connection, "CONNECT_TIMEOUT", 2.0)

    def kill(jobs):
        if jobs:
            os.kill(scheduler, signal.SIGKILL)

    with pytest.raises(DropspinError, match="the connection was lost; what is finished is kept, and the same command continues"):
        run_sweep(load_sweep(SPEC | {"dts": [1e-4]}), str(tmp_path / "s"), scheduler=address, on_progress=kill)
    assert capfd.readouterr().err == ""


@pytest.mark.extended
@pytest.mark.parametrize("workers", [0], indirect=True)
def test_scheduler_without_workers_is_reported(workers, tmp_path, monkeypatch):
    monkeypatch.setattr(connection, "WORKER_TIMEOUT", 0.5)
    with pytest.raises(DropspinError, match=r"no worker has connected for 0.5 s; start one with: dask worker tcp://"):
        run_sweep(load_sweep(SPEC), str(tmp_path / "out"), scheduler=workers[0])
    assert not (tmp_path / "out").exists()


def test_worker_that_may_not_start_processes_is_reported(tmp_path, monkeypatch):
    """Dask's workers are daemonic processes by default; the message names the setting."""
    work = Work.of(load_sweep(SPEC), ResourceLimits())
    monkeypatch.setattr(multiprocessing, "current_process", lambda: SimpleNamespace(daemon=True))
    with pytest.raises(DropspinError, match="set DASK_DISTRIBUTED__WORKER__DAEMON=False where workers are started"):
        running._run_on_worker(work, str(tmp_path), next(work.parts))


def test_missing_scheduler_and_missing_dask_are_reported(tmp_path, monkeypatch):
    monkeypatch.setattr(connection, "CONNECT_TIMEOUT", 0.5)
    with pytest.raises(DropspinError, match=r"--scheduler tcp://127.0.0.1:1: no scheduler answers .*; start one with: dask scheduler"):
        run_sweep(load_sweep(SPEC), str(tmp_path / "out"), scheduler="tcp://127.0.0.1:1")
    monkeypatch.setattr(connection, "find_spec", lambda name: None)
    with pytest.raises(EngineMissing, match="pip install 'distributed>="):
        run_sweep(load_sweep(SPEC), str(tmp_path / "other"), scheduler="tcp://127.0.0.1:1")


@pytest.mark.parametrize("answer", [None, b"HTTP/1.0 400 Bad Request\r\n\r\n"], ids=["silent", "HTTP"])
def test_address_at_which_something_else_listens_is_refused_in_one_line(answer, tmp_path, monkeypatch):
    monkeypatch.setattr(connection, "CONNECT_TIMEOUT", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve():
            with suppress(OSError), server.accept()[0] as client:
                client.recv(16)
                client.sendall(answer)

        if answer:
            threading.Thread(target=serve, daemon=True).start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(DropspinError) as caught:
            run_sweep(load_sweep(SPEC), str(tmp_path / "out"), scheduler=address)
    assert (
        str(caught.value)
        == f"--scheduler {address}: the program at this address does not answer as a scheduler; start one with: dask scheduler."
    )
    assert not (tmp_path / "out").exists()


def test_sweep_that_was_refused_before_its_first_job_can_be_given_again(tmp_path, monkeypatch):
    """With another spec too, and without --resume: the folder holds no row."""
    monkeypatch.setattr("dropspin.comparisons.sweeps.running.connected", lambda scheduler: nullcontext())
    refuse = mock.Mock(side_effect=DropspinError("a worker has mujoco 3.1, this machine has 4.0; install the same on both."))
    monkeypatch.setattr("dropspin.comparisons.sweeps.running._run_on_cluster", refuse)
    for spec in (SPEC, SPEC | {"dts": [8e-3]}):
        with pytest.raises(DropspinError, match="install the same on both"):
            run_sweep(load_sweep(spec), str(tmp_path / "out"), scheduler="tcp://host:8786")
    run_sweep(load_sweep(SPEC | {"engines": ["wang"]}), str(tmp_path / "out"))
    assert len(table(tmp_path / "out")) == 12
    with pytest.raises(DropspinError, match="holds 12 of 12 jobs of this sweep"):
        run_sweep(load_sweep(SPEC | {"engines": ["wang"]}), str(tmp_path / "out"))


def test_worker_with_other_versions_refuses_its_part(tmp_path):
    """Results of two versions do not go into one table."""
    work = Work.of(load_sweep(SPEC), ResourceLimits())
    other = replace(work, versions=work.versions | {"mujoco": "3.1"})
    with pytest.raises(DropspinError, match=r"a worker has mujoco \d.*, this machine has 3.1; install the same on both"):
        running._run_on_worker(other, str(tmp_path), next(other.parts))


class ProcessesHere:
    """Stands for `EngineProcesses`; engines run in this process."""

    def __init__(self, resources, start_method):
        self.closed = False

    def call(self, entry, work, *given):
        return work(entry, *given)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.closed = True


def test_engine_processes_of_another_sweep_are_closed(tmp_path, monkeypatch):
    """A worker that has served another sweep, or other resource limits, ends the engines of that one first."""
    monkeypatch.setattr(running, "_reschedule_if_closing", lambda: None)
    monkeypatch.setattr(running, "EngineProcesses", ProcessesHere)
    used = []
    for seconds in (5.0, 6.0):
        work = Work.of(load_sweep(SPEC | {"engines": ["wang"]}), ResourceLimits(processor_time=seconds))
        running._run_on_worker(work, str(tmp_path / str(seconds)), next(work.parts))
        [(owner, [processes])] = running._idle.items()
        used.append(processes)
        assert owner == (work.identity, work.resources)
    assert used[0] is not used[1]
    assert (used[0].closed, used[1].closed) == (True, False)
    running._close_idle_processes()
    assert used[1].closed
    assert not running._idle
