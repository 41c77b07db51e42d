"""Walls, and a floor that ends."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.transcription import UP, update

from dropspin import reference_impl
from dropspin.reference_impl import Body, Floor, Methods, Wall, World
from dropspin.reference_impl.parameters import _frames
from dropspin.reference_impl.state import ORIENTATION, POSITION, SPIN, VELOCITY

G = np.array([0.0, -9.8, 0.0])
BOX = Body(2.0, np.diag([0.3, 0.2, 0.4]), np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * [0.1, 0.2, 0.15])
BALL = Body(1.0, 0.004 * np.eye(3), np.zeros((1, 3)), (0.1, 0.1, 0.1))
CYLINDER = Body(1.0, np.diag([0.01, 0.005, 0.01]), np.array([[0, 0.1, 0], [0, -0.1, 0]]), (0.1, 0.0, 0.1))
LEFT, SLANTED = np.array([1.0, 0.0, 0.0]), np.array([-2.0, -0.4, 0.3]) / np.sqrt(4.25)
AT_RIGHT = np.array([0.6, 0.0, 0.0])
THROWN = np.array([0, 0.6, 0, 0.1, 0.2, 0.3, 0.9, 5, 2, 1, 3, 2, 1.0])


def between_walls(surface, floor=None):
    """A floor, a wall on the left, and one on the right that leans forward."""
    walls = Wall(AT_RIGHT, SLANTED, surface), Wall(-AT_RIGHT, LEFT, surface)
    return World(G, floor or surface, walls=walls)


@pytest.mark.sample(1)
@pytest.mark.parametrize("sticking", [False, True], ids=["eq15", "eq17"])
def test_motion_between_walls_matches_the_transcription(sticking):
    """To 1e-13 of each part's scale after 1000 steps in which all three planes act (measured: 8e-15)."""
    found = reference_impl.simulate(THROWN, BOX, between_walls(Floor(0.6, np.inf if sticking else 0.0, 0.1)), 1e-3, 1000)
    planes = {}, {"point": AT_RIGHT, "normal": SLANTED}, {"point": -AT_RIGHT, "normal": LEFT}
    expected, acted = [found[0]], set()
    for _ in range(1000):
        after = update(expected[-1], BOX.mass, BOX.inertia, BOX.points, 1e-3, G, 1.0, 1.0, 0.6, sticking, 0.1, planes)
        push = after[VELOCITY] - expected[-1][VELOCITY] - 1e-3 * G
        acted |= {int(np.argmax([push @ UP, push @ SLANTED, push @ LEFT]))} if np.linalg.norm(push) > 1e-6 else set()
        expected.append(after)
    assert acted == {0, 1, 2}
    for part in (POSITION, ORIENTATION, VELOCITY, SPIN):
        assert np.abs(found[:, part] - np.array(expected)[:, part]).max() <= 1e-13 * np.abs(np.array(expected)[:, part]).max()


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("body", "methods"),
    [
        pytest.param(BOX, Methods(law="coulomb", contact="sequential"), id="box"),
        pytest.param(BALL, Methods(law="coulomb", contact="sequential"), id="ball"),
        pytest.param(CYLINDER, Methods(law="coulomb"), id="cylinder"),
    ],
)
def test_wall_is_a_floor_seen_from_elsewhere(body, methods):
    """A scene turned and moved has the same motion, to 1e-9 (measured: 3e-12)."""
    surface = Floor(0.4, 0.3)
    turn, at = Rotation.from_rotvec([0.4, -2.1, 1.3]), np.array([3.0, -2.0, 1.0])
    start = THROWN - 0.3 * np.eye(13)[1]
    turned = np.concatenate(
        [turn.apply(start[:3]) + at, (turn * Rotation.from_quat(start[3:7])).as_quat(), *turn.apply(start[7:].reshape(2, 3))]
    )
    wall = World(turn.apply(G), walls=(Wall(at + turn.apply([5.0, 0, 2.0]), turn.apply(UP), surface),))
    expected = reference_impl.simulate(start, body, World(G, surface), 1e-3, 400, methods=methods)
    found = reference_impl.simulate(turned, body, wall, 1e-3, 400, methods=methods)
    np.testing.assert_allclose(turn.inv().apply(found[:, :3] - at), expected[:, :3], atol=1e-9)
    np.testing.assert_allclose(turn.inv().apply(found[:, 7:10]), expected[:, 7:10], atol=1e-9)
    assert np.ptp(expected[:, 8]) > 1.0


