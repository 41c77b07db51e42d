"""The record of releases: measured once, resumed, merged, and refused if changed. pip and npm are replaced: no test needs a network.

The file is longer than 300 lines because it tests every way in which a release, a file or an index can fail.
"""

import re
import sys
from pathlib import Path
from threading import Event

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.cli import assert_refused, dropspin

import dropspin as ds
from dropspin.comparisons.engines.registry import BUILT_IN
from dropspin.comparisons.record import environments, release, study
from dropspin.comparisons.record.environments import measured, without_paths
from dropspin.comparisons.record.plan import Plan, load_plan
from dropspin.comparisons.record.store import HASH, OTHERS, OWN, SCHEMA, Record, machine, stored
from dropspin.comparisons.results.complete_folders import sha256
from dropspin.comparisons.running.driving import Breakdown
from dropspin.comparisons.running.timing import TimedSteps
from dropspin.scenarios import DropspinError, load

RELEASES = ["1.0", "1.1", "1.2"]
PLAN = Plan.model_validate(
    {
        "dts": [0.01],
        "scenes": ["spin-principal"],
        "engines": {"wang": {"package": "dropspin", "oldest": "1.0", "labels": ["wang", "wang[rotation=exact]"]}},
    }
)


class Stub:
    """Measures a release without an environment: the value is the release's number; some releases raise."""

    def __init__(self):
        self.asked, self.failures = [], {}

    def __call__(self, plan, engine, release, time_limit, stopping):
        self.asked.append(release)
        if release in self.failures:
            raise self.failures[release]
        row = {"label": "wang", "scene": "spin-principal", "dt": 0.01, "metric": "energy_error", "unit": "1", "verdict": "measured"}
        return {"rows": [row | {"value": float(release), "reason": ""}], "versions": f"numpy {release}"}


@pytest.fixture
def stub(monkeypatch):
    replaced = Stub()
    monkeypatch.setattr(study, "measured", replaced)
    monkeypatch.setattr(study, "releases", lambda package, oldest: RELEASES)
    return replaced


def record(folder, plan=PLAN, on_done=lambda one, left: None, **given):
    study.record(Record(folder), plan, jobs=1, time_limit=10.0, on_done=on_done, **given)


def table(folder):
    rows = pd.read_parquet(folder).sort_values(["engine", "release", "processor"], ignore_index=True)
    return rows.fillna(-1.0)  # NaN differs from itself


def files(folder):
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_complete_release_is_not_measured_again(stub, tmp_path):
    record(tmp_path, chosen=["1.1"])
    before = files(tmp_path)
    record(tmp_path)
    assert stub.asked == ["1.1", "1.0", "1.2"]
    assert before.items() <= files(tmp_path).items()
    rows = table(tmp_path)
    assert rows[["release", "value", "profile", "versions", "origin"]].to_numpy().tolist() == [
        [release, float(release), "calibrated", f"numpy {release}", "own"] for release in RELEASES
    ]
    assert rows.loc[0, ["processor", "system", "python"]].to_dict() == machine()


def test_a_changed_plan_is_measured_again_in_the_place_of_the_old(stub, tmp_path):
    record(tmp_path)
    record(tmp_path, PLAN.model_copy(update={"dts": (0.02,)}))
    assert stub.asked == 2 * RELEASES
    assert len(table(tmp_path)) == 3


def test_an_interrupt_keeps_whole_files_and_the_next_call_continues(stub, tmp_path):
    def interrupt(one, left):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record(tmp_path, on_done=interrupt)
    kept, before = set(table(tmp_path)["release"]), len(stub.asked)
    assert kept
    assert not list(tmp_path.rglob(".*"))
    record(tmp_path)
    assert not kept & set(stub.asked[before:])
    assert table(tmp_path)["release"].tolist() == RELEASES


def test_a_release_that_fails_costs_its_own_row(stub, tmp_path):
    stub.failures = {"1.0": Breakdown("missing", "not installable: no wheel"), "1.1": Breakdown("broken", "not runnable: exit code -11")}
    record(tmp_path)
    rows = table(tmp_path)
    assert rows["verdict"].tolist() == ["missing", "broken", "measured"]
    assert rows["reason"].tolist() == ["not installable: no wheel", "not runnable: exit code -11", ""]
    before = files(tmp_path)
    record(tmp_path)  # another day it may be installable
    assert stub.asked == [*RELEASES, "1.0"]
    assert files(tmp_path) == before
    stub.failures = {}
    record(tmp_path)
    assert table(tmp_path)["verdict"].tolist() == ["measured", "broken", "measured"]


