"""Output folders of studies, and the tables in them."""

import csv
import json
from concurrent.futures import ThreadPoolExecutor
from time import sleep

import pytest
from support.cli import dropspin

from dropspin.comparisons.results.complete_folders import one_at_a_time, study_folder, written_whole
from dropspin.reports.output import write_table


@pytest.mark.parametrize("verb", ["limits", "tradeoff"])
@pytest.mark.parametrize("folder", ["taken", "taken/inside", "/proc"])
def test_an_output_folder_that_cannot_be_written_fails_before_the_work(verb, folder, tmp_path):
    """A file, a path inside a file, and a folder in which nobody can create files."""
    (tmp_path / "taken").write_text("mine")
    done = dropspin(verb, "spin-principal", "-e", "mujoco", "-o", folder, cwd=tmp_path)
    assert done.returncode == 2
    assert f"dropspin: {folder}: cannot be written: " in done.stderr
    assert "working on spin-principal" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_an_output_folder_that_stays_empty_is_removed(tmp_path):
    """With the parents that were created for it; a folder that holds a file stays, and so does one that existed before."""
    (tmp_path / "before").mkdir()
    with study_folder(str(tmp_path / "before/new/inside")) as folder:
        assert folder.is_dir()
    assert list(tmp_path.rglob("*")) == [tmp_path / "before"]
    with study_folder(str(tmp_path / "before")):
        pass
    with study_folder(str(tmp_path / "filled/inside")) as folder:
        (folder / "table.csv").touch()
    assert (tmp_path / "before").is_dir()
    assert (tmp_path / "filled/inside/table.csv").exists()


def test_a_table_is_the_same_as_csv_and_as_json(tmp_path):
    rows = [{"engine": "a,b", "error": 1e-300, "cost": None}, {"engine": "µ", "error": 0.1, "cost": 2.0}]
    write_table(tmp_path, "made", rows)
    assert json.loads((tmp_path / "made.json").read_text(encoding="utf-8")) == rows
    with (tmp_path / "made.csv").open(newline="", encoding="utf-8") as file:
        read = list(csv.DictReader(file))
    assert read == [{name: "" if value is None else str(value) for name, value in row.items()} for row in rows]


def test_interrupted_file_leaves_the_old_one(tmp_path):
    file = tmp_path / "page.html"
    file.write_text("old")

    def write():
        with written_whole(file) as unfinished:
            unfinished.write_text("half a")
            assert file.read_text() == "old"
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write()
    assert file.read_text() == "old"
    assert [one.name for one in tmp_path.iterdir()] == ["page.html"]


def test_folder_of_a_study_replaces_that_of_an_earlier_one(tmp_path):
    for name in ("early", "late"):
        with study_folder(str(tmp_path)) as folder:
            (folder / "scenes").mkdir()
            (folder / "scenes" / f"{name}.toml").touch()
    assert [path.name for path in (tmp_path / "scenes").iterdir()] == ["late.toml"]


def test_commands_that_change_a_file_take_turns(tmp_path):
    """Each adds a line to what it read before; without turns, most lines are lost."""
    path = tmp_path / "baseline.toml"
    path.touch()

    def add(line):
        with one_at_a_time(path):
            before = path.read_text()
            sleep(0.01)
            path.write_text(f"{before}{line}\n")

    with ThreadPoolExecutor(8) as workers:
        list(workers.map(add, range(8)))
    assert sorted(path.read_text().split()) == [str(line) for line in range(8)]
    assert list(tmp_path.iterdir()) == [path]
