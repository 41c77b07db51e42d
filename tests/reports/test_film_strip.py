"""Film strips: the moments, and bodies that are where the states say."""

import re

import numpy as np
import pytest

import dropspin as ds
from dropspin.reports.html.film_strip import LEFT, PANEL, TOP, strip_of
from dropspin.reports.replay.motions import replay_together


def strip(name, **moved):
    scene = ds.load(name)
    return scene, strip_of(replay_together(scene, 4e-3, moved))


def exactly(name):
    scene = ds.load(name)
    times = 4e-3 * np.arange(scene.steps(4e-3) + 1)
    return ds.Trajectory.from_states(times, ds.truth_for(scene).states(times))


def test_moments_are_around_the_impact_and_the_engine_that_is_exact_covers_the_outline():
    scene, shown = strip("drop-box-corner", mujoco=exactly("drop-box-corner"))
    [impact] = ds.truth_for(scene).events
    names, times = zip(*(moment.split(", ") for moment in shown.moments), strict=True)
    assert names == ("start", "impact", "after", "end")
    assert float(times[1].split()[0]) == pytest.approx(impact.time, abs=2e-3)
    [(_, _, path)] = shown.rows
    assert path == shown.exact
    assert shown.difference < 1e-9
    assert shown.shows_impact


def test_impact_of_a_long_motion_is_drawn_when_it_occurs():
    """Frames are 0.2 s apart; the ball strikes the floor at √(2/9.8) = 0.452 s, and both motions have the state at the nearest step."""
    scene = ds.load("bounce-95")
    times = 5e-3 * np.arange(scene.steps(5e-3) + 1)
    shown = strip_of(replay_together(scene, 5e-3, {"mujoco": ds.Trajectory.from_states(times, ds.truth_for(scene).states(times))}))
    assert shown.moments[1] == "impact, 0.45 s"
    [(_, _, path)] = shown.rows
    drawn = [
        np.array([list(map(float, re.findall(r"-?[\d.]+", one)[:2])) for one in re.findall("M[^Ma]+a", each)])
        for each in (path, shown.exact)
    ]
    np.testing.assert_allclose(*drawn, atol=2.0)


def test_body_is_drawn_where_it_is_and_an_arrow_points_to_one_outside():
    """Moved up by 0.3 of its size the body is higher by that much of its drawn size; from ten sizes on there is an arrow alone."""
    scene = ds.load("fall-spin")
    motion = exactly("fall-spin")
    size = scene.body.size
    near, far = (ds.Trajectory.from_states(motion.t, motion.states + np.eye(13)[1] * part * size) for part in (0.3, 10.0))
    _, shown = strip("fall-spin", mujoco=near, pybullet=far)
    (_, _, path), (_, _, arrows) = shown.rows
    starts = [np.array(re.findall(r"M(-?\d+) (-?\d+)", one), dtype=float) for one in (path, shown.exact)]
    assert np.median(starts[1] - starts[0], axis=0)[1] == pytest.approx(0.3 * 36.0 / (1.0 + 0.5 * 1.2), abs=1.0)
    assert arrows.count("M") == 2 * len(shown.moments)
    assert shown.difference == 1.0
    assert not shown.shows_impact


def test_engine_that_diverged_is_left_out_of_later_panels():
    motion = exactly("fall-spin")
    _, shown = strip("fall-spin", mujoco=motion[: len(motion) // 2])
    [(_, _, path)] = shown.rows
    across = np.array(re.findall(r"M(-?\d+) ", path), dtype=float)
    assert across.max() < LEFT + 2 * PANEL[0]
    assert TOP > 0.0