def test_results_stay_where_a_release_can_no_longer_be_measured(stub, tmp_path):
    """Its environment may fail another day, because the disk is full or a package has left the index."""
    record(tmp_path)
    before, said = files(tmp_path), []
    stub.failures = {"1.1": Breakdown("missing", "not installable: no space left")}
    changed = PLAN.model_copy(update={"dts": (0.02,)})
    record(tmp_path, changed, chosen=["1.1"], on_done=lambda one, left: said.append(one))
    assert files(tmp_path) == before
    assert said == ["wang 1.1: not installable: no space left; the earlier file stays"]


def test_workers_of_a_cluster_measure_with_their_own_machine_in_the_rows(stub, tmp_path, monkeypatch):
    """Workers are threads of this process, with the stub in place of pip; the record is the one of this machine."""
    distributed = pytest.importorskip("distributed")
    record(tmp_path / "here", chosen=["1.0", "1.1"])
    monkeypatch.setattr(study, "machine", lambda: machine() | {"processor": "of the worker"})
    there = tmp_path / "there"
    with distributed.LocalCluster(1, threads_per_worker=2, processes=False, protocol="tcp", dashboard_address=None) as cluster:
        record(there, scheduler=cluster.scheduler_address)
        assert sorted(stub.asked) == sorted(["1.0", "1.1", *RELEASES])
        record(there, scheduler=cluster.scheduler_address)
    assert len(stub.asked) == 5  # what the workers have measured is not measured again
    rows = table(there)
    assert set(rows["processor"]) == {"of the worker"}
    columns = ["release", "value", "label", "scene", "versions"]
    assert rows.iloc[:2][columns].equals(table(tmp_path / "here")[columns])


def rewrite(path, **changes):
    """Change a file of one row."""
    row = pq.ParquetFile(path).read().to_pylist()[0] | changes
    types = pa.schema([(field.name, pa.string() if isinstance(row[field.name], str) else field.type) for field in SCHEMA])
    pq.write_table(pa.Table.from_pylist([row], types), path)


@pytest.fixture
def two_records(stub, tmp_path, monkeypatch):
    """Of two machines."""
    mine, sent = tmp_path / "mine", tmp_path / "sent"
    record(mine)
    monkeypatch.setattr(study, "machine", lambda: machine() | {"processor": "another"})
    record(sent, chosen=["1.0", "1.2"])
    return mine, sent


def test_merging_loses_nothing_and_merging_twice_changes_nothing(two_records):
    mine, sent = two_records
    expected = sorted([*table(mine).drop(columns="origin").to_numpy().tolist(), *table(sent).drop(columns="origin").to_numpy().tolist()])
    assert dropspin("record", "--merge", sent, "-o", mine, cwd=mine).stdout == f"2 files added to {mine}, as unsigned\n"
    after = files(mine)
    rows = table(mine)
    assert sorted(rows.drop(columns="origin").to_numpy().tolist()) == expected
    assert rows["origin"].tolist() == ["own", "unsigned", "own", "own", "unsigned"]
    assert Record(mine).merge([str(sent), *map(str, sent.rglob("*.parquet"))]) == []
    assert Record(sent).merge([str(mine)]) == sorted(path.name for path in (mine / OWN).iterdir())
    assert files(mine) == after


def test_a_changed_digit_is_refused_with_the_name_of_the_file(two_records):
    mine, sent = two_records
    path = max(sent.rglob("*.parquet"))
    rewrite(path, value=1.2 + 4e-16)
    before = files(mine)
    assert_refused(dropspin("record", "--merge", sent, "-o", mine, cwd=mine), f"{path.name}: refused: it was changed")
    assert files(mine) == before


@pytest.mark.parametrize(
    ("column", "value", "words"),
    [
        ("value", "0.5", "other columns or types"),
        ("unit", "m", "another unit"),
        ("metric", "beauty", "a metric that dropspin does not have"),
        ("verdict", "wonderful", "a verdict that dropspin does not have"),
        ("dt", -0.01, "a time step that is not above 0"),
        ("dt", np.inf, "a time step that is not above 0 and finite"),
        ("profile", "default", "another profile"),
        ("release", "1.3", "another engine or release than its name"),
        ("reason", "cannot open /home/someone/engine.so", "a path"),
        ("reason", "\x1b[2J", "control characters"),
        ("trajectory", "12", "no SHA-256"),
        ("label", "mujoco", "a label of another engine"),
        ("measured", "yesterday", "isoformat"),
    ],
)
def test_rows_that_no_record_has_are_refused(two_records, column, value, words):
    """With the right hash in the name: whoever writes a file can compute it."""
    mine, sent = two_records
    path = max(sent.rglob("*.parquet"))
    rewrite(path, **{column: value})
    path = path.rename(path.with_name(f"wang-1.2-{sha256(path.read_bytes())[:HASH]}.parquet"))
    with pytest.raises(DropspinError, match=f"{re.escape(path.name)}: refused: .*{words}"):
        Record(mine).merge([str(path)])
    assert not (mine / OTHERS).exists()


