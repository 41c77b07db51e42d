"""Prisms that roll over their edges, compared with Taylor series of 40 digits, McGeer's ratio and speed, and the laws of contact."""

import math
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from mpmath import mp, mpf
from support.scenes import G, prism, regular
from support.taylor import Solution

from dropspin.scenarios import load, truth_for
from dropspin.scenarios.mechanics import energy
from dropspin.scenarios.rotations import about, multiply, rotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN

UP = np.array([0.0, 1.0, 0.0])
IRREGULAR = ([0.0, -0.21], [0.13, -0.16], [0.22, 0.02], [-0.02, 0.2], [-0.18, -0.06]), (0.5, 0.7, 0.4, 0.6, 0.8)


def rolled(points, masses, pull, speed, guesses):
    """Each landing about the next corner: time, angle of rotation, angular velocities before and after, way of the pivot; 40 digits.

    Angles are positive forward. The rotation of the arm (x, y) from the corner in contact to the centre of mass and the angular velocity
    follow from the moment of gravity about that corner. The landing is a root of the height of the neighbouring corner, and the angular
    momentum about this corner is a sum over the points.

    Args:
        points: In the plane, relative to the centre of mass, at the start; the first one is in contact.
        masses: Their masses.
        pull: Gravity in the plane.
        speed: Angular velocity at the start.
        guesses: Times of the landings to within 1e-7 s, and whether each is forward.
    """
    M, now, turned, way, corner = mpmath.fsum(masses), mpf(0), mpf(0), mpf(0), 0
    inertia = mpmath.fsum(m * (x * x + y * y) for m, (x, y) in zip(masses, points, strict=True))
    for guess, is_forward in guesses:

        def seen(point, by):
            (x, y), sine, cosine = point, mpmath.sin(by), mpmath.cos(by)
            return x * cosine + y * sine, y * cosine - x * sine

        old, new = corner % len(points), (corner + (1 if is_forward else -1)) % len(points)
        arm = seen([-c for c in points[old]], turned)
        square = arm[0] ** 2 + arm[1] ** 2
        torque = M / (inertia + M * square)

        def rates(unknowns, torque=torque):
            _, rate, x, y = unknowns
            return [1 * rate, torque * pull[0] * y - torque * pull[1] * x, y * rate, -1 * (x * rate)]

        solution, wait = Solution(rates, [turned, speed, *arm], step=0.5), guess - now - mpf("1e-6")
        for _ in range(6):  # Newton's method at ascending times
            angle, rate, *_ = solution(wait)
            across, height = (a - b for a, b in zip(seen(points[new], angle), seen(points[old], angle), strict=True))
            wait += height / (across * rate)
        heights = [seen(point, angle)[1] - seen(points[old], angle)[1] for point in points]
        assert min(heights) > -mpf("1e-30")
        assert sum(abs(height) < mpf("1e-30") for height in heights) == 2
        places = [seen(point, angle) for point in points]
        about_new = mpf(0)
        for m, (x, y) in zip(masses, places, strict=True):
            velocity = rate * (y - places[old][1]), -rate * (x - places[old][0])
            about_new += m * ((y - places[new][1]) * velocity[0] - (x - places[new][0]) * velocity[1])
        after = about_new / (inertia + M * (places[new][0] ** 2 + places[new][1] ** 2))
        now, turned, way, corner, speed = now + wait, angle, way + across, corner + (1 if is_forward else -1), after
        yield now, angle, rate, after, way - places[new][0], -places[new][1]


