"""Output that nobody reads, or that cannot be written: no result is lost, and the exit code is that of the result."""

import json
import os
import subprocess
from pathlib import Path

import pytest
from support.cli import DROPSPIN, dropspin

from dropspin.comparisons.running.progress import Progress
from dropspin.reports.terminal.progress import progress_bar

SCENE = """
duration = 0.5
[body]
shape = "box"
half_extents = [0.1, 0.2, 0.3]
mass = 2.0
[start]
angular_velocity = [1.0, 5.0, 0.5]
"""
FAILING = '[[expect]]\nmetric = "orientation_error"\nbelow = 1e-15\nreason = "no method of a finite order is that accurate"\n'
MEASURING = {
    "run": (["run", "box.toml", "-e", "wang", "--dt", "0.01", "--quick"], "report.html"),
    "run -v": (["run", "box.toml", "-e", "wang", "--dt", "0.01", "--quick", "-v"], "report.html"),
    "tradeoff": (["tradeoff", "box.toml", "-e", "wang[rotation=rk4]", "--budget", "1e-9"], "tradeoff.md"),
    "limits": (["limits", "box.toml", "-e", "wang", "--axis", "mass", "--dt", "0.05"], "limits.md"),
    "symmetries": (["symmetries", "box.toml", "-e", "wang", "--dt", "0.05"], "symmetries.md"),
    "sweep": (["sweep", "spec.toml"], "parts"),
}


@pytest.fixture
def scenes(tmp_path):
    (tmp_path / "box.toml").write_text(SCENE)
    (tmp_path / "failing.toml").write_text(SCENE + FAILING)
    (tmp_path / "spec.toml").write_text('scenes = ["box.toml"]\nengines = ["wang"]\ndts = [0.01]\n')
    return tmp_path


@pytest.fixture
def closed_pipe():
    reader, writer = os.pipe()
    os.close(reader)
    with open(writer, "w", encoding="utf-8", closefd=False) as stream:
        yield stream
    os.close(writer)


@pytest.fixture
def full_device():
    with open("/dev/full", "w", encoding="utf-8") as stream:
        yield stream


@pytest.mark.extended
@pytest.mark.parametrize("name", MEASURING)
def test_closed_pipe_loses_no_file_and_keeps_the_exit_code(name, scenes, closed_pipe):
    """As in `dropspin run | head -1`."""
    arguments, file = MEASURING[name]
    done = dropspin(*arguments, "-o", "out", cwd=scenes, stdout=closed_pipe)
    assert done.returncode == 0, done.stderr
    assert (scenes / "out" / file).exists()
    assert "Traceback" not in done.stderr


@pytest.mark.extended
def test_exit_code_of_a_failed_check_is_that_with_a_closed_pipe_and_on_a_full_device(scenes, closed_pipe, full_device):
    for stream in (closed_pipe, full_device):
        run = ("run", "failing.toml", "-e", "wang", "--dt", "0.01", "-o", "out")
        assert dropspin(*run, cwd=scenes, stdout=stream).returncode == 1
        assert dropspin("check", "out", cwd=scenes, stdout=stream).returncode == 1


@pytest.mark.sample(1)
@pytest.mark.parametrize("arguments", [["list"], ["list", "--json"], ["show", "drop-ball"], ["--help"], ["run", "--help"]], ids=" ".join)
def test_closed_pipe_is_quiet_in_a_process_of_its_own(arguments):
    process = subprocess.Popen([DROPSPIN, *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    assert process.wait(timeout=60) == 0
    assert process.stderr.read() == ""
    process.stderr.close()


@pytest.mark.extended
@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (MEASURING["run"][0], 0),
        (["run", "failing.toml", "-e", "wang", "--dt", "0.01"], 1),
        (["run", "no-such-scene"], 2),
        (["run", "--no-such-option"], 2),
        (["show", "drop-ball", "-e", "my_engine:Mine"], 3),
    ],
    ids=lambda given: " ".join(given) if isinstance(given, list) else None,
)
def test_full_device_for_errors_changes_no_exit_code(arguments, code, scenes, full_device):
    """A line of progress, or of an error, that cannot be written is no failed check."""
    (scenes / "my_engine.py").write_text("import no_such_engine")
    assert dropspin(*arguments, cwd=scenes, stderr=full_device).returncode == code


@pytest.mark.extended
def test_full_device_for_the_output_is_said_and_loses_no_file(scenes):
    """In a process of its own, because Python writes what is left once more when it ends."""
    command = [DROPSPIN, *MEASURING["run"][0], "-o", "out", "--json"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, cwd=scenes, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert done.stderr.splitlines()[-1] == "dropspin: standard output cannot be written: No space left on device; what was printed is lost."
    assert json.loads((scenes / "out" / "run.json").read_text())["scenes"].keys() == {"box"}


def test_progress_says_which_scenes_are_finished(capsys):
    """Scenes run in parallel."""
    with progress_bar(3, 2) as shown:
        for scene in ("long", "short"):
            shown.on_progress(Progress(scene, "wang", 0.01))
        shown.on_finished("short", 2)
        shown.on_finished("long", 3)
    lines = capsys.readouterr().err.splitlines()
    assert [line.partition(", 0 s elapsed")[0] for line in lines] == ["finished short (2 of 3 scenes", "finished long (3 of 3 scenes"]
