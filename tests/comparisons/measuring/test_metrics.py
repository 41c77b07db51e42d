"""Metrics on motions made up for the purpose: nothing for the truth itself, and exactly what was planted otherwise."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.engines import QUICK

from dropspin import scenarios
from dropspin.comparisons.measuring.comparison import Comparison, Unresolved
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.running.run import measure
from dropspin.scenarios import Trajectory, truth_for
from dropspin.scenarios.rotations import about, multiply

DT = 1e-3
FIELDS = ("position", "orientation", "velocity", "angular_velocity")


def exact_motion(name, dt=DT, **changes):
    scene = scenarios.load(name)
    truth, t = truth_for(scene), dt * np.arange(scene.steps(dt) + 1)
    motion = truth(t[truth.covers(t)])
    return scene, Trajectory(**{field: changes.get(field, getattr(motion, field)) for field in motion.__dataclass_fields__})


@pytest.mark.sample(24)
@pytest.mark.parametrize("name", [name for name in QUICK if scenarios.load(name).recording is None])
def test_exact_solution_has_no_error(name):
    """Every metric of the exact solution is 0 to 1e-12 of its scale; metrics of an impact to the speed that one step adds."""
    scene, motion = exact_motion(name)
    turn = 1.5 * float(np.linalg.norm(motion.angular_velocity, axis=1).max())  # of the contact point about the centre, in a step
    for metric, value in measure(scene, motion).items():
        # Sampled rows are up to a step away from the impact: g dt/u, and u dt for a gap.
        near_impact = {
            "restitution_error": 2.5 * 9.8 / 4,
            "contact_momentum_error": max(2.5 * 9.8 / 4, turn),
            "contact_gap": 5.0,
            "friction_push": 1.0,
        }
        allowed = max(near_impact.get(metric, 0.0) * DT, 1e-12)
        assert abs(value) <= allowed, (metric, value)


@pytest.mark.extended
def test_catalogue_uses_every_metric():
    """The test above does not cover a metric that no scene has."""
    used = set()
    for name in QUICK:
        used |= set(measure(*exact_motion(name)))
    assert used == set(METRICS)


@pytest.mark.sample(2)
@pytest.mark.parametrize("planted", [1e-12, 1e-6, 0.1])
def test_planted_attitude_error_is_measured(planted):
    """A constant error of attitude after the start is measured as itself, whatever the sign of the quaternion."""
    scene, motion = exact_motion("spin-asymmetric")
    turned = multiply(about(np.array([0.0, 0.6, 0.8]), np.array(planted))[None], motion.orientation)
    turned[0] = motion.orientation[0]
    for sign in (1, -1):
        found = measure(scene, exact_motion("spin-asymmetric", orientation=sign * turned)[1])
        assert found["orientation_error"] == pytest.approx(planted, rel=1e-3, abs=2e-15)


def test_planted_position_energy_and_momentum_errors_are_measured():
    """1e-9 m of position; 1e-6 more spin gives 1e-6 more L and 2e-6 more energy, with its sign."""
    scene, motion = exact_motion("spin-asymmetric")
    aside = exact_motion("spin-asymmetric", position=motion.position + np.array([0, 0, 1e-9]))[1]
    assert measure(scene, aside)["position_error"] == pytest.approx(1e-9, rel=1e-6)
    for sign in (1, -1):
        faster = exact_motion("spin-asymmetric", angular_velocity=motion.angular_velocity * (1 + sign * 1e-6))[1]
        found = measure(scene, faster)
        assert found["angular_momentum_error"] == pytest.approx(1e-6, rel=1e-5)
        assert found["angular_momentum_direction_error"] <= 1e-12
        assert found["energy_error"] == pytest.approx(sign * 2e-6, rel=1e-5)


def components(name, metric, motion):
    scene = scenarios.load(name)
    return METRICS[metric].average_components([Comparison.with_truth(scene, motion, truth_for(scene))]).parts


@pytest.mark.extended
@pytest.mark.parametrize("turn", [[0.0, 0.0, 0.0], [1e-12, 0.0, 0.0], [0.0, -3e-6, 4e-6], [0.6, 0.8, -2.4], [0.0, 3.1, 0.0]])
def test_planted_attitude_error_has_its_components(turn):
    """The rotation vector, as scipy has it, whatever the sign of the quaternion."""
    _, motion = exact_motion("spin-asymmetric")
    turned = multiply(Rotation.from_rotvec(turn).as_quat()[None], motion.orientation)
    for sign in (1, -1):
        planted = exact_motion("spin-asymmetric", orientation=sign * turned)[1]
        [found] = components("spin-asymmetric", "orientation_error", planted)
        np.testing.assert_allclose(found, turn, rtol=1e-12, atol=1e-15)


def test_planted_position_and_momentum_errors_have_their_components():
    """One vector in the only flight of a spin, and one in each of two flights of a drop, at the end of its middle half."""
    _, motion = exact_motion("spin-asymmetric")
    aside = exact_motion("spin-asymmetric", position=motion.position + np.array([3e-9, 0, -4e-9]))[1]
    np.testing.assert_allclose(components("spin-asymmetric", "position_error", aside), [[3e-9, 0.0, -4e-9]], rtol=1e-6)
    faster = exact_motion("spin-asymmetric", angular_velocity=motion.angular_velocity * (1 + 1e-6))[1]
    [found] = components("spin-asymmetric", "angular_momentum_error", faster)
    assert np.linalg.norm(found) == pytest.approx(1e-6, rel=1e-5)
    scene, motion = exact_motion("drop-box-corner")
    drifting = exact_motion("drop-box-corner", position=motion.position + motion.t[:, None] * np.array([1e-9, 0.0, 0.0]))[1]
    found = components("drop-box-corner", "position_error", drifting)
    landing = truth_for(scene).events[0].time
    np.testing.assert_allclose(found[:, 0], [1e-9 * (0.75 * landing), 1e-9 * scene.duration], rtol=2.0 * DT / landing)


def test_planted_direction_of_angular_momentum_is_measured():
    """ω turned by 1e-7 about an axis square to L turns L by as much, for a ball."""
    scene = scenarios.load(
        {
            "duration": 1.0,
            "body": {"shape": "sphere", "radius": 1.0, "mass": 1.0},
            "start": {"angular_velocity": [0.0, 3.0, 0.0]},
        }
    )
    motion = truth_for(scene)(DT * np.arange(1001))
    w = motion.angular_velocity @ np.array([[1, 0, 0], [1e-7, 1, 0], [0, 0, 1]])
    turned = Trajectory(motion.t, motion.position, motion.orientation, motion.velocity, w)
    assert measure(scene, turned)["angular_momentum_direction_error"] == pytest.approx(1e-7, rel=1e-6)


def test_planted_restitution_is_measured():
    """A ball that bounces as with e = 0.51: bounce height e'² - e², restitution error 0.01, both positive."""
    scene = scenarios.load("drop-ball")
    lively = scene.model_copy(update={"floor": scene.floor.model_copy(update={"restitution": 0.51})})
    motion = truth_for(lively)(DT * np.arange(scene.steps(DT) + 1))
    found = measure(scene, motion)
    assert found["bounce_height_error"] == pytest.approx(0.51**2 - 0.25, rel=1e-9)
    assert found["restitution_error"] == pytest.approx(0.01, abs=2.5e-3)
    assert found["energy_error"] == pytest.approx(0.51**2 - 0.25, rel=1e-9)


