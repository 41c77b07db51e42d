"""Sweeps that are killed, interrupted, broken by an engine, or sent somewhere else: the table is the one of a sweep left in peace."""

import ctypes
import json
import random
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
from support import engines as made

from comparisons.engines.base import Diverged
from comparisons.running.processes import Closed, Failed, ResourceLimits
from comparisons.sweeps import load_sweep, read, run_sweep
from comparisons.sweeps.work import Work
from scenarios import DropspinError

DROPSPIN = Path(sys.executable).with_name("dropspin")
SPEC = {
    "scenes": ["drop-ball"],
    "engines": ["document"],
    "dts": [4e-3],
    "grid": {"floor.restitution": [0.2, 0.4, 0.6, 0.8], "start.position[1]": [0.5, 1.0]},
}


def table(where):
    return read(str(where)).drop(columns="time_per_step")


def same(one, other):
    pd.testing.assert_frame_equal(table(one), table(other), check_exact=True)


class Breaking(made.Exact):
    """Does something else with each restitution."""

    name = "breaking"

    def prepare(self, scene, dt):
        match scene.floor.restitution:
            case 0.2:
                ctypes.string_at(0)
            case 0.4:
                while True:
                    pass
            case 0.6 if scene.start.position[1] == 0.5:
                raise RuntimeError("no")
            case 0.6:
                raise Diverged("step 3")
            case 0.8 if scene.start.position[1] == 0.5:
                return made.ExactSimulation(scene, dt, made.nan_after_half_a_second)
        return super().prepare(scene, dt)


def test_an_engine_that_breaks_costs_its_own_rows(tmp_path):
    """A segmentation fault, an endless loop, an exception, NaN: each told in its row; the other rows are as ever."""
    sweep = load_sweep(SPEC)
    whole = replace(sweep, engines=(*sweep.engines, Breaking(), made.Exact()))
    run_sweep(whole, str(tmp_path / "whole"), limits=ResourceLimits(processor_time=1.0))
    found = table(tmp_path / "whole")
    bad = found[found["engine"] == "breaking"].reset_index(drop=True)
    assert list(bad["verdict"]) == ["crashed", "crashed", "timed_out", "timed_out", "crashed", "diverged", "diverged", "measured"]
    reasons = [
        "SIGSEGV",
        "SIGSEGV",
        "not done after 1 s",
        "not done after 1 s",
        "RuntimeError: no",
        "step 3",
        "not finite at t = 0.504 s",
        "",
    ]
    for said, meant in zip(bad["reason"], reasons, strict=True):
        assert meant in said
    exact = found[found["engine"] == "exact"].reset_index(drop=True)
    figures = [name for name in found.columns if found[name].dtype == float]
    pd.testing.assert_frame_equal(bad.loc[7:, figures], exact.loc[7:, figures], check_exact=True)
    run_sweep(sweep, str(tmp_path / "document"))
    document = found[found["engine"] == "document"].reset_index(drop=True)
    pd.testing.assert_frame_equal(document, table(tmp_path / "document"), check_exact=True)


class Leaking(made.Exact):
    """Keeps 50 MB of each job."""

    name = "leaking"
    kept: ClassVar = []

    def prepare(self, scene, dt):
        self.kept.append(np.ones(6_250_000))
        return super().prepare(scene, dt)


def test_a_leak_costs_no_job(tmp_path):
    """None of them breaks in a process of its own, so none is said to."""
    asked = replace(load_sweep(SPEC | {"grid": {"floor.restitution": {"from": 0.1, "to": 0.9, "count": 60}}}), engines=(Leaking(),))
    run_sweep(asked, str(tmp_path / "s"), limits=ResourceLimits(processor_time=20.0, memory=2**30))
    assert set(read(str(tmp_path / "s"))["verdict"]) == {"measured"}


def test_what_is_left_of_a_kill_is_no_obstacle(tmp_path):
    """A sweep that was killed before it could say what it is; a part that is torn says so."""
    asked, where = load_sweep(SPEC), tmp_path / "s"
    where.mkdir()
    (where / ".unfinished-123-sweep.json").touch()
    run_sweep(asked, str(where), resume=True)
    [part] = where.rglob("*.parquet")
    part.write_bytes(part.read_bytes()[:500])
    with pytest.raises(DropspinError, match="is no whole part of a sweep; delete it"):
        read(str(where))


def test_the_table_is_one_row_a_job(tmp_path):
    """In order, with what was set, and the same on any file system."""
    sweep = load_sweep(SPEC)
    run_sweep(sweep, str(tmp_path / "disk"))
    found = table(tmp_path / "disk")
    assert list(found["job"]) == list(range(8))
    np.testing.assert_array_equal(found["floor.restitution"], np.repeat([0.2, 0.4, 0.6, 0.8], 2))
    assert found["seed"].isna().all()
    assert (found["rebound"].to_numpy()[1::2] == np.sort(found["rebound"].to_numpy()[1::2])).all()
    run_sweep(sweep, "memory://sweep")
    same(tmp_path / "disk", "memory://sweep")
    fsspec.filesystem("memory").rm("/sweep", recursive=True)


