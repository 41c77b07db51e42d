"""The command line as a whole: exit codes, errors, interrupts and output streams."""

import io
import os
import signal
import subprocess
import sys
import tomllib
from contextlib import nullcontext
from pathlib import Path
from unittest import mock

import pytest
import yaml
from support.cli import Started, dropspin, spawn

import dropspin as ds
from dropspin.comparisons.judging.verdicts import MARKS
from dropspin.comparisons.limits import study
from dropspin.comparisons.results.interrupts import INTERRUPTS
from dropspin.comparisons.running.process_limits import FIVE_MINUTES, ONE_MINUTE
from dropspin.reports.commands import main as cli
from dropspin.reports.commands.limits import limits_command
from dropspin.reports.commands.run import run_command
from dropspin.reports.terminal import interrupts
from dropspin.reports.terminal.streams import unfailing

ROOT = Path(__file__).parents[3]
HARSH = """
duration = 0.5
[body]
shape = "sphere"
radius = 0.1
mass = 1.0
[start]
position = [0.0, 1.0, 0.0]
[gravity]
acceleration = [0.0, -9.81, 0.0]
[floor]
restitution = 0.6
friction = "none"
[[expect]]
metric = "penetration"
below = 1e-9
reason = "no engine is that stiff"
"""


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("arguments", "code", "output", "error"),
    [
        (["list", "metrics"], 0, "orientation_error", ""),
        (
            ["run", "harsh.toml", "-e", "mujoco", "--dt", "0.01"],
            1,
            "1 of 1 check fails.",
            "timing the steps of each engine\n",
        ),
        (
            ["run", "drop-ball", "-e", "mujoco[solreff=1 2]"],
            2,
            "",
            "dropspin: mujoco's option 'solreff' is unknown. Did you mean 'solref'?",
        ),
        (["conform", "my_engine:Mine"], 3, "", "dropspin: my_engine:Mine needs the module no_such_engine, which is not installed.\n"),
    ],
    ids=[0, 1, 2, 3],
)
def test_exit_codes_of_the_installed_command(arguments, code, output, error, tmp_path):
    """In a process of its own, where an exit code is what a shell sees; output and errors on their own streams.

    A failed check, which is measured, is in this process.
    """
    (tmp_path / "harsh.toml").write_text(HARSH)
    (tmp_path / "my_engine.py").write_text("import no_such_engine")
    done = (dropspin if code == 1 else spawn)(*arguments, cwd=tmp_path)
    assert done.returncode == code, done.stderr
    assert output in done.stdout
    assert done.stderr.startswith(error)
    assert bool(done.stderr) == bool(error)
    assert "Traceback" not in done.stderr + done.stdout


