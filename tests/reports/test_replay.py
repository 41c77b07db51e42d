"""The replay: what it shows is what the run holds; impulses are the truth's; pages and clips are written whole."""

import base64
import json
import re
import shutil
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image

import comparisons
import reports
import scenarios
from reports.commands.main import dropspin, main
from reports.replay import as_data, replay_of, replay_page, write_clip
from reports.replay.bodies import outline
from reports.replay.motions import MOST_FRAMES, _stride, floor_impulses
from scenarios import DropspinError, Trajectory, truth_for
from scenarios.mechanics import angular_momentum
from scenarios.rotations import about, angle_between_orientations, multiply, rotate


@pytest.fixture(scope="module")
def results():
    """A corner that strikes, a free tumble and a ball, at two steps."""
    scenes = [scenarios.load(name) for name in ("drop-box-corner", "spin-asymmetric", "drop-ball")]
    return comparisons.run(scenes, ["document", "mujoco"], [4e-3, 2e-3])


@pytest.fixture(scope="module")
def folder(results, tmp_path_factory):
    """The run, written."""
    return reports.write(results, tmp_path_factory.mktemp("out") / "run").parent


def unpacked(columns, count):
    """What the page's program makes of columns."""
    whole = [
        np.full(count, column)
        if isinstance(column, float)
        else np.frombuffer(base64.b64decode(column["data"]), dtype="<i4" if "scale" in column else "<f8") * column.get("scale", 1.0)
        for column in columns
    ]
    return np.column_stack(whole)


def test_frames_are_the_states_of_the_trajectory(results):
    """What a page is given, decoded, is every so-manyeth stored state, to 3e-10 of the largest; measured 2.3e-10."""
    for name in results.scenes:
        replay = replay_of(results, name)
        for motion in as_data(replay)["motions"]:
            if motion["isTruth"]:
                continue
            stored = results.trajectories[name, motion["label"], 4e-3]
            every = round(replay.interval / 4e-3)
            for part in ("position", "orientation"):
                shown, expected = unpacked(motion[part], motion["count"]), getattr(stored, part)[::every]
                assert len(shown) == len(expected) <= MOST_FRAMES + 1
                assert np.abs(shown - expected).max() <= 3e-10 * max(np.abs(expected).max(), 1e-300)


def test_the_ghost_is_the_truth(results):
    """At the frames' times."""
    replay = replay_of(results, "spin-asymmetric", 2e-3)
    ghost = replay.motions[-1]
    exact = truth_for(replay.scene)(replay.interval * np.arange(len(ghost.frames)))
    assert ghost.label == "truth"
    assert len(ghost.frames) == len(replay.motions[0].frames)
    np.testing.assert_allclose(ghost.frames.orientation, exact.orientation, atol=1e-15)


def test_between_frames_it_turns_as_it_spins():
    """500 rad/s, 18 rad from frame to frame: a quarter of the way on, attitude is that of a quarter of the time, by the closed form."""
    scene = scenarios.load("spin-principal-500")
    results = comparisons.run([scene], ["mujoco"], [4e-3])
    replay = replay_of(results, scene.name)
    assert 500.0 * replay.interval > np.pi
    for motion in replay.motions:
        for frame in (0, 7, len(motion.frames) - 2):
            q = motion.pose(frame + 0.25)[1]
            expected = multiply(
                about(np.array(scene.start.angular_velocity) / 500.0, 125.0 * replay.interval), motion.frames.orientation[frame]
            )
            assert angle_between_orientations(q, expected) < (1e-9 if motion.label == "truth" else 0.05)


def test_the_last_state_is_a_frame():
    """Whatever the number of steps, if it can be divided."""
    for steps in (150, 375, 2500, 1750, 10_000):
        every = _stride(steps)
        assert steps % every == 0
        assert MOST_FRAMES / 4 <= steps / every <= MOST_FRAMES or steps < MOST_FRAMES
    assert 631 / _stride(631) <= MOST_FRAMES  # a prime


