"""Heights at rest of bodies that are put on known faces."""

import numpy as np
import pytest
from support.tosses import BRICK

from dropspin.comparisons.logs.log import Header, Log, Toss
from dropspin.comparisons.logs.rest import Rests, level_share, rests
from dropspin.scenarios.rotations import about, multiply, rotate
from dropspin.scenarios.state import Array

QUARTER = np.asarray(np.pi / 2)
FACES = {  # orientations in which an axis of the body is up or down, and the half extent along it [m]
    (0, 1): (about(np.array([0.0, 0.0, 1.0]), QUARTER), 0.04),
    (0, -1): (about(np.array([0.0, 0.0, 1.0]), -QUARTER), 0.04),
    (1, 1): (np.array([0.0, 0.0, 0.0, 1.0]), 0.05),
    (1, -1): (np.array([1.0, 0.0, 0.0, 0.0]), 0.05),
    (2, 1): (about(np.array([1.0, 0.0, 0.0]), -QUARTER), 0.07),
    (2, -1): (about(np.array([1.0, 0.0, 0.0]), QUARTER), 0.07),
}


def resting(scale: float, error: Array, tilt: float = 0.0) -> Log:
    """A brick on each face, turned about the vertical; the tracked point is at `error` [m] from the centre, which the header gives."""
    tosses = []
    for number, (orientation, half) in enumerate(FACES.values()):
        turned = multiply(about(np.array([0.0, 1.0, 0.0]), np.asarray(0.3 * number)), orientation)
        height = scale * (half + rotate(turned, error)[1])
        record = multiply(about(np.array([0.6, 0.0, 0.8]), np.asarray(tilt)), turned)
        rows = np.ones((12, 1))
        tosses.append(Toss(str(number), np.arange(12) / 100.0, rows * [0.1, height, 0.2], rows * record))
    return Log(Header.model_validate({"data": "made", "rate": 100.0, "body": BRICK}), tuple(tosses), "made", ())


def test_scale_and_tracked_point_are_exact() -> None:
    error = np.array([0.001, -0.002, 0.003])
    scale, _, found, _ = rests(resting(0.98, error)).scale()
    assert scale == pytest.approx(0.98, abs=1e-12)
    np.testing.assert_allclose(found, 0.98 * error, atol=1e-12)


def test_a_record_that_is_not_quite_level_does_not_change_the_scale() -> None:
    # The mean height of a face's corners is the height of its centre; that of its lowest corner is 0.5 mm less.
    scale, _, _, _ = rests(resting(1.0, np.zeros(3), tilt=0.005)).scale()
    assert scale == pytest.approx(1.0, abs=1e-4)


def test_an_axis_of_which_one_face_was_seen_says_nothing_about_the_point() -> None:
    log = resting(1.0, np.zeros(3))
    found = rests(log)
    some = np.array([0, 0, 2, 3, 4, 5])
    partial = Rests(found.orientations[some], found.heights[some], found.expected[some])
    _, _, errors, _ = partial.scale()
    assert np.isnan(errors[0])
    assert np.isfinite(errors[1:]).all()


def test_bodies_on_faces_are_level_and_those_on_edges_are_not() -> None:
    assert level_share(resting(1.0, np.zeros(3))) == (1.0, 6)
    assert level_share(resting(1.0, np.zeros(3), tilt=0.3)) == (0.0, 6)
