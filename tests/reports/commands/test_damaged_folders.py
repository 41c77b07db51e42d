"""Folders that are damaged, or that somebody made who knows the format: refused in one line, and nothing is written.

Damages that a checksum tells are made as they happen; all others have right checksums, so that only the content can give them away.
"""

import io
import json
import os
import random
import shutil
from zipfile import ZipFile

import numpy as np
import pandas as pd
import pytest
from support.cli import dropspin
from support.run_folders import change_json, change_table, contents, replace_file

from comparisons.results.store import load_results, save
from comparisons.running.run import run
from comparisons.sweeps.running import read_sweep, run_sweep
from comparisons.sweeps.spec import load_sweep
from reports.run_folder import write_report
from scenarios import DropspinError, load

ENSEMBLE = {
    "name": "few",
    "duration": 0.2,
    "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0},
    "floor": {"restitution": 0.5, "friction": 0.3},
    "gravity": {"acceleration": [0.0, -9.81, 0.0]},
    "start": {"position": [0.0, 0.15, 0.0]},
    "ensemble": {"size": 3, "seed": 1},
}
FLIPS = 100
DEEP = "[" * 5000 + "]" * 5000


@pytest.fixture(scope="module")
def small():
    """A run of two scenes, one of them an ensemble."""
    spin = load("spin-principal").model_dump(exclude_none=True, exclude={"expect"}) | {"duration": 0.2}
    return run([spin, ENSEMBLE], ["document", "mujoco"], 1e-2)


@pytest.fixture(scope="module")
def folder(small, tmp_path_factory):
    """The run, written."""
    return write_report(small, tmp_path_factory.mktemp("out") / "run").parent


@pytest.fixture
def copied(folder, tmp_path):
    """A copy of the run, in a folder of its own."""
    return shutil.copytree(folder, tmp_path / "run")


def assert_refused(done, name):
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr + done.stdout
    [line] = done.stderr.splitlines()
    assert line.startswith("dropspin: ")
    assert name in line


def raw(name, content):
    """Put something in the place of a file; its checksum stays."""

    def damage(folder):
        [file] = folder.glob(name)
        if content is None:
            file.unlink()
        else:
            file.write_bytes(content(file.read_bytes()) if callable(content) else content)

    return damage