def test_one_that_flies_off_hides_no_one(results):
    """Its places are given whole, others' as exactly as ever; the view stays with those that are there."""
    key = ("drop-ball", "document", 4e-3)
    motion = results.trajectories[key]
    away = np.where(motion.t > 0.3, 2.0 ** np.minimum(10.0 * (motion.t - 0.3) / 4e-3, 900.0), 0.0)
    flown = replace(motion, position=motion.position + away[:, None] * [1.0, 0.0, 0.0])
    replay = replay_of(replace(results, trajectories={**results.trajectories, key: flown}), "drop-ball")
    assert 1.0 < replay.sight < 30.0
    shown = next(one for one in as_data(replay)["motions"] if one["label"] == "document")
    kept = flown.position[:: round(replay.interval / 4e-3)][: shown["count"]]
    np.testing.assert_array_equal(unpacked(shown["position"], shown["count"])[:, 0], kept[:, 0])
    np.testing.assert_allclose(unpacked(shown["position"], shown["count"])[:, 1], kept[:, 1], atol=1e-9)


def test_an_impulse_is_the_truths(results):
    """M (v⁺ − v⁻), through the corner that strikes; measured 2e-16 N s and 3e-15 m."""
    scene = results.scenes["drop-box-corner"]
    [impact] = truth_for(scene).events
    motion = Trajectory.from_states(np.array([0.0, 1e-9]), np.array([impact.before, impact.after]))
    weightless = scene.model_copy(update={"gravity": None})
    J, point = floor_impulses(weightless, motion, np.array([0]))
    expected = scene.body.mass * (impact.after - impact.before)[7:10]
    np.testing.assert_allclose(J[0], expected, atol=1e-14)
    turned = np.diff(angular_momentum(scene, motion), axis=0)[0]
    np.testing.assert_allclose(np.cross(point[0] - motion.position[0], J[0]), turned, atol=1e-13)
    lowest = min(motion.position[0] + rotate(motion.orientation[0], scene.body.vertices), key=lambda corner: corner[1])
    np.testing.assert_allclose(point[0], lowest, atol=1e-12)


def test_impulses_of_an_engine_stop_what_fell(results):
    """A ball: all impulses and gravity's together are the change of momentum, to rounding; each goes through the point below the centre."""
    replay = replay_of(results, "drop-ball")
    for motion in replay.motions:
        v, spent = motion.frames.velocity, replay.interval * np.sum(~np.isin(np.arange(1, len(motion.frames)), motion.struck))
        gained = motion.impulses.sum(axis=0) + replay.scene.body.mass * replay.scene.acceleration * replay.interval * len(motion.struck)
        left = replay.scene.body.mass * (v[-1] - v[0] - spent * replay.scene.acceleration)
        np.testing.assert_allclose(gained, left, atol=2e-2 if motion.label == "truth" else 1e-9)
        np.testing.assert_allclose(motion.points[:, [0, 2]], 0.0, atol=1e-9)
        np.testing.assert_allclose(motion.points[:, 1], 0.0, atol=1e-12)


def test_no_floor_no_impulse(results):
    assert all(len(motion.struck) == 0 for motion in replay_of(results, "spin-asymmetric").motions)


SOLIDS = {
    "box": ({"shape": "box", "half_extents": [0.1, 0.2, 0.3], "mass": 1.0}, 6, 8 * 0.1 * 0.2 * 0.3),
    "octahedron": ({"shape": "vertices", "points": [*np.eye(3).tolist(), *(-np.eye(3)).tolist()], "mass": 6.0}, 8, 4 / 3),
    "cube with points inside and on its faces": (
        {"shape": "vertices", "points": [[x, y, z] for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1.0, 0.0, 1.0)], "mass": 1.0},
        6,
        8.0,
    ),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_faces_close_a_solid(name):
    """So many faces, all seen from outside counterclockwise: by the divergence theorem they hold the solid's volume."""
    body, faces, volume = SOLIDS[name]
    shape = outline(scenarios.load({"duration": 1.0, "body": body}).body)
    assert len(shape.faces) == faces
    held = 0.0
    for face in shape.faces:
        first, *rest = shape.vertices[list(face)]
        held += sum(np.dot(first, np.cross(a, b)) for a, b in pairwise(rest)) / 6.0
    assert held == pytest.approx(volume, rel=1e-12)


