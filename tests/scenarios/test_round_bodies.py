"""Capsules, cylinders, ellipsoids and offset centres of mass: mass properties, lowest points, contacts and impacts in 25 digits."""

import math

import mpmath as mp
import numpy as np
import pytest
from scipy.optimize import brentq

from dropspin.scenarios import SceneError, Trajectory, load, truth_for
from dropspin.scenarios.bodies import SHAPES
from dropspin.scenarios.mechanics import lowest_height
from dropspin.scenarios.rotations import about, multiply, rotate
from dropspin.scenarios.state import SPIN, UP
from dropspin.scenarios.truths.contact_search import ContactSearch
from dropspin.scenarios.truths.flight import flight_states

G = 9.8
R, H = 0.1, 0.25
SEMI_AXES = (0.1, 0.25, 0.17)
CAPSULE = {"shape": "capsule", "radius": R, "half_length": H, "mass": 2.0}
CYLINDER = {"shape": "cylinder", "radius": R, "half_length": H, "mass": 2.0}
ELLIPSOID = {"shape": "ellipsoid", "half_extents": list(SEMI_AXES), "mass": 2.0}
OFFSET = {"shape": "sphere", "radius": R, "mass": 2.0, "center_of_mass": [0.0, 0.03, 0.0], "inertia": [8e-3, 7e-3, 8e-3]}
ROUND = {"capsule": CAPSULE, "cylinder": CYLINDER, "ellipsoid": ELLIPSOID, "offset": OFFSET}
LYING = about(np.array([1.0, 0.0, 0.0]), np.array(0.5 * math.pi)).tolist()
"""The orientation in which the body's y axis is along z."""
FALLEN = [0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)]
"""The orientation in which its x axis is upright."""


def scene(body, friction="none", restitution=0.5, duration=1.0, gravity=(0.0, -G, 0.0), **start):
    floor = {"restitution": restitution, "friction": friction}
    return load({"duration": duration, "body": body, "start": start, "gravity": {"acceleration": list(gravity)}, "floor": floor})


def of_revolution(radius, low, high, density):
    """Mass, moment about the axis y and moment across it of discs of a radius at each height, or of their rims."""
    disc = density == "solid"

    def integral(of):
        return mp.quad(of, [low, *([-H, H] if low < -H else []), high])

    def weight(y):
        r = radius(y)
        return mp.pi * r**2 if disc else 2 * mp.pi * r * mp.sqrt(1 + mp.diff(radius, y) ** 2)

    share = mp.mpf(1) / 2 if disc else mp.mpf(1)
    mass = integral(weight)
    along = integral(lambda y: weight(y) * share * radius(y) ** 2)
    across = integral(lambda y: weight(y) * (share / 2 * radius(y) ** 2 + y**2))
    return mass, along, across


def end(y):
    """The radius of a capsule's surface at a height."""
    beyond = max(abs(y) - H, 0)
    return mp.sqrt(max(mp.mpf(R) ** 2 - beyond**2, 0))


@pytest.mark.parametrize(
    ("body", "pieces"),
    [
        (CAPSULE, [of_revolution(end, -H - R, H + R, "solid")]),
        (CYLINDER, [of_revolution(lambda y: mp.mpf(R), -H, H, "solid")]),
        (ELLIPSOID | {"half_extents": [R, H, R]}, [of_revolution(lambda y: R * mp.sqrt(1 - (y / H) ** 2), -H, H, "solid")]),
        (
            CYLINDER | {"inertia": "surface"},
            [
                of_revolution(lambda y: mp.mpf(R), -H, H, "surface"),
                (2 * mp.pi * R**2, mp.pi * R**4, 2 * mp.pi * R**2 * (mp.mpf(R) ** 2 / 4 + mp.mpf(H) ** 2)),
            ],
        ),
    ],
)
def test_moments_are_those_of_an_integral_over_discs(body, pieces):
    """A body of revolution as discs, or as the rims of its surface."""
    mass, along, across = (sum(piece[number] for piece in pieces) for number in range(3))
    found = np.diag(load({"duration": 1.0, "body": body}).body.inertia_tensor)
    np.testing.assert_allclose(found, [float(2 * value / mass) for value in (across, along, across)], rtol=1e-12)


