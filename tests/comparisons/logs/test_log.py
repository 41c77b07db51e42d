"""Recordings in any convention load as the same motion; what is wrong with a file is one line; what it shows by itself is a fact."""

import io
import json
import zipfile

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import tomlkit
from scipy.spatial.transform import Rotation

from dropspin.comparisons.logs import formats
from dropspin.comparisons.logs.header import LENGTHS, TIMES
from dropspin.comparisons.logs.log import load_log
from dropspin.scenarios import DropspinError
from dropspin.scenarios.errors import SceneWarning

BODY = {"shape": "box", "half_extents": [0.05, 0.05, 0.05], "mass": 1.0}
RATE, FRAMES = 100.0, 40
T = np.arange(FRAMES) / RATE
POSITION = np.column_stack([2.0 * T, 1.0 + T - 4.905 * T**2, -T])
SPIN = np.array([3.0, -5.0, 7.0])
TURNED = Rotation.from_rotvec(T[:, None] * SPIN) * Rotation.from_euler("xyz", [0.3, -1.0, 2.0])
VELOCITY = np.column_stack([np.full(FRAMES, 2.0), 1.0 - 9.81 * T, np.full(FRAMES, -1.0)])
AXES = {  # the axes of the recording in the world with y up, as columns
    "x": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    "-x": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
    "y": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "-y": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    "z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "-z": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
}


def written(folder, columns, header=(), name="toss.csv", **body):
    """A header and its data, and the path of the header."""
    path = folder / name
    match path.suffix:
        case ".csv":
            rows = zip(*columns.values(), strict=True)
            path.write_text("\n".join([",".join(columns), *(",".join(map(str, row)) for row in rows)]) + "\n")
        case ".npz":
            np.savez(path, **columns)
        case ".parquet":
            pq.write_table(pa.table(dict(columns)), path)
        case ".mcap":
            write_mcap(path, {"/pose": columns})
    (folder / "toss.toml").write_text(tomlkit.dumps({"data": name, **dict(header), "body": BODY | body}))
    return folder / "toss.toml"


def write_mcap(path, topics, encoding="json"):
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        for topic, columns in topics.items():
            channel = writer.register_channel(topic, encoding, 0)
            for number, row in enumerate(zip(*columns.values(), strict=True)):
                given = {name: value for name, value in zip(columns, row, strict=True) if value is not None}
                data = json.dumps(given, default=float).encode()
                writer.add_message(channel, log_time=number, publish_time=number, data=data)
        writer.finish()


def recorded(up="y", quaternion="xyzw", rotation="body-to-world", spin_frame="world", length="m", time="s"):
    """The columns of the motion in a convention, converted by SciPy."""
    to_file = Rotation.from_matrix(np.array(AXES[up]).T)
    turned = to_file * TURNED
    q = (turned.inv() if rotation == "world-to-body" else turned).as_quat()
    q = np.roll(q, 1, axis=1) if quaternion == "wxyz" else q
    spin = turned.inv().apply(to_file.apply(SPIN)) if spin_frame == "body" else to_file.apply(np.tile(SPIN, (FRAMES, 1)))
    values = [
        (T[:, None] + 3.0) / TIMES[time],
        to_file.apply(POSITION) / LENGTHS[length],
        q,
        to_file.apply(VELOCITY) / LENGTHS[length] * TIMES[time],
        spin * TIMES[time],
    ]
    return dict(zip(["t", "x", "y", "z", "qx", "qy", "qz", "qw", "vx", "vy", "vz", "wx", "wy", "wz"], np.hstack(values).T, strict=True))


POSE = {name: values for name, values in recorded().items() if name[0] not in "vw"}


def assert_is_the_motion(toss):
    np.testing.assert_allclose(toss.t, T, atol=1e-12)
    np.testing.assert_allclose(toss.position, POSITION, atol=1e-12)
    np.testing.assert_allclose((TURNED.inv() * Rotation.from_quat(toss.orientation)).magnitude(), 0.0, atol=1e-12)
    assert np.abs(np.diff(toss.orientation, axis=0)).max() < 0.1  # no jump of sign


