"""Ensembles: many bodies in one call, whose parameters may differ and which do not affect each other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.methods import COVERING

from dropspin import reference_impl
from dropspin.reference_impl import Body, Floor, Methods, World
from dropspin.reference_impl.state import ORIENTATION, SPIN, VELOCITY

G = np.array([0.0, -9.8, 0.0])
POINTS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * [0.1, 0.2, 0.3]
BOX = Body(1.0, reference_impl.solid_box_inertia(1.0, np.array([0.1, 0.2, 0.3])), POINTS)
WORLD = World(G, Floor(0.5, np.inf))


def starts(count, seed=0):
    rows = np.random.default_rng(seed).normal(size=(count, 13))
    rows[:, 1] = 0.4
    rows[:, ORIENTATION] /= np.linalg.norm(rows[:, ORIENTATION], axis=1, keepdims=True)
    return rows


def test_time_step_gravity_and_damping_may_differ_from_body_to_body():
    """x_n = x₀ + h² g n(n+1)/2 and v_n = c^n v₀ for each body's own h, g and rate, to 1e-13 (measured 5e-15)."""
    h, g, rate = np.linspace(1e-3, 2e-2, 21), np.linspace(-20.0, 5.0, 21), np.linspace(0.0, 3.0, 21)
    n = np.arange(101)
    start = np.array([0, 5, 0, 0, 0, 0, 1, 3.0, 0, 0, 0, 2.0, 0])
    falling = reference_impl.simulate(start, BOX, World(np.outer(g, [0, 1, 0]), damping=(0.0, 0.0)), h, 100)
    assert falling.shape == (21, 101, 13)
    exact = 5 + np.outer(h**2 * g, n * (n + 1) / 2)
    np.testing.assert_allclose(falling[:, :, 1], exact, rtol=0, atol=1e-13 * np.abs(exact).max())
    slowing = reference_impl.simulate(start, BOX, World(np.zeros(3), damping=(rate, 2 * rate)), h, 100)
    np.testing.assert_allclose(slowing[:, :, 7], 3 * np.exp(-np.outer(rate * h, n)), rtol=1e-13)
    np.testing.assert_allclose(slowing[:, :, 11], 2 * np.exp(-np.outer(2 * rate * h, n)), rtol=1e-13)


def test_each_body_rebounds_by_its_own_restitution():
    """A flat box from rest above the floor leaves at e times its speed of arrival, for each body's own e."""
    e = np.linspace(0.0, 1.0, 33)
    start = np.array([0, 1.0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.0])
    speed = reference_impl.simulate(start, BOX, World(G, Floor(e, 0.0)), 1e-3, 450)[:, :, 8]
    struck = np.argmax(speed[:, 1:] > speed[:, :-1], axis=1)
    assert (struck == struck[0]).all()
    arrival = speed[:, struck[0]] - 9.8e-3  # gravity has acted once more before the impact
    np.testing.assert_allclose(speed[:, struck[0] + 1], -e * arrival, rtol=1e-13, atol=1e-15)


def test_shape_of_the_result_follows_the_arguments():
    """One state gives (n, 13); any argument for each body, even for one, gives (B, n, 13)."""
    start = starts(1)[0]
    assert reference_impl.simulate(start, BOX, WORLD, 1e-3, 7, every=3).shape == (3, 13)
    assert reference_impl.simulate(start[None], BOX, WORLD, 1e-3, 7, every=3).shape == (1, 3, 13)
    assert reference_impl.simulate(start, BOX, WORLD, np.array([1e-3]), 7, every=3).shape == (1, 3, 13)
    assert reference_impl.step(start, BOX, WORLD, 1e-3).shape == (13,)
    assert reference_impl.step(start, BOX, WORLD, 1e-3, forces=np.zeros((5, 8, 3))).shape == (5, 13)
    assert reference_impl.step(starts(4), BOX, WORLD, 1e-3).shape == (4, 13)


@settings(max_examples=20, deadline=None)
@given(
    count=st.integers(1, 24),
    every=st.integers(1, 9),
    threads=st.integers(1, 4),
    seed=st.integers(0, 1000),
    methods=st.sampled_from([Methods(), Methods(contact="sequential", law="coulomb")]),
)
def test_body_has_the_same_bits_in_an_ensemble_and_alone(count, every, threads, seed, methods):
    """For any number of bodies, rows and threads."""
    many = starts(count, seed)
    world = World(G, Floor(0.5, 0.0)) if methods.contact == "sequential" else WORLD
    together = reference_impl.simulate(many, BOX, world, 1e-2, 40, every, methods, threads)
    for state, rows in zip(many, together, strict=True):
        np.testing.assert_array_equal(rows, reference_impl.simulate(state, BOX, world, 1e-2, 40, every, methods))


