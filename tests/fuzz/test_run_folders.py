"""Folders of runs, studies and sweeps: damaged ones, and ones of a stranger who computes the checksums."""

import io
import json
import os
from contextlib import suppress
from pathlib import Path

import numpy as np
import pandas as pd
from hypothesis import given
from hypothesis import strategies as st
from support.run_folders import replace_file

from dropspin.comparisons.results.run_file import signed
from fuzz.campaign import cases
from fuzz.cases import fill, run, surroundings
from fuzz.strategies import JSON, TEXTS, damaged, edited

COMMANDS = st.sampled_from(
    [
        (("report", "run"), ("run",)),
        (("report", "run", "--plots", "svg"), ("run",)),
        (("check", "run", "--json"), ()),
        (("check", "run", "--junit", "out/junit.xml"), ("out",)),
        (("compare", "run", "run2"), ()),
        (("compare", "history", "run2", "run", "-o", "out"), ("out",)),
        (("replay", "run", "--no-open"), ("run",)),
        (("accept", "run", "--reason", "r"), ("dropspin-baseline.toml",)),
        (("run", "ball.toml", "-e", "wang", "--dt", "0.02", "-o", "run", "--resume"), ("run",)),
    ]
)
TYPES = ["int64", "float32", "str", "bool", "datetime64[ns]", "category", "object", "complex128"]
ARRAYS = st.sampled_from(
    [
        np.array([], dtype=float),
        np.array(None, dtype=object),
        np.array([{}, "x"], dtype=object),
        np.array(["x" * 50]),
        np.full((11, 3), np.nan),
        np.full((11, 3), np.inf),
        np.zeros((11, 4), dtype=complex),
        np.zeros((11, 13), dtype="f2"),
        np.zeros(1, dtype=[("a", "f8"), ("b", "O")]),
        np.array("2020", dtype="datetime64[D]"),
        np.zeros((0, 3)),
        np.zeros((11, 3), dtype=">f8"),
    ]
)


def files(folder: Path) -> list[str]:
    """The paths of the files below a folder, sorted."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


@st.composite
def tables(draw: st.DrawFn, content: bytes) -> bytes:
    """A table of a run with rows, columns, types or values changed."""
    frame = pd.read_parquet(io.BytesIO(content))
    column = draw(st.sampled_from(list(frame.columns)))
    change = draw(st.sampled_from(["drop", "rename", "type", "value", "rows", "swap", "more"]))
    if change == "drop":
        frame = frame.drop(columns=column)
    elif change == "rename":
        frame = frame.rename(columns={column: draw(TEXTS)})
    elif change == "type":
        with_type = draw(st.sampled_from(TYPES))
        frame[column] = pd.Series([None] * len(frame)).astype(object if with_type == "complex128" else with_type, errors="ignore")
    elif change == "value":
        frame[column] = frame[column].astype(object)
        frame.loc[draw(st.integers(0, len(frame) - 1)), column] = draw(JSON.filter(lambda value: not isinstance(value, list | dict)))
    elif change == "rows":
        frame = pd.concat([frame, frame.iloc[: draw(st.integers(1, len(frame)))]]) if draw(st.booleans()) else frame.iloc[:0]
    elif change == "swap":
        frame[column] = frame[draw(st.sampled_from(list(frame.columns)))]
    else:
        frame["more"] = 1.0
    target = io.BytesIO()
    try:
        frame.to_parquet(target, index=False)
    except Exception:  # pyarrow cannot store a column of such values
        return b"PAR1"
    return target.getvalue()


@st.composite
def arrays(draw: st.DrawFn, content: bytes) -> bytes:
    """A file of arrays with one of them replaced, renamed or removed."""
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        held = dict(stored)
    name = draw(st.sampled_from(sorted(held)))
    change = draw(st.sampled_from(["replace", "edit", "remove", "rename"]))
    if change == "replace":
        held[name] = draw(ARRAYS)
    elif change == "edit" and held[name].size:
        held[name] = held[name].copy()
        held[name].flat[draw(st.integers(0, held[name].size - 1))] = draw(st.floats())
    else:
        array = held.pop(name)
        if change == "rename":
            held[draw(st.sampled_from(["x", "../x", "position", ""]))] = array
    target = io.BytesIO()
    np.savez(target, **held)
    return target.getvalue()


def change_any(draw: st.DrawFn, folder: Path) -> None:
    """Damage one file of a folder, remove it, or put something else in its place, as a broken disk would."""
    name = draw(st.sampled_from(files(folder)))
    change = draw(st.sampled_from(["damage", "damage", "remove", "pipe", "link", "folder", "add"]))
    if change == "damage":
        (folder / name).write_bytes(draw(damaged((folder / name).read_bytes())))
        return
    if change != "add":
        (folder / name).unlink()
    if change == "pipe":
        os.mkfifo(folder / name)
    elif change == "link":
        (folder / name).symlink_to(draw(st.sampled_from(["absent", "/dev/zero", "/etc/passwd", name.rpartition("/")[2], ".."])))
    elif change == "folder":
        (folder / name).mkdir()
    elif change == "add":
        (folder / draw(st.sampled_from(["x", "replay.html", "plots", ".unfinished-abc", "report.html.tmp"]))).write_bytes(b"x")


def forge(draw: st.DrawFn, folder: Path) -> None:
    """Change the content of a file, and repair the checksums."""
    kind = draw(st.sampled_from(["json", "json", "table", "arrays"]))
    if kind == "json":
        content = json.loads((folder / "run.json").read_text())
        changed = draw(edited({key: value for key, value in content.items() if key != "sha256"}, JSON))

        text = json.dumps(changed | {"sha256": {path: one for path, one in content["sha256"].items() if path != "run.json"}})
        with suppress(ValueError):  # of lone surrogates, which cannot be signed
            text = signed(json.loads(text))
        (folder / "run.json").write_text(text)
        return
    name = "results.parquet" if kind == "table" else draw(st.sampled_from([name for name in files(folder) if name.endswith(".npz")]))
    replace_file(folder, name, draw((tables if kind == "table" else arrays)((folder / name).read_bytes())))


@cases(230)
@given(st.data(), COMMANDS)
def test_forged_runs_are_loaded_or_refused(sound, data, command):
    with surroundings() as work:
        fill(work, sound)
        forge(data.draw, work / "run")
        run(work, *command[0], outputs=command[1])


@cases(150)
@given(st.data(), COMMANDS)
def test_damaged_runs_are_loaded_or_refused(sound, data, command):
    with surroundings() as work:
        fill(work, sound)
        change_any(data.draw, work / "run")
        run(work, *command[0], outputs=command[1])


@cases(50)
@given(st.data())
def test_studies_are_added_or_refused(sound, data):
    with surroundings() as work:
        fill(work, sound)
        section = json.loads((sound / "study" / "section.json").read_text())
        if data.draw(st.booleans()):
            (work / "study" / "section.json").write_text(json.dumps(data.draw(edited(section, JSON))))
        else:
            change_any(data.draw, work / "study")
        run(work, "report", "run", "--add", "study", outputs=["run"])


@cases(50)
@given(st.data())
def test_damaged_sweeps_are_resumed_or_refused(sound, data):
    with surroundings() as work:
        fill(work, sound)
        change_any(data.draw, work / "sweep")
        run(work, "sweep", "spec.toml", "-o", "sweep", "--resume", outputs=["sweep"])
