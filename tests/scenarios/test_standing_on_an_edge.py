"""Boxes that tip, rock and slip, compared with published values and with Taylor series of 40 digits."""

import math
from itertools import pairwise, permutations

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp, mpf
from support.scenes import standing
from support.taylor import Solution

from dropspin.scenarios import load, truth_for
from dropspin.scenarios.mechanics import energy
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.state import ORIENTATION, POSITION, SPIN

AXES = list(permutations(range(3)))


@pytest.mark.parametrize(
    ("name", "time", "angle", "speed"), [("tip-box", 0.99989682, 1.0, 2.87658296), ("slip-stick", 0.78614720, 1.2, 3.64150199)]
)
def test_falls_match_published_values(name, time, angle, speed):
    """From 0.1 rad, at rest: the time and speed at which a larger angle is reached, to the eight decimals given."""
    scene = load(name)
    end = truth_for(scene)([0.0, time])
    w = np.linalg.norm(end.angular_velocity[1])
    turned = 2.0 * math.acos(abs(float(end.orientation[0] @ end.orientation[1])))
    assert w == pytest.approx(speed, abs=2e-7)  # a time of eight decimals fixes it to 5e-9 times ψ'' = 10 to 17
    assert turned == pytest.approx(angle - 0.1, abs=2e-8)
    assert np.abs(end.velocity[1, [0, 2]]).max() == 0.0 or name == "tip-box"


def test_landing_ratio_matches_published_values():
    """Housner's ratio for corner masses, a = .2, b = .5: 1 - 2 a²/(2 R²) = .862069; for a solid box .793103."""
    for inertia, ratio in (("vertices", 0.862069), ("solid", 0.793103)):
        content = load("rock-block").model_dump(exclude={"expect", "origin"}, exclude_none=True)
        content["body"] |= {"inertia": inertia}
        impact = truth_for(load(content)).events[0]
        assert impact.after[12] / impact.before[12] == pytest.approx(ratio, abs=5e-7)


def pendulum(square, angle, speed):
    """The solution (ψ, ψ', sin ψ, cos ψ) of ψ'' = p² sin ψ, by Taylor series with 40 digits."""

    def rates(unknowns):
        _, rate, sine, cosine = unknowns
        return [1 * rate, square * sine, rate * cosine, -1 * (rate * sine)]

    return Solution(rates, [angle, speed, mpmath.sin(angle), mpmath.cos(angle)], step=0.5)


@pytest.mark.parametrize("speed", [0.0, 0.4, -0.35])
def test_tipping_matches_taylor_series(speed):
    """ψ'' = p² sin ψ by Taylor series; angle and speed to 1e-13 (measured 2e-14)."""
    scene = standing(lean=-0.2, speed=speed)
    times = [0.1, 0.3, 0.5, 0.62]
    found = truth_for(scene)(times)
    with mp.workdps(40):
        a, h = mpf(0.2), mpf(0.5)
        square = mpf("9.8") / (2 * mpmath.sqrt(a * a + h * h))
        solution = pendulum(square, mpf(0.2), mpf(speed))
        centre = found.position - np.array(scene.start.position)
        for row, (psi, rate, *_) in enumerate(map(solution, times)):
            R = mpmath.sqrt(a * a + h * h)
            assert found.position[row, 1] == pytest.approx(float(R * mpmath.cos(psi)), abs=1e-13)
            assert np.linalg.norm(found.angular_velocity[row]) == pytest.approx(abs(float(rate)), abs=1e-13)
            way = float(R * (mpmath.sin(psi) - mpmath.sin(mpf(0.2))))
            assert centre[row, [0, 2]] @ [math.cos(0.3), -math.sin(0.3)] == pytest.approx(way, abs=1e-13)


