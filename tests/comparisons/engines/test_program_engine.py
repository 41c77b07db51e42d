"""Programs as engines: the documented one in C compared with `wang`, and programs that end, are silent, or answer with something else."""

import os
import re
import shutil
import subprocess
import sys
import time
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
from support.adapter_files import verify_changes_with

import dropspin as ds
from dropspin.comparisons.conformance.checks import conform, run_check
from dropspin.comparisons.engines import program_engine
from dropspin.comparisons.engines.adapter_code import adapter_code
from dropspin.comparisons.engines.program_engine import scene_lines
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.comparisons.running.driving import Breakdown, divergence, try_record
from dropspin.comparisons.running.process_limits import ResourceLimits
from dropspin.comparisons.running.processes import EngineProcesses

DOCS = Path(__file__).parents[3] / "docs"
SPIN, TUMBLE = ds.load("fall-spin"), ds.load("drop-box-tumble")
STATE = "0 0 0 0 0 0 1 0 0 0 0 0 0"
LOOP = "import os, signal, sys, time\nfor line in sys.stdin:\n    word = line.split()[0]\n    if word in ('start', 'advance'): {}\n"


@pytest.fixture(scope="module")
def solver(tmp_path_factory):
    """The engine of the documentation, with its program built beside it."""
    folder = tmp_path_factory.mktemp("course")
    for name in ("solver.c", "solver.py"):
        shutil.copy(DOCS / "course" / name, folder)
    subprocess.run(["cc", "-O2", "-Wall", "-Werror", "-o", folder / "solver", folder / "solver.c", "-lm"], check=True)
    return adapter_in(folder)()


def adapter_in(folder):
    spec = spec_from_file_location("solver_of_the_course", folder / "solver.py")
    module = sys.modules[spec.name] = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Solver


@pytest.mark.parametrize("name", ["drop-box-tumble", "drop-ball-backspin", "drop-box-sticking", "spin-damped"])
def test_program_in_c_has_the_motion_of_wang(solver, name):
    """To 1e-9 of the largest number over 200 steps through impacts and damping, as another order of additions allows."""
    scene = ds.load(name)
    with solver.prepare(scene, 2e-3) as simulation:
        found = simulation.record(200)
    expected = ds.engine("wang").prepare(scene, 2e-3).record(200)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("check", ["repeats", "waiting", "settings", "velocity lag", "gripping corner", "impacts", "later impacts"])
def test_program_in_c_conforms(solver, check):
    found = run_check(EngineEntry(solver.label, solver), check)
    assert found.outcome == "passed", found.message


def program(*command):
    return type("Program", (ds.ProgramEngine,), {"name": "program", "program": command, "__doc__": "A program."})()


def python(answer):
    return program(sys.executable, "-u", "-c", LOOP.format(answer))


@pytest.mark.parametrize(
    ("engine", "verdict", "reason"),
    [
        (
            python("sys.exit('no such body')"),
            "crashed",
            r"the program ended with exit code 1 and the last line 'no such body' instead of answering 'start'",
        ),
        (python("os.kill(os.getpid(), 11)"), "crashed", "the program ended with SIGSEGV instead of answering 'start'"),
        (python("os.kill(os.getpid(), signal.SIGXCPU)"), "timed_out", "did not answer 'start' within the processor time that it may use"),
        (python("os.kill(os.getpid(), signal.SIGRTMIN + 3)"), "crashed", "the program ended with signal 37 instead of answering 'start'"),
        (python("print('hello')"), "crashed", "the program answered 'start' with 'hello', 1 word; a state is a line of 13 numbers"),
        (python("print(line[6:].strip() if word == 'start' else '1 2 3')"), "crashed", "the program answered 'advance 1' with '1 2 3'"),
        (python("print(line[6:].strip() if word == 'start' else 'nan ' * 13)"), "diverged", "the state is not finite"),
        (python("sys.stdout.write(line[6:] + '2\\n')"), "crashed", r"the program wrote '2\\n' before 'advance 1'; an answer is one line"),
        (python(f"print('{STATE}')"), "crashed", "velocity at the start is"),
        (python("os.close(1); time.sleep(9)"), "crashed", "the program closed its output instead of answering 'start'"),
        (program("absent-solver"), "crashed", "'absent-solver' cannot be started: No such file or directory"),
        (program(), "crashed", r'`program` is \(\); give the command and its arguments, such as \("./solver",\)'),
    ],
)
def test_program_that_breaks_costs_its_row(engine, verdict, reason):
    recorded = try_record(engine, SPIN, 0.01)
    found = recorded if isinstance(recorded, Breakdown) else divergence(recorded.motion)
    assert found.verdict == verdict
    assert re.search(reason, found.reason), found.reason


