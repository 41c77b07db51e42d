"""Lagrange's top against its equations in Euler's angles with 25 digits, its integrals of motion, and the rate of a steady precession."""

import math

import mpmath
import numpy as np
import pytest

from dropspin.scenarios import load, truth_for
from dropspin.scenarios.mechanics import angular_momentum, energy
from dropspin.scenarios.rotations import about, multiply, rotate

H, MASS, G = 0.1, 2.0, 9.8
TO_CENTRE = np.array([H, H, H])
LENGTH = H * math.sqrt(3.0)
ALONG = 2.0 / 3.0 * MASS * H**2
ACROSS = ALONG + MASS * LENGTH**2
UP = np.array([0.0, 1.0, 0.0])
TIMES = np.array([0.1, 0.2, 0.4])


def cube(lean=0.35, spin=120.0, precession=0.0, nutation=0.0, **floor):
    """A cube on a corner: the angle of its diagonal [rad], and the rates of Euler's angles; `spin` is along the diagonal [rad/s]."""
    n = np.array([math.sin(lean), math.cos(lean), 0.0])
    across = np.cross(TO_CENTRE / LENGTH, n)
    angle = math.atan2(np.linalg.norm(across), TO_CENTRE @ n / LENGTH)
    q = about(across / np.linalg.norm(across), np.array(angle))
    nodes = np.cross(UP, n) / math.sin(lean)
    omega = precession * UP + nutation * nodes
    omega += (spin - omega @ n) * n
    r = rotate(q, TO_CENTRE)
    return load(
        {
            "name": "cube",
            "duration": 0.5,
            "body": {"shape": "box", "half_extents": [H, H, H], "mass": MASS},
            "start": {
                "position": [0.3, float(r[1]), -0.2],
                "orientation": q.tolist(),
                "velocity": np.cross(omega, r).tolist(),
                "angular_velocity": omega.tolist(),
            },
            "gravity": {"acceleration": [0.0, -G, 0.0]},
            "floor": {"restitution": 0.0, "friction": "infinite"} | floor,
        }
    )


def by_angles(lean, spin, precession, nutation, times):
    """θ, θ', φ, φ' and ψ, with the constants C ω·n and L·Y, from Lagrange's equation of θ."""
    u = mpmath.cos(mpmath.mpf(lean))
    q = ALONG * mpmath.mpf(spin)
    p = ACROSS * mpmath.mpf(precession) * (1 - u**2) + q * u

    def rates(_, y):
        theta, speed, _, _ = y
        sine, cosine = mpmath.sin(theta), mpmath.cos(theta)
        turning = (p - q * cosine) / (ACROSS * sine**2)
        torque = MASS * mpmath.mpf(G) * LENGTH * sine
        return [speed, turning**2 * sine * cosine + (torque - q * turning * sine) / ACROSS, turning, spin - turning * cosine]

    with mpmath.workdps(18):
        solution = mpmath.odefun(rates, 0, [mpmath.mpf(lean), mpmath.mpf(nutation), 0, 0])
        return [np.array(solution(time), dtype=float) for time in times]


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("lean", "spin", "precession", "nutation"),
    [(0.35, 120.0, 0.0, 0.0), (0.3, -150.0, -1.0, 2.0)],
)
def test_motion_is_that_of_the_equations_in_eulers_angles(lean, spin, precession, nutation):
    scene = cube(lean, spin, precession, nutation)
    truth = truth_for(scene)
    assert truth.name == "rough-contact"
    times = TIMES[truth.horizon >= TIMES]
    assert len(times) == 3
    found = truth(times)
    start, n = np.array(scene.start.orientation), np.array([math.sin(lean), math.cos(lean), 0.0])
    nodes, tip = np.cross(UP, n) / math.sin(lean), np.array(scene.start.position) - rotate(start, TO_CENTRE)
    for row, (theta, _, phi, psi) in enumerate(by_angles(lean, spin, precession, nutation, times)):
        turns = ((UP, phi), (nodes, theta - lean), (n, psi))
        turned = start
        for axis, angle in reversed(turns):
            turned = multiply(about(axis, np.array(angle)), turned)
        np.testing.assert_allclose(abs(found.orientation[row] @ turned), 1.0, rtol=0, atol=1e-12)
        np.testing.assert_allclose(found.position[row], tip + rotate(turned, TO_CENTRE), rtol=0, atol=2e-11)


def test_integrals_of_the_motion_are_constant():
    """Energy, the angular momentum about the tip along the vertical, and the angular velocity along the body's axis; the tip is at rest."""
    scene = cube(precession=3.0, nutation=1.0)
    motion = truth_for(scene)(np.linspace(0.0, 0.5, 200))
    arm = rotate(motion.orientation, TO_CENTRE)
    about_tip = angular_momentum(scene, motion) + MASS * np.cross(arm, motion.velocity)
    along = np.sum(motion.angular_velocity * arm, axis=1) / LENGTH
    tip = motion.velocity - np.cross(motion.angular_velocity, arm)
    for values in (energy(scene, motion), about_tip[:, 1], along):
        assert np.ptp(values) < 2e-12 * abs(values[0])
    assert np.abs(tip).max() < 1e-14
    assert np.ptp(motion.position - arm, axis=0).max() < 1e-15


