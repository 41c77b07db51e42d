"""`dropspin conform`, and engines of one's own on the command line."""

import json
import os
import re
from pathlib import Path

import pytest
from support.adapters import DRIFTING
from support.cli import TERMINAL, dropspin, spawn
from support.engines import Exact

from dropspin.comparisons.conformance.checks import CHECKS, conform

ADAPTER = (Path(__file__).parents[3] / "docs" / "bring-your-engine.md").read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]


@pytest.mark.extended
def test_the_adapter_of_the_documentation_conforms_and_runs(tmp_path):
    """A module in the working directory; its results bear its name, and what it prints is not in the output."""
    (tmp_path / "my_module.py").write_text(f"print('hello')\n{ADAPTER}")
    done = dropspin("conform", "my_module:Flyer", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert {row["outcome"] for row in json.loads(done.stdout)} == {"passed", "declined"}
    done = dropspin("run", "fall-spin", "-e", "my_module:Flyer", "--dt", "0.004", "--json", cwd=tmp_path)
    assert {row["engine"] for row in json.loads(done.stdout)} == {"flyer"}
    assert {path.name for path in tmp_path.iterdir()} - {"__pycache__"} == {"my_module.py", "out"}


@pytest.mark.extended
def test_files_of_the_user_hide_no_module_of_dropspin(tmp_path):
    """In a fresh process, in whose working directory a file has the name of a package of dropspin."""
    (tmp_path / "my_module.py").write_text(f"print('hello')\n{ADAPTER}\nclass Mine:\n    Flyer = Flyer\n")
    for name in ("scenarios", "comparisons", "reports"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('a file of the user hides a module of dropspin')")
    for environment in ({}, {"PYTHONPATH": str(tmp_path)}):
        done = spawn("show", "spin-asymmetric", "-e", "my_module:Mine.Flyer", cwd=tmp_path, **environment)
        assert done.returncode == 0, done.stderr
        assert done.stderr == ""  # output of an engine is dropped


def test_a_wrong_adapter_gets_exit_code_1_and_a_diagnosis(tmp_path):
    wrong = ADAPTER.replace("Rotation.from_quat(q).apply(self.data.qvel[3:])", "self.data.qvel[3:]")
    assert wrong != ADAPTER
    (tmp_path / "my_module.py").write_text(wrong)
    done = dropspin("conform", "my_module:Flyer", cwd=tmp_path)
    assert done.returncode == 1
    assert "angular velocity appears to be in the body frame" in " ".join(done.stdout.split())


RAISING = """
from dropspin import Engine, Simulation
from support_of_mine import deeper


class Mine(Engine):
    name = "mine"

    def prepare(self, scene, dt):
        return Moving(scene)


class Moving(Simulation):
    def __init__(self, scene):
        self.now = scene.initial_state

    def advance(self, steps):
        self.now[0] += deeper(self.now)  # line 18

    def state(self):
        return self.now.copy()
"""


@pytest.fixture
def raising(tmp_path):
    """The folder of an adapter that raises when it steps, in a function of another file."""
    (tmp_path / "raising.py").write_text(RAISING)
    (tmp_path / "support_of_mine.py").write_text("def deeper(state):\n    return state[99]\n")
    return tmp_path


ERROR = "IndexError: index 99 is out of bounds for axis 0 with size 13 (raising.py:18, in advance)"


def test_exceptions_have_the_line_of_the_adapter_and_are_printed_once(raising):
    done = dropspin("conform", "raising:Mine", cwd=raising)
    assert done.returncode == 3
    *rows, shared, outcome = done.stdout.splitlines()
    assert [row[:20].strip() for row in rows] == list(CHECKS)
    [first] = [row for row in rows if row.endswith(ERROR)]
    same = [row for row in rows if row.endswith(f"  the same error as in '{first[:20].strip()}'")]
    assert shared == f"{1 + len(same)} checks have the same error: {ERROR}"
    [built] = [row for row in rows if row.startswith("builds what is meant")]
    assert f"{ERROR}, in the scene tumbling; decline scenes that the engine cannot run, with a reason" in built
    assert outcome == f"{2 + len(same)} of {len(rows)} checks fail, with 2 different messages."
    assert "Traceback" not in done.stdout


def test_whole_traceback_of_an_adapter_is_printed_on_request(raising):
    done = dropspin("conform", "raising:Mine", "--check", "time", "--traceback", cwd=raising)
    assert 'support_of_mine.py", line 2, in deeper' in done.stdout
    [row] = json.loads(dropspin("conform", "raising:Mine", "--check", "time", "--traceback", "--json", cwd=raising).stdout)
    assert row["traceback"].startswith("Traceback (most recent call last):")
    assert row["message"] == ERROR


@pytest.mark.extended
@pytest.mark.parametrize("environment", [{}, TERMINAL], ids=["pipe", "terminal"])
def test_texts_of_an_adapter_do_not_control_the_terminal(raising, environment):
    """Neither its exceptions, nor the lines of its file in a traceback; JSON has the same text in escapes."""
    hostile = "\x1b]0;title\x07\x1b[2J\u202e\x9b1m\u061c"
    (raising / "support_of_mine.py").write_text(f"def deeper(state):\n    raise ValueError({hostile!r})  # {hostile}\n")
    options = ("conform", "raising:Mine", "--check", "time", "--traceback")
    done = dropspin(*options, cwd=raising, **environment)
    assert "title" in done.stdout
    assert not set(hostile) & set("\x07\u202e\x9b\u061c") & set(done.stdout + done.stderr)
    assert "\x1b]" not in done.stdout
    assert "\x1b[2J" not in done.stdout
    printed = dropspin(*options, "--json", cwd=raising).stdout
    assert printed.replace("\n", "").isprintable()
    [row] = json.loads(printed)
    assert f"# {hostile}" in row["traceback"]


def test_checks_are_reported_as_they_finish():
    """Each with its result, in order."""
    reported = []
    found = conform(Exact(), ["claims", "time"], on_result=reported.append)
    assert reported == found
    assert [one.check for one in found] == ["claims", "time"]


def test_check_in_a_folder_of_its_own_leaves_no_file(tmp_path, monkeypatch):
    """Not even if the engine ends the process, which then cannot remove the folder."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "temporary"))
    (tmp_path / "breaking.py").write_text(f"import os\n{ADAPTER}\nFlight.advance = lambda *given: os.abort()\n")
    done = dropspin("conform", "breaking:Flyer", "--check", "files", cwd=tmp_path)
    assert done.returncode == 3, done.stderr
    assert not list((tmp_path / "temporary").iterdir())


def test_rows_fit_a_terminal_of_80_columns(raising):
    lines = dropspin("conform", "raising:Mine", "--check", "time", cwd=raising, **TERMINAL).stdout.splitlines()
    assert max(map(len, lines)) <= 80
    assert ERROR in " ".join(" ".join(lines).split())


ENGINE = "from dropspin import Engine\nclass Mine(Engine):"


@pytest.mark.extended
@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("", 2, "my_module's engine 'Mine' is unknown"),
        (f"{ENGINE} name = 'x y' * 1000", 2, "Mine.name is 'x yx yx"),
        ("Mine = 3", 2, "Mine is not an engine; an engine is a class that inherits from dropspin.Engine"),
        (f"{ENGINE} pass", 2, "Mine.name is ''; give it a name for results"),
        ("import no_such_engine", 3, "needs the module no_such_engine, which is not installed"),
        ("1 / 0", 3, "my_module cannot be imported: ZeroDivisionError: division by zero"),
        (f"{ENGINE}\n name='mine'\n prepare = None\n def __init__(self): pass", 3, "cannot be constructed: TypeError: Mine.__init__()"),
        (f"{ENGINE}\n name='mine'", 3, "cannot be constructed: TypeError: Can't instantiate abstract class Mine with"),
        (None, 2, "no module 'my_module' here"),
        ("import sys\nsys.exit(0)", 3, "cannot be imported: SystemExit: 0"),
        (f"{ENGINE}\n name='mujoco'", 2, "which is a built-in engine; results need another name"),
    ],
)
def test_what_is_not_an_engine_is_refused_in_one_line(text, code, message, tmp_path):
    if text is not None:
        (tmp_path / "my_module.py").write_text(text)
    done = dropspin("conform", "my_module:Mine", cwd=tmp_path)
    assert done.returncode == code
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert len(done.stderr) < 400


@pytest.mark.parametrize("member", ["prepare", "advance", "state"])
def test_a_missing_required_member_is_named(member, tmp_path):
    """That of an engine when it is loaded, that of a simulation in the line that constructs it."""
    (tmp_path / "my_module.py").write_text(DRIFTING.replace(f"def {member}(", "def renamed("))
    done = dropspin("conform", "my_module:Mine", "--check", "states", cwd=tmp_path)
    assert done.returncode == 3
    [line] = (done.stderr if member == "prepare" else done.stdout).splitlines()[:1]
    kind, end = ("Mine", ".") if member == "prepare" else ("Drifting", "(my_module.py:16, in prepare)")
    assert re.search(rf"TypeError: Can't instantiate abstract class {kind} with.* abstract method '?{member}\b", line)
    assert line.endswith(end)


@pytest.mark.extended
def test_an_engine_of_another_package(tmp_path):
    """One that is installed with an entry point is listed, and runs by its name; no package can take a name of dropspin's own engines."""
    (tmp_path / "my_module.py").write_text(ADAPTER)
    info = tmp_path / "flyer-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: flyer\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[dropspin.engines]\nflyer = my_module:Flyer\nmujoco = my_module:Flyer\n")
    listed = spawn("list", "engines", "--json", cwd=os.curdir, PYTHONPATH=str(tmp_path))
    rows = {row["engine"]: row["summary"] for row in json.loads(listed.stdout)}
    assert rows["flyer"] == "MuJoCo in free flight."
    assert rows["mujoco"].startswith("MuJoCo with exact restitution")
    done = spawn("show", "spin-asymmetric", "-e", "flyer", cwd=os.curdir, PYTHONPATH=str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert "version" in done.stdout
