"""`dropspin log check`: output, files and exit codes of sound and faulty recordings, and wrong command lines."""

import json
import re
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import tomlkit
from support.cli import TERMINAL, assert_refused, dropspin
from support.tosses import BRICK, made

from dropspin.comparisons.logs.check import TossFacts, Value
from dropspin.comparisons.logs.continued_tosses import flights_in
from dropspin.comparisons.logs.fit import Estimate, LogFit
from dropspin.comparisons.logs.log import Cause, Finding, load_log
from dropspin.reports.stories.log_check import SPINNING, CheckedLog
from dropspin.reports.stories.log_findings import sentence
from dropspin.reports.stories.log_fit import FittedLog
from dropspin.reports.study_files import read_study
from dropspin.scenarios import DropspinError, load


@pytest.fixture
def recording(tmp_path):
    """A folder with a sound recording of ten tosses, toss.toml, whose columns are in mm."""
    tosses = made(1, 10, (2e-4, 2e-3)).log.tosses
    rows = {
        "toss": np.repeat([toss.name for toss in tosses], [len(toss) for toss in tosses]),
        "t": np.concatenate([toss.t for toss in tosses]),
        **dict(zip("xyz", 1e3 * np.vstack([toss.position for toss in tosses]).T, strict=True)),
        **dict(zip(["qx", "qy", "qz", "qw"], np.vstack([toss.orientation for toss in tosses]).T, strict=True)),
    }
    np.savez(tmp_path / "toss.npz", **rows)
    for name, keys in {"toss": {}, "short": {"length_scale": 1.02}}.items():
        (tmp_path / f"{name}.toml").write_text(tomlkit.dumps({"data": "toss.npz", "length_unit": "mm", **keys, "body": BRICK}))
    return tmp_path


@pytest.fixture(scope="module")
def cube(tmp_path_factory):
    """The folder in which the shipped tosses were checked, and what was printed."""
    folder = tmp_path_factory.mktemp("cube")
    done = dropspin("log", "check", "toss-cube", "-o", "out", cwd=folder)
    assert done.returncode == 1
    return folder, done.stdout


@pytest.mark.extended
def test_sound_recording_has_values_and_no_finding(recording):
    done = dropspin("log", "check", "toss.toml", cwd=recording, **TERMINAL)
    assert done.returncode == 0, done.stdout + done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) <= 40
    assert max(map(len, lines)) <= 80
    assert lines[0].startswith("toss.toml: 10 tosses; 10 flights with ")
    assert lines[-2:] == ["0 findings.", "Written: out/log-check/report.html"]
    folder = recording / "out/log-check"
    rows = json.loads((folder / "log_check.json").read_text())
    assert len(rows) == pq.read_table(folder / "log_check.parquet").num_rows
    [gravity] = [row for row in rows if row["name"] == "gravity"]
    assert gravity["low"] < 9.81 < gravity["high"]
    assert "10 tosses; 10 flights" in (folder / "report.html").read_text()
    assert CheckedLog.model_validate_json((folder / "section.json").read_text()).findings == []


@pytest.mark.extended
def test_finding_is_printed_with_alternatives_and_remedy_and_is_exit_code_1(recording):
    done = dropspin("log", "check", "short.toml", "-o", "out", cwd=recording)
    assert done.returncode == 1
    said = r"Gravity is .* m/s² .*: either lengths are (.*) % short, or the rate is (.*) % low, or gravity there"
    found = re.search(said, done.stdout)
    assert found is not None, done.stdout
    assert [float(number) for number in found.groups()] == pytest.approx([2.0, 1.0], abs=0.3)
    data = json.loads((recording / "out" / "log_check.json").read_text())
    assert [row["kind"] for row in data if row["row"] == "findings"] == ["scale"]


