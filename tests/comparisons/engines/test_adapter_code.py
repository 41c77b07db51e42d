"""The hash of a built-in adapter: its file, those of its folder that it imports, directly or not, and others of the same names."""

from pathlib import Path

import pytest

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
        *((f"{file.stem.rpartition('_')[0]}_engine.py", file.name) for file in sorted(HERE.glob("*.toml"))),
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
