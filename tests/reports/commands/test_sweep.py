"""`dropspin sweep`."""

import json
import os
import signal
from pathlib import Path

import pandas as pd
import pytest
from support.cli import Started, dropspin

from dropspin.comparisons.sweeps.folder import read_sweep

SPEC = """
scenes  = ["drop-ball"]
engines = ["mujoco", "pybullet"]
dts     = [0.004]

[grid]
floor.restitution = { from = 0.0, to = 1.0, count = 5 }
"start.position[1]" = [0.5, 1.0]
"""
LONG = """
scenes  = ["bounce-95"]
engines = ["mujoco"]
dts     = [0.004]

[random]
count = 16
seed = 1
floor.restitution = { from = 0.0, to = 1.0 }
"""


def test_a_sweep_prints_the_worst_values_and_runs_nothing_twice(tmp_path):
    """The table, progress on the standard error, the same numbers as JSON."""
    (tmp_path / "spec.toml").write_text(SPEC)
    done = dropspin("sweep", "spec.toml", "-o", "out/mine", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "20 of 20 jobs" in done.stderr
    assert "per second" in done.stderr
    assert "10 measured" in done.stdout
    assert "Written: out/mine, 20 jobs; from Python: dropspin.read_sweep('out/mine')\n" in done.stdout
    again = dropspin("sweep", "spec.toml", "-o", "out/mine", cwd=tmp_path)
    assert again.returncode == 2
    assert again.stderr.startswith("dropspin: out/mine: holds 20 of 20 jobs of this sweep; resume it with --resume, ")
    assert again.stderr.count("\n") == 1
    resumed = dropspin("sweep", "spec.toml", "-o", "out/mine", "--resume", "--json", cwd=tmp_path)
    rows = json.loads(resumed.stdout)
    assert [(row["engine"], row["jobs"], row["verdicts"]) for row in rows] == [
        (name, 10, {"measured": 10}) for name in ("mujoco", "pybullet")
    ]
    found = read_sweep(str(tmp_path / "out/mine"))
    for row in rows:
        assert row["worst_penetration"] == found[found["engine"] == row["engine"]]["penetration"].max()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "spec.toml"]


@pytest.mark.parametrize(
    ("arguments", "text", "code", "message"),
    [
        (["absent.toml"], SPEC, 2, "absent.toml: No such file or directory"),
        (["spec.toml"], "scenes = [", 2, "spec.toml: not TOML"),
        (["spec.toml"], SPEC.replace("drop-ball", "drop-bal"), 2, "Did you mean 'drop-ball'"),
        (["spec.toml"], SPEC.replace("floor.rest", "floor.flor_rest"), 2, "spec.toml: grid: floor.flor_restitution"),
        (["spec.toml"], SPEC.replace("to = 1.0", "to = 2.0"), 2, "got 2.0; must be less than or equal to 1"),
        (["spec.toml", "-o", "precious"], SPEC, 2, "precious: is a file, or inside one"),
        (["spec.toml", "-o", "s9://bucket"], SPEC, 2, "-o s9://bucket: Protocol not known"),
        (["spec.toml", "--scheduler", "nowhere"], SPEC, 2, "--scheduler nowhere: "),
        (["spec.toml", "--time-limit", "0"], SPEC, 2, "0.0 is not in the range"),
        (["spec.toml"], SPEC.replace('"mujoco"', '"my_module:Mine"'), 3, "needs the module no_such_engine"),
    ],
)
def test_a_sweep_that_cannot_run_is_refused(arguments, text, code, message, tmp_path):
    """One line, an exit code, nothing written."""
    (tmp_path / "precious").write_text("x")
    (tmp_path / "spec.toml").write_text(text)
    (tmp_path / "my_module.py").write_text("import no_such_engine")
    done = dropspin("sweep", *arguments, cwd=tmp_path)
    assert done.returncode == code
    assert message in done.stderr
    assert "Traceback" not in done.stderr
    assert {path.name for path in tmp_path.iterdir()} - {"__pycache__"} == {"my_module.py", "precious", "spec.toml"}


def test_an_engine_that_breaks_down_gets_exit_code_3(tmp_path):
    """A module beside the spec; the tally says how its jobs ended."""
    (tmp_path / "my_module.py").write_text(
        "from dropspin import Engine\nclass Mine(Engine):\n name='mine'\n def prepare(self, s, dt): 1 / 0"
    )
    (tmp_path / "spec.toml").write_text(SPEC.replace('"pybullet"', '"my_module:Mine"'))
    done = dropspin("sweep", "spec.toml", "--json", cwd=tmp_path)
    assert done.returncode == 3, done.stderr
    assert json.loads(done.stdout)[1]["verdicts"] == {"crashed": 10}


@pytest.fixture(scope="module")
def whole(shared):
    """The table of the long sweep, uninterrupted."""

    def make(folder):
        (folder / "spec.toml").write_text(LONG)
        assert dropspin("sweep", "spec.toml", "-o", "whole", cwd=folder).returncode == 0

    return read_sweep(str(shared("long-sweep", make) / "whole")).drop(columns="time_per_step")


@pytest.mark.extended
@pytest.mark.usefixtures("engine_processes")
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_sweep_is_resumed(how, whole, tmp_path):
    """Exit code 130 at once; written jobs are counted; no process is left; resumed, the table is that of an uninterrupted sweep."""
    (tmp_path / "spec.toml").write_text(LONG)
    process = Started("sweep", "spec.toml", "-o", "part", cwd=tmp_path)
    assert any("per second" in line for line in process.stderr)
    code, errors = process.end(how)
    assert code == 130
    assert "Traceback" not in errors
    kept = len(read_sweep(str(tmp_path / "part")))
    assert f"dropspin: interrupted; {kept} of 16 jobs are kept; --resume continues the sweep." in errors
    assert 0 < kept < 16
    assert not [name for name in os.listdir("/proc") if name.isdigit() and parent_of(name) == str(process.pid)]
    assert dropspin("sweep", "spec.toml", "-o", "part", "--resume", cwd=tmp_path).returncode == 0
    pd.testing.assert_frame_equal(read_sweep(str(tmp_path / "part")).drop(columns="time_per_step"), whole, check_exact=True)


def parent_of(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1]
    except OSError:
        return ""