@pytest.mark.parametrize(
    ("answer", "remedy"),
    [
        ("print('hello')", "a state is a line of 13 numbers, in the scene tumbling"),
        ("sys.exit('no body')", ", in the scene tumbling; decline scenes that the engine cannot run, with a reason"),
    ],
)
def test_program_that_prints_text_is_not_told_to_decline_scenes(answer, remedy):
    found = run_check(EngineEntry("program", python(answer)), "builds what is meant")
    assert found.outcome == "failed"
    assert found.message.endswith(remedy), found.message


@pytest.mark.parametrize(("form", "digits"), [("%f", 6), ("%.12f", 12), ("%g", 6), ("%.9g", 9)])
def test_program_that_prints_too_few_digits_is_told_so(form, digits):
    found = run_check(EngineEntry("program", python(f"print(*({form!r} % float(n) for n in line.split()[1:]))")), "builds what is meant")
    assert found.message == f"the start is rounded to {digits} digits; print states with 17 digits, as %.17g does (in the scene tumbling)"


def test_program_that_ends_between_requests_says_how():
    with python("sys.stdout.write(line[6:]); sys.exit(3)").prepare(SPIN, 0.01) as simulation:
        simulation._process.wait()
        with pytest.raises(RuntimeError, match="ended with exit code 3 instead of answering 'advance 1'"):
            simulation.advance(1)


@pytest.mark.parametrize(("last", "reason"), [("", "ended with exit code 1 instead of answering 'advance 1'"), (STATE, None)])
def test_program_that_ends_before_a_child_that_it_forked_is_not_waited_for(last, reason):
    """The child holds the output open. What the program wrote before its end is read."""
    code = f"os.write(1, (line[6:] if word == 'start' else {last!r} + '\\n' * {bool(last)}).encode())\n"
    code += "    if word == 'advance' and os.fork(): os._exit(1)\n    if word == 'advance': time.sleep(8)"
    start = time.monotonic()
    with python(code).prepare(SPIN, 0.01) as simulation:
        if reason is None:
            simulation.advance(1)
            assert simulation.state()[6] == 1.0
        else:
            with pytest.raises(RuntimeError, match=reason):
                simulation.advance(1)
        assert time.monotonic() < start + 7.0  # instead of 8 s


def test_program_that_does_not_answer_is_ended(monkeypatch):
    """It waits for its input, and dropspin for its answer, as when that stays in a buffer."""
    monkeypatch.setattr(program_engine, "PATIENCE", 1.0)
    found = try_record(python("pass"), SPIN, 0.01)
    assert (found.verdict, found.reason) == ("timed_out", "the program did not answer 'start' within 1 s; does it flush its output?")


def test_program_that_does_not_flush_is_waited_for_in_two_checks(monkeypatch):
    """It is the mistake of a beginner, who gets an answer after a few seconds: the other checks are not run."""
    monkeypatch.setattr(program_engine, "PATIENCE", 0.5)
    found = {one.check: one for one in conform(python("print(line[6:].strip()) if word == 'advance' else 0"))}
    late = [
        name for name, one in found.items() if one.message == "the program did not answer 'start' within 0.5 s; does it flush its output?"
    ]
    assert late == ["compilation", "builds what is meant"]
    assert {found[name].outcome for name in late} == {"timed_out"}
    assert found["waiting"].message.startswith("not run, because compilation and builds what is meant used up their time")


def test_program_that_writes_its_answer_slowly_has_the_time_of_an_answer_for_all_of_it(monkeypatch):
    monkeypatch.setattr(program_engine, "PATIENCE", 1.0)
    found = try_record(python("[(print('1', end=' '), time.sleep(0.3)) for _ in range(20)]"), SPIN, 0.01)
    assert found.reason.startswith("the program did not answer 'start' within 1 s")


@pytest.mark.usefixtures("engine_processes")
def test_program_that_hangs_is_waited_for_as_long_as_the_time_limit_says():
    """Not for a second for each of its hundreds of steps, which in a run is much longer than that of all other engines."""
    hanging = python("print(line[6:].strip()) if word == 'start' else time.sleep(1000)")
    with EngineProcesses(ResourceLimits(processor_time=1.0)) as processes:
        found = processes.call(EngineEntry(hanging.label, hanging), run_check, "coasting")
    reason = "the program did not answer 'advance 1' within 1 s, the time limit; does it flush its output?"
    assert (found.outcome, found.message) == ("timed_out", reason)


@pytest.mark.parametrize("name", ["solver", "lib/engine.js"])
def test_engine_of_which_a_file_changed_is_another_engine(tmp_path, name):
    """A run that was interrupted is not resumed with it. The adapter names the program `solver`, which may load scripts."""
    shutil.copy(DOCS / "course" / "solver.py", tmp_path)
    verify_changes_with(adapter_in(tmp_path), tmp_path / name)