@pytest.mark.parametrize(
    ("engine", "changes", "words"),
    [
        ("unicorn", [{"engine": "unicorn", "label": "", "profile": ""}], "an engine that dropspin does not have"),
        ("wang", [{"trajectory": "0" * 64}, {"trajectory": "1" * 64, "metric": "energy_drift"}], "two motions"),
        ("wang", [{"cost": 1.0}, {"cost": 2.0, "metric": "energy_drift"}], "costs of one simulation"),
        ("wang", [{"verdict": "measured"}, {"verdict": "crashed", "metric": "energy_drift"}], "verdicts"),
    ],
)
def test_files_of_unknown_engines_and_rows_that_contradict_each_other_are_refused(engine, changes, words, stub, tmp_path):
    record(tmp_path, chosen=["1.0"])
    [row] = pq.ParquetFile(*tmp_path.rglob("*.parquet")).read().to_pylist()
    path = tmp_path / "sent.parquet"
    pq.write_table(pa.Table.from_pylist([row | change for change in changes], SCHEMA), path)
    path = path.rename(tmp_path / f"{engine}-1.0-{sha256(path.read_bytes())[:HASH]}.parquet")
    with pytest.raises(DropspinError, match=f"refused: it has .*{words}"):
        stored(path)


@pytest.mark.parametrize(("name", "words"), [("results.parquet", "its name is not"), ("absent", "no file of a record")])
def test_what_is_no_record_is_refused(tmp_path, name, words):
    (tmp_path / "results.parquet").touch()
    assert_refused(dropspin("record", "--merge", name, cwd=tmp_path), words)


def test_unknown_engines_and_releases_are_refused(stub, tmp_path):
    assert_refused(dropspin("record", "-e", "mujoko", cwd=tmp_path), "mujoco")
    assert_refused(dropspin("record", "-e", "mujoco", "--release", "0.9", cwd=tmp_path), "release '0.9'")
    assert stub.asked == []


@pytest.mark.parametrize("text", ["{", "<<<<<<< HEAD\n{}", "3", "[1]"])
def test_a_damaged_list_of_releases_is_refused_in_one_line(text, stub, tmp_path):
    """As after a conflict of two branches, because the file is committed."""
    (tmp_path / "record").mkdir()
    (tmp_path / "record/_releases.json").write_text(text)
    assert_refused(dropspin("record", "-e", "mujoco", "-o", "record", cwd=tmp_path), "_releases.json: is damaged; delete it")
    assert stub.asked == []


@pytest.fixture
def installed(monkeypatch):
    """Call it with a name: in the place of pip, a package of this name and of version 9.9 is written into each new environment."""
    real = environments.run

    def install(name):
        def replaced(command, stopping):
            if "pip" not in command:
                return real(command, stopping)
            python = Path(command[command.index("--python") + 1])
            [packages] = python.parents[1].glob("[Ll]ib/**/site-packages")
            (packages / f"{name}-9.9.dist-info").mkdir()
            (packages / f"{name}-9.9.dist-info/METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 9.9\n")
            return 0, ""

        monkeypatch.setattr(environments, "run", replaced)

    return install


def test_a_release_is_measured_in_an_environment_in_which_it_hides_the_running_one(installed):
    """The engine is dropspin's own, of which a package of another version is installed; the values are those of this process."""
    installed("dropspin")
    found = measured(PLAN, "wang", "9.9", 60.0, Event())
    motion = ds.simulate("spin-principal", "wang", 0.01)
    values = ds.measure("spin-principal", motion)
    rows = [row for row in found["rows"] if row["label"] == "wang"]
    assert all(0.0 < row["cost"] <= row["median_cost"] and row["relative_cost"] > 0.0 and "low" not in row for row in rows)
    assert {row["metric"]: row["value"] for row in rows} == pytest.approx(values, rel=0.0, abs=0.0, nan_ok=True)
    assert {row["trajectory"] for row in rows} == {sha256(motion.states.tobytes())}
    assert found["versions"].startswith("dropspin 9.9, numpy ")


@pytest.mark.extended
def test_a_release_that_another_one_hides_is_not_measured(installed):
    installed("another")
    with pytest.raises(Breakdown, match=r"^not runnable: exit code 1: version .* is imported instead of 9\.9$"):
        measured(PLAN, "wang", "9.9", 60.0, Event())


def test_range_of_the_error_is_that_of_the_step_in_which_the_impact_is_found():
    """Wang's method finds an impact up to a step late: the error of the bounce height is between 0 and the distance fallen in a step."""
    scene, dt = load("drop-ball"), 4e-3
    found = release.range_over_phases(ds.engine("wang"), scene, dt)
    fallen = scene.start.position[1] - scene.body.radius
    speed = np.sqrt(2.0 * 9.8 * fallen)
    assert 0.0 <= found["low"] < 0.3 * found["high"]
    assert 0.3 * speed * dt / fallen < found["high"] < speed * dt / fallen
    assert release.range_over_phases(ds.engine("wang"), load("spin-asymmetric"), dt) == {}


