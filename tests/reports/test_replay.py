"""The replay: it shows the states of the run and the impulses of the exact solution; pages and GIFs are written whole."""

import base64
import json
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from support.cli import dropspin

import dropspin as ds
from comparisons.results.store import save
from reports.commands.replay import replay_command
from reports.html.replay import replay_page
from reports.plots.colours import EXACT
from reports.replay import as_data, replay_of
from reports.replay.clip import write_clip
from reports.replay.motions import MOST_FRAMES, _stride, floor_impulses
from scenarios import DropspinError, Trajectory, truth_for
from scenarios.mechanics import angular_momentum
from scenarios.rotations import about, angle_between_orientations, multiply, rotate


@pytest.fixture(scope="module")
def folder(shared):
    """The data of a run: the impact of a corner, a free tumble and a ball, at two time steps."""

    def make(folder):
        save(ds.run(["drop-box-corner", "spin-asymmetric", "drop-ball"], ["document", "mujoco"], dt=[4e-3, 2e-3]), folder)

    return shared("replay-run", make)


@pytest.fixture(scope="module")
def results(folder):
    return ds.load_results(folder)


def unpacked(columns, count):
    """The numbers that the viewer reads from the columns of `as_data`."""
    whole = [
        np.full(count, column)
        if isinstance(column, float)
        else np.frombuffer(base64.b64decode(column["data"]), dtype="<i4" if "scale" in column else "<f8") * column.get("scale", 1.0)
        for column in columns
    ]
    return np.column_stack(whole)


def test_frames_are_stored_states_at_a_fixed_stride(results):
    """Decoded data of the page, to 3e-10 of the largest value; measured 2.3e-10."""
    for name in results.scenes:
        replay = replay_of(results, name)
        for motion in as_data(replay)["motions"]:
            if motion["isExact"]:
                continue
            stored = results.trajectories[name, motion["label"], 4e-3]
            every = round(replay.interval / 4e-3)
            for part in ("position", "orientation"):
                shown, expected = unpacked(motion[part], motion["count"]), getattr(stored, part)[::every]
                assert len(shown) == len(expected) <= MOST_FRAMES + 1
                assert np.abs(shown - expected).max() <= 3e-10 * max(np.abs(expected).max(), 1e-300)


def test_last_motion_is_the_exact_solution_at_the_frames(results):
    replay = replay_of(results, "spin-asymmetric", 2e-3)
    ghost = replay.motions[-1]
    exact = truth_for(replay.scene)(replay.interval * np.arange(len(ghost.frames)))
    assert ghost.label == EXACT
    assert len(ghost.frames) == len(replay.motions[0].frames)
    np.testing.assert_allclose(ghost.frames.orientation, exact.orientation, atol=1e-15)


def test_interpolation_between_frames_follows_the_angular_velocity():
    """500 rad/s, 18 rad between frames: a quarter of an interval after a frame the attitude is that of the closed form."""
    scene = ds.load("spin-principal-500")
    results = ds.run(scene, "mujoco", dt=4e-3)
    replay = replay_of(results, scene.name)
    assert 500.0 * replay.interval > np.pi
    for motion in replay.motions:
        for frame in (0, 7, len(motion.frames) - 2):
            q = motion.pose(frame + 0.25)[1]
            expected = multiply(
                about(np.array(scene.start.angular_velocity) / 500.0, 125.0 * replay.interval), motion.frames.orientation[frame]
            )
            assert angle_between_orientations(q, expected) < (1e-9 if motion.label == EXACT else 0.05)


def test_last_state_is_a_frame():
    """For every number of steps that has a suitable divisor."""
    for steps in (150, 375, 2500, 1750, 10_000):
        every = _stride(steps)
        assert steps % every == 0
        assert MOST_FRAMES / 4 <= steps / every <= MOST_FRAMES or steps < MOST_FRAMES
    assert 631 / _stride(631) <= MOST_FRAMES  # a prime


def test_motion_that_flies_off_does_not_blur_the_others(results):
    """Its positions are stored as float64, those of the others as precisely as before; the view covers those that stay."""
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


def test_impulse_and_its_point_are_those_of_the_exact_impact(results):
    """M (v⁺ − v⁻), through the corner in contact; measured 2e-16 N s and 3e-15 m."""
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


def test_impulses_and_gravity_add_up_to_the_change_of_momentum(results):
    """A ball, to rounding; each impulse acts through the point below the centre."""
    replay = replay_of(results, "drop-ball")
    for motion in replay.motions:
        v, spent = motion.frames.velocity, replay.interval * np.sum(~np.isin(np.arange(1, len(motion.frames)), motion.struck))
        gained = motion.impulses.sum(axis=0) + replay.scene.body.mass * replay.scene.acceleration * replay.interval * len(motion.struck)
        left = replay.scene.body.mass * (v[-1] - v[0] - spent * replay.scene.acceleration)
        np.testing.assert_allclose(gained, left, atol=2e-2 if motion.label == EXACT else 1e-9)
        np.testing.assert_allclose(motion.points[:, [0, 2]], 0.0, atol=1e-9)
        np.testing.assert_allclose(motion.points[:, 1], 0.0, atol=1e-12)


def test_scene_without_floor_has_no_impulses(results):
    assert all(len(motion.struck) == 0 for motion in replay_of(results, "spin-asymmetric").motions)


def test_motion_of_a_diverged_engine_ends_at_its_last_finite_state(results):
    key = ("spin-asymmetric", "document", 4e-3)
    motion = results.trajectories[key]
    broken = replace(motion, position=np.where(motion.t[:, None] < 1.0, motion.position, np.nan))
    replay = replay_of(replace(results, trajectories={**results.trajectories, key: broken}), "spin-asymmetric")
    shown = next(one for one in replay.motions if one.label == "document")
    assert shown.frames.t[-1] == pytest.approx(1.0, abs=replay.interval)


