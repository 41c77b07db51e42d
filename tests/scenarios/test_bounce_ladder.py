"""The bounce ladder compared with sums of single bounces by mpmath, and its range of validity."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dropspin.scenarios import load, truth_for
from dropspin.scenarios.rotations import about, multiply, rotate


def ball(restitution=0.5, height=1.0, g=9.8, velocity=(0.0, 0.0, 0.0), spin=(0.0, 0.0, 0.0), duration=3.0, **floor):
    return load(
        {
            "duration": duration,
            "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0},
            "start": {"position": [0.0, 0.1 + height, 0.0], "velocity": list(velocity), "angular_velocity": list(spin)},
            "gravity": {"acceleration": [0.0, -g, 0.0]},
            "floor": {"restitution": restitution, "friction": "none"} | floor,
        }
    )


@pytest.mark.parametrize(("restitution", "zeno"), [(0.3, 0.838972), (0.5, 1.355262), (0.7, 2.559939), (0.9, 8.583325)])
def test_impacts_accumulate_at_zeno_s_time(restitution, zeno):
    """The impacts accumulate at t₀ + 2 u₀ e / (g (1 - e)); published to six decimals for a drop of 1 m."""
    truth = truth_for(ball(restitution, duration=zeno + 0.01))
    assert truth.events[-1].time == pytest.approx(zeno, abs=1e-6)
    assert truth([zeno + 0.005]).position[0, 1] == pytest.approx(0.1, abs=1e-15)
    assert truth([zeno + 0.005]).velocity[0, 1] == 0.0


@given(st.floats(0.05, 1.0), st.floats(0.01, 20), st.floats(-3, 3))
def test_bounces_match_sums_with_forty_digits(restitution, height, upward):
    """Ten bounces summed one by one with 40 digits: times, speeds and apexes to 1e-13 relative."""
    truth = truth_for(ball(restitution, height, velocity=(0.0, upward, 0.0), duration=20.0))
    with mpmath.mp.workdps(40):
        g, e = mpmath.mpf(9.8), mpmath.mpf(restitution)
        lowest = mpmath.mpf(0.1 + height) - mpmath.mpf(0.1)
        speed = mpmath.sqrt(mpmath.mpf(upward) ** 2 + 2 * g * lowest)
        time = (mpmath.mpf(upward) + speed) / g
        first = speed
        for event in truth.events[:10]:
            assert event.time == pytest.approx(float(time), rel=1e-13)
            assert -event.before[8] == pytest.approx(float(speed), rel=1e-12)
            speed *= e
            if speed <= 1e-12 * first:
                assert event.after[8] == 0.0  # counts as rest
                break
            assert event.after[8] == pytest.approx(float(speed), rel=1e-12)
            half = time + speed / g
            if half < 20:
                apex = truth([float(half)]).position[0, 1]
                assert apex == pytest.approx(0.1 + float(speed**2 / (2 * g)), rel=1e-12)
            time += 2 * speed / g


def test_ball_of_restitution_1_rebounds_to_the_drop_height():
    truth = truth_for(ball(1.0, duration=100.0))
    assert len(truth.events) == math.floor((100 + math.sqrt(2 / 9.8)) / (2 * math.sqrt(2 / 9.8)))
    assert all(event.after[8] == pytest.approx(math.sqrt(19.6), rel=1e-13) for event in truth.events)


def test_ball_of_restitution_0_rests_after_one_impact():
    truth = truth_for(ball(0.0))
    assert len(truth.events) == 1
    np.testing.assert_array_equal(truth([1.0, 2.0]).velocity, 0.0)


def test_rest_speed_ends_the_ladder():
    """Restitution is 0 from the first impact that is slower than rest_speed: u = 4.43, 2.21, 1.11, 0.55 m/s."""
    truth = truth_for(ball(0.5, rest_speed=1.0))
    assert [round(float(event.after[8]), 3) for event in truth.events] == [2.214, 1.107, 0.553, 0.0]


def test_frictionless_floor_changes_neither_sideways_motion_nor_spin():
    truth = truth_for(ball(velocity=(2.0, 0.0, -1.0), spin=(0.0, 3.0, 4.0)))
    end = truth([2.5])
    np.testing.assert_allclose(end.position[0, [0, 2]], [5.0, -2.5], rtol=1e-15)
    np.testing.assert_array_equal(end.angular_velocity[0], [0.0, 3.0, 4.0])


def test_bounce_ladder_is_limited_to_its_range_of_validity():
    """Not with friction and sideways motion, for a tilted box, or with damping."""
    assert truth_for(ball(velocity=(1.0, 0.0, 0.0), friction="infinite")).name == "ball-impact"
    assert truth_for(ball(spin=(1.0, 0.0, 0.0), friction=0.3)).name == "ball-impact"
    assert truth_for(ball(friction="infinite")).name == "bounce-ladder"
    box = ball().model_dump(exclude_none=True)
    box["body"] = {"shape": "box", "mass": 1.0, "half_extents": [0.1, 0.1, 0.1]}
    assert truth_for(load(box)).name == "bounce-ladder"
    box["start"]["orientation"] = [0.0, 0.0, 0.1, 1.0]
    assert truth_for(load(box)).name == "edge-impact"
    assert truth_for(load(ball().model_dump(exclude_none=True) | {"damping": {"linear": 0.1}})) is None


def test_times_outside_the_horizon_are_rejected():
    with pytest.raises(ValueError, match="the exact solution 'bounce-ladder' is valid for 0 <= t <= 3 s"):
        truth_for(ball())([-0.1])
    with pytest.raises(ValueError, match="the exact solution 'bounce-ladder' is valid for 0 <= t <= 3 s"):
        truth_for(ball())([3.1])


def test_a_later_origin_of_time_ends_the_solution_as_much_earlier():
    truth = truth_for(ball())
    later = truth.after(0.25)
    assert later.horizon == truth.horizon - 0.25
    assert [event.time for event in later.events] == [event.time - 0.25 for event in truth.events]
    t = np.array([0.0, 0.3, 2.0])
    np.testing.assert_array_equal(later(t).states, truth(t + 0.25).states)


@pytest.mark.parametrize("height", [0.0, 1e-17, 5e-11])
def test_ball_within_rounding_of_the_floor_rests_on_it(height):
    """At restitution 1 it does not bounce a nanometre high a billion times."""
    truth = truth_for(ball(1.0, height, duration=1000.0))
    assert truth is not None
    np.testing.assert_allclose(truth([0.0, 1000.0]).position[:, 1], 0.1, rtol=0, atol=1e-10)


def test_ladder_of_too_many_bounces_is_replaced_by_a_hundred_impacts():
    """A million bounces would not fit into memory."""
    truth = truth_for(ball(1.0, 1e-6, duration=3600.0))
    assert (truth.name, len(truth.events)) == ("ball-impact", 100)


def test_flat_box_may_spin_about_the_vertical_only():
    """On a frictionless floor it then lands flat."""
    box = ball().model_dump(exclude_none=True)
    box["body"] = {"shape": "box", "mass": 1.0, "half_extents": [0.1, 0.1, 0.3]}
    box["start"] |= {"angular_velocity": [0.0, 3.0, 0.0]}
    truth = truth_for(load(box))
    assert truth.name == "bounce-ladder"
    turned = truth([0.5]).orientation[0]
    np.testing.assert_allclose(turned, [0, np.sin(0.75), 0, np.cos(0.75)], atol=1e-15)
    assert truth_for(load(box | {"floor": {"restitution": 0.5, "friction": "infinite"}})) is None
    box["start"] |= {"angular_velocity": [0.1, 3.0, 0.0]}
    assert truth_for(load(box)) is None or truth_for(load(box)).name != "bounce-ladder"


@pytest.mark.parametrize("half", [[0.3, 0.1, 0.2], [0.1, 0.2, 0.3]])
def test_a_flat_box_does_not_turn_over_by_rounding(half):
    """Its attitude is rounded, and about the intermediate axis rounding grows by e in 13 ms: the solution ends before that shows."""
    half_turn = math.sqrt(0.5)
    upright = multiply(about(np.array([0.0, 1.0, 0.0]), np.array(0.7)), np.array([half_turn, 0.0, 0.0, half_turn]))
    start = {"position": [0.0, 0.5 + half[2], 0.0], "orientation": upright.tolist(), "angular_velocity": [0.0, 50.0, 0.0]}
    scene = load(
        {
            "duration": 5.0,
            "body": {"shape": "box", "half_extents": half, "mass": 1.0},
            "start": start,
            "gravity": {"acceleration": [0.0, -9.8, 0.0]},
            "floor": {"restitution": 0.9, "friction": "none"},
        }
    )
    truth = truth_for(scene)
    assert truth.name == "bounce-ladder"
    is_intermediate = half == [0.3, 0.1, 0.2]
    assert (truth.horizon < 1.0) == is_intermediate
    assert all(event.time <= truth.horizon for event in truth.events)
    motion = truth(np.linspace(0.0, truth.horizon, 501))
    vertical = rotate(motion.orientation, np.array([0.0, 0.0, 1.0]))
    assert np.hypot(vertical[:, 0], vertical[:, 2]).max() < 1e-7
    later = truth_for(scene.starting_at(motion.states[100]))
    assert later is not None
    np.testing.assert_allclose(later([0.05]).position, truth([motion.t[100] + 0.05]).position, atol=1e-12)


@pytest.mark.parametrize("inertia", ["surface", [0.003, 0.004, 0.0035]])
def test_a_spinning_ball_of_any_inertia_bounces_on_a_frictionless_floor_and_turns_as_in_free_flight(inertia):
    ladder = ball(spin=(3.0, 1.0, -2.0), velocity=(0.4, 0.0, 0.1), duration=2.0)
    scene = load(ladder.model_dump(exclude_none=True) | {"body": ladder.body.model_dump(exclude_none=True) | {"inertia": inertia}})
    truth, free = truth_for(scene), truth_for(load(scene.model_dump(exclude_none=True, exclude={"floor"})))
    assert (truth.name, truth.horizon) == ("bounce-ladder", 2.0)
    t = np.linspace(0.0, 2.0, 50)
    found, flying = truth(t), free(t)
    np.testing.assert_array_equal(found.orientation, flying.orientation)
    np.testing.assert_array_equal(found.angular_velocity, flying.angular_velocity)
    np.testing.assert_array_equal(found.position[:, 1], truth_for(ladder)(t).position[:, 1])


def test_a_box_that_slides_without_friction_is_not_said_to_rest():
    box = {"shape": "box", "half_extents": [0.3, 0.1, 0.2], "mass": 1.0}
    start, floor = {"position": [0.0, 0.1, 0.0], "velocity": [1.0, 0.0, 0.5]}, {"restitution": 0.5, "friction": "none"}
    scene = load({"duration": 1.0, "body": box, "start": start, "gravity": {"acceleration": [0.0, -9.8, 0.0]}, "floor": floor})
    assert truth_for(scene).statement.startswith("the body slides on the floor at a constant velocity")


@pytest.mark.parametrize("offset", [0.0, 0.1, 0.25])
def test_a_box_rests_on_its_face_wherever_its_centre_of_mass_is_above_it(offset):
    """It lands so that it stays flat only if the mean of its lowest points is under its centre of mass."""
    box = {"shape": "box", "half_extents": [0.3, 0.1, 0.2], "mass": 1.0, "center_of_mass": [offset, 0.0, 0.0], "inertia": [0.002] * 3}
    scene = {"duration": 1.0, "body": box, "gravity": {"acceleration": [0.0, -9.8, 0.0]}, "floor": {"restitution": 0.5, "friction": 0.4}}
    truth = truth_for(load(scene | {"start": {"position": [0.0, 0.1, 0.0]}}))
    assert truth.name == "bounce-ladder"
    np.testing.assert_array_equal(truth([0.0, 1.0]).position, [[0.0, 0.1, 0.0]] * 2)
    falling = truth_for(load(scene | {"start": {"position": [0.0, 0.3, 0.0]}}))
    assert (falling is None) == (offset > 0.0)


@pytest.mark.parametrize(("lean", "rests"), [(0.0, True), (0.15, True), (0.25, False)])
def test_a_leaning_prism_rests_only_with_its_centre_of_mass_above_its_base(lean, rests):
    """Its upper face is shifted by twice the lean beside the lower one, which reaches 0.2 m to each side of its middle."""
    base = np.array([(0.2, -0.1, 0.2), (-0.2, -0.1, 0.2), (-0.2, -0.1, -0.2), (0.2, -0.1, -0.2)]) - [lean, 0.0, 0.0]
    points = np.vstack([base, base + np.array([2.0 * lean, 0.2, 0.0])]).tolist()
    body = {"shape": "vertices", "points": points, "mass": 1.0, "inertia": "vertices"}
    floor, gravity = {"restitution": 0.0, "friction": "infinite"}, {"acceleration": [0.0, -9.8, 0.0]}
    scene = load({"duration": 1.0, "body": body, "start": {"position": [0.0, 0.1, 0.0]}, "gravity": gravity, "floor": floor})
    truth = truth_for(scene)
    assert (truth is not None and truth.name == "bounce-ladder") == rests


def growths_of_a_tilt(impacts, u, e, lever, inertia):
    """Of a disturbance of the spin, after each impact: a tilt φ moves the lowest point by (ρ - h) φ, the lever times φ.

    Then dω = -M (1 + e) u (ρ - h) φ / I for an impact at the speed u.
    """
    tilt, rate, t, found = 0.0, 1.0, u / 9.8, []
    for _ in range(impacts):
        tilt += rate * t
        rate -= (1.0 + e) * u * lever * tilt / inertia
        u *= e
        t = 2.0 * u / 9.8
        found.append(abs(rate))
    return np.array(found)


@pytest.mark.parametrize(("half_extents", "impacts"), [([0.3, 0.2, 0.1], 1), ([0.1, 0.1, 0.1], 11)])
def test_a_ladder_ends_where_impacts_have_amplified_a_tilt_of_a_curved_body(half_extents, impacts):
    """With ρ the radius of curvature; a sphere has ρ = h."""
    a, _, h = half_extents
    body = {"shape": "ellipsoid", "half_extents": half_extents, "mass": 1.0}
    start = {"position": [0.0, 1.0 + h, 0.0], "orientation": list(about(np.array([1.0, 0.0, 0.0]), np.asarray(np.pi / 2)))}
    floor, gravity = {"restitution": 0.9, "friction": "none"}, {"acceleration": [0.0, -9.8, 0.0]}
    truth = truth_for(load({"duration": 6.0, "body": body, "start": start, "gravity": gravity, "floor": floor}))
    assert (truth.name, len(truth.events)) == ("bounce-ladder", impacts)
    growths = growths_of_a_tilt(impacts + 1, math.sqrt(2.0 * 9.8), 0.9, a**2 / h - h, 0.2 * (a**2 + h**2))
    assert (growths[-1] > 1e4) == (truth.horizon < 6.0)
    assert (growths[:-1] < 1e4).all()


@pytest.mark.parametrize(("e", "below"), [(0.9, 0.03), (0.5, 0.03), (0.9, 0.0)])
def test_a_ladder_of_a_lying_capsule_ends_where_impacts_have_amplified_its_roll(e, below):
    """With ρ the radius; its centre of mass is below its axis, or on it."""
    inertia, half = (0.05, 0.004, 0.05), float(np.sqrt(0.5))
    body = {"shape": "capsule", "radius": 0.1, "half_length": 0.3, "mass": 1.0, "inertia": inertia, "center_of_mass": [0.0, 0.0, -below]}
    scene = {"duration": 3.0, "body": body, "floor": {"restitution": e, "friction": "none"}, "gravity": {"acceleration": [0.0, -9.8, 0.0]}}
    truth = truth_for(load(scene | {"start": {"position": [0.0, 0.5, 0.0], "orientation": [0.0, half, half, 0.0]}}))
    growths = growths_of_a_tilt(30, math.sqrt(2.0 * 9.8 * (0.4 + below)), e, below, 0.004)
    expected = int(np.argmax(growths > 1e4)) if growths.max() > 1e4 else None
    assert truth.name == "bounce-ladder"
    assert (len(truth.events) if truth.horizon < 3.0 else None) == expected


def test_a_spin_on_the_point_of_an_ellipsoid_is_known_until_it_is_unstable():
    """Small turns φ, χ about the level axes of the body, of moments A and B, with C about the vertical and k = M g (ρ - h) for each.

    A φ'' = (A + B - C) ω χ' - (k_a + (C - B) ω²) φ,  B χ'' = -(A + B - C) ω φ' - (k_b + (C - A) ω²) χ
    """
    A, C, B = inertia = (0.0085, 0.001, 0.008)
    body = {"shape": "ellipsoid", "half_extents": [0.3, 0.1, 0.2], "mass": 1.0, "inertia": inertia}
    for spin, height in ((27.0, 0.1), (27.0, 0.3), (5.0, 0.1)):
        start = {"position": [0.0, height, 0.0], "angular_velocity": [0.0, spin, 0.0]}
        floor, gravity = {"restitution": 0.0, "friction": "none"}, {"acceleration": [0.0, -9.8, 0.0]}
        truth = truth_for(load({"duration": 10.0, "body": body, "start": start, "gravity": gravity, "floor": floor}))
        k_a, k_b = 9.8 * (0.2**2 / 0.1 - 0.1), 9.8 * (0.3**2 / 0.1 - 0.1)
        turning = (A + B - C) * spin
        p, q = k_a + (C - B) * spin**2, k_b + (C - A) * spin**2
        squares = np.roots([A * B, A * q + B * p + turning**2, p * q])  # of the rates λ
        growth = float(np.sqrt(squares.astype(complex)).real.max())
        rest = math.sqrt(2.0 * (height - 0.1) / 9.8)
        assert truth.name == "bounce-ladder"
        assert truth.horizon == pytest.approx(min(10.0, rest + math.log(1e4) / growth) if growth > 1e-6 else 10.0, rel=1e-6)


def test_a_spin_of_a_solid_ellipsoid_about_its_shortest_axis_is_stable():
    body = {"shape": "ellipsoid", "half_extents": [0.3, 0.1, 0.2], "mass": 1.0}
    start = {"position": [0.0, 0.1, 0.0], "angular_velocity": [0.0, 27.0, 0.0]}
    floor, gravity = {"restitution": 0.0, "friction": "none"}, {"acceleration": [0.0, -9.8, 0.0]}
    assert truth_for(load({"duration": 10.0, "body": body, "start": start, "gravity": gravity, "floor": floor})).horizon == 10.0


def test_an_edge_with_a_vertex_within_it_is_no_face():
    """Two descriptions of one body: a prism whose lower edge has an end in the middle too."""
    edge, top = [[-0.1, 0.0, 0.0], [0.1, 0.0, 0.0]], [[0.0, 0.2, 0.05], [0.0, 0.2, -0.05]]

    def truth(points):
        body = {"shape": "vertices", "points": points, "mass": 1.0, "inertia": [0.001] * 3, "center_of_mass": [0.0, 0.1, 0.0]}
        scene = {"body": body, "start": {"position": [0.0, 0.5, 0.0]}, "floor": {"restitution": 0.3, "friction": "infinite"}}
        return truth_for(load(scene | {"duration": 3.0, "gravity": {"acceleration": [0.0, -9.8, 0.0]}}))

    plain, divided = truth([*edge, *top]), truth([*edge, [0.0, 0.0, 0.0], *top])
    assert plain.name == "edge-impact"
    assert (divided.horizon, divided.ends) == (plain.horizon, plain.ends)
    t = np.linspace(0.0, plain.horizon, 20)
    np.testing.assert_array_equal(divided(t).states, plain(t).states)