def test_body_that_diverges_does_not_affect_the_others():
    """NaN stays in its body, for every rotation that can diverge."""
    world = World(G, Floor(0.5, np.inf), (0.1, 0.1))
    bounded = ("note", "implicit-gyroscopic", "exact")
    diverging = {methods.rotation: methods for methods in (Methods(**choice) for choice in COVERING) if methods.rotation not in bounded}
    assert set(diverging) == {"gyroscopic", "midpoint", "rk4"}
    for methods in diverging.values():
        many = starts(20)
        expected = np.delete(reference_impl.simulate(many, BOX, world, 1e-3, 50, methods=methods), 7, axis=0)
        many[7, SPIN] = 1e200
        together = reference_impl.simulate(many, BOX, world, 1e-3, 50, methods=methods)
        assert not np.isfinite(together[7, -1]).all()
        np.testing.assert_array_equal(np.delete(together, 7, axis=0), expected)


def test_forces_may_differ_from_body_to_body():
    """Eq 9 with a couple of its own for each of 20 bodies: ω changes by h I⁻¹ Σ r × f."""
    rng = np.random.default_rng(0)
    forces = rng.normal(size=(20, 8, 3))
    start = np.array([0, 5, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.0])
    after = reference_impl.step(start, BOX, World(), 1e-3, forces=forces)
    torques = np.cross(POINTS, forces).sum(axis=1)
    np.testing.assert_allclose(after[:, SPIN], 1e-3 * np.linalg.solve(BOX.inertia, torques.T).T, rtol=1e-12)
    np.testing.assert_allclose(after[:, VELOCITY], 1e-3 * forces.sum(axis=1), rtol=1e-12, atol=1e-18)


def test_balls_of_an_ensemble_turn_if_one_of_them_spins():
    """The rotation is left out only if no body needs it; balls without spin keep their attitude either way."""
    ball = Body(1.0, 0.4 * 0.01 * np.eye(3), np.zeros((1, 3)), (0.1, 0.1, 0.1))
    many = np.tile(np.array([0, 5, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0.0]), (20, 1))
    many[3, 11] = 1.0
    rows = reference_impl.simulate(many, ball, World(G), 1e-3, 100)
    assert rows[3, -1, 4] == pytest.approx(np.sin(0.05), abs=1e-6)
    others = np.delete(rows, 3, axis=0)
    np.testing.assert_array_equal(others, np.broadcast_to(others[0], others.shape))


@pytest.mark.parametrize(
    ("attempt", "message"),
    [
        (lambda: run(body=Body(np.array([1.0, 2.0, -1.0]), BOX.inertia, POINTS)), "mass: got -1.0 for body 2; must be a number above 0"),
        (lambda: run(dt=np.array([1e-3, np.nan])), "dt: got nan for body 1"),
        (lambda: run(dt=np.full(5, 1e-3)), "ensemble: got 4 of state but 5 of body, world and dt"),
        (lambda: run(body=Body(np.ones(3), BOX.inertia, POINTS, np.zeros((2, 3)))), "ensemble: got 3 of mass but 2 of semi_axes"),
        (lambda: run(states=np.zeros((0, 13))), r"state: must have shape \(13,\) or \(B, 13\), got \(0, 13\)"),
        (lambda: run(world=World(G, Floor(np.array([0.5, 1.5]), 0.0))), "restitution: got 1.5 for body 1; must be between 0 and 1"),
        (lambda: run(world=World(G, Floor(0.5, np.array([0.0, 0.3])))), "friction: got 0.3; law 'note' takes 0 and infinity only"),
        (
            lambda: run(body=Body(1.0, np.stack([np.eye(3), -np.eye(3)]), POINTS)),
            "inertia: got .* for body 1; must be .* positive definite",
        ),
        (lambda: run(body=Body("heavy", BOX.inertia, POINTS)), "mass: got 'heavy'; must be a number above 0"),
        (lambda: run(body=Body(1.0, np.triu(np.ones((3, 3))) + 2 * np.eye(3), POINTS)), "inertia: got .* must be a symmetric"),
        (lambda: run(threads=0), "threads: got 0; must be a whole number, at least 1"),
    ],
)
def test_invalid_argument_of_an_ensemble_names_the_body(attempt, message):
    with pytest.raises(ValueError, match=message):
        attempt()


def run(states=None, body=BOX, world=WORLD, dt=1e-3, threads=None):
    return reference_impl.simulate(starts(4) if states is None else states, body, world, dt, 1, threads=threads)