@pytest.mark.parametrize(
    ("corners", "masses", "speed", "slope", "heading", "count"),
    [
        (regular(8), None, 3.4, 0.0, 0.0, 7),  # over four edges, then it rocks
        (regular(6), None, 3.0, 0.15, 0.3, 6),
        (regular(12), None, -3.0, 0.2, -2.0, 8),  # uphill, and back
        (regular(8), None, -1.0, 0.5, 0.0, 3),  # turns back before it lands, on a slope steeper than π/8
        (*IRREGULAR, 3.2, 0.12, 1.0, 6),
        (*IRREGULAR, -2.5, -0.05, 0.0, 4),
    ],
)
def test_landings_match_taylor_series(corners, masses, speed, slope, heading, count):
    """Times, angular velocities and positions to 1e-13 (measured 1.3e-14 s, 1.1e-15, 4e-16 m)."""
    scene = prism(corners, speed, slope, masses=masses, heading=heading, duration=4.0)
    truth = truth_for(scene)
    assert len(truth.events) >= count
    course = rotate(about(UP, np.array(heading)), np.array([1.0, 0.0, 0.0]))
    axis = np.cross(UP, course)
    guesses = [(mpf(event.time), float(event.before[SPIN] @ axis) > 0.0) for event in truth.events[:count]]
    with mp.workdps(40):
        weights = [mpf(1)] * len(corners) if masses is None else [mpf(m) for m in masses]
        plane = [[mpf(float(c)) for c in vertex[:2]] for vertex in scene.body.vertices[::2]]
        pull = [mpf(float(scene.acceleration @ course)), mpf(float(scene.acceleration[1]))]
        start = np.array(scene.start.position)
        pivot = start @ course + float(plane[0][0])
        for event, row in zip(truth.events, rolled(plane, weights, pull, mpf(speed), guesses), strict=False):
            time, angle, before, after, way, height = map(float, row)
            assert event.time == pytest.approx(time, abs=1e-13)
            assert event.before[SPIN] @ axis == pytest.approx(before, rel=1e-13)
            assert event.after[SPIN] @ axis == pytest.approx(after, rel=1e-13)
            assert event.before[POSITION] @ course == pytest.approx(pivot + way, abs=1e-13)
            assert event.before[1] == pytest.approx(height, abs=1e-14)
            turned = multiply(about(axis, np.array(angle)), np.array(scene.start.orientation))
            assert abs(event.before[ORIENTATION] @ turned) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("n", [4, 5, 6, 8, 20])
@pytest.mark.parametrize("moment", [0.5, 0.7])
def test_landing_keeps_mcgeers_ratio(n, moment):
    """(I + M R² cos(2π/n)) / (I + M R²), with I about the axis."""
    points, square = [[*corner, z] for corner in regular(n) for z in (-0.1, 0.1)], 0.2**2
    body = {
        "shape": "vertices",
        "points": points,
        "mass": 2.0,
        "inertia": [moment * square + 0.01, moment * square + 0.01, moment * 2.0 * square],
    }
    impact = truth_for(prism(regular(n), 2.0, 0.1, body=body)).events[0]
    assert impact.after[12] / impact.before[12] == pytest.approx((moment + math.cos(2 * math.pi / n)) / (moment + 1.0), rel=1e-13)


@pytest.mark.parametrize("speed", [2.4, 4.5])
def test_speed_on_a_slope_tends_to_mcgeers_fixed_point(speed):
    """What a landing takes equals what a step down the slope of 2 R sin(π/n) gives: (1 - r²) ω² (1 + k) R²/2 = g 2 R sin(π/n) sin γ."""
    truth = truth_for(prism(regular(8), speed, 0.1, duration=30.0))
    ratio = (1.0 + math.cos(math.pi / 4)) / 2.0
    step = 2.0 * 0.2 * math.sin(math.pi / 8)
    expected = math.sqrt(G * step * math.sin(0.1) / ((1.0 - ratio**2) * 0.2**2))
    assert (truth.name, truth.horizon) == ("rimless-wheel", 30.0)
    assert abs(truth.events[0].before[12] + expected) > 0.1
    np.testing.assert_allclose([-event.before[12] for event in truth.events[-5:]], expected, rtol=1e-11)
    q = truth(np.linspace(0.0, 30.0, 1000)).orientation
    assert np.sum(q[1:] * q[:-1], axis=1).min() > 0.9  # also from one turn to the next