@pytest.mark.parametrize("up", AXES)
@pytest.mark.parametrize("conventions", [("xyzw", "body-to-world", "body", "mm", "ms"), ("wxyz", "world-to-body", "world", "inch", "ns")])
def test_every_convention_loads_as_the_same_motion(tmp_path, up, conventions):
    quaternion, rotation, spin_frame, length, time = conventions
    header = {"up": up, "quaternion": quaternion, "rotation": rotation, "spin_frame": spin_frame, "length_unit": length, "time_unit": time}
    [toss] = load_log(written(tmp_path, recorded(up, *conventions), header)).tosses
    assert_is_the_motion(toss)
    np.testing.assert_allclose(toss.velocity, VELOCITY, atol=1e-12)
    np.testing.assert_allclose(toss.angular_velocity, np.tile(SPIN, (FRAMES, 1)), atol=1e-12)


@pytest.mark.parametrize("ending", ["csv", "npz", "parquet", "mcap"])
def test_every_format_loads_as_the_same_motion(tmp_path, ending):
    [toss] = load_log(written(tmp_path, POSE, name=f"toss.{ending}")).tosses
    assert_is_the_motion(toss)
    assert toss.velocity is None


def test_lengths_are_divided_by_their_scale_and_heights_are_above_the_floor(tmp_path):
    [toss] = load_log(written(tmp_path, POSE, {"length_scale": 0.98, "floor_height": 0.7})).tosses
    np.testing.assert_allclose(toss.position, POSITION / 0.98 - [0.0, 0.7, 0.0])


def test_tosses_keep_their_order_and_may_alternate(tmp_path):
    both = {name: np.repeat(values, 2) for name, values in POSE.items()} | {"toss": ["second", "1"] * FRAMES}
    header = written(tmp_path, both)
    assert [toss.name for toss in load_log(header).tosses] == ["second", "1"]
    for toss in load_log(header).tosses:
        assert_is_the_motion(toss)


def test_rate_stands_in_for_times(tmp_path):
    without = {name: values for name, values in POSE.items() if name != "t"}
    [toss] = load_log(written(tmp_path, without, {"rate": RATE})).tosses
    assert_is_the_motion(toss)


def test_shipped_tosses_come_to_rest_on_a_face():
    """Only with the right order of the quaternion and axis up: a face is down, and the centre at half of the recorded side, 2.1 % short."""
    log = load_log("toss-cube")
    assert len(log.tosses) == 100
    assert log.irregularities == ()
    for toss in log.tosses:
        downward = Rotation.from_quat(toss.orientation[-1]).as_matrix()[1]
        assert np.abs(downward).max() > 0.999
        assert toss.position[-1, 1] == pytest.approx(0.979 * 0.0524, abs=1.5e-3)


@pytest.mark.parametrize(
    ("ending", "names", "expected"),
    [
        ("csv", ["NA", "null"], ["NA", "null"]),
        ("npz", [1700000000.0, 1700000001.0], ["1700000000", "1700000001"]),
        ("npz", np.float32([1.0, 1.5]), ["1", "1.5"]),
        ("parquet", [0.1234567, 0.1234568], ["0.1234567", "0.1234568"]),
        ("mcap", [20260101, 20260102], ["20260101", "20260102"]),
    ],
)
def test_tosses_of_different_names_are_different(tmp_path, ending, names, expected):
    both = {name: np.repeat(values, 2) for name, values in POSE.items()} | {"toss": np.tile(names, FRAMES)}
    assert [toss.name for toss in load_log(written(tmp_path, both, name=f"toss.{ending}")).tosses] == expected


def changed(**values):
    """The columns with some of them changed or, for None, left out."""
    return {name: column for name, column in (POSE | values).items() if column is not None}


def with_value(name, row, value):
    column = POSE[name].astype(object)
    column[row] = value
    return changed(**{name: column})


def with_times(change):
    t = T.copy()
    change(t)
    return changed(t=t)


