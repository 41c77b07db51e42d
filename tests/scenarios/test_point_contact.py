"""Bodies that roll or slide on one point: 25 digits by another route, steady rolling on a rim, and small oscillations."""

import math

import mpmath as mp
import numpy as np
import pytest
from support.scenes import on_one_point, rolling_disc

from dropspin.scenarios import truth_for
from dropspin.scenarios.mechanics import energy
from dropspin.scenarios.rotations import about, multiply, rotate, rotation_vector

G = 9.8
X, Y, Z = np.eye(3)
ELLIPSOID = {"shape": "ellipsoid", "half_extents": [0.2, 0.1, 0.15], "mass": 2.0}
OFFSET = {"shape": "sphere", "radius": 0.1, "mass": 2.0, "center_of_mass": [0.01, -0.03, 0.005], "inertia": [5e-3, 6e-3, 7e-3]}
CAPSULE = {"shape": "capsule", "radius": 0.1, "half_length": 0.2, "mass": 2.0}
TUMBLER = {"mass": 2.0, "radius": 0.1, "half_length": 0.2, "center_of_mass": [0.0, 0.05, 0.03], "inertia": [3e-2, 6e-3, 3e-2]}
LEANING = about(np.array([0.6, 0.0, 0.8]), np.array(0.3))
ON_ITS_SIDE = about(X, np.array(0.5 * math.pi))


def skew(a):
    return mp.matrix([[0, -a[2], a[1]], [a[2], 0, -a[0]], [-a[1], a[0], 0]])


def newton_euler(scene, *, moves_in_the_body=True):
    """The rates of a state, in the world frame, with the force of the floor as an unknown beside the accelerations.

    The ellipsoid about the vertex is the matrix E, whose rate is Ω E - E Ω; the constraint is differentiated once.
    """
    body, rows = scene.body, [1] if scene.floor.friction == "none" else [0, 1, 2]
    lowest = np.argmin(rotate(np.array(scene.start.orientation), body.vertices)[:, 1])
    vertex, inertia, mass = (mp.matrix(one.tolist()) for one in (body.vertices[lowest], body.inertia_tensor, body.mass * np.eye(3)))
    squares, up, gravity = mp.diag([mp.mpf(a) ** 2 for a in body.semi_axes.tolist()]), mp.matrix(Y.tolist()), mp.matrix(scene.acceleration)

    def rates(state):
        x, y, z, s = state[3:7]
        length, turn = x * x + y * y + z * z + s * s, skew([x, y, z])
        R = mp.eye(3) + 2 * (s * turn + turn * turn) / length
        spin = mp.matrix(state[10:13])
        W, E, to_vertex, tensor = skew(spin), R * squares * R.T, R * vertex, R * inertia * R.T
        rate, depth = W * E - E * W, mp.sqrt(E[1, 1]) or mp.mpf(1)
        arm = to_vertex - E * up / depth
        moved = W * to_vertex + E * up * rate[1, 1] / (2 * depth**3) - rate * up / depth if moves_in_the_body else W * arm
        system, right = mp.zeros(6 + len(rows)), mp.zeros(6 + len(rows), 1)
        system[0:3, 0:3], system[3:6, 3:6] = mass, tensor
        right[0:3, 0], right[3:6, 0] = mass * gravity, -W * tensor * spin
        for n, row in enumerate(rows):
            system[row, 6 + n], system[6 + n, row] = -1, 1
            for k in range(3):
                system[3 + k, 6 + n] = -skew(arm)[k, row]
                system[6 + n, 3 + k] = -skew(arm)[row, k]
            right[6 + n] = -(W * moved)[row]
        a, b, c = spin
        turning = [s * a + b * z - c * y, s * b + c * x - a * z, s * c + a * y - b * x, -(a * x + b * y + c * z)]
        return [*state[7:10], *(part / 2 for part in turning), *mp.lu_solve(system, right)[:6]]

    return rates


