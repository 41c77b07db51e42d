"""Moments that a body can have: closed forms, and random distributions of mass inside it."""

import math
from itertools import product

import numpy as np
import pytest
from scipy.optimize import linprog

from dropspin.scenarios import SceneError, load
from dropspin.scenarios.bodies.possible_moments import largest_multiple
from dropspin.scenarios.rotations import rotate

CUBE = np.array(list(product((-1.0, 1.0), repeat=3)))
X = np.array([1.0, 0.0, 0.0])
TRIANGLE = np.array([[math.cos(a), 0.0, math.sin(a)] for a in 2.0 * math.pi * np.arange(3) / 3.0])
CENTRED = [0.0, 0.0, 0.0]
TURN = np.array([0.3, 0.2, 0.5, 0.8]) / np.linalg.norm([0.3, 0.2, 0.5, 0.8])
BODIES = {
    "sphere": {"shape": "sphere", "radius": 0.2},
    "ellipsoid": {"shape": "ellipsoid", "half_extents": [0.1, 0.2, 0.3]},
    "box": {"shape": "box", "half_extents": [0.1, 0.2, 0.3]},
    "cylinder": {"shape": "cylinder", "radius": 0.2, "half_length": 0.1},
    "capsule": {"shape": "capsule", "radius": 0.1, "half_length": 0.2},
    "vertices": {"shape": "vertices", "points": [[-0.2, -0.2, -0.2], [0.3, -0.1, -0.2], [-0.1, 0.3, -0.1], [0.0, 0.0, 0.4]]},
}


def multiple(points, squares):
    return largest_multiple(points, np.array(squares, dtype=float), math.inf)


@pytest.mark.parametrize(
    ("points", "squares", "expected"),
    [
        (CUBE, np.eye(3), 1.0),
        (CUBE * [1.0, 1e-3, 2.0], np.diag([1.0, 1e-6, 4.0]), 1.0),
        (CUBE, np.diag([1.0, 1.0, 0.0]), 1.0),
        (CUBE + 0.5 * X, np.eye(3), 0.75),  # up to 1/2 · 3/2 of x²
        (CUBE, 1.5 * np.eye(3) - 0.5, 2.0 / 3.0),  # xy + yz + zx >= -1 at every corner of the cube
        (TRIANGLE, np.diag([1.0, 0.0, 1.0]), 0.5),
        (TRIANGLE, np.diag([0.0, 0.0, 1.0]), 1.0 / 3.0),  # all mass on the line x = 0, which is 2/√3 long
        (TRIANGLE, np.diag([1.0, 0.0, 0.0]), 0.5),
        (CUBE + 1.5 * X, np.eye(3), 0.0),
    ],
)
def test_largest_multiple_has_its_closed_form(points, squares, expected):
    """Within 6e-4 above it. The largest moments of a triangle along z are less than those of equal masses at its corners."""
    found = multiple(points, squares)
    assert expected * (1.0 - 1e-9) <= found <= expected * (1.0 + 5e-4) + 1e-4


def test_largest_multiple_of_any_moments_is_that_of_a_programme_over_a_fine_grid():
    """Of a tetrahedron with its centre of mass anywhere inside, by masses at 4,495 points; these are fewer than all."""
    random = np.random.default_rng(2)
    steps = np.array([share for share in product(range(30), repeat=3) if sum(share) <= 29]) / 29.0
    for _ in range(3):
        corners = random.normal(size=(4, 3))
        corners -= random.dirichlet(np.full(4, 5.0)) @ corners
        points = corners[0] + steps @ (corners[1:] - corners[0])
        factor = random.normal(size=(3, 3))
        squares = factor @ factor.T
        moments = np.array([np.outer(point, point)[np.triu_indices(3)] for point in points])
        equal = np.column_stack([np.vstack([moments.T, points.T]), -np.append(squares[np.triu_indices(3)], np.zeros(3))])
        shares = np.append(np.ones(len(points)), 0.0)
        of_grid = -linprog(shares - 1.0, shares[None], [1.0], equal, np.zeros(9)).fun
        assert of_grid * (1.0 - 1e-6) <= multiple(corners, squares) <= 1.01 * of_grid


BETWEEN = np.array([math.sin(math.pi / 64), 0.0, math.cos(math.pi / 64)])
"""A direction between the corners of the polygon around a rim."""
Y = np.array([0.0, 1.0, 0.0])
OBLIQUE = math.cos(17.0 * math.pi / 64) * Y + math.sin(17.0 * math.pi / 64) * BETWEEN