def quaternion_times(factor):
    return changed(**{name: np.where(np.arange(FRAMES) == 4, factor * POSE[name], POSE[name]) for name in ("qx", "qy", "qz", "qw")})


WRONG = {
    "nan": (
        with_value("y", 3, np.nan),
        "toss.csv: column y: row 4 has no number; give a finite number, or leave out rows without tracking",
    ),
    "infinite": (with_value("qx", 0, np.inf), "column qx: row 1 has inf"),
    "text": (with_value("z", 5, "lost"), "column z: row 6 has 'lost'; give a finite number"),
    "decimal comma": (with_value("z", 5, '"0,5"'), "column z: row 6 has '0,5'"),
    "one row": ({name: values[:1] for name, values in POSE.items()}, "toss 1: got 1 state; give at least two"),
    "no row": ({name: values[:0] for name, values in POSE.items()}, "has no rows; give a row for each frame"),
    "no toss": (changed(toss=["a"] * (FRAMES - 1) + [""]), "toss.csv: column toss: row 40 has no name; give a number or a text of up to"),
    "long name of a toss": (changed(toss=["a" * 101] * FRAMES), "column toss: row 1 has a name of 101 characters; give a number or a"),
    "one row of a toss": (changed(toss=["a"] * (FRAMES - 1) + ["b"]), "toss b: got 1 state; give at least two"),
    "equal times": (with_times(lambda t: t.__setitem__(5, t[4])), "do not increase: 0.04 s is after 0.04 s; leave out one of the two"),
    "times back": (with_times(lambda t: t.__setitem__(5, 0.01)), "toss 1: the times do not increase: 0.01 s is after 0.04 s; give"),
    "zero quaternion": (quaternion_times(0.0), "toss 1: the quaternion of row 5 has length 0; give unit quaternions"),
    "long quaternion": (quaternion_times(1.2), "the quaternion of row 5 has length 1.2"),
    "no time": (changed(t=None), "toss.toml: neither a column t nor the key rate says when the frames were taken; give one"),
    "missing column": (changed(qw=None), "toss.csv: has no column qw; it has t, x, y, z, qx, qy, qz"),
    "part of a velocity": (changed(vx=T), "has no column vy, vz"),
    "unknown column": (changed(time=T), "column 'time' is unknown. Allowed: t, x, y, z"),
    "semicolons": ({";".join(POSE): T}, "column 't;x;y;z;qx;qy;qz;qw' is unknown: semicolons separate the values; separate them by commas"),
    "tabs": ({"\t".join(POSE): T}, "is unknown: tabs separate the values; separate them by commas"),
    "no name": (changed(t=None) | {"": T}, "toss.csv: column 8 has no name: the first line ends in a separator; leave it out there"),
    "no name within": ({"": T} | POSE, "toss.csv: column 1 has no name; leave it out, as the number of a row, or name it"),
    "a name twice": ({" x": T} | POSE, "toss.csv: column 'x' is there twice; give each column once"),
    "times that look equal": (
        with_times(lambda t: t.__setitem__(5, t[4] - 1e-9)),
        "0.04 s is after 0.04 s; give the states in the order of time (row 6)",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_values_and_columns_are_one_line(tmp_path, case):
    columns, message = WRONG[case]
    with pytest.raises(DropspinError) as caught:
        load_log(written(tmp_path, columns))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


LATER = np.where(T < 0.1, None, 1.0)
"""A column that the first messages do not have."""
ARRAYS = {
    "text": (changed(z=np.array(["a"] * FRAMES)), "toss.npz: column z: row 1 has 'a'"),
    "matrix": (changed(z=np.zeros((FRAMES, 2))), "z has shape (40, 2) and type float64; give one number a row"),
    "objects": (changed(z=np.array([{}] * FRAMES)), "z has shape (40,) and type object"),
    "lengths": (changed(z=T[:-1]), "the columns have different lengths"),
    "yes and no": (changed(z=T > 0.1), "z has shape (40,) and type bool"),
    "no toss": (changed(toss=np.where(T > 0.1, np.nan, 1.0)), "toss.npz: column toss: row 12 has no name; give a number or a text"),
    "nan": (changed(z=np.where(T > 0.1, np.nan, T)), "column z: row 12 has no number"),
}


def test_values_without_a_name_are_refused(tmp_path):
    header = written(tmp_path, POSE)
    text = (tmp_path / "toss.csv").read_text()
    (tmp_path / "toss.csv").write_text("\n".join([line + ",0" if number else line for number, line in enumerate(text.splitlines())]))
    with pytest.raises(DropspinError, match=r"toss\.csv: rows have more values than the first line has names; name every column\.$"):
        load_log(header)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("t,x,y".encode("utf-16"), "is text in UTF-16; save it as UTF-8"),
        (b"# timestamp tx ty tz\n0.0 1 2 3\n", "spaces separate the values; separate them by commas"),
        (b"format,1.2,rate,240,240\nt,x,y,z\n", "column '240' is there twice; .* and the names of the columns in the first line alone"),
    ],
)
def test_exports_of_other_programs_are_refused_with_what_to_do(tmp_path, content, message):
    header = written(tmp_path, POSE)
    (tmp_path / "toss.csv").write_bytes(content)
    with pytest.raises(DropspinError, match=message):
        load_log(header)


