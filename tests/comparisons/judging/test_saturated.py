"""Errors that are as large as they can be at coarse steps, unusable at the finest one, or hidden by those of another flight."""

import math

import numpy as np
import pytest
from support import engines as made

import dropspin as ds
from dropspin.comparisons.judging.convergence import Claim, Convergence, SeriesPoint, convergence, is_refuted
from dropspin.comparisons.judging.error_budget import ErrorBudget, error_budget
from dropspin.comparisons.judging.judge import judge_asymptotic_error
from dropspin.comparisons.measuring.metric import Average

MINE = Claim("mine", None, np.float64)
STEPS = 2.0 ** -np.arange(5)


def judged(scene, metric, measured):
    """The convergence, and the judgement of the asymptotic error, of means without sampling noise, for each time step [s]."""
    series = []
    for dt, parts in measured.items():
        average = Average(np.array(parts), *np.zeros((2, *np.shape(parts))))
        series.append(SeriesPoint(dt, scene.steps(dt), average, None, 1e-9))
    found = convergence(scene, MINE, ds.METRICS[metric], series)
    return found, judge_asymptotic_error(scene, MINE, ds.METRICS[metric], found)


def flights(metric, *parts):
    """The same for flights of a dropped ball at 4, 2 and 1 ms."""
    return judged(ds.load("drop-ball"), metric, dict(zip([4e-3, 2e-3, 1e-3], parts, strict=True)))[0].budget


@pytest.mark.parametrize(("value", "is_stated"), [(3.1, True), (1e-12, False), (math.nan, False)])
def test_orientation_that_saturates_at_the_finest_step_is_undecided(value, is_stated):
    """Nothing is stated of an error that is negligible or that the finest step does not resolve."""
    _, judgement = judged(ds.load("spin-asymmetric"), "orientation_error", {4e-3: [3.12], 2e-3: [3.13], 1e-3: [value]})
    assert (judgement is not None) == is_stated
    if judgement is not None:
        assert (judgement.cause, judgement.verdict, math.isnan(judgement.upper)) == ("unresolved", "measured", True)


def test_run_with_an_orientation_that_saturates_has_an_undecided_trend():
    def turned(state, time):
        state[3:7] = [0.0, 0.0, 1.0, 0.0] if time else state[3:7]
        return state

    class Turned(made.Exact):
        name = "turned"

        def prepare(self, scene, dt):
            return made.ExactSimulation(scene, dt, turned)

    scene = ds.load("fall-spin").model_copy(update={"duration": 0.04, "expect": ()})
    results = ds.run(scene, Turned(), [4e-3, 2e-3, 1e-3])
    status = results.statuses()["fall-spin"]["turned"]
    assert (status.verdict, status.reason) == ("passed", "trend undecided")


@pytest.mark.parametrize("last", [math.nan, math.inf, -math.inf])
def test_coarser_steps_do_not_stand_for_the_finest_one(last):
    """Errors of first order, of which the finest is not a number."""
    found = error_budget(STEPS, [*STEPS[:4], last], resolution=0.0)
    assert (found.cause, math.isnan(found.asymptotic_error)) == ("unresolved", True)
    assert found.reason.startswith("the error at the finest time step is not usable")
    assert error_budget(STEPS, [last, *STEPS[1:]], resolution=0.0).cause == "discretisation"


@pytest.mark.parametrize("finest", [0.3, 1.0, 3.0, 5.0])
@pytest.mark.parametrize("shape", [lambda x: 1.0 - np.exp(-x), lambda x: x / (1.0 + x), lambda x: np.tanh(0.6 * x)])
@pytest.mark.parametrize("count", [3, 4, 5])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_bounded_error_that_vanishes_is_no_model_error(finest, shape, count, sign):
    """Energy that damping takes in proportion to the step: all of it at coarse steps, none as dt → 0."""
    errors = sign * shape(finest * STEPS[:count] / STEPS[count - 1])
    found = error_budget(STEPS[:count], errors, resolution=0.0)
    assert found.cause != "model"
    assert found.lower <= 0.0 <= found.upper


def test_error_that_falls_ever_less_remains_a_model_error():
    assert error_budget(STEPS, 0.5 + 0.1 * STEPS, resolution=0.0).cause == "model"
    noisy = 0.5 + 1e-4 * np.array([3.0, 1.0, -1.0, -3.5, -9.0])  # falls ever faster, by less than the noise
    assert error_budget(STEPS, noisy, resolution=3e-4).cause == "model"


def test_flight_that_is_largest_at_a_coarser_step_is_judged_too():
    """The second flight is right at 1 ms alone: it is not within rounding at every time step."""
    found = flights("energy_error", [[0.001, 0.0], [0.56, 0.0]], [[0.001, 0.0], [0.56, 0.0]], [[1e-15, 0.0], [4e-16, 0.0]])
    assert found.cause == "unresolved"
    assert found.upper > 0.1


