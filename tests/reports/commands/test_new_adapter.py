"""`dropspin new-adapter`: the files that it writes work as they are, and names that cannot work are refused."""

import pytest
from support.cli import assert_refused, dropspin

from dropspin import pytest_plugin

pytest_plugins = ["pytester"]


@pytest.mark.extended
def test_written_adapter_passes_the_written_tests(pytester, monkeypatch):
    """They check conformance and that errors vanish as dt → 0, also in another folder and under a name with several words."""
    done = dropspin("new-adapter", "wobbly_Top2", "-o", "deep/er", cwd=pytester.path)
    assert done.returncode == 0, done.stderr
    assert "in deep/er: dropspin conform wobbly_Top2:WobblyTop2; pytest test_wobbly_Top2.py\n" in done.stdout
    folder = pytester.path / "deep" / "er"
    assert sorted(path.name for path in folder.iterdir()) == ["test_wobbly_Top2.py", "wobbly_Top2.py"]
    monkeypatch.chdir(folder)
    monkeypatch.setattr(pytest_plugin.Runs, "dropspin", lambda runs, *arguments: dropspin(*arguments, cwd=folder))
    tested = pytester.runpytest_inprocess("-q", "-k", "conforms or drop-ball-wobbly", "test_wobbly_Top2.py")
    tested.assert_outcomes(passed=2, deselected=2)
    [row] = [line for line in tested.outlines if line.startswith("wobbly-Top2")]
    assert row.split()[1] == "drop-ball"


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("3d", "got '3d'; give a name for a Python module, such as my_engine"),
        ("my-engine", "got 'my-engine'; give a name for a Python module"),
        ("../stray", "give a name for a Python module"),
        ("lambda", "give a name for a Python module"),
        ("moteur_à_balles", "give a name for a Python module"),
        ("x" * 61, "at most 60 characters"),
        ("mujoco_warp", "'mujoco_warp', which is already the name of an engine; choose another one, such as mujoco_warp_adapter."),
        ("wang", "already the name of an engine"),
        ("json", "'json', which is already the name of an importable module; choose another one, such as json_adapter."),
        ("dropspin", "already the name of an importable module"),
    ],
)
def test_names_that_cannot_work_are_refused(name, message, tmp_path):
    assert_refused(dropspin("new-adapter", name, cwd=tmp_path), message)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("taken", ["mine.py", "test_mine.py", "mine"])
def test_nothing_is_overwritten(taken, tmp_path):
    """Nor is a module written that a folder of the same name may hide."""
    (tmp_path / taken).write_text("precious")
    assert_refused(
        dropspin("new-adapter", "mine", cwd=tmp_path), f"{taken}: exists already; choose another name, or another folder with -o."
    )
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [(taken, "precious")]


@pytest.mark.parametrize("folder", ["/proc/x", "file", "file/deeper"])
def test_a_folder_that_cannot_be_written_is_refused(folder, tmp_path):
    (tmp_path / "file").write_text("precious")
    assert_refused(dropspin("new-adapter", "mine", "-o", folder, cwd=tmp_path), f"{folder}: cannot be written: ")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
