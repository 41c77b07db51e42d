"""Each numbered equation of the lecture note by itself, compared with another source or with its defining property."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import Rotation

from dropspin import reference_impl
from dropspin.reference_impl.body import Floor, World
from dropspin.reference_impl.contacts.mean import apply_impulse
from dropspin.reference_impl.contacts.response import impulse_response
from dropspin.reference_impl.laws import note
from dropspin.reference_impl.parameters import pack, read_body
from dropspin.reference_impl.quaternion import from_matrix, normalise, product, rotation_matrix
from dropspin.reference_impl.vectors import Mat3, Quat, Vec3, cross, cross_matrix, dot, solve

numbers = st.floats(-3, 3, allow_subnormal=False)
vectors = arrays(float, 3, elements=numbers)
quaternions = arrays(float, 4, elements=numbers).filter(lambda q: np.linalg.norm(q) > 0.1).map(lambda q: q / np.linalg.norm(q))
EPS = np.finfo(float).eps


def mat3(m) -> Mat3:
    return Mat3(*(Vec3(*map(float, row)) for row in m))


def quat(q) -> Quat:
    return Quat(*map(float, q))


def vec3(v) -> Vec3:
    return Vec3(*map(float, v))


@given(arrays(float, 4, elements=numbers).filter(lambda q: np.linalg.norm(q) > 1e-3))
def test_eq3_normalised_quaternion_has_unit_length(q):
    """Eq 3, to 2 eps."""
    assert abs(np.linalg.norm(normalise(quat(q))) - 1.0) <= 2 * EPS


@given(quaternions)
def test_eq4_rotation_matrix_matches_scipy(q):
    """To 8 eps of 1 (measured: 2.2e-16)."""
    np.testing.assert_allclose(np.array(rotation_matrix(quat(q))), Rotation.from_quat(q).as_matrix(), rtol=0, atol=8 * EPS)


@given(quaternions, quaternions)
def test_eq5_product_rotates_by_the_second_then_by_the_first(p, q):
    """As the composition of SciPy's rotations."""
    found = Rotation.from_quat(product(quat(p), quat(q))).as_matrix()
    np.testing.assert_allclose(found, (Rotation.from_quat(p) * Rotation.from_quat(q)).as_matrix(), rtol=0, atol=8 * EPS)


def test_eq2_and_eq8_by_hand():
    """A unit cube of 1 kg: corner masses 1/8 give 1/2, unit masses (eq 8 as printed) 4, the solid 1/6 kg m²."""
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    masses = np.full(8, 0.125)
    assert reference_impl.total_mass(masses) == 1.0
    np.testing.assert_allclose(reference_impl.vertex_inertia(corners, masses), 0.5 * np.eye(3), rtol=0, atol=EPS)
    np.testing.assert_allclose(reference_impl.vertex_inertia(corners, np.ones(8)), 4.0 * np.eye(3), rtol=0, atol=8 * EPS)
    np.testing.assert_allclose(reference_impl.solid_box_inertia(1.0, np.full(3, 0.5)), np.eye(3) / 6, rtol=4 * EPS)


@given(arrays(float, (5, 3), elements=numbers), arrays(float, 5, elements=st.floats(0.1, 2)))
def test_eq8_gives_the_kinetic_energy_of_its_masses(points, masses):
    """ω·Iω/2 is the kinetic energy of the masses that turn with ω."""
    w = np.array([0.3, -0.7, 0.5])
    energy = 0.5 * np.sum(masses * np.sum(np.cross(w, points) ** 2, axis=1))
    found = 0.5 * w @ reference_impl.vertex_inertia(points, masses) @ w
    assert found == pytest.approx(energy, rel=1e-12, abs=1e-12)


def test_inertia_of_solid_box_and_ball():
    """The integrals of x² + y²: m/3 (a² + b²) and 2/5 m R²."""
    box = reference_impl.solid_box_inertia(3.0, np.array([1.0, 2.0, 3.0]))
    np.testing.assert_allclose(np.diag(box), [13.0, 10.0, 5.0], rtol=4 * EPS)
    np.testing.assert_allclose(reference_impl.solid_sphere_inertia(2.0, 0.5), 0.2 * np.eye(3), rtol=4 * EPS)


@given(vectors, vectors)
def test_eq14_cross_matrix(r, j):
    """r* j = r × j, to the last bit except for the sign of zero."""
    np.testing.assert_array_equal(np.array(cross_matrix(vec3(r)) @ vec3(j)), np.cross(r, j))
    np.testing.assert_array_equal(np.array(cross(vec3(r), vec3(j))), np.cross(r, j))