def test_body_without_a_bounce_fails_bounce_height():
    """The flights of the exact solution say where to measure."""
    scene = scenarios.load("drop-ball")
    dead = scene.model_copy(update={"floor": scene.floor.model_copy(update={"restitution": 0.0})})
    found = measure(scene, truth_for(dead)(DT * np.arange(1501)))
    assert found["bounce_height_error"] == pytest.approx(-0.25, rel=1e-9)
    assert found["energy_error"] == pytest.approx(-0.25, rel=1e-9)
    assert found["restitution_error"] == pytest.approx(-0.5, abs=2.5e-3)


def test_body_that_falls_through_the_floor_fails():
    """Restitution is undefined, penetration is the depth, and the energy error is 0 before the impact only."""
    scene, _ = exact_motion("drop-ball")
    t = DT * np.arange(1501)
    free = scene.model_copy(update={"floor": None})
    found = measure(scene, truth_for(free)(t))
    assert np.isnan(found["restitution_error"])
    assert found["penetration"] == pytest.approx(9.8 * 1.5**2 / 2 - 1.0, rel=1e-9)
    assert found["energy_error"] == pytest.approx(0.75, rel=1e-9)  # after the first bounce; later it is out of step


def test_synchronised_energy_accounts_for_the_velocity_lag():
    """Semi-implicit Euler's free fall: synchronised energy to 1e-13, raw energy off by -M g² h t/2 over M g H."""
    scene = scenarios.load("drop-ball").model_copy(update={"floor": None, "duration": 0.4})
    h, n = 1e-3, np.arange(401)
    states = np.zeros((401, 13))
    states[:, 1] = 1.1 - 9.8 * h**2 * n * (n + 1) / 2
    states[:, 6] = 1.0
    states[:, 8] = -9.8 * h * n
    found = measure(scene, Trajectory.from_states(h * n, states, velocity_lag=h / 2))
    scale = 0.5 * (9.8 * 0.4) ** 2
    assert abs(found["energy_error"]) <= 1e-13
    assert found["energy_error_raw"] == pytest.approx(-(9.8**2) * h * 0.4 / 2 / scale, rel=1e-9)