def test_cost_is_the_least_of_five_timings_and_relative_to_document_timed_in_turn(monkeypatch):
    """A step takes 3, 1, 2, 5 and 4 µs of a clock, and one of `wang` 0.1 µs; with 1,000 steps a simulated second."""
    micros = iter([3.0, 1.0, 2.0, 5.0, 4.0])

    def timed(engine, scene, dt, steps):
        per_step = 0.1 if engine.label == "wang" else next(micros)
        return TimedSteps(1.0, 0.0, 1e-6 * per_step * steps, steps, np.zeros(13))

    monkeypatch.setattr(release, "time_steps", timed)
    found = release.costs(ds.engine("mujoco"), load("spin-asymmetric"), 1e-3)
    assert found == {"cost": pytest.approx(1e-3), "median_cost": pytest.approx(3e-3), "relative_cost": pytest.approx(30.0)}


def test_pip_that_fails_is_named_with_its_error(monkeypatch, tmp_path):
    monkeypatch.setattr(environments, "run", lambda command, stopping: (1, "ERROR: first\nERROR: No matching distribution\nsome advice\n"))
    with pytest.raises(Breakdown, match=r"^not installable: No matching distribution$"):
        measured(PLAN, "wang", "1.0", 60.0, Event())
    with pytest.raises(DropspinError, match="pip cannot list the releases of dropspin: No matching distribution"):
        environments.releases("dropspin", "1.0")


def test_releases_are_those_from_the_oldest_on(monkeypatch):
    output = "WARNING: experimental\nmujoco (4.0.0)\nAvailable versions: 4.0.0, 3.10.0, 3.9.0, 3.2.4, 3.2.3\n"
    monkeypatch.setattr(environments, "run", lambda command, stopping: (0, output))
    assert environments.releases("mujoco", "3.2.4") == ["3.2.4", "3.9.0", "3.10.0", "4.0.0"]
    with pytest.raises(DropspinError, match="oldest release"):
        environments.releases("mujoco", "3.2.0")


def test_a_command_ends_when_the_work_stops():
    stopping = Event()
    stopping.set()
    with pytest.raises(environments.Closed):
        environments.run([sys.executable, "-c", "import time; time.sleep(60)"], stopping)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("cannot open /home/someone/env/lib/engine.so: no", "cannot open engine.so: no"),
        (r"in C:\Users\someone\engine.dll", "in engine.dll"),
        ("the unit is m/s, not kg/m/s²", "the unit is m/s, not kg/m/s²"),
    ],
)
def test_paths_become_file_names(text, expected):
    assert without_paths(text) == expected


def test_the_plan_names_engines_with_canonical_labels():
    plan = load_plan()
    assert plan.engines.keys() <= BUILT_IN.keys()
    for name in ("mujoco", "rapier", "dart", "drake"):
        assert [ds.engine(label).label for label in plan.engines[name].labels] == list(plan.engines[name].labels)
    assert plan.engines["mjx"].requirements("3.3.0") == ["mujoco-mjx==3.3.0", "mujoco==3.3.0"]
    assert plan.engines["newton"].requirements("1.0.0") == ["newton[sim]==1.0.0"]
    assert plan.engines["pybullet"].requirements("3.2.6") == ["pybullet==3.2.6", "numpy<2", "pandas<3", "pyarrow<26"]
    assert plan.engines["pybullet"].requirements("3.2.7") == ["pybullet==3.2.7"]
    assert plan.engines["rapier-js"].requirements("0.20.0") == ["@dimforge/rapier3d-compat@0.20.0"]
    assert plan.engines["cannon-es"].requirements("0.20.0") == ["cannon-es@0.20.0"]
    assert plan.scenes_of("mjx") == ("drop-ball", "spin-dzhanibekov")
    assert plan.scenes_of("dart") == plan.scenes
    assert len({plan.digest(name) for name in plan.engines}) == len(plan.engines)  # each loads its scenes


def test_a_file_with_any_changed_byte_is_refused_or_read(two_records):
    """With the right hash in the name, so that the reader of Parquet gets it."""
    path = max(two_records[1].rglob("*.parquet"))
    content, refused = path.read_bytes(), []
    for place in range(0, len(content), max(1, len(content) // 100)):
        changed = bytearray(content)
        changed[place] ^= 0x55
        changed_file = path.with_name(f"wang-1.2-{sha256(changed)[:HASH]}.parquet")
        changed_file.write_bytes(changed)
        try:
            stored(changed_file)
        except DropspinError as error:
            refused.append(str(error).startswith(f"{changed_file.name}: refused: "))
    assert len(refused) > 50
    assert all(refused)