@pytest.mark.parametrize("case", ARRAYS)
def test_wrong_array_is_one_line(tmp_path, case):
    columns, message = ARRAYS[case]
    with pytest.raises(DropspinError) as caught:
        load_log(written(tmp_path, columns, name="toss.npz"))
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("topics", "encoding", "message"),
    [
        ({"/a": POSE, "/b": POSE}, "json", "toss.mcap: has several topics (/a, /b); name one in the header, as topic"),
        ({"/a": POSE}, "ros1", "a message of topic /a is not a JSON object of the columns"),
        ({"/a": {"x": T}}, "json", "has no column y, z, qx, qy, qz, qw; it has x"),
        ({"/a": with_value("x", 10, True)}, "json", "toss.mcap: column x: row 11 has True; give a finite number"),
        ({"/a": with_value("x", 10, None)}, "json", "toss.mcap: column x: row 11 has no number; give a finite number"),
        ({"/a": changed(**dict.fromkeys(("vx", "vy", "vz"), LATER))}, "json", "toss.mcap: column vx: row 1 has no number; give a finite"),
        ({"/a": changed(foo=LATER)}, "json", "toss.mcap: column 'foo' is unknown"),
        ({}, "json", "has no message"),
    ],
)
def test_wrong_mcap_file_is_one_line(tmp_path, topics, encoding, message):
    header = written(tmp_path, POSE, name="toss.mcap")
    write_mcap(tmp_path / "toss.mcap", topics, encoding)
    with pytest.raises(DropspinError) as caught:
        load_log(header)
    assert message in str(caught.value)


def test_one_topic_of_an_mcap_file_is_read(tmp_path):
    header = written(tmp_path, POSE, {"topic": "/a"}, name="toss.mcap")
    write_mcap(tmp_path / "toss.mcap", {"/a": POSE, "/b": {"x": T}})
    assert_is_the_motion(load_log(header).tosses[0])


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("toss-cub", "recording 'toss-cub' is unknown. Did you mean 'toss-cube'? Known: toss-cube."),
        ("toss.csv", "toss.csv: is the data of a recording; give its header, a TOML file with the keys data and [body]"),
        ("absent.toml", "absent.toml: No such file or directory"),
        (".", "is a directory"),
    ],
)
def test_what_is_no_header_is_one_line(tmp_path, monkeypatch, given, message):
    written(tmp_path, POSE)
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DropspinError) as caught:
        load_log(given)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ({"upp": "z"}, "toss.toml: upp: unknown key. Allowed: data, topic, source, body, floor, rate, up"),
        ({"up": "w"}, "toss.toml: up: got 'w'; must be 'x', '-x', 'y', '-y', 'z' or '-z'"),
        ({"rate": -1.0}, "rate: got -1.0; must be greater than 0"),
        ({"body": {"shape": "box", "mass": 1.0}}, "body.half_extents: missing"),
        ({"data": "absent.csv"}, "absent.csv: No such file or directory"),
        ({"data": "toss.toml"}, "is not the data of a recording; give a file that ends in .csv, .parquet, .npz, .mcap"),
    ],
)
def test_wrong_header_is_one_line(tmp_path, header, message):
    path = written(tmp_path, POSE)
    path.write_text(tomlkit.dumps({"data": "toss.csv", "body": BODY} | header))
    with pytest.raises(DropspinError) as caught:
        load_log(path)
    assert message in str(caught.value)