def test_moments_of_surfaces_of_parts():
    """A capsule's surface of no cylinder is that of a ball; the surface of a cube; a thin ball."""
    nearly_a_ball = load({"duration": 1.0, "body": CAPSULE | {"half_length": 1e-9, "inertia": "surface"}}).body
    ball = load({"duration": 1.0, "body": {"shape": "sphere", "radius": R, "mass": 2.0, "inertia": "surface"}}).body
    np.testing.assert_allclose(nearly_a_ball.inertia_tensor, ball.inertia_tensor, rtol=1e-7)
    np.testing.assert_allclose(ball.inertia_tensor, 2.0 / 3.0 * 2.0 * R**2 * np.eye(3), rtol=1e-15)
    cube = load({"duration": 1.0, "body": {"shape": "box", "half_extents": [0.5, 0.5, 0.5], "mass": 3.0, "inertia": "surface"}}).body
    np.testing.assert_allclose(cube.inertia_tensor, 3.0 * 5.0 / 18.0 * np.eye(3), rtol=1e-15)  # 5/18 M a², a the edge
    # The sides of a capsule's surface, and its ends: half spheres about ±H, whose centroid is R/2 beyond.
    sides, ends = 4 * math.pi * R * H, 4 * math.pi * R**2
    across = sides * (R**2 / 2 + H**2 / 3) + ends * (2 * R**2 / 3 + H**2 + H * R)
    capsule = load({"duration": 1.0, "body": CAPSULE | {"inertia": "surface"}}).body
    np.testing.assert_allclose(capsule.moments[0], 2.0 * across / (sides + ends), rtol=1e-14)


@pytest.mark.sample(1)
@pytest.mark.parametrize("half_extents", [(0.1, 0.2, 0.35), (0.02, 0.4, 0.05)])
def test_moments_of_the_surface_of_an_ellipsoid(half_extents):
    """Against the area element |∂x/∂θ × ∂x/∂φ|, integrated over an octant by Gauss and Legendre's rule; measured 3e-15."""
    (a, b, c), (nodes, weights) = half_extents, np.polynomial.legendre.leggauss(200)
    theta, phi = np.meshgrid(*[np.pi / 4 * (1.0 + nodes)] * 2)
    x, y, z = a * np.sin(theta) * np.cos(phi), b * np.sin(theta) * np.sin(phi), c * np.cos(theta)
    area = np.sin(theta) * np.hypot(np.hypot(b * c * x / a, a * c * y / b), a * b * z / c) * np.outer(weights, weights)
    x, y, z = (np.sum(area * part**2) / np.sum(area) for part in (x, y, z))
    expected = [2.0 * (y + z), 2.0 * (z + x), 2.0 * (x + y)]
    body = load({"duration": 1.0, "body": {"shape": "ellipsoid", "half_extents": half_extents, "mass": 2.0, "inertia": "surface"}}).body
    np.testing.assert_allclose(body.inertia_tensor, np.diag(expected), rtol=1e-12)


def surface(name, random, count):
    """Points of a body's surface, relative to its centre of mass, shape (count, 3)."""
    directions = random.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    if name == "ellipsoid":
        return directions * SEMI_AXES
    if name == "offset":
        return R * directions - OFFSET["center_of_mass"]
    if name == "capsule":
        return R * directions + np.copysign(H, directions[:, 1:2]) * UP
    flat = directions * [1.0, 0.0, 1.0]
    return R * flat / np.linalg.norm(flat, axis=1, keepdims=True) + np.copysign(H, directions[:, 1:2]) * UP


@pytest.mark.parametrize("name", ROUND)
def test_lowest_points_are_the_lowest_of_many(name):
    """Of 20 orientations; no point of the surface is lower, and one of many is nearly as low."""
    random = np.random.default_rng(3)
    points = surface(name, random, 40_000)
    for quaternion in random.normal(size=(20, 4)):
        orientation = quaternion / np.linalg.norm(quaternion)
        state = np.concatenate([[0.0, 1.0, 0.0], orientation, np.zeros(6)])
        one = scene(ROUND[name], position=[0.0, 1.0, 0.0], orientation=orientation.tolist())
        found = lowest_height(one, Trajectory.from_states(np.zeros(1), state[np.newaxis]))[0]
        sampled = 1.0 + rotate(orientation, points)[:, 1].min()
        assert found <= sampled + 1e-15
        assert found > sampled - 2e-4
        assert one.clearance == pytest.approx(found, abs=1e-15)
        assert 1.0 + one.body.lowest(orientation, 0.0)[0, 1] == pytest.approx(found, abs=1e-15)
        assert np.linalg.norm(points, axis=1).max() <= one.body.size * (1.0 + 1e-12)