def test_hostile_scene_name_is_escaped(results):
    hostile = "</script><b>&"
    content = results.scenes["spin-asymmetric"].model_dump(exclude_none=True)
    scene = ds.load({**content, "name": hostile})
    trajectories = {
        (hostile, engine, dt): motion for (name, engine, dt), motion in results.trajectories.items() if name == "spin-asymmetric"
    }
    text = replay_page([replay_of(replace(results, scenes={hostile: scene}, trajectories=trajectories), hostile)], [[]])
    assert hostile not in text
    assert text.count("</script>") == 3  # the motions, no plots, the code


def replay(*arguments):
    return dropspin("replay", *arguments, "--no-open", cwd=".")


def test_replay_command_writes_one_page_without_links(folder, tmp_path):
    copied = shutil.copytree(folder, tmp_path / "run")
    done = replay(copied)
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"Written: {copied / 'replay.html'}\n"
    text = (copied / "replay.html").read_text(encoding="utf-8")
    assert not re.search(r"(?:src|href)=|@import|url\((?!#)", text.replace("xlink:href", "").replace('href="#', ""))
    data = [json.loads(found) for found in re.findall(r'type="application/json"[^>]*>(.*?)</script>', text)]
    assert [one["scene"] for one in data if "motions" in one] == [
        "drop-box-corner",
        "spin-asymmetric",
        "drop-ball",
    ]


def test_gif_shows_all_of_a_motion(folder, tmp_path):
    """0.6 s at twice real time, 25 frames per second: 8 frames."""
    done = replay(folder, "drop-box-corner", "--gif", tmp_path / "clip.gif", "--speed", 2)
    assert done.returncode == 0, done.stderr
    with Image.open(tmp_path / "clip.gif") as clip:
        assert clip.n_frames == 8
        assert clip.info["duration"] == 40


def test_gif_is_four_times_slower_than_real_time_by_default():
    assert [option.default for option in replay_command.params if option.name == "speed"] == [0.25]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["no-such-scene"], "this run has no scene 'no-such-scene'; choose one of drop-box-corner, spin-asymmetric, drop-ball."),
        (["drop-ball", "--dt", "0.5"], "drop-ball was not run at 0.5 s; choose one of 0.004, 0.002 s."),
        (["drop-ball", "--gif", "clip.avi"], "--gif clip.avi: give the file the ending .gif"),
        (["drop-ball", "--gif", "clip.gif", "--speed", "nan"], "more than 5,000 frames; choose a speed of at least 0.0075."),
        (["drop-ball", "--gif", "clip.gif", "--speed", "1e-9"], "a GIF at a speed of 1e-09 has more than 5,000 frames"),
        (["drop-ball", "--gif", "absent/clip.gif"], "absent/clip.gif: cannot be written: No such file or directory; choose another file."),
        (["drop-ball", "--gif", "clip.gif", "-o", "page.html"], "-o page.html is for the page"),
        (["--gif", "clip.gif"], "name it: drop-box-corner"),
        (["drop-ball", "--dt", "-1"], "--dt"),
    ],
)
def test_bad_request_ends_in_one_message_and_exit_code_2(folder, arguments, message):
    assert_refused(replay(folder, *arguments), message)


def assert_refused(done, message):
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_gif_file_name_must_end_in_gif(results, tmp_path):
    with pytest.raises(DropspinError, match=r"clip\.mp4: an animation is written as GIF; give the file the ending \.gif\."):
        write_clip(replay_of(results, "drop-ball"), tmp_path / "clip.mp4", 1.0)


def test_interrupted_gif_leaves_the_old_one(results, tmp_path):
    file = tmp_path / "clip.gif"
    file.write_bytes(b"old")

    def stop(fraction):
        if fraction > 0.3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_clip(replay_of(results, "drop-ball"), file, 2.0, stop)
    assert file.read_bytes() == b"old"
    assert [one.name for one in tmp_path.iterdir()] == ["clip.gif"]


def test_report_command_keeps_the_replay(folder, tmp_path):
    copied = shutil.copytree(folder, tmp_path / "run")
    (copied / "replay.html").write_text("a replay")
    assert dropspin("report", copied, cwd=tmp_path).returncode == 0
    assert (copied / "report.html").exists()
    assert (copied / "replay.html").read_text() == "a replay"


def without(name):
    """A function that removes an entry of run.json."""

    def damage(folder):
        content = json.loads((folder / "run.json").read_text())
        del content[name]
        (folder / "run.json").write_text(json.dumps(content))

    return damage


def junk(folder):
    next(folder.glob("trajectories/*.npz")).write_bytes(b"junk")


@pytest.mark.parametrize("damage", [*map(without, ("engines", "provenance", "trajectories", "origins", "scenes")), junk])
def test_damaged_run_is_refused(folder, tmp_path, damage):
    copied = shutil.copytree(folder, tmp_path / "run")
    damage(copied)
    for verb in ("report", "replay"):
        assert_refused(dropspin(verb, copied, cwd=tmp_path), "not the folder of a run, or damaged")


@pytest.mark.parametrize(
    "content",
    [
        '{"title": "a", "parts": 5}',
        '{"title": "a", "parts": [{"kind": "bogus"}]}',
        "[]",
        '{"title": "a", "parts": [{"kind": "table", "rows": []}]}',
    ],
)
def test_damaged_study_is_refused(folder, tmp_path, content):
    (tmp_path / "section.json").write_text(content)
    assert_refused(dropspin("report", folder, "--add", tmp_path, cwd=tmp_path), "has no study, or a damaged one")
