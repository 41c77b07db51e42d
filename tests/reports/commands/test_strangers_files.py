"""Studies, sweeps and baselines of somebody else, and the names in runs: refused in one line, or written as text only."""

import json
import shutil

import pandas as pd
import pytest
from support.cli import assert_refused, dropspin
from support.run_folders import contents

from comparisons.running.run import run
from comparisons.sweeps.running import read_sweep, run_sweep
from comparisons.sweeps.spec import load_sweep
from reports.run_folder import write_report
from scenarios import DropspinError, load

DEEP = "[" * 5000 + "]" * 5000


@pytest.mark.parametrize("name", ["../../stray", "/tmp/dropspin-stray", "..", "a/b", "x" * 300, "<img src=x onerror=alert(1)>"])
def test_history_writes_only_into_its_folder(name, small, tmp_path):
    """A scene's name is no path; every picture has its place, and the page names it."""
    spin = load("spin-principal").model_dump(exclude_none=True, exclude={"expect"}) | {"duration": 0.2, "name": name}
    for copy in ("one", "two"):
        write_report(run(spin, "mujoco", 1e-2), tmp_path / "runs" / copy)
    before = contents(tmp_path)
    assert dropspin("history", "runs", "-o", "deep/er/out", cwd=tmp_path).returncode == 0
    written = contents(tmp_path).keys() - before.keys()
    assert {path.rpartition("/")[0] for path in written} == {"deep/er/out"}
    [picture] = [path.rpartition("/")[2] for path in written if path.endswith(".svg")]
    page = (tmp_path / "deep/er/out/history.md").read_text()
    assert f"]({picture})" in page
    assert "<img" not in page.replace("\\<", "")


def chart(**changes):
    """A section with one chart of two points, with changes to its line."""
    line = {"label": "a", "x": 0, "y": "AACAPwAAAEA=", "colour": "#0072B2", "width": 1.5} | changes
    return {"title": "t", "parts": [{"kind": "charts", "name": "n", "charts": [{"xLabel": "x", "x": [[1.0, 2.0]], "lines": [line]}]}]}


def test_section_of_plain_data_is_added(copied, tmp_path):
    """The reference of the refused ones."""
    (tmp_path / "section.json").write_text(json.dumps(chart()))
    assert dropspin("report", "run", "--add", ".", cwd=tmp_path).returncode == 0
    assert '"y": "AACAPwAAAEA="' in (copied / "report.html").read_text()


@pytest.mark.parametrize(
    "content",
    [
        "",
        "[]",
        DEEP,
        '{"title": "t", "parts": [{"kind": "svg", "content": "<svg onload=alert(1)>"}]}',
        '{"title": "t", "parts": [{"kind": "charts", "name": "n", "svg": "<svg>", "charts": []}]}',
        '{"title": "t", "parts": [{"kind": "table", "rows": [{"a": "1"}, {"b": "1"}]}]}',
        '{"title": "\\u001b[2J", "parts": []}',
        *(
            json.dumps(chart(**change))
            for change in (
                {"y": "AACAPw=="},
                {"y": "no base 64"},
                {"y": [1.0, 2.0]},
                {"x": 1},
                {"x": -1},
                {"colour": "url(https://example.org/x)"},
                {"dashes": "10000"},
                {"marker": "<svg>"},
                {"width": "1"},
                {"onclick": "alert(1)"},
                {"low": "AACAPwAAAEA="},
            )
        ),
        json.dumps(chart()).replace("[[1.0, 2.0]]", '[{"first": 0, "step": 1, "count": 1000000000000}]'),
        json.dumps(chart()).replace('"xLabel": "x"', '"reference": "other"'),
    ],
)
def test_section_of_anything_else_is_refused(content, copied, tmp_path):
    (tmp_path / "section.json").write_text(content)
    before = contents(tmp_path)
    assert_refused(dropspin("report", "run", "--add", ".", cwd=tmp_path), "has no study, or a damaged one (section.json: ")
    assert contents(tmp_path) == before


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """A sweep of two jobs."""
    where = tmp_path_factory.mktemp("sweep") / "out"
    spec = {"scenes": ["drop-ball"], "engines": ["document"], "dts": [4e-3], "grid": {"floor.restitution": [0.2, 0.4]}}
    run_sweep(load_sweep(spec), str(where))
    return where


def sweep_table(**columns):
    def damage(part):
        pd.read_parquet(part).assign(**columns).to_parquet(part, index=False)

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
    ],
)
def test_damaged_part_of_a_sweep_is_refused(damage, sweep, tmp_path):
    copied = shutil.copytree(sweep, tmp_path / "out")
    [part] = copied.rglob("*.parquet")
    damage(part)
    with pytest.raises(DropspinError, match=r"\.parquet: is damaged; delete it, and run its jobs again with --resume\.$"):
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
        b"\xff\xfe",
    ],
)
def test_damaged_baseline_is_refused(content, copied, tmp_path):
    (tmp_path / "b.toml").write_bytes(content)
    done = dropspin("check", "run", "--baseline", "b.toml", cwd=tmp_path)
    assert_refused(done, "b.toml")