def test_a_level_disc_is_carried_by_its_rim():
    """Four points of the rim whose mean is under the centre."""
    lowest = load({"duration": 1.0, "body": CYLINDER}).body.lowest(np.array([0.0, 0.0, 0.0, 1.0]), 1e-12)
    np.testing.assert_allclose(lowest[:, 1], -H)
    np.testing.assert_allclose(np.hypot(lowest[:, 0], lowest[:, 2]), R)
    np.testing.assert_allclose(lowest.mean(axis=0), [0.0, -H, 0.0], atol=1e-17)


def half_height(name, angle):
    """Height of the centre of mass of a body that is turned about x by an angle from upright and touches the floor."""
    sine, cosine = mp.sin(angle), mp.cos(angle)
    return {
        "capsule": lambda: R + H * abs(cosine),
        "cylinder": lambda: H * abs(cosine) + R * abs(sine),
        "ellipsoid": lambda: mp.sqrt((SEMI_AXES[1] * cosine) ** 2 + (SEMI_AXES[2] * sine) ** 2),
        "offset": lambda: R + OFFSET["center_of_mass"][1] * cosine,
    }[name]()


@pytest.mark.sample(3)
@pytest.mark.parametrize("name", ROUND)
@pytest.mark.parametrize("spin", [3.0, -40.0])
def test_contact_and_impact_about_a_fixed_axis_in_25_digits(name, spin):
    """The time by a root search in 25 digits; the velocities by Newton's restitution and the arm of the lowest point."""
    with mp.workdps(25):
        start, y0, g, w = mp.mpf("0.4"), mp.mpf("0.7"), mp.mpf(G), mp.mpf(spin)

        def height(t):
            return y0 - g * t**2 / 2 - half_height(name, start + w * t)

        ascending = [mp.mpf(k) / 2000 for k in range(1000)]
        first = next(t for t in ascending if height(t) <= 0)
        time = mp.findroot(height, (first - mp.mpf(1) / 2000, first), solver="anderson", tol=1e-45)
        # The rate at which the lowest point sinks at a spin is spin times the arm along the floor.
        arm = mp.diff(lambda angle: half_height(name, angle), start + w * time)
        body = scene(ROUND[name], position=[0.0, 0.7, 0.0]).body
        inertia, mass, e = mp.mpf(float(body.inertia_tensor[0, 0])), mp.mpf(body.mass), mp.mpf("0.5")
        impulse = (1 + e) * (g * time + w * arm) / (1 / mass + arm**2 / inertia)
        after = (-g * time + impulse / mass, w - impulse * arm / inertia)
    turned = about(np.array([1.0, 0.0, 0.0]), np.array(0.4)).tolist()
    found = truth_for(scene(ROUND[name], position=[0.0, 0.7, 0.0], orientation=turned, angular_velocity=[spin, 0.0, 0.0])).events[0]
    assert found.time == pytest.approx(float(time), rel=4e-15)
    np.testing.assert_allclose(found.after[[8, 10]], [float(value) for value in after], rtol=1e-12)


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", ROUND)
def test_first_contact_of_a_tumbling_body_is_that_of_a_fine_search(name):
    """Thirty random starts: the lowest height along the exact flight is positive before the contact, and zero at it."""
    random = np.random.default_rng(5)
    for _ in range(30):
        orientation = random.normal(size=4)
        spin = (10.0 ** random.uniform(0.0, 2.0) * random.normal(size=3)).tolist()
        given = {"position": [0.0, 0.45, 0.0], "orientation": orientation.tolist(), "angular_velocity": spin}
        one = scene(ROUND[name], **given, velocity=[0.0, random.uniform(-2.0, 2.0), 0.0])
        flight = flight_states(one.initial_state, one.body.inertia_tensor, one.acceleration)
        contact = ContactSearch(flight, one.body.hull, one.body.semi_axes).next_contact(1.0)
        times = np.append(np.linspace(0.0, contact.time * (1.0 - 1e-9), 4000), contact.time)
        heights = lowest_height(one, Trajectory.from_states(times, flight(times)))
        assert contact.is_decided
        assert heights[:-1].min() > 0.0
        assert abs(heights[-1]) < 1e-13


