"""Algorithm 1 as a whole: exact solutions of its difference equations, conserved quantities, known faults, and the Python interface."""

import numpy as np
import pytest

from dropspin import reference_impl
from dropspin.reference_impl import Body, Floor, World
from dropspin.reference_impl.state import ORIENTATION, POSITION, SPIN, VELOCITY

G = np.array([0.0, -9.8, 0.0])
HALF = np.array([0.1, 0.2, 0.3])
POINTS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * HALF
BODY = Body(1.0, reference_impl.solid_box_inertia(1.0, HALF), POINTS)


def state(x=(0, 5, 0), q=(0, 0, 0, 1), v=(0, 0, 0), w=(0, 0, 0)):
    return np.concatenate([x, q, v, w]).astype(float)


def test_eq1_free_flight_in_closed_form():
    """x_n = x₀ + n h v₀ + h² g n(n+1)/2: semi-implicit Euler, to 1e-13 of the distance (measured 3e-15)."""
    h, n = 1e-2, np.arange(301)
    rows = reference_impl.simulate(state(v=(1, 2, 3)), BODY, World(G), h, 300)
    exact = np.array([0, 5, 0]) + np.outer(n * h, [1, 2, 3]) + np.outer(h**2 * n * (n + 1) / 2, G)
    np.testing.assert_allclose(rows[:, POSITION], exact, rtol=0, atol=1e-13 * np.abs(exact).max())


def test_synchronised_energy_is_conserved_and_the_raw_one_drifts():
    """v²/2 - g·x + h g·v/2 is constant to 1e-13; v²/2 - g·x loses g² h t/2, 0.48 J/kg after 1 s at 10 ms."""
    h = 1e-2
    rows = reference_impl.simulate(state(), BODY, World(G), h, 100)
    raw = 0.5 * np.sum(rows[:, VELOCITY] ** 2, axis=1) - rows[:, POSITION] @ G
    shadow = raw + 0.5 * h * rows[:, VELOCITY] @ G
    assert np.ptp(shadow) <= 1e-13 * shadow[0]
    assert raw[-1] - raw[0] == pytest.approx(-(9.8**2) * h * 1.0 / 2, rel=1e-12)


def test_eq6_turns_by_twice_the_arctangent_of_half():
    """Known fault: one step turns 2 atan(|ω| h/2) instead of |ω| h. Closed form after 100 steps, to 1e-12 rad."""
    h, speed = 0.05, 6.0
    rows = reference_impl.simulate(state(w=(0, speed, 0)), BODY, World(), h, 100)
    angle = 2 * np.arctan2(rows[:, 4], rows[:, 6])
    exact = np.arange(101) * 2 * np.arctan(speed * h / 2)
    np.testing.assert_allclose(np.exp(1j * angle), np.exp(1j * exact), rtol=0, atol=1e-12)


def test_without_gyroscopic_term_energy_and_length_of_momentum_look_perfect():
    """Eq 6 keeps ω in space: energy and |L| to 1e-12, while L swings by twice its angle to ω."""
    body = Body(1.0, np.diag([0.00189422, 0.00621102, 0.00719467]), POINTS)
    rows = reference_impl.simulate(state(w=np.radians([25, -15, 40])), body, World(), 1e-3, 10_000)
    from scipy.spatial.transform import Rotation

    R = Rotation.from_quat(rows[:, ORIENTATION])
    L = R.apply(R.inv().apply(rows[:, SPIN]) @ body.inertia)
    energy = np.sum(L * rows[:, SPIN], axis=1)
    length = np.linalg.norm(L, axis=1)
    assert np.ptp(energy) <= 1e-12 * energy[0]
    assert np.ptp(length) <= 1e-12 * length[0]
    direction = np.arccos(np.clip(L @ L[0] / (length * length[0]), -1, 1))
    cone = np.arctan2(np.linalg.norm(np.cross(L[0], rows[0, SPIN])), L[0] @ rows[0, SPIN])
    assert direction.max() == pytest.approx(2 * cone, rel=1e-5)  # L describes a cone about ω; 0.753 rad
    assert direction.max() > 0.7


def test_eq9_weights_of_the_vertices_have_no_torque():
    """They give the same motion as gravity."""
    share = np.full(8, BODY.mass / 8)
    weights = np.outer(share, G)
    tilted = state(q=np.array([0.2, 0.1, -0.3, 0.9]) / np.linalg.norm([0.2, 0.1, -0.3, 0.9]), w=(1, 2, 3))
    by_forces = reference_impl.step(tilted, BODY, World(), 1e-3, forces=weights)
    by_gravity = reference_impl.step(tilted, BODY, World(G), 1e-3)
    np.testing.assert_allclose(by_forces, by_gravity, rtol=0, atol=4e-16 * 5)


