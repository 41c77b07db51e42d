"""`dropspin conform`, and engines of one's own on the command line."""

import json
import os
from pathlib import Path

import pytest
from support.cli import dropspin, spawn

ADAPTER = (Path(__file__).parents[3] / "docs" / "bring-your-engine.md").read_text(encoding="utf-8").split("```python\n")[1].split("```")[0]


def test_the_adapter_of_the_documentation_conforms_and_runs(tmp_path):
    """A module in the working directory; its results bear its name, and what it prints is not in the output."""
    (tmp_path / "my_module.py").write_text(f"print('hello')\n{ADAPTER}")
    done = dropspin("conform", "my_module:Flyer", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert {row["outcome"] for row in json.loads(done.stdout)} == {"passed", "declined"}
    done = dropspin("run", "spin-asymmetric", "-e", "my_module:Flyer", "--dt", "0.002", "--json", cwd=tmp_path)
    assert {row["engine"] for row in json.loads(done.stdout)} == {"flyer"}
    assert {path.name for path in tmp_path.iterdir()} - {"__pycache__"} == {"my_module.py", "out"}


def test_files_of_the_user_hide_no_module_of_dropspin(tmp_path):
    """In a fresh process, in whose working directory a file has the name of a package of dropspin."""
    (tmp_path / "my_module.py").write_text(f"print('hello')\n{ADAPTER}\nclass Mine:\n    Flyer = Flyer\n")
    for name in ("scenarios", "comparisons", "reports"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('a file of the user hides a module of dropspin')")
    for environment in ({}, {"PYTHONPATH": str(tmp_path)}):
        done = spawn("show", "spin-asymmetric", "-e", "my_module:Mine.Flyer", cwd=tmp_path, **environment)
        assert done.returncode == 0, done.stderr
        assert done.stderr == "hello\n"


def test_a_wrong_adapter_gets_exit_code_1_and_a_diagnosis(tmp_path):
    wrong = ADAPTER.replace("Rotation.from_quat(q).apply(self.data.qvel[3:])", "self.data.qvel[3:]")
    assert wrong != ADAPTER
    (tmp_path / "my_module.py").write_text(wrong)
    done = dropspin("conform", "my_module:Flyer", cwd=tmp_path)
    assert done.returncode == 1
    assert "angular velocity appears to be in the body frame" in " ".join(done.stdout.split())


ENGINE = "from dropspin import Engine\nclass Mine(Engine):"


@pytest.mark.parametrize(
    ("text", "code", "message"),
    [
        ("", 2, "my_module's engine 'Mine' is unknown"),
        ("Mine = 3", 2, "Mine is not an engine; an engine is a class that inherits from dropspin.Engine"),
        (f"{ENGINE} pass", 2, "Mine.name is ''; give it a name for results"),
        ("import no_such_engine", 3, "needs the module no_such_engine, which is not installed"),
        ("1 / 0", 2, "cannot be imported (ZeroDivisionError"),
        (f"{ENGINE}\n name='mine'\n def __init__(self): pass", 2, "could not be created"),
        (None, 2, "no module 'my_module' here"),
        ("import sys\nsys.exit(0)", 2, "cannot be imported (SystemExit"),
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


def test_an_engine_of_another_package(tmp_path):
    """One that is installed with an entry point is listed, and runs by its name; no package can take a name of dropspin's own engines."""
    (tmp_path / "my_module.py").write_text(ADAPTER)
    info = tmp_path / "flyer-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: flyer\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[dropspin.engines]\nflyer = my_module:Flyer\nmujoco = my_module:Flyer\n")
    listed = dropspin("list", "engines", "--json", cwd=tmp_path)
    rows = {row["engine"]: row["summary"] for row in json.loads(listed.stdout)}
    assert rows["flyer"] == "MuJoCo in free flight."
    assert rows["mujoco"].startswith("MuJoCo with exact restitution")
    done = spawn("show", "spin-asymmetric", "-e", "flyer", cwd=os.curdir, PYTHONPATH=str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert "version" in done.stdout
