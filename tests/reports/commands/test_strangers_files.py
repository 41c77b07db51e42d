"""Studies, sweeps and baselines of somebody else, and the names in runs: refused in one line, or written as text only."""

import json
import os
import re
import shutil

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.cli import assert_refused, dropspin
from support.run_folders import change_json, change_table, contents

from dropspin.comparisons.running.run import run
from dropspin.comparisons.sweeps.folder import read_sweep
from dropspin.comparisons.sweeps.running import run_sweep
from dropspin.comparisons.sweeps.spec import load_sweep
from dropspin.comparisons.tradeoff.ladder import Ladder
from dropspin.comparisons.tradeoff.pareto import CostPoint, TradeOff
from dropspin.reports.run_folder import write_report
from dropspin.reports.stories.tradeoff import TradeOffs
from dropspin.scenarios import DropspinError, load

DEEP = "[" * 5000 + "]" * 5000


@pytest.mark.extended
@pytest.mark.parametrize("name", ["../../stray", "/tmp/dropspin-stray", "..", "a/b", "x" * 300, "<img src=x onerror=alert(1)>"])
def test_history_writes_only_into_its_folder(name, small, tmp_path):
    """A scene's name is no path; every picture has its place, and the page names it."""
    spin = load("spin-principal").model_dump(exclude_none=True, exclude={"expect"}) | {"duration": 0.2, "name": name}
    write_report(run(spin, "mujoco", 1e-2), tmp_path / "runs" / "one")
    shutil.copytree(tmp_path / "runs" / "one", tmp_path / "runs" / "two")
    before = contents(tmp_path)
    assert dropspin("compare", "history", "runs", "-o", "deep/er/out", cwd=tmp_path).returncode == 0
    written = contents(tmp_path).keys() - before.keys()
    assert {path.rpartition("/")[0] for path in written} == {"deep/er/out"}
    [picture] = [path.rpartition("/")[2] for path in written if path.endswith(".svg")]
    page = (tmp_path / "deep/er/out/history.md").read_text()
    assert f"]({picture})" in page
    assert "<img" not in page.replace("\\<", "")


@pytest.mark.sample(1)
@pytest.mark.parametrize("verb", [("compare", "good", "run"), ("compare", "history", "good", "run", "-o", "out")])
def test_settings_are_printed_without_control_characters(verb, small_folder, copied, tmp_path):
    """They are what an engine's adapter reported: their names and values may be of any characters."""
    shutil.copytree(small_folder, tmp_path / "good")

    def change(content):
        for settings in content["provenance"]["settings"]["mujoco"].values():
            settings |= {"version": "\x1b[2J", "\x1b[3J": "\x1b[4J"}

    change_json(copied, change)
    change_table(copied, lambda frame: frame.assign(value=frame["value"] + 1.0))
    done = dropspin(*verb, cwd=tmp_path)
    assert done.returncode in (0, 1), done.stderr
    assert "\\u001b[2J" in done.stdout
    assert not any("\x1b" in text for text in (done.stdout, done.stderr))


def study(scene=(), ladder=(), **point):
    """A study of one engine at one time step, with changes to its scene, its ladder of time steps, and its configuration."""
    found = TradeOff(
        load("spin-principal"),
        "orientation_error",
        (CostPoint("<b>", 0.01, 1e-3, np.array([1.0, 2.0, 3.0])),),
        (Ladder("<b>", ((0.01, 1e-3),), "budget", "it was spent"),),
    )
    content = TradeOffs(scenes=[found], within=[1e-2]).model_dump(mode="json")
    [stored] = content["scenes"]
    stored["points"][0] |= point
    stored["ladders"][0] |= dict(ladder)
    stored |= dict(scene)
    return content


def test_study_of_a_stranger_is_added_as_text(copied, tmp_path):
    """The reference of the refused ones."""
    (tmp_path / "section.json").write_text(json.dumps(study()))
    assert dropspin("report", "run", "--add", ".", cwd=tmp_path).returncode == 0
    page = (copied / "report.html").read_text().replace("\xa0", " ")
    assert "spin-principal, orientation error within 0.01 rad: &lt;b&gt; at 10 ms, 2 s per simulated second." in page
    assert "<b>" not in page