@pytest.mark.extended
@settings(max_examples=60, deadline=None)
@given(
    st.integers(3, 12),
    st.floats(0.2, 6.0) | st.floats(-6.0, -0.2),
    st.floats(-0.3, 0.3),
    st.floats(-3.0, 3.0),
    st.floats(0.05, 0.95),
)
def test_motion_obeys_the_laws_of_contact(n, speed, slope, heading, share):
    """Up to the horizon: energy between landings to 1e-12, no corner below the floor, the edge at rest, and no pull of the floor."""
    scene = prism(regular(n), speed, slope, lean=(2.0 * share - 1.0) * 0.9 * math.pi / n, heading=heading)
    truth = truth_for(scene)
    assume(truth is not None)
    edges = [0.0, *(event.time for event in truth.events if event.time > 0.0), truth.horizon]
    for begin, end in pairwise(edges[:13]):
        if end - begin < 1e-3:
            continue
        times = np.linspace(begin, end, 30)[1:]
        motion = truth(times)
        assert np.ptp(energy(scene, motion)) <= 1e-12 * 2.0 * G * n * 0.2
        corners = motion.position[:, None] + rotate(motion.orientation[:, None], scene.body.vertices[None])
        assert corners[..., 1].min() >= -1e-13
        lowest = corners[..., 1].argsort(axis=1)[:, :2]
        arms = np.take_along_axis(corners - motion.position[:, None], lowest[..., None], axis=1)
        slip = motion.velocity[:, None] + np.cross(motion.angular_velocity[:, None], arms)
        assert np.abs(slip[:-1]).max() <= 1e-12
        step = 1e-3 * (end - begin)
        inner = times[:-1][times[:-1] - step > begin]
        lift = (truth(inner + step).velocity - truth(inner - step).velocity)[:, 1] / (2.0 * step) - scene.acceleration[1]
        assert lift.min() >= -1e-4 * G


def test_box_of_vertices_moves_like_the_box():
    """To rounding, for a rocking block."""
    box = load("rock-block")
    points = [[x, y, z] for x in (-0.2, 0.2) for y in (-0.5, 0.5) for z in (-0.2, 0.2)]
    body = {"shape": "vertices", "points": points, "mass": 1.0}
    times = np.linspace(0.0, 2.0, 100)
    truths = truth_for(box), truth_for(load(box.model_dump(exclude={"expect", "origin"}, exclude_none=True) | {"body": body}))
    np.testing.assert_allclose(*(truth(times).states for truth in truths), rtol=0, atol=2e-13)


def test_wheel_that_cannot_pass_an_edge_comes_to_rest_on_a_face():
    """On a gentle slope."""
    scene = prism(regular(6), 3.0, 0.05, duration=60.0)
    end = truth_for(scene)([59.0])
    assert not end.velocity.any()
    assert end.position[0, 1] == pytest.approx(0.2 * math.cos(math.pi / 6), abs=1e-15)
    assert end.position[0, 0] > 0.7


def test_wheel_on_a_steep_slope_never_rests():
    """Beyond π/n; it speeds up until the floor would have to pull."""
    truth = truth_for(prism(regular(8), 1.0, 0.5, duration=60.0))
    speeds = [-event.before[12] for event in truth.events]
    assert len(speeds) == 3
    assert speeds == sorted(speeds)
    assert truth.horizon == truth.events[-1].time < 60.0


def test_wheel_that_starts_too_fast_would_lift_off():
    """At the top of an edge the floor pushes if ω² R < g; to rounding the limit."""
    limit = math.sqrt(G / 0.2)
    assert truth_for(prism(regular(20), 1.001 * limit)) is None
    assert truth_for(prism(regular(20), 0.9 * limit)).name == "rimless-wheel"


def test_triangle_that_loses_all_its_speed_stops():
    """(k + cos 120°)/(1 + k) <= 0 for k <= 1/2: it lies after the first landing."""
    points = [[*corner, z] for corner in regular(3) for z in (-0.1, 0.1)]
    body = {"shape": "vertices", "points": points, "mass": 1.0, "inertia": [0.012, 0.012, 0.012]}
    truth = truth_for(prism(regular(3), 0.5, body=body))
    assert len(truth.events) == 1
    assert not truth([2.0]).velocity.any()


def test_solution_ends_where_the_body_stops_on_a_face_that_does_not_carry_it():
    """A plank that rises on its lower edge and drops back on a slope of 70°, with k = 1/2; its face is stable up to 68°."""
    plank = [[0.5, -0.2], [0.5, 0.2], [-0.5, 0.2], [-0.5, -0.2]]
    points = [[*corner, z] for corner in plank for z in (-0.1, 0.1)]
    body = {"shape": "vertices", "points": points, "mass": 1.0, "inertia": [0.03, 0.125, 0.5 * 0.29]}
    truth = truth_for(prism(plank, -1.0, math.radians(70.0), lean=0.05, body=body))
    assert len(truth.events) == 1
    assert not truth.events[0].after[SPIN].any()
    assert truth.horizon == truth.events[0].time


