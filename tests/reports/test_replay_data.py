"""The data of a replay: what the viewer decodes differs from the states of the run by a fraction of a pixel."""

import base64
import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.frames import a_quarter_later

import dropspin as ds
from dropspin.reports.replay import Replay, as_data, replay_of
from dropspin.reports.replay.data import quantised
from dropspin.reports.replay.motions import MOST_FRAMES, Impacts, Motion, rotations_of_steps
from dropspin.scenarios import Trajectory, truth_for
from dropspin.scenarios.rotations import about, angle_between_orientations

LARGEST = float(np.finfo(np.float32).max)


@pytest.fixture(scope="module")
def results():
    """The impact of a corner, a free tumble and a ball."""
    return ds.run(["drop-box-corner", "spin-asymmetric", "drop-ball"], ["wang", "mujoco"], dt=4e-3)


def decoded(column, count):
    """The numbers that the viewer reads from a column of positions or of rotation vectors."""
    if isinstance(column, float):
        return np.full(count, column)
    raw = base64.b64decode(column["data"])
    return column["low"] + column["step"] * np.frombuffer(raw, "<u2") if "step" in column else np.frombuffer(raw, "<f4").astype(float)


def shown(motion, interval):
    """Times [s], positions [m], orientations and errors that the viewer reads from the data of a motion."""
    times = np.union1d(interval * np.arange(motion["count"]), motion["between"])
    position, rotation = (np.column_stack([decoded(column, len(times)) for column in motion[part]]) for part in ("position", "rotation"))
    halves = [np.frombuffer(base64.b64decode(column), "<u2").astype("<u4") << np.uint32(16) for column in motion["errors"]]
    return times, position, Rotation.from_rotvec(rotation).as_quat(), [column.astype("<u4").view("<f4") for column in halves]


def test_frames_are_stored_states_to_a_fraction_of_a_pixel(results):
    """At a fixed stride and around impacts: coordinates to 1e-3 of the size of the body, orientations to 9e-5 rad, errors to 0.4 %."""
    for name, scene in results.scenes.items():
        replay = replay_of(results, name)
        data = as_data(replay)
        for motion in data["motions"][:-1]:
            assert not motion["isExact"]
            stored = results.trajectories[name, motion["label"], 4e-3]
            times, position, orientation, errors = shown(motion, data["interval"])
            rows = np.rint(times / 4e-3).astype(int)
            np.testing.assert_allclose(times, stored.t[rows], atol=1e-9)
            assert {*range(0, len(stored), round(replay.interval / 4e-3))} <= {*rows}
            assert motion["count"] <= MOST_FRAMES + 1
            assert np.abs(position - stored.position[rows]).max() <= 1e-3 * scene.body.size
            assert angle_between_orientations(orientation, stored.orientation[rows]).max() <= 9e-5
            exact = truth_for(scene)(times)
            away = np.linalg.norm(stored.position[rows] - exact.position, axis=1)
            np.testing.assert_allclose(errors[0], away, rtol=4e-3)
            np.testing.assert_allclose(errors[1], angle_between_orientations(stored.orientation[rows], exact.orientation), rtol=4e-3)


@pytest.mark.parametrize("span", [0.0, 1e-12, 0.1, 13.1, 13.2, 1e4, 1e300])
def test_rounding_of_a_column_is_within_its_tolerance(span):
    """16 bits while half a level is at most 1e-4, floats of 32 bits beyond; what the viewer reads is what was promised."""
    numbers = -3.0 + span * np.random.default_rng(0).permutation(np.linspace(0.0, 1.0, 1001))
    column, promised = quantised(numbers, 1e-4)
    found = decoded(json.loads(json.dumps(column)), len(numbers))
    np.testing.assert_array_equal(found, promised)
    if span <= 13.1:
        assert np.abs(found - numbers).max() <= min(1e-4, span / 131_070 + 1e-15)
    else:
        np.testing.assert_allclose(found, np.minimum(numbers, LARGEST), rtol=2.0**-23)


def test_turns_between_frames_are_counted_from_the_rounded_attitudes():
    """A body that turns by π − 1e-6 a frame: rounded, by more than π as often as by less; its motion still goes one way."""
    t, angle = 0.01 * np.arange(101), np.pi - 1e-6
    states = np.zeros((101, 13))
    states[:, 3:7] = about(np.array([0.6, 0.0, 0.8]), angle * np.arange(101))
    states[:, 10:] = angle / 0.01 * np.array([0.6, 0.0, 0.8])
    scene = ds.load("spin-principal-500").model_copy(update={"duration": 1.0})
    frames, none = Trajectory.from_states(t, states), Impacts(np.empty(0), np.empty((0, 3)), np.empty((0, 3)))
    motion = Motion("an-engine", "#123456", frames, rotations_of_steps(frames), None, none)
    [data] = as_data(Replay(scene, 0.01, 0.01, [motion]))["motions"]
    q = shown(data, 0.01)[2]
    rounded = replace(motion, frames=replace(motion.frames, orientation=q))
    turns = data["turns"] or [0] * 100
    assert {*turns} == {-1, 0} or {*turns} == {0, 1}
    np.testing.assert_array_equal(turns, rounded.turns)
    for frame in range(100):
        quarter = a_quarter_later(rounded, frame)
        assert angle_between_orientations(quarter, about(np.array([0.6, 0.0, 0.8]), angle * (frame + 0.25))) < 3e-4


def test_motion_that_flies_off_does_not_blur_the_others(results):
    """Its positions are stored as floats of 32 bits, up to the largest one; the view covers those that stay."""
    key = ("drop-ball", "wang", 4e-3)
    motion = results.trajectories[key]
    away = np.where(motion.t > 0.3, 2.0 ** np.minimum(10.0 * (motion.t - 0.3) / 4e-3, 900.0), 0.0)
    flown = replace(motion, position=motion.position + away[:, None] * [1.0, 0.0, 0.0])
    replay = replay_of(replace(results, trajectories={**results.trajectories, key: flown}), "drop-ball")
    assert 1.0 < replay.sight < 30.0
    data = next(one for one in as_data(replay)["motions"] if one["label"] == "wang")
    times, position, _, _ = shown(data, replay.interval)
    kept = flown.position[np.rint(times / 4e-3).astype(int)]
    np.testing.assert_allclose(position[:, 0], np.minimum(kept[:, 0], LARGEST), rtol=2.0**-23)
    np.testing.assert_allclose(position[:, 1], kept[:, 1], atol=1e-3 * replay.scene.body.size)
