"""Files of the working directory, and packages that are installed and broken, do not disturb a command."""

import json
import resource
import shlex
import shutil
import subprocess
import sys
from unittest import mock

import pytest
from support.adapters import DRIFTING
from support.cli import DROPSPIN, Started, assert_refused, dropspin, spawn

from dropspin.reports.stories import listings

STRAYS = ("bottleneck", "numexpr", "cloudpickle", "yaml", "colorama", "lxml", "click", "numpy", "matplotlib", "scenarios", "_pytest")
BALL = """
duration = 0.1
[body]
shape = "sphere"
radius = 0.1
mass = 1.0
[start]
velocity = [1.0, 0.0, 0.0]
"""
RUN = ("run", "ball.toml", "-e", "wang", "--dt", "0.01", "-o", "out")


@pytest.fixture
def strays(tmp_path):
    """A working directory with modules that leave a mark when they are imported, and settings of matplotlib that cannot be read."""
    for name in STRAYS:
        (tmp_path / f"{name}.py").write_text(f"open('imported-{name}', 'w').close()\nraise RuntimeError('a stray was imported')")
    (tmp_path / "matplotlibrc").write_bytes(b"axes.facecolor: red\n\xff\xfe\x00")
    (tmp_path / "ball.toml").write_text(BALL)
    return tmp_path


@pytest.mark.extended
@pytest.mark.parametrize("arguments", [("doctor",), RUN], ids=lambda given: given[0])
def test_strays_in_the_working_directory_are_not_imported(arguments, strays):
    done = spawn(*arguments, cwd=strays)
    assert done.returncode == 0, done.stderr
    assert not list(strays.glob("imported-*"))


@pytest.mark.extended
def test_plots_ignore_settings_of_the_working_directory_and_the_backend_of_a_notebook(strays):
    """Also one that is not installed."""
    elsewhere = strays / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "ball.toml").write_text(BALL)
    assert dropspin(*RUN, cwd=elsewhere).returncode == 0
    shutil.copytree(elsewhere / "out", strays / "out")
    done = spawn("report", "out", "--plots", "svg", cwd=strays, MPLBACKEND="module://not_installed.backend_inline")
    assert (done.returncode, done.stderr) == (0, "")
    assert dropspin("report", "out", "--plots", "svg", cwd=elsewhere).returncode == 0
    first, second = ((strays / name / "out" / "plots") for name in ("", "elsewhere"))
    drawn = {file.name: file.read_bytes() for file in first.iterdir()}
    assert drawn
    assert drawn == {file.name: file.read_bytes() for file in second.iterdir()}


@pytest.fixture
def _broken(tmp_path, monkeypatch):
    """A package pydrake that cannot be imported comes before the one that may be installed."""
    folder = tmp_path / "packages"
    (folder / "pydrake").mkdir(parents=True)
    text = "libGL.so.1: cannot open shared object file: No such file or directory"
    (folder / "pydrake" / "__init__.py").write_text(f"raise ImportError({text!r})")
    (tmp_path / "ball.toml").write_text(BALL)
    for name in [
        name for name in sys.modules if name.partition(".")[0] == "pydrake" or name == "dropspin.comparisons.engines.drake_engine"
    ]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(folder)


REASON = "drake is installed, but pydrake cannot be imported: ImportError: libGL.so.1: cannot open shared object file"
CURE = "apt-get install libgl1"


