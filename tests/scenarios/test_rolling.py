"""A ball that slides and rolls, against Taylor integrations with 25 digits, conservation laws and Coriolis's results."""

import mpmath
import numpy as np
import pytest

from dropspin.scenarios import load, truth_for
from dropspin.scenarios.mechanics import energy
from dropspin.scenarios.truths.rolling import rolling

RADIUS = 0.1


def thrown(velocity=(3.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0), gravity=(0.0, -9.8, 0.0), friction=0.2, inertia="solid", height=RADIUS, **more):
    return load(
        {
            "name": "thrown",
            "duration": 2.0,
            "body": {"shape": "sphere", "radius": RADIUS, "mass": 2.0, "inertia": inertia},
            "start": {"position": [1.0, height, -2.0], "velocity": list(velocity), "angular_velocity": list(spin)},
            "gravity": {"acceleration": list(gravity)},
            "floor": {"restitution": 0.5, "friction": friction},
        }
        | more
    )


HOLLOW = (2.0 * 2.0 * RADIUS**2 / 3.0,) * 3


def integrated(scene, t):
    """The state while the ball slides, from Newton's and Euler's equations and q' = ω q / 2."""
    mass, inertia, friction = scene.body.mass, scene.body.inertia_tensor[0, 0], scene.floor.friction
    gx, gy, gz = map(mpmath.mpf, scene.acceleration)

    def rates(_, state):
        _, _, _, qx, qy, qz, qw, vx, vy, vz, wx, wy, wz = state
        sx, sz = vx + RADIUS * wz, vz - RADIUS * wx  # v + ω × (-r Y)
        slip = mpmath.sqrt(sx**2 + sz**2)
        fx, fz = friction * mass * gy * sx / slip, friction * mass * gy * sz / slip
        turning = [
            (wx * qw + wy * qz - wz * qy) / 2,
            (wy * qw + wz * qx - wx * qz) / 2,
            (wz * qw + wx * qy - wy * qx) / 2,
            -(wx * qx + wy * qy + wz * qz) / 2,
        ]
        return [vx, vy, vz, *turning, gx + fx / mass, 0, gz + fz / mass, -RADIUS * fz / inertia, 0, RADIUS * fx / inertia]

    with mpmath.workdps(25):
        found = mpmath.odefun(rates, 0, [mpmath.mpf(value) for value in scene.initial_state])(t)
    return np.array(found, dtype=float)


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "scene",
    [
        thrown(velocity=(2.4, 0.0, 1.8)),
        thrown(velocity=(1.0, 0.0, 0.0), spin=(0.0, 0.0, 60.0), inertia=HOLLOW),
        thrown(velocity=(2.0, 0.0, 0.0), spin=(30.0, 10.0, 0.0)),  # its axis turns
        thrown(velocity=(1.0, 0.0, -2.0), spin=(3.0, 4.0, 5.0), gravity=(2.0, -9.6, 1.0)),
        thrown(velocity=(-2.0, 0.0, 1.0), gravity=(9.0, -3.0, 1.0), inertia=HOLLOW),  # it never rolls
    ],
)
def test_slide_is_that_of_a_taylor_integration(scene):
    """After .2 s, while it slides, to 1e-13 of each size; the quaternion to 1e-13."""
    truth = truth_for(scene)
    assert truth.name == "rolling"
    expected = integrated(scene, 0.2)
    np.testing.assert_allclose(truth([0.2]).states[0], expected, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize(("inertia", "share"), [("solid", 5.0 / 7.0), (HOLLOW, 3.0 / 5.0)])
def test_thrown_ball_rolls_at_the_known_share_of_its_speed(inertia, share):
    """5/7 of a solid ball's speed and 3/5 of a hollow one's, from t = (1 - share) v/(f g) on; Coriolis (1835)."""
    velocity = np.array([2.4, 0.0, 1.8])
    rolls = (1.0 - share) * 3.0 / (0.2 * 9.8)
    motion = truth_for(thrown(velocity=velocity, inertia=inertia))([0.999 * rolls, rolls, 2.0])
    assert np.linalg.norm(motion.velocity[0]) > share * 3.0 * 1.0001
    np.testing.assert_allclose(motion.velocity[1:], [share * velocity] * 2, rtol=0, atol=2e-15)
    np.testing.assert_allclose(np.cross([0.0, RADIUS, 0.0], motion.velocity[1:]), -(RADIUS**2) * -motion.angular_velocity[1:], atol=1e-15)


def test_ball_with_backspin_comes_back():
    """The angular momentum about the floor is conserved: v = (v₀ - 2/5 r ω₀) 5/7."""
    motion = truth_for(thrown(velocity=(1.0, 0.0, 0.0), spin=(0.0, 0.0, 60.0)))([2.0])
    np.testing.assert_allclose(motion.velocity[0], [(1.0 - 0.4 * RADIUS * 60.0) * 5.0 / 7.0, 0.0, 0.0], rtol=0, atol=1e-15)


def test_path_of_a_ball_with_side_spin_is_a_parabola_and_then_a_line():
    """The deceleration has a constant direction while it slides; Coriolis (1835)."""
    scene = thrown(velocity=(2.0, 0.0, 0.0), spin=(30.0, 10.0, 0.0))
    motion = truth_for(scene)(np.linspace(0.0, 0.4, 5))
    slip = np.array([2.0, 0.0, -3.0])
    expected = -0.2 * 9.8 * slip / np.linalg.norm(slip)
    np.testing.assert_allclose(np.diff(motion.velocity, axis=0) / 0.1, [expected] * 4, rtol=0, atol=1e-13)
    end = truth_for(scene)([1.5, 2.0])
    np.testing.assert_allclose(end.velocity[0], end.velocity[1], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(end.angular_velocity[:, 1], 10.0)


@pytest.mark.parametrize("friction", [2.0 / 7.0 * 0.5, 0.3, "infinite"])
def test_ball_rolls_down_a_slope_with_five_sevenths(friction):
    """From rest, if f is at least 2/7 of the slope, which is 1/2 here; energy is conserved."""
    scene = thrown(velocity=(0.0, 0.0, 0.0), gravity=(3.0, -10.0, 4.0), friction=friction)
    motion = truth_for(scene)(np.array([0.0, 0.5, 2.0]))
    t = motion.t[:, None]
    np.testing.assert_allclose(motion.velocity, 5.0 / 7.0 * t * [3.0, 0.0, 4.0], rtol=0, atol=2e-15)
    np.testing.assert_allclose(motion.position - [1.0, RADIUS, -2.0], 5.0 / 14.0 * t**2 * [3.0, 0.0, 4.0], rtol=0, atol=2e-15)
    assert np.ptp(energy(scene, motion)) < 1e-13


def test_ball_slips_on_a_slope_steeper_than_its_friction():
    """Its acceleration is g_t - f g_n, and that of its spin f M g_n r/I."""
    motion = truth_for(thrown(velocity=(0.0, 0.0, 0.0), gravity=(3.0, -10.0, 4.0), friction=0.1))([2.0])
    np.testing.assert_allclose(motion.velocity[0], 2.0 * (5.0 - 1.0) * np.array([0.6, 0.0, 0.8]), rtol=1e-15)
    np.testing.assert_allclose(motion.angular_velocity[0], 2.0 * 2.5 * 1.0 / RADIUS * np.array([0.8, 0.0, -0.6]), rtol=1e-14)


def test_orientation_is_continuous_where_rolling_begins():
    """By q' = ω q / 2 across the change, with steps of 1e-6 s."""
    scene = thrown(velocity=(2.0, 0.0, 0.0), spin=(30.0, 10.0, 0.0))
    slip = np.hypot(2.0, 3.0)
    rolls = 2.0 / 7.0 * slip / (0.2 * 9.8)
    motion = truth_for(scene)(rolls + 1e-6 * np.arange(-3, 4))
    dot = np.abs(np.sum(motion.orientation[1:] * motion.orientation[:-1], axis=1))
    turned = 2.0 * np.linalg.norm(motion.orientation[1:] - motion.orientation[:-1], axis=1)
    assert dot.min() > 1.0 - 1e-9
    np.testing.assert_allclose(turned, 1e-6 * np.linalg.norm(motion.angular_velocity[:-1], axis=1), rtol=1e-5)


@pytest.mark.parametrize(
    "scene",
    [
        thrown(friction="infinite"),  # an impulse would stop its slip at once
        thrown(inertia=(0.01, 0.012, 0.01)),
        thrown(
            inertia=((0.01, 0.002, 0.001), (0.002, 0.01, 0.0), (0.001, 0.0, 0.01))
        ),  # equal about the body's axes, not in all directions
        thrown(height=0.2),
        thrown(velocity=(1.0, 0.5, 0.0)),
        thrown(damping={"linear": 0.1}),
        thrown(gravity=(1.0, 9.8, 0.0)),
    ],
)
def test_rolling_is_limited_to_its_range_of_validity(scene):
    truth = truth_for(scene)
    assert truth is None or truth.name != "rolling"


def test_ellipsoid_does_not_roll_stably_about_an_axis_of_the_middle_moment():
    """As a free body turns over about that axis; `point_contact` knows such a motion for a while."""
    half = float(np.sqrt(0.5))
    body = {"shape": "ellipsoid", "half_extents": [0.1, 0.2, 0.1], "mass": 2.0}
    start = {"position": [0.0, 0.1, 0.0], "orientation": [half, 0.0, 0.0, half], "velocity": [5.0, 0.0, 0.0]}
    start["angular_velocity"] = [0.0, 0.0, -50.0]
    solid, uneven = (thrown(body=body | inertia, start=start) for inertia in ({}, {"inertia": [0.006, 0.008, 0.012]}))
    assert rolling(solid, solid.floor).horizon == 2.0
    assert rolling(uneven, uneven.floor) is None