RAW = {
    f"{kind} {name}": (raw(name, content), name.split("*")[0])
    for name in ("run.json", "results.parquet", "trajectories/000-*.npz", "ensembles/*.npz")
    for kind, content in {
        "empty": b"",
        "half": lambda text: text[: len(text) // 2],
        "absent": None,
        "one byte more": lambda text: text + b"x",
        "text": b"not what it should be",
        "deep nesting": DEEP.encode(),
    }.items()
}


def edited(*path, to=None, of=lambda value, name: None):
    """Set, or change, a value of run.json."""

    def damage(folder):
        def change(content):
            for key in path[:-1]:
                content = content[key]
            if to is None:
                of(content, path[-1])
            else:
                content[path[-1]] = to

        change_json(folder, change)

    return damage


def without(content, name):
    del content[name]


TOP = ("provenance", "engines", "scenes", "digests", "origins", "trajectories", "ensembles", "sha256")
PROVENANCE = (
    "asked",
    "started",
    "versions",
    "wheels",
    "python",
    "platform",
    "cpu",
    "cores",
    "commit",
    "code",
    "names",
    "adapters",
    "settings",
)
JSON = (
    {f"without {name}": edited(name, of=without) for name in TOP}
    | {f"{name}: a number": edited(name, to=5) for name in TOP}
    | {f"without provenance.{name}": edited("provenance", name, of=without) for name in PROVENANCE}
    | {f"provenance.{name}: a list": edited("provenance", name, to=[[1]]) for name in PROVENANCE}
    | {
        "unknown key": edited("more", to=1),
        "no engines": edited("engines", to=[]),
        "an engine twice": edited("engines", to=["document", "document"]),
        "engine that did not run": edited("engines", to=["document", "other"]),
        "control characters": edited("provenance", "cpu", to="\x1b[2J"),
        "time step of NaN": edited("provenance", "asked", "dts", to=[float("nan")]),
        "time step as text": edited("provenance", "asked", "dts", to=["0.01"]),
        "negative time step": edited("provenance", "asked", "dts", to=[-0.01]),
        "no time": edited("provenance", "started", to="yesterday"),
        "version that is a list": edited("provenance", "versions", "numpy", to=[2]),
        "scene that is none": edited("scenes", "few", to={"duration": 1.0}),
        "scene of another motion": edited("scenes", "few", "duration", to=0.3),
        "scene with NaN": edited("scenes", "few", "duration", to=float("nan")),
        "settings nested deeply": edited("provenance", "settings", to=json.loads("[" * 150 + "]" * 150)),
        "drawn scenes without a seed": edited("provenance", "asked", "draw", to=1),
    }
)


def renamed(content):
    """The first trajectory has a path that leads out of the folder."""
    path = next(iter(content["trajectories"]))
    content["trajectories"]["trajectories/../../x.npz"] = content["trajectories"].pop(path)
    content["sha256"]["trajectories/../../x.npz"] = content["sha256"].pop(path)


def table(**columns):
    """Replace columns of the table."""
    return lambda folder: change_table(folder, lambda frame: frame.assign(**columns))


TABLES = {
    "scene that was not run": table(scene="fall-spin"),
    "engine that was not run": table(engine="other"),
    "unknown metric": table(metric="x"),
    "unknown verdict": table(verdict="fine"),
    "unknown kind": table(kind="x"),
    "unknown unit": table(unit="furlong"),
    "other time step": table(dt=0.5),
    "time step of 0": table(dt=0.0),
    "texts for numbers": table(value="1"),
    "numbers for texts": table(reason=1.0),
    "whole numbers for numbers": table(value=1),
    "absent texts": table(reason=None),
    "negative tolerance": table(tolerance=-1.0),
    "negative steps": table(steps=-1),
    "control characters in a table": table(reason="\x1b]0;x\x07"),
    "two rows of one result": lambda folder: change_table(folder, lambda frame: pd.concat([frame, frame])),
    "no rows": lambda folder: change_table(folder, lambda frame: frame[:0]),
    "column less": lambda folder: change_table(folder, lambda frame: frame.drop(columns="unit")),
    "column more": table(more=1),
    "means of a scene without an ensemble": lambda folder: change_table(
        folder, lambda frame: frame.assign(scene=frame["scene"].where(frame["kind"] != "ensemble", "spin-principal"))
    ),
    "table that is text": lambda folder: replace_file(folder, "results.parquet", b"PAR1 PAR1"),
    "empty table": lambda folder: replace_file(folder, "results.parquet", b""),
}


def arrays(kind, **changes):
    """Replace arrays of the first file of a kind; None leaves one out."""

    def damage(folder):
        name = f"{kind}/{min(path.name for path in (folder / kind).iterdir())}"
        with np.load(folder / name) as stored:
            found = dict(stored)
        for array, change in changes.items():
            found[array] = change(found.get(array)) if callable(change) else change
        content = io.BytesIO()
        np.savez(content, **{array: values for array, values in found.items() if values is not None})
        replace_file(folder, name, content.getvalue())

    return damage


def huge(folder):
    """The declared shape of an array is larger than any memory; the file is not."""
    name = f"trajectories/{min(path.name for path in (folder / 'trajectories').iterdir())}"
    content, header = io.BytesIO(), io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": (10**15, 3)})
    with ZipFile(folder / name) as old, ZipFile(content, "w") as new:
        for member in old.namelist():
            new.writestr(member, header.getvalue() if member == "position.npy" else old.read(member))
    replace_file(folder, name, content.getvalue())


def first(name):
    return lambda folder: replace_file(folder, f"{name}/{min(path.name for path in (folder / name).iterdir())}", b"")


ARRAYS = {
    "empty trajectory": first("trajectories"),
    "empty ensemble": first("ensembles"),
    "huge shape": huge,
    "too few rows in one array": arrays("trajectories", position=lambda x: x[:-1]),
    "no rows": arrays("trajectories", **dict.fromkeys(("t", "position", "orientation", "velocity", "angular_velocity"), lambda x: x[:0])),
    "too many rows": arrays(
        "trajectories",
        **dict.fromkeys(("t", "position", "orientation", "velocity", "angular_velocity"), lambda x: np.concatenate([x, x])),
    ),
    "other shape": arrays("trajectories", position=lambda x: x[:, :2]),
    "other type": arrays("trajectories", position=lambda x: x.astype("f4")),
    "objects": arrays("trajectories", position=lambda x: x.astype(object)),
    "array less": arrays("trajectories", velocity=None),
    "array more": arrays("trajectories", more=np.zeros(1)),
    "times of another step": arrays("trajectories", t=lambda t: 2.0 * t),
    "lag of NaN": arrays("trajectories", velocity_lag=np.array(np.nan)),
    "ensemble of another size": arrays("ensembles", rebound=lambda x: x[:-1]),
    "ensemble less": arrays("ensembles", energy=None),
}
FORGED = {
    **{name: (damage, "run.json") for name, damage in JSON.items()},
    "path out of the folder": (lambda folder: change_json(folder, renamed), "run.json"),
    **{f"table: {name}": (damage, "results.parquet") for name, damage in TABLES.items()},
    **{f"arrays: {name}": (damage, "ensembles/" if "ensemble" in name else "trajectories/") for name, damage in ARRAYS.items()},
}


@pytest.mark.parametrize(("damage", "named"), (RAW | FORGED).values(), ids=(RAW | FORGED).keys())
def test_damaged_run_is_refused_in_one_line(damage, named, copied, tmp_path):
    damage(copied)
    before = contents(tmp_path)
    assert_refused(dropspin("report", "run", cwd=tmp_path), named)
    assert contents(tmp_path) == before


def test_undamaged_copy_is_loaded(copied, tmp_path):
    """The reference of the damages above: signed again without a change, the folder is what it was."""
    change_json(copied, lambda content: None)
    change_table(copied, lambda frame: frame)
    assert dropspin("report", "run", cwd=tmp_path).returncode == 0


@pytest.mark.parametrize("verb", [("check", "run"), ("compare", "run", "run"), ("history", "run", "run2", "-o", "h"), ("replay", "run")])
def test_every_verb_refuses_a_damaged_run(verb, copied, tmp_path):
    shutil.copytree(copied, tmp_path / "run2")
    edited("provenance", "asked", to=[])(copied)
    before = contents(tmp_path)
    done = dropspin(*verb, cwd=tmp_path)
    assert (done.returncode, "Traceback" in done.stderr) == (2, False)
    assert "run: not the folder of a run, or damaged (run.json: provenance.asked: " in done.stderr
    assert contents(tmp_path) == before


@pytest.mark.parametrize("name", ["run.json", "results.parquet"])
def test_pipe_in_a_run_is_refused(name, copied, tmp_path):
    """Reading it would block for ever."""
    (copied / name).unlink()
    os.mkfifo(copied / name)
    assert_refused(dropspin("report", "run", cwd=tmp_path), "not a regular file")


def test_flipped_bits_are_told_or_change_nothing(small, tmp_path):
    """Each of 100 random bits in a folder: the run is refused with the name of the file, or is what it was."""
    rng = random.Random(20)
    (tmp_path / "run").mkdir()
    save(small, tmp_path / "run")
    files = contents(tmp_path / "run")
    refused = 0
    for _ in range(FLIPS):
        name = rng.choice(list(files))
        content = bytearray(files[name])
        bit = rng.randrange(8 * len(content))
        content[bit // 8] ^= 1 << bit % 8
        (tmp_path / "run" / name).write_bytes(content)
        try:
            found = load_results(tmp_path / "run")
        except DropspinError as error:
            refused += 1
            assert name in str(error) or "has a format of" in str(error)  # noqa: PT017
        else:
            pd.testing.assert_frame_equal(found.table, small.table)
            assert found.provenance == json.loads(json.dumps(small.provenance))
            assert {key: motion.states.tobytes() for key, motion in found.trajectories.items()} == {
                key: motion.states.tobytes() for key, motion in small.trajectories.items()
            }
        (tmp_path / "run" / name).write_bytes(files[name])
    assert refused > 0.9 * FLIPS  # those that are not lie in the white space of run.json


def test_a_link_to_a_private_file_is_not_copied(copied, tmp_path):
    """A stranger's folder may have a replay that leads elsewhere."""
    (tmp_path / "private").write_text("secret")
    (copied / "replay.html").symlink_to(tmp_path / "private")
    assert dropspin("report", "run", cwd=tmp_path).returncode == 0
    assert not (copied / "replay.html").exists()
    assert (tmp_path / "private").read_text() == "secret"


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