def test_smaller_error_of_another_flight_that_remains_is_a_model_error():
    """The error of the second flight vanishes; the first one keeps 0.0011, above what may remain of the second."""
    found = flights("energy_error", [[0.0011, 0.0], [0.0204, 0.0]], [[0.00111, 0.0], [0.0101, 0.0]], [[0.001115, 0.0], [0.005025, 0.0]])
    assert (found.cause, found.asymptotic_error) == ("model", pytest.approx(0.00112, rel=0.01))
    vanishing = flights("energy_error", *([[0.1 * dt, 0.0], [5.0 * dt, 0.0]] for dt in (4e-3, 2e-3, 1e-3)))
    assert vanishing.cause == "discretisation"


def test_impact_within_the_first_step_is_no_model_error():
    """A ball is thrown at the floor, which it reaches at 0.37 ms: of each time step, the whole height depends on that share of it."""
    ball = ds.load(
        {
            "duration": 0.7,
            "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0},
            "start": {"position": [0.0, 0.1015, 0.0], "velocity": [0.0, -4.0, 0.0]},
            "gravity": {"acceleration": [0.0, -9.8, 0.0]},
            "floor": {"restitution": 0.8, "friction": "none"},
        }
    )
    results = ds.run(ball, "mujoco", [4e-3, 2e-3, 1e-3])
    assert results.exit_code() == 0
    assert results.asymptotic_errors("model").empty


def test_energy_that_is_lost_at_coarse_steps_is_no_model_error():
    """PyBullet, of a box at 100 rad/s: coarser steps, at which all is lost, look like a model error, which the finer one refutes."""
    box = {"shape": "box", "half_extents": [0.1, 0.2, 0.3], "mass": 1.0}
    scene = ds.load({"duration": 20.0, "body": box, "start": {"angular_velocity": [0.3, 100.0, 0.3]}})
    results = ds.run(scene, "pybullet", [4e-3, 2e-3, 1e-3])
    assert results.exit_code() == 0
    assert results.asymptotic_errors("unresolved")["metric"].tolist().count("energy_error") == 1


def test_finer_step_without_a_usable_error_refutes_no_model_error():
    """An orientation that is wrong by 2.82 rad at 1 ms saturates at 0.5 ms."""

    class Turned(made.Exact):
        name = "turned"

        def prepare(self, scene, dt):
            return made.ExactSimulation(scene, dt, made.turned_by(2.86 - 40.0 * dt))

    scene = ds.load("fall-spin").model_copy(update={"duration": 0.2, "expect": ()})
    results = ds.run(scene, Turned(), [4e-3, 2e-3, 1e-3])
    assert results.statuses()["fall-spin"]["turned"].verdict == "failed"
    assert results.asymptotic_errors("model")["metric"].tolist() == ["orientation_error"]


@pytest.mark.parametrize(
    ("cause", "finest", "expected"),
    [
        ("discretisation", 0.55, True),
        ("unresolved", 0.45, True),
        ("unresolved", -0.45, True),
        ("unresolved", 0.49, False),
        ("unresolved", 0.55, False),
        ("unresolved", math.nan, False),
        ("model", 0.3, False),
    ],
)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_model_error_is_refuted_by_a_finer_error_that_vanishes_or_is_clearly_nearer_to_0(cause, finest, expected, sign):
    """It is 0.52 at the finest step and estimated as 0.5, of either sign."""
    found = Convergence(ErrorBudget("model", "", 0.5 * sign, *sorted([0.4 * sign, 0.6 * sign])), 1e-3, finest_error=0.52 * sign)
    finer = Convergence(ErrorBudget(cause, "", 0.0, -1.0, 1.0), 5e-4, finest_error=finest)
    assert is_refuted(found, finer) == expected


def test_errors_of_exactly_0_at_the_finest_step_are_not_within_rounding_at_every_step():
    found = flights("energy_error", [[0.0, 0.0], [0.56, 0.0]], [[0.0, 0.0], [0.56, 0.0]], [[0.0, 0.0], [0.0, 0.0]])
    assert (found.cause, found.upper > 0.1) == ("unresolved", True)


def test_model_error_beside_a_flight_whose_error_saturates_is_stated():
    """The second flight is wrong by 3 rad at every step, which measures nothing; the first one approaches 0.5 rad."""
    box = ds.load("drop-box-corner")
    found, _ = judged(box, "angular_momentum_direction_error", {dt: [0.5 + 0.01 * dt, 3.0] for dt in (4e-3, 2e-3, 1e-3)})
    assert (found.budget.cause, found.budget.asymptotic_error) == ("model", pytest.approx(0.5, abs=0.01))