@pytest.mark.parametrize("ending", ["npz", "parquet", "mcap", "csv"])
def test_damaged_file_is_one_line(tmp_path, ending):
    """Every file with ten bytes changed, or cut off, loads or is refused in one line."""
    header, refused = written(tmp_path, POSE, name=f"toss.{ending}"), list[str]()
    sound, draw = (tmp_path / f"toss.{ending}").read_bytes(), np.random.default_rng(0)
    for _ in range(40):
        raw = bytearray(sound[: draw.integers(1, len(sound))] if draw.random() < 0.3 else sound)
        for place in draw.integers(0, len(raw), 10):
            raw[place] = draw.integers(256)
        (tmp_path / f"toss.{ending}").write_bytes(raw)
        try:
            load_log(header)
        except DropspinError as error:
            refused.append(str(error))
    assert len(refused) > 20
    assert all(message.isprintable() for message in refused)


def test_too_many_rows_are_refused_before_they_are_read(tmp_path, monkeypatch):
    """Of an array of 1e8 numbers, only the head is in the file."""
    header = written(tmp_path, POSE, name="toss.npz")
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (100_000_000,)})
    with zipfile.ZipFile(tmp_path / "toss.npz", "w") as archive:
        for name in POSE:
            archive.writestr(f"{name}.npy", head.getvalue())
    with pytest.raises(DropspinError, match=r"has more than 1,000,000 rows, the limit for a recording; give fewer tosses\.$"):
        load_log(header)


@pytest.mark.parametrize("ending", ["csv", "parquet", "mcap"])
def test_rows_are_limited_in_every_format(tmp_path, monkeypatch, ending):
    monkeypatch.setattr(formats, "MOST_ROWS", FRAMES - 1)
    with pytest.raises(DropspinError, match="has more than 39 rows"):
        load_log(written(tmp_path, POSE, name=f"toss.{ending}"))


def facts(log):
    return [(fact.kind, fact.toss, fact.frame, round(fact.value, 6), round(fact.expected, 6)) for fact in log.irregularities]


def test_long_steps_of_uneven_times_are_no_missing_frames(tmp_path):
    steps = 0.01 * np.random.default_rng(1).uniform(0.4, 1.8, FRAMES - 1)
    log = load_log(written(tmp_path, POSE | {"t": np.concatenate([[0.0], np.cumsum(steps)])}, {}))
    assert {finding.kind for finding in log.irregularities} == {"jitter"}


@pytest.mark.parametrize(("rate", "digits"), [(240.0, 3), (120.0, 3), (30.0, 2)])
def test_rounded_times_have_the_rate_of_their_mean_step(tmp_path, rate, digits):
    """At 240 frames per second, most steps of times in whole milliseconds are of 4 ms."""
    columns = POSE | {"t": np.round(np.arange(FRAMES) / rate, digits)}
    assert "rate" not in {finding.kind for finding in load_log(written(tmp_path, columns, {"rate": rate})).irregularities}
    wrong = load_log(written(tmp_path, columns, {"rate": 1.1 * rate}))
    [found] = [finding for finding in wrong.irregularities if finding.kind == "rate"]
    assert found.value == pytest.approx(rate, rel=0.02)