def test_energy_gain_is_the_largest_rise():
    """Down by 20 %, then up by 5 %, then down: the gain is 5 %, the drift is the end's."""
    scene, motion = exact_motion("spin-principal")
    factor = np.interp(motion.t, [0, 3, 6, 10], [1.0, 0.8, 0.85, 0.7])
    found = measure(scene, exact_motion("spin-principal", angular_velocity=motion.angular_velocity * np.sqrt(factor)[:, None])[1])
    assert found["energy_gain"] == pytest.approx(0.05, rel=1e-6)
    assert found["energy_drift"] == pytest.approx(-0.3, rel=1e-9)


def test_sideways_push_on_a_frictionless_floor_is_measured():
    """Down to 1e-10 of the momentum."""
    scene, motion = exact_motion("drop-ball")
    pushed = motion.velocity + np.outer(motion.t > 0.45, [1e-10, 0, 0])
    found = measure(scene, exact_motion("drop-ball", velocity=pushed)[1])
    assert found["horizontal_momentum_error"] == pytest.approx(1e-10 / np.sqrt(2 * 9.8), rel=1e-9)


def test_one_nan_makes_the_metrics_nan():
    """At any row."""
    _, motion = exact_motion("drop-ball")
    assert motion.first_bad_row is None
    position = motion.position.copy()
    position[700, 2] = np.nan
    assert exact_motion("drop-ball", position=position)[1].first_bad_row == 700


def test_too_coarse_a_step_raises_unresolved():
    """Two rows of a flight do not give an apex."""
    scene, motion = exact_motion("drop-ball", dt=0.1)
    case = Comparison.with_truth(scene, motion, truth_for(scene))
    with pytest.raises(Unresolved, match=r"less than 16 steps of 0\.1 s"):
        METRICS["bounce_height_error"].average([case])