@pytest.mark.usefixtures("_broken")
def test_broken_engine_is_a_row_of_doctor_and_of_the_list(tmp_path):
    done = dropspin("doctor", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = {row["what"]: row["found"] for row in json.loads(done.stdout)}
    assert rows["engine drake"].startswith(f"broken: {REASON}")
    assert CURE in rows["engine drake"]
    assert rows["engine wang"].startswith("works")
    done = dropspin("list", "engines", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert next(row["summary"] for row in json.loads(done.stdout) if row["engine"] == "drake").startswith(REASON)


@pytest.mark.usefixtures("_broken")
def test_broken_engine_costs_its_own_row(tmp_path):
    done = dropspin(*RUN, "-e", "drake", "--json", cwd=tmp_path)
    assert done.returncode == 3, done.stderr
    rows = json.loads(done.stdout)
    [row] = [row for row in rows if row["engine"] == "drake"]
    assert row["verdict"] == "broken"
    assert row["reason"].startswith(REASON)
    assert {row["verdict"] for row in rows if row["engine"] == "wang"} <= {"passed", "measured"}
    assert dropspin("run", "ball.toml", "-e", "drake", "-o", "alone", cwd=tmp_path).returncode == 3
    for command in (("show", "drop-ball", "-e", "drake"), ("conform", "drake")):
        done = dropspin(*command, cwd=tmp_path)
        assert done.returncode == 3
        assert done.stderr.startswith(f"dropspin: {REASON}")
        assert len(done.stderr.splitlines()) == 1


ADAPTER = "import helper_of_drifting\n" + DRIFTING
SPEC = 'scenes = ["ball.toml"]\nengines = ["drifting:Mine"]\ndts = [0.01]\n[grid]\n"body.mass" = [1.0, 2.0, 3.0]\n'


def test_sweep_is_not_resumed_with_another_adapter(tmp_path):
    """Not even if only a module that it imports has changed."""
    texts = {"drifting.py": ADAPTER, "helper_of_drifting.py": "x = 1", "ball.toml": BALL, "spec.toml": SPEC}
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    assert dropspin("sweep", "spec.toml", "-o", "out", cwd=tmp_path).returncode == 0
    assert dropspin("sweep", "spec.toml", "-o", "out", "--resume", cwd=tmp_path).returncode == 0
    (tmp_path / "helper_of_drifting.py").write_text("x = 2")
    done = dropspin("sweep", "spec.toml", "-o", "out", "--resume", cwd=tmp_path)
    assert done.returncode == 2
    assert "holds a sweep that was run with the adapter of mine " in done.stderr


@pytest.mark.extended
def test_run_is_resumed_with_scenes_of_the_same_adapter_only(tmp_path):
    """A changed one is measured again, which is said."""
    texts = {"drifting.py": ADAPTER, "helper_of_drifting.py": "x = 1", "ball.toml": BALL}
    texts["stopping.py"] = "import os, signal\nfrom drifting import Mine as Base\n\nclass Mine(Base):\n    name = 'stopping'\n"
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    (tmp_path / "later.toml").write_text(BALL)
    after_timing = "len(calls.append(scene.name) or [name for name in calls if name == 'later']) > 3"
    stop = f"    def prepare(self, scene, dt, calls=[]):\n        if {after_timing}: os.kill(os.getppid(), signal.SIGINT)\n"
    (tmp_path / "stopping.py").write_text(texts["stopping.py"] + stop + "        return super().prepare(scene, dt)\n")
    command = ("run", "ball.toml", "later.toml", "-j1", "-e", "stopping:Mine", "--dt", "0.01", "-o", "out")
    code, errors = Started(*command, cwd=tmp_path).end()
    assert code == 130
    assert "1 of 2 scenes is kept" in errors
    (tmp_path / "stopping.py").write_text(texts["stopping.py"])
    done = dropspin(*command, "--resume", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "measured again, not resumed: since the interrupted run, the code of stopping changed" in done.stderr


@pytest.mark.parametrize("threads", ["0", "-1", " 00 "])
def test_number_of_threads_below_one_is_refused_in_one_line(threads, tmp_path):
    assert_refused(
        dropspin("list", cwd=tmp_path, NUMBA_NUM_THREADS=threads), f"NUMBA_NUM_THREADS: got {threads!r}; give a whole number above 0"
    )


def test_working_directory_that_was_removed_is_refused_in_one_line(tmp_path):
    """In a process of its own: the command arranges Python's path before anything else."""
    folder = tmp_path / "removed"
    folder.mkdir()
    command = f"rmdir ../removed; exec {shlex.quote(str(DROPSPIN))} list"
    done = subprocess.run(["sh", "-c", command], cwd=folder, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "dropspin: the working directory does not exist any more; change to another one.\n"


def test_limit_of_the_address_space_is_named_in_one_line(tmp_path, monkeypatch):
    """One that is too small for the libraries, and a larger one, with which work fails in any way."""
    for limit, words in (
        (10**8, "limited to 0.093 GiB; raise the limit (ulimit -v); 1 GiB is the least"),
        (2**31, "(RuntimeError: can't start)"),
    ):
        monkeypatch.setattr(resource, "getrlimit", lambda kind, limit=limit: (limit, limit))
        monkeypatch.setattr(listings, "scene_rows", mock.Mock(side_effect=RuntimeError("can't start")))
        done = dropspin("list", cwd=tmp_path)
        assert_refused(done, words)


def test_memory_that_is_short_without_a_limit_is_no_internal_error(tmp_path, monkeypatch):
    monkeypatch.setattr(listings, "scene_rows", mock.Mock(side_effect=MemoryError("Unable to allocate 3 TiB")))
    assert_refused(dropspin("list", cwd=tmp_path), "not enough memory (MemoryError: Unable to allocate 3 TiB).")
