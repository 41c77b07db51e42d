"""The velocity of a point under a constant pull and dry friction, against a Taylor integration with 30 digits and against closed forms."""

import math

import mpmath
import numpy as np
import pytest

from dropspin.scenarios.truths.dry_friction import dry_friction

START = np.array([1.5, 0.0, -2.0])


def integrated(start, pull, friction, t):
    """Velocity and its integral at a time before the velocity vanishes."""
    px, pz, a = mpmath.mpf(pull[0]), mpmath.mpf(pull[2]), mpmath.mpf(friction)

    def rates(_, y):
        ux, uz, _, _ = y
        speed = mpmath.sqrt(ux**2 + uz**2)
        return [px - a * ux / speed, pz - a * uz / speed, ux, uz]

    with mpmath.workdps(30):
        ux, uz, x, z = mpmath.odefun(rates, 0, [mpmath.mpf(start[0]), mpmath.mpf(start[2]), 0, 0])(t)
    return np.array([ux, 0, uz], dtype=float), np.array([x, 0, z], dtype=float)


@pytest.mark.sample(1)
@pytest.mark.parametrize("friction", [1.0, 2.0, 40.0])  # with a pull of 2 m/s², 1 and 2 make an exponent 0
@pytest.mark.parametrize("angle", [0.3, 2.8])
def test_motion_is_that_of_a_taylor_integration(friction, angle):
    """At a fifth of the time to the end, to 1e-14 of the speed."""
    heading = math.atan2(START[2], START[0]) + angle
    pull = 2.0 * np.array([math.cos(heading), 0.0, math.sin(heading)])
    motion, stops = dry_friction(START, pull, friction)
    t = 0.2 * min(stops, 3.0)
    expected = integrated(START, pull, friction, t)
    for found, true in zip(motion(np.array([t])), expected, strict=True):
        np.testing.assert_allclose(found[0], true, rtol=0, atol=1e-14 * np.linalg.norm(START) * max(t, 1.0))


def test_velocity_vanishes_after_the_known_time():
    """At t = (a |u₀| + p·u₀)/(a² - p²), from d(a|u| + p·u)/dt = p² - a²; from then on it stays where it is."""
    pull, friction = np.array([1.0, 0.0, 2.0]), 3.0
    motion, stops = dry_friction(START, pull, friction)
    speed = np.linalg.norm(START)
    np.testing.assert_allclose(stops, (friction * speed + pull @ START) / (friction**2 - pull @ pull), rtol=1e-15)
    velocity, way = motion(stops * np.array([1.0 - 1e-9, 1.0, 2.0]))
    assert np.linalg.norm(velocity[0]) < 1e-8 * speed
    assert not velocity[1:].any()
    np.testing.assert_allclose(way[0], way[1], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(way[1], way[2])


def test_power_of_the_forces_is_the_change_of_energy():
    """u²/2 changes by p·x minus a times the length of the path, which is the integral of |u|."""
    pull, friction = np.array([-3.0, 0.0, 1.0]), 2.0
    t = np.linspace(0.0, 2.0, 20001)
    velocity, way = dry_friction(START, pull, friction)[0](t)
    speeds = np.linalg.norm(velocity, axis=1)
    path = np.concatenate([[0.0], np.cumsum(0.5 * (speeds[1:] + speeds[:-1]) * np.diff(t))])
    np.testing.assert_allclose(0.5 * speeds**2, 0.5 * speeds[0] ** 2 + way @ pull - friction * path, rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    ("pull", "friction", "velocity", "way", "stops"),
    [
        ((0.0, 0.0, 0.0), 2.0, 0.5, 1.5, 1.25),  # from 2.5 m/s, level: after 1 s
        ((1.2, 0.0, -1.6), 2.0, 2.5, 2.5, math.inf),  # the pull is along the velocity, and as large as friction
        ((-0.6, 0.0, 0.8), 2.0, 0.0, 2.5**2 / 6.0, 2.5 / 3.0),  # uphill: it stops and stays
        ((-3.0, 0.0, 4.0), 2.0, -3.0 * (1.0 - 2.5 / 7.0), 2.5**2 / 14.0 - 1.5 * (1.0 - 2.5 / 7.0) ** 2, math.inf),  # it comes back
        ((0.6, 0.0, -0.8), 0.0, 3.5, 3.0, math.inf),  # no friction
    ],
)
def test_motion_along_a_line(pull, friction, velocity, way, stops):
    """After one second, along the velocity at the start."""
    motion, found = dry_friction(START, np.array(pull), friction)
    speeds, ways = motion(np.array([1.0]))
    assert found == pytest.approx(stops, rel=1e-15)
    along = START / 2.5
    np.testing.assert_allclose([speeds[0] @ along, ways[0] @ along], [velocity, way], rtol=0, atol=2e-15)


@pytest.mark.parametrize(("friction", "velocity"), [(3.0, 2.0), (5.0, 0.0), (9.0, 0.0), (math.inf, 0.0)])
def test_a_point_at_rest_starts_if_the_pull_exceeds_friction(friction, velocity):
    motion, stops = dry_friction(np.zeros(3), np.array([3.0, 0.0, 4.0]), friction)
    speeds, ways = motion(np.array([1.0]))
    assert np.linalg.norm(speeds[0]) == pytest.approx(velocity, rel=1e-15)
    assert np.linalg.norm(ways[0]) == pytest.approx(0.5 * velocity, rel=1e-15)
    assert stops == (math.inf if velocity else 0.0)


def test_without_friction_the_velocity_grows_with_time():
    pull, t = np.array([1.0, 0.0, 0.5]), np.array([0.0, 0.5, 3.0])
    speeds, ways = dry_friction(START, pull, 0.0)[0](t)
    np.testing.assert_allclose(speeds, START + np.outer(t, pull), rtol=1e-15)
    np.testing.assert_allclose(ways, np.outer(t, START) + 0.5 * np.outer(t**2, pull), rtol=1e-15)