@pytest.mark.sample(1)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_steady_precession_has_the_rate_of_its_equation(sign):
    """A Ω² cos θ - C ω·n Ω + M g l = 0: the slow and the fast rate."""
    lean, spin = 0.35, 120.0
    a, b = ACROSS * math.cos(lean), ALONG * spin
    rate = (b + sign * math.sqrt(b * b - 4.0 * a * MASS * G * LENGTH)) / (2.0 * a)
    truth = truth_for(cube(lean, spin, rate))
    times = np.linspace(0.0, truth.horizon, 20)
    n = rotate(truth(times).orientation, TO_CENTRE) / LENGTH
    np.testing.assert_allclose(n[:, 1], math.cos(lean), rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.unwrap(np.arctan2(-n[:, 2], n[:, 0])), rate * times, rtol=0, atol=1e-10)


def test_motion_ends_where_the_floor_would_pull_or_another_corner_touches_it():
    falling = truth_for(cube(lean=0.5, spin=5.0))
    assert 0.05 < falling.horizon < 0.5
    low = falling(falling.horizon)
    corners = H * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    assert (low.position[0, 1] + rotate(low.orientation[0], corners)[:, 1]).min() > -1e-12
    assert truth_for(cube(lean=0.35, spin=120.0, precession=25.0, nutation=20.0)) is None  # it lifts off at once


@pytest.mark.parametrize("duration", [0.5, 1.0, 2.0])
def test_slow_top_is_known_until_another_corner_strikes(duration):
    """It falls like a pendulum; the sampled times do not depend on the spin or on the duration."""
    scene = cube(spin=0.01).model_copy(update={"duration": duration})
    horizons = truth_for(scene).horizon
    assert 0.1 < horizons < 0.5
    corners = H * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    motion = truth_for(scene)(np.linspace(0.0, horizons, 50))
    for corner in corners:
        assert (motion.position + rotate(motion.orientation, corner))[:, 1].min() > -1e-12


@pytest.mark.parametrize(
    "change",
    [
        {"damping": {"linear": 0.1}},
        {"gravity": {"acceleration": [0.1, G, 0.0]}},
    ],
)
def test_other_problems_are_no_top(change):
    given = cube().model_dump(mode="json", exclude_none=True, exclude={"tags", "summary", "source", "expect", "name"})
    truth = truth_for(load(given | change | {"name": "other"}))
    assert truth is None or truth.name != "rough-contact"


@pytest.mark.extended
def test_a_coefficient_of_friction_that_suffices_holds_the_tip():
    """A coefficient of 0.5 suffices at all times, 0.01 not even at the start."""
    times = np.linspace(0.0, 0.5, 9)
    np.testing.assert_array_equal(truth_for(cube(friction=0.5))(times).states, truth_for(cube())(times).states)
    assert truth_for(cube(friction=0.01)) is None


def test_moving_tip_is_no_top():
    scene = cube()
    truth = truth_for(scene.starting_at(scene.initial_state + 1e-6 * np.eye(13)[7]))
    assert truth is None or truth.name != "rough-contact"


@pytest.mark.extended
def test_cone_of_points_is_a_top_with_two_different_moments():
    """An apex below eight points on a circle, whose centre of mass is the origin; dL/dt = r × M g at each time."""
    corners = [[0.0, -0.16, 0.0], *([0.12 * math.cos(k * math.pi / 4), 0.02, 0.12 * math.sin(k * math.pi / 4)] for k in range(8))]
    lean = about(np.array([0.0, 0.0, 1.0]), np.array(0.4))
    r = rotate(lean, np.array([0.0, 0.16, 0.0]))
    omega = 200.0 * r / 0.16 + np.array([0.0, 3.0, 0.0])
    scene = load(
        {
            "name": "cone",
            "duration": 0.5,
            "body": {"shape": "vertices", "points": corners, "mass": MASS},
            "start": {
                "position": r.tolist(),
                "orientation": lean.tolist(),
                "velocity": np.cross(omega, r).tolist(),
                "angular_velocity": omega.tolist(),
            },
            "gravity": {"acceleration": [0.0, -G, 0.0]},
            "floor": {"restitution": 0.0, "friction": "infinite"},
        }
    )
    moments = np.diag(scene.body.inertia_tensor)
    assert moments[0] == pytest.approx(moments[2], rel=1e-14)
    assert abs(moments[0] - moments[1]) > 0.1 * moments[0]
    truth, step = truth_for(scene), 1e-4
    assert (truth.name, truth.horizon) == ("rough-contact", 0.5)
    times = np.linspace(0.01, 0.49, 7)

    def about_tip(t):
        motion = truth(t)
        return angular_momentum(scene, motion) + MASS * np.cross(motion.position, motion.velocity)

    near, far = (about_tip(times + k * step) - about_tip(times - k * step) for k in (1, 2))
    change = (8.0 * near - far) / (12.0 * step)
    np.testing.assert_allclose(change, np.cross(truth(times).position, [0.0, -MASS * G, 0.0]), rtol=0, atol=1e-8)