def test_a_plane_figure_is_one_face():
    """A square of points, turned anyhow: one face of four corners, in order."""
    corners = np.array([[1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0], [0.0, 0.0, 0.0]])
    points = rotate(np.array([0.1, 0.2, 0.3, 0.4]) / np.sqrt(0.3), corners)
    shape = outline(scenarios.load({"duration": 1.0, "body": {"shape": "vertices", "points": points.tolist(), "mass": 1.0}}).body)
    assert shape.is_flat
    [face] = shape.faces
    sides = np.linalg.norm(np.diff(shape.vertices[[*face, face[0]]], axis=0), axis=1)
    np.testing.assert_allclose(sides, 2.0, rtol=1e-12)


def test_a_motion_ends_where_it_is_not_finite(results):
    """A diverged engine is shown as far as it goes."""
    key = ("spin-asymmetric", "document", 4e-3)
    motion = results.trajectories[key]
    broken = replace(motion, position=np.where(motion.t[:, None] < 1.0, motion.position, np.nan))
    replay = replay_of(replace(results, trajectories={**results.trajectories, key: broken}), "spin-asymmetric")
    shown = next(one for one in replay.motions if one.label == "document")
    assert shown.frames.t[-1] == pytest.approx(1.0, abs=replay.interval)


def test_names_are_text(results):
    """A hostile name stays within its element and its data."""
    hostile = "</script><b>&"
    content = results.scenes["spin-asymmetric"].model_dump(exclude_none=True)
    scene = scenarios.load({**content, "name": hostile})
    trajectories = {
        (hostile, engine, dt): motion for (name, engine, dt), motion in results.trajectories.items() if name == "spin-asymmetric"
    }
    text = replay_page([replay_of(replace(results, scenes={hostile: scene}, trajectories=trajectories), hostile)], {hostile: "<svg></svg>"})
    assert hostile not in text
    assert text.count("</script>") == 2


def called(*arguments):
    return CliRunner().invoke(dropspin, ["replay", *map(str, arguments), "--no-open"])


def test_the_verb_writes_a_page(folder):
    """Into the run's folder, whole, and without any address."""
    done = called(folder)
    assert done.exit_code == 0, done.output
    text = (folder / "replay.html").read_text(encoding="utf-8")
    assert not re.search(r"(?:src|href)=|@import|url\((?!#)", text.replace("xlink:href", "").replace('href="#', ""))
    assert [json.loads(found)["scene"] for found in re.findall(r'type="application/json"[^>]*>(.*?)</script>', text)] == [
        "drop-box-corner",
        "spin-asymmetric",
        "drop-ball",
    ]


def test_a_clip_has_all_of_a_motion(folder, tmp_path):
    """0.6 s, four times slowed down, 25 frames a second: 61 pictures."""
    done = called(folder, "drop-box-corner", "--gif", tmp_path / "clip.gif")
    assert done.exit_code == 0, done.output
    with Image.open(tmp_path / "clip.gif") as clip:
        assert clip.n_frames == 61
        assert clip.info["duration"] == 40


