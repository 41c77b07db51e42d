"""Folders that studies write into, and the tables in them."""

import csv
import json

import pytest
from click.testing import CliRunner

from reports.commands.main import dropspin
from reports.output import folder_made, write_table
from scenarios import DropspinError


@pytest.mark.parametrize("verb", ["limits", "tradeoff"])
@pytest.mark.parametrize("folder", ["taken", "taken/inside", "/proc"])
def test_a_folder_that_cannot_be_written_costs_no_work(verb, folder, tmp_path, monkeypatch):
    """A file, something inside of one, and a folder in which nothing can be made, by nobody."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "taken").write_text("mine")
    done = CliRunner().invoke(dropspin, [verb, "spin-principal", "-e", "mujoco", "-o", folder])
    assert isinstance(done.exception, DropspinError)
    assert f"{folder}: cannot be written: " in str(done.exception)
    assert "running spin-principal" not in done.output
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def test_a_folder_that_stays_empty_goes_again(tmp_path):
    """With those that were made on the way to it; one that holds something stays, and so does what was there before."""
    (tmp_path / "before").mkdir()
    with folder_made(str(tmp_path / "before/new/inside")) as folder:
        assert folder.is_dir()
    assert list(tmp_path.rglob("*")) == [tmp_path / "before"]
    with folder_made(str(tmp_path / "before")):
        pass
    with folder_made(str(tmp_path / "filled/inside")) as folder:
        (folder / "table.csv").touch()
    assert (tmp_path / "before").is_dir()
    assert (tmp_path / "filled/inside/table.csv").exists()


def test_a_table_says_the_same_in_both_forms(tmp_path):
    rows = [{"engine": "a,b", "error": 1e-300, "cost": None}, {"engine": "µ", "error": 0.1, "cost": 2.0}]
    write_table(tmp_path, "made", ["engine", "error", "cost"], rows)
    assert json.loads((tmp_path / "made.json").read_text(encoding="utf-8")) == rows
    with (tmp_path / "made.csv").open(newline="", encoding="utf-8") as file:
        read = list(csv.DictReader(file))
    assert read == [{name: "" if value is None else str(value) for name, value in row.items()} for row in rows]
