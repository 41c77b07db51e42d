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
from support.cli import assert_refused, dropspin
from support.run_folders import change_json, change_table, contents, replace_file

from dropspin.comparisons.results.store import load_results, save
from dropspin.scenarios import DropspinError

FLIPS = 100
DEEP = "[" * 5000 + "]" * 5000


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
MACHINE = ("python", "platform", "cpu", "cores", "commit", "code")
PROVENANCE = ("asked", "started", "versions", "wheels", *MACHINE, "names", "adapters", "settings")
JSON = (
    {f"without {name}": edited(name, of=without) for name in TOP}
    | {f"{name}: a number": edited(name, to=5) for name in TOP}
    | {f"without provenance.{name}": edited("provenance", name, of=without) for name in PROVENANCE}
    | {f"provenance.{name}: a list": edited("provenance", name, to=[[1]]) for name in PROVENANCE}
    | {
        "unknown key": edited("more", to=1),
        "no engines": edited("engines", to=[]),
        "an engine twice": edited("engines", to=["wang", "wang"]),
        "engine that did not run": edited("engines", to=["wang", "other"]),
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


ROWS = ("t", "position", "orientation", "velocity", "angular_velocity")
ARRAYS = {
    "empty trajectory": first("trajectories"),
    "empty ensemble": first("ensembles"),
    "huge shape": huge,
    "too few rows in one array": arrays("trajectories", position=lambda x: x[:-1]),
    "no rows": arrays("trajectories", **dict.fromkeys(ROWS, lambda x: x[:0])),
    "one row": arrays("trajectories", **dict.fromkeys(ROWS, lambda x: x[:1])),
    "one row less": arrays("trajectories", **dict.fromkeys(ROWS, lambda x: x[:-1])),
    "too many rows": arrays("trajectories", **dict.fromkeys(ROWS, lambda x: np.concatenate([x, x]))),
    "orientations of length 2": arrays("trajectories", orientation=lambda x: 2.0 * x),
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


@pytest.mark.sample(31)
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


@pytest.mark.parametrize(
    "verb", [("check", "run"), ("compare", "run", "run"), ("compare", "history", "run", "run2", "-o", "h"), ("replay", "run")]
)
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


@pytest.mark.extended
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


def test_a_replay_is_not_written_through_a_link(copied, tmp_path):
    """The link of a stranger's folder may lead to any file of the user."""
    (tmp_path / "private").write_text("secret")
    (copied / "replay.html").unlink(missing_ok=True)
    (copied / "replay.html").symlink_to(tmp_path / "private")
    assert_refused(dropspin("replay", "run", "--no-open", cwd=tmp_path), "run/replay.html: is a link")
    assert (tmp_path / "private").read_text() == "secret"
    assert dropspin("replay", "run", "--no-open", "-o", "page.html", cwd=tmp_path).returncode == 0


def test_links_in_place_of_unfinished_folders_are_removed_alone(copied, tmp_path):
    """They look like those of a killed process; what they lead to stays."""
    private = tmp_path / "private"
    (private / "old").mkdir(parents=True)
    (tmp_path / ".run-unfinished-abcdefgh").symlink_to(private)
    (tmp_path / ".out-unfinished-abcdefgh").symlink_to(private)
    assert dropspin("report", "run", cwd=tmp_path).returncode == 0
    assert dropspin("replay", "run", "--no-open", "-o", "out", cwd=tmp_path).returncode == 0
    assert sorted(private.rglob("*")) == [private / "old"]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "private", "run"]
