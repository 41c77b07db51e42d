"""The surfaces of bodies: closed, with faces in order."""

from itertools import pairwise

import numpy as np
import pytest

import dropspin as ds
from dropspin.scenarios.rotations import rotate

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
def test_faces_of_a_body_enclose_its_volume(name):
    """The faces, all counterclockwise seen from outside, enclose the volume of the body by the divergence theorem."""
    body, faces, volume = SOLIDS[name]
    shape = ds.load({"duration": 1.0, "body": body}).body.outline
    assert len(shape.faces) == faces
    held = 0.0
    for face in shape.faces:
        first, *rest = shape.vertices[list(face)]
        held += sum(np.dot(first, np.cross(a, b)) for a, b in pairwise(rest)) / 6.0
    assert held == pytest.approx(volume, rel=1e-12)


def test_plane_body_is_one_face():
    """A square of points in a general orientation: one face of four corners, in order."""
    corners = np.array([[1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0], [0.0, 0.0, 0.0]])
    points = rotate(np.array([0.1, 0.2, 0.3, 0.4]) / np.sqrt(0.3), corners)
    shape = ds.load({"duration": 1.0, "body": {"shape": "vertices", "points": points.tolist(), "mass": 1.0}}).body.outline
    assert shape.is_flat
    [face] = shape.faces
    sides = np.linalg.norm(np.diff(shape.vertices[[*face, face[0]]], axis=0), axis=1)
    np.testing.assert_allclose(sides, 2.0, rtol=1e-12)


THIN = {
    "points within a few metres of a triangle of a thousand kilometres": {
        "shape": "vertices",
        "points": [[1.0, 1.0, 0.0], [3.0, 1e-3, 1e6], [1e-5, 2.0, 3.0], [1e-3, 0.0, 1e4], [1e4, 0.0, 1e4], [0.0, 2.0, 3.0]],
        "mass": 1.0,
    },
    "a rod of a light year": {"shape": "box", "half_extents": [9e15, 1.0, 5e-3], "mass": 1.0},
    "points on a line": {"shape": "vertices", "points": [[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], "mass": 1.0, "inertia": [0.1, 1.0, 1.0]},
}


@pytest.mark.parametrize("name", THIN)
def test_body_thinner_than_qhull_resolves_is_plane(name):
    body = ds.load({"duration": 1.0, "body": THIN[name]}).body
    shape = body.outline
    assert shape.is_flat
    [face] = shape.faces
    assert sorted(face) == list(range(len(shape.vertices)))
    assert body.resting_height < 0.01