def test_eq6_torque_of_a_couple():
    """Two opposite forces at corners: ω changes by h I⁻¹ Σ r × f, v does not change."""
    forces = np.zeros((8, 3))
    forces[0], forces[7] = (0, 0, 1.0), (0, 0, -1.0)
    after = reference_impl.step(state(), BODY, World(), 1e-3, forces=forces)
    torque = sum(np.cross(p, f) for p, f in zip(POINTS, forces, strict=True))
    np.testing.assert_allclose(after[SPIN], 1e-3 * np.linalg.solve(BODY.inertia, torque), rtol=1e-14)
    np.testing.assert_array_equal(after[VELOCITY], 0.0)


def test_damping_is_exponential_in_time():
    """Factors exp(-rate h) in each step give exp(-rate t) for any h."""
    for h in (0.1, 0.01):
        rows = reference_impl.simulate(state(v=(1, 0, 0), w=(0, 2, 0)), BODY, World(damping=(0.7, 1.1)), h, round(1 / h))
        assert rows[-1, 7] == pytest.approx(np.exp(-0.7), rel=1e-13)
        assert rows[-1, 11] == pytest.approx(2 * np.exp(-1.1), rel=1e-13)


def test_absent_part_has_the_bits_of_a_part_without_effect():
    """No gravity, no damping, no floor: the same bits as with zero gravity, no decay and a floor out of reach."""
    start = state(x=(0, 50, 0), v=(1, -2, 3), w=(1, 2, 3))
    without = reference_impl.simulate(start, BODY, World(), 1e-3, 200)
    with_all = reference_impl.simulate(start, BODY, World(np.zeros(3), Floor(0.5, np.inf), (0.0, 0.0)), 1e-3, 200)
    np.testing.assert_array_equal(without, with_all)


def test_ball_bounces_at_its_lowest_point():
    """A ball is one vertex at -R N; an impact changes its spin only if it slides on a floor with friction."""
    ball = Body(1.0, reference_impl.solid_sphere_inertia(1.0, 0.1), np.zeros((1, 3)), (0.1, 0.1, 0.1))
    start = state(x=(0, 0.1 - 1e-4, 0), v=(2, -3, 0), w=(0, 0, 5))
    smooth = reference_impl.step(start, ball, World(floor=Floor(0.8, 0.0)), 1e-4)
    rough = reference_impl.step(start, ball, World(floor=Floor(0.8, np.inf)), 1e-4)
    assert smooth[8] == pytest.approx(2.4, rel=1e-14)
    assert rough[8] == pytest.approx(2.4, rel=1e-14)
    # Sticking, solid ball: v_x⁺ = v_x - (2/7)(v_x + R ω_z), and then no slip.
    assert rough[7] == pytest.approx(2 - 2 / 7 * (2 + 0.1 * 5), rel=1e-13)
    assert rough[7] + 0.1 * rough[12] == pytest.approx(0.0, abs=1e-14)


def test_flat_body_at_rest_sinks_by_one_step_of_gravity():
    """Known fault: at restitution 0 a flat box rests at a depth of g h² (no position correction)."""
    h = 1 / 60
    flat = state(x=(0, 0.2, 0))
    rows = reference_impl.simulate(flat, BODY, World(G, Floor(0.0, np.inf)), h, 600)
    assert 0.2 - rows[-1, 1] == pytest.approx(9.8 * h**2, rel=1e-12)


def test_recording_fewer_rows_does_not_change_them():
    start, world = state(x=(0, 0.4, 0), v=(1, 0, 0), w=(3, 2, 1)), World(G, Floor(0.5, np.inf))
    all_rows = reference_impl.simulate(start, BODY, world, 1e-3, 1000)
    np.testing.assert_array_equal(reference_impl.simulate(start, BODY, world, 1e-3, 1000, every=7), all_rows[::7])


def test_state_of_the_wrong_shape_is_rejected():
    with pytest.raises(ValueError, match=r"shape \(13,\) or \(B, 13\), got \(7,\)"):
        reference_impl.step(np.zeros(7), BODY, World(), 1e-3)


def test_eq7_and_eq9_for_a_tilted_box():
    """Forces on the vertices: Δω = h R I⁻¹ Rᵀ Σ R p × f, by NumPy."""
    rng = np.random.default_rng(3)
    q = np.array([0.4, -0.2, 0.5, 0.7])
    q /= np.linalg.norm(q)
    forces = rng.normal(size=(8, 3))
    after = reference_impl.step(state(q=q), BODY, World(), 1e-3, forces=forces)
    from scipy.spatial.transform import Rotation

    R = Rotation.from_quat(q).as_matrix()
    torque = np.cross(POINTS @ R.T, forces).sum(axis=0)
    np.testing.assert_allclose(after[SPIN], 1e-3 * R @ np.linalg.solve(BODY.inertia, R.T @ torque), rtol=1e-12)


