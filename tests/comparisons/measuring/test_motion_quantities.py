"""Metrics without a reference solution: closed forms and 30 digits, by NumPy for one motion and compiled for many side by side."""

import mpmath
import numpy as np
import pytest

from dropspin.comparisons.measuring.batch_quantities import motions_side_by_side
from dropspin.comparisons.measuring.metrics import energy_drift, energy_gain, penetration
from dropspin.comparisons.measuring.motion_quantities import Motions, Setup
from dropspin.comparisons.sweeps.outcomes import standard_metrics
from dropspin.scenarios import Trajectory, load

DT = 0.01
BALL = {
    "name": "ball",
    "duration": 1.0,
    "body": {"shape": "sphere", "radius": 0.1, "mass": 2.0},
    "start": {"position": [0.0, 1.1, 0.0]},
    "gravity": {"acceleration": [0.0, -10.0, 0.0]},
    "floor": {"restitution": 0.5, "friction": "none"},
}


def one(scene, states, lag=0.0):
    return Motions.of(scene, Trajectory.from_states(DT * np.arange(len(states)), states, lag))


def in_a_batch(scene, states, lag=0.0):
    """The same motion beside another one, longer than it, so that its rows are padded; of the results, those of this motion."""
    longer = np.concatenate([states, np.tile([0.0, 9.0, 0.0, 0.0, 0.0, 0.0, 1.0, 9.0, 9.0, 9.0, 9.0, 9.0, 9.0], (5, 1))])
    setup = Setup.of_starts([scene])
    last = np.array([len(longer) - 1, len(states) - 1])
    both, valid = motions_side_by_side(setup, np.array([longer[::-1], longer]), np.full(2, DT), np.full(2, lag), last, 1e-5)
    assert valid.all()
    return both


@pytest.fixture(params=["one", "batch"])
def measured(request):
    """A function from a scene, states and a property or metric to its value, by each of the two paths."""

    def value(scene, states, quantity, lag=0.0):
        motions = one(scene, states, lag) if request.param == "one" else in_a_batch(scene, states, lag)
        found = quantity(motions)
        return found if request.param == "one" else found[1]

    return value


def bouncing(steps=100, restitution=0.5):
    """A ball dropped by 1 m under 10 m/s², exactly: it strikes the floor at √0.2 s = 0.4472 s."""
    states = np.zeros((steps + 1, 13))
    states[:, 6] = 1.0
    impact = np.sqrt(0.2)
    for row in range(steps + 1):
        t = DT * row
        rising = restitution * 10.0 * impact
        states[row, 1] = 1.1 - 5.0 * t**2 if t < impact else 0.1 + rising * (t - impact) - 5.0 * (t - impact) ** 2
        states[row, 8] = -10.0 * t if t < impact else rising - 10.0 * (t - impact)
    return states


def test_first_contact_is_the_step_of_the_impact(measured):
    scene = load(BALL)
    assert measured(scene, bouncing(), lambda m: m.first_contact[0]) == 44
    assert measured(scene, bouncing(), lambda m: m.first_contact[1]) == 45
    assert measured(scene, bouncing(40), lambda m: m.first_contact[0]) == -1
    without_floor = load({key: value for key, value in BALL.items() if key != "floor"})
    assert measured(without_floor, bouncing(), lambda m: m.first_contact[0]) == -1


def test_contact_that_lasts_to_the_end_ends_at_the_last_row(measured):
    states = bouncing(60)
    states[45:, 8] = 0.0
    assert measured(load(BALL), states, lambda m: m.first_contact[1]) == 60


def test_rebound_is_the_apex_after_the_first_contact(measured):
    """(R + e² H) / (R + H); the apex, e √(2 H / g) after the impact, is between two rows: g dt²/8 at most."""
    assert measured(load(BALL), bouncing(), lambda m: m.rebound) == pytest.approx((0.1 + 0.25) / 1.1, abs=10 * DT**2 / 8 / 1.1)
    assert measured(load(BALL), bouncing(40), lambda m: m.rebound) == 0.0


