"""The free rotor at and near its separatrix, its principal axes and symmetric inertia, compared with Taylor series of 40 digits."""

import numpy as np
import pytest
from mpmath import matrix, mp, mpf
from support import taylor

from dropspin.scenarios import load, truth_for
from dropspin.scenarios.rotations import angle_between_orientations, rotate
from dropspin.scenarios.truths.free_rotor import free_rotor
from dropspin.scenarios.truths.rotor_horizon import EPS, TOLERANCE

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
TURNED = np.array([0.5, 10.0, 40.0])  # rad, about


def tiny(rng):
    return rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-16, -6)


def principal(rng):
    """A spin within 1e-30 to 1e-6 of a principal axis, each by its own amount."""
    moments, spin = rng.uniform(1.0, 2.0, 3), 10.0 ** rng.uniform(-30, -6, 3)
    spin[rng.integers(3)] = 3.0
    return moments, spin


def separatrix(rng):
    """A spin within 1e-16 to 1e-6 of the separatrix, somewhere on it."""
    a, b, c = moments = np.sort(rng.uniform(1.0, 2.0, 3))
    spin = rng.normal(size=3) * [1.0, 10.0 ** rng.uniform(-3, 3), 0.0]
    spin[2] = spin[0] * np.sqrt(a * (b - a) / (c * (c - b))) * (1.0 + tiny(rng))
    order = rng.permutation(3)
    return moments[order], spin[order]


def symmetric(rng):
    """Two moments, or all three, within 1e-16 to 1e-6 of each other; the spin may be near the separatrix too."""
    _, spin = separatrix(rng)
    moments = rng.uniform(1.0, 2.0, 3) if rng.random() < 0.6 else np.full(3, rng.uniform(1.0, 2.0)) * (1.0 + tiny(rng))
    moments[1] = moments[0] * (1.0 + tiny(rng))
    return moments[rng.permutation(3)], spin


def exact_motion(moments, spin, orientation, times):
    found = taylor.free_rotor(moments, spin, orientation, times)
    return np.array([[float(c) for c in q] for q, _ in found]), np.array([[float(c) for c in w] for _, w in found])


@pytest.mark.sample(4)
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("draw", [principal, separatrix, symmetric])
def test_attitude_of_extreme_starts_is_right_to_1e_13_of_the_angle_turned(draw, seed):
    """Measured: 1e-14 at most, near the separatrix."""
    moments, spin = draw(np.random.default_rng(seed))
    times = TURNED / np.linalg.norm(spin)
    orientations, rates = free_rotor(np.diag(moments), IDENTITY, spin)(times)
    exact, spins = exact_motion(moments, spin, IDENTITY, times)
    assert np.all(angle_between_orientations(orientations, exact) <= 1e-13 * np.maximum(TURNED, 1.0))
    np.testing.assert_allclose(rates, rotate(exact, spins), rtol=0, atol=1e-12 * np.linalg.norm(spin))


def test_spin_a_rounding_error_off_the_unstable_axis_turns_over():
    """(1e-17, 1, 0) rad/s with moments 1, 2, 3 for 101 rad: attitude to 1e-13 of the angle; it turned over on the way."""
    times = np.array([40.0, 70.0, 101.0])
    orientations, _ = free_rotor(np.diag([1.0, 2.0, 3.0]), IDENTITY, np.array([1e-17, 1.0, 0.0]))(times)
    exact, spins = exact_motion((1.0, 2.0, 3.0), (1e-17, 1.0, 0.0), IDENTITY, times)
    assert spins[:, 1].min() < -0.99
    assert np.all(angle_between_orientations(orientations, exact) <= 1e-13 * times)


