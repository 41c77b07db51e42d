"""Heights at rest of bodies that are put on known faces."""

from dataclasses import replace

import numpy as np
import pytest
from support.tosses import BRICK, made

from dropspin.comparisons.logs.flights import flights_of
from dropspin.comparisons.logs.header import Header
from dropspin.comparisons.logs.log import Log, Toss
from dropspin.comparisons.logs.other_conventions import of_lengths, orders_of_axes
from dropspin.comparisons.logs.recording_faults import of_floor
from dropspin.comparisons.logs.rest import Rests, level_share, rests
from dropspin.scenarios.rotations import about, multiply, rotate
from dropspin.scenarios.state import Array

FLOOR = {"restitution": 0.3, "friction": 0.3}
QUARTER = np.asarray(np.pi / 2)
FACES = {  # orientations in which an axis of the body is up or down, and the half extent along it [m]
    (0, 1): (about(np.array([0.0, 0.0, 1.0]), QUARTER), 0.04),
    (0, -1): (about(np.array([0.0, 0.0, 1.0]), -QUARTER), 0.04),
    (1, 1): (np.array([0.0, 0.0, 0.0, 1.0]), 0.05),
    (1, -1): (np.array([1.0, 0.0, 0.0, 0.0]), 0.05),
    (2, 1): (about(np.array([1.0, 0.0, 0.0]), -QUARTER), 0.07),
    (2, -1): (about(np.array([1.0, 0.0, 0.0]), QUARTER), 0.07),
}


def resting(scale: float, error: Array, tilt: float = 0.0, floor: float = 0.0) -> Log:
    """A brick on each face, turned about the vertical; the tracked point is at `error` [m] from the centre, which the header gives."""
    tosses = []
    for number, (orientation, half) in enumerate(FACES.values()):
        turned = multiply(about(np.array([0.0, 1.0, 0.0]), np.asarray(0.3 * number)), orientation)
        height = scale * (floor + half + rotate(turned, error)[1]) - floor
        record = multiply(about(np.array([0.6, 0.0, 0.8]), np.asarray(tilt)), turned)
        rows = np.ones((12, 1))
        tosses.append(Toss(str(number), np.arange(12) / 100.0, rows * [0.1, height, 0.2], rows * record))
    header = {"data": "made", "rate": 100.0, "body": BRICK, "floor_height": floor}
    return Log(Header.model_validate(header), tuple(tosses), "made", ())


@pytest.mark.parametrize("floor", [0.0, 0.7, -0.4])
def test_scale_and_tracked_point_are_exact(floor: float) -> None:
    error = np.array([0.001, -0.002, 0.003])
    scale, _, found, _ = rests(resting(0.98, error, floor=floor)).scale()
    assert scale == pytest.approx(0.98, abs=1e-12)
    np.testing.assert_allclose(found, 0.98 * error, atol=1e-12)


def test_heights_at_rest_tell_edges_in_another_order_from_moments() -> None:
    log = resting(1.0, np.array([1e-4, 2e-4, -1e-4]))
    assert {cause.name for _, cause in orders_of_axes(log)} == {"order of the moments"}
    wrong = replace(log, header=log.header.corrected({"body.half_extents": [0.07, 0.04, 0.05], "body.inertia": [5.5e-4, 9.9e-4, 8.7e-4]}))
    right = [cause for inertia, cause in orders_of_axes(wrong) if np.array_equal(inertia, log.header.body.inertia_tensor)]
    assert [(cause.name, cause.keys["body.half_extents"]) for cause in right] == [("body axes", [0.04, 0.05, 0.07])]


