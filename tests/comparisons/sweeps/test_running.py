"""Sweeps that are killed, resumed, or broken by an engine: the table is that of an undisturbed sweep."""

import ctypes
import json
import random
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import fsspec
import numpy as np
import pandas as pd
import pytest
from support import engines as test_engines

from dropspin.comparisons.engines.base import Diverged, EngineBroken
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.comparisons.running.processes import Closed
from dropspin.comparisons.sweeps import parts
from dropspin.comparisons.sweeps.folder import read_sweep
from dropspin.comparisons.sweeps.parts import Work
from dropspin.comparisons.sweeps.running import run_sweep
from dropspin.comparisons.sweeps.spec import load_sweep
from dropspin.scenarios import DropspinError

DROPSPIN = Path(sys.executable).with_name("dropspin")
SPEC = {
    "scenes": ["drop-ball"],
    "engines": ["wang"],
    "dts": [4e-3],
    "grid": {"floor.restitution": [0.2, 0.4, 0.6, 0.8], "start.position[1]": [0.5, 1.0]},
}


def table(where):
    return read_sweep(str(where)).drop(columns="time_per_step")


def assert_same(one, other):
    pd.testing.assert_frame_equal(table(one), table(other), check_exact=True)


@pytest.mark.parametrize("spec", [SPEC, "sweep.toml", None])
def test_spec_that_is_not_loaded_is_refused_with_the_remedy(spec, tmp_path):
    with pytest.raises(DropspinError, match=r"sweep: got .*; give the result of dropspin.load_sweep"):
        run_sweep(spec, str(tmp_path / "out"))


class Breaking(test_engines.Exact):
    """Fails in another way at each restitution."""

    name = "breaking"

    def prepare(self, scene, dt):
        match scene.floor.restitution:
            case 0.2:
                ctypes.string_at(0)
            case 0.4 if scene.start.position[1] == 0.5:
                while True:
                    pass
            case 0.6 if scene.start.position[1] == 0.5:
                raise RuntimeError("no")
            case 0.6:
                raise Diverged("step 3")
            case 0.8 if scene.start.position[1] == 0.5:
                return test_engines.ExactSimulation(scene, dt, test_engines.nan_after_half_a_second)
        return super().prepare(scene, dt)


@pytest.mark.extended
@pytest.mark.usefixtures("engine_processes")
def test_engine_that_breaks_costs_its_own_rows(tmp_path):
    """A segmentation fault, an endless loop, an exception, NaN: each is reported in its row; the other rows do not change."""
    sweep = load_sweep(SPEC)
    whole = replace(sweep, engines=(*sweep.engines, Breaking(), test_engines.Exact()))
    run_sweep(whole, str(tmp_path / "whole"), resources=ResourceLimits(processor_time=1.0))
    found = table(tmp_path / "whole")
    bad = found[found["engine"] == "breaking"].reset_index(drop=True)
    assert list(bad["verdict"]) == ["crashed", "crashed", "timed_out", "measured", "crashed", "diverged", "diverged", "measured"]
    reasons = [
        "SIGSEGV",
        "SIGSEGV",
        "not done after",  # of processor time, or of wall time on a machine that is busy
        "",
        "RuntimeError: no",
        "step 3",
        "not finite at t = 0.504 s",
        "",
    ]
    for reason, expected in zip(bad["reason"], reasons, strict=True):
        assert expected in reason
    exact = found[found["engine"] == "exact"].reset_index(drop=True)
    numbers = [name for name in found.columns if found[name].dtype == float]
    pd.testing.assert_frame_equal(bad.loc[[3, 7], numbers], exact.loc[[3, 7], numbers], check_exact=True)
    run_sweep(sweep, str(tmp_path / "wang"))
    document = found[found["engine"] == "wang"].reset_index(drop=True)
    pd.testing.assert_frame_equal(document, table(tmp_path / "wang"), check_exact=True)


@pytest.mark.extended
@pytest.mark.usefixtures("engine_processes")
@pytest.mark.parametrize(("text", "reason"), [("changed = True", "is not that with which"), ("1 / 0", "cannot be imported: ZeroDivision")])
def test_adapter_that_changes_ends_the_sweep_and_what_is_written_is_kept(text, reason, tmp_path, monkeypatch):
    """Its jobs would be kept as crashed, for good: on a cluster too, where a worker may have another copy."""
    monkeypatch.setattr(parts, "LARGEST_PART", 1)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    crash = f"lambda self, *given: (open('mine.py', 'a').write('\\n{text}'), os._exit(1))"
    head = "import os\nfrom dropspin.comparisons.engines.wang import Wang\nclass Mine(Wang):\n"
    (tmp_path / "mine.py").write_text(f"{head}    name = 'mine'\n    prepare = prepare_batch = {crash}\n")
    with pytest.raises(EngineBroken, match=rf"mine cannot be used any more: .*{reason}"):
        run_sweep(load_sweep(SPEC | {"engines": ["wang", "mine:Mine"]}), str(tmp_path / "out"))
    assert set(read_sweep(str(tmp_path / "out"))["engine"]) == {"wang"}