@pytest.mark.parametrize("signs", [(1, 1, 1), (-1, 1, 1), (1, -1, -1), (-1, 1, -1)])
def test_start_exactly_on_the_separatrix_approaches_the_unstable_axis(signs):
    """Moments 4, 5, 9 with ω_a = ±3 ω_c: I_c (I_c - I_b) ω_c² = I_a (I_b - I_a) ω_a². It ends parallel to the axis b, without warning."""
    moments, spin = (4.0, 5.0, 9.0), np.array([1.5, 0.25, 0.5]) * signs
    times = TURNED / np.linalg.norm(spin)
    motion = free_rotor(np.diag(moments), IDENTITY, spin)
    exact, _ = exact_motion(moments, spin, IDENTITY, times)
    assert np.all(angle_between_orientations(motion(times)[0], exact) <= 1e-13 * np.maximum(TURNED, 1.0))
    orientation, rates = motion(np.array([1e4]))
    assert abs(rotate(orientation[0], np.array([0.0, 1.0, 0.0])) @ rates[0]) == pytest.approx(np.linalg.norm(rates[0]), rel=1e-12)


@pytest.mark.parametrize("scale", [1e-150, 1e120])
def test_motion_does_not_depend_on_the_units(scale):
    """Moments and spin of any magnitude, of powers of two: the same digits at the same angles."""
    unit = 2.0 ** np.round(np.log2(scale))
    spin, times = np.array([1e-9, 2.0, 0.1]), np.array([0.0, 3.0, 50.0])
    plain = free_rotor(np.diag([1.0, 2.0, 3.0]), IDENTITY, spin)(times)
    scaled = free_rotor(np.diag([1.0, 2.0, 3.0]) * unit, IDENTITY, spin * unit)(times / unit)
    np.testing.assert_array_equal(scaled[0], plain[0])
    np.testing.assert_array_equal(scaled[1] / unit, plain[1])


def body_spin(orientation, spin):
    """A spin in the world as one in the body, of the exact values of the numbers, in 60 digits."""
    with mp.workdps(60):
        x, y, z, w = (mpf(c) / mp.sqrt(sum(mpf(d) ** 2 for d in orientation)) for c in orientation)
        turned = matrix(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
            ]
        )
        return tuple(turned.T * matrix([mpf(c) for c in spin]))


TILTED = np.array([0.2, -0.3, 0.1, 0.9]) / np.linalg.norm([0.2, -0.3, 0.1, 0.9])


@pytest.mark.sample(2)
@pytest.mark.parametrize("offset", [0.0, 1e-16, 1e-9])
def test_tilted_start_is_taken_at_its_exact_numbers(offset):
    """Near the unstable axis, in a tilted attitude: right to 1e-13 of the angle for the numbers given, beyond the horizon too."""
    spin, times = rotate(TILTED, np.array([offset, 3.0, 0.0])), np.array([5.0, 15.0, 30.0])
    orientations, _ = free_rotor(np.diag([1.0, 2.0, 3.0]), TILTED, spin)(times)
    exact, _ = exact_motion((1.0, 2.0, 3.0), body_spin(TILTED, spin), TILTED, times)
    assert np.all(angle_between_orientations(orientations, exact) <= 1e-13 * 3.0 * times)


@pytest.mark.sample(1)
@pytest.mark.parametrize("moments", [(1.0, 2.0, 3.0), (1.0, 1.2, 2.0)])
def test_horizon_is_where_one_ulp_has_grown_to_its_tolerance(moments):
    """A start whose quaternion is one eps off differs at the horizon by 0.01 to 1 of the tolerance, and by more than it a little later."""
    spin = rotate(TILTED, np.array([0.0, 3.0, 0.0]))
    horizon = free_rotor(np.diag(moments), TILTED, spin).horizon
    times = np.array([horizon, horizon + 4.0])
    exact, _ = exact_motion(moments, body_spin(TILTED, spin), TILTED, times)
    moved = TILTED + np.array([EPS, 0.0, -EPS, 0.0])
    other, _ = exact_motion(moments, body_spin(moved, spin), moved, times)
    grown = angle_between_orientations(exact, other) / (TOLERANCE * 3.0 * times)
    assert 0.01 < grown[0] < 1.0 < grown[1]


