"""The replay: it shows the states of the run and the impulses of the exact solution; pages and GIFs are written whole."""

import json
import re
import resource
import shutil
import sys
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from support.cli import dropspin
from support.frames import a_quarter_later

import dropspin as ds
from dropspin.comparisons.results.store import save
from dropspin.reports.commands.replay import replay_command
from dropspin.reports.html.replay import replay_page
from dropspin.reports.replay import replay_of
from dropspin.reports.replay.clip import _in_box, write_clip
from dropspin.reports.replay.data import as_data
from dropspin.reports.replay.motions import MOST_FRAMES, _stride, contact_impulses, impact_rows, replay_together
from dropspin.scenarios import DropspinError, Trajectory, truth_for
from dropspin.scenarios.mechanics import angular_momentum
from dropspin.scenarios.rotations import about, angle_between_orientations, multiply, rotate
from dropspin.scenarios.surfaces import Wall
from dropspin.scenarios.truths.truth import EXACT


@pytest.fixture(scope="module")
def folder(shared):
    """The data of a run: the impact of a corner, a free tumble and a ball, at two time steps."""

    def make(folder):
        save(ds.run(["drop-box-corner", "spin-asymmetric", "drop-ball"], ["wang", "mujoco"], dt=[4e-3, 2e-3]), folder)

    return shared("replay-run", make)


@pytest.fixture(scope="module")
def results(folder):
    return ds.load_results(folder)


def test_last_motion_is_the_exact_solution_at_the_frames(results):
    replay = replay_of(results, "spin-asymmetric", 2e-3)
    ghost = replay.motions[-1]
    exact = truth_for(replay.scene)(replay.interval * np.arange(len(ghost.frames)))
    assert len(ghost.impacts.times) == 0
    assert ghost.label == EXACT
    assert len(ghost.frames) == len(replay.motions[0].frames)
    np.testing.assert_allclose(ghost.frames.orientation, exact.orientation, atol=1e-15)


def test_interpolation_between_frames_follows_the_angular_velocity():
    """500 rad/s, 18 rad between frames: a quarter of an interval after a frame the orientation is that of the closed form."""
    scene = ds.load("spin-principal-500")
    results = ds.run(scene, "mujoco", dt=4e-3)
    replay = replay_of(results, scene.name)
    assert 500.0 * replay.interval > np.pi
    for motion in replay.motions:
        for frame in (0, 7, len(motion.frames) - 2):
            q = a_quarter_later(motion, frame)
            expected = multiply(
                about(np.array(scene.start.angular_velocity) / 500.0, 125.0 * replay.interval), motion.frames.orientation[frame]
            )
            assert angle_between_orientations(q, expected) < (1e-9 if motion.label == EXACT else 0.05)


def test_body_turns_as_its_states_do_and_not_as_its_angular_velocity_says():
    """States 4 ms apart turn by 1.6 rad, which an angular velocity of 500 rad/s does not show; nor do frames 40 ms apart."""
    scene = ds.load("spin-principal-500")
    axis, angles = np.array(scene.start.angular_velocity) / 500.0, 1.6 * np.arange(scene.steps(4e-3) + 1)
    states = np.tile(scene.initial_state, (len(angles), 1))
    states[:, 3:7] = multiply(about(axis, angles), np.array(scene.start.orientation))
    motion, _ = replay_together(scene, 4e-3, {"slow": Trajectory.from_states(4e-3 * np.arange(len(angles)), states)}).motions
    assert motion.frames.t[1] == pytest.approx(0.04)
    for frame in (0, 7, 100):
        expected = multiply(about(axis, 4.0), motion.frames.orientation[frame])
        assert angle_between_orientations(a_quarter_later(motion, frame), expected) < 1e-9


def test_exact_engine_turns_as_the_exact_solution_does():
    """A body that tumbles, for 60 s: several turns about axes that change between frames 0.2 s apart."""
    body = {"shape": "box", "mass": 1.0, "half_extents": [0.05, 0.1, 0.2]}
    scene = ds.load({"duration": 60.0, "body": body, "start": {"angular_velocity": [60.0, 30.0, 30.0]}})
    engine, exact = replay_together(scene, 0.01, {"same": truth_for(scene)(0.01 * np.arange(6001))}).motions
    np.testing.assert_array_equal(engine.turns, exact.turns)


