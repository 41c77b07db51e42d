"""`dropspin sweep` as its users meet it: in a process of its own."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from comparisons.sweeps import read

DROPSPIN = Path(sys.executable).with_name("dropspin")
SPEC = """
scenes  = ["drop-ball"]
engines = ["document", "mujoco"]
dts     = [0.004]

[grid]
floor.restitution = { from = 0.0, to = 1.0, count = 5 }
"start.position[1]" = [0.5, 1.0]
"""
LONG = """
scenes  = ["bounce-95"]
engines = ["mujoco"]
dts     = [0.002]

[random]
count = 24
seed = 1
floor.restitution = { from = 0.0, to = 1.0 }
"""


def dropspin(*arguments, cwd):
    return subprocess.run([DROPSPIN, *arguments], cwd=cwd, capture_output=True, text=True, timeout=300, check=False)


def test_a_sweep(tmp_path):
    """The table, progress on the standard error, the same numbers as JSON, and nothing run twice."""
    (tmp_path / "spec.toml").write_text(SPEC)
    done = dropspin("sweep", "spec.toml", "-o", "out/mine", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "20 of 20 jobs" in done.stderr
    assert "a second" in done.stderr
    assert "10 measured" in done.stdout
    assert "Written: out/mine, 20 jobs" in done.stdout
    again = dropspin("sweep", "spec.toml", "-o", "out/mine", cwd=tmp_path)
    assert again.returncode == 2
    assert again.stderr == "dropspin: out/mine: holds 20 of 20 jobs of this sweep; --resume goes on, or choose another folder with -o.\n"
    resumed = dropspin("sweep", "spec.toml", "-o", "out/mine", "--resume", "--json", cwd=tmp_path)
    rows = json.loads(resumed.stdout)
    assert [(row["engine"], row["jobs"], row["verdicts"]) for row in rows] == [
        (name, 10, {"measured": 10}) for name in ("document", "mujoco")
    ]
    found = read(str(tmp_path / "out/mine"))
    worst = found[found["engine"] == "mujoco"]["penetration"].max()
    assert rows[1]["worst_penetration"] == worst
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "spec.toml"]


@pytest.mark.parametrize(
    ("arguments", "text", "code", "message"),
    [
        (["absent.toml"], SPEC, 2, "absent.toml: No such file or directory"),
        (["spec.toml"], "scenes = [", 2, "spec.toml: not TOML"),
        (["spec.toml"], SPEC.replace("drop-ball", "drop-bal"), 2, "Did you mean 'drop-ball'"),
        (["spec.toml"], SPEC.replace("floor.rest", "floor.flor_rest"), 2, "spec.toml: grid: floor.flor_restitution"),
        (["spec.toml"], SPEC.replace("to = 1.0", "to = 2.0"), 2, "got 2.0; must be less than or equal to 1"),
        (["spec.toml", "-o", "precious"], SPEC, 2, "precious: is a file, or in one"),
        (["spec.toml", "-o", "s9://bucket"], SPEC, 2, "-o s9://bucket: Protocol not known"),
        (["spec.toml", "--scheduler", "nowhere"], SPEC, 2, "--scheduler nowhere: is no address"),
        (["spec.toml", "--time-limit", "0"], SPEC, 2, "0.0 is not in the range"),
        (["spec.toml"], SPEC.replace('"mujoco"', '"my_module:Mine"'), 3, "needs the module no_such_engine"),
    ],
)
def test_what_cannot_be_swept(arguments, text, code, message, tmp_path):
    """One line, an exit code, nothing written."""
    (tmp_path / "precious").write_text("x")
    (tmp_path / "spec.toml").write_text(text)
    (tmp_path / "my_module.py").write_text("import no_such_engine")
    done = dropspin("sweep", *arguments, cwd=tmp_path)
    assert done.returncode == code
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert {path.name for path in tmp_path.iterdir()} - {"__pycache__"} == {"my_module.py", "precious", "spec.toml"}


def test_an_engine_of_ones_own_that_breaks(tmp_path):
    """A module beside the spec; exit code 3, and the tally says how its jobs ended."""
    (tmp_path / "my_module.py").write_text(
        "import comparisons\nclass Mine(comparisons.Engine):\n name='mine'\n def prepare(self, s, dt): 1 / 0"
    )
    (tmp_path / "spec.toml").write_text(SPEC.replace('"mujoco"', '"my_module:Mine"'))
    done = dropspin("sweep", "spec.toml", "--json", cwd=tmp_path)
    assert done.returncode == 3, done.stderr
    assert json.loads(done.stdout)[1]["verdicts"] == {"crashed": 10}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The table of the long sweep, left in peace."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "spec.toml").write_text(LONG)
    assert dropspin("sweep", "spec.toml", "-o", "whole", cwd=folder).returncode == 0
    return read(str(folder / "whole")).drop(columns="time_per_step")


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_sweep_goes_on(how, whole, tmp_path):
    """Exit code 130 at once, what is written is whole and counted, no process is left; and the table is as if nothing had happened."""
    (tmp_path / "spec.toml").write_text(LONG)
    process = subprocess.Popen(
        [DROPSPIN, "sweep", "spec.toml", "-o", "part"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    while "a second" not in process.stderr.readline():
        pass
    process.send_signal(how)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in errors
    kept = len(read(str(tmp_path / "part")))
    assert f"dropspin: interrupted; {kept} of 24 jobs are kept, --resume goes on." in errors
    assert 0 < kept < 24
    assert not [name for name in os.listdir("/proc") if name.isdigit() and parent_of(name) == str(process.pid)]
    assert dropspin("sweep", "spec.toml", "-o", "part", "--resume", cwd=tmp_path).returncode == 0
    pd.testing.assert_frame_equal(read(str(tmp_path / "part")).drop(columns="time_per_step"), whole, check_exact=True)


def parent_of(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1]
    except OSError:
        return ""


def test_an_interrupt_that_is_swallowed_still_stops_the_sweep(tmp_path, monkeypatch):
    from click.testing import CliRunner

    from reports.commands import main as cli

    (tmp_path / "spec.toml").write_text(SPEC)
    monkeypatch.setattr("reports.commands.interrupts._interrupts", [signal.SIGINT])
    done = CliRunner().invoke(cli.dropspin, ["sweep", str(tmp_path / "spec.toml"), "-o", str(tmp_path / "out")])
    assert done.exit_code != 0
    assert not (tmp_path / "out").exists()