def test_energy_scale_is_that_of_the_fall_or_of_the_start(measured):
    """M g H = 20 J for the ball; M v²/2 = 25 J where it is larger; M g times the size, 2 J, for a ball that starts on the floor."""
    states = bouncing()
    assert measured(load(BALL), states, lambda m: m.energy_scale) == pytest.approx(20.0, rel=1e-14)
    states[0, 7] = 5.0
    assert measured(load(BALL), states, lambda m: m.energy_scale) == pytest.approx(25.0, rel=1e-14)
    lying = load(BALL | {"start": {"position": [0.0, 0.1, 0.0]}})
    assert measured(lying, np.tile(lying.initial_state, (9, 1)), lambda m: m.energy_scale) == pytest.approx(2.0, rel=1e-14)


def test_energy_metrics_of_the_exact_bounce(measured):
    """No drift before the impact; none of the energy comes back after it."""
    assert abs(measured(load(BALL), bouncing(), energy_drift)) < 1e-14
    assert abs(measured(load(BALL), bouncing(), energy_gain)) < 1e-14


def test_energy_gain_is_the_largest_rise_above_any_earlier_value(measured):
    """Heights of 1.1, 0.6, 0.8, 0.3 and 0.7 m at rest: 0.4 m of the 1 m of the fall; drift up to the first contact."""
    states = np.tile(load(BALL).initial_state, (5, 1))
    states[:, 1] = [1.1, 0.6, 0.8, 0.3, 0.7]
    assert measured(load(BALL), states, energy_gain) == pytest.approx(0.4, rel=1e-13)
    states[1:, 8] = 5.0  # the floor pushes between rows 0 and 1 already
    assert measured(load(BALL), states, energy_drift) == 0.0
    falling = bouncing(40)
    falling[:, 1] += np.linspace(0.0, 0.05, 41)
    assert measured(load(BALL), falling, energy_drift) == pytest.approx(0.05, rel=1e-12)


def test_penetration_is_the_depth_of_the_lowest_point(measured):
    """A box with a corner straight down; the deepest of the rows; 0 where none is below the floor."""
    box = load(BALL | {"body": {"shape": "box", "half_extents": [0.3, 0.2, 0.6], "mass": 1.0}})
    states = np.tile(box.initial_state, (4, 1))
    diagonal = np.array([0.3, 0.2, 0.6])
    axis = np.cross(diagonal, [0.0, -1.0, 0.0])
    angle = np.arccos(-0.2 / 0.7)
    states[:, 3:7] = [*(np.sin(angle / 2) * axis / np.linalg.norm(axis)), np.cos(angle / 2)]
    states[:, 1] = [0.8, 0.65, 0.68, 0.9]
    assert measured(box, states, penetration) == pytest.approx(0.05, rel=1e-13)
    states[:, 1] = 0.75
    assert measured(box, states, penetration) == 0.0


def test_last_row_in_motion_is_the_last_above_the_threshold(measured):
    """At rest is slower than 2 g dt = 0.2 m/s: of speeds 1, 0.21, 0.19 and 0.1 m/s, the second; row 0 if it never moves."""
    states = np.tile(load(BALL).initial_state, (4, 1))
    states[:, 7] = [1.0, 0.21, 0.19, 0.1]
    assert measured(load(BALL), states, lambda m: m.last_row_in_motion) == 1
    states[:, 7] = 0.1
    assert measured(load(BALL), states, lambda m: m.last_row_in_motion) == 0


def random_scene(seed):
    """Points in general position: an inertia tensor without a zero; gravity in a general direction."""
    random = np.random.default_rng(seed)
    return load(
        BALL
        | {
            "body": {"shape": "vertices", "points": random.normal(size=(6, 3)).tolist(), "mass": 2.0},
            "start": {"position": [0.1, 4.0, -0.3]},
            "gravity": {"acceleration": random.normal(size=3).tolist()},
            "damping": {"linear": 0.1, "angular": 0.2},
        }
    )


def random_states(seed, rows=30):
    states = np.random.default_rng(1000 + seed).normal(size=(rows, 13))
    states[:, 3:7] /= np.linalg.norm(states[:, 3:7], axis=1)[:, np.newaxis]
    return states