def test_last_state_is_a_frame():
    """For every number of steps that has a suitable divisor."""
    for steps in (150, 375, 2500, 1750, 10_000):
        every = _stride(steps)
        assert steps % every == 0
        assert MOST_FRAMES / 4 <= steps / every <= MOST_FRAMES or steps < MOST_FRAMES
    assert 631 / _stride(631) <= MOST_FRAMES  # a prime


def test_impulse_and_its_point_are_those_of_the_exact_impact(results):
    """M (v⁺ − v⁻), through the corner in contact; measured 2e-16 N s and 3e-15 m."""
    scene = results.scenes["drop-box-corner"]
    [impact] = truth_for(scene).events
    motion = Trajectory.from_states(np.array([0.0, 1e-9]), np.array([impact.before, impact.after]))
    weightless = scene.model_copy(update={"gravity": None})
    J, point = contact_impulses(weightless, motion, np.array([0]), np.array([1]))
    expected = scene.body.mass * (impact.after - impact.before)[7:10]
    np.testing.assert_allclose(J[0], expected, atol=1e-14)
    turned = np.diff(angular_momentum(scene, motion), axis=0)[0]
    np.testing.assert_allclose(np.cross(point[0] - motion.position[0], J[0]), turned, atol=1e-13)
    lowest = min(motion.position[0] + rotate(motion.orientation[0], scene.body.vertices), key=lambda corner: corner[1])
    np.testing.assert_allclose(point[0], lowest, atol=1e-12)


def test_impulses_and_gravity_add_up_to_the_change_of_momentum(results):
    """A ball, over all steps, to rounding; each impulse acts through the point below the centre."""
    scene = results.scenes["drop-ball"]
    for engine in results.engines:
        motion = results.trajectories["drop-ball", engine, 4e-3]
        rows = np.arange(len(motion) - 1)
        J, points = contact_impulses(scene, motion, rows, rows + 1)
        gained = J.sum(axis=0) + scene.body.mass * scene.acceleration * motion.t[-1]
        np.testing.assert_allclose(gained, scene.body.mass * (motion.velocity[-1] - motion.velocity[0]), atol=1e-9)
        np.testing.assert_allclose(points, motion.position[:-1] * [1.0, 0.0, 1.0], atol=1e-9)


def test_impulse_of_a_wall_acts_at_the_wall():
    """A ball of radius 0.15 m between a floor and a wall at x = 1.5 m: at the wall first, then on the floor."""
    scene = ds.load("bounce-wall-ball")
    motion = ds.simulate(scene, "wang", 1e-3)
    rows = np.flatnonzero(np.linalg.norm(np.diff(motion.velocity, axis=0), axis=1) > 1.0)
    J, points = contact_impulses(scene, motion, rows, rows + 1)
    assert len(rows) == 2
    np.testing.assert_allclose(points[0, [0, 2]], [scene.wall[0].point[0], 0.0], rtol=1e-12)
    np.testing.assert_allclose(points[0, 1], motion.position[rows[0], 1], rtol=1e-12)
    np.testing.assert_allclose(points[1, 1], 0.0, atol=1e-12)
    assert J[0, 0] < 0.0 < J[1, 1]


def test_impacts_are_the_steps_with_large_impulses(results):
    """The bounces of a ball; not the steps in which the floor holds it up, whose impulse is that of the weight."""
    scene = results.scenes["drop-ball"]
    weight = scene.body.mass * 9.8 * 4e-3
    for motion in replay_of(results, "drop-ball").motions[:-1]:
        v = results.trajectories["drop-ball", motion.label, 4e-3].velocity[:, 1]
        J = scene.body.mass * np.diff(v) + weight
        rows = np.rint(motion.impacts.times / 4e-3).astype(int)
        np.testing.assert_array_equal(rows, np.flatnonzero(4.0 * weight < J) + 1)
        np.testing.assert_allclose(motion.impacts.impulses[:, 1], J[rows - 1], rtol=1e-9)
        assert 5 < len(rows) < (0.5 * weight < J).sum()
        assert {*rows, *(rows - 1)} <= {*np.rint(motion.frames.t / 4e-3).astype(int)}


