"""Rotations, mass properties and mechanics compared with SciPy and with values by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from dropspin.scenarios import Trajectory, load, rotations
from dropspin.scenarios.bodies.inertia import is_diagonal, principal_axes
from dropspin.scenarios.mechanics import angular_momentum, energy, kinetic_energy, lowest_height

long_enough = arrays(float, 4, elements=st.floats(-1, 1)).filter(lambda q: np.linalg.norm(q) > 0.1)
quaternions = long_enough.map(lambda q: q / np.linalg.norm(q))
vectors = arrays(float, 3, elements=st.floats(-3, 3, allow_subnormal=False))


@given(quaternions, quaternions, vectors)
def test_rotations_match_scipy(p, q, v):
    """Product, rotation and its inverse, to 1e-14."""
    P, Q = Rotation.from_quat(p), Rotation.from_quat(q)
    np.testing.assert_allclose(rotations.rotate(p, v), P.apply(v), rtol=0, atol=1e-14)
    np.testing.assert_allclose(rotations.unrotate(p, rotations.rotate(p, v)), v, rtol=0, atol=1e-14)
    np.testing.assert_allclose(rotations.rotate(rotations.multiply(p, q), v), (P * Q).apply(v), rtol=0, atol=1e-14)


@given(quaternions, vectors.filter(lambda v: np.linalg.norm(v) > 0.1), st.floats(1e-12, 3.1))
def test_angle_between_orientations_is_accurate_and_ignores_the_sign(q, axis, angle):
    """From 1e-12 rad to nearly π, to 3e-15; q and -q are the same orientation."""
    turned = rotations.multiply(rotations.about(axis / np.linalg.norm(axis), np.array(angle)), q)
    assert rotations.angle_between_orientations(q, turned) == pytest.approx(angle, abs=3e-15)
    assert rotations.angle_between_orientations(q, -turned) == pytest.approx(angle, abs=3e-15)
    assert rotations.angle_between_orientations(q, -q) == 0.0


def test_angle_between_vectors_resolves_small_and_straight_angles():
    """The arc cosine would lose half the digits at both ends."""
    x = np.array([1.0, 0.0, 0.0])
    assert rotations.angle_between_vectors(x, np.array([1.0, 1e-12, 0.0])) == pytest.approx(1e-12, rel=1e-12)
    assert rotations.angle_between_vectors(x, -x) == pytest.approx(np.pi)


def body(**table):
    return load({"duration": 1.0, "body": table}).body


def test_inertia_of_each_keyword():
    """Solid, corner masses, eq 8 as printed, given moments; a ball."""
    box = {"shape": "box", "half_extents": [1.0, 2.0, 3.0], "mass": 6.0}
    np.testing.assert_allclose(np.diag(body(**box).inertia_tensor), [26, 20, 10], rtol=1e-15)
    np.testing.assert_allclose(np.diag(body(**box, inertia="vertices").inertia_tensor), [78, 60, 30], rtol=1e-15)
    np.testing.assert_allclose(np.diag(body(**box, inertia="note").inertia_tensor), [104, 80, 40], rtol=1e-15)
    np.testing.assert_allclose(np.diag(body(**box, inertia=[3, 4, 5]).inertia_tensor), [3, 4, 5], rtol=1e-15)
    np.testing.assert_allclose(body(shape="sphere", radius=0.5, mass=2.0).inertia_tensor, 0.2 * np.eye(3), rtol=1e-15)


@given(quaternions)
def test_principal_axes_of_diagonal_and_full_tensors(q):
    """The body axes in their order if the tensor is diagonal, else right-handed axes that diagonalise it."""
    moments = np.diag([3.0, 1.0, 2.0])
    own, axes = principal_axes(moments)
    assert (own.tolist(), axes.tolist()) == ([3.0, 1.0, 2.0], np.eye(3).tolist())
    R = Rotation.from_quat(q).as_matrix()
    turned = R @ moments @ R.T
    found, axes = principal_axes(0.5 * (turned + turned.T))
    np.testing.assert_allclose(axes @ np.diag(found) @ axes.T, turned, atol=1e-14)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    assert is_diagonal(moments)
    assert not is_diagonal(moments + 1e-300 * (np.ones((3, 3)) - np.eye(3)))


def test_vertices_are_centred_on_their_masses():
    """A dumb-bell of 1 and 3 kg, 4 m long, with a light cross bar: the centre is nearer to the heavy end."""
    points = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [3.0, 1.0, 0.0], [3.0, -1.0, 0.0]]
    found = body(shape="vertices", points=points, masses=[1.0, 3.0, 0.5, 0.5])
    assert found.mass == 5.0
    np.testing.assert_allclose(found.vertices[:, 0], [-3, 1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(found.inertia_tensor, np.diag([1.0, 12.0, 13.0]), atol=1e-14)
    assert found.resting_height == 0.0


def test_resting_height_of_a_solid_set_of_vertices():
    """The corners of a box have the resting height of the box."""
    corners = [[x, y, z] for x in (-1.0, 1.0) for y in (-2.0, 2.0) for z in (-3.0, 3.0)]
    assert body(shape="vertices", points=corners, mass=1.0).resting_height == pytest.approx(1.0, rel=1e-12)


def test_energy_momentum_and_height_by_hand():
    """A box of 2 kg moving at 3 m/s and turning at 4 rad/s about its y axis, 5 m up."""
    scene = load("drop-box-flat").model_copy(update={})
    states = np.array([[0, 5, 0, 0, 0, 0, 1, 3, 0, 0, 0, 4, 0]], dtype=float)
    motion = Trajectory.from_states(np.zeros(1), states)
    about_y = (0.1**2 + 0.25**2) / 3
    assert kinetic_energy(scene, motion)[0] == pytest.approx(0.5 * 9 + 0.5 * about_y * 16, rel=1e-15)
    np.testing.assert_allclose(angular_momentum(scene, motion)[0], [0, 4 * about_y, 0], atol=1e-16)
    assert energy(scene, motion)[0] == pytest.approx(0.5 * 9 + 0.5 * about_y * 16 + 9.8 * (5 - 0.1), rel=1e-15)
    assert lowest_height(scene, motion)[0] == pytest.approx(5 - 0.15, rel=1e-15)


def test_synchronised_energy_adds_the_velocity_lag():
    """By lag M g·v."""
    scene = load("drop-ball")
    states = np.array([[0, 1, 0, 0, 0, 0, 1, 0, -2, 0, 0, 0, 0]], dtype=float)
    motion = Trajectory.from_states(np.zeros(1), states, velocity_lag=0.01)
    raw, synchronised = (energy(scene, motion, flag)[0] for flag in (False, True))
    assert synchronised - raw == pytest.approx(0.01 * 9.8 * 2, rel=1e-12)