def test_ball_at_a_smooth_elastic_wall_moves_as_the_mirror_image_of_the_free_one():
    wall = Wall(np.array([1.0, 0, 0]), -LEFT, Floor(1.0, 0.0))
    start = np.concatenate([[0, 1, 0, 0, 0, 0, 1], [3, 1, 1], [1.0, 2, 3]])
    free = reference_impl.simulate(start, BALL, World(G), 1e-3, 500)
    found = reference_impl.simulate(start, BALL, World(G, walls=(wall,)), 1e-3, 500)
    beyond = free[:, 0] > 0.9
    detected = free[np.argmax(beyond), 0]  # the step in which the ball is found behind the wall still moves it back by the depth
    np.testing.assert_allclose(found[:, 0], np.where(beyond, 2 * detected - free[:, 0], free[:, 0]), atol=1e-13)
    np.testing.assert_allclose(found[:, 1:7], free[:, 1:7], atol=1e-15)


@pytest.mark.extended
def test_bodies_between_walls_move_in_an_ensemble_as_alone():
    """To the last bit, those that touch a wall and those that do not."""
    starts = np.tile(THROWN, (19, 1))
    starts[:, POSITION] += np.linspace(-0.1, 0.1, 19)[:, None] * [1, 1, 2]
    worlds = between_walls(Floor(0.5, np.inf), Floor(0.5, np.inf, 0.0, (0.6, 0.3), 0.2))
    together = reference_impl.simulate(starts, BOX, worlds, 1e-3, 300)
    for start, rows in zip(starts, together, strict=True):
        np.testing.assert_array_equal(reference_impl.simulate(start, BOX, worlds, 1e-3, 300), rows)


@pytest.mark.sample(1)
@pytest.mark.parametrize("methods", [Methods(), Methods(law="normal", contact="sequential")], ids=str)
def test_floor_carries_no_point_beyond_its_end(methods):
    floor, arm = Floor(0.0, 0.0, 0.0, (1.0, 0.5), 0.3), np.array([0.3, 0.0, 0.2])

    def falls(*position, body=BALL):
        start = np.concatenate([position, [0, 0, 0, 1], [0, -1, 0, 0, 0, 0.0]])
        after = reference_impl.step(start, body, World(G, floor), 1e-3, methods=methods)
        return bool(after[8] < -1.0)

    for point in ([0.9, 0.0, 0.4], [-0.9, 0.0, -0.4], [1.1, 0.0, 0.0], [0.0, 0.0, -0.6]):  # the only vertex, away from the centre
        is_beyond = abs(point[0]) > 1.0 or abs(point[2]) > 0.5
        assert falls(*(np.array(point) - arm - 1e-3 * UP), body=Body(1.0, np.eye(3), arm[np.newaxis])) == is_beyond

    assert [falls(0.9, 0.05, 0.4), falls(-0.9, -0.15, -0.4)] == [False, False]
    assert [falls(1.1, 0.05, 0.0), falls(0.0, 0.05, -0.6)] == [True, True]
    assert falls(0.0, -0.25, 0.0)  # its lowest point is below the floor


def test_ball_that_slides_over_the_end_of_the_floor_falls_freely_from_there():
    start = np.concatenate([[0, 0.1, 0, 0, 0, 0, 1], [2, 0, 0, 0, 0, 0.0]])
    rows = reference_impl.simulate(start, BALL, World(G, Floor(0.0, 0.0, 0.0, (1.0, 1.0))), 1e-4, 7000)
    since = 1e-4 * (np.arange(7001) - 5000)
    expected = np.where(since > 0, 0.1 - 4.9 * since**2, 0.1)
    np.testing.assert_allclose(rows[:, 1], expected, atol=4e-4)  # g t dt/2 of the method, and the step before the end
    np.testing.assert_allclose(rows[:, 0], 2e-4 * np.arange(7001), atol=1e-12)


def test_frames_are_rotations_that_take_the_normal_upwards():
    normals = np.vstack([np.eye(3), -np.eye(3), [[1e-9, -1.0, 0.0]], Rotation.random(50, rng=1).apply([0, 0, 1])])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    for normal, frame in zip(normals, _frames(normals).reshape(-1, 3, 3), strict=True):
        np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-15)
        np.testing.assert_allclose(frame @ normal, UP, atol=1e-15)
        assert np.linalg.det(frame) > 0


@pytest.mark.parametrize(
    ("wall", "message"),
    [
        (Wall(np.zeros(3), [0, 2.0, 0], Floor(0.5, 0.0)), r"walls\[0\].normal: got .*; must be a vector of length 1"),
        (Wall([0, np.nan, 0], UP, Floor(0.5, 0.0)), r"walls\[0\].point: got .*; must be finite numbers, in m"),
        (Wall(np.zeros(3), UP, Floor(2.0, 0.0)), r"walls\[0\].restitution: got 2.0; must be between 0 and 1"),
        (Wall(np.zeros(3), UP, Floor(0.5, 0.3)), r"friction: got 0.3; law 'note' takes 0 and infinity only"),
    ],
)
def test_wrong_wall_is_named(wall, message):
    with pytest.raises(ValueError, match=message):
        reference_impl.step(THROWN, BOX, World(G, walls=(wall,)), 1e-3)