def extrapolated(rates, start, end, steps, columns=11):
    """The state at the end, by Gragg's midpoint rule and Aitken-Neville extrapolation (Bulirsch & Stoer 1966), and its last correction."""
    state, correction = [mp.mpf(value) for value in start], 0
    for _ in range(steps):
        table = []
        for j in range(1, columns + 1):
            h, before = mp.mpf(end) / steps / (2 * j), state
            now = [a + h * b for a, b in zip(state, rates(state), strict=True)]
            for _ in range(2 * j - 1):
                before, now = now, [a + 2 * h * b for a, b in zip(before, rates(now), strict=True)]
            row = [[(a + b + h * c) / 2 for a, b, c in zip(now, before, rates(now), strict=True)]]
            for k in range(1, j):
                factor = (mp.mpf(j) / (j - k)) ** 2 - 1
                row.append([a + (a - b) / factor for a, b in zip(row[-1], table[-1][k - 1], strict=True)])
            table.append(row)
        state, correction = table[-1][-1], max(correction, *(abs(a - b) for a, b in zip(*table[-1][-2:], strict=True)))
    return np.array(state, dtype=float), correction


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    "scene",
    [
        on_one_point(ELLIPSOID, LEANING, (1.0, 2.0, -1.5), "none", slip=(0.3, 0.0, -0.2)),
        on_one_point(ELLIPSOID, LEANING, (1.0, 2.0, -1.5), gravity=(1.0, -G, 0.5)),
        on_one_point(OFFSET, LEANING, (3.0, 1.0, -2.0)),
        on_one_point(CAPSULE, LEANING, (2.0, 5.0, 1.0)),
        rolling_disc(0.7, 12.0, nutation=0.5, centre=-0.01)[0],
    ],
    ids=["smooth ellipsoid", "rough ellipsoid on a slope", "offset ball", "end of a capsule", "nutating disc"],
)
def test_motion_is_that_of_an_integration_with_25_digits(scene):
    """After .03 s to 1e-13 of each size; with a contact point that is fixed in the body, the integration differs by more than 1e-5."""
    truth = truth_for(scene)
    assert truth.name == f"{'smooth' if scene.floor.friction == 'none' else 'rough'}-contact"
    with mp.workdps(30):
        expected, correction = extrapolated(newton_euler(scene), scene.initial_state, 0.03, 1)
        faulty, _ = extrapolated(newton_euler(scene, moves_in_the_body=False), scene.initial_state, 0.03, 1, 4)
    assert correction < 1e-16
    np.testing.assert_allclose(truth([0.03]).states[0], expected, rtol=1e-13, atol=1e-13)
    assert np.abs(faulty - expected).max() > 1e-5


