"""Scenes with a recording: loading, what is refused, and the reference that they give."""

import json

import numpy as np
import pytest
from support import toss_cube_scene

from dropspin.comparisons.logs.log import load_log
from dropspin.scenarios import SceneError, load, reference_for, truth_for
from dropspin.scenarios.loading import CATALOGUE
from dropspin.scenarios.state import ORIENTATION, POSITION, VELOCITY
from dropspin.scenarios.truths.measured import measured
from dropspin.scenarios.variations import changed


@pytest.fixture
def files(tmp_path):
    """A folder with the tosses of the catalogue, and the path of a scene file beside them, which is to be written."""
    (tmp_path / "tosses.json").write_bytes((CATALOGUE / "toss-cube.json").read_bytes())
    return tmp_path


def with_table(folder, table, before=""):
    content = (CATALOGUE / "toss-cube.toml").read_text(encoding="utf-8").partition("[body]")[2]
    path = folder / "mine.toml"
    path.write_text(f"{before}\n[recording]\n{table}\n[body]{content}", encoding="utf-8")
    return path


@pytest.mark.extended
def test_catalogue_has_every_fifth_toss_of_the_shipped_recording():
    """The frames are those of the recording. The starts are estimates, which the scene keeps: newer ones are within the uncertainty."""
    shipped, made = load("toss-cube").recording, toss_cube_scene.chosen(load_log("toss-cube"))
    assert [toss.name for toss in shipped.tosses] == [toss.name for toss in made.tosses]
    for one, other in zip(shipped.tosses, made.tosses, strict=True):
        for name in ("t", "position", "orientation"):
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=0.0, atol=1e-6)
        uncertainty = np.std(one.starts[1:], axis=0)  # of the starts that are drawn as the flight leaves them open
        assert (np.abs(np.subtract(one.starts[0], other.starts[0])) <= 0.1 * uncertainty).all()


def test_reference_is_the_recorded_pose_in_each_frame_and_no_exact_solution():
    scene = load("toss-cube")
    [toss, *_], truth = scene.recording.tosses, reference_for(scene)
    assert (truth.name, truth.is_exact, truth.events) == ("measured", False, ())
    found = truth(truth.frames).states
    np.testing.assert_array_equal(found[:, POSITION], toss.position)
    np.testing.assert_allclose(np.abs(np.sum(found[:, ORIENTATION] * toss.orientation, axis=1)), 1.0, atol=1e-5)
    middle = 0.5 * (truth.frames[3] + truth.frames[4])
    between = truth([middle]).states[0]
    np.testing.assert_allclose(between[POSITION], 0.5 * (toss.position[3] + toss.position[4]))
    np.testing.assert_allclose(between[VELOCITY], (toss.position[4] - toss.position[3]) / (toss.t[4] - toss.t[3]))
    later = truth.after(-0.001)
    np.testing.assert_allclose(later(later.frames).position, toss.position, atol=1e-12)


def test_the_sign_of_a_recorded_quaternion_has_no_meaning():
    recording = load("toss-cube").recording
    toss = recording.tosses[0]
    signs = np.where(np.arange(len(toss.t)) % 3 == 1, -1.0, 1.0)[:, np.newaxis]
    flipped = measured(recording, toss.model_copy(update={"orientation": signs * toss.orientation}))
    t = np.linspace(0.0, toss.t[-1], 40)
    np.testing.assert_allclose(flipped(t).states, measured(recording, toss)(t).states, rtol=0, atol=1e-12)


def test_one_toss_is_chosen_by_name_and_changes_the_digest(files):
    scene = load(with_table(files, 'file = "tosses.json"\ntoss = "53"'))
    assert [toss.name for toss in scene.recording.tosses] == ["53"]
    assert 0.01 < scene.duration - scene.recording.tosses[0].t[-1] < 0.021
    every = load(with_table(files, 'file = "tosses.json"'))
    assert len(every.recording.tosses) == 20
    assert len({scene.digest, every.digest, every.model_copy(update={"recording": None}).digest}) == 3


def test_stored_scene_needs_no_file():
    scene = load("toss-cube")
    again = load(scene.model_dump(mode="json", exclude={"origin"}))
    assert again.recording == scene.recording
    assert again.digest == scene.digest


def test_other_starts_and_bodies_have_no_recording():
    """Their motions are not those that were recorded; the exact solution of the scene itself stays as it is."""
    scene = load("toss-cube")
    assert scene.starting_at(scene.initial_state).recording is None
    assert changed(scene, body={"mass": 1.0}).recording is None
    assert truth_for(scene).is_exact


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('file = "absent.json"', r"recording\.file: .*absent\.json: No such file or directory"),
        ('file = "tosses.json"\ntos = "4"', r"recording\.tos: unknown key\. Did you mean 'toss'\? Allowed: file, toss\."),
        ('file = "tosses.json"\ntoss = "5"', r"recording\.toss: got '5'; no such toss\. Known: '4, 20, 53,"),
        ('file = "tosses.json"\ntoss = 4', r"recording\.toss: got 4; no such toss"),
        ("file = 3", r"recording\.file: got 3; must be the path of a file \.json that dropspin log check wrote"),
        (
            'file = "mine.toml"',
            r"recording\.file: .*mine\.toml: is not JSON, or damaged; give the file \.json that dropspin",
        ),
    ],
)
def test_wrong_table_is_refused(files, table, message):
    with pytest.raises(SceneError, match=message):
        load(with_table(files, table))


def test_start_beside_a_recording_is_refused(files):
    path = with_table(files, 'file = "tosses.json"')
    path.write_text(path.read_text(encoding="utf-8") + "\n[start]\nposition = [0.0, 1.0, 0.0]\n", encoding="utf-8")
    with pytest.raises(SceneError, match=r"start: the recording gives the start; leave out \[start\], or \[recording\]"):
        load(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda toss: toss["t"].reverse(), "t must be above 0 and increase"),
        (lambda toss: toss["position"].pop(), "need one row for each frame"),
        (lambda toss: toss["starts"].pop(), "starts has 19 states; it needs 20"),
        (lambda toss: toss["orientation"][3].__setitem__(0, 2.0), "orientations must be unit quaternions"),
        (lambda toss: toss["position"][3].__setitem__(0, 1e300), "must be a list of rows of 3 numbers of up to 1e"),
        (lambda toss: toss.update(position="no"), "must be a list of rows of 3 numbers of up to 1e"),
    ],
)
def test_damaged_tosses_are_refused(files, change, message):
    content = json.loads((files / "tosses.json").read_text())
    change(content["tosses"][0])
    (files / "tosses.json").write_text(json.dumps(content))
    with pytest.raises(SceneError, match=rf"recording\.file: .*tosses\.json: tosses\[0\].*{message}"):
        load(with_table(files, 'file = "tosses.json"'))
