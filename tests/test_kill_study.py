"""Commands that are killed or interrupted at random moments: half-written output is never accepted, and resumed results are the same."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pandas as pd
import pytest
from support.cli import DROPSPIN

from dropspin.comparisons.regressions.baseline import load_baseline
from dropspin.comparisons.results.store import load_results
from dropspin.comparisons.sweeps.folder import read_sweep
from dropspin.reports.study_files import read_study
from dropspin.scenarios import DropspinError

SIGNALS = 30
"""Of each kind to each command."""
SCENE = """
duration = {duration}
[body]
shape = "sphere"
radius = 0.1
mass = 1.0
[gravity]
acceleration = [0.0, -9.81, 0.0]
"""
SPEC = """
scenes = ["one.toml"]
engines = ["wang", "mujoco"]
dts = [0.01, 0.005]
[random]
count = 130
seed = 1
"body.mass" = { from = 1.0, to = 2.0 }
"""
COMMANDS = {
    "run": ("run", "one.toml", "two.toml", "-e", "wang", "--dt", "0.01", "-o", "out", "--resume"),
    "sweep": ("sweep", "spec.toml", "-o", "out", "--resume"),
    "tradeoff": ("tradeoff", "one.toml", "-e", "wang", "--budget", "0.05", "-o", "out"),
    "limits": ("limits", "one.toml", "-e", "wang", "--axis", "duration", "--dt", "0.05", "-o", "out"),
    "accept": ("accept", "run", "--reason", "kills", "--baseline", "out/baseline.toml"),
    "report": ("report", "out", "--plots", "svg"),
}


def results_of(folder):
    results = load_results(folder)
    assert (folder / "report.html").read_text(encoding="utf-8").rstrip().endswith("</html>")
    return results.table.drop(columns="time_per_step")


def jobs_of(folder):
    return read_sweep(str(folder)).drop(columns="time_per_step").set_index("job")


def limits_of(folder):
    read_study(str(folder))
    return pd.read_json(folder / "limits.json", dtype=False)


def configurations_of(folder):
    read_study(str(folder))
    return pd.read_json(folder / "tradeoff.json", dtype=False)[["engine"]].drop_duplicates()  # all else depends on measured times


LOADERS = {
    "run": results_of,
    "sweep": jobs_of,
    "tradeoff": configurations_of,
    "limits": limits_of,
    "accept": lambda folder: load_baseline(folder / "baseline.toml").results,
    "report": results_of,
}


def start(folder, verb):
    return subprocess.Popen(
        [DROPSPIN, *COMMANDS[verb]],
        cwd=folder,
        env=os.environ | {"TMPDIR": str(folder / "tmp")},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def finish(folder, verb):
    """Run a command to its end; returns its duration [s]."""
    began, process = time.monotonic(), start(folder, verb)
    _, errors = process.communicate(timeout=300)
    assert process.returncode == 0, errors
    return time.monotonic() - began


def await_handlers(process):
    """Wait until a process handles SIGTERM, or ends; before this, Python itself is starting."""
    while process.poll() is None:
        caught = next(line for line in Path(f"/proc/{process.pid}/status").read_text().splitlines() if line.startswith("SigCgt:"))
        if int(caught.split()[1], 16) >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.01)


def members(session):
    """The processes of a session that have not ended."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if fields[3] == str(session) and fields[0] != "Z":
            found.append(stat.parent.name)
    return found


def assert_no_process(session):
    """Assert that a session has no processes; those of a killed command end at once, but not in the same instant."""
    for _ in range(400):
        if not members(session):
            return
        time.sleep(0.05)
    raise AssertionError(f"processes {members(session)} are left")


def tree(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def loaded(folder, verb):
    """The output of a command; None if it is absent or incomplete, which is refused in one line."""
    try:
        return LOADERS[verb](folder / "out")
    except DropspinError:
        return None


def assert_same(found, expected):
    rows = expected.loc[found.index] if found.index.name == "job" else expected  # an interrupted sweep has some of the jobs
    pd.testing.assert_frame_equal(found, rows, check_exact=True)


@pytest.fixture
def prepared(request, tmp_path):
    """A folder with scenes, a spec and, for commands that need one, a run."""
    (tmp_path / "tmp").mkdir()
    for number, name in enumerate(("one", "two")):
        (tmp_path / f"{name}.toml").write_text(SCENE.format(duration=0.5 + number))
    (tmp_path / "spec.toml").write_text(SPEC)
    if (verb := request.getfixturevalue("verb")) in ("accept", "report"):
        finish(tmp_path, "run")
    if verb == "accept":
        (tmp_path / "out").rename(tmp_path / "run")
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("kind", [signal.SIGKILL, signal.SIGINT], ids=["SIGKILL", "SIGINT"])
@pytest.mark.parametrize("verb", COMMANDS)
def test_output_after_signals_at_random_moments(verb, kind, prepared):
    """The moments are spread over the duration of an undisturbed command; in every third case there is no earlier output."""
    finish(prepared, verb)  # which compiles and caches what is not compiled yet
    if verb != "report":
        shutil.rmtree(prepared / "out")
    duration, expected, files = finish(prepared, verb), loaded(prepared, verb), tree(prepared)
    chance, codes, delays = random.Random(f"{verb} {kind.name}"), Counter(), []
    moments = [(number + chance.random()) / SIGNALS * duration for number in range(SIGNALS)]
    chance.shuffle(moments)
    for number, moment in enumerate(moments):
        if number % 3 == 0 and verb != "report":
            shutil.rmtree(prepared / "out", ignore_errors=True)
        process = start(prepared, verb)
        time.sleep(moment)
        if kind == signal.SIGINT:
            await_handlers(process)
        process.send_signal(kind)
        sent = time.monotonic()
        _, errors = process.communicate(timeout=120)
        delays.append(time.monotonic() - sent)
        codes[process.returncode] += 1
        assert process.returncode in ((0, 130) if kind == signal.SIGINT else (0, -kind)), errors
        assert "Traceback" not in errors
        assert_no_process(process.pid)
        found = loaded(prepared, verb)
        if found is not None:
            assert_same(found, expected)
        if kind == signal.SIGINT:  # what an interrupted run keeps for --resume is beside the folder
            assert [path for path in tree(prepared) if path not in files and not path.startswith(".out-measured")] == []
            assert found is not None or verb not in ("report", "run") or not (prepared / "out").exists()
    slowest = f"ended within {max(delays):.2f} s of the signal"
    sys.stdout.write(f"{verb}, {kind.name}: {duration:.1f} s undisturbed; exit codes {dict(codes)}; {slowest}\n")
    assert codes[130 if kind == signal.SIGINT else -kind] > SIGNALS / 3
    finish(prepared, verb)
    assert_same(loaded(prepared, verb), expected)
    assert tree(prepared) == files
