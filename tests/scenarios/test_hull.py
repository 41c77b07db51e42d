"""The corners of a body of points: those that can be the lowest, whatever its shape."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dropspin.scenarios import load
from dropspin.scenarios.bodies.hull import hull_corners
from dropspin.scenarios.mechanics import lowest_height, offset_of
from dropspin.scenarios.trajectory import Trajectory

SKEW = Rotation.from_quat([0.2, 0.5, -0.3, 0.7]).as_matrix()
GRID = np.stack(np.meshgrid(np.arange(5.0), np.arange(4.0)), axis=-1).reshape(-1, 2)
CUBE = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
NOISE = np.random.default_rng(1).normal(size=(20, 3))

SHAPES = {  # points, how many are corners
    "cube": (CUBE @ SKEW.T, 8),
    "cube with points within, on faces and on edges": (np.vstack([CUBE, 0.5 * CUBE, np.eye(3), [[1, 1, 0]], [[0, 0, 0]]]), 8),
    "plate": (np.column_stack([GRID, np.zeros(20)]), 4),
    "plate in a skew plane, off the origin": (np.column_stack([GRID, np.zeros(20)]) @ SKEW.T + 3.0, 4),
    "plate of the thickness of rounding": (np.column_stack([GRID, 1e-16 * NOISE[:, 0]]) @ SKEW.T, 4),
    "plate a little thicker": (np.column_stack([GRID, 1e-11 * NOISE[:, 0]]) @ SKEW.T, None),
    "line": (np.outer(np.arange(7.0), SKEW[0]), 2),
    "line that is nearly one": (np.outer(np.arange(20.0), SKEW[0]) + 1e-12 * NOISE, None),
    "triangle": (NOISE[:3], 3),
    "two points": (CUBE[:2], 2),
    "one point twice": (np.ones((2, 3)), 1),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_lowest_corner_is_the_lowest_point_in_every_direction(shape):
    """To 1e-14 of the size, in 500 directions."""
    points, count = SHAPES[shape]
    corners = hull_corners(points)
    directions = np.random.default_rng(2).normal(size=(500, 3))
    heights = points @ (directions / np.linalg.norm(directions, axis=1, keepdims=True)).T
    assert np.abs(heights[corners].min(axis=0) - heights.min(axis=0)).max() <= 1e-14 * np.abs(points).max()
    assert len(corners) == (len(corners) if count is None else count)
    assert np.array_equal(corners, np.unique(corners))


def body_of(points):
    return load({"duration": 1.0, "body": {"shape": "vertices", "mass": 1.0, "points": np.asarray(points).tolist()}})


def test_body_without_other_points_than_corners_has_the_same_lowest_height_bit_for_bit():
    scene = body_of(NOISE / np.linalg.norm(NOISE, axis=1, keepdims=True))
    np.testing.assert_array_equal(scene.body.hull, scene.body.vertices)
    attitudes = Rotation.random(50, random_state=3).as_quat()
    motion = Trajectory.from_states(np.arange(50.0), np.hstack([np.zeros((50, 3)), attitudes, np.zeros((50, 6))]))
    expected = np.min([offset_of(tuple(attitudes.T), vertex) for vertex in scene.body.vertices.tolist()], axis=0)
    np.testing.assert_array_equal(lowest_height(scene, motion), expected)


def test_body_of_a_thousand_points_is_searched_by_its_corners():
    """Three shells of a cube's corners, filled: 8 corners are left of 1,008 points."""
    filling = np.random.default_rng(4).uniform(-0.9, 0.9, size=(1000, 3))
    assert len(body_of(np.vstack([CUBE, filling])).body.hull) == 8
