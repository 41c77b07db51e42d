"""Contacts: impacts of several vertices, convergence, and the known faults at rest."""

import warnings

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dropspin import reference_impl
from dropspin.reference_impl import Body, Floor, Methods, World
from dropspin.reference_impl.floor_plane import contact_count, contact_offset
from dropspin.reference_impl.parameters import SEMI_AXES, pack, read_body, read_vector
from dropspin.reference_impl.quaternion import rotation_matrix
from dropspin.reference_impl.state import ORIENTATION, SPIN, VELOCITY
from dropspin.reference_impl.vectors import Quat

G = np.array([0.0, -9.8, 0.0])
STICKS = np.inf


def cube(half=0.5, mass=1.0, solid=False):
    points = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    masses = np.full(8, mass / 8)
    inertia = reference_impl.solid_box_inertia(mass, np.full(3, half)) if solid else reference_impl.vertex_inertia(points, masses)
    return Body(mass, inertia, points)


def approach_left_over(state, after, body):
    """The fastest approach [m/s] of a vertex that was below the floor, with the velocities after the contact."""
    R = Rotation.from_quat(state[ORIENTATION])
    offsets = R.apply(body.points)
    below = state[1] + offsets[:, 1] < 0
    velocities = after[VELOCITY] + np.cross(after[SPIN], offsets)
    return float(np.max(-velocities[below, 1], initial=0.0))


def random_contacts(n):
    rng = np.random.default_rng(11)
    body = cube(0.3)
    for k in range(n):
        # Half of them nearly flat, so that several vertices are below.
        q = Rotation.from_rotvec(rng.normal(size=3) * (0.02 if k % 2 else 1.0)).as_quat()
        offsets = Rotation.from_quat(q).apply(body.points)
        v, w = rng.normal(size=3) - [0, 2, 0], rng.normal(size=3) * 3
        yield body, np.concatenate([[0, -offsets[:, 1].min() - 0.02, 0], q, v, w])


def test_mean_contact_leaves_vertices_approaching():
    """Known fault: more than a fifth of the impacts with several vertices leave one approaching."""
    left, several = 0, 0
    for body, state in random_contacts(200):
        below = np.sum(state[1] + Rotation.from_quat(state[ORIENTATION]).apply(body.points)[:, 1] < 0)
        if below > 1:
            several += 1
            after = reference_impl.step(state, body, World(floor=Floor(0.5, STICKS)), 1e-6)
            left += approach_left_over(state, after, body) > 1e-6
    assert several > 50
    assert left / several > 0.2


@pytest.mark.sample(1)
@pytest.mark.parametrize("friction", [0.2, 1.0])
def test_sequential_friction_of_a_sliding_ball(friction):
    """Δv_t = -f (1 + e) |u_n| t, to 1e-9 in each direction."""
    ball = Body(2.0, reference_impl.solid_sphere_inertia(2.0, 0.1), np.zeros((1, 3)), (0.1, 0.1, 0.1))
    state = np.array([0, 0.1 - 1e-6, 0, 0, 0, 0, 1, 6.0, -1.0, 8.0, 0, 0, 0])
    for e, threshold in ((0.5, 0.0), (0.0, 2.0)):  # below the threshold there is no restitution
        floor = Floor(0.5, friction, threshold)
        after = reference_impl.step(state, ball, World(floor=floor), 1e-9, methods=Methods(law="coulomb", contact="sequential"))
        lost = friction * (1 + e)
        np.testing.assert_allclose(after[VELOCITY], [6.0 - 0.6 * lost, e, 8.0 - 0.8 * lost], rtol=0, atol=1e-9)


