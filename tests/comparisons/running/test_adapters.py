"""Adapters that return, raise or do what the protocol does not have cost their own rows, and nothing of them stays."""

import importlib.util
import os
import sys
import time
from pathlib import Path

import pytest
from support.adapters import DRIFTING

import dropspin as ds
from dropspin.comparisons.running.process_limits import ResourceLimits

DRIFT = {"name": "drift", "duration": 0.1, "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0}, "start": {"velocity": [1.0, 0.0, 0.0]}}
LIMITS = ResourceLimits(processor_time=1.0, memory=2**30)
SOUND = "import os, sys, time\nimport numpy as np\nfrom dropspin import KnownLimitation\n" + DRIFTING
DEEP = "settings = []\nfor _ in range(100_000): settings = [settings]\nDrifting.settings = {'deep': settings}"
CYCLE = "settings = {}\nsettings['itself'] = settings\nDrifting.settings = settings"
PRINTED = """
class Silent(Exception):
    def __str__(self):
        raise RuntimeError
Mine.declines = lambda self, scene: (_ for _ in ()).throw(Silent())
"""


def constructor(body):
    """An adapter whose constructor does something."""
    return f"Mine.__init__ = lambda self, options={{}}: {body}"


RETURNED = [
    ("Mine.order = 'four'", "order is 'four'"),
    ("Mine.order_in = lambda self, scene: float('nan')", "order is nan"),
    ("Mine.precision = 'double'", "precision is 'double'"),
    ("Mine.discretisation = lambda self, scene: 3", "discretisation() is 3"),
    ("Mine.predicted_error = lambda self, scene, truth, metric, dt: 'small'", "the predicted error of"),
    ("Mine.declines = lambda self, scene: True", "the answer of declines() is True"),
    ("Mine.declines = lambda self, scene: 'x' * 10**6", "at most 1000 characters"),
    ("Mine.declines = lambda self, scene: 'a lone \\ud800'", "printable text"),
    ("Drifting.settings = {'f': lambda: 0}", "settings cannot be stored as JSON: TypeError"),
    ("Drifting.settings = {(1, 2): 3}", "settings cannot be stored as JSON: TypeError"),
    ("Drifting.settings = {'n': 10**5000}", "settings cannot be stored as JSON: ValueError"),
    ("Drifting.settings = {'s': '\\ud800'}", "settings cannot be stored as JSON: Unicode"),
    ("Drifting.settings = {'s': 'x' * 10**6}", "longer than 100000 bytes"),
    ("Drifting.settings = {'deep': " + "[" * 50 + "]" * 50 + "}", "nested more than 20 deep"),
    ("Drifting.settings = 7", "settings cannot be stored as JSON: TypeError"),
    (CYCLE, "settings cannot be stored as JSON: ValueError"),
    (DEEP, "settings cannot be stored as JSON: RecursionError"),
    ("Drifting.known_limitations = [KnownLimitation(b'bytes')]", "known_limitations has"),
    ("Drifting.known_limitations = [KnownLimitation('x', {'drift': 'y'})]", "known_limitations: drift is 'y'"),
    ("Drifting.known_limitations = ['\\ud800']", "printable text"),
    ("Drifting.known_limitations = ['red \\x1b[31m']", "printable text"),
    ("Drifting.velocity_lag = 'half'", "velocity_lag is 'half'"),
    ("Drifting.state = lambda self: None", "the state has shape (), not (13,)"),
    ("Drifting.record = lambda self, steps, every=1: 'rows'", "ValueError"),
    ("Mine.prepare = lambda self, scene, dt: None", "prepare() returns None"),
    ("Mine.prepare = lambda self, scene, dt: os._exit(0)", "its process exited with code 0"),
    ("Mine.prepare = lambda self, scene, dt: (_ for _ in ()).throw(SystemExit(0))", "SystemExit: 0"),
    ("Drifting.advance = lambda self, steps: bytearray(2**34)", "MemoryError: (the engine's process may not use more memory)"),
    (PRINTED, "Silent: its text cannot be made, RuntimeError"),
]
CONSTRUCTED = [
    ("raise ImportError('libGL.so.1: no such file')", "cannot be imported: ImportError: libGL.so.1: no such file"),
    ("raise KeyboardInterrupt", "KeyboardInterrupt"),
    ("os._exit(7)", "its process ended with exit code 7"),
    ("while True: pass", "not done after"),
    (constructor("os._exit(0)"), "its process exited with code 0"),
    (constructor("[None for _ in iter(int, 1)]"), "not done after"),
    (constructor("(_ for _ in ()).throw(GeneratorExit())"), "GeneratorExit"),
    (constructor("1 / 0"), "cannot be constructed: ZeroDivisionError"),
    ("Mine.label = property(lambda self: 'other')", "its label is 'other'; it must be 'mine'"),
    ("Mine.choices = {'a': ('b\\nc', 'd')}", "must be one line of printable text"),
    ("Mine.choices = {'a': 'bc'}", "choices.a: got 'bc'"),
    ("Mine.numbers = {'a': 3}", "numbers.a: got 3"),
]


def run(monkeypatch, folder, extra, name="mine"):
    """The rows of an adapter with some extra code, beside the reference implementation."""
    (folder / f"{name}.py").write_text(f"{SOUND}\n{extra}\n")
    monkeypatch.chdir(folder)
    return ds.run(DRIFT, [f"{name}:Mine", "wang"], 1e-2, resources=LIMITS)


def judged(found, engine):
    return {(row["verdict"], row["reason"]) for row in found.table.to_dict("records") if row["engine"] == engine}


def test_texts_of_an_adapter_over_several_lines_become_one(tmp_path, monkeypatch):
    """In a table, on a terminal and in a report each has one line."""
    found = run(monkeypatch, tmp_path, "Mine.declines = lambda self, scene: 'has\\n  no\\tfloor'")
    assert judged(found, "mine") == {("declined", "has no floor")}


def test_sound_adapter_is_measured_and_leaves_nothing_in_this_process(tmp_path, monkeypatch):
    modules, path = set(sys.modules), list(sys.path)
    found = run(monkeypatch, tmp_path, "sys.modules['numpy'].sum = None")
    assert found.exit_code() == 0
    assert "mine" in found.engines
    assert "mine" not in set(sys.modules) - modules
    assert sys.path == path


@pytest.mark.sample(1)
@pytest.mark.parametrize(("extra", "reason"), RETURNED, ids=range(len(RETURNED)))
def test_wrong_answers_of_an_adapter_cost_its_own_row(extra, reason, tmp_path, monkeypatch):
    found = run(monkeypatch, tmp_path, extra)
    [(verdict, text)] = judged(found, "mine")
    assert verdict == "crashed"
    assert reason in text
    assert found.exit_code() == 3
    assert all(verdict in ("passed", "measured") for verdict, _ in judged(found, "wang"))


@pytest.mark.sample(1)
@pytest.mark.parametrize(("extra", "reason"), CONSTRUCTED, ids=range(len(CONSTRUCTED)))
def test_adapter_that_cannot_be_constructed_is_broken(extra, reason, tmp_path, monkeypatch):
    found = run(monkeypatch, tmp_path, extra)
    [(verdict, text)] = judged(found, "mine:Mine")
    assert verdict == "broken"
    assert reason in text
    assert found.exit_code() == 3
    assert all(verdict in ("passed", "measured") for verdict, _ in judged(found, "wang"))


@pytest.mark.skipif(not Path("/proc").exists(), reason="the processes are looked for in /proc")
def test_children_of_an_adapter_end_with_it(tmp_path, monkeypatch):
    run(monkeypatch, tmp_path, "import subprocess\nsubprocess.Popen(['sleep', '86399'])")
    deadline = time.monotonic() + 10.0
    while sleepers() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not sleepers()


def sleepers():
    found = []
    for one in Path("/proc").iterdir():
        try:
            found += [one.name] if b"86399" in (one / "cmdline").read_bytes() else []
        except OSError:  # not a process, or one that has ended
            continue
    return found


@pytest.mark.extended
def test_adapter_that_changes_during_a_run_is_not_mixed_with_itself(tmp_path, monkeypatch):
    """It is imported again after it crashed; by then its file is another."""
    extra = "Mine.prepare = lambda self, scene, dt: (open('mine.py', 'a').write('\\nchanged = True'), os._exit(1))"
    found = run(monkeypatch, tmp_path, extra)
    assert judged(found, "mine") == {("crashed", "its process ended with exit code 1")}
    other = ds.run([DRIFT, DRIFT | {"name": "again"}], "mine:Mine", 1e-2, resources=LIMITS).table
    reasons = other.set_index("scene")["reason"]
    assert "the code of mine:Mine is not that with which the command began" in reasons["again"]


@pytest.mark.extended
def test_code_of_an_adapter_is_that_of_all_modules_it_loads(tmp_path, monkeypatch):
    """Of those that it imports in functions, by relative imports, and by computed names; not of installed ones."""
    package = tmp_path / "pack"
    package.mkdir()
    (package / "__init__.py").write_text("")
    texts = {"near.py": "import pack.deep", "deep.py": "x = 1", "late.py": "y = 1", "named.py": "z = 1", "unused.py": "u = 1"}
    for name, text in texts.items():
        (package / name).write_text(text)
    extra = """
from . import near
import importlib
importlib.import_module('pack.' + 'named')
def later():
    from .late import y
"""
    (package / "mine.py").write_text(f"{SOUND}\n{extra}")
    monkeypatch.chdir(tmp_path)

    def code():
        return ds.run(DRIFT, "pack.mine:Mine", 1e-2).provenance["adapters"]["mine"]

    before = code()
    assert code() == before
    seen = {}
    for name, text in {**texts, "__init__.py": "", "mine.py": f"{SOUND}\n{extra}"}.items():
        (package / name).write_text(f"{text}\n# changed\n")
        seen[name] = code()
        (package / name).write_text(text)
    assert {name for name, found in seen.items() if found == before} == {"unused.py"}


def test_working_directory_is_importable_for_named_engines_only(tmp_path, monkeypatch):
    (tmp_path / "stray_of_mine.py").write_text("raise SystemExit('a stray was imported')")
    found = run(monkeypatch, tmp_path, "import helper_of_mine" if (tmp_path / "helper_of_mine.py").write_text("x = 1") else "")
    assert judged(found, "mine")
    assert importlib.util.find_spec("stray_of_mine") is None
    assert os.getcwd() == str(tmp_path)