@pytest.mark.parametrize(
    ("motion", "turns"),
    [({}, False), ({"v": (0, 0, 1)}, True), ({"v": (1, 0, 0)}, True), ({"w": (0, 1e-3, 0)}, True), ({"q": (0.6, 0, 0, 0.8)}, False)],
)
@pytest.mark.parametrize("sideways", [(0, 0, 0), (0.1, 0, 0), (0, 0, 0.1)])
def test_ball_turns_only_if_it_spins_or_slides(motion, turns, sideways):
    """With infinite friction: by spin, sliding, or gravity along the floor, in x and in z. Otherwise its attitude keeps every bit."""
    ball = Body(1.0, reference_impl.solid_sphere_inertia(1.0, 0.1), np.zeros((1, 3)), (0.1, 0.1, 0.1))
    start = state(x=(0, 0.2, 0), **motion)
    rows = reference_impl.simulate(start, ball, World(G + np.array(sideways), Floor(0.5, np.inf)), 1e-3, 400)
    turned = bool(np.any(rows[-1, ORIENTATION] != rows[0, ORIENTATION]))
    assert turned == (turns or any(sideways))


def test_orientations_are_normalised():
    """Multiples of a quaternion are the same attitude, for large and small factors; one of unit length keeps every bit."""
    q = np.array([0.1, 0.2, -0.3, 0.9]) / np.linalg.norm([0.1, 0.2, -0.3, 0.9])
    rows = [
        reference_impl.simulate(state(x=(0, 0.4, 0), q=scale * q), BODY, World(G, Floor(0.5, np.inf)), 1e-3, 100)
        for scale in (1.0, 2.0, 1e-170, 1e200)
    ]
    for other in rows[1:]:
        np.testing.assert_allclose(other, rows[0], rtol=0, atol=1e-12)
    np.testing.assert_array_equal(rows[0][0, ORIENTATION], q)


def test_simulator_holds_copies_and_can_be_pickled():
    import pickle

    points = POINTS.copy()
    simulator = reference_impl.Simulator(Body(1.0, BODY.inertia, points), World(G, Floor(0.5, np.inf)), 1e-3)
    start = state(x=(0, 0.5, 0))
    before = simulator.run(start, 400)
    points *= 3.0
    np.testing.assert_array_equal(simulator.run(start, 400), before)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(simulator)).run(start, 400), before)


def test_overflow_in_a_kernel_does_not_raise():
    """Compiled code continues with inf and NaN."""
    for rotation in ("note", "gyroscopic", "implicit-gyroscopic", "midpoint", "rk4", "exact"):
        rows = reference_impl.simulate(state(w=(1e200, 1e200, 0)), BODY, World(), 1.0, 5, methods=reference_impl.Methods(rotation=rotation))
        assert rows.shape == (6, 13)


@pytest.mark.parametrize(
    ("attempt", "message"),
    [
        (lambda: go(steps=np.uint8(255)), None),
        (lambda: go(steps=2.5), "steps: got 2.5; must be a whole number, at least 0"),
        (lambda: go(steps=-1), "steps: got -1"),
        (lambda: go(every=2**63), "every: got 9223372036854775808"),
        (lambda: go(every=None), "every: got None"),
        (lambda: go(body=Body(1.0, BODY.inertia, None)), "points: got None"),
        (lambda: go(body=Body(1.0, BODY.inertia, 3.0)), "points: must have shape"),
        (lambda: go(body=Body(1.0, BODY.inertia, [])), "points: "),
        (lambda: go(body=Body(1.0, BODY.inertia, [[1, 2, 3], [1, 2]])), "points: got"),
        (lambda: go(body=Body(1.0, BODY.inertia, POINTS[0])), "points: must have shape"),
        (lambda: go(body=Body(1.0, np.diag([1.0, 1.0, 1e-14]), POINTS)), "inertia: got .* positive definite"),
        (lambda: go(body=Body(1.0, np.diag([1e-320, 1.0, 1.0]), POINTS)), "inertia: got"),
        (lambda: go(world=World(damping=(-1e6, 0.0))), "linear damping: got -1000000.0; must be 0 or more"),
        (lambda: go(world=World(damping=(0.1, 0.1, 0.1))), "damping: got .*; must be two rates"),
        (lambda: go(world=World(floor=Floor(0.5, "inf"))), "friction: got 'inf'"),
        (lambda: go(dt=True), "dt: got True"),
        (lambda: go(start=state().astype(complex)), "state: got"),
    ],
)
def test_invalid_arguments_are_rejected(attempt, message):
    """With a ValueError that names the argument; a whole number of another type is accepted."""
    if message is None:
        assert attempt().shape == (256, 13)
    else:
        with pytest.raises(ValueError, match=message):
            attempt()


def go(steps=1, every=1, body=BODY, world=None, dt=1e-3, start=None):
    return reference_impl.simulate(state() if start is None else start, body, world or World(), dt, steps, every)


def test_inertia_of_collinear_points_is_rejected():
    """For either sign that rounding gives the moment about their line."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        points = np.outer(rng.normal(size=4), rng.normal(size=3))
        inertia = reference_impl.vertex_inertia(points - points.mean(axis=0), np.ones(4))
        with pytest.raises(ValueError, match="positive definite"):
            go(body=Body(4.0, inertia, points))