def test_impacts_of_the_exact_solution_are_its_events(results):
    scene = results.scenes["drop-ball"]
    events = truth_for(scene).events
    found = replay_of(results, "drop-ball").motions[-1]
    np.testing.assert_array_equal(found.impacts.times, [event.time for event in events])
    gained = [scene.body.mass * (event.after - event.before)[7:10] for event in events]
    np.testing.assert_allclose(found.impacts.impulses, gained, atol=1e-14)
    assert {*found.impacts.times} <= {*found.frames.t}


def test_event_without_an_impulse_is_no_impact():
    """The friction of a box that turns on the floor begins to act; its impulses have no largest one, by which the page would scale them."""
    [exact] = replay_together(ds.load("turn-box-flat"), 1e-2, {}).motions
    assert not len(exact.impacts.times)


def test_contact_over_adjacent_steps_is_one_impact(results):
    """A soft floor: a bounce over three steps, after a fall; its impulse is the sum, its time that of the largest part."""
    scene = results.scenes["drop-ball"]
    parts = [0.0] * 20 + [1.0, 3.0, 2.0] + [0.0] * 20
    v = np.cumsum([-1.0, *(part - 9.8e-3 for part in parts)])
    states = np.zeros((len(v), 13))
    states[:, 1], states[:, 6], states[:, 8] = 1.0 + np.cumsum(v) * 1e-3, 1.0, v
    motion = Trajectory.from_states(1e-3 * np.arange(len(v)), states)
    before, after, main = impact_rows(scene, motion)
    assert [before.tolist(), after.tolist(), main.tolist()] == [[20], [23], [22]]
    np.testing.assert_allclose(contact_impulses(scene, motion, before, after)[0][:, 1], [6.0], rtol=1e-12)


def test_scene_without_floor_has_no_impulses(results):
    assert all(len(motion.impacts.times) == 0 for motion in replay_of(results, "spin-asymmetric").motions)


def test_motion_of_a_diverged_engine_ends_at_its_last_finite_state(results):
    key = ("spin-asymmetric", "wang", 4e-3)
    motion = results.trajectories[key]
    broken = replace(motion, position=np.where(motion.t[:, None] < 1.0, motion.position, np.nan))
    replay = replay_of(replace(results, trajectories={**results.trajectories, key: broken}), "spin-asymmetric")
    ended = next(one for one in replay.motions if one.label == "wang")
    assert ended.frames.t[-1] == pytest.approx(1.0, abs=replay.interval)


def test_hostile_scene_name_is_escaped(results):
    hostile = "</script><b>&"
    content = results.scenes["spin-asymmetric"].model_dump(exclude_none=True)
    scene = ds.load({**content, "name": hostile})
    trajectories = {
        (hostile, engine, dt): motion for (name, engine, dt), motion in results.trajectories.items() if name == "spin-asymmetric"
    }
    text = replay_page([replay_of(replace(results, scenes={hostile: scene}, trajectories=trajectories), hostile)], [[]])
    assert hostile not in text
    assert text.count("</script>") == 2  # the motions and the code


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


def test_full_disk_leaves_the_old_page(folder, tmp_path):
    """A limit of the size of files stands for a full disk."""
    page = tmp_path / "replay.html"
    page.write_text("old")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limits[1]))
    try:
        with pytest.raises(DropspinError, match=r"replay\.html: cannot be written: File too large; choose another file\."):
            replay_command.main([str(folder), "drop-ball", "--no-open", "-o", str(page)], standalone_mode=False)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert page.read_text() == "old"
    assert [one.name for one in tmp_path.iterdir()] == ["replay.html"]


def test_gif_shows_all_of_a_motion(folder, tmp_path):
    """0.6 s at twice real time, 25 frames per second: 8 frames."""
    done = replay(folder, "drop-box-corner", "--gif", tmp_path / "clip.gif", "--speed", 2)
    assert done.returncode == 0, done.stderr
    with Image.open(tmp_path / "clip.gif") as clip:
        assert clip.n_frames == 8
        assert clip.info["duration"] == 40