@pytest.mark.parametrize(
    ("body", "orientation", "height"),
    [
        (CYLINDER, [0, 0, 0, 1], H),
        (CYLINDER, LYING, R),
        (CAPSULE, LYING, R),
        (ELLIPSOID, FALLEN, SEMI_AXES[0]),
    ],
)
def test_bodies_that_land_where_they_can_lie_bounce_as_a_ladder(body, orientation, height):
    """The first impact at √(2 H/g), the rebound e² H, and no spin, also on a rough floor."""
    found = truth_for(scene(body, 0.4, position=[0.0, height + 0.2, 0.0], orientation=orientation))
    assert found.name == "bounce-ladder"
    assert found.events[0].time == pytest.approx(math.sqrt(0.4 / G), rel=1e-14)
    rebound = found([found.events[0].time + 0.5 * math.sqrt(0.4 / G)])
    assert rebound.position[0, 1] == pytest.approx(height + 0.05, rel=1e-13)


def test_a_body_that_lands_where_it_falls_over_is_no_ladder():
    """An ellipsoid on its long axis, and a capsule on its end; both are central impacts whose outcome any turn destroys."""
    for body, height in ((ELLIPSOID, SEMI_AXES[1]), (CAPSULE, H + R)):
        found = truth_for(scene(body, position=[0.0, height + 0.2, 0.0]))
        assert found is None or found.name != "bounce-ladder"


PROLATE = {"shape": "ellipsoid", "half_extents": [R, H, R], "mass": 2.0}


@pytest.mark.parametrize(
    ("body", "k"),
    [
        (CYLINDER, 3.0),
        (CYLINDER | {"inertia": [0.05, 2.0 * R**2, 0.05]}, 2.0),
        (CYLINDER | {"inertia": [0.05, 0.5 * R**2, 0.05]}, 5.0),
        (PROLATE, 3.5),
    ],
)
def test_round_bodies_on_their_sides_roll_by_their_moment(body, k):
    """Thrown without spin one rolls at (k - 1)/k of its speed, k = 1 + M R²/I; on a slope it then gains (k - 1)/k of g sin."""
    rolled = truth_for(scene(body, 0.3, position=[0.0, R, 0.0], orientation=LYING, velocity=[1.0, 0.0, 0.0]))([0.9])
    assert rolled.velocity[0, 0] == pytest.approx(1.0 - 1.0 / k, rel=1e-13)
    assert rolled.angular_velocity[0, 2] == pytest.approx(-(1.0 - 1.0 / k) / R, rel=1e-13)
    sloped = truth_for(scene(body, 0.9, position=[0.0, R, 0.0], orientation=LYING, gravity=(1.0, -G, 0.0)))([0.8])
    assert sloped.velocity[0, 0] == pytest.approx(0.8 * (1.0 - 1.0 / k), rel=1e-13)


def test_an_ellipsoid_rolls_about_whichever_axis_is_the_long_one_and_not_about_a_short_one():
    """Axes of the body frame in another order do not change the motion; a flat ellipsoid would fall over."""
    along_z = scene(PROLATE | {"half_extents": [R, R, H]}, 0.3, position=[0.0, R, 0.0], velocity=[1.0, 0.0, 0.0])
    along_y = scene(PROLATE, 0.3, position=[0.0, R, 0.0], orientation=LYING, velocity=[1.0, 0.0, 0.0])
    np.testing.assert_allclose(truth_for(along_z)([0.9]).states[:, 7:], truth_for(along_y)([0.9]).states[:, 7:], rtol=1e-13, atol=1e-15)
    flat = truth_for(scene(PROLATE | {"half_extents": [H, H, R]}, 0.3, position=[0.0, H, 0.0], velocity=[1.0, 0.0, 0.0]))
    assert flat is None or flat.name != "rolling"


@pytest.mark.parametrize(
    "start",
    [
        {"velocity": [1.0, 0.0, 0.1]},
        {"velocity": [1.0, 0.0, 0.0], "angular_velocity": [0.0, 0.1, 0.0]},
        {"velocity": [1.0, 0.0, 0.0], "orientation": [0.0, 0.0, 0.0, 1.0], "position": [0.0, H, 0.0]},
    ],
)
def test_a_cylinder_that_leaves_its_course_does_not_roll(start):
    """A part of the velocity along its axis, a spin across it, and one that stands."""
    found = truth_for(scene(CYLINDER, 0.3, **{"position": [0.0, R, 0.0], "orientation": LYING, **start}))
    assert found is None or found.name != "rolling"