def test_a_folder_is_never_two_sweeps(tmp_path):
    """Another sweep's, the same one's, somebody else's: refused in one line, and left as it was."""
    where = str(tmp_path / "out")
    run_sweep(load_sweep(SPEC), where)
    with pytest.raises(DropspinError, match="holds 8 of 8 jobs of this sweep; --resume goes on, or choose another folder"):
        run_sweep(load_sweep(SPEC), where)
    with pytest.raises(DropspinError, match="holds a sweep that was asked for differently"):
        run_sweep(load_sweep(SPEC | {"dts": [2e-3]}), where, resume=True)
    about = Path(where, "sweep.json")
    told = json.loads(about.read_text())
    told["provenance"]["versions"]["mujoco"], told["identity"] = "3.1", "another"
    about.write_text(json.dumps(told))
    with pytest.raises(DropspinError, match=r"made with mujoco 3.1, now \d.*; choose another folder"):
        run_sweep(load_sweep(SPEC), where, resume=True)
    work = Work.of(load_sweep(SPEC), ResourceLimits())
    assert replace(work, versions=work.versions | {"mujoco": "3.1"}).identity != work.identity
    about.write_text("{}")
    with pytest.raises(DropspinError, match=r"its sweep.json is none of a sweep's"):
        run_sweep(load_sweep(SPEC), where, resume=True)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "precious").write_text("x")
    with pytest.raises(DropspinError, match="holds something that is no sweep"):
        run_sweep(load_sweep(SPEC), str(tmp_path / "mine"))
    for place in (tmp_path / "mine" / "precious", tmp_path / "mine" / "precious" / "x"):
        with pytest.raises(DropspinError, match="is a file, or in one; choose a folder with -o"):
            run_sweep(load_sweep(SPEC), str(place))
    with pytest.raises(DropspinError, match="Protocol not known: planet"):
        run_sweep(load_sweep(SPEC), "planet://x")
    with pytest.raises(DropspinError, match="no sweep is there"):
        read(str(tmp_path / "absent"))
    assert (tmp_path / "mine" / "precious").read_text() == "x"


def test_what_is_there_is_not_run_again(tmp_path):
    """A part that is lost is run again, the others stay as they are; what a killed write left goes."""
    spec = SPEC | {"scenes": ["bounce-95"], "engines": ["mujoco"]}
    run_sweep(load_sweep(spec), str(tmp_path / "whole"))
    run_sweep(load_sweep(spec), str(tmp_path / "out"))
    parts = sorted((tmp_path / "out").rglob("*.parquet"))
    assert len(parts) > 1
    parts[0].rename(parts[0].with_name(f".unfinished-1-{parts[0].name}"))
    stamps = [part.stat().st_mtime_ns for part in parts[1:]]
    told = []
    run_sweep(load_sweep(spec), str(tmp_path / "out"), resume=True, told=told.append)
    assert [part.stat().st_mtime_ns for part in parts[1:]] == stamps
    assert sorted((tmp_path / "out").rglob("*.parquet")) == parts
    assert told[0] == 8 - told[-1]
    assert sum(told) == 8
    same(tmp_path / "out", tmp_path / "whole")


def test_an_engine_that_ends_with_its_sweep_has_not_failed():
    """A job whose process is gone because all is being stopped has no row; it is run when the sweep goes on."""
    over = []

    class Ending:
        def call(self, *given):
            over.append(True)
            raise Failed("crashed", "its process was ended by SIGKILL")

    def go_on():
        if len(over) == 2:  # the second time it is alone
            raise Closed

    work = Work.of(load_sweep(SPEC | {"grid": {}}), ResourceLimits())
    with pytest.raises(Closed):
        work.table(next(work.parts), Ending(), go_on)


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
    """Run a sweep, kill it at random moments of its way, and let it go on each time; returns how often it was killed."""
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
    """Processes that bear the folder in their command line: a sweep and what it has forked."""
    return [path for path in Path("/proc").glob("[0-9]*/cmdline") if str(folder).encode() in path.read_bytes()]


def test_a_sweep_that_is_killed_goes_on(tmp_path):
    """SIGKILL at three random moments, resumed each time: the table of one never killed, bit for bit, and no process left behind."""
    spec = write_spec(tmp_path, 60, "drop-ball", ["document", "mujoco"])
    subprocess.run([DROPSPIN, "sweep", spec, "-o", tmp_path / "whole"], check=True, capture_output=True)
    assert killed_and_resumed(spec, tmp_path / "killed", kills=3, seed=1) == 3
    same(tmp_path / "killed", tmp_path / "whole")
    assert len(table(tmp_path / "whole")) == 240
    assert not list((tmp_path / "killed").rglob(".unfinished*"))
    assert processes_of(tmp_path / "killed") == []


@pytest.mark.slow
def test_two_thousand_jobs_killed_twenty_times(tmp_path):
    """Three engines, 2,004 jobs, SIGKILL at twenty random moments: the same table."""
    spec = write_spec(tmp_path, 334, "drop-box-tumble", ["document", "mujoco", "pybullet"])
    subprocess.run([DROPSPIN, "sweep", spec, "-o", tmp_path / "whole"], check=True, capture_output=True)
    assert killed_and_resumed(spec, tmp_path / "killed", kills=20, seed=2) == 20
    same(tmp_path / "killed", tmp_path / "whole")
    assert len(table(tmp_path / "whole")) == 2004
    assert processes_of(tmp_path / "killed") == []
