"""The command line as its users meet it: in a process of its own."""

import csv
import json
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import comparisons
import scenarios
from comparisons.engines.mujoco_engine import MuJoCo
from reports.views.failures import failing

DROPSPIN = Path(sys.executable).with_name("dropspin")
SCENE = """
summary  = "Mine"
duration = 0.5
[body]
shape = "box"
half_extents = [0.1, 0.2, 0.3]
mass = 2.0
[start]
position = [0.0, 1.0, 0.0]
orientation = [0.1, 0.2, 0.3, 0.9]
angular_velocity = [1.0, 2.0, 3.0]
[gravity]
acceleration = [0.0, -9.81, 0.0]
[floor]
restitution = 0.6
friction = "infinite"
"""


def dropspin(*arguments, cwd):
    return subprocess.run([DROPSPIN, *arguments], cwd=cwd, capture_output=True, text=True, timeout=300, check=False)


def test_a_scene_of_ones_own(tmp_path):
    """Any path works, and the arrays are those of the Python call, bit for bit."""
    (tmp_path / "my-scene.toml").write_text(SCENE)
    done = dropspin("run", "my-scene.toml", "-e", "document", "-e", "mujoco", "--dt", "0.002", "-o", "out/mine", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Report: out/mine/report.html" in done.stdout
    assert (tmp_path / "out/mine/report.html").is_file()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["my-scene.toml", "out"]
    for engine in ("document", "mujoco"):
        motion = comparisons.simulate(scenarios.load(tmp_path / "my-scene.toml"), engine, dt=2e-3)
        [file] = (tmp_path / "out/mine/trajectories").glob(f"*-{engine}-*.npz")
        with np.load(file, allow_pickle=False) as arrays:
            for field in ("t", "position", "orientation", "velocity", "angular_velocity"):
                np.testing.assert_array_equal(arrays[field], getattr(motion, field))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "drop-bal"], "Did you mean 'drop-ball'?"),
        (["run", "absent.toml"], "absent.toml: No such file or directory"),
        (["run", "drop-ball", "-e", "mujocco"], "Did you mean 'mujoco'?"),
        (["run", "drop-ball", "-e", "mujoco[integrator=rk5]"], "Did you mean 'rk4'?"),
        (["run", "drop-ball", "--dt", "0"], "dt: got 0.0 s"),
        (["run", "drop-ball", "--dt", "nan"], "dt: got nan s"),
        (["run", "drop-ball", "--dt", "fast"], "'fast' is not a valid float"),
        (["run", "drop-ball", "--out", "x"], "No such option"),
        (["run", "drop-ball", "-o", "."], "the working directory, or a mount point, cannot be replaced"),
        (["run", "drop-ball", "-o", "precious"], "precious: is a file; choose a folder"),
        (["run", "drop-ball", "-o", "precious/x"], "precious/x: cannot be written"),
        (["run", "drop-ball", "--dt", "1e-310"], "dt: got 1e-310 s"),
        (["run", "drop-ball", "--dt", "0.01", "--dt", "0.01"], "a step is named twice"),
        (["run", "x" * 300], "is not in the catalogue"),
        (["show", "drop-ball", "-e", "mujoco", "--dt", "nan"], "dt: got nan s"),
        (["show", "drop-ball", "-e", "mujoco", "--dt", "0"], "dt: got 0.0 s"),
        (["frobnicate"], "No such command"),
        (["show", "drop-bal"], "Did you mean 'drop-ball'?"),
        (["show", "drop-ball", "-e", "x"], "engine 'x' is unknown"),
        (["list", "planets"], "'planets' is not one of"),
    ],
    ids=lambda case: " ".join(case) if isinstance(case, list) else "",
)
def test_bad_usage(arguments, message, tmp_path):
    """Exit code 2, the reason on the standard error, no traceback, nothing written."""
    (tmp_path / "precious").write_text("x")
    done = dropspin(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["precious"]


def test_expectation_that_fails_is_exit_code_1(tmp_path):
    """With the scene, the metric, the bound, and the command that does it again."""
    text = SCENE + '[[expect]]\nmetric = "penetration"\nbelow = 1e-9\nreason = "no engine is that stiff"\n'
    (tmp_path / "harsh.toml").write_text(text)
    done = dropspin("run", "harsh.toml", "-e", "mujoco", "--dt", "0.002", cwd=tmp_path)
    assert done.returncode == 1
    assert "penetration is" in done.stdout
    assert "no engine is that stiff" in done.stdout.replace("\n", " ")
    assert "1 of 1 checks fail." in done.stdout


@pytest.mark.parametrize("what", ["scenes", "engines", "metrics"])
def test_list(what, tmp_path):
    """A table for people, the same in JSON for programs."""
    table = dropspin("list", what, cwd=tmp_path)
    data = json.loads(dropspin("list", what, "--json", cwd=tmp_path).stdout)
    assert table.returncode == 0
    for row in data:
        assert next(iter(row.values())) in table.stdout


def test_show(tmp_path):
    """What is modelled, what is left out, the truth; an engine's settings; a scene that it declines."""
    shown = dropspin("show", "spin-asymmetric", cwd=tmp_path).stdout
    assert "gravity, floor, damping" in shown
    assert "elliptic" in shown
    settings = dropspin("show", "drop-ball", "-e", "mujoco", "--dt", "0.002", cwd=tmp_path).stdout
    assert "[0.0, -750.0]" in settings
    declined = dropspin("show", "drop-ball", "-e", "mujoco[integrator=rk4]", cwd=tmp_path).stdout
    assert "declines drop-ball" in declined.replace("\n", " ")


def test_doctor(tmp_path):
    """Every engine installed here takes its steps."""
    rows = {row["what"]: row["found"] for row in json.loads(dropspin("doctor", "--json", cwd=tmp_path).stdout)}
    assert rows["engine document"].startswith("works")
    assert rows["engine mujoco"].startswith("works")
    assert rows["python"] == sys.version.split()[0]


def test_json_of_a_run(tmp_path):
    """The rows and nothing else on the standard output, to the last digit; no number is null."""
    done = dropspin("run", "spin-principal", "-e", "pybullet", "--dt", "0.004", "--json", cwd=tmp_path)
    rows = json.loads(done.stdout, parse_constant=lambda name: pytest.fail(f"{name} is no JSON"))
    with (tmp_path / "out/run/results.csv").open(newline="") as file:
        for row, kept in zip(rows, csv.DictReader(file), strict=True):
            assert row["metric"] == kept["metric"]
            assert row["value"] == float(kept["value"])
            assert (row["upper"] is None) == (kept["upper"] == "")
    assert any(0 < abs(row["value"]) < 1e-11 for row in rows)
    assert "running spin-principal" in done.stderr


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252"])
def test_terminals_without_utf_8(encoding, tmp_path):
    """A question mark for a sign that is not there; never a traceback, never another exit code."""
    environment = os.environ | {"PYTHONIOENCODING": encoding, "PYTHONUTF8": "0"}
    for arguments in (["run", "spin-principal", "-e", "mujoco", "--dt", "0.01"], ["show", "drop-ball"], ["list", "metrics"]):
        done = subprocess.run([DROPSPIN, *arguments], cwd=tmp_path, env=environment, capture_output=True, timeout=120, check=False)
        assert done.returncode == 0, done.stderr.decode(encoding)


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_runs_leave_nothing(how, tmp_path):
    """Ctrl-C, or a CI server that has waited long enough: exit code 130, no folder, no traceback."""
    process = subprocess.Popen([DROPSPIN, "run"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    assert "running" in process.stderr.readline()
    process.send_signal(how)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []


def test_dry_run(tmp_path):
    """What would be measured of what, as programs can ask for it again; nothing is written."""
    (tmp_path / "mine.toml").write_text(SCENE)
    done = dropspin("run", "./mine.toml", "-e", "mujoco[ integrator=euler ]", "--dt", "0.002", "--dry-run", "--json", cwd=tmp_path)
    plan = json.loads(done.stdout)
    assert plan["engines"] == [{"engine": "mujoco", "from": "mujoco[ integrator=euler ]", "missing": ""}]
    assert plan["dts"] == [0.002]
    [scene] = plan["scenes"]
    assert (scene["scene"], scene["from"]) == ("mine", "./mine.toml")
    assert set(scene["metrics"]) == set(
        comparisons.run([scenarios.load(tmp_path / "mine.toml")], ["mujoco"], [2e-3]).measurements["metric"]
    )
    assert "spin-principal" in dropspin("run", "core", "--dry-run", cwd=tmp_path).stdout
    assert dropspin("run", "core", "--dt", "0", "--dry-run", cwd=tmp_path).returncode == 2
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]


def rows_of(folder):
    with (folder / "results.csv").open(newline="") as file:
        return [{key: value for key, value in row.items() if key != "time_per_step"} for row in csv.DictReader(file)]


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_interrupted_runs_go_on(how, tmp_path):
    """What is measured is kept, scene by scene; with --resume only the rest is run, and the table is as if nothing had happened."""
    asked = ["run", "spin-principal", "fall-spin", "drop-ball", "-e", "document", "-e", "mujoco"]
    whole = dropspin(*asked, "-o", "whole", cwd=tmp_path)
    assert whole.returncode == 0
    process = subprocess.Popen([DROPSPIN, *asked, "-o", "part"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    while "drop-ball" not in process.stderr.readline():
        pass
    process.send_signal(how)
    _, errors = process.communicate(timeout=60)
    if how == signal.SIGINT:
        assert process.returncode == 130
        assert "2 of 3 scenes are kept, --resume goes on" in errors
    kept = tmp_path / ".part-measured"
    assert len(list(kept.glob("[0-9]*"))) == 2
    stamps = [path.stat().st_mtime_ns for path in sorted(kept.glob("[0-9]*/run.json"))]
    resumed = subprocess.Popen(
        [DROPSPIN, *asked, "-o", "part", "--resume"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    while "drop-ball" not in resumed.stderr.readline():
        pass
    assert [path.stat().st_mtime_ns for path in sorted(kept.glob("[0-9]*/run.json"))][:2] == stamps
    told, errors = resumed.communicate(timeout=120)
    assert resumed.returncode == 0, errors
    assert "All" in told
    assert rows_of(tmp_path / "part") == rows_of(tmp_path / "whole")
    assert not kept.exists()


def test_resume_runs_again_what_was_asked_differently(tmp_path):
    """Other steps, another scene of the same name: nothing of an earlier run is taken for it."""
    import comparisons
    from reports.run_folder import Measured

    scene = scenarios.load("spin-principal")
    earlier = comparisons.run([scene], ["document"], [4e-3])
    Measured(tmp_path / "run").keep(earlier)
    [part] = Measured(tmp_path / "run").parts()
    ran = []

    def count(scene, engine, dt):
        ran.append(dt)

    def runs_again(scene, engines, dts, **limits):
        kept = []
        comparisons.run([scene], engines, dts, count, keep=kept.append, done=[part], **limits)
        return len(kept) == 1

    assert not runs_again(scene, ["document"], [4e-3])
    assert runs_again(scene, ["document"], [2e-3])
    assert runs_again(scene, ["mujoco"], [4e-3])
    assert runs_again(scene.model_copy(update={"duration": 0.5}), ["document"], [4e-3])
    assert runs_again(scene, ["document"], [4e-3], limits=comparisons.ResourceLimits(processor_time=600.0))


def test_an_interrupt_that_is_swallowed_still_stops_the_run(tmp_path, monkeypatch):
    """A callback of an engine or of the compiler may eat the exception; the next step of the run notices."""
    from click.testing import CliRunner

    from reports.commands import main as cli

    monkeypatch.setattr("reports.commands.interrupts._interrupts", [signal.SIGINT])
    done = CliRunner().invoke(cli.dropspin, ["run", "spin-principal", "-e", "document", "--dt", "0.01", "-o", str(tmp_path / "out")])
    assert done.exit_code != 0
    assert list(tmp_path.iterdir()) == []


def test_output_that_cannot_be_written_to(tmp_path):
    """A full device: one line and exit code 2, not 1."""
    with Path("/dev/full").open("w") as full:
        done = subprocess.run([DROPSPIN, "list"], cwd=tmp_path, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    assert done.returncode == 2
    assert "No space left" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("expectation", "message"),
    [
        ('metric = "energy_eror"\nbelow = 1', "Did you mean 'energy_error'?"),
        ('metric = "horizontal_momentum_error"\nbelow = 1', "it needs a frictionless floor"),
        ('metric = "penetration"\nbelow = 1\nengine = "documnt"', "no such engine. Did you mean 'document'?"),
        ('metric = "penetration"\nbelow = 1\nengine = "mujoco[integrator=euler]"', "write it as 'mujoco'"),
    ],
)
def test_expectations_that_would_never_be_judged(expectation, message, tmp_path):
    """A gate with a typo must not pass: refused by run and by show, with the file's name."""
    (tmp_path / "gate.toml").write_text(SCENE + f'[[expect]]\n{expectation}\nreason = "why"\n')
    for verb in (["run", "gate.toml", "--dt", "0.01"], ["show", "gate.toml"]):
        done = dropspin(*verb, cwd=tmp_path)
        assert done.returncode == 2
        assert message in done.stderr
        assert "gate.toml: expect[0]" in done.stderr


def test_nothing_judged_is_not_nothing_expected(tmp_path):
    """Expectations for other steps are not said to be missing."""
    done = dropspin("run", "spin-asymmetric", "-e", "mujoco[integrator=rk4]", "--dt", "0.01", cwd=tmp_path)
    assert "No expectation is for these engines at these steps" in done.stdout


def test_command_that_does_it_again(tmp_path):
    """With the path as it was given, quoted, all digits of the step, and the time limit if it is not the usual one."""
    (tmp_path / "my scene.toml").write_text(SCENE + '[[expect]]\nmetric = "penetration"\nbelow = 1e-9\nreason = "stiff"\n')
    command = ("run", "my scene.toml", "-e", "mujoco", "--dt", "0.00123456789")
    assert f"Again: dropspin {shlex.join(command)} -o out/again" in dropspin(*command, cwd=tmp_path).stdout.replace("\n", " ")
    done = dropspin(*command, "--time-limit", "17", cwd=tmp_path)
    assert f"Again: dropspin {shlex.join(command)} --time-limit 17 -o out/again" in done.stdout.replace("\n", " ")


def test_call_that_does_it_again():
    """Of a scene or an engine that was given as an object: no command knows it."""
    ball = scenarios.load("drop-ball")
    content = ball.model_dump(exclude_none=True, exclude={"origin", "expect"})
    given = scenarios.load(content | {"expect": [{"metric": "penetration", "below": 1e-9, "reason": "stiff"}]})
    by_name = ball.model_copy(update={"expect": given.expect})
    for scene, engine, call in (
        (given, MuJoCo(), "[<scene 'drop-ball'>], [<engine 'mujoco'>], [0.004]"),
        (given, "mujoco", "[<scene 'drop-ball'>], ['mujoco'], [0.004]"),
        (by_name, MuJoCo(), "[scenarios.load('drop-ball')], [<engine 'mujoco'>], [0.004]"),
    ):
        [found] = failing(comparisons.run([scene], [engine], [4e-3]))
        assert found.again == f"comparisons.run({call})"


ADAPTER = (Path(__file__).parents[2] / "docs" / "bring-your-engine.md").read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]


def test_an_engine_of_ones_own(tmp_path):
    """A module in the working directory, as the page says: it conforms, it runs, and its results bear its name."""
    (tmp_path / "my_module.py").write_text(f"print('hello')\n{ADAPTER}\nclass Mine:\n    Flyer = Flyer\n")
    (tmp_path / "scenarios.py").write_text("raise SystemExit('a file of the user hides a module of dropspin')")
    done = dropspin("conform", "my_module:Flyer", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert {row["verdict"] for row in json.loads(done.stdout)} == {"passed", "declined"}
    done = dropspin("run", "spin-asymmetric", "-e", "my_module:Flyer", "--dt", "0.002", "--json", cwd=tmp_path)
    assert {row["engine"] for row in json.loads(done.stdout)} == {"flyer"}
    assert dropspin("show", "spin-asymmetric", "-e", "my_module:Mine.Flyer", cwd=tmp_path).returncode == 0
    assert sorted(path.name for path in tmp_path.iterdir()) in (
        ["__pycache__", "my_module.py", "out", "scenarios.py"],
        ["my_module.py", "out", "scenarios.py"],
    )


def test_an_engine_of_ones_own_that_is_wrong(tmp_path):
    """One word a mistake, and exit code 1."""
    wrong = ADAPTER.replace("Rotation.from_quat(q).apply(self.data.qvel[3:])", "self.data.qvel[3:]")
    (tmp_path / "my_module.py").write_text(wrong)
    done = dropspin("conform", "my_module:Flyer", cwd=tmp_path)
    assert done.returncode == 1
    assert "angular velocity looks body-framed" in " ".join(done.stdout.split())


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("", 2, "my_module's engine 'Mine' is unknown"),
        ("Mine = 3", 2, "Mine is no engine"),
        ("import comparisons\nclass Mine(comparisons.Engine): pass", 2, "Mine.name is what results call it"),
        ("import no_such_engine", 3, "needs the module no_such_engine, which is not installed"),
        ("1 / 0", 2, "cannot be imported (ZeroDivisionError"),
        ("import comparisons\nclass Mine(comparisons.Engine):\n name='mine'\n def __init__(self): pass", 2, "could not be created"),
        (None, 2, "no module 'my_module' here"),
        ("import sys\nsys.exit(0)", 2, "cannot be imported (SystemExit"),
        ("import comparisons\nclass Mine(comparisons.Engine):\n name='mujoco'", 2, "an engine of dropspin's own; results need another"),
    ],
)
def test_an_engine_that_is_none(text, code, message, tmp_path):
    if text is not None:
        (tmp_path / "my_module.py").write_text(text)
    done = dropspin("conform", "my_module:Mine", cwd=tmp_path)
    assert done.returncode == code
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_an_engine_of_another_package(tmp_path):
    """One that is installed with an entry point is listed, and run by its name."""
    (tmp_path / "my_module.py").write_text(ADAPTER)
    info = tmp_path / "flyer-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: flyer\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[dropspin.engines]\nflyer = my_module:Flyer\nmujoco = my_module:Flyer\n")
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    listed = subprocess.run([DROPSPIN, "list", "engines", "--json"], env=environment, capture_output=True, text=True, check=True)
    rows = {row["engine"]: row["summary"] for row in json.loads(listed.stdout)}
    assert rows["flyer"] == "MuJoCo in free flight."
    assert rows["mujoco"].startswith("MuJoCo with exact restitution")  # nobody takes a name of dropspin's own
    done = subprocess.run([DROPSPIN, "show", "spin-asymmetric", "-e", "flyer"], env=environment, capture_output=True, text=True, check=True)
    assert "version" in done.stdout


def test_calibrate(tmp_path):
    """The table, the settings and the texts; one text alone; all of it as JSON."""
    asked = ("calibrate", "--restitution", "0.7", "--dt", "0.002")
    done = dropspin(*asked, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "[0.0, -850.0]" in done.stdout
    assert "To paste, as mjcf:" in done.stdout
    alone = dropspin(*asked, "-e", "pybullet", "--as", "urdf", cwd=tmp_path)
    assert alone.stdout.startswith("<?xml")
    found = json.loads(dropspin(*asked, "--json", cwd=tmp_path).stdout)
    assert found["settings"]["solref"] == [0.0, -850.0]
    assert {one["name"]: one["value"] for one in found["measured"]}["restitution"] == pytest.approx(0.7, abs=1e-4)
    assert set(found["programs"]) == {"python", "mjcf"}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["--dt", "0.002"], "Missing option '--restitution'"),
        (["--restitution", "2", "--dt", "0.002"], "2.0 is not in the range"),
        (["--restitution", "0.5", "--dt", "1"], "dt: got 1.0 s"),
        (["--restitution", "0.5", "--dt", "0.002", "--friction", "some"], "friction: got 'some'; it is none, infinite or a number"),
        (["--restitution", "0.5", "--dt", "0.002", "--as", "urdf"], "mujoco's language 'urdf' is unknown"),
        (["--restitution", "0.5", "--dt", "0.002", "-e", "document"], "document has no settings to calibrate"),
    ],
)
def test_calibrate_what_cannot_be(given, message, tmp_path):
    done = dropspin("calibrate", *given, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_tradeoff(tmp_path):
    """The front, the advice, and the files."""
    (tmp_path / "short.toml").write_text("""
duration = 2.0
[body]
shape = "box"
half_extents = [0.1, 0.2, 0.3]
mass = 2.0
[start]
angular_velocity = [1.0, 5.0, 0.5]
""")
    asked = ("tradeoff", "short.toml", "-e", "document[rotation=rk4]", "-e", "document[rotation=exact]", "-e", "document")
    done = dropspin(*asked, "--within", "1e-9", "--within", "1e-30", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    told = " ".join(done.stdout.split())
    assert "orientation error within 1e-09 rad: document[rotation=" in told
    assert "within 1e-30 rad: nothing gets there; the nearest is document[rotation=" in told
    assert "Left out: document, it does not converge: orientation error stays at" in told
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "section.json",
        "short.svg",
        "tradeoff.csv",
        "tradeoff.json",
        "tradeoff.md",
    ]
    rows = json.loads((tmp_path / "out" / "tradeoff.json").read_text())
    assert {row["engine"] for row in rows} == {"document[rotation=rk4]", "document[rotation=exact]"}
    assert all(row["cost_best"] <= row["cost"] for row in rows)
    assert any(row["on_front"] for row in rows)
    assert all(row["side_by_side"] > 0.0 for row in rows)


def test_tradeoff_of_what_has_no_truth(tmp_path):
    (tmp_path / "mine.toml").write_text(SCENE.replace("mass = 2.0", "mass = 2.0").replace('friction = "infinite"', "friction = 0.3"))
    done = dropspin("tradeoff", "mine.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "has no truth to hold errors against" in done.stderr
    assert list(tmp_path.iterdir()) == [tmp_path / "mine.toml"]
