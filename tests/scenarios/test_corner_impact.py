"""The corner impact compared with published values, its conservation laws, and an integrator with events."""

import numpy as np
import pytest

from dropspin.scenarios import load, truth_for
from dropspin.scenarios.mechanics import angular_momentum, energy, lowest_height
from dropspin.scenarios.rotations import rotate
from dropspin.scenarios.state import ORIENTATION, RATES, SPIN, VELOCITY
from dropspin.scenarios.trajectory import Trajectory
from dropspin.scenarios.truths.flight import flight_states
from dropspin.scenarios.variations import in_units

UP = np.array([0.0, 1.0, 0.0])


def dropped_from_rest(friction):
    return load(
        {
            "duration": 0.6,
            "body": {"shape": "box", "half_extents": [0.25, 0.35, 0.5], "mass": 1.0, "inertia": "vertices"},
            "start": {"position": [0.0, 1.5, 0.0], "orientation": [0.2, 0.1, -0.3, 0.9]},
            "gravity": {"acceleration": [0.0, -9.8, 0.0]},
            "floor": {"restitution": 0.5, "friction": friction},
        }
    )


def test_single_impact_matches_published_values():
    """A box of corner masses dropped from rest: time and velocities after, to the six published decimals."""
    [smooth] = truth_for(dropped_from_rest("none")).events
    assert smooth.time == pytest.approx(0.426939, abs=5e-7)
    np.testing.assert_allclose(smooth.after[VELOCITY], [0, 1.084631, 0], rtol=0, atol=5e-7)
    np.testing.assert_allclose(smooth.after[SPIN], [-3.903102, -0.284375, 0.051236], rtol=0, atol=5e-7)
    [rough] = truth_for(dropped_from_rest("infinite")).events
    np.testing.assert_allclose(rough.after[VELOCITY], [-0.038962, 1.558309, -1.253507], rtol=0, atol=5e-7)


@pytest.mark.parametrize("name", ["drop-box-corner", "drop-box-sticking"])
def test_single_corner_impact_conserves_what_its_law_says(name):
    """To 1e-13: the angular momentum about the corner, and the tangential impulse or velocity of the friction law."""
    scene = load(name)
    truth = truth_for(scene)
    [impact] = truth.events
    before, after = truth.states(np.array([impact.time]))[0], impact.after
    np.testing.assert_allclose(before, impact.before, rtol=0, atol=1e-14)
    offsets = rotate(impact.before[ORIENTATION], scene.body.vertices)
    corner = offsets[np.argmin(offsets[:, 1])]
    assert impact.before[1] + corner[1] == pytest.approx(0.0, abs=1e-14)

    axes = rotate(impact.before[ORIENTATION], np.eye(3)).T
    inertia = axes @ scene.body.inertia_tensor @ axes.T
    kick = scene.body.mass * (after[VELOCITY] - impact.before[VELOCITY])
    turn = inertia @ (after[SPIN] - impact.before[SPIN])
    np.testing.assert_allclose(turn, np.cross(corner, kick), rtol=0, atol=1e-13 * np.linalg.norm(kick))
    contact_before, contact_after = (s[VELOCITY] + np.cross(s[SPIN], corner) for s in (impact.before, after))
    assert contact_after[1] == pytest.approx(-0.5 * contact_before[1], rel=1e-13)
    if name == "drop-box-corner":
        np.testing.assert_allclose(kick[[0, 2]], 0.0, rtol=0, atol=1e-13)
    else:
        np.testing.assert_allclose(contact_after[[0, 2]], 0.0, rtol=0, atol=1e-13)

    t = np.linspace(0, scene.duration, 400)
    motion = truth(t)
    assert lowest_height(scene, motion).min() >= -1e-12  # no second impact before the end
    flights = [t <= impact.time, t > impact.time]
    for flight in flights:
        assert np.ptp(energy(scene, motion)[flight]) <= 1e-12 * energy(scene, motion)[0]
        L = angular_momentum(scene, motion)[flight]
        assert np.abs(L - L[0]).max() <= 1e-12 * np.linalg.norm(L[0])
    assert energy(scene, motion)[-1] < energy(scene, motion)[0]