def test_tensors_are_given_as_urdf_and_mjcf_give_them():
    """Nine numbers, six in the order of MJCF, and URDF's names are the same body; its mirror image has two products of the other sign."""
    matrix = [[0.03, 0.002, -0.001], [0.002, 0.04, 0.003], [-0.001, 0.003, 0.05]]
    named = {"ixx": 0.03, "ixy": 0.002, "ixz": -0.001, "iyy": 0.04, "iyz": 0.003, "izz": 0.05}
    found = [
        load({"duration": 1.0, "body": {"shape": "box", "half_extents": [0.2, 0.3, 0.4], "mass": 1.0, "inertia": given}}).body
        for given in (matrix, [0.03, 0.04, 0.05, 0.002, -0.001, 0.003], named)
    ]
    np.testing.assert_array_equal(found[0].inertia_tensor, matrix)
    assert found[0] == found[1] == found[2]
    np.testing.assert_allclose(np.array(found[0].mirrored()["inertia"])[0], [0.03, -0.002, 0.001])


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"inertia": [[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]}, "must be symmetric"),
        ({"inertia": [[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]}, "must have positive principal moments"),
        ({"inertia": [1.0, 1.0, 3.0, 0.0, 0.0, 0.0]}, "no body has these moments"),
        ({"center_of_mass": [0.0, 0.1, 0.0]}, "give inertia as numbers"),
        ({"radius": 0.0}, "greater than 0"),
    ],
)
def test_impossible_bodies_are_refused(keys, message):
    """In one line that says what is allowed."""
    with pytest.raises(SceneError, match=message):
        load({"duration": 1.0, "body": CYLINDER | keys})


def test_the_lowest_height_of_an_ellipsoid_is_its_distance_from_the_centre_of_mass():
    """Against the nearest of a million points; on the shortest axis, off it, and at the centre of an ellipse."""
    random = np.random.default_rng(1)
    points = surface("ellipsoid", random, 1_000_000)
    for centre in ([0.0, 0.1, 0.05], [0.02, 0.05, 0.03], [0.0, 0.0, 0.02]):
        body = load({"duration": 1.0, "body": ELLIPSOID | {"center_of_mass": centre, "inertia": [0.05, 0.02, 0.05]}}).body
        assert body.resting_height == pytest.approx(np.linalg.norm(points - centre, axis=1).min(), abs=2e-5)


def test_every_shape_turns_and_mirrors_into_the_same_body():
    """Twice mirrored, and with its axes in another order three times, unless it has its own: the vertices and the tensor of the start."""
    tensor = [0.1, 0.09, 0.08, 1e-3, 2e-3, 3e-3]
    points = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.4, 0.0], [0.0, 0.0, 0.5]]
    bodies = {
        **ROUND,
        "box": {"shape": "box", "half_extents": [0.1, 0.2, 0.3], "mass": 2.0, "inertia": tensor},
        "vertices": {"shape": "vertices", "points": points, "mass": 2.0, "inertia": "vertices"},
        "mesh": {"shape": "mesh", "points": points, "faces": [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], "mass": 2.0},
    }
    assert {body["shape"] for body in bodies.values()} == set(SHAPES)
    for body in bodies.values():
        own = load({"duration": 1.0, "body": body}).body
        mirror, turned = own, own
        for _ in range(2):
            mirror = load({"duration": 1.0, "body": mirror.model_dump(exclude_none=True) | mirror.mirrored()}).body
        for _ in range(0 if own.has_own_axis else 3):
            turned = load({"duration": 1.0, "body": turned.model_dump(exclude_none=True) | turned.with_axes((2, 0, 1))}).body
        for other in (mirror, turned):
            np.testing.assert_allclose(other.inertia_tensor, own.inertia_tensor, rtol=1e-14, atol=1e-17)
            np.testing.assert_allclose(other.vertices, own.vertices, rtol=1e-14, atol=1e-17)