@pytest.mark.parametrize("speed", [0.0, 0.5, -0.3])
def test_slipping_matches_taylor_series(speed):
    """Lagrange's equation (k + sin²ψ) ψ'' + sin ψ cos ψ ψ'² = (g/R) sin ψ, k = 1, by Taylor series; to 1e-13 (measured 3e-14).

    With d = 1/(1 + sin²ψ) as an unknown of its own, d' = -2 d² sin ψ cos ψ ψ', the equation is polynomial.
    """
    scene = standing(half=(0.02, 0.5), lean=-0.2, speed=speed, friction="none", sideways=(0.3, -0.4))
    times = [0.1, 0.3, 0.45]
    found = truth_for(scene)(times)
    with mp.workdps(40):
        R = mpmath.sqrt(mpf(0.02) ** 2 + mpf(0.5) ** 2)

        def rates(unknowns):
            _, rate, sine, cosine, d = unknowns
            turning = cosine * rate
            acceleration = d * (mpf("9.8") / R * sine - sine * (turning * rate))
            return [1 * rate, acceleration, 1 * turning, -1 * (rate * sine), -2 * (d * d * (sine * turning))]

        sine = mpmath.sin(mpf(0.2))
        solution = Solution(rates, [mpf(0.2), mpf(speed), sine, mpmath.cos(mpf(0.2)), 1 / (1 + sine**2)], step=0.5)
        for row, (psi, rate, *_) in enumerate(map(solution, times)):
            assert found.position[row, 1] == pytest.approx(float(R * mpmath.cos(psi)), abs=1e-13)
            assert found.velocity[row, 1] == pytest.approx(float(-R * mpmath.sin(psi) * rate), abs=2e-13)
            assert np.linalg.norm(found.angular_velocity[row]) == pytest.approx(abs(float(rate)), abs=2e-13)
    sideways = found.position - np.array(scene.start.position)
    np.testing.assert_allclose(sideways[:, [0, 2]], np.outer(times, [0.3, -0.4]), atol=1e-15)


def test_landings_match_taylor_series():
    """Three rockings: Taylor series to the landing, angular momentum about the new edge by vectors; times to 1e-13 (measured 1e-15)."""
    scene = standing(lean=0.6 * math.atan(0.4))
    truth = truth_for(scene)
    with mp.workdps(40):
        a, h = mpf(0.2), mpf(0.5)
        R2, alpha = a * a + h * h, mpmath.atan(a / h)
        square = mpf("9.8") / (2 * mpmath.sqrt(R2))
        psi, rate, now = mpf(0.6 * math.atan(0.4)), mpf(0), mpf(0)
        for impact in truth.events[:3]:
            solution, wait = pendulum(square, psi, rate), mpf(impact.time) - now - mpf("1e-9")
            for _ in range(4):  # Newton's method from 1e-9 s before, at ascending times
                angle, speed, *_ = solution(wait)
                wait += (alpha - angle) / speed
            now += wait
            # About the new edge: I ω of the box, less M c x v of its centre, which moves as about the old one.
            momentum = R2 * speed + h * (speed * h) - a * (speed * a)
            assert impact.time == pytest.approx(float(now), abs=1e-13)
            assert np.linalg.norm(impact.before[SPIN]) == pytest.approx(float(speed), rel=1e-13)
            assert np.linalg.norm(impact.after[SPIN]) == pytest.approx(float(momentum / (2 * R2)), rel=1e-13)
            psi, rate = alpha, -momentum / (2 * R2)


@pytest.mark.parametrize("axes", AXES)
@pytest.mark.parametrize("lean", [0.25, -0.25])
@pytest.mark.parametrize("friction", ["infinite", "none"])
def test_box_lands_on_the_face_that_it_falls_towards(axes, lean, friction):
    """For any axis of the body as the edge, the centre ends at the half height above that face."""
    scene = standing(lean=lean, axes=axes, friction=friction)
    truth = truth_for(scene)
    assert truth.name == ("rocking" if friction == "infinite" else "slipping")
    landing = truth.events[0].before if friction == "infinite" else truth.states(np.array([truth.horizon]))[0]
    corners = landing[POSITION] + rotate(landing[ORIENTATION], scene.body.vertices)
    np.testing.assert_allclose(np.sort(corners[:, 1])[:4], 0.0, atol=2e-15 if friction == "infinite" else 1e-14)
    assert landing[1] == pytest.approx(0.5 if lean > 0 else 0.2, abs=1e-14)