class Leaking(test_engines.Exact):
    """Keeps 100 MB of address space of each job."""

    name = "leaking"
    kept: ClassVar = []

    def prepare(self, scene, dt):
        self.kept.append(np.empty(12_500_000))
        return super().prepare(scene, dt)


@pytest.mark.extended
@pytest.mark.usefixtures("engine_processes")
def test_leak_is_not_attributed_to_a_job(tmp_path):
    """Sixteen jobs exceed a limit of 1 GB together; none of them does in a process of its own."""
    sweep = replace(load_sweep(SPEC | {"grid": {"floor.restitution": {"from": 0.1, "to": 0.9, "count": 16}}}), engines=(Leaking(),))
    run_sweep(sweep, str(tmp_path / "s"), resources=ResourceLimits(processor_time=20.0, memory=2**30))
    assert set(read_sweep(str(tmp_path / "s"))["verdict"]) == {"measured"}


def test_unfinished_files_are_ignored_and_damaged_parts_reported(tmp_path):
    """The files of a sweep that was killed at its beginning; a part of which only the first bytes are there."""
    asked, where = load_sweep(SPEC), tmp_path / "s"
    where.mkdir()
    (where / ".unfinished-123-sweep.json").touch()
    run_sweep(asked, str(where), resume=True)
    [part] = where.rglob("*.parquet")
    part.write_bytes(part.read_bytes()[:500])
    with pytest.raises(DropspinError, match="is damaged; delete it, and run its jobs again with --resume"):
        read_sweep(str(where))


def test_table_has_one_row_for_each_job_on_any_file_system(tmp_path):
    """In the order of the jobs, with the values that were set."""
    sweep = load_sweep(SPEC)
    run_sweep(sweep, str(tmp_path / "disk"))
    found = table(tmp_path / "disk")
    assert list(found["job"]) == list(range(8))
    np.testing.assert_array_equal(found["floor.restitution"], np.repeat([0.2, 0.4, 0.6, 0.8], 2))
    assert found["seed"].isna().all()
    assert (found["rebound"].to_numpy()[1::2] == np.sort(found["rebound"].to_numpy()[1::2])).all()
    run_sweep(sweep, "memory://sweep")
    assert_same(tmp_path / "disk", "memory://sweep")
    fsspec.filesystem("memory").rm("/sweep", recursive=True)


def test_folder_that_holds_something_else_is_refused(tmp_path):
    """The same sweep, another one, other versions, other files: refused in one line, and left unchanged."""
    where = str(tmp_path / "out")
    run_sweep(load_sweep(SPEC), where)
    with pytest.raises(DropspinError, match="holds 8 of 8 jobs of this sweep; resume it with --resume, or choose another folder with -o"):
        run_sweep(load_sweep(SPEC), where)
    for spec, seconds in ((SPEC | {"dts": [2e-3]}, 60.0), (SPEC, 30.0)):
        with pytest.raises(DropspinError, match="holds another sweep: the specs or the time limits differ; choose another folder with -o"):
            run_sweep(load_sweep(spec), where, resume=True, resources=ResourceLimits(processor_time=seconds))
    about = Path(where, "sweep.json")
    content = json.loads(about.read_text())
    content["provenance"]["versions"]["mujoco"], content["identity"] = "3.1", "0123456789ab"
    about.write_text(json.dumps(content))
    with pytest.raises(DropspinError, match=r"holds a sweep that was run with mujoco 3.1, now \d.*; choose another folder"):
        run_sweep(load_sweep(SPEC), where, resume=True)
    work = Work.of(load_sweep(SPEC), ResourceLimits())
    assert replace(work, versions=work.versions | {"mujoco": "3.1"}).identity != work.identity
    about.write_text("{}")
    with pytest.raises(DropspinError, match=r"its sweep.json is not a valid description of a sweep"):
        run_sweep(load_sweep(SPEC), where, resume=True)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "precious").write_text("x")
    with pytest.raises(DropspinError, match="holds files that do not belong to a sweep"):
        run_sweep(load_sweep(SPEC), str(tmp_path / "mine"))
    for place in (tmp_path / "mine" / "precious", tmp_path / "mine" / "precious" / "x"):
        with pytest.raises(DropspinError, match="is a file, or inside one; choose a folder with -o"):
            run_sweep(load_sweep(SPEC), str(place))
    with pytest.raises(DropspinError, match="Protocol not known: planet"):
        run_sweep(load_sweep(SPEC), "planet://x")
    with pytest.raises(DropspinError, match="does not hold a sweep"):
        read_sweep(str(tmp_path / "absent"))
    assert (tmp_path / "mine" / "precious").read_text() == "x"