def test_a_video(folder, tmp_path):
    """The file that a player expects."""
    done = called(folder, "drop-box-corner", "--mp4", tmp_path / "clip.mp4", "--speed", 2)
    assert done.exit_code == 0, done.output
    assert (tmp_path / "clip.mp4").read_bytes()[4:8] == b"ftyp"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["no-such-scene"], "it has drop-box-corner, spin-asymmetric, drop-ball"),
        (["drop-ball", "--dt", "0.5"], "this run has 0.004, 0.002"),
        (["drop-ball", "--gif", "clip.avi"], "--gif clip.avi: give the file the ending .gif"),
        (["drop-ball", "--mp4", "clip.gif"], "--mp4 clip.gif: give the file the ending .mp4"),
        (["drop-ball", "--gif", "clip.gif", "--speed", "nan"], "more than 5,000 frames; choose one of at least 0.0075"),
        (["drop-ball", "--gif", "clip.gif", "--speed", "1e-9"], "more than 5,000 frames"),
        (["drop-ball", "--gif", "absent/clip.gif"], "absent/clip.gif: cannot be written"),
        (["drop-ball", "--gif", "clip.gif", "-o", "page.html"], "-o page.html is for the page"),
        (["--gif", "clip.gif"], "name it: drop-box-corner"),
        (["drop-ball", "--dt", "-1"], "--dt"),
    ],
)
def test_bad_requests(folder, arguments, said, monkeypatch, capsys):
    """One message, exit code 2."""
    told(monkeypatch, capsys, ["replay", str(folder), *arguments, "--no-open"], said)


def told(monkeypatch, capsys, arguments, said):
    """What the command says of bad input, as its caller sees it."""
    monkeypatch.setattr("sys.argv", ["dropspin", *map(str, arguments)])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2
    err = capsys.readouterr().err
    assert said in err
    assert "Traceback" not in err


def test_a_clip_that_is_interrupted_leaves_the_old_one(folder, results, tmp_path):
    """Nothing of the new one is there."""
    file = tmp_path / "clip.gif"
    file.write_bytes(b"old")

    def stop(share):
        if share > 0.3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_clip(replay_of(results, "drop-ball"), file, 2.0, stop)
    assert file.read_bytes() == b"old"
    assert [one.name for one in tmp_path.iterdir()] == ["clip.gif"]


def test_a_video_without_a_program(folder, results, tmp_path, monkeypatch):
    """It is the program that is missing, not the file."""
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/no/such/ffmpeg")
    with pytest.raises(DropspinError, match="no ffmpeg that can be run at '/no/such/ffmpeg'"):
        write_clip(replay_of(results, "drop-ball"), tmp_path / "clip.mp4", 1.0)


def test_a_report_again_keeps_the_replay(folder, tmp_path):
    made = tmp_path / "run"
    shutil.copytree(folder, made)
    assert called(made).exit_code == 0
    before = (made / "replay.html").read_bytes()
    assert CliRunner().invoke(dropspin, ["report", str(made)]).exit_code == 0
    assert (made / "replay.html").read_bytes() == before


def without(name):
    """Damage of run.json: an entry is gone."""

    def damage(folder):
        content = json.loads((folder / "run.json").read_text())
        del content[name]
        (folder / "run.json").write_text(json.dumps(content))

    return damage


def junk(folder):
    next(folder.glob("trajectories/*.npz")).write_bytes(b"junk")


@pytest.mark.parametrize("damage", [*map(without, ("engines", "provenance", "trajectories", "origins", "scenes")), junk])
def test_a_damaged_run(folder, tmp_path, damage, monkeypatch, capsys):
    made = tmp_path / "run"
    shutil.copytree(folder, made)
    damage(made)
    for verb in ("report", "replay"):
        told(monkeypatch, capsys, [verb, made], "not the folder of a run, or damaged")


@pytest.mark.parametrize(
    "content",
    [
        '{"title": "a", "parts": 5}',
        '{"title": "a", "parts": [{"kind": "bogus"}]}',
        "[]",
        '{"title": "a", "parts": [{"kind": "table", "rows": []}]}',
    ],
)
def test_a_damaged_study(folder, tmp_path, content, monkeypatch, capsys):
    (tmp_path / "section.json").write_text(content)
    told(monkeypatch, capsys, ["report", folder, "--add", tmp_path], "holds no study, or a damaged one")