@pytest.mark.parametrize(
    "content",
    [
        "",
        "[]",
        DEEP,
        '{"title": "t", "parts": []}',
        '{"study": "run"}',
        *(
            json.dumps(changed)
            for changed in (
                study() | {"study": "limits"},
                study() | {"svg": "<svg onload=alert(1)>"},
                study() | {"within": "all"},
                study(scene={"points": []}),
                study(scene={"metric": "beauty"}),
                study(scene={"scene": {"duration": 1.0}}),
                study(scene={"worlds": [{}]}),
                study(ladder={"ended": "soon"}),
                study(cost="1.0"),
                study(cost=["a"]),
                study(cost=[]),
                study(error="Infinity"),
                study(error=None),
                study(dt="NaN"),
            )
        ),
    ],
)
def test_study_of_anything_else_is_refused(content, copied, tmp_path):
    (tmp_path / "section.json").write_text(content)
    before = contents(tmp_path)
    assert_refused(dropspin("report", "run", "--add", ".", cwd=tmp_path), "has no study, or a damaged one (section.json: ")
    assert contents(tmp_path) == before


@pytest.mark.extended
def test_names_of_runs_are_printed_without_control_characters(small_folder, tmp_path):
    """The name of a folder may be of any characters, and be no text."""
    for name in (b"one\x1b[2J", b"two\xff"):
        shutil.copytree(small_folder, tmp_path / "runs" / os.fsdecode(name))
    done = dropspin("compare", "history", "runs", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "one\\u001b[2J" in (tmp_path / "out/history.csv").read_text(encoding="utf-8") + (tmp_path / "out/history.md").read_text(
        encoding="utf-8"
    )
    assert not any("\x1b" in text for text in (done.stdout, done.stderr, *map(bytes.decode, contents(tmp_path / "out").values())))


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """A sweep of two jobs."""
    where = tmp_path_factory.mktemp("sweep") / "out"
    spec = {"scenes": ["drop-ball"], "engines": ["wang"], "dts": [4e-3], "grid": {"floor.restitution": [0.2, 0.4]}}
    run_sweep(load_sweep(spec), str(where))
    return where


def sweep_table(change=lambda table: table, **columns):
    """Change the table of a part, or replace columns by one value each."""

    def damage(part):
        table = change(pq.read_table(part))
        for name, value in columns.items():
            old = table.schema.get_field_index(name)
            table = (table.remove_column(old) if old >= 0 else table).append_column(name, pa.array([value] * len(table)))
        pq.write_table(table, part)

    return damage


@pytest.mark.parametrize(
    "damage",
    [
        lambda part: part.write_bytes(b""),
        lambda part: part.write_bytes(b"PAR1PAR1"),
        lambda part: part.write_bytes(part.read_bytes()[:-40] + b"\xff" * 40),
        lambda part: pd.DataFrame({"x": [1]}).to_parquet(part),
        sweep_table(verdict="fine"),
        sweep_table(engine=1.0),
        sweep_table(steps="many"),
        sweep_table(job=1),
        sweep_table(lambda table: table[:1]),
        sweep_table(lambda table: table.take([0, 1, 1])),
        lambda part: (part.unlink(), os.mkfifo(part)),
        lambda part: (part.unlink(), part.mkdir()),
    ],
)
def test_damaged_part_of_a_sweep_is_refused(damage, sweep, tmp_path):
    copied = shutil.copytree(sweep, tmp_path / "out")
    [part] = copied.rglob("*.parquet")
    damage(part)
    with pytest.raises(DropspinError, match=r"\.parquet: is damaged; delete it, and run its jobs again with --resume\.$"):
        read_sweep(str(copied))


def test_part_of_another_sweep_is_refused(sweep, tmp_path):
    """Its columns are those of a sweep, and not of this one."""
    copied = shutil.copytree(sweep, tmp_path / "out")
    [part] = copied.rglob("*.parquet")
    _, second, identity = part.name.split("-")
    other = shutil.copy(part, part.with_name(f"{second}-{int(second) + 2:016d}-{identity}"))
    sweep_table(lambda table: table.set_column(0, "job", pa.array([2, 3])))(other)
    assert list(read_sweep(str(copied))["job"]) == [0, 1, 2, 3]
    sweep_table(other=1.0)(other)
    with pytest.raises(DropspinError, match="has other columns than"):
        read_sweep(str(copied))


def test_changed_part_with_the_columns_of_a_sweep_is_read(sweep, tmp_path):
    """The reference of the refused ones."""
    copied = shutil.copytree(sweep, tmp_path / "out")
    [part] = copied.rglob("*.parquet")
    sweep_table(verdict="passed")(part)
    assert list(read_sweep(str(copied))["verdict"]) == ["passed"] * 2


def test_description_of_a_sweep_that_is_a_pipe_is_refused(sweep, tmp_path):
    """Reading it would block for ever."""
    copied = shutil.copytree(sweep, tmp_path / "out")
    (copied / "sweep.json").unlink()
    os.mkfifo(copied / "sweep.json")
    with pytest.raises(DropspinError, match=r"its sweep\.json is not a valid description of a sweep"):
        read_sweep(str(copied))


def test_sweep_without_a_part_has_no_table(sweep, tmp_path):
    copied = shutil.copytree(sweep, tmp_path / "out")
    shutil.rmtree(copied / "parts")
    with pytest.raises(DropspinError, match="no job has been run"):
        read_sweep(str(copied))


@pytest.mark.parametrize(
    ("name", "value"),
    [("identity", "("), ("jobs", -1), ("jobs", "2"), ("part_size", 0), ("provenance", {}), ("provenance", {"versions": [1]})],
)
def test_damaged_description_of_a_sweep_is_refused(name, value, sweep, tmp_path):
    copied = shutil.copytree(sweep, tmp_path / "out")
    content = json.loads((copied / "sweep.json").read_text()) | {name: value}
    (copied / "sweep.json").write_text(json.dumps(content))
    with pytest.raises(DropspinError, match=r"its sweep\.json is not a valid description of a sweep"):
        read_sweep(str(copied))


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"format = 3\nresults = 5",
        b"format = '3'",
        b"format = [3]",
        b"format = 3\naccepted = [1]",
        b"format = 3\n[scenes]\na = 1",
        b"format = 3\n[results.a.b.c.d]\nvalue = 1",
        b"format = 3\n[scenes]\na = 'x'\n[results.a.b.'0.01'.energy_error]\nvalue = nan\ntolerance = 1.0\nby = 'x'",
        b"format = 3\nx = " + DEEP.encode(),
        b"format = 3\n[engines]\na = '\\u001b[2J'".replace(b"'", b'"'),
        b'format = 3\n[scenes]\n"\\u001b[2J" = "x"',
        b'format = 3\n[scenes]\na = "x"\n[results.a."\\u001b[2J"]',
        b'format = 3\n[accepted.k]\ndate = 2026-01-01\nreason = "\\u001b[2J"\nversions = {}',
        b"\xff\xfe",
    ],
)
def test_damaged_baseline_is_refused(content, copied, tmp_path):
    (tmp_path / "b.toml").write_bytes(content)
    done = dropspin("check", "run", "--baseline", "b.toml", cwd=tmp_path)
    assert_refused(done, "b.toml")


