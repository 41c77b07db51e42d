"""Exact solutions between a floor and walls, compared with an event-driven integration in 30 digits by another route."""

import mpmath as mp
import numpy as np
import pytest

from dropspin.scenarios import load, truth_for
from dropspin.scenarios.state import SPIN, VELOCITY

RADIUS, MASS, DIGITS = 0.1, 1.5, 30
FLOOR = {"restitution": 0.8, "friction": "none"}
RIGHT = {"restitution": 0.7, "friction": "none", "point": [0.9, 0.0, 0.0], "normal": [-1.0, 0.0, 0.0]}
LEFT = {"restitution": 1.0, "friction": "none", "point": [-0.4, 0.0, 0.0], "normal": [2.0, -0.3, 0.5]}
BALL = {"shape": "sphere", "radius": RADIUS, "mass": MASS}
GRAVITY = [0.3, -9.8, 0.2]


def scene(walls=(RIGHT, LEFT), floor=FLOOR, body=BALL, gravity=GRAVITY, duration=2.0, **start):
    """A ball thrown between two walls."""
    start = {"position": [0.0, 0.6, 0.0], "velocity": [5.0, 2.0, 0.3], "angular_velocity": [4.0, -7.0, 20.0]} | start
    return load(
        {"duration": duration, "body": body, "start": start, "gravity": {"acceleration": gravity}, "floor": floor, "wall": list(walls)}
    )


def events(own, count):
    """Times, plane numbers, and velocities and spins after the first impacts of a ball, in vectors of mpmath, by the laws for balls.

    With the slip s of the contact point and the normal speed u, a ball of inertia 2/5 M R² that sticks loses 2/7 of s, one that slips
    f (1 + e) u of it.
    """
    mp.mp.dps = DIGITS
    planes = [([0, 0, 0], [0, 1, 0], own.floor)] + [(wall.point, wall.normal, wall) for wall in own.wall]
    x, v, w, g = (
        mp.matrix(list(map(float, a))) for a in (own.start.position, own.start.velocity, own.start.angular_velocity, own.acceleration)
    )

    def dot(a, b):
        return mp.fsum(p * q for p, q in zip(a, b, strict=True))

    def cross(a, b):
        return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])

    time, struck, found = mp.mpf(0), None, []
    for _ in range(count):
        nearest = (mp.inf, None)
        for number, (point, normal, _surface) in enumerate(planes):
            n = mp.matrix(list(map(float, normal)))
            n = n / mp.norm(n)
            a, b, c = dot(n, g) / 2, dot(n, v), dot(n, x - mp.matrix(list(map(float, point)))) - mp.mpf(RADIUS)
            c = mp.mpf(0) if number == struck else c  # it is at this plane
            root = mp.sqrt(b * b - 4 * a * c)
            for wait in [(-b - root) / (2 * a), (-b + root) / (2 * a)] if a else [-c / b]:
                is_later = mp.im(wait) == 0 and wait > mp.mpf(10) ** -20
                if is_later and dot(n, v + g * wait) < 0 and wait < nearest[0]:
                    nearest = wait, number
        wait, struck = nearest
        n = mp.matrix(list(map(float, planes[struck][1])))
        n, surface = n / mp.norm(n), planes[struck][2]
        x, v, time = x + wait * v + wait**2 / 2 * g, v + wait * g, time + wait
        speed = -dot(n, v)
        slip = v + cross(w, -mp.mpf(RADIUS) * n)
        slip -= dot(n, slip) * n
        e, most = mp.mpf(surface.restitution), mp.mpf(2) / 7 * mp.norm(slip)
        lost = min(most, mp.mpf(surface.coefficient) * (1 + e) * speed) if surface.coefficient < np.inf else most
        kick = -lost / mp.norm(slip) * slip if lost else 0 * slip
        v = v + kick + (1 + e) * speed * n
        w = w + cross(-mp.mpf(RADIUS) * n, kick) / (mp.mpf(2) / 5 * mp.mpf(RADIUS) ** 2)
        found.append((time, struck, v.copy(), w.copy()))
    return found