def test_planted_landing_error_is_measured():
    """A box that keeps 1 % more of its angular speed at each landing."""
    scene, motion = exact_motion("rock-block")
    landing = truth_for(scene).events[0].time
    spin = motion.angular_velocity.copy()
    spin[motion.t > landing] *= 1.01
    _, planted = exact_motion("rock-block", angular_velocity=spin)
    before, after = np.searchsorted(motion.t, landing) + np.array([-3, 3])
    assert measure(scene, planted)["landing_error"] == pytest.approx(0.01 * spin[after, 2] / 1.01 / spin[before, 2], rel=1e-9)


def test_landing_of_a_body_that_does_not_turn_is_not_a_number():
    """And NumPy does not warn of it."""
    scene, motion = exact_motion("rock-block")
    _, still = exact_motion("rock-block", angular_velocity=np.zeros_like(motion.angular_velocity))
    assert np.isnan(METRICS["landing_error"].value_or_nan([Comparison.with_truth(scene, still, truth_for(scene))]))


def test_moment_about_the_contact_point_of_a_body_at_rest_is_unresolved():
    """A ball that is thrown up in its first step: it has no speed to compare with."""
    scene, motion = exact_motion("drop-ball")
    thrown = np.where(motion.t[:, None] > 0.0, [0.0, 3.0, 0.0], 0.0) + motion.t[:, None] * scene.acceleration
    _, at_rest = exact_motion("drop-ball", velocity=thrown)
    with pytest.raises(Unresolved, match="the body is at rest before the impact"):
        METRICS["contact_momentum_error"].average([Comparison.with_truth(scene, at_rest, truth_for(scene))])


def test_planted_moment_about_the_contact_point_is_measured():
    """An impact that adds ΔL about the contact point measures ΔL over M |r| |v| in every direction."""
    scene, motion = exact_motion("drop-ball")
    landing = truth_for(scene).events[0]
    for push in ([1e-6, 0.0, 0.0], [0.0, -1e-6, 0.0], [0.0, 0.6e-6, 0.8e-6]):
        spin = motion.angular_velocity + np.where(motion.t[:, None] > landing.time, push, 0.0)
        _, planted = exact_motion("drop-ball", angular_velocity=spin)
        expected = 0.4 * 0.1**2 * 1e-6 / (0.1 * 9.8 * DT * int(landing.time / DT))  # I ω over R and the last speed before
        assert measure(scene, planted)["contact_momentum_error"] == pytest.approx(expected, rel=1e-9)
        [found] = components("drop-ball", "contact_momentum_error", planted)
        np.testing.assert_allclose(found, np.array(push) / 1e-6 * expected, rtol=1e-9, atol=1e-9 * expected)
    # A force at the contact itself, in any direction, is none.
    sideways = np.where(motion.t[:, None] > landing.time, [0.3, 0.0, 0.4], 0.0)
    spin = np.cross([0.0, -0.1, 0.0], sideways) / (0.4 * 0.1**2)
    _, planted = exact_motion("drop-ball", velocity=motion.velocity + sideways, angular_velocity=motion.angular_velocity + spin)
    assert measure(scene, planted)["contact_momentum_error"] == pytest.approx(0.0, abs=1e-14)


def test_planted_motion_after_rest_is_measured():
    """A body that comes to rest and is kicked again for a while: the time of its last motion and the rms of its last tenth."""
    scene, motion = exact_motion("drop-ball-dull")
    assert scene.duration == pytest.approx(motion.t[-1])
    kicked = motion.velocity.copy()
    late = motion.t >= 0.95 * scene.duration
    kicked[late, 1] = 0.3
    found = measure(*exact_motion("drop-ball-dull", velocity=kicked))
    last_tenth = motion.t >= 0.9 * scene.duration
    assert found["rest_jitter"] == pytest.approx(0.3 * np.sqrt(late.sum() / last_tenth.sum()), rel=1e-12)
    still = np.flatnonzero(0.5 * motion.velocity[:, 1] ** 2 > max(2 * (9.8 * DT) ** 2, 1e-6 * 9.8 * 0.1))[-1] * DT
    assert found["rest_time_error"] == pytest.approx((scene.duration - still) / still, rel=1e-9)


