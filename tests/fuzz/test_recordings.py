"""Recordings: changed headers, damaged data in every format, and the measured tosses of a scene."""

import io
import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from hypothesis import given
from hypothesis import strategies as st

from dropspin.scenarios.loading import CATALOGUE
from fuzz.campaign import cases
from fuzz.cases import run, surroundings
from fuzz.inputs import toml
from fuzz.strategies import damaged, edited

T = np.arange(30) / 100.0
COLUMNS = {name: np.full(30, float(name == "qw")) for name in ("x", "z", "qx", "qy", "qz", "qw")} | {"t": T, "y": 1.0 - 4.905 * T**2}
HEADER = {
    "data": "toss.csv",
    "rate": 100.0,
    "up": "y",
    "body": {"shape": "box", "half_extents": [0.1, 0.05, 0.04], "mass": 1.0},
    "floor": {"restitution": 0.5, "friction": 0.3},
    "noise": {"position": 1e-3, "orientation": 1e-2},
}


def data() -> dict[str, bytes]:
    """The columns in each format."""
    rows = zip(*COLUMNS.values(), strict=True)
    text = "\n".join([",".join(COLUMNS), *(",".join(map(str, row)) for row in rows)])
    npz, parquet = io.BytesIO(), io.BytesIO()
    np.savez(npz, **COLUMNS)
    pq.write_table(pa.table(COLUMNS), parquet)
    return {"toss.csv": text.encode(), "toss.npz": npz.getvalue(), "toss.parquet": parquet.getvalue()}


SOUND = data()


@cases(100)
@given(edited(HEADER).map(toml) | damaged(toml(HEADER)))
def test_headers_are_checked_or_refused(content):
    with surroundings() as work:
        (work / "toss.csv").write_bytes(SOUND["toss.csv"])
        (work / "toss.toml").write_bytes(content)
        run(work, "log", "check", "toss.toml", "-o", "out", outputs=["out"])


@cases(150)
@given(st.sampled_from(sorted(SOUND)).flatmap(lambda name: st.tuples(st.just(name), damaged(SOUND[name]))))
def test_data_are_checked_or_refused(damage):
    name, content = damage
    with surroundings() as work:
        (work / name).write_bytes(content)
        (work / "toss.toml").write_bytes(toml(HEADER | {"data": name}))
        run(work, "log", "check", "toss.toml", "-o", "out", outputs=["out"])


def tosses():
    """The file of tosses of a scene, with one toss of three frames."""
    recording = json.loads((CATALOGUE / "toss-cube.json").read_bytes())
    first = {key: values if key in ("name", "starts") else values[:3] for key, values in recording["tosses"][0].items()}
    return recording | {"tosses": [first]}


SCENE = {"body": HEADER["body"], "floor": HEADER["floor"], "recording": {"file": "tosses.json"}}
TOSSES = tosses()


@cases(40)
@given(edited(TOSSES).map(json.dumps).map(str.encode) | damaged(json.dumps(TOSSES).encode()))
def test_measured_tosses_of_a_scene_are_read_or_refused(content):
    with surroundings() as work:
        (work / "tosses.json").write_bytes(content)
        (work / "scene.toml").write_bytes(toml(SCENE))
        run(work, "show", "scene.toml", outputs=[])
