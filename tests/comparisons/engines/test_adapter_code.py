"""The hash of an adapter's code.

Of a built-in one: its file, those of its folder that it imports, directly or not, and others of the same names. Of others also the
libraries in and below the folder of the file, or the files that the adapter names.
"""

import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest
from support.adapter_files import verify_changes_with

import dropspin as ds
from dropspin.comparisons.engines import adapter_code as code
from dropspin.comparisons.engines import base
from dropspin.comparisons.engines.adapter_code import built_in_code

HERE = Path(base.__file__).parent


def _copied(folder):
    for file in HERE.glob("*.*"):
        (folder / file.name).write_bytes(file.read_bytes())


@pytest.mark.parametrize(
    ("adapter", "changed"),
    [
        ("rapier_js_engine.py", "rapier_js_engine.cjs"),
        ("rapier_js_engine.py", "node_process.cjs"),
        ("rapier_js_engine.py", "rapier_scenes.py"),
        ("mujoco_engine.py", "mujoco_engine.py"),
        ("mjx_engine.py", "mujoco_model.py"),
        *((f"{file.stem.rpartition('_')[0]}_engine.py", file.name) for file in sorted(HERE.glob("*_*.toml"))),
    ],
)
def test_a_changed_file_of_an_adapter_is_another_engine(tmp_path, adapter, changed):
    _copied(tmp_path)
    before = built_in_code(tmp_path / adapter)
    (tmp_path / changed).write_bytes(b"# changed\n" + (tmp_path / changed).read_bytes())
    assert built_in_code(tmp_path / adapter) != before


@pytest.mark.parametrize(
    ("adapter", "changed"),
    [
        ("rapier_engine.py", "rapier_js_engine.py"),
        ("rapier_js_engine.py", "cannon_es_engine.cjs"),
        ("mujoco_engine.py", "mujoco_warp_engine.py"),
        ("mujoco_engine.py", "base.py"),
    ],
)
def test_a_changed_file_of_another_engine_is_the_same(tmp_path, adapter, changed):
    _copied(tmp_path)
    before = built_in_code(tmp_path / adapter)
    (tmp_path / changed).write_bytes(b"# changed\n" + (tmp_path / changed).read_bytes())
    assert built_in_code(tmp_path / adapter) == before


def adapter_in(folder, **stated):
    """A class of an adapter in a file of a folder."""
    file = folder / "mine.py"
    file.write_text("import dropspin as ds\nclass Mine(ds.Engine):\n    name = 'mine'\n    prepare = None\n")
    spec = spec_from_file_location(f"mine_{folder.name}", file)
    module = sys.modules[spec.name] = module_from_spec(spec)
    spec.loader.exec_module(module)
    for name, value in stated.items():
        setattr(module.Mine, name, value)
    return module.Mine


@pytest.mark.parametrize(
    ("changed", "code_files", "changes"),
    [
        ("engine.so", None, True),
        ("libengine.so.1", None, True),
        ("build/libengine.so.1.2", None, True),
        ("build/engine.dylib", None, True),
        ("build/engine.js", None, False),  # a program in another language may load it, see test_program_engine.py
        ("build/engine.json", None, False),
        ("node_modules/engine/engine.so", None, False),
        (".cache/engine.so", None, False),
        ("../build/engine.bin", ("../build/*.bin", "mine.py"), True),
        ("data/deep/engine.json", ("**/*.json",), True),
        ("engine.so", ("mine.py",), False),
    ],
)
def test_libraries_below_an_adapter_or_the_files_that_it_names_belong_to_it(tmp_path, changed, code_files, changes):
    """An interrupted run is not resumed with another library, wherever below the adapter it lies."""
    folder = tmp_path / "adapter"
    folder.mkdir()
    verify_changes_with(adapter_in(folder, code_files=code_files), folder / changed, changes)


@pytest.mark.parametrize(
    ("code_files", "message"),
    [
        (("absent.so",), r"Mine\.code_files: no file 'absent\.so' in .*; paths are relative to this folder\."),
        ("mine.py", r"Mine\.code_files is 'mine\.py'; give a sequence of strings"),
        ((Path("mine.py"),), r"Mine\.code_files is .*; give a sequence of strings"),
    ],
)
def test_files_that_cannot_be_told_are_refused(tmp_path, code_files, message):
    with pytest.raises(ds.DropspinError, match=message):
        code.adapter_code(adapter_in(tmp_path, code_files=code_files))


@pytest.mark.parametrize("most", [{"MOST_ENTRIES": 4}, {"MOST_BYTES": 4 << 20}], ids=["many entries", "large files"])
def test_below_a_large_folder_no_file_belongs_to_an_adapter(tmp_path, monkeypatch, most):
    """Such as a home folder; a library that is a loop of links is none."""
    for name, value in most.items():
        monkeypatch.setattr(code, name, value)
    (tmp_path / "build").mkdir()
    for number in range(3):
        (tmp_path / "build" / f"{number}.so").write_bytes(b"0" * (2 << 20))
    (tmp_path / "loop.so").symlink_to("loop.so")
    adapter = adapter_in(tmp_path)
    verify_changes_with(adapter, tmp_path / "build" / "0.so", False)
    verify_changes_with(adapter, tmp_path / "own.so", True)


def test_library_that_an_engine_builds_below_its_folder_ends_no_command(tmp_path):
    """The code with which a command begins is that of the modules; a later command finds another engine."""
    adapter = adapter_in(tmp_path)
    before = code.adapter_code(adapter), code.adapter_code(adapter, with_below=False)
    (tmp_path / "build").mkdir()
    (tmp_path / "build" / "engine.so").write_bytes(b"built")
    after = code.adapter_code(adapter), code.adapter_code(adapter, with_below=False)
    assert after[0] != before[0]
    assert after[1] == before[1]