def tumbling(friction, duration=2.0):
    content = dropped_from_rest(friction).model_dump(exclude_none=True)
    content["body"] |= {"inertia": "vertices"}
    content["floor"] |= {"restitution": 0.6}
    content["start"] = {
        "position": [0, 2, 0],
        "orientation": [0.2, 0.1, -0.3, 0.9],
        "velocity": [0.5, 0, 0],
        "angular_velocity": [2, -1, 3],
    }
    return load(content | {"duration": duration})


def test_impact_times_of_a_tumble_match_published_values():
    """Three impacts of a sticking box at .532426, 1.202082 and 1.263919 s, to every printed digit."""
    times = [event.time for event in truth_for(tumbling("infinite")).events]
    np.testing.assert_allclose(times[:3], [0.532426, 1.202082, 1.263919], rtol=0, atol=5e-7)


@pytest.mark.parametrize("friction", ["none", "infinite"])
def test_tumble_matches_an_integrator_with_events(friction):
    """DOP853, root-found impacts, the balance of momentum as nine equations: all impacts to 1e-9 s and 1e-8 of the velocities.

    Each impact amplifies earlier differences; the measured ones are 3e-11 s and 1.3e-10 at the last impact.
    """
    from scipy.integrate import solve_ivp
    from scipy.spatial.transform import Rotation

    scene = tumbling(friction)
    truth = truth_for(scene)
    tensor, points, M = scene.body.inertia_tensor, scene.body.vertices, scene.body.mass
    inverse, e = np.linalg.inv(tensor), scene.floor.restitution

    def derivative(t, s):
        q, spin = s[ORIENTATION], s[SPIN]  # spin in the body
        p, q0, r = spin
        turning = 0.5 * np.array(
            [q[3] * p + q[1] * r - q[2] * q0, q[3] * q0 + q[2] * p - q[0] * r, q[3] * r + q[0] * q0 - q[1] * p, -q[:3] @ spin]
        )
        return np.concatenate([s[VELOCITY], turning, [0, -9.8, 0], -inverse @ np.cross(spin, tensor @ spin)])

    def lowest(t, s):
        return s[1] + Rotation.from_quat(s[ORIENTATION]).apply(points)[:, 1].min()

    lowest.terminal, lowest.direction = True, -1
    state, now = scene.initial_state, 0.0
    state[SPIN] = Rotation.from_quat(state[ORIENTATION]).inv().apply(state[SPIN])
    for event in truth.events:
        solved = solve_ivp(derivative, (now, 3.0), state, "DOP853", events=lowest, rtol=1e-13, atol=1e-13)
        now, state = solved.t[-1], solved.y[:, -1]
        assert now == pytest.approx(event.time, abs=1e-9)
        R = Rotation.from_quat(state[ORIENTATION]).as_matrix()
        r = (points @ R.T)[np.argmin((points @ R.T)[:, 1])]
        v, w = state[VELOCITY], R @ state[SPIN]
        approach = v + np.cross(w, r)
        arm = -np.cross(np.eye(3), r).T  # arm @ j = r × j, and ω × r = -arm @ ω
        # Unknown: v+, ω+, j. M (v+ - v) = j; I (ω+ - ω) = r × j; and what the contact does, three equations.
        A, b = np.zeros((9, 9)), np.zeros(9)
        A[:3, :3], A[:3, 6:], b[:3] = M * np.eye(3), -np.eye(3), M * v
        world = R @ tensor @ R.T
        A[3:6, 3:6], A[3:6, 6:], b[3:6] = world, -arm, world @ w
        A[6:, :3], A[6:, 3:6] = np.eye(3), -arm
        b[6:] = [0.0, -e * approach[1], 0.0]
        if friction == "none":  # no tangential impulse, instead of no tangential velocity
            for row, axis in ((6, 0), (8, 2)):
                A[row], b[row] = 0.0, 0.0
                A[row, 6 + axis] = 1.0
        after = np.linalg.solve(A, b)
        np.testing.assert_allclose(event.after[RATES], after[:6], rtol=0, atol=1e-8 * np.abs(after[:6]).max())
        state = np.concatenate([state[:7], after[:3], R.T @ after[3:6]])
        now, state = now + 1e-9, solve_ivp(derivative, (0, 1e-9), state, "DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    assert len(truth.events) >= 5


@pytest.mark.extended
def test_solution_ends_where_a_disturbance_has_grown_too_much():
    """At the tenth impact at the latest; until then no part is below the floor, and a disturbance of 1e-10 grows to 1e-5 at most."""
    scene = load("drop-box-corner").model_copy(update={"duration": 5.0})
    truth = truth_for(scene)
    assert truth.horizon < 5.0
    assert 1 < len(truth.events) <= 100
    heights = lowest_height(scene, truth(np.linspace(0, truth.horizon, 3000)))
    assert heights.min() >= -1e-12
    assert heights[-1] == pytest.approx(0.0, abs=1e-12)
    moved = scene.initial_state
    moved[10] += 1e-10
    other = truth_for(scene.starting_at(moved))
    last = truth.events[-1]
    assert np.abs(other.events[len(truth.events) - 1].after - last.after).max() <= 1e-5


def test_corner_impact_is_limited_to_its_range_of_validity():
    """No closed form for an edge whose ends move differently, or damping; a flight that ends in the air has one."""
    content = dropped_from_rest("none").model_dump(exclude_none=True)
    spinning_edge = content | {"start": {"position": [0, 1.5, 0], "orientation": [0.3, 0, 0, 1], "velocity": [0, 0, 1]}}
    assert truth_for(load(spinning_edge)).name == "edge-impact"
    spinning_edge["start"] |= {"velocity": [0, 0, 0], "angular_velocity": [0, 0, 0.1]}
    assert truth_for(load(spinning_edge)) is None or truth_for(load(spinning_edge)).name == "corner-impact"
    assert truth_for(load(content | {"damping": {"linear": 0.1}})) is None
    assert truth_for(load(content | {"duration": 0.3})).events == ()


def test_floor_does_not_pull():
    """The upward kick of eq 17 is linear in the sideways speed of the corner, and pulls beyond the speed at which it is 0."""

    def at_speed(speed):
        content = dropped_from_rest("infinite").model_dump(exclude_none=True)
        content["start"] = content["start"] | {"velocity": [0.0, 0.0, speed]}
        return truth_for(load(content))

    kicks = [at_speed(speed).events[0] for speed in (0.0, 1.0)]
    at_rest, at_one = (kick.after[8] - kick.before[8] for kick in kicks)
    none = at_rest / (at_rest - at_one)
    assert 1.0 < abs(none) < 100.0
    assert at_speed(0.999 * none).events[0].after[8] > at_speed(0.999 * none).events[0].before[8]
    assert at_speed(1.001 * none) is None


def box_at(clearance, velocity):
    """The published box with its corner at this height above the floor."""
    content = dropped_from_rest("none").model_dump(exclude_none=True)
    scene = load(content)
    content["start"] = content["start"] | {"position": [0.0, 1.5 - scene.clearance + clearance, 0.0], "velocity": [0.0, velocity, 0.0]}
    return load(content | {"duration": 1.0})


@pytest.mark.sample(1)
@pytest.mark.parametrize("clearance", [0.0, -1e-12, 1e-12, -5e-10])
def test_corner_that_leaves_the_floor_strikes_only_when_it_returns(clearance):
    """Thrown up from the floor, or from a rounding error below it: the impact is after 2 v/g."""
    impact, *_ = truth_for(box_at(clearance, 2.0)).events
    assert impact.time == pytest.approx(2 * 2.0 / 9.8, abs=1e-9)


def test_corner_on_the_floor_that_descends_strikes_at_once():
    """The solution continues after the impact."""
    truth = truth_for(box_at(-1e-12, -1.0))
    assert truth.events[0].time == 0.0
    assert truth.horizon > 0.05


@pytest.mark.parametrize("speed", [1.0, 30.0])
def test_impact_of_a_fast_spin_is_found_between_samples(speed):
    """A box without gravity that spins and dips 20 µm below the floor once a turn strikes in its first turn, in a scene of any length."""

    def spinning(height):
        return load(
            {
                "duration": 300.0,
                "body": {"shape": "box", "half_extents": [0.1, 0.1, 0.1], "mass": 1.0},
                "start": {"position": [0, height, 0], "angular_velocity": [15 * speed, 5 * speed, 50 * speed]},
                "floor": {"restitution": 0.5, "friction": "none"},
            }
        )

    def heights(scene, until):
        t = np.linspace(0, until, 200_001)
        states = flight_states(scene.initial_state, scene.body.inertia_tensor, np.zeros(3))
        return t, lowest_height(scene, Trajectory.from_states(t, states(t)))

    turn = 2 * np.pi / np.linalg.norm([15 * speed, 5 * speed, 50 * speed])
    scene = spinning(0.2 - heights(spinning(0.2), turn)[1].min() - 2e-5)
    [impact] = truth_for(scene).events
    t, h = heights(scene, turn)
    assert impact.time == pytest.approx(t[np.argmax(h < 0)], abs=turn / 100_000)


@pytest.mark.parametrize("friction", ["none", "infinite"])
def test_edge_strikes_as_one_point_at_its_middle(friction):
    """Two equal impulses by symmetry: u_n+ = -e u_n at both corners, energy balance of the planar collision. To 1e-13."""
    content = dropped_from_rest(friction).model_dump(exclude_none=True)
    start = {"position": [0, 1.5, 0], "orientation": [0, 0, np.sin(0.2), np.cos(0.2)]}
    scene = load(content | {"start": start, "duration": 0.6})
    [impact] = truth_for(scene).events
    half = np.array(scene.body.half_extents)
    c, s = np.cos(0.4), np.sin(0.4)
    r = np.array([-c * half[0] + s * half[1], -s * half[0] - c * half[1]])  # the lower edge: x and y from the centre
    u = impact.before[8]
    M, moment = scene.body.mass, scene.body.inertia_tensor[2, 2]
    if friction == "none":
        j = np.array([0.0, -(1 + 0.5) * u / (1 / M + r[0] ** 2 / moment)])
    else:
        K = np.eye(2) / M + np.array([[r[1] ** 2, -r[0] * r[1]], [-r[0] * r[1], r[0] ** 2]]) / moment
        j = np.linalg.solve(K, [0.0, -(1 + 0.5) * u])
    spin = (r[0] * j[1] - r[1] * j[0]) / moment
    np.testing.assert_allclose(impact.after[7:9], impact.before[7:9] + j / M, rtol=0, atol=1e-13 * abs(u))
    np.testing.assert_allclose(impact.after[SPIN], [0, 0, spin], rtol=0, atol=1e-12 * abs(spin))


def test_solution_ends_where_the_body_stays_on_the_floor():
    """Dropped without restitution, it ends at the first impact; put down on a corner, the body falls about it, and there is none."""
    content = dropped_from_rest("infinite").model_dump(exclude_none=True)
    scene = load(content)
    content["floor"] |= {"restitution": 0.0}
    dropped = truth_for(load(content))
    assert dropped.horizon == dropped.events[0].time
    content["start"] |= {"position": [0.0, scene.start.position[1] - scene.clearance, 0.0]}
    assert truth_for(load(content)).name == "rough-contact"


@pytest.mark.parametrize(("spin", "rise"), [((0, 0, -1.0), 0.0), ((0, 0, 1.0), 0.0), ((0, 0, -1.0), 0.05), ((1.0, 0, 0), 0.0)])
def test_flat_box_with_some_descending_corners_does_not_sink_into_the_floor(spin, rise):
    scene = load(
        {
            "name": "flat",
            "duration": 1.0,
            "body": {"shape": "box", "half_extents": [0.1, 0.1, 0.1], "mass": 1.0},
            "start": {"position": [0.0, 0.1, 0.0], "velocity": [0.0, rise, 0.0], "angular_velocity": list(spin)},
            "gravity": {"acceleration": [0.0, -9.8, 0.0]},
            "floor": {"restitution": 0.5, "friction": "none"},
        }
    )
    truth = truth_for(scene)
    if truth is not None:
        motion = truth(np.linspace(0.0, min(1.0, truth.horizon), 1000))
        assert lowest_height(scene, motion).min() >= -1e-9


@pytest.mark.extended
def test_solution_ends_at_the_same_time_in_other_units():
    """A tumble with ten impacts, in millimetres and in grams."""
    scene = load("drop-box-anyhow")
    horizon = truth_for(scene).horizon
    assert horizon < scene.duration
    for units in ({"length": 1e3}, {"mass": 1e3}):
        assert truth_for(in_units(scene, **units)).horizon == pytest.approx(horizon, rel=1e-12)