@given(arrays(float, (3, 3), elements=numbers), vectors)
def test_solve_inverts_the_product(m, b):
    """Cramer's rule on well-conditioned matrices, as K is."""
    m = m @ m.T + np.eye(3)
    np.testing.assert_allclose(m @ np.array(solve(mat3(m), vec3(b))), b, rtol=0, atol=1e-13 * np.linalg.cond(m) * 10)


def box_in_the_air(q):
    half = np.array([0.1, 0.2, 0.4])
    mass = 1.7
    inertia = reference_impl.solid_box_inertia(mass, half)
    packed = pack(reference_impl.Body(mass, inertia, np.array([half])), World(), 1.0)
    body = read_body(packed.columns[0], packed.points[0], None, False, None)
    R = Rotation.from_quat(q).as_matrix()
    return body, R, R @ np.linalg.inv(inertia) @ R.T


@given(quaternions, vectors, vectors)
def test_eq15_k_gives_the_velocity_change_of_the_contact_point(q, r, j):
    """K j is the change of v + ω × r after eq 12 with impulse j."""
    body, _, inverse = box_in_the_air(q)
    K = impulse_response(vec3(r), mat3(inverse), body.mass)
    change = j / body.mass + np.cross(inverse @ np.cross(r, j), r)
    np.testing.assert_allclose(np.array(K @ vec3(j)), change, rtol=0, atol=1e-12 * max(1.0, np.abs(change).max()))


@given(quaternions, vectors.filter(lambda r: np.linalg.norm(r) > 0.1), vectors, vectors, st.booleans())
def test_eq11_and_eq16_hold_after_the_impulse(q, r, v, w, sticking):
    """The contact point leaves as prescribed: v - (1 + µ) v_n N without friction, -µ v_n N when it sticks."""
    body, R, inverse = box_in_the_air(q)
    mu = 0.6
    v_after, w_after = apply_impulse(vec3(r), mat3(R), vec3(v), vec3(w), body, Floor(mu, np.inf if sticking else 0.0), note.impulse)
    before, after = v + np.cross(w, r), np.array(v_after) + np.cross(w_after, r)
    up = np.array([0.0, 1.0, 0.0])
    wanted = -mu * before[1] * up if sticking else before - (1 + mu) * before[1] * up
    scale = 1 + np.abs(v).max() + np.abs(w).max() * np.abs(r).max()
    np.testing.assert_allclose(after, wanted, rtol=0, atol=1e-11 * scale)
    # Eq 12: one impulse at r changes angular momentum by r × M Δv.
    turned = np.linalg.inv(inverse) @ (np.array(w_after) - w)
    np.testing.assert_allclose(turned, np.cross(r, body.mass * (np.array(v_after) - v)), rtol=0, atol=1e-11 * scale)


def test_restitution_is_0_below_the_rest_speed():
    """Section 3.2: below rest_speed the rebound is 0, above it is µ."""
    body, R, _ = box_in_the_air(np.array([0.0, 0.0, 0.0, 1.0]))
    r = Vec3(0.0, -0.2, 0.0)
    floor = Floor(0.5, np.inf, 0.1)
    slow, _ = apply_impulse(r, mat3(R), Vec3(0.0, -0.09, 0.0), Vec3(0.0, 0.0, 0.0), body, floor, note.impulse)
    fast, _ = apply_impulse(r, mat3(R), Vec3(0.0, -0.11, 0.0), Vec3(0.0, 0.0, 0.0), body, floor, note.impulse)
    assert slow.y == pytest.approx(0.0, abs=EPS)
    assert fast.y == pytest.approx(0.055, rel=1e-14)
    assert dot(fast, Vec3(1.0, 0.0, 1.0)) == 0.0


@pytest.mark.parametrize("largest", range(4))
def test_quaternion_of_a_rotation_matrix_is_exact_whichever_component_is_the_largest(largest):
    rng = np.random.default_rng(largest)
    for _ in range(20):
        q = rng.uniform(-0.5, 0.5, 4)
        q[largest] = 1.0
        q /= np.linalg.norm(q)
        found = np.array(from_matrix(rotation_matrix(quat(q))))
        np.testing.assert_allclose(np.sign(found @ q) * found, q, rtol=0, atol=4 * EPS)
