"""The closed form of the free rotor compared with Taylor series of 40 digits, with invariants, and with simpler exact solutions."""

from fractions import Fraction
from functools import cache

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support import taylor

from dropspin.scenarios.rotations import angle_between_orientations, multiply, rotate, unrotate
from dropspin.scenarios.truths.asymmetric_top import AsymmetricTop
from dropspin.scenarios.truths.free_rotor import free_rotor, principal_spin

IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])
TILTED = np.array([0.5, 0.5, 0.5, 0.5])  # a unit quaternion that doubles hold exactly, and that only permutes axes

CASES = {
    "brick": ((0.00189422, 0.00621102, 0.00719467), (0.4363, -0.2618, 0.6981), 30.0),
    "round the largest": ((1.0, 2.0, 3.0), (-0.1, 0.2, -0.9), 40.0),
    "round the smallest": ((1.0, 2.0, 3.0), (1.0, 0.2, -0.3), 40.0),
    "axes in another order": ((3.0, 1.0, 2.0), (0.1, 0.3, 2.0), 20.0),
    "a cyclic order": ((2.0, 3.0, 1.0), (0.1, -0.3, 2.0), 20.0),
    "dzhanibekov": ((1.0, 2.0, 3.0), (0.001, 5.0, 0.0), 7.0),
    "dzhanibekov, the other side": ((1.0, 2.0, 3.0), (0.0, 5.0, 0.001), 7.0),
    "symmetric about the largest": ((1.0, 1.0, 1.5), (0.1, 2.0, 3.0), 20.0),
    "symmetric about the smallest": ((1.0, 1.5, 1.5), (0.1, 2.0, 3.0), 20.0),
    "nearly symmetric": ((1.0, 1.000001, 1.5), (0.1, 2.0, 3.0), 20.0),
    "needle": ((0.001, 1.0, 1.0009), (20.0, 1.0, 0.5), 10.0),
    "almost a principal axis": ((1.0, 2.0, 3.0), (1e-9, 0.0, 4.0), 20.0),
}


@cache
def taylor_solution(case):
    """Times, orientations from the identity, and body-frame spins. From another start q₀ the orientations are q₀ times these."""
    moments, spin, duration = CASES[case]
    times = np.linspace(0.0, duration, 6)
    exact = taylor.free_rotor(moments, spin, IDENTITY, times)
    return times, np.array([[float(c) for c in q] for q, _ in exact]), np.array([[float(c) for c in w] for _, w in exact])


@pytest.mark.sample(3)
@pytest.mark.parametrize("start", [IDENTITY, TILTED], ids=["upright", "tilted"])
@pytest.mark.parametrize("case", CASES)
def test_attitude_and_spin_match_taylor_series(case, start):
    """Attitude to 1e-11 rad (measured: 3e-12 for the needle, 2e-13 for the others), spin to 1e-11 of its magnitude."""
    moments, spin, _ = CASES[case]
    times, from_identity, exact_spins = taylor_solution(case)
    motion = free_rotor(np.diag(moments), start, rotate(start, np.array(spin)))
    orientations, rates = motion(times)
    exact_orientations = multiply(np.broadcast_to(start, (len(times), 4)), from_identity)
    assert angle_between_orientations(orientations, exact_orientations).max() <= 1e-11
    np.testing.assert_allclose(rates, rotate(exact_orientations, exact_spins), rtol=0, atol=1e-11 * np.linalg.norm(spin))


@pytest.mark.slow
def test_attitude_after_four_hundred_turns():
    """A brick for 400 turns: attitude to 1e-11 rad (measured 3e-12)."""
    moments, spin, _ = CASES["brick"]
    duration = 400 * 2 * np.pi / np.linalg.norm(spin)
    motion = free_rotor(np.diag(moments), IDENTITY, np.array(spin))
    orientation, _ = motion(np.array([duration]))
    [(exact, _)] = taylor.free_rotor(moments, spin, IDENTITY, [duration])
    assert angle_between_orientations(orientation[0], np.array([float(c) for c in exact])) <= 1e-11


def test_taylor_series_are_converged():
    """The reference itself: shorter steps and more terms change less than 20 digits."""
    coarse = taylor.free_rotor((1, 2, 3), (0.3, 1.0, -0.2), IDENTITY, [2.0])
    fine = taylor.free_rotor((1, 2, 3), (0.3, 1.0, -0.2), IDENTITY, [2.0], order=60, step="0.1")
    with mpmath.mp.workdps(40):
        assert max(abs(a - b) for a, b in zip(coarse[0][0], fine[0][0], strict=True)) < mpmath.mpf(10) ** -20


def test_periods_match_published_values():
    """The brick's spin repeats after 15.22777 s, the wing nut turns over every 6.861337 s (independent results by mpmath)."""

    def top(moments, spin):
        return AsymmetricTop(np.array(moments), np.eye(3), IDENTITY, np.array([Fraction(rate) for rate in spin]))

    brick = top([0.00189422, 0.00621102, 0.00719467], np.radians([25, -15, 40]).tolist())
    assert brick.period == pytest.approx(15.22777, abs=5e-6)
    nut = top([1.0, 2.0, 3.0], [0.001, 5.0, 0.0])
    assert nut.period / 2 == pytest.approx(6.861337, abs=5e-7)


moments = arrays(float, 3, elements=st.floats(0.2, 1.0)).map(lambda parts: parts.sum() - parts + 0.0)
spins = arrays(float, 3, elements=st.floats(-3, 3, allow_subnormal=False))
orientations = arrays(float, 4, elements=st.floats(-1, 1)).filter(lambda q: np.linalg.norm(q) > 0.1).map(lambda q: q / np.linalg.norm(q))