def test_heights_at_rest_name_edges_in_another_order_beside_moments_in_numbers() -> None:
    """The moments are right, so that the motion shows nothing. A floor that is too high moves all heights alike."""
    log = resting(1.0, np.array([1e-4, 2e-4, -1e-4]))
    assert list(of_lengths(log)) == []
    wrong = log.header.corrected({"body.half_extents": [0.07, 0.05, 0.04], "floor_height": 0.1})
    [found] = of_lengths(replace(log, header=wrong))
    assert (found.kind, [cause.keys for cause in found.causes]) == ("lengths", [{"body.half_extents": [0.04, 0.05, 0.07]}])
    assert found.value == pytest.approx(np.std([0.03, 0.03, 0.0, 0.0, -0.03, -0.03], ddof=1), rel=0.01)
    assert found.rests < 5e-4
    both_edges = log.header.corrected({"body.half_extents": [0.05, 0.05, 0.07]})
    assert list(of_lengths(replace(log, header=both_edges))) == []


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


def test_a_floor_at_another_height_is_named_with_the_height_that_fits() -> None:
    flights = flights_of(made(3, 2, (2e-4, 2e-3), spin=8.0).log, np.array([0.0, -9.81, 0.0]))
    assert flights is not None

    def keys(above: float, floor: dict[str, float] | None = FLOOR, scale: float = 1.0) -> list[dict[str, float]]:
        log = resting(scale, np.zeros(3))
        tosses = tuple(replace(toss, position=np.add(toss.position, [0.0, above, 0.0])) for toss in log.tosses)
        header = Header.model_validate({**log.header.model_dump(), "floor_height": 0.1, "floor": floor})
        found = of_floor(replace(flights, log=replace(log, header=header, tosses=tosses)), 1e-4)
        return [dict(finding.causes[0].keys) for finding in found]

    assert keys(0.35) == [{"floor_height": 0.45}]
    assert keys(-0.25) == [{"floor_height": -0.15}]
    assert keys(0.001) == keys(0.0, scale=0.98) == keys(0.35, floor=None) == []


def test_height_above_the_floor_needs_several_rests() -> None:
    found = rests(resting(1.0, np.array([0.001, -0.002, 0.003])))
    above, error = found.above()
    # On both faces of each axis, δ cancels; its standard deviation is that of ±1, ±2, ±3 mm.
    assert above == pytest.approx(0.0, abs=1.1e-3)
    assert error == pytest.approx(1e-3 * np.sqrt(28.0 / 5.0 / 6.0), rel=1e-9)
    assert np.isnan(Rests(*(part[:5] for part in found)).above()).all()


def test_bodies_at_rest_are_recognised_beside_noise_and_bodies_that_move_are_not() -> None:
    """At the noise of tags, and at a hundredth of the size in 0.1 s, which is ten times the noise."""
    random, log = np.random.default_rng(3), resting(1.0, np.zeros(3))
    noisy = [
        replace(toss, position=toss.position + 2e-4 * random.normal(size=(12, 3)), orientation=_noisy(toss.orientation, 2e-3, random))
        for toss in log.tosses
    ]
    assert len(rests(replace(log, tosses=tuple(noisy))).heights) == 6
    moving = [replace(toss, position=toss.position + 0.02 * toss.t[:, np.newaxis] * np.array([1.0, 0.0, 0.0])) for toss in noisy]
    assert len(rests(replace(log, tosses=tuple(moving))).heights) == 0


def _noisy(orientations: Array, noise: float, random: np.random.Generator) -> Array:
    turned = orientations + noise / 2.0 * random.normal(size=orientations.shape)
    return turned / np.linalg.norm(turned, axis=1, keepdims=True)


@pytest.mark.parametrize(("elsewhere", "apart"), [(2, False), (10, True)])
def test_a_few_bodies_on_something_else_do_not_hide_the_floor_of_the_others(elsewhere, apart):
    """Of 20 bodies that rest at 0.5 m, some lie up to a metre lower."""
    expected = np.tile([0.02, 0.03, 0.05, 0.02], 5)
    lower = np.where(np.arange(20) < elsewhere, np.linspace(0.4, 1.0, 20), 0.0)
    found = Rests(np.tile([0.0, 0.0, 0.0, 1.0], (20, 1)), 0.5 + expected - lower, expected)
    assert found.are_apart(0.1) is apart