def test_mp4_has_the_frames_of_the_gif_and_names_its_encoder_if_that_is_missing(results, tmp_path, monkeypatch):
    encoder = pytest.importorskip("imageio_ffmpeg")
    write_clip(replay_of(results, "drop-box-corner"), tmp_path / "clip.mp4", 2.0)
    assert encoder.count_frames_and_secs(str(tmp_path / "clip.mp4"))[0] == 8
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(DropspinError, match=r"clip\.mp4: MP4 files need a package that is not installed: pip install"):
        write_clip(replay_of(results, "drop-box-corner"), tmp_path / "clip.mp4", 2.0)


def test_gif_is_four_times_slower_than_real_time_by_default():
    assert [option.default for option in replay_command.params if option.name == "speed"] == [0.25]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["no-such-scene"], "this run has no scene 'no-such-scene'; choose one of drop-box-corner, spin-asymmetric, drop-ball."),
        (["drop-ball", "--dt", "0.5"], "drop-ball was not run at 0.5 s; choose one of 0.004, 0.002 s."),
        (["drop-ball", "--gif", "clip.avi"], "--gif clip.avi: the file name must end in .gif"),
        (["drop-ball", "--mp4", "clip.gif"], "--mp4 clip.gif: the file name must end in .mp4"),
        (["drop-ball", "--gif", "clip.gif", "--speed", "nan"], "nan is not a finite number."),
        (["drop-ball", "--gif", "clip.gif", "--speed", "1e-9"], "a film at a speed of 1e-09 has more than 5,000 frames"),
        (["drop-ball", "--gif", "/dev/null/clip.gif"], "/dev/null/clip.gif: cannot be written: File exists; choose another file."),
        (["drop-ball", "--gif", "clip.gif", "-o", "page.html"], "-o page.html names the page"),
        (["drop-ball", "-o", "page.GIF"], "-o page.GIF names the page, which is HTML; give --gif page.GIF for a film"),
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


@pytest.mark.extended
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


@pytest.mark.extended
def test_planes_of_a_scene_are_drawn_and_impulses_are_those_of_all():
    surface = {"restitution": 0.8, "friction": "none"}
    wall = surface | {"point": [1.0, 0.0, 0.0], "normal": [-0.6, 0.0, 0.8]}
    start = {"position": [0.0, 0.5, 0.0], "velocity": [4.0, 1.0, 0.0]}
    body, floor = {"shape": "sphere", "radius": 0.1, "mass": 1.0}, surface | {"half_extents": [4.0, 2.0]}
    gravity = {"acceleration": [0.0, -9.8, 0.0]}
    scene = ds.load({"duration": 0.6, "body": body, "start": start, "gravity": gravity, "floor": floor, "wall": [wall]})
    replay = replay_together(scene, 1e-3, {"wang": ds.simulate(scene, "wang", 1e-3)})
    floor_drawn, wall_drawn = as_data(replay)["planes"]
    assert floor_drawn["ends"] == (4.0, 2.0)
    np.testing.assert_allclose(np.array(wall_drawn["along"]) @ wall["normal"], 0.0, atol=1e-9)
    assert [event.wall for event in truth_for(scene).events] == [0, None]
    for motion, tolerance in zip(replay.motions, (0.01, 1e-12), strict=True):
        at_wall, at_floor = motion.impacts.impulses
        np.testing.assert_allclose(motion.impacts.times, [event.time for event in truth_for(scene).events], atol=2e-3)  # two steps
        np.testing.assert_allclose(at_wall, 1.8 * 2.4 * np.array(wall["normal"]), atol=tolerance)  # M (1 + e) u, u = 4 m/s 0.6
        np.testing.assert_allclose(at_floor[[0, 2]], 0.0, atol=1e-12)


def test_wall_of_a_gif_fills_the_view():
    """The diagonal plane of a cube cuts it in a regular hexagon of side √½; a plane beside the cube, not at all."""
    wall = Wall(point=(0.5, 0.5, 0.5), normal=(1.0, 1.0, 1.0), restitution=0.5, friction="none")
    corners = _in_box(wall, np.zeros(3), np.ones(3))
    np.testing.assert_allclose(np.linalg.norm(np.roll(corners, 1, axis=0) - corners, axis=1), [np.sqrt(0.5)] * 6)
    np.testing.assert_allclose(corners.sum(axis=1), 1.5)
    assert _in_box(wall, np.ones(3), np.full(3, 2.0)).shape == (0, 3)