@given(moments, spins, orientations)
def test_energy_and_angular_momentum_are_conserved(inertia, spin, start):
    """Angular momentum in space and energy are constant to 1e-12; the start is reproduced to the last digits."""
    assume(np.linalg.norm(spin) > 1e-3)
    tensor = np.diag(inertia)
    w0 = rotate(start, spin)
    orientation, w = free_rotor(tensor, start, w0)(np.linspace(0, 50, 101))
    L = rotate(orientation, unrotate(orientation, w) @ tensor)
    L0 = rotate(start, tensor @ spin)
    np.testing.assert_allclose(L, np.broadcast_to(L0, L.shape), rtol=0, atol=1e-12 * np.linalg.norm(L0))
    energy = np.sum(L * w, axis=1)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-12)
    assert angle_between_orientations(orientation[0], start) <= 1e-13
    np.testing.assert_allclose(w[0], w0, rtol=0, atol=1e-14 * np.linalg.norm(w0) * 10)


@given(moments, spins, orientations, st.floats(0.1, 5))
def test_motion_can_be_restarted_at_any_time(inertia, spin, start, pause):
    """The motion from t is the motion from the state at t: the closed form is a flow, to 1e-10."""
    assume(np.linalg.norm(spin) > 1e-2)
    # Near the separatrix the rounding of the restart grows exponentially, as any disturbance of the body does.
    ordered = np.argsort(inertia)
    tensor = np.diag(inertia)
    beyond = abs((tensor @ spin) @ (tensor @ spin) - 2 * 0.5 * spin @ tensor @ spin * inertia[ordered[1]])
    assume(beyond > 0.05 * (tensor @ spin) @ (tensor @ spin))
    first = free_rotor(tensor, start, rotate(start, spin))
    q, w = first(np.array([pause, pause + 3.0]))
    again, _ = free_rotor(tensor, q[0], w[0])(np.array([3.0]))
    assert angle_between_orientations(again[0], q[1]) <= 1e-10


def test_symmetric_top_reduces_to_two_rotations():
    """A body with two equal moments: R(t) = exp(t L/A) R₀ exp(t (1 - C/A) ω₃ e₃), to 1e-12 rad."""
    from dropspin.scenarios.rotations import about

    A, C, spin, t = 1.0, 1.5, np.array([0.4, -0.3, 2.0]), np.linspace(0, 30, 50)
    orientation, _ = free_rotor(np.diag([A, A, C]), TILTED, rotate(TILTED, spin))(t)
    L = rotate(TILTED, np.array([A, A, C]) * spin)
    precession = about(L / np.linalg.norm(L), np.linalg.norm(L) / A * t)
    own = about(np.array([0.0, 0.0, 1.0]), (1 - C / A) * spin[2] * t)
    exact = multiply(multiply(precession, np.broadcast_to(TILTED, precession.shape)), own)
    assert angle_between_orientations(orientation, exact).max() <= 1e-12


def test_motion_does_not_depend_on_the_body_frame():
    """A body described in a rotated frame, with an inertia tensor that is not diagonal, moves alike."""
    rng = np.random.default_rng(3)
    frame = rng.normal(size=4)
    frame /= np.linalg.norm(frame)
    axes = rotate(frame, np.eye(3)).T
    moments, w, t = np.array([1.0, 2.0, 3.0]), np.array([0.3, 1.0, -0.4]), np.linspace(0, 20, 40)
    straight, _ = free_rotor(np.diag(moments), IDENTITY, w)(t)
    # The same body described in a frame that is rotated by `frame`.
    skew = axes.T @ np.diag(moments) @ axes
    turned, _ = free_rotor(skew, frame, w)(t)
    expected = multiply(straight, np.broadcast_to(frame, straight.shape))
    assert angle_between_orientations(turned, expected).max() <= 1e-12


def test_spin_about_a_principal_axis_is_steady():
    """The angle is ω t; a body at rest stays at rest."""
    orientation, w = free_rotor(np.diag([1.0, 2.0, 3.0]), IDENTITY, np.array([0.0, 2.0, 0.0]))(np.array([0.0, 0.7]))
    np.testing.assert_allclose(orientation[1], [0, np.sin(0.7), 0, np.cos(0.7)], rtol=0, atol=2e-16)
    np.testing.assert_array_equal(w[1], [0, 2, 0])
    still, w = principal_spin(TILTED, np.zeros(3))(np.array([5.0]))
    np.testing.assert_array_equal(still[0], TILTED)
    np.testing.assert_array_equal(w[0], 0.0)


@pytest.mark.parametrize("spin", [(0.3, 2.0, 0.1), (2.0, 0.4, 0.3), (0.1, 0.3, 2.0)])
def test_largest_spin_is_the_greatest_speed(spin):
    rotor = free_rotor(np.diag([0.02, 0.05, 0.04]), np.array([0.0, 0.0, 0.0, 1.0]), np.array(spin))
    speeds = np.linalg.norm(rotor(np.linspace(0.0, 60.0, 40_001))[1], axis=1)  # of many periods
    assert rotor.largest_spin == pytest.approx(speeds.max(), rel=1e-6)
    assert rotor.largest_spin >= speeds.max() * (1.0 - 1e-14)


def test_many_times_at_once_are_those_of_parts():
    rotor = free_rotor(np.diag([0.02, 0.05, 0.04]), np.array([0.0, 0.0, 0.0, 1.0]), np.array([0.3, 2.0, 0.1]))
    t = np.linspace(0.0, 5.0, 40_001)
    together, parts = rotor(t), [rotor(part) for part in np.array_split(t, 7)]
    for whole, several in zip(together, zip(*parts, strict=True), strict=True):
        np.testing.assert_allclose(whole, np.concatenate(several), rtol=0, atol=1e-14)