@pytest.mark.extended
def test_scene_of_each_toss_continues_it(cube):
    folder, _ = cube
    files = sorted((folder / "out" / "scenes").glob("*.toml"))
    assert len(files) == 101
    flights = flights_in("toss-cube")
    [start] = [start for start in flights.starts() if start.toss.name == "4"]
    scene = load(folder / "out" / "scenes" / "toss-4.toml")
    np.testing.assert_allclose(scene.initial_state, start.state, rtol=0.0, atol=1e-9)
    [toss] = scene.recording.tosses
    frames = start.toss.t[start.frame + 1 :] - start.toss.t[start.frame]
    np.testing.assert_allclose(toss.t, frames, rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(toss.position, start.toss.position[start.frame + 1 :], rtol=0.0, atol=1e-6)
    assert frames[-1] < scene.duration < frames[-1] + 0.03
    every = load(folder / "out" / "scenes" / "tosses.toml")
    assert len(every.recording.tosses) == 100
    np.testing.assert_array_equal(every.initial_state, scene.initial_state)
    assert scene.floor == flights.log.header.floor


@pytest.mark.extended
def test_corrected_header_has_the_remedies_and_loads(cube):
    folder, _ = cube
    log = load_log(folder / "out" / "corrected.toml")
    assert (log.header.length_scale, log.header.body.center_of_mass) == (0.978, (-0.0002, 0.0009, 0.0061))
    assert len(log.tosses) == 100


def test_check_is_kept_if_scenes_cannot_start_above_the_floor(recording, monkeypatch):
    """As with the centre of mass in a wrong place, which is the finding."""

    def below(flights):
        raise DropspinError("toss 1: the body is 34 mm below the floor during its flight.")

    monkeypatch.setattr("dropspin.comparisons.logs.continued_tosses.measured_scene", below)
    with (recording / "toss.toml").open("a") as file:
        file.write("[floor]\nrestitution = 0.5\nfriction = 0.5\n")
    done = dropspin("log", "check", "toss.toml", "-o", "out", cwd=recording)
    assert (done.returncode, done.stdout.splitlines()[-2]) == (0, "0 findings.")
    assert "scenes/ is not written: toss 1: the body is 34 mm below the floor during its flight." in done.stderr
    assert {"report.html", "corrected.toml"} <= {path.name for path in (recording / "out").iterdir()}


def test_page_shows_what_is_printed_of_the_shipped_tosses(cube):
    """Line by line, up to the places at which lines are broken."""
    page = (Path(__file__).parents[3] / "docs" / "measured.md").read_text(encoding="utf-8")
    [shown] = re.findall(r"^```text\n(toss-cube: .*?)^```$", page, re.DOTALL | re.MULTILINE)
    printed = " ".join(cube[1].split())
    assert [part for part in shown.split("…\n") if " ".join(part.split()) not in printed] == []


@pytest.mark.extended
def test_fit_and_comparison_write_pages_and_name_what_to_correct(recording):
    """With lengths that a header calls 2 % long, which they are not, gravity is too small."""
    header = tomlkit.parse((recording / "short.toml").read_text()) | {"floor": {"restitution": 0.3, "friction": 0.3}}
    (recording / "short.toml").write_text(tomlkit.dumps(header))
    for command, rows in (("fit", {"estimates"}), ("compare", {"errors", "groups", "parts"})):
        done = dropspin("log", command, "short.toml", "-e", "wang[contact=sequential,law=coulomb]", "-o", command, cwd=recording)
        assert done.returncode == 0, done.stderr
        assert "lengths are" in done.stdout
        assert "Correct the header first: dropspin log check short.toml writes corrected.toml" in done.stdout
        assert {row["row"] for row in json.loads((recording / command / f"log_{command}.json").read_text())} == rows
        assert "Correct the header first" in (recording / command / "report.html").read_text()
        assert read_study(str(recording / command)).title.endswith("short.toml")


def test_many_findings_of_one_kind_are_shortened_on_a_terminal_alone():
    findings = [Finding("gap", 1.0, 0.0, str(number), 7) for number in range(5)]
    study = CheckedLog(recording="r", values=[], findings=findings, tosses=[])
    texts = [list(part.items) for part in study.document().parts if part.kind == "sentences"]
    assert [len(items) for items in texts] == [5, 4]
    assert texts[1][-1] == "2 more findings of this kind (gap)."


@pytest.mark.parametrize(("half_width", "needs"), [(0.03, "about 90 tosses like these, or a faster spin"), (np.inf, "a faster spin")])
def test_value_that_no_toss_determines_says_what_it_needs(half_width, needs):
    values = [
        Value("centre of mass, x", 0.0, -half_width, half_width, "m", 0.01),
        Value("I_x / I_y over the header's", 1e-304, 0.0, 1e304, "", 1e-305),
    ]
    study = CheckedLog(recording="r", values=values, findings=[], tosses=[TossFacts(str(number), 0, 9, 1.0) for number in range(10)])
    [table] = [part for part in study.document().parts if part.kind == "table"]
    assert [row["value"] for row in table.rows] == ["not identifiable"] * 2
    assert [row["95 % interval"] for row in table.rows] == [f"needs {needs}", f"needs {SPINNING}"]


@pytest.mark.parametrize(("touches", "reason"), [(True, "no toss slides"), (False, "no body touches the floor of the header")])
def test_parameter_without_contact_is_not_identified_because_of_the_floor(touches, reason):
    unknown = [Estimate("wang", name, 0.5, 0.0, 1.0, False, False) for name in ("friction", "restitution")]
    fit = LogFit(8, 8, tuple(unknown), (), None, {"wang": 0.05}, {}, touches)
    [sentences] = [part.items for part in FittedLog(recording="r", findings=[], fit=fit).document().parts if part.kind == "sentences"]
    assert reason in next(sentence for sentence in sentences if sentence.startswith("Friction is not identified with wang: "))


@pytest.mark.parametrize(
    ("finding", "text"),
    [
        (
            Finding("floor", -0.35, 0.0, causes=(Cause("floor", keys={"floor_height": -0.25}),)),
            "Bodies at rest are 350 mm below the floor of the header: the floor is at another height. Remedy: floor_height = -0.25.",
        ),
        (
            Finding("frame dropped", 1.0, 0.0, "2", 15),
            "Toss 2: number of frames missing before frame 15: 1. Remedy: give the exact time of each frame in a column t.",
        ),
    ],
)
def test_sentence_on_a_finding(finding, text):
    assert sentence(finding) == text


def test_help_of_log_lists_its_commands(tmp_path):
    helped = dropspin("log", "--help", cwd=tmp_path)
    assert helped.returncode == 0
    assert re.findall(r"^  (\w+)  +", helped.stdout, re.MULTILINE) == ["check", "compare", "fit"]
    alone = dropspin("log", cwd=tmp_path)
    assert (alone.returncode, alone.stderr) == (2, helped.stdout)


@pytest.mark.sample(3)
@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("log", "chek"), "No such command 'chek'. Did you mean 'check'? To list the arguments and options: dropspin log --help"),
        (("log", "check", "toss-cub"), "recording 'toss-cub' is unknown. Did you mean 'toss-cube'?"),
        (("log", "check", "toss.npz"), "toss.npz: is the data of a recording; give its header"),
        (("log", "check", "absent.toml"), "absent.toml: No such file or directory"),
        (("log", "check", "still.toml"), "no toss has "),
    ],
)
def test_wrong_recordings_are_refused_and_nothing_is_written(arguments, message, recording):
    rows = {name: np.full(50, float(name == "qw")) for name in ("x", "y", "z", "qx", "qy", "qz", "qw")}
    np.savez(recording / "still.npz", **rows)
    (recording / "still.toml").write_text(tomlkit.dumps({"data": "still.npz", "rate": 100.0, "body": BRICK}))
    done = dropspin(*arguments, cwd=recording)
    assert_refused(done, message)
    assert not (recording / "out").exists()