FRICTIONS = [("none", "none"), (0.3, 0.15), ("infinite", 0.4), (0.25, "infinite")]


@pytest.mark.parametrize(("floor", "wall"), FRICTIONS, ids=str)
def test_ball_between_walls_moves_as_the_events_in_30_digits(floor, wall):
    """Times to 1e-12 s, velocities to 1e-11 m/s and spins to 1e-10 rad/s, over ten impacts at all three planes."""
    own = scene([RIGHT | {"friction": wall}, LEFT | {"friction": wall}], FLOOR | {"friction": floor})
    truth = truth_for(own)
    assert (truth.name, truth.horizon) == ("ball-impact", own.duration)
    expected = events(own, len(truth.events))
    assert len(expected) >= 6
    assert {number for _, number, _, _ in expected} == {0, 1, 2}
    for event, (time, number, velocity, spin) in zip(truth.events, expected, strict=True):
        assert event.wall == (None if number == 0 else number - 1)
        assert abs(event.time - time) < 1e-12
        np.testing.assert_allclose(event.after[VELOCITY], [float(one) for one in velocity], rtol=0, atol=1e-11)
        np.testing.assert_allclose(event.after[SPIN], [float(one) for one in spin], rtol=0, atol=1e-10)
        np.testing.assert_allclose(truth([event.time]).states[0], event.before, rtol=0, atol=1e-12)


def test_ball_at_a_smooth_elastic_wall_is_the_mirror_image_of_the_free_one():
    elastic = RIGHT | {"restitution": 1.0}
    own = scene([elastic], gravity=[0.0, -9.8, 0.0], duration=0.5, position=[0.0, 3.0, 0.0])
    free = scene([elastic | {"point": [1e4, 0.0, 0.0]}], gravity=[0.0, -9.8, 0.0], duration=0.5, position=[0.0, 3.0, 0.0])
    times = np.linspace(0.0, 0.5, 101)
    found, expected = truth_for(own)(times).states, truth_for(free)(times).states
    np.testing.assert_allclose(found[:, 0], np.minimum(expected[:, 0], 2 * 0.8 - expected[:, 0]), atol=1e-14)
    np.testing.assert_allclose(
        found[:, [1, 2, 3, 4, 5, 6, 8, 9, 10, 11, 12]], expected[:, [1, 2, 3, 4, 5, 6, 8, 9, 10, 11, 12]], atol=1e-14
    )


def test_solution_ends_where_two_planes_are_struck_at_once():
    """A ball thrown along the bisector into the corner of two walls."""
    walls = [RIGHT, RIGHT | {"point": [0.0, 0.0, 0.9], "normal": [0.0, 0.0, -1.0]}]
    truth = truth_for(scene(walls, velocity=[3.0, 1.0, 3.0], gravity=[0.0, -9.8, 0.0]))
    assert (truth.horizon, truth.ends) == (pytest.approx(0.8 / 3.0), "the body strikes two planes at once")
    assert truth.events == ()


def test_solution_ends_where_the_body_stays_on_a_wall():
    truth = truth_for(scene([RIGHT | {"restitution": 0.0}, LEFT]))
    assert truth.ends == "the body stays on the wall[0]"