def test_program_on_the_search_path_is_identified_by_its_file(tmp_path, monkeypatch):
    """Its version is not that of every other program, and another file of the name is another engine."""
    monkeypatch.setenv("PATH", str(tmp_path / "bin"), prepend=os.pathsep)
    shutil.copy(DOCS / "course" / "solver.py", tmp_path)
    engine, file, versions = adapter_in(tmp_path), tmp_path / "bin" / "my-solver", []
    engine.program = ("my-solver",)
    verify_changes_with(engine, file)
    for comment in ("a", "b", "a"):
        file.write_text(f"#!{sys.executable} -u\n# {comment}\n{LOOP.format('print(line[6:].strip())')}")
        file.chmod(0o755)
        with engine().prepare(SPIN, 0.01) as simulation:
            assert simulation.settings["program"] == "my-solver"
            versions.append(simulation.settings["version"])
    assert versions[0] == versions[2] != versions[1]


@pytest.mark.parametrize("absolute", [False, True])
def test_settings_of_a_program_are_the_same_in_another_folder(tmp_path, absolute):
    """A baseline is checked in another checkout, where its settings are not the cause of a change."""
    found = []
    for folder in (tmp_path / "a", tmp_path / "b"):
        (folder / "lib").mkdir(parents=True)
        shutil.copy(DOCS / "course" / "solver.py", folder)
        script = folder / "lib" / "program.py"
        script.write_text(LOOP.format("print(line[6:].strip())"))
        adapter = adapter_in(folder)
        adapter.program = (sys.executable, "-u", "-W", "ignore::x/y", str(script) if absolute else "./lib/program.py")
        with adapter().prepare(SPIN, 0.01) as simulation:
            found.append(simulation.settings)
    assert found[0] == found[1]
    assert found[0]["program"] == f"{Path(sys.executable).name} -u -W ignore::x/y lib/program.py"


def test_argument_of_a_program_may_be_longer_than_a_path(tmp_path):
    shutil.copy(DOCS / "course" / "solver.py", tmp_path)
    adapter = adapter_in(tmp_path)
    adapter.program = (sys.executable, "-u", "-c", LOOP.format("print(line[6:].strip())") + "#" * 300)
    assert adapter_code(adapter) is not None
    with adapter().prepare(SPIN, 0.01) as simulation:
        assert simulation.settings["program"].endswith("###")


@pytest.mark.parametrize("stated", [{}, {"lag": 0.0}])
def test_lag_of_a_program_is_what_its_class_states(stated):
    """By default that of Algorithm 1."""
    engine = type("Stating", (type(python("print(line[6:].strip())")),), stated)()
    with engine.prepare(SPIN, 0.01) as simulation:
        assert simulation.velocity_lag == stated.get("lag", 0.5) * 0.01


def test_slow_program_is_waited_for(monkeypatch):
    """An interpreted program that takes 30 ms a step, and most of a second for all of them."""
    monkeypatch.setattr(program_engine, "PATIENCE", 0.2)
    answer = f"time.sleep(0.03 * int(line.split()[1]) if word == 'advance' else 0); print('{STATE}')"
    with python(answer).prepare(SPIN, 0.01) as simulation:
        simulation.advance(20)
        assert simulation.state()[6] == 1.0


def test_lines_of_a_scene_are_those_of_the_page():
    """Each word has its row in the table of the page, in the order in which it is sent; the numbers are those of the scene."""
    wall = [{"point": [2.0, 0.0, 0.0], "normal": [-1.0, 0.0, 0.0], "restitution": 0.5, "friction": "infinite"}]
    scene = ds.load(TUMBLE.model_dump(exclude={"expect", "origin"}, exclude_none=True) | {"wall": wall, "damping": {"linear": 2.0}})
    lines = [line.split() for line in scene_lines(scene, 0.5)]
    page = (DOCS / "course.md").read_text(encoding="utf-8")
    documented = re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)
    assert list(dict.fromkeys(words[0] for words in lines if words[0] != "vertex")) == [word for word in documented if word != "advance"]
    numbers = {words[0]: np.array(words[1:], dtype=float) for words in lines}
    np.testing.assert_array_equal(numbers["start"], scene.initial_state)
    np.testing.assert_array_equal(numbers["inertia"], scene.body.inertia_tensor.ravel())
    np.testing.assert_allclose(numbers["damping"], [np.exp(-1.0), 1.0])
    np.testing.assert_array_equal(numbers["wall"], [2.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.5, np.inf, 0.0])
    assert numbers["vertices"] == sum(words[0] == "vertex" for words in lines) == 8