@pytest.mark.parametrize(
    ("orientation", "spin", "is_limited"),
    [
        (IDENTITY, (0.0, 5.0, 0.0), False),  # the zeros have no eps
        (IDENTITY, (1e-16, 5.0, 0.0), False),
        ((0.0, 0.6, 0.0, 0.8), (0.0, 5.0, 0.0), False),  # turned about the spin
        (TILTED, (0.0, 5.0, 0.0), True),
        (TILTED, (1e-9, 5.0, 0.0), True),
        (TILTED, (1e-3, 5.0, 0.0), False),
        (TILTED, (5.0, 0.0, 0.0), False),
        (TILTED, (0.0, 0.0, 5.0), False),
        (TILTED, (1.0, 2.0, 3.0), False),
    ],
)
def test_only_starts_that_rounding_decides_have_a_horizon(orientation, spin, is_limited):
    q = np.array(orientation)
    rotor = free_rotor(np.diag([1.0, 2.0, 3.0]), q, rotate(q, np.array(spin)))
    assert np.isfinite(rotor.horizon) == is_limited


@pytest.mark.extended
@pytest.mark.parametrize(("apart", "spin"), [(5e-7, (0.3, 0.2, 0.8)), (5e-7, (2.0, 0.3, 0.1)), (1e-5, (0.0, 1.0, 0.9))])
@pytest.mark.parametrize("is_needle", [True, False])
def test_nearly_equal_moments_have_no_horizon_away_from_the_separatrix(is_needle, apart, spin):
    """One eps of each moment changes the orientation by less than the tolerance, also after 80 rad: it grows in proportion to time."""
    moments = np.array([1e-6 + apart, 1.0 - apart, 1.0]) if is_needle else np.array([1.0, 1.0 + apart, 2.0])
    rotor = free_rotor(np.diag(moments), IDENTITY, np.array(spin))
    assert rotor.horizon == np.inf
    times = TURNED / np.linalg.norm(spin) * 2.0
    exact, _ = exact_motion(moments, spin, IDENTITY, times)
    others = [
        exact_motion(moments * (1.0 + EPS * np.array(signs)), spin, IDENTITY, times)[0] for signs in ((0, 1, -1), (-1, 1, 0), (1, 0, -1))
    ]
    for other in others:
        assert (angle_between_orientations(exact, other) <= TOLERANCE * np.linalg.norm(spin) * times).all()


def test_equal_moments_and_spins_of_symmetric_bodies_have_no_horizon():
    for moments in ((1.0, 1.0, 1.0), (1.0, 1.0, 1.5), (1.0, 1.5, 1.5), (1.5e-6, 1.0 - 5e-7, 1.0)):
        assert free_rotor(np.diag(moments), TILTED, np.array([1.0, 2.0, 3.0])).horizon == np.inf


@pytest.mark.parametrize("decay", [0.0, 0.05, 10.0])
def test_horizon_of_a_scene_is_that_of_its_rotor_at_its_own_time(decay):
    """With damping the rotor's time is (1 - exp(-κ t))/κ, which may never reach the horizon."""
    scene = load(
        {
            "duration": 50.0,
            "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0, "inertia": [1.0, 2.0, 2.5]},
            "start": {"orientation": TILTED.tolist(), "angular_velocity": rotate(TILTED, np.array([0.0, 3.0, 0.0])).tolist()},
            "damping": {"angular": decay},
        }
    )
    rotor = free_rotor(scene.body.inertia_tensor, np.array(scene.start.orientation), np.array(scene.start.angular_velocity))
    horizon = truth_for(scene).horizon
    if decay == 10.0:
        assert horizon == np.inf
    else:
        assert (-np.expm1(-decay * horizon) / decay if decay else horizon) == pytest.approx(rotor.horizon, rel=1e-12)