@pytest.mark.parametrize("name", ["drop-ball", "drop-box-anyhow", "drop-ball-lively", "rock-block"])
def test_same_flights_are_compared_at_every_default_time_step(name):
    """Finer steps would resolve further flights, in which the errors of the impacts before have grown: an error that grows as dt → 0."""
    scene = scenarios.load(name)
    truth = truth_for(scene)
    counts = []
    for dt in (4e-3, 2e-3, 1e-3, 2.5e-4):
        times = dt * np.arange(1 + scene.steps(dt))
        counts.append(len(Comparison.with_truth(scene, truth(np.minimum(times, truth.horizon)), truth).flights))
    assert len(set(counts)) == 1
    assert counts[0] >= 3


def test_flights_end_where_the_body_is_desynchronised():
    """A body whose flights are 4 % longer is compared with the exact flights only while both are in the same flight."""
    scene, motion = exact_motion("drop-ball-lively")
    late = truth_for(scene)(motion.t / 1.04)
    slow = Comparison.with_truth(scene, Trajectory(motion.t, *(getattr(late, f) for f in FIELDS)), truth_for(scene))
    sound = Comparison.with_truth(scene, motion, truth_for(scene))
    assert len(sound.flights) == 7
    assert 2 <= len(slow.flights) < 6
    frozen = Trajectory.from_states(motion.t, np.tile(scene.initial_state, (len(motion), 1)))
    assert len(Comparison.with_truth(scene, frozen, truth_for(scene)).flights) == 2


def dropped(velocity=(0.0, 0.0, 0.0), restitution=0.0):
    """A ball of 2 cm, 1 m above a floor of a restitution."""
    return scenarios.load(
        {
            "name": "dropped",
            "duration": 1.5,
            "body": {"shape": "sphere", "radius": 0.02, "mass": 0.1},
            "start": {"position": [0.0, 1.02, 0.0], "velocity": list(velocity)},
            "gravity": {"acceleration": [0.0, -9.81, 0.0]},
            "floor": {"restitution": restitution, "friction": "none"},
        }
    )


def rebounding(scene, dt, restitution, waits=0.0, stops=0.0):
    """Exact flights; the first rebound is `waits` seconds late, and the ball rests from an impact slower than `stops` on."""
    t, g = dt * np.arange(1 + scene.steps(dt)), 9.81
    states = np.tile(scene.initial_state, (len(t), 1))
    start, height, velocity = 0.0, scene.clearance, scene.start.velocity[1]
    while velocity + height > 0.0 and start < t[-1]:
        speed = np.sqrt(velocity**2 + 2.0 * g * height)
        since = np.maximum(t - start, 0.0)
        aloft = (t >= start) & (since <= (velocity + speed) / g)
        states[:, 1] = np.where(aloft, 0.02 + height + velocity * since - 0.5 * g * since**2, np.where(t >= start, 0.02, states[:, 1]))
        states[:, 8] = np.where(aloft, velocity - g * since, np.where(t >= start, 0.0, states[:, 8]))
        start, velocity, height, waits = start + (velocity + speed) / g + waits, restitution * speed if speed > stops else 0.0, 0.0, 0.0
    states[:, 0] = scene.start.velocity[0] * t
    return Trajectory.from_states(t, states)


def test_short_flight_after_the_first_impact_is_compared_or_unresolved():
    """A ball that does not rebound lacks e² of the energy, which an error of the fall alone would hide."""
    for restitution in (0.15, 0.3):
        scene = dropped(restitution=restitution)
        assert measure(scene, rebounding(scene, DT, 0.0))["energy_error"] == pytest.approx(-(restitution**2), rel=1e-9)
    scene = dropped(restitution=0.05)
    assert np.isnan(measure(scene, rebounding(scene, DT, 0.0))["energy_error"])