@pytest.mark.parametrize("shape", ["box", "capsule"])
def test_corner_that_strikes_a_wall_has_the_impact_of_a_floor_there(shape):
    """The scene with a wall, turned so that the wall is the floor, has the same impact."""
    body = {"shape": "box", "half_extents": [0.1, 0.15, 0.2], "mass": 2.0}
    body = body if shape == "box" else {"shape": "capsule", "radius": 0.1, "half_length": 0.2, "mass": 2.0}
    surface = {"restitution": 0.6, "friction": 0.3}
    start = {"orientation": [0.3, 0.2, 0.1, 0.9], "angular_velocity": [3.0, 1.0, 2.0]}
    at_wall = scene([RIGHT | surface], body=body, gravity=[1.0, -2.0, 0.5], **start)

    # The rotation that takes -x to y takes (x, y, z) to (y, -x, z).
    def turned(a):
        return [a[1], -a[0], a[2]]

    q = np.sqrt(0.5) * np.array([0.0, 0.0, -1.0, 1.0])
    (x, y, z), w = np.array(at_wall.start.orientation[:3]), at_wall.start.orientation[3]
    orientation = [q[3] * x - q[2] * y, q[3] * y + q[2] * x, q[3] * z + q[2] * w, q[3] * w - q[2] * z]
    content = {
        "duration": 2.0,
        "body": body,
        "start": {
            "position": turned(np.array(at_wall.start.position) - [0.9, 0.0, 0.0]),
            "orientation": orientation,
            "velocity": turned(at_wall.start.velocity),
            "angular_velocity": turned(at_wall.start.angular_velocity),
        },
        "gravity": {"acceleration": turned([1.0, -2.0, 0.5])},
        "floor": surface,
    }
    [found, expected] = (truth_for(one).events[0] for one in (at_wall, load(content)))
    assert found.wall == 0
    assert found.time == pytest.approx(expected.time, abs=1e-13)
    for part in (VELOCITY, SPIN):
        np.testing.assert_allclose(turned(found.after[part]), expected.after[part], atol=1e-11)


def test_solutions_of_the_floor_hold_until_the_body_comes_near_a_wall_or_the_end():
    """A ball that rolls towards a wall, one that rolls towards the end of the floor, and one that rolls along the wall."""
    rolls = {"position": [3e-4, RADIUS, 0.0], "velocity": [1.0, 0.0, 0.0], "angular_velocity": [0.0, 0.0, -1.0 / RADIUS]}
    rough = FLOOR | {"friction": 0.5}
    to_wall = truth_for(scene([RIGHT], rough, gravity=[0.0, -9.8, 0.0], **rolls))
    assert 0.78 < to_wall.horizon < 0.8
    assert to_wall.ends == "the body comes near a wall or the end of the floor"
    to_end = truth_for(scene([], rough | {"half_extents": [0.6, 1.0]}, gravity=[0.0, -9.8, 0.0], **rolls))
    assert 0.48 < to_end.horizon < 0.5
    along = truth_for(scene([RIGHT | {"normal": [0.0, 0.0, 1.0], "point": [0.0, 0.0, -0.2]}], rough, gravity=[0.0, -9.8, 0.0], **rolls))
    assert along.covers_all(2.0)
    assert to_wall.name == to_end.name == along.name


@pytest.mark.parametrize(("height", "duration"), [(3.0, 40.0), (3.0, 400.0), (1000.0, 20.0)])
def test_fast_or_long_vertical_motion_comes_no_nearer_to_the_end_of_the_floor(height, duration):
    """A small cube falls onto the middle of a table and rests there."""
    cube = {"shape": "box", "half_extents": [0.02, 0.02, 0.02], "mass": 0.1}
    table = {"restitution": 0.0, "friction": 1.0, "half_extents": [0.2, 0.2], "thickness": 0.05}
    start, gravity = {"position": [0.0, height, 0.0]}, {"acceleration": [0.0, -9.8, 0.0]}
    truth = truth_for(load({"duration": duration, "body": cube, "start": start, "gravity": gravity, "floor": table}))
    assert truth.covers_all(duration)
    np.testing.assert_allclose(truth.states(np.array([duration]))[0, :3], [0.0, 0.02, 0.0], atol=1e-12)


@pytest.mark.parametrize("position", [[3.0, 0.3, 0.0], [0.0, -1.0, 0.0]])
def test_start_beside_or_below_a_floor_that_ends_has_no_solution(position):
    assert truth_for(scene([], FLOOR | {"half_extents": [1.0, 1.0], "thickness": 0.2}, position=[3.0, -0.3, 0.0])) is None
    found = truth_for(scene([], FLOOR | {"half_extents": [1.0, 1.0], "thickness": 0.2}, position=position))
    assert found is None
