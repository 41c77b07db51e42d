"""Scenes that are valid, but probably not meant: moments of inertia without a body, mass at the points of a solid, another axis up."""

import re
import warnings

import numpy as np
import pytest
from support.cli import dropspin

from dropspin.scenarios import SceneError, load
from dropspin.scenarios.errors import SceneWarning
from dropspin.scenarios.random_families import FAMILIES

BOX = {"shape": "box", "half_extents": [0.005, 0.01, 0.01], "mass": 0.1}
FLOOR = {"floor": {"restitution": 0.5, "friction": 0.3}, "gravity": {"acceleration": [0.0, -9.8, 0.0]}}


def scene(body, **tables):
    return {"duration": 1.0, "body": body, "start": {"position": [0.0, 1.0, 0.0]}, **tables}


@pytest.mark.parametrize(
    ("shape", "largest"),
    [
        ({"shape": "box", "half_extents": [0.005, 0.01, 0.01]}, [2e-4, 1.25e-4, 1.25e-4]),  # all mass at the corners
        ({"shape": "sphere", "radius": 0.3}, [0.06, 0.06, 0.06]),  # a shell: 2/3 M R²
        ({"shape": "sphere", "radius": 0.3}, [0.09, 0.09, 0.0]),  # all mass at two poles
        ({"shape": "vertices", "points": [[-0.1, -0.1, -0.1], [0.1, 0.1, -0.1], [0.1, -0.1, 0.1], [-0.1, 0.1, 0.1]]}, [0.02, 0.02, 0.02]),
    ],
)
def test_largest_possible_moments_are_accepted_and_larger_ones_are_not(shape, largest):
    """Given with four digits, a possible moment may be too large in the fifth."""
    body = {"mass": 1.0, **shape}
    moments = np.maximum(largest, 1e-9)
    load(scene({**body, "inertia": (1.0005 * moments).tolist()}, **FLOOR))
    with pytest.raises(SceneError, match="needs mass outside of the body"):
        load(scene({**body, "inertia": (1.01 * moments).tolist()}, **FLOOR))


def test_message_on_impossible_moments_gives_the_largest_possible_ones():
    """For a cube with sides of 104.8 mm and 0.37 kg, 0.00203 kg m²: all of its mass at its corners."""
    cube = {"shape": "box", "half_extents": [0.0524] * 3, "mass": 0.37, "inertia": [0.0081] * 3}
    with pytest.raises(SceneError, match=re.escape("up to [0.00203, 0.00203, 0.00203] kg m² for 0.37 kg. Correct")):
        load(scene(cube, **FLOOR))
    with pytest.warns(SceneWarning, match="Without a floor, the size has no effect"):
        assert load(scene(cube)).body.inertia == (0.0081, 0.0081, 0.0081)


def test_moments_within_bounds_of_a_body_that_is_too_thin_for_them_are_refused():
    """Each moment is possible, but together they need a mean square of x of 5e-5 m², and x is at most 5 mm."""
    with pytest.raises(SceneError, match=re.escape("root mean square of x, y and z of [0.00707, ")):
        load(scene({**BOX, "inertia": [1e-5, 1e-5, 1e-5]}, **FLOOR))


def test_mass_at_the_points_of_a_body_is_mentioned_unless_it_is_asked_for():
    points = [[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)]
    body = {"shape": "vertices", "mass": 1.0, "points": points}
    with pytest.warns(SceneWarning, match="the mass is at the 8 points"):
        load(scene(body))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for meant in ({"inertia": "vertices"}, {"inertia": [0.5, 0.5, 0.5]}, {"masses": [0.125] * 8}):
            load(scene({**body, **meant}))


@pytest.mark.parametrize("gravity", [[0.0, 0.0, -9.81], [9.81, 0.0, 0.0], [0.0, -1e-9, -9.81]])
def test_gravity_along_the_floor_is_mentioned(gravity):
    with pytest.warns(SceneWarning, match="along the floor.*y is up"):
        load(scene(BOX, **FLOOR | {"gravity": {"acceleration": gravity}}))


@pytest.mark.extended
def test_scenes_on_slopes_in_free_fall_and_drawn_ones_are_not_mentioned():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load(scene(BOX, gravity={"acceleration": [0.0, 0.0, -9.81]}))
        load(scene(BOX, **FLOOR | {"gravity": {"acceleration": [9.5, -0.2, 0.0]}}))
        load(scene(BOX, **FLOOR | {"gravity": {"acceleration": [0.0, 0.0, 0.0]}}))
        for number in range(1, len(FAMILIES)):
            load(f"draw-7-{number}")


def test_command_prints_a_warning_in_one_line(tmp_path):
    path = tmp_path / "z-up.toml"
    path.write_text(
        "duration = 1.0\n[body]\nshape = 'sphere'\nradius = 0.1\nmass = 1.0\n[start]\nposition = [0, 1, 1]\n"
        "[gravity]\nacceleration = [0, 0, -9.81]\n[floor]\nrestitution = 0.5\nfriction = 'none'\n"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        finished = dropspin("show", path, cwd=tmp_path)
    assert finished.returncode == 0
    assert finished.stderr.startswith("dropspin: warning: ")
    assert finished.stderr.count("\n") == 1