@pytest.mark.extended
@pytest.mark.parametrize("dt", [5e-3, 1e-3])
@pytest.mark.parametrize("kind", [{}, {"waits": 0.3}, {"stops": 0.2}, {"stops": 2.0}])
@pytest.mark.parametrize("restitution", [0.3, 0.5, 0.9])
@pytest.mark.parametrize("scene", [dropped(), dropped((2.0, 0.0, 0.0)), dropped((0.0, 1.0, 0.0)), dropped(restitution=0.05)])
def test_rebound_of_a_body_that_should_stay_down_is_measured(scene, restitution, kind, dt):
    """e² of the height from which it falls, above what the exact body has, for a rebound at once, after 0.3 s or that ends in rest."""
    up = scene.start.velocity[1]
    fallen = 1.0 + up**2 / (2.0 * 9.81)
    found = measure(scene, rebounding(scene, dt, restitution, **kind))
    speed = np.sqrt(2.0 * 9.81 * fallen)
    assert found["bounce_height_error"] == pytest.approx((restitution**2 - scene.floor.restitution**2) * fallen, abs=2.0 * speed * dt)


@pytest.mark.parametrize("dt", [5e-3, 1e-3])
@pytest.mark.parametrize("scene", [dropped(), dropped((2.0, 0.0, 0.0)), dropped(restitution=0.05)])
def test_body_that_stays_down_has_no_bounce_height_error(scene, dt):
    """Neither has the exact motion; one that lies deeper has this depth."""
    exact = truth_for(scene)(dt * np.arange(1 + scene.steps(dt)))
    assert abs(measure(scene, exact)["bounce_height_error"]) < 2.5e-3 * bool(scene.floor.restitution) + 1e-12
    deeper = exact.position - 1e-3 * (exact.t > truth_for(scene).events[0].time)[:, None] * np.array([0.0, 1.0, 0.0])
    sunk = Trajectory(exact.t, deeper, exact.orientation, exact.velocity, exact.angular_velocity)
    assert measure(scene, sunk)["bounce_height_error"] == pytest.approx(-1e-3, abs=1e-12)
    shorter = Comparison(scene, sunk, exact[:-2], tuple(event.time for event in truth_for(scene).events))  # as of a later start phase
    assert METRICS["bounce_height_error"].average([shorter]).value == pytest.approx(-1e-3, abs=1e-12)


def test_energy_after_an_impact_counts_though_the_flight_before_is_much_longer():
    """A ball that rebounds with 0.15 flies for 0.3 times as long as it fell."""
    scene = dropped(restitution=0.15)
    truth = truth_for(scene)
    exact = truth(np.arange(0.0, 1.0, 1e-3))
    first, second = (event.time for event in truth.events[:2])
    states = exact.states.copy()
    states[(exact.t > first) & (exact.t < second), 7:10] *= 1.5
    case = Comparison.with_truth(scene, Trajectory.from_states(exact.t, states, 0.0), truth)
    assert METRICS["energy_error"].value([case]) > 0.005


def test_root_mean_square_over_start_phases_has_no_sign():
    """Two flights as far too high as too low have the mean 0, of which no single run knows."""
    scene, motion = exact_motion("drop-ball")
    metric, truth, cases = METRICS["bounce_height_error"], truth_for(scene), []
    for factor in (1.02, 0.98):
        height = motion.position.copy()
        height[motion.t > truth.events[0].time, 1] *= factor
        cases.append(Comparison.with_truth(scene, exact_motion("drop-ball", position=height)[1], truth))
    single = [metric.root_mean_square([case]) for case in cases]
    assert single == pytest.approx([abs(metric.value([case])) for case in cases])
    assert abs(metric.value(cases)) < 0.05 * min(single)
    assert metric.root_mean_square(cases) == pytest.approx(np.sqrt(np.mean(np.square(single))))