@pytest.mark.sample(2)
@pytest.mark.parametrize(("value", "tolerance"), [("1e308", "5e-324"), ("1e308", "1e308"), ("5e-324", "1e308")])
@pytest.mark.parametrize("engine", ["mujoco", "other"])
def test_extreme_numbers_of_a_baseline_are_compared_and_kept(engine, value, tolerance, copied, tmp_path):
    """Of results that the run has, which are compared with them, and of those that it lacks, which are written again."""
    assert dropspin("accept", "run", "--baseline", "b.toml", "--reason", "x", cwd=tmp_path).returncode == 0
    text = (tmp_path / "b.toml").read_text()
    line = next(line for line in text.splitlines() if line.startswith("results.few.mujoco"))
    extreme = re.sub("value = .*, tolerance = .*, by", f"value = {value}, tolerance = {tolerance}, by", line)
    kept = text.replace(line, extreme) if engine == "mujoco" else text + extreme.replace("mujoco", engine) + "\n"
    for verb in (["check", "run"], ["accept", "run", "--reason", "y"]):
        (tmp_path / "b.toml").write_text(kept)
        done = dropspin(*verb, "--baseline", "b.toml", cwd=tmp_path)
        assert done.returncode in (0, 1), done.stderr
        assert done.stderr == ""
    if engine == "other":
        assert extreme.replace("mujoco", engine).partition(" = ")[0] in (tmp_path / "b.toml").read_text()