@given(
    st.floats(0.05, 1.0),
    st.floats(0.05, 1.0),
    st.floats(-1.0, 1.0).filter(lambda share: abs(share) > 1e-3),
    st.floats(-3.0, 3.0),
    st.sampled_from(AXES),
)
def test_rocking_conserves_energy_on_a_fixed_edge_above_the_floor(a, h, share, heading, axes):
    """Between landings the edge is at rest, energy is constant to 1e-13 of M g R, and no corner is below the floor by 1e-13 of the size."""
    lean = share * 0.999 * (math.atan2(a, h) if share > 0 else math.atan2(h, a))
    scene = standing(half=(a, h), lean=lean, heading=heading, axes=axes)
    truth = truth_for(scene)
    size, scale = math.hypot(a, h), 2.0 * 9.8 * math.hypot(a, h)
    edges = [0.0, *(event.time for event in truth.events[:4])]
    for begin, end in pairwise(edges):
        motion = truth(np.linspace(begin, end, 20)[1:])
        assert np.ptp(energy(scene, motion)) <= 1e-13 * scale
        corners = motion.position[:, None] + rotate(motion.orientation[:, None], scene.body.vertices[None])
        assert corners[..., 1].min() >= -1e-13 * size
        lowest = corners[..., 1].argsort(axis=1)[:, :2]
        arms = np.take_along_axis(corners - motion.position[:, None], lowest[..., None], axis=1)
        speeds = motion.velocity[:, None] + np.cross(motion.angular_velocity[:, None], arms)
        flat = np.sort(corners[..., 1], axis=1)[:, 2] < 1e-6 * size
        assert np.abs(speeds[~flat]).max(initial=0.0) <= 1e-13


def test_rocking_ends_at_rest_in_place():
    """After Zeno's time, on the face on which it rocked."""
    scene = standing(half=(0.5, 0.5), lean=math.pi / 4 - math.radians(0.1), duration=20.0)
    truth = truth_for(scene)
    end = truth([20.0])
    ratios = [np.linalg.norm(event.after[SPIN]) / np.linalg.norm(event.before[SPIN]) for event in truth.events[:5]]
    np.testing.assert_allclose(ratios, 0.5, rtol=1e-12)  # a cube of corner masses keeps half
    assert not end.velocity.any()
    assert not end.angular_velocity.any()
    assert end.position[0, 1] == pytest.approx(0.5, abs=1e-15)
    flat = truth.events[0].before[POSITION]
    np.testing.assert_allclose(end.position[0], flat, atol=1e-15)


def test_wide_box_stops_at_its_first_landing():
    """Where Housner's ratio is not above 0 the old edge cannot rise."""
    scene = standing(lean=0.5, body={"shape": "box", "half_extents": [0.5, 0.2, 0.3], "mass": 2.0}, half=(0.5, 0.2))
    assert len(truth_for(scene).events) == 1
    assert not truth_for(scene)([3.0]).velocity.any()


def test_solution_with_restitution_ends_at_the_landing():
    """The rebound of a whole face has no known solution."""
    scene = standing(lean=0.2, floor={"restitution": 0.5, "friction": "infinite"})
    truth = truth_for(scene)
    assert (truth.name, truth.events) == ("tipping", ())
    assert truth.horizon == truth_for(standing(lean=0.2)).events[0].time


@pytest.mark.parametrize(
    "change",
    [
        {"floor": {"restitution": 0.0, "friction": 0.5}},
        {"damping": {"linear": 0.1}},
        {"gravity": {"acceleration": [0.1, -9.8, 0.0]}},
        {"lean": -1e-9},  # rounding decides to which side it falls
        {"speed": -6.0},  # passes the top
        {"body": {"shape": "box", "half_extents": [0.2, 0.5, 0.3], "mass": 2.0, "inertia": [1e-3, 1e-3, 1e-3]}, "lean": -0.05},  # lifts off
    ],
)
def test_stand_is_limited_to_its_range_of_validity(change):
    """Not with slip and friction, damping, a slope, balance, passing the top, or a negative normal force."""
    truth = truth_for(standing(**change))
    assert truth is None or truth.name not in ("tipping", "rocking", "slipping")