def test_an_impact_of_any_round_body_keeps_energy_at_restitution_one():
    """Without friction, to rounding, over all impacts of a second."""
    turn = multiply(about(np.array([0.6, 0.0, 0.8]), np.array(0.9)), np.array([0.0, 0.0, 0.0, 1.0])).tolist()
    for body in ROUND.values():
        one = scene(body, restitution=1.0, position=[0.0, 0.5, 0.0], orientation=turn, angular_velocity=[2.0, -1.0, 3.0])
        events = truth_for(one).events
        assert events
        for event in events:
            energies = []
            for state in (event.before, event.after):
                spin, inertia = state[SPIN], one.body.inertia_tensor
                axes = rotate(state[3:7], np.eye(3))
                energies.append(0.5 * one.body.mass * state[7:10] @ state[7:10] + 0.5 * (axes @ spin) @ inertia @ (axes @ spin))
            assert energies[1] == pytest.approx(energies[0], rel=1e-12)


def planar_impacts(radius, half, tilt, height, restitution, count):
    """The times of the impacts of a cylinder that turns in the plane of its axis, without friction: roots of closed-form heights."""
    inertia = 0.25 * radius**2 + half**2 / 3.0  # over the mass
    now, y, v, angle, spin, times = 0.0, height, 0.0, tilt, 0.0, []
    while len(times) < count:

        def gap(s, start=(y, v, angle, spin)):
            turned = start[2] + start[3] * s
            return start[0] + start[1] * s - 0.5 * G * s * s - half * np.abs(np.cos(turned)) - radius * np.abs(np.sin(turned))

        steps = 1e-9 + np.arange(0.0, 0.5, 1e-6)
        first = steps[np.argmax((gap(steps) < 0.0) & (np.gradient(gap(steps)) < 0.0))]
        s = brentq(gap, first - 1e-6, first, xtol=1e-15)
        now, y, angle, v = now + s, y + v * s - 0.5 * G * s * s, angle + spin * s, v - G * s
        across, along = math.copysign(radius, -math.sin(angle)), math.copysign(half, -math.cos(angle))
        arm = across * math.cos(angle) - along * math.sin(angle)  # of the lowest corner, along x
        push = -(1.0 + restitution) * (v + spin * arm) / (1.0 + arm**2 / inertia)
        v, spin = v + push, spin + push * arm / inertia
        times.append(now)
    return times


@pytest.mark.parametrize("half", [0.05, 0.03, 0.01])
def test_flat_cylinders_that_clatter_strike_with_one_rim_and_then_with_the_other(half):
    tilt = 0.1
    flat = {"shape": "cylinder", "radius": R, "half_length": half, "mass": 1.0}
    orientation = [0.0, 0.0, math.sin(0.5 * tilt), math.cos(0.5 * tilt)]
    events = truth_for(scene(flat, duration=0.5, position=[0.0, 0.3, 0.0], orientation=orientation)).events[:5]
    assert [event.time for event in events] == pytest.approx(planar_impacts(R, half, tilt, 0.3, 0.5, 5), abs=1e-11)


@pytest.mark.sample(4)
@pytest.mark.parametrize("seed", range(24))
def test_no_flat_body_passes_through_the_floor(seed):
    random = np.random.default_rng(seed)
    half, tilt, friction = R * random.choice([0.02, 0.1, 0.3, 0.6, 1.0]), random.uniform(0.05, 1.2), ["none", "infinite", 0.3][seed % 3]
    flat = {"shape": "cylinder", "radius": R, "half_length": half, "mass": 1.0}
    flat = flat if seed % 2 else {"shape": "ellipsoid", "half_extents": [R, half, 0.9 * R], "mass": 1.0}
    axis = random.uniform(0.0, 2.0 * math.pi)
    turned = about(np.array([math.cos(axis), 0.0, math.sin(axis)]), np.array(tilt)).tolist()
    spin = (2.0 * random.normal(size=3)).tolist()
    one = scene(flat, friction, duration=0.5, position=[0.0, 0.4, 0.0], orientation=turned, angular_velocity=spin)
    truth = truth_for(one)
    assert truth.events
    assert lowest_height(one, truth(np.linspace(0.0, truth.horizon, 5000))).min() > -1e-12
    for event in truth.events:
        at_impact = lowest_height(one, Trajectory.from_states(np.zeros(1), event.before[np.newaxis]))
        assert abs(at_impact[0]) < 1e-12