def test_internal_error_is_exit_code_70(tmp_path):
    """With a traceback, which an error report needs."""
    program = "import dropspin, dropspin.reports.stories.listings as listings\nlistings.scene_rows = None\ndropspin.main()"
    command = [sys.executable, "-c", program, "list"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (70, "")
    assert done.stderr.startswith("dropspin: internal error; please report the following output.\nTraceback (most recent call last):\n")
    assert done.stderr.endswith("TypeError: 'NoneType' object is not callable\n")


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
        (["run", "drop-ball", "--dry-run"], "No such option"),
        (["run", "drop-ball", "-o", "."], "the working directory and mount points cannot be replaced"),
        (["run", "drop-ball", "-o", "precious"], "precious: this is a file; choose a folder"),
        (["run", "drop-ball", "-o", "precious/x"], "precious/x: cannot be written"),
        (["run", "drop-ball", "--dt", "1e-310"], "dt: got 1e-310 s"),
        (["run", "drop-ball", "--dt", "0.01", "--dt", "0.01"], "dt: a time step is given twice (0.01, 0.01); give each once."),
        (["run", "x" * 300], "is not in the catalogue"),
        (["show", "drop-ball", "-e", "mujoco", "--dt", "nan"], "dt: got nan s"),
        (["show", "drop-ball", "-e", "mujoco", "--dt", "0"], "dt: got 0.0 s"),
        (["rnu"], "dropspin: command 'rnu' is unknown. Did you mean 'run'?"),
        (["twins", "drop-ball"], "dropspin: twins is now: dropspin symmetries twins."),
        (["compare", "old"], "dropspin: Missing argument 'NEW'. To list the arguments and options: dropspin compare --help"),
        (["show", "drop-bal"], "Did you mean 'drop-ball'?"),
        (["show", "drop-ball", "-e", "x"], "engine 'x' is unknown"),
        (["list", "planets"], "'planets' is not one of"),
    ],
    ids=lambda case: " ".join(case) if isinstance(case, list) else "",
)
def test_bad_usage_is_exit_code_2_and_writes_nothing(arguments, message, tmp_path):
    """The reason is on the standard error, without a traceback."""
    (tmp_path / "precious").write_text("x")
    done = dropspin(*arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    assert [path.name for path in tmp_path.iterdir()] == ["precious"]


@pytest.mark.parametrize("arguments", [(), ("--help",), ("-h",)])
def test_help_lists_every_command(arguments, tmp_path):
    """A line for each, and nothing else looks like a command."""
    done = dropspin(*arguments, cwd=tmp_path)
    assert done.returncode == (0 if arguments else 2)
    listed = (done.stdout + done.stderr).partition("Use:\n")[2]
    names = [line.strip().split("  ")[0] for line in listed.splitlines() if line.startswith("  ") and not line.startswith("   ")]
    assert names == list(cli.COMMANDS)
    assert all(Path(cli.__file__).with_name(f"{name.replace('-', '_').replace(' ', '_')}.py").is_file() for name in names)


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_every_command_has_a_help_page(name, tmp_path):
    done = dropspin(*name.split(), "--help", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stdout.startswith(f"Usage: dropspin {name} ")


def test_version_says_what_to_cite(tmp_path):
    """In the words of CITATION.cff, which has the version, the license and the name of the package."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert {"cff-version", "message", "title", "authors"} <= citation.keys()  # which the format requires
    assert (citation["title"], citation["version"], citation["license"]) == (project["name"], project["version"], project["license"])
    [note] = citation["references"]
    lines = dropspin("--version", cwd=tmp_path).stdout
    for words in (f"{citation['authors'][0]['name']}, dropspin, version {citation['version']}", "Huamin Wang", note["title"]):
        assert words in lines
    assert max(map(len, lines.splitlines())) <= 80


@pytest.mark.extended
@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252"])
def test_terminals_without_utf_8(encoding, tmp_path, monkeypatch):
    """A question mark in place of a character that the terminal lacks; no traceback and no other exit code."""
    monkeypatch.chdir(tmp_path)
    printed = b""
    for arguments in (["run", "spin-principal", "-e", "mujoco", "--dt", "0.01"], ["show", "drop-ball"], ["list", "metrics"]):
        monkeypatch.setattr(sys, "argv", ["dropspin", *arguments])
        for name in ("stdout", "stderr"):
            monkeypatch.setattr(sys, name, io.TextIOWrapper(io.BytesIO(), encoding=encoding))
        handlers = {one: signal.getsignal(one) for one in INTERRUPTS}
        with pytest.raises(SystemExit) as end:
            cli.main()
        for one, handler in handlers.items():
            signal.signal(one, handler)
        sys.stdout.flush()
        printed += sys.stdout.buffer.getvalue()
        assert end.value.code == 0
    assert b"?" in printed


@pytest.mark.parametrize("encoding", ["ascii", "latin-1", "cp1252"])
def test_marks_of_outcomes_stay_different_without_utf_8(encoding):
    """And as wide; any other character becomes a question mark, as the mark of a missing engine is."""
    marks = "".join(dict.fromkeys([*MARKS.values(), "~", "–"]))
    stream = unfailing(io.TextIOWrapper(io.BytesIO(), encoding=encoding))
    stream.write(marks.replace("?", "ω"))
    stream.flush()
    printed = stream.buffer.getvalue().decode(encoding)
    assert len(set(printed)) == len(printed) == len(marks)
    assert printed[marks.index("?")] == "?"


@pytest.mark.extended
def test_a_terminal_without_utf_8_in_a_process_of_its_own(tmp_path):
    done = spawn("show", "drop-ball", cwd=tmp_path, PYTHONIOENCODING="ascii", PYTHONUTF8="0")
    assert done.returncode == 0, done.stderr
    assert "?" in done.stdout


@pytest.mark.sample(1)
@pytest.mark.usefixtures("engine_processes")
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
def test_an_interrupted_run_leaves_nothing(how, tmp_path):
    """Ctrl-C, or SIGTERM from a CI server: exit code 130, no folder, no traceback."""
    (tmp_path / "long.toml").write_text('duration = 10.0\n[body]\nshape = "sphere"\nradius = 0.1\nmass = 1.0\n')
    process = Started("run", "long.toml", "-e", "mujoco", "--dt", "0.01", "--dt", "0.00003", cwd=tmp_path)
    assert process.stderr.readline() == "timing the steps of each engine\n"
    code, errors = process.end(how)
    assert code == 130
    assert errors.splitlines()[-1] == "dropspin: interrupted; nothing was written."
    assert "Traceback" not in errors
    assert os.listdir(tmp_path) == ["long.toml"]


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="Windows has no SIGHUP")
def test_the_end_of_the_terminal_is_an_interrupt_unless_it_is_ignored(monkeypatch):
    """As nohup ignores it."""
    monkeypatch.setattr(interrupts, "_interrupts", [])
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    before = {one: signal.getsignal(one) for one in INTERRUPTS}
    try:
        for handler in (signal.SIG_IGN, signal.SIG_DFL):
            signal.signal(signal.SIGHUP, handler)
            interrupts.handle_interrupts()
            with pytest.raises(KeyboardInterrupt) if handler is signal.SIG_DFL else nullcontext():
                signal.raise_signal(signal.SIGHUP)
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
    assert interrupts._interrupts == [signal.SIGHUP]


def test_an_interrupt_that_becomes_another_error_is_an_interrupt(monkeypatch, tmp_path):
    """As in compiled code: `import mujoco` turns it into an ImportError."""
    monkeypatch.setattr("dropspin.reports.terminal.interrupts._interrupts", [signal.SIGINT])
    monkeypatch.setattr("dropspin.comparisons.engines.registry.import_module", mock.Mock(side_effect=ImportError("initialization failed")))
    done = dropspin("show", "drop-ball", "-e", "mujoco", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (130, "dropspin: interrupted; nothing was written.\n")


@pytest.mark.parametrize("verb", ["run", "sweep"])
def test_an_interrupt_that_is_swallowed_still_stops_the_command(verb, tmp_path, monkeypatch):
    """A callback of an engine or of the compiler may swallow the exception; the next step of the work raises it again."""
    (tmp_path / "spec.toml").write_text('scenes = ["drop-ball"]\nengines = ["mujoco"]\ndts = [0.004]\n')
    monkeypatch.setattr("dropspin.reports.terminal.interrupts._interrupts", [signal.SIGINT])
    given = ["spec.toml"] if verb == "sweep" else ["spin-principal", "-e", "mujoco", "--dt", "0.01"]
    done = dropspin(verb, *given, "-o", "out", cwd=tmp_path)
    assert done.returncode == 130
    kept = "0 of 1 jobs are kept; --resume continues the sweep" if verb == "sweep" else "nothing was written"
    assert done.stderr.splitlines()[-1] == f"dropspin: interrupted; {kept}."
    assert os.listdir(tmp_path) == ["spec.toml"]


def test_defaults_of_options_are_those_of_the_library():
    """Options state their defaults as numbers, because `--help` imports no library."""
    limits = {option.name: option.default for option in limits_command.params}
    run = {option.name: option for option in run_command.params}
    assert (limits["dt"], limits["within"], limits["resources"]) == (study.DT, study.WITHIN, ONE_MINUTE.processor_time)
    assert run["resources"].default == FIVE_MINUTES.processor_time
    assert run["dts"].help.endswith(f"[default: {', '.join(map(str, ds.DEFAULT_DTS))}]")