@pytest.mark.sample(2)
@pytest.mark.parametrize(("law", "friction"), [("normal", 0.0), ("coulomb", 0.4), ("coulomb", 1.0)])
@pytest.mark.parametrize("e", [0.0, 0.5])
@pytest.mark.filterwarnings("ignore:.*not solved")
def test_sequential_leaves_no_vertex_approaching(law, friction, e):
    """No submerged vertex approaches faster than 1e-9 m/s after a step that converged; no energy is added at restitution 0."""
    methods = Methods(law=law, contact="sequential")
    for body, state in random_contacts(200):
        simulator = reference_impl.Simulator(body, World(floor=Floor(e, friction)), 1e-9, methods)
        after = simulator.run(state, 1)[1]
        if simulator.unsolved_steps:
            assert e > 0.0  # at restitution 0 all converge
            continue
        assert approach_left_over(state, after, body) <= 1e-9
        if e > 0.0:
            continue
        R = Rotation.from_quat(state[ORIENTATION]).as_matrix()
        tensor = R @ body.inertia @ R.T
        energies = [0.5 * s[VELOCITY] @ s[VELOCITY] + 0.5 * s[SPIN] @ tensor @ s[SPIN] for s in (state, after)]
        assert energies[1] <= energies[0] * (1 + 1e-9)


def test_sequential_warns_if_it_did_not_converge():
    """Infinite friction at several vertices need not have a solution; each step converges or warns."""
    from dropspin.reference_impl import UnsolvedContact

    methods, unsolved = Methods(law="coulomb", contact="sequential"), 0
    for body, state in random_contacts(200):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            after = reference_impl.step(state, body, World(floor=Floor(0.0, STICKS)), 1e-9, methods=methods)
        if caught:
            unsolved += 1
            assert caught[0].category is UnsolvedContact
            assert "not solved in 1 of 1 steps" in str(caught[0].message)
        else:
            assert approach_left_over(state, after, body) <= 1e-9
    assert 0 < unsolved < 10


def test_sequential_friction_is_opposite_to_the_slip():
    """A flat box that turns on four corners: the moment of friction is f M g ρ to 1e-9, although a corner responds unequally in x and z."""
    points = np.array([[x, y, z] for x in (-0.3, 0.3) for y in (-0.1, 0.1) for z in (-0.2, 0.2)])
    body = Body(1.0, reference_impl.solid_box_inertia(1.0, np.array([0.3, 0.1, 0.2])), points)
    state = np.array([0, 0.1 - 1e-6, 0, 0, 0, 0, 1, 0, 0, 0, 0, 10.0, 0], dtype=float)
    after = reference_impl.step(state, body, World(G, Floor(0.0, 0.3)), 1e-3, methods=Methods(law="coulomb", contact="sequential"))
    slowing = 0.3 * 9.8 * np.hypot(0.3, 0.2) / body.inertia[1, 1]
    np.testing.assert_allclose(after[SPIN], [0.0, 10.0 - 1e-3 * slowing, 0.0], atol=1e-9)


def test_sequential_flat_impact_is_straight_up():
    """Four corners at once, restitution 0.5: no spin."""
    body = cube(0.1)
    state = np.array([0, 0.099, 0, 0, 0, 0, 1, 0, -2.0, 0, 0, 0, 0], dtype=float)
    after = reference_impl.step(state, body, World(floor=Floor(0.5, 0.0)), 1e-9, methods=Methods(law="normal", contact="sequential"))
    assert after[8] == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(after[SPIN], 0.0, atol=1e-8)


def test_dropped_cube_sinks():
    """Known fault: a tilted cube dropped at restitution 0 sinks by more than 0.03 m in 300 s at 1/60 s."""
    body, world = cube(0.5), World(G, Floor(0.0, STICKS))
    q = Rotation.from_rotvec([0.1, 0.05, 0.2]).as_quat()
    rows = reference_impl.simulate(np.concatenate([[0, 1.0, 0], q, np.zeros(6)]), body, world, 1 / 60, 18_000, 100)
    assert rows[-60:, 1].max() < 0.5 - 0.03


@pytest.mark.parametrize("mu", [0.6, 0.8, 0.9, 0.95])
def test_limit_cycle_of_a_lively_ball(mu):
    """Known fault: for µ above 1/2 the literal bouncer never rests but strikes at u* = g h / (1 - µ), to 2 %."""
    h = 1 / 60
    ball = Body(1.0, reference_impl.solid_sphere_inertia(1.0, 0.1), np.zeros((1, 3)), (0.1, 0.1, 0.1))
    state = np.array([0, 1.1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0], dtype=float)
    rows = reference_impl.simulate(state, ball, World(G, Floor(mu, 0.0)), h, 120_000)
    v = rows[-20_000:, 8]
    impacts = -v[:-1][(v[1:] > 0) & (v[:-1] < 0)] + 9.8 * h
    assert impacts.max() == pytest.approx(9.8 * h / (1 - mu), rel=0.02)


