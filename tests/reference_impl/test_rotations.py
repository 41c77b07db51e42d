"""The rotations compared with the closed form of the free rotor: orders, conserved quantities, limits."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dropspin import reference_impl
from dropspin.reference_impl import Body, Methods, World
from dropspin.reference_impl.elliptic import r_c1, r_f, r_j, sn_cn_dn
from dropspin.reference_impl.methods import ROTATIONS
from dropspin.reference_impl.state import ORIENTATION, SPIN
from dropspin.scenarios.rotations import angle_between_orientations, rotate, unrotate
from dropspin.scenarios.truths.free_rotor import free_rotor

POINTS = np.array([[0.1, 0.1, 0.1], [-0.1, -0.1, -0.1]])
IDENTITY, TILTED = np.array([0.0, 0.0, 0.0, 1.0]), np.array([0.5, 0.5, 0.5, 0.5])


def turned(rotation, moments, spin, duration, steps, start=TILTED):
    """States at the start and the end, and the exact attitude at the end."""
    inertia = np.diag(np.asarray(moments, dtype=float))
    w = rotate(start, np.asarray(spin, dtype=float))
    state = np.concatenate([np.zeros(3), start, np.zeros(3), w])
    body = Body(1.0, inertia, POINTS)
    rows = reference_impl.simulate(state, body, World(), duration / steps, steps, steps, Methods(rotation=rotation))
    exact, _ = free_rotor(inertia, start, w)(np.array([duration]))
    return rows, angle_between_orientations(rows[-1, ORIENTATION], exact[0])


# The range of |ω| dt in which each method shows its order, between rounding and higher orders.
ASYMPTOTIC_RANGES = {
    "gyroscopic": (0.0125, 0.00625, 0.003125),
    "implicit-gyroscopic": (0.0125, 0.00625, 0.003125),
    "midpoint": (0.1, 0.05, 0.025),
    "rk4": (0.1, 0.05, 0.025),
}


def test_every_rotation_of_finite_order_is_measured():
    assert {name for name, leaf in ROTATIONS.items() if leaf.ORDER not in (None, math.inf)} == set(ASYMPTOTIC_RANGES)


@pytest.mark.sample(7)
@pytest.mark.parametrize("moments", [(1, 2, 3), (3, 1, 2), (0.3, 0.9, 1.0)])
@pytest.mark.parametrize("rotation", ASYMPTOTIC_RANGES)
def test_observed_order_is_the_declared_one(rotation, moments):
    """The slope of the attitude error over the time step, within 0.1 of the declared order (measured: within 0.06)."""
    order, sizes = ROTATIONS[rotation].ORDER, ASYMPTOTIC_RANGES[rotation]
    spin = np.array([0.3, 0.8, -0.5])
    steps = [round(20 * np.linalg.norm(spin) / size) for size in sizes]
    errors = [turned(rotation, moments, spin, 20.0, n)[1] for n in steps]
    slope = np.polyfit(-np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.1)


def test_error_of_the_note_s_rotation_does_not_vanish():
    """The attitude error stays above a radian as dt → 0."""
    errors = [turned("note", (1, 2, 3), (0.3, 0.8, -0.5), 20.0, n)[1] for n in (1000, 4000, 16000)]
    assert min(errors) > 1.0
    assert max(errors) / min(errors) < 1.01


@pytest.mark.parametrize("steps", [7, 100, 10_000, 300_000])
def test_exact_rotation_is_exact_for_any_time_step(steps):
    """1000 rad/s for 10 s: attitude within 1e-9 + 1e-12 a step of the closed form (measured a sixth of it at most)."""
    spin = 1000 * np.array([0.36, 0.48, 0.8])
    _, error = turned("exact", (1, 2, 3), spin, 10.0, steps)
    assert error <= 1e-9 + 1e-12 * steps


EXACT_CASES = {
    "circles the smallest": ((1, 2, 3), (1.0, 0.2, -0.3)),
    "circles the largest": ((1, 2, 3), (-0.1, 0.2, -0.9)),
    "symmetric": ((1, 1, 1.5), (0.1, 2.0, 3.0)),
    "symmetric, the other way": ((1, 1.5, 1.5), (0.1, 2.0, 3.0)),
    "principal": ((1, 2, 3), (0.0, -2.0, 0.0)),
    "ball": ((2, 2, 2), (1.0, 1.0, 1.0)),
    "at rest": ((1, 2, 3), (0.0, 0.0, 0.0)),
    "needle": ((0.001, 1.0, 1.0009), (20.0, 1.0, 0.5)),
    "unordered": ((2, 3, 1), (0.1, -0.3, 2.0)),
}


@pytest.mark.parametrize("case", EXACT_CASES)
def test_exact_rotation_covers_every_kind_of_motion(case):
    """To 1e-11 rad in ten steps, to 2e-10 in a thousand."""
    moments, spin = EXACT_CASES[case]
    assert turned("exact", moments, spin, 10.0, 10)[1] <= 1e-11
    assert turned("exact", moments, spin, 10.0, 1000)[1] <= 2e-10


def kept(rotation, size, steps=20_000):
    """Relative drift of energy and of L in space, for |ω| dt = size."""
    spin = np.array([0.3, 0.8, -0.5])
    rows, _ = turned(rotation, (1, 2, 3), spin, steps * size / np.linalg.norm(spin), steps)
    inertia = np.diag([1.0, 2.0, 3.0])
    L = rotate(rows[:, ORIENTATION], unrotate(rows[:, ORIENTATION], rows[:, SPIN]) @ inertia)
    energy = np.sum(L * rows[:, SPIN], axis=1)
    return abs(energy[-1] / energy[0] - 1), np.linalg.norm(L[-1] - L[0]) / np.linalg.norm(L[0])


@pytest.mark.parametrize(("rotation", "energy"), [("midpoint", 1e-11), ("exact", 1e-11)])
def test_energy_and_angular_momentum_are_conserved(rotation, energy):
    """20,000 steps of |ω| dt = 0.1: L in space to 1e-11 (measured 3e-12), energy to rounding, or without drift."""
    drift, momentum = kept(rotation, 0.1)
    assert momentum <= 1e-11
    assert drift <= energy


def test_energy_drift_of_each_rotation():
    """The explicit gyroscopic term diverges, the implicit one and RK4 lose energy; midpoint conserves it at |ω| dt = 1."""
    assert not kept("gyroscopic", 0.1, 5000)[0] < 1.0
    assert kept("implicit-gyroscopic", 0.1, 5000)[0] > 0.3
    assert 1e-9 < kept("rk4", 0.1, 5000)[0] < 1e-4
    assert kept("midpoint", 1.0, 5000)[0] <= 1e-10


def test_rotations_do_not_depend_on_the_body_frame():
    """A body in a rotated frame, whose inertia tensor is not diagonal, turns alike."""
    from dropspin.scenarios.rotations import multiply

    frame = np.array([0.1, -0.5, 0.3, 0.8]) / np.linalg.norm([0.1, -0.5, 0.3, 0.8])
    axes = rotate(frame, np.eye(3)).T
    w = np.array([0.3, 1.0, -0.4])
    for rotation in ("gyroscopic", "implicit-gyroscopic", "midpoint", "rk4", "exact"):
        rows = [
            reference_impl.simulate(
                np.concatenate([np.zeros(3), start, np.zeros(3), w]), Body(1.0, inertia, POINTS), World(), 0.01, 100, 100,
                Methods(rotation=rotation),
            )[-1]
            for start, inertia in ((IDENTITY, np.diag([1.0, 2.0, 3.0])), (frame, axes.T @ np.diag([1.0, 2.0, 3.0]) @ axes))
        ]  # fmt: skip
        straight, skew = (row[ORIENTATION] for row in rows)
        assert angle_between_orientations(multiply(straight, frame), skew) <= 1e-12


def test_elliptic_functions_match_scipy_and_mpmath():
    """R_F, R_J and sn, cn, dn, to 1e-12."""
    import mpmath
    from scipy.special import elliprf, elliprj

    rng = np.random.default_rng(1)
    for _ in range(300):
        phi, m1, n = rng.uniform(0, 1.57), 10 ** rng.uniform(-12, 0), -(10 ** rng.uniform(-3, 6))
        s, c = math.sin(phi), math.cos(phi)
        x, y, p = c * c, m1 + (1 - m1) * c * c, 1 - n * s * s
        assert r_f(x, y, 1.0) == pytest.approx(float(elliprf(x, y, 1.0)), rel=1e-14)
        assert r_j(x, y, 1.0, p) == pytest.approx(float(elliprj(x, y, 1.0, p)), rel=1e-13)
    for m1 in (1.0, 0.5, 1e-6):
        for u in (-7.3, 0.0, 0.4, 3.0):
            with mpmath.mp.workdps(40):
                m = 1 - mpmath.mpf(m1)
                exact = [float(mpmath.re(mpmath.ellipfun(name, mpmath.mpf(u), m=m))) for name in ("sn", "cn", "dn")]
            assert sn_cn_dn(u, m1) == pytest.approx(exact, rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("rotation", ["midpoint", "exact"])
def test_energy_does_not_drift_by_rounding(rotation):
    """Rounding of the attitude has no bias: at most 1e-16 a step over 100,000 steps (measured 6e-17; 4e-16 without the division by q·q)."""
    body = Body(1.0, np.diag([1.0, 2.0, 3.0]), np.full((1, 3), 0.1))
    start = np.array([0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0.3, 0.8, -0.5])
    rows = reference_impl.simulate(start, body, World(), 1e-3, 100_000, 100_000, Methods(rotation=rotation))
    energy = [0.5 * (np.diag(body.inertia) @ Rotation.from_quat(row[ORIENTATION]).inv().apply(row[SPIN]) ** 2) for row in rows]
    assert abs(energy[1] / energy[0] - 1) <= 1e-11


def test_midpoint_solves_its_equation_at_large_angles():
    """At |ω| dt = 2.5 Newton's method takes many steps; energy and L are conserved to 1e-12."""
    body = Body(1.0, np.diag([1.0, 2.0, 3.0]), np.full((1, 3), 0.1))
    start = np.array([0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1.0, 1.5, -1.7])
    rows = reference_impl.simulate(start, body, World(), 2.5 / np.linalg.norm(start[10:]), 200, 1, Methods(rotation="midpoint"))
    R = Rotation.from_quat(rows[:, ORIENTATION])
    spin = R.inv().apply(rows[:, SPIN])
    energy, L = 0.5 * spin**2 @ np.diag(body.inertia), R.apply(spin * np.diag(body.inertia))
    assert np.ptp(energy) <= 1e-12 * energy[0]
    assert np.abs(L - L[0]).max() <= 1e-12 * np.linalg.norm(L[0])


def test_carlson_r_c_matches_mpmath():
    """R_C(1, 1 + y), to 2e-15, for y of both signs."""
    import mpmath

    for y in (-0.999, -0.5, -1e-3, -1e-4, 0.0, 1e-4, 1e-2, 0.7, 30.0, 1e8):
        exact = float(mpmath.elliprc(1, 1 + mpmath.mpf(y)))
        assert r_c1(y) == pytest.approx(exact, rel=2e-15)
