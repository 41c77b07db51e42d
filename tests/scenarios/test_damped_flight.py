"""Damped flight compared with 40 digits: a closed formula by mpmath for the path, Taylor series of Euler's equations for the rotation."""

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mpmath import mp, mpf
from support.taylor import free_rotor as taylor_rotor

from dropspin.scenarios import load, truth_for
from dropspin.scenarios.rotations import angle_between_orientations, unrotate

TIMES = [0.0, 1e-3, 0.5, 2.0, 10.0]


def thrown(linear=0.0, angular=0.0, spin=(0.0, 0.0, 0.0), moments=(1.0, 2.0, 3.0 - 1e-9)):
    return load(
        {
            "name": "thrown",
            "duration": 10.0,
            "body": {"shape": "box", "half_extents": [0.1, 0.2, 0.3], "mass": 2.0, "inertia": list(moments)},
            "start": {"position": [1.0, 2.0, 3.0], "velocity": [4.0, 5.0, -6.0], "angular_velocity": list(spin)},
            "gravity": {"acceleration": [0.0, -9.8, 0.5]},
            "damping": {"linear": linear, "angular": angular},
        }
    )


@pytest.mark.parametrize("rate", [1e-12, 1e-3, 0.3, 1.0, 1.2, 40.0])
def test_path_matches_forty_digits(rate):
    """With x = x₀ + (v₀ - g/k)(1 - e⁻ᵏᵗ)/k + g t/k, which in doubles loses all digits at small k; to 1e-14 of the distance."""
    found = truth_for(thrown(linear=rate))(TIMES)
    scene = thrown(linear=rate)
    with mp.workdps(60):
        k = mpf(rate)
        for n, t in enumerate(map(mpf, TIMES)):
            for axis in range(3):
                x0, v0, g = (mpf(float(part[axis])) for part in (scene.start.position, scene.start.velocity, scene.acceleration))
                x = x0 + (v0 - g / k) * (1 - mpmath.exp(-k * t)) / k + g * t / k
                v = (v0 - g / k) * mpmath.exp(-k * t) + g / k
                assert abs(found.position[n, axis] - x) <= 1e-14 * (1 + abs(v0) * t + abs(g) * t * t)
                assert abs(found.velocity[n, axis] - v) <= 1e-14 * (abs(v0) + abs(g) * t)


@pytest.mark.sample(2)
@pytest.mark.parametrize("rate", [0.05, 0.7])
@pytest.mark.parametrize("spin", [(0.3, 5.0, -0.2), (4.0, 0.1, 2.0)])
def test_rotation_matches_taylor_series(rate, spin):
    """Attitude to 1e-12 rad and spin to 1e-13 of its start (measured 6e-14 and 2e-15), damping in the differential equation itself."""
    scene = thrown(angular=rate, spin=spin)
    found = truth_for(scene)(TIMES)
    exact = taylor_rotor(np.diag(scene.body.inertia_tensor), spin, (0.0, 0.0, 0.0, 1.0), TIMES, damping=rate)
    for n, (quaternion, body_spin) in enumerate(exact):
        attitude = np.array([float(c) for c in quaternion])
        assert angle_between_orientations(found.orientation[n], attitude) <= 1e-12
        difference = unrotate(found.orientation[n], found.angular_velocity[n]) - np.array([float(c) for c in body_spin])
        assert np.abs(difference).max() <= 1e-13 * np.linalg.norm(spin)


@given(st.floats(0.0, 5.0), st.floats(0.0, 5.0))
def test_motion_can_be_restarted_at_any_time(rate, pause):
    scene = thrown(linear=rate, angular=rate, spin=(0.3, 4.0, -0.2))
    truth = truth_for(scene)
    resumed = truth_for(scene.starting_at(truth([pause]).states[0]))
    np.testing.assert_allclose(resumed([1.0]).position, truth([pause + 1.0]).position, rtol=0, atol=1e-11)
    assert angle_between_orientations(resumed([1.0]).orientation[0], truth([pause + 1.0]).orientation[0]) <= 1e-11


def test_damping_rates_of_0_give_the_free_flight_bit_for_bit():
    damped, content = thrown(spin=(1.0, 2.0, 3.0)), thrown(spin=(1.0, 2.0, 3.0)).model_dump(exclude_none=True)
    del content["damping"]
    np.testing.assert_array_equal(truth_for(damped)(TIMES).states, truth_for(load(content))(TIMES).states)