def on_a_floor(body):
    floor = {"restitution": 0.5, "friction": 0.3}
    start = {"position": [0.0, 5.0, 0.0]}
    return load({"duration": 1.0, "body": body, "start": start, "gravity": {"acceleration": [0.0, -9.8, 0.0]}, "floor": floor}).body


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", BODIES)
def test_moments_of_masses_inside_a_body_are_accepted_and_larger_ones_are_refused(name):
    """Three to six masses anywhere inside and on the surface, with their centre of mass and their full tensor."""
    random = np.random.default_rng(4)
    shape = on_a_floor(BODIES[name] | {"mass": 2.0, "inertia": [1e-4] * 3, "center_of_mass": CENTRED})
    for count in (3, 4, 6):
        directions = random.normal(size=(count, 3))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        points = random.dirichlet(np.full(len(shape.corners), 0.2), count) @ shape.corners + directions * shape.semi_axes
        shares = random.dirichlet(np.ones(count))
        centre = shares @ points
        squares = (points - centre).T * shares @ (points - centre)
        tensor = 2.0 * (np.trace(squares) * np.eye(3) - squares)
        given = BODIES[name] | {"mass": 2.0, "center_of_mass": centre.tolist()}
        body = on_a_floor(given | {"inertia": tensor.tolist()})
        larger = 1.01 * body.possible_multiple(squares)
        assert larger >= 1.01 * (1.0 - 1e-9)
        with pytest.raises(SceneError, match=r"needs mass outside of the body: at most 0\.99 times"):
            on_a_floor(given | {"inertia": (larger * tensor).tolist()})


@pytest.mark.parametrize(
    ("body", "squares"),
    [
        (BODIES["sphere"], np.eye(3) * 0.2**2 / 3.0),
        (BODIES["sphere"] | {"center_of_mass": [0.1, 0.0, 0.0]}, np.diag([0.2**2 - 0.1**2, 0.0, 0.0])),
        (BODIES["ellipsoid"], np.diag([0.5 * 0.1**2, 0.0, 0.5 * 0.3**2])),
        (BODIES["ellipsoid"] | {"center_of_mass": [0.05, 0.1, 0.0]}, 0.5 * np.diag([0.1**2, 0.0, 0.0])),
        (BODIES["cylinder"], np.diag([0.5 * 0.2**2, 0.1**2, 0.5 * 0.2**2])),
        (BODIES["cylinder"] | {"center_of_mass": [0.1, 0.05, 0.0]}, np.diag([0.75 * 0.2**2, 0.75 * 0.1**2, 0.0])),
        (BODIES["cylinder"], 0.2**2 * np.outer(BETWEEN, BETWEEN)),
        (BODIES["capsule"], np.diag([0.0, 0.3**2, 0.0])),
        (BODIES["capsule"], np.outer(0.2 * Y + 0.1 * OBLIQUE, 0.2 * Y + 0.1 * OBLIQUE)),
        (BODIES["box"], np.diag([0.1**2, 0.2**2, 0.3**2])),
        ({"shape": "box", "half_extents": [0.1] * 3}, 0.01 * (np.eye(3) - 1.0 / 3.0)),
        (BODIES["box"] | {"center_of_mass": [0.05, 0.0, 0.0]}, np.diag([0.75 * 0.1**2, 0.2**2, 0.3**2])),
    ],
)
def test_largest_moments_of_shapes_have_their_closed_form(body, squares):
    """A mean square distance of 1 in units of the half extents; the square of a rim's radius; a sum of products at a cube's corners.

    Where there is no formula, up to 1 % more.
    """
    found = on_a_floor(body | {"mass": 1.0, "inertia": [1e-4] * 3}).possible_multiple(squares)
    has_formula = body["shape"] in ("sphere", "ellipsoid") or (body["shape"] == "box" and not np.triu(squares, 1).any())
    assert 1.0 - 1e-9 <= found <= (1.0 + 1e-9 if has_formula else 1.01)


def test_a_tensor_is_judged_in_any_axes():
    """All mass of a cube at its corners, with the axes of the tensor turned: a cube has equal moments, so the same; a long box does not."""
    cube = {"shape": "box", "half_extents": [0.1] * 3, "mass": 1.0}
    turned = rotate(TURN, rotate(TURN, np.diag([0.04, 0.03, 0.02])).T)
    on_a_floor(cube | {"inertia": (0.02 * np.eye(3)).tolist()})
    on_a_floor({"shape": "box", "half_extents": [0.08, 0.14, 0.18], "mass": 1.0, "inertia": [0.04, 0.03, 0.02]})
    with pytest.raises(SceneError, match="times as much is possible"):
        on_a_floor({"shape": "box", "half_extents": [0.08, 0.14, 0.18], "mass": 1.0, "inertia": turned.tolist()})