@pytest.mark.extended
def test_resuming_runs_only_the_missing_parts(tmp_path):
    """A missing part is run again, the others keep their files; an unfinished file is removed."""
    spec = SPEC | {"scenes": ["bounce-95"], "engines": ["mujoco"]}
    run_sweep(load_sweep(spec), str(tmp_path / "whole"))
    shutil.copytree(tmp_path / "whole", tmp_path / "out")
    parts = sorted((tmp_path / "out").rglob("*.parquet"))
    assert len(parts) > 1
    left = tmp_path / "out" / ".unfinished-killed00"
    left.mkdir()
    parts[0].rename(left / "new")
    stamps = [part.stat().st_mtime_ns for part in parts[1:]]
    completed = []
    run_sweep(load_sweep(spec), str(tmp_path / "out"), resume=True, on_progress=completed.append)
    assert [part.stat().st_mtime_ns for part in parts[1:]] == stamps
    assert sorted((tmp_path / "out").rglob("*.parquet")) == parts
    assert not left.exists()
    assert completed[0] == 8 - completed[-1]
    assert sum(completed) == 8
    assert_same(tmp_path / "out", tmp_path / "whole")


def test_process_that_ends_with_the_worker_of_a_cluster_is_not_a_failure():
    """A job whose process ended because the worker closes has no row; another worker runs it."""
    calls = []

    class Ending:
        def call(self, *given):
            calls.append(True)
            return Breakdown("crashed", "its process was ended by SIGKILL")

    def verify_running():
        if len(calls) == 2:  # the second time the job is by itself
            raise Closed

    work = Work.of(load_sweep(SPEC | {"grid": {}}), ResourceLimits())
    with pytest.raises(Closed):
        work.table(next(work.parts), Ending(), verify_running)


def write_spec(folder, count, scene, engines):
    (folder / "spec.toml").write_text(f"""
scenes = ["{scene}"]
engines = {json.dumps(engines)}
dts = [0.004, 0.002]
[random]
count = {count}
seed = 1
"floor.restitution" = {{ from = 0.0, to = 1.0 }}
"start.position[1]" = {{ from = 0.7, to = 2.0 }}
""")
    return folder / "spec.toml"


def parts_in(folder):
    return len(list(folder.glob("parts/*/[0-9]*.parquet")))


def killed_and_resumed(spec, folder, kills, seed):
    """Run a sweep, kill it at random moments, and resume it each time; returns how often it was killed."""
    chance, killed = random.Random(seed), 0
    while True:
        process = subprocess.Popen(
            [DROPSPIN, "sweep", spec, "-o", folder, "--resume"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True
        )
        if killed == kills:
            _, errors = process.communicate(timeout=600)
            assert process.returncode == 0, errors
            return killed
        enough = parts_in(folder) + chance.choice([0, 1, 1])
        while process.poll() is None and parts_in(folder) < enough:
            time.sleep(0.002)
        time.sleep(chance.uniform(0.0, 0.2))
        if process.poll() is not None:
            process.communicate()
            return killed
        process.send_signal(signal.SIGKILL)
        process.communicate()
        killed += 1


def processes_of(folder):
    """Processes with the folder in their command line: a sweep and its engine processes."""
    return [path for path in Path("/proc").glob("[0-9]*/cmdline") if str(folder).encode() in path.read_bytes()]


@pytest.mark.extended
def test_killed_sweep_is_resumed_to_the_same_table(tmp_path):
    """SIGKILL at three random moments, resumed each time: the table of one never killed, bit for bit, and no process left behind."""
    spec = write_spec(tmp_path, 60, "drop-ball", ["wang", "mujoco"])
    run_sweep(load_sweep(spec), str(tmp_path / "whole"))
    assert killed_and_resumed(spec, tmp_path / "killed", kills=3, seed=1) == 3
    assert_same(tmp_path / "killed", tmp_path / "whole")
    assert len(table(tmp_path / "whole")) == 240
    assert not list((tmp_path / "killed").rglob(".*"))
    assert processes_of(tmp_path / "killed") == []


@pytest.mark.slow
def test_two_thousand_jobs_killed_twenty_times(tmp_path):
    """Three engines, 2,004 jobs, SIGKILL at twenty random moments: the same table."""
    spec = write_spec(tmp_path, 334, "drop-box-tumble", ["wang", "mujoco", "pybullet"])
    subprocess.run([DROPSPIN, "sweep", spec, "-o", tmp_path / "whole"], check=True, capture_output=True)
    assert killed_and_resumed(spec, tmp_path / "killed", kills=20, seed=2) == 20
    assert_same(tmp_path / "killed", tmp_path / "whole")
    assert len(table(tmp_path / "whole")) == 2004
    assert processes_of(tmp_path / "killed") == []