@pytest.mark.sample(1)
@pytest.mark.parametrize("friction", ["none", "infinite"])
def test_a_body_on_a_corner_moves_as_in_an_integration_with_25_digits(friction):
    """With three different moments about axes that are not those of the box; the corner rests, or slides without friction."""
    body = {"shape": "box", "half_extents": [0.1, 0.15, 0.2], "mass": 2.0, "inertia": [0.03, 0.025, 0.02, 2e-3, 1e-3, -1e-3]}
    scene = on_one_point(body, about(np.array([0.48, 0.6, 0.64]), np.array(0.9)), (0.5, 3.0, -1.0), friction)
    with mp.workdps(30):
        expected, _ = extrapolated(newton_euler(scene), scene.initial_state, 0.01, 1)
    np.testing.assert_allclose(truth_for(scene)([0.01]).states[0], expected, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("friction", ["none", "infinite"])
def test_energy_is_constant_and_the_contact_point_obeys_its_constraint(friction):
    scene = on_one_point(OFFSET, LEANING, (3.0, 1.0, -2.0), friction)
    motion = truth_for(scene)(np.linspace(0.0, 1.0, 60))
    arms = np.array([scene.body.lowest(orientation, 0.0)[0] for orientation in motion.orientation])
    moving = motion.velocity + np.cross(motion.angular_velocity, arms)
    assert np.ptp(energy(scene, motion)) < 1e-13
    assert np.abs(motion.position[:, 1] + arms[:, 1]).max() < 1e-15
    assert np.abs(moving if friction == "infinite" else moving[:, 1]).max() < 1e-14


def stiffness(angle, precession, spin, half_length=0.02, radius=0.1):
    """κ of small changes θ'' = -κ θ of the angle of a disc in steady rolling, by derivatives of the equations along the nutation."""
    c, a, d, R = 0.5 * radius**2, 0.25 * radius**2 + half_length**2 / 3.0, half_length, radius

    def rates(theta, across, along):
        """dω_u/dθ, dω_n/dθ and θ''; u points down in the face, and n along the axis."""
        cot = 1 / mp.tan(theta)
        system = mp.matrix([[c + R**2, R * d], [-d * c / R, a]])
        changes = mp.lu_solve(system, mp.matrix([-R * across * (R + d * cot), -(c * along + a * across * cot)]))
        moment = across**2 * (a * cot + d * (R + d * cot)) + along * across * (c + R * (R + d * cot))
        return changes[1], changes[0], (moment - G * (R * mp.cos(theta) - d * mp.sin(theta))) / (a + R**2 + d**2)

    across, along = -precession * math.sin(angle), spin
    slope_u, slope_n, _ = rates(mp.mpf(angle), across, along)
    return -float(mp.diff(lambda e: rates(angle + e, across + e * slope_u, along + e * slope_n)[2], 0))


STEADY = [(0.5, None, 0.02), (0.2, None, 1e-5), (1.0, 8.0, 0.02), (1.0, -20.0, 0.03), (0.7, 15.0, 0.02)]


@pytest.mark.sample(1)
@pytest.mark.parametrize(("angle", "precession", "half_length"), STEADY)
def test_steady_rolling_on_a_rim(angle, precession, half_length):
    """The angle stays to 1e-12, and the precession has its rate; the centre rests or goes round in a circle; the motion is stable."""
    scene, rate, spin = rolling_disc(angle, precession, half_length, duration=0.5)
    truth, t = truth_for(scene), np.linspace(0.0, 0.5, 40)
    motion = truth(t)
    axes = rotate(motion.orientation, Y)
    assert (truth.name, truth.horizon) == ("rough-contact", 0.5)
    assert stiffness(angle, rate, spin, half_length) > 0.0
    np.testing.assert_allclose(axes[:, 1], math.cos(angle), rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.unwrap(np.arctan2(-axes[:, 2], axes[:, 0])), rate * t, rtol=0, atol=1e-11)
    way = rate * half_length * math.sin(angle) - spin * 0.1
    np.testing.assert_allclose(
        np.linalg.norm(motion.velocity, axis=1), abs(way), rtol=0, atol=0.1 * 1e-11
    )  # as the precession, times the radius
    if precession is None:
        assert np.ptp(motion.position, axis=0).max() < 1e-13


def test_eulers_disc_without_thickness_has_the_known_rate():
    """Ω² = 4 g/(R sin θ) of a solid thin disc, M g R/(A sin θ) in general; Routh, art. 244."""
    _, rate, spin = rolling_disc(0.2, None, 1e-9)
    assert rate**2 == pytest.approx(4.0 * G / (0.1 * math.sin(0.2)), rel=1e-7)
    assert abs(spin) < 1e-6


def test_a_disturbed_disc_nutates_at_the_rate_of_its_stability():
    """The period of the angle is 2π/√κ, to the square of its amplitude."""
    scene, rate, spin = rolling_disc(0.7, 15.0, nutation=1e-4, duration=1.0)
    t = np.linspace(0.0, 1.0, 4001)
    lean = np.arccos(rotate(truth_for(scene)(t).orientation, Y)[:, 1])
    turns = t[1:-1][(np.diff(lean)[:-1] > 0.0) & (np.diff(lean)[1:] <= 0.0)]
    assert len(turns) > 1
    period = (turns[-1] - turns[0]) / (len(turns) - 1)
    assert period == pytest.approx(2.0 * math.pi / math.sqrt(stiffness(0.7, rate, spin)), rel=1e-3)


def test_unstable_rolling_is_known_until_a_disturbance_has_grown():
    """At √-κ, about ln(1e4) = 9.2 times its inverse."""
    scene, rate, spin = rolling_disc(1.2, 3.0, duration=4.0)
    grows = math.sqrt(-stiffness(1.2, rate, spin))
    truth = truth_for(scene)
    assert "amplifies small differences" in truth.ends
    assert 0.5 * math.log(1e4) / grows < truth.horizon < 1.5 * math.log(1e4) / grows


def test_a_disc_rolls_steadily_only_if_friction_suffices():
    """The centripetal force, |Ω v|/g of the weight."""
    _, rate, spin = rolling_disc(1.0, 8.0)
    needed = abs(rate * (rate * 0.02 * math.sin(1.0) - spin * 0.1)) / G
    assert truth_for(rolling_disc(1.0, 8.0, friction=1.0001 * needed, duration=0.2)[0]).horizon == 0.2
    assert truth_for(rolling_disc(1.0, 8.0, friction=0.9999 * needed, duration=0.2)[0]) is None


ROCKING = [
    ({**ELLIPSOID}, np.array([0.0, 0.0, 0.0, 1.0]), X, 0.1, 0.15**2 / 0.1),
    ({**ELLIPSOID}, np.array([0.0, 0.0, 0.0, 1.0]), Z, 0.1, 0.2**2 / 0.1),
    (OFFSET | {"center_of_mass": [0.0, -0.03, 0.0]}, np.array([0.0, 0.0, 0.0, 1.0]), X, 0.07, 0.1),
    (TUMBLER | {"shape": "cylinder"}, ON_ITS_SIDE, Z, 0.07, 0.1),
    (TUMBLER | {"shape": "capsule"}, ON_ITS_SIDE, Z, 0.07, 0.1),
    ({**CAPSULE, "center_of_mass": [0.0, -0.21, 0.0], "inertia": [4e-3, 3e-3, 4e-3]}, np.array([0.0, 0.0, 0.0, 1.0]), X, 0.09, 0.1),
]


@pytest.mark.sample(2)
@pytest.mark.parametrize("friction", ["none", "infinite"])
@pytest.mark.parametrize(("body", "rest", "axis", "height", "curvature"), ROCKING)
def test_small_oscillations_have_their_frequency_up_to_the_square_of_the_amplitude(body, rest, axis, height, curvature, friction):
    """The deviation from a cos(p t), over a, falls by 4 as a is halved: p² = M g (ρ - h)/(I + M h²), without M h² on a smooth floor."""
    deviations, t = [], np.linspace(0.0, 0.4, 40)
    for amplitude in (0.02, 0.01):
        scene = on_one_point(body, multiply(about(axis, np.array(amplitude)), rest), friction=friction, duration=0.4)
        inertia = axis @ rotate(rest, scene.body.inertia_tensor @ rotate(rest * [-1, -1, -1, 1], axis))
        share = inertia / 2.0 + (height**2 if friction == "infinite" else 0.0)
        angle = rotation_vector(rest, truth_for(scene)(t).orientation) @ axis
        deviations.append(np.abs(angle / amplitude - np.cos(math.sqrt(G * (curvature - height) / share) * t)).max())
    assert 0.0 < deviations[0] < 30.0 * 0.02**2
    assert math.log2(deviations[0] / deviations[1]) == pytest.approx(2.0, abs=0.1)


def test_bodies_at_rest_where_they_can_lie_stay_there():
    """The bounce ladder of no height; a body at rest where it falls over is known until a disturbance has grown."""
    lying = on_one_point(OFFSET | {"center_of_mass": [0.0, -0.03, 0.0]}, [0.0, 0.0, 0.0, 1.0])
    assert truth_for(lying).name == "bounce-ladder"
    assert truth_for(lying).horizon == 1.0
    upright = truth_for(on_one_point(ELLIPSOID, about(Z, np.array(0.5 * math.pi)), duration=3.0))
    assert 0.3 < upright.horizon < 3.0
    assert "amplifies" in upright.ends


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ("scene", "ends"),
    [
        (on_one_point({**ELLIPSOID, "half_extents": [0.3, 0.1, 0.1]}, about(Z, np.array(0.3)), (0.0, 0.0, 14.0), duration=0.3), "pull"),
        (on_one_point(ELLIPSOID, [0.0, 0.0, 0.0, 1.0], (0.0, 0.0, 5.0), 0.3), "slips"),
        (on_one_point({**CAPSULE, "shape": "cylinder"}, about(Z, np.array(1.0))), "another part"),
        (on_one_point({**CAPSULE, "shape": "cylinder"}, about(Z, np.array(0.2))), "another part"),
    ],
)
def test_a_motion_ends_where_its_contact_changes(scene, ends):
    truth = truth_for(scene)
    assert truth.name == "rough-contact"
    assert 0.0 < truth.horizon < scene.duration
    assert ends in truth.ends


@pytest.mark.parametrize(
    "scene",
    [
        on_one_point(ELLIPSOID, LEANING, slip=(0.1, 0.0, 0.0)),
        on_one_point(ELLIPSOID, LEANING, friction="none", slip=(0.0, 0.1, 0.0)),
        on_one_point(TUMBLER | {"shape": "cylinder"}, ON_ITS_SIDE, (0.0, 0.1, 1.0)),
        on_one_point({**TUMBLER, "shape": "capsule", "center_of_mass": [0.0, 0.25, 0.01]}, ON_ITS_SIDE, (0.0, 0.0, 1.0)),
        on_one_point(ELLIPSOID, LEANING, gravity=(0.0, G, 0.0)),
    ],
)
def test_other_motions_are_no_point_contact(scene):
    """A point that slips, one that rises, a cylinder that leaves its course, a capsule whose one end lifts, and a body that flies off."""
    truth = truth_for(scene)
    assert truth is None or "contact" not in truth.name