def test_times_with_steps_of_one_and_of_two_units_fit_the_rate_of_the_header(tmp_path):
    """At 75 frames per second, times in hundredths of a second; a step of two looks like a missing frame."""
    log = load_log(written(tmp_path, POSE | {"t": np.round(np.arange(FRAMES) / 75.0, 2)}, {"rate": 75.0}))
    assert "rate" not in {finding.kind for finding in log.irregularities}


def test_repeated_rows_missing_frames_uneven_times_and_another_rate_are_facts(tmp_path):
    rows = np.delete(np.arange(FRAMES), [20, 21, 30])
    held = np.where((rows >= 10) & (rows < 13), 10, rows)
    columns = {name: values[held] for name, values in POSE.items()} | {"t": T[rows]}
    columns["t"][-1] += 0.001
    log = load_log(written(tmp_path, columns, {"rate": 101.0}))
    assert facts(log) == [
        ("repeated", "1", 11, 2.0, 0.0),
        ("gap", "1", 20, 2.0, 0.0),
        ("gap", "1", 28, 1.0, 0.0),
        ("jitter", "1", 36, 0.011, 0.01),
        ("rate", "", None, 100.0, 101.0),
    ]


NOISE = dict(zip(POSE, 2e-4 * np.random.default_rng(3).normal(size=(len(POSE), FRAMES)), strict=True))
NOISY = {name: values + NOISE[name] for name, values in POSE.items() if name != "t"}
STILL = np.minimum(np.arange(FRAMES), 20)
"""Rows of which the first 21 are of a motion that ends there."""


@pytest.mark.parametrize(
    ("first", "end", "columns", "fact"),
    [
        (10, 24, "xyzq", ("repeated", "1", 11, 13.0, 0.0)),
        (0, 12, "xyzq", ("repeated", "1", 1, 11.0, 0.0)),
        (30, FRAMES, "xyzq", ("repeated", "1", 31, 9.0, 0.0)),
        (20, 22, "xyz", ("repeated position", "1", 21, 1.0, 0.0)),
        (0, 2, "q", ("repeated orientation", "1", 1, 1.0, 0.0)),
    ],
)
def test_frozen_rows_are_facts_however_long_and_wherever_they_are(tmp_path, first, end, columns, fact):
    rows = np.arange(FRAMES)
    held = np.where((rows >= first) & (rows < end), first, rows)
    given = {name: values[held] if name[0] in columns else values for name, values in NOISY.items()}
    assert facts(load_log(written(tmp_path, given, {"rate": RATE}))) == [fact]


@pytest.mark.parametrize(
    "columns",
    [
        {name: values[STILL] for name, values in POSE.items()},
        {name: values[STILL] + NOISE[name] for name, values in POSE.items()},
        {name: np.round(values, 2 if name in "xyz" else 3) for name, values in (NOISY | {"x": 0.2 * T, "z": 0.1 * T}).items()},
        {name: values[STILL] if name[0] == "q" else values for name, values in POSE.items()},
    ],
    ids=["stops at once", "rests with noise", "rounded to 1 cm", "stops turning"],
)
def test_rest_and_rounding_are_no_frozen_rows(tmp_path, columns):
    columns = {name: values for name, values in columns.items() if name != "t"}
    assert facts(load_log(written(tmp_path, columns, {"rate": RATE}))) == []


def test_body_at_rest_in_rounded_rows_is_no_fact(tmp_path):
    """Rounded to 1 mm and 1 ms at 100 Hz, with a second of rest."""
    still = {name: np.concatenate([values, np.full(100, values[-1])]) for name, values in POSE.items()}
    still |= {name: np.round(still[name], 3) for name in "xyz"} | {"t": np.arange(len(still["t"])) / RATE}
    assert load_log(written(tmp_path, still, {"rate": RATE})).irregularities == ()


def test_impossible_inertia_of_a_header_is_warned_of(tmp_path):
    """Ten times that of the solid; a shell of the same mass has up to three times as much."""
    path = written(tmp_path, recorded("y"), inertia=[0.0167, 0.0167, 0.0167])
    with pytest.warns(SceneWarning, match=r"^.*toss\.toml: body\.inertia: got .* needs mass outside of the body"):
        load_log(path)
