"""Outputs of commands that are interrupted, or whose disk is full: the old output stays, and nothing else is left."""

import os
import resource
import signal
import subprocess
import time
from contextlib import contextmanager

import pytest
from support.cli import DROPSPIN, Started, dropspin

BALL = 'duration = 0.2\n[body]\nshape = "sphere"\nradius = 0.1\nmass = 1.0\n'
LONG = [
    (("report", "run", "--plots", "svg", "--plots", "png"), signal.SIGTERM),
    (("replay", "run", "few", "--gif", "old.gif", "--speed", "0.001"), signal.SIGINT),
    (("limits", "drop-ball", "-e", "wang", "-e", "mujoco", "-o", "study"), signal.SIGTERM),
    (("tradeoff", "drop-ball", "-o", "study"), signal.SIGINT),
]
"""Commands that take many seconds."""
FULL = [
    (("run", "ball.toml", "-e", "wang", "--dt", "0.01", "-o", "run"), 20_000, "run: cannot be written: File too large; the folder is "),
    (("report", "run", "--plots", "svg"), 20_000, "run: cannot be written: File too large; the folder is unchanged."),
    (("replay", "run", "--no-open"), 20_000, "run/replay.html: cannot be written: File too large; choose another file."),
    (("replay", "run", "few", "--gif", "old.gif"), 5_000, "old.gif: cannot be written: File too large; choose another file."),
    (("accept", "run", "--reason", "x", "--baseline", "old.toml"), 200, "old.toml: cannot be written: File too large"),
    (("tradeoff", "ball.toml", "-e", "wang", "--budget", "0.01", "-o", "study"), 500, "study: cannot be written: File too large"),
    (("limits", "ball.toml", "-e", "wang", "--axis", "mass", "--dt", "0.01", "-o", "study"), 500, "study: cannot be written: File"),
    (("check", "run", "--junit", "old.xml"), 1_000, "old.xml: cannot be written: File too large; choose another file."),
]
"""Commands, a size of files [bytes] that is less than that of one of their outputs, and what they say."""


@pytest.fixture
def outputs(copied):
    """A folder with a run, a scene and old outputs."""
    folder = copied.parent
    (folder / "ball.toml").write_text(BALL)
    (folder / "study").mkdir()
    for name in ("old.gif", "old.xml", "run/replay.html", "study/tradeoff.md", "study/limits.md", "study/section.json", "study/own.txt"):
        (folder / name).write_text("old")
    assert dropspin("accept", "run", "--reason", "first", "--baseline", "old.toml", cwd=folder).returncode == 0
    return folder


def contents(folder):
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.extended
@pytest.mark.parametrize(
    ("option", "message"),
    [
        (("check", "run", "--junit", "pipe"), "pipe: cannot be written: No such device or address"),
        (("check", "run", "--summary", "pipe"), "pipe: cannot be written: No such device or address"),
        (("accept", "run", "--reason", "x", "--baseline", "pipe"), "pipe: is a pipe or a device"),
        (("replay", "run", "--no-open", "-o", "pipe"), "pipe: is not a regular file; choose another file."),
        (("replay", "run", "few", "--gif", "pipe.gif"), "pipe.gif: is not a regular file; choose another file."),
        (("report", "pipe"), "pipe"),
        (("run", "ball.toml", "-e", "wang", "--dt", "0.01", "-o", "pipe"), "pipe: this is a file; choose a folder."),
        (("limits", "ball.toml", "-e", "wang", "-o", "pipe"), "pipe: cannot be written: File exists"),
    ],
    ids=lambda given: " ".join(given[:3]) if isinstance(given, tuple) else "",
)
def test_pipes_are_neither_replaced_nor_waited_for(option, message, outputs):
    """A pipe stands for a device such as /dev/null, which root could replace by a file."""
    for name in ("pipe", "pipe.gif"):
        os.mkfifo(outputs / name)
    before = contents(outputs)
    done = dropspin(*option, cwd=outputs)
    assert (done.returncode, message in done.stderr) == (2, True), done.stderr
    assert contents(outputs) == before
    assert (outputs / "pipe").is_fifo()
    assert (outputs / "pipe.gif").is_fifo()


@pytest.mark.extended
def test_a_pipe_that_is_read_takes_a_summary(outputs):
    done = subprocess.run(
        [DROPSPIN, "check", "run", "--summary", "/dev/stdout"], cwd=outputs, capture_output=True, text=True, check=False, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert "|" in done.stdout


@contextmanager
def full_disk(size):
    """A limit of the size of files [bytes] stands for a full disk."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


@pytest.mark.extended
def test_full_disk_says_that_what_was_measured_is_kept(outputs):
    command = ("run", "ball.toml", "-e", "wang", "--dt", "0.01", "-o", "new")
    with full_disk(20_000):
        done = dropspin(*command, cwd=outputs)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].endswith("choose another folder. 1 of 1 scene is kept; --resume continues the run.")
    resumed = dropspin(*command, "--resume", cwd=outputs)
    assert resumed.returncode == 0
    assert "running" not in resumed.stderr


def test_full_disk_says_that_a_sweep_can_be_resumed(outputs):
    (outputs / "spec.toml").write_text('scenes = ["ball.toml"]\nengines = ["wang"]\ndts = [0.01]\n')
    with full_disk(5_000):
        done = dropspin("sweep", "spec.toml", "-o", "new", cwd=outputs)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1].endswith("the parts written so far are complete: --resume continues the sweep.")
    assert dropspin("sweep", "spec.toml", "-o", "new", "--resume", cwd=outputs).returncode == 0


@pytest.mark.sample(2)
@pytest.mark.usefixtures("engine_processes", "all_start_phases")
@pytest.mark.parametrize(("command", "kind"), LONG, ids=[command[0] for command, _ in LONG])
def test_interrupted_commands_leave_the_old_output(command, kind, outputs):
    before = contents(outputs)
    process = Started(*command, cwd=outputs)
    while process.is_alive() and not any(outputs.rglob(".*unfinished-*")):
        time.sleep(0.01)
    code, errors = process.end(kind)
    assert code == 130, errors
    assert errors.splitlines()[-1] == "dropspin: interrupted; nothing was written."
    assert "Traceback" not in errors
    assert contents(outputs) == before


@pytest.mark.sample(1)
@pytest.mark.parametrize(("command", "size", "message"), FULL, ids=[" ".join(command[:4]) for command, _, _ in FULL])
def test_full_disks_leave_the_old_output(command, size, message, outputs):
    """What a run has measured may stay for --resume."""
    before = contents(outputs)
    with full_disk(size):
        done = dropspin(*command, cwd=outputs)
    assert done.returncode == 2, done.stderr
    assert done.stderr.splitlines()[-1].startswith(f"dropspin: {message}")
    assert "Traceback" not in done.stderr
    assert {name: content for name, content in contents(outputs).items() if not name.startswith(".run-measured/")} == before