def test_mean_contact_has_no_torsional_friction():
    """Known fault: a flat box that sticks at its mean contact point spins about the vertical for ever."""
    body, world = cube(0.2), World(G, Floor(0.0, STICKS))
    state = np.array([0, 0.2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 10.0, 0], dtype=float)
    rows = reference_impl.simulate(state, body, world, 1e-3, 10_000, 10_000)
    assert rows[-1, 11] == pytest.approx(10.0, rel=1e-9)


def test_mean_contact_turns_a_sliding_flat_box():
    """Known fault: eq 17 at the mean point of a flat sliding box: v_x → 1, ω_z = -2 in one step, for a cube of corner masses."""
    body = cube(0.5)
    state = np.array([0, 0.5 - 1e-6, 0, 0, 0, 0, 1, 3.0, -1e-3, 0, 0, 0, 0], dtype=float)
    after = reference_impl.step(state, body, World(floor=Floor(0.0, STICKS)), 1e-6)
    share = 1 / (1 + 1.0 * 0.25 / body.inertia[2, 2])
    assert after[7] == pytest.approx(3.0 * (1 - share), rel=1e-9)
    assert after[7] + 0.5 * after[12] == pytest.approx(0.0, abs=1e-12)


def test_fast_small_body_stays_below_the_floor():
    """Known fault: a cube of 10 cm dropped from 5 m at 1/60 s is completely below the floor after one step, and stays there."""
    body = cube(0.05)
    state = np.array([0, 5.04, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0], dtype=float)
    heights = reference_impl.simulate(state, body, World(G, Floor(0.0, STICKS)), 1 / 60, 600)[:, 1]
    assert heights[-1] < -0.05
    assert np.ptp(heights[-60:]) < 1e-2


@pytest.mark.parametrize("half", [0.01, 0.5, 20.0])
def test_corner_of_a_body_of_any_size_strikes_when_it_reaches_the_floor(half):
    """A cube that falls slowly on a corner, in its own lengths: it is stopped in the step after the corner is below the floor."""
    body = cube(half)
    orientation = Rotation.align_vectors([0.0, -1.0, 0.0], [1.0, 1.0, 1.0])[0].as_quat()
    height, dt = np.sqrt(3.0) * half, 1e-3
    state = np.array([0, 1.01 * height, 0, *orientation, 0, -half, 0, 0, 0, 0], dtype=float)
    rows = reference_impl.simulate(state, body, World(floor=Floor(0.0, STICKS)), dt, 40)
    struck = np.flatnonzero(rows[:, 8] > -half)[0]
    assert rows[struck - 1, 1] < height <= rows[struck - 2, 1] + 1e-12 * height


def test_points_of_a_rim_divide_it_into_three_from_the_lowest():
    """Of a cylinder at random orientations: on the rim, 120° apart, the first as low as the disc is; of a level disc too."""
    packed = pack(Body(1.0, np.eye(3), np.array([[0.0, -0.3, 0.0], [0.0, 0.3, 0.0]]), (0.2, 0.0, 0.2)), World(), 1.0)
    body = read_body(packed.columns[0], packed.points[0], read_vector(packed.columns[0], SEMI_AXES), True, None)
    assert contact_count(body) == 6
    for q in (np.array([0.0, 0.0, 0.0, 1.0]), *np.random.default_rng(2).normal(size=(5, 4))):
        R = rotation_matrix(Quat(*(q / np.linalg.norm(q)).tolist()))
        axes = np.array([[*R.row1], [*R.row2], [*R.row3]])
        for vertex in range(2):
            centre = axes @ packed.points[0][vertex]
            arms = np.array([[*contact_offset(R, body, 3 * vertex + place)] for place in range(3)]) - centre
            np.testing.assert_allclose(np.linalg.norm(arms, axis=1), 0.2, rtol=1e-14)
            np.testing.assert_allclose(arms @ axes[:, 1], 0.0, atol=1e-15)
            np.testing.assert_allclose(arms.sum(axis=0), 0.0, atol=1e-15)
            assert arms[0, 1] == pytest.approx(-0.2 * np.hypot(axes[1, 0], axes[1, 2]), abs=1e-15)