@pytest.mark.parametrize("seed", range(5))
def test_energy_and_lowest_height_of_general_states_to_30_digits(measured, seed):
    """½ M v² + ½ ω·R I Rᵀ ω - M g·(x - origin) + lag M g·v, and the least y + (R p)_y."""
    scene, states, lag = random_scene(seed), random_states(seed), 0.005
    energies, heights = [], []
    with mpmath.workdps(30):
        inertia, g = mpmath.matrix(scene.body.inertia_tensor.tolist()), mpmath.matrix(scene.acceleration.tolist())
        origin = mpmath.matrix([0.0, scene.body.resting_height, 0.0])
        for state in states.tolist():
            x, (a, b, c, d), v, w = mpmath.matrix(state[0:3]), state[3:7], mpmath.matrix(state[7:10]), mpmath.matrix(state[10:13])
            a, b, c, d = map(mpmath.mpf, (a, b, c, d))
            turn = mpmath.matrix(
                [
                    [1 - 2 * (b * b + c * c), 2 * (a * b - c * d), 2 * (a * c + b * d)],
                    [2 * (a * b + c * d), 1 - 2 * (a * a + c * c), 2 * (b * c - a * d)],
                    [2 * (a * c - b * d), 2 * (b * c + a * d), 1 - 2 * (a * a + b * b)],
                ]
            )
            spin = turn.T * w
            kinetic = (2 * (v.T * v)[0] + (spin.T * inertia * spin)[0]) / 2
            energies.append(float(kinetic - 2 * (g.T * (x - origin))[0] + mpmath.mpf(lag) * 2 * (g.T * v)[0]))
            heights.append(float(x[1] + min((turn * mpmath.matrix(p))[1] for p in scene.body.vertices.tolist())))
    found = measured(scene, states, lambda m: m.states.energy, lag)[: len(states)]
    np.testing.assert_allclose(found, energies, rtol=0.0, atol=1e-14 * np.abs(energies).max())
    found = measured(scene, states, lambda m: m.states.lowest_height)[: len(states)]
    reached = np.isfinite(found)
    np.testing.assert_allclose(found[reached], np.array(heights)[reached], rtol=0.0, atol=1e-14)
    assert (np.array(heights)[~reached] >= 0.0).all()


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("without", [(), ("damping",), ("floor",), ("gravity", "damping")])
def test_metrics_of_general_motions_have_the_same_bits_in_a_batch(seed, without):
    scene = load({key: value for key, value in random_scene(seed).model_dump(exclude_none=True).items() if key not in without})
    states = random_states(seed)
    states[10:13, 7:10] = states[10, 7:10] + DT * np.arange(3)[:, np.newaxis] * scene.acceleration  # a flight of two steps
    alone = Motions.of(scene, Trajectory.from_states(DT * np.arange(len(states)), states, 0.005))
    together = in_a_batch(scene, states, 0.005)
    np.testing.assert_array_equal(alone.states.energy, together.states.energy[1, : len(states)])
    for quantity in ("energy_scale", "rebound", "last_row_in_motion", "first_flight_end"):
        assert getattr(alone, quantity) == getattr(together, quantity)[1], quantity
    for rows, in_batch in zip(alone.first_contact, together.first_contact, strict=True):
        assert rows == in_batch[1]
    drift, gain, depth = standard_metrics(together)[1, :3]
    assert (drift, gain) == (
        (energy_drift(alone), energy_gain(alone)) if scene.damping is None else (pytest.approx(np.nan, nan_ok=True),) * 2
    )
    assert depth == (penetration(alone) if scene.floor is not None else pytest.approx(np.nan, nan_ok=True))


@pytest.mark.parametrize("fault", [np.nan, np.inf, 2.0])
@pytest.mark.parametrize("column", [0, 5, 12])
def test_states_that_are_not_valid_are_reported(fault, column):
    """Not finite, or a quaternion that is not of length 1; rows after the last one do not count."""
    states = np.array([bouncing(20)] * 3)
    states[0, 10, column] = states[1, 20, column] = fault
    last = np.array([20, 19, 20])
    _, valid = motions_side_by_side(Setup.of_starts([load(BALL)]), states, np.full(3, DT), np.zeros(3), last, 1e-5)
    np.testing.assert_array_equal(valid, [fault == 2.0 and column != 5, True, True])