def test_almost_parallel_faces_have_no_solution():
    """A corner that rises 1e-11 m above a face: rounding determines whether there are two landings or one."""
    corners = regular(8)
    middle = (0.5 * (np.array(corners[2]) + np.array(corners[3]))).tolist()
    assert truth_for(prism([*corners[:3], [1.1 * c for c in middle], *corners[3:]], 2.0)).name == "rimless-wheel"
    truth = truth_for(prism([*corners[:3], [c * (1.0 + 5e-11) for c in middle], *corners[3:]], 2.0))
    assert truth is None or truth.name not in ("rimless-wheel", "rocking", "tipping")


@pytest.mark.parametrize("restitution", [0.0, 0.5])
def test_solution_with_restitution_ends_at_the_landing(restitution):
    truth = truth_for(prism(regular(8), 3.0, floor={"restitution": restitution, "friction": "infinite"}))
    assert (truth.name == "tipping", truth.horizon < 0.2) == (restitution > 0.0, restitution > 0.0)


def test_prism_slips_until_it_lands():
    """On a frictionless floor: energy is constant, the centre of mass falls vertically, and the face is flat at the horizon."""
    scene = prism(regular(6), lean=0.1, floor={"restitution": 0.0, "friction": "none"})
    truth = truth_for(scene)
    assert truth.name == "slipping"
    motion = truth(np.linspace(0.0, truth.horizon, 50))
    assert np.ptp(energy(scene, motion)) < 1e-13 * 12.0 * G * 0.2
    assert np.ptp(motion.position[:, [0, 2]], axis=0).max() < 1e-15
    assert motion.position[-1, 1] == pytest.approx(0.2 * math.cos(math.pi / 6), abs=1e-14)


def test_slipping_prism_has_no_solution_on_a_slope_or_if_it_lands_backwards():
    """The centre of mass of the second one overhangs the face behind the edge on which it stands."""
    smooth = {"floor": {"restitution": 0.0, "friction": "none"}}
    overhanging = [[0.0, 0.0], [0.4, 0.3], [0.3, 0.3], [-0.1, 0.0]]
    assert truth_for(prism(regular(6), lean=0.1, **smooth)).name == "slipping"
    assert truth_for(prism(regular(6), lean=0.1, slope=0.1, **smooth)) is None
    assert truth_for(prism(overhanging, lean=0.05, **smooth)).name == "slipping"
    assert truth_for(prism(overhanging, -1.5, lean=0.05, **smooth)) is None


def octagon(depths=None, **body):
    """A body on the octagon's corners; `depths` gives the two places along some edges, by the edge's number."""
    points = [[*corner, z] for k, corner in enumerate(regular(8)) for z in (depths or {}).get(k, (-0.1, 0.1))]
    return {"body": {"shape": "vertices", "points": points, "mass": 8.0, **body}}


@pytest.mark.parametrize(
    "change",
    [
        {"floor": {"restitution": 0.0, "friction": 0.5}},
        {"damping": {"linear": 0.1}},
        {"gravity": {"acceleration": [0.0, -9.8, 0.1]}},  # along the edge
        octagon(dict.fromkeys(range(8), (0.0, 1e-12))),  # flat, on a corner
        octagon({2: (0.05, 0.1), 6: (-0.1, -0.05)}, inertia=[0.1, 0.1, 0.1]),  # would tilt when an edge on one side carries it
        octagon({2: (-0.1, 0.2), 6: (-0.2, 0.1)}),  # a product of inertia
        octagon(inertia=[0.1, 0.1, 0.1]) | {"start": {"position": [0.0, 0.2, 0.0], "angular_velocity": [0.0, 0.0, -2.0]}},  # its edge slips
        octagon(inertia=[0.1, 0.1, 0.1])
        | {"start": {"position": [0.0, 0.2, 0.0], "velocity": [0.4, 0.0, 0.0], "angular_velocity": [0.3, 0.0, -2.0]}},  # it tilts
    ],
)
def test_other_problems_are_no_wheel(change):
    assert truth_for(prism(regular(8), 2.0, **octagon(inertia=[0.1, 0.1, 0.1]))).name == "rimless-wheel"
    truth = truth_for(prism(regular(8), 2.0, **change))
    assert truth is None or truth.name not in ("rimless-wheel", "rocking", "tipping")
