"""Causes, orders and asymptotic errors of engines whose faults are known."""

import math
from itertools import product

import numpy as np
import pytest
from support import engines as made

import dropspin as ds
from dropspin.comparisons.judging.convergence import Claim, SeriesPoint, convergence
from dropspin.comparisons.judging.judge import judge_asymptotic_error, judge_order
from dropspin.comparisons.measuring.metric import Average

STEPS = [8e-3, 4e-3, 2e-3]


def study(results, metric, kind):
    rows = results.table[(results.table["metric"] == metric) & (results.table["kind"] == kind)]
    return rows.iloc[0] if len(rows) else None


def run(scene, engine, dts=STEPS):
    return ds.run(scene, engine, dts)


@pytest.mark.extended
@pytest.mark.parametrize(
    ("engine", "cause", "order"),
    [
        ("wang", "model", None),
        ("wang[rotation=gyroscopic]", "discretisation", 1),
        ("wang[rotation=implicit-gyroscopic]", "discretisation", 1),
        ("mujoco", "discretisation", 1),
        ("mujoco[integrator=implicitfast]", "discretisation", 1),
        ("pybullet", "discretisation", 1),
        ("wang[rotation=midpoint]", "discretisation", 2),
        ("mujoco[integrator=rk4]", "discretisation", 4),
        ("wang[rotation=rk4]", "discretisation", 4),
        ("wang[rotation=exact]", "rounding", None),
    ],
)
def test_cause_and_order_of_the_attitude_error_are_those_of_the_method(engine, cause, order):
    """An asymmetric brick in free flight: the cause that theory gives for each method, and its order within .1 (measured within .03)."""
    seconds = 30.0 if engine == "wang" else 10.0  # the error that is known of Wang's method is that after 30 s
    brick = ds.load("spin-asymmetric").model_copy(update={"duration": seconds})
    found = run(brick, engine, [6.4e-2, 3.2e-2, 1.6e-2] if order == 4 else [8e-3, 4e-3, 2e-3])
    limit, observed = study(found, "orientation_error", "asymptotic_error"), study(found, "orientation_error", "order")
    assert limit["cause"] == cause
    assert (found.measurements.loc[found.measurements["metric"] == "orientation_error", "cause"] == cause).all()
    assert found.exit_code() == 0
    if order is not None:
        assert observed["value"] == pytest.approx(order, abs=0.1)
        assert observed["verdict"] == "passed"
        assert abs(limit["value"]) <= limit["upper"]


def test_irregular_convergence_is_no_model_error():
    """The orientation errors [rad] of a turning box that PyBullet stopped irregularly at time steps of 16 to 1 ms.

    The lengths alone seem to pass 0 and to approach 0.036 rad; no component of the rotation does.
    """
    measured = {
        0.016: (0.06102862, 0.00046202, 0.06075899, -0.0003589),
        0.008: (0.0491381, -0.00390358, 0.0439638, 0.00854031),
        0.004: (0.03651882, -0.00193137, 0.02833807, -0.00096796),
        0.002: (0.02364607, -0.00354537, 0.01834405, 0.00796453),
        0.001: (0.00437256, 6.76060838e-08, 4.37256262e-03, -1.20820929e-07),
    }
    scene = ds.load("draw-2026-039")
    series = [
        SeriesPoint(dt, scene.steps(dt), average([length]), average([components]), 3e-8) for dt, (length, *components) in measured.items()
    ]
    claim, metric = Claim("pybullet", None, np.float64), ds.METRICS["orientation_error"]
    error = judge_asymptotic_error(scene, claim, metric, convergence(scene, claim, metric, series))
    assert (error.cause, error.verdict) == ("unresolved", "measured")
    assert "no component grows" in error.reason


def test_reason_states_the_interval_that_components_widen():
    """A length that halves, and components that change irregularly: the interval reaches as far as theirs."""
    scene, components = ds.load("spin-asymmetric"), [(2e-3, 1e-3, 0.0), (0.5e-3, -1e-3, 0.0), (1e-3, 0.6e-3, 0.0)]
    series = [
        SeriesPoint(dt, scene.steps(dt), average([2.0 * dt]), average([each]), 3e-8)
        for dt, each in zip((4e-3, 2e-3, 1e-3), components, strict=True)
    ]
    found = convergence(scene, Claim("mine", None, np.float64), ds.METRICS["orientation_error"], series).budget
    assert (found.cause, found.upper > 5e-3) == ("discretisation", True)
    assert f"up to {found.upper:.2g} may remain" in found.reason


def cause_of(measured, metric="energy_error"):
    """The cause of a ball's error, whose parts at each time step are given: a row for each flight that the step resolves."""
    scene = ds.load("drop-ball")
    series = [SeriesPoint(dt, scene.steps(dt), average(parts), None, 1e-9) for dt, parts in measured.items()]
    return convergence(scene, Claim("mine", None, np.float64), ds.METRICS[metric], series).budget


def test_flights_that_a_coarse_step_does_not_resolve_are_judged():
    """After the impact an error of 0.26 remains. A step that resolves only the fall, which has no error, must not hide it."""
    fall, rises = [1e-16, 0.0], {0.008: [0.263, 0.0], 0.004: [0.260, 0.0], 0.002: [0.2601, 0.0]}
    after = {dt: [fall, rise] for dt, rise in rises.items()}
    assert cause_of(after).cause == "model"
    assert cause_of({0.016: [fall]} | after).cause == "model"
    assert cause_of({0.016: [fall], 0.008: after[0.008], 0.004: after[0.004]}).cause == "unresolved"


def test_an_error_that_changes_its_sign_at_the_finest_step_does_not_vanish():
    """The energy is too large by a share that falls to 0 at 1 ms, where it is too small by rounding."""
    found = cause_of({0.004: [[0.9701, 0.0]], 0.002: [[0.3334, 0.0]], 0.001: [[0.0, -3.28e-7]]})
    assert found.cause == "unresolved"
    assert found.upper > 0.1


def test_the_error_of_the_other_sign_may_be_the_one_that_remains():
    """The largest loss falls with the time step, and the smaller gain does not."""
    steps = {0.004: [[0.002, -0.0084]], 0.002: [[0.002, -0.0042]], 0.001: [[0.002, -0.0021]]}
    found = cause_of(steps)
    assert (found.cause, found.asymptotic_error) == ("model", pytest.approx(0.002, rel=1e-6))


def test_interval_of_an_error_that_vanishes_contains_the_limit_of_the_other_sign():
    """The largest loss vanishes; the smallest one, which is smaller at each step, ends as a gain of 3.5e-5."""
    found = cause_of({dt: [[3.5e-5 - 0.105 * dt, -0.13 * dt]] for dt in (0.004, 0.002, 0.001)})
    assert found.cause != "model"
    assert found.lower < 0.0
    assert found.upper > 3.5e-5
    assert "vanishes" not in found.reason


def test_error_that_grows_as_fast_as_the_inverse_time_step_is_a_model_error():
    """That of an engine that ignores the time step, and simulates longer with finer ones; slower growth and small errors may be chance."""

    def found(*errors, resolution=0.0):
        scene, parts = ds.load("drop-ball"), [Average(np.array([error]), *np.full((2, 1), resolution)) for error in errors]
        series = [SeriesPoint(dt, scene.steps(dt), each, None, 1e-9) for dt, each in zip((0.004, 0.002, 0.001), parts, strict=True)]
        return convergence(scene, Claim("mine", None, np.float64), ds.METRICS["bounce_height_error"], series).budget

    grown = found(-0.376, -15.3, -77.1)
    assert (grown.cause, grown.upper) == ("model", -77.1)
    assert "grows at least as fast as 1/dt" in grown.reason
    assert found(0.376, 15.3, 77.1, resolution=10.0).lower == pytest.approx(62.1)
    assert found(0.02, 0.03, 0.04).cause == "unresolved"
    assert found(0.376e-4, 15.3e-4, 77.1e-4).cause == "unresolved"
    assert found(0.01, 0.05, 0.2, resolution=0.2).cause == "unresolved"  # within the sampling noise
    assert found(0.01, -0.05, 0.2).cause == "unresolved"
    assert found(0.0, 1e-4, 0.3).cause == "unresolved"  # at one time step alone


def average(parts):
    """An average with these parts, without sampling noise."""
    return Average(np.array(parts, ndmin=1), *np.zeros((2, *np.shape(parts))))


def test_bounce_converges_at_first_order_after_averaging_start_phases(core_run):
    """With e = .9 all three engines: apex and restitution, at order 1 or at rounding."""
    found = ds.load_results(core_run, arrays=False)
    lively = found.table[found.table["scene"] == "drop-ball-lively"]
    orders = lively[(lively["kind"] == "order") & lively["metric"].isin(["bounce_height_error", "restitution_error"])]
    assert len(orders) == 5  # PyBullet's restitution is exact
    np.testing.assert_allclose(orders["value"], 1.0, atol=0.02)
    assert "drop-ball-lively" not in set(found.asymptotic_errors("model")["scene"])


@pytest.mark.extended
@pytest.mark.parametrize("more", [1.003, 0.997])
def test_small_restitution_fault_is_a_model_error(more):
    """.3 % of restitution in a first-order engine are found without any bound of the scene."""

    class TooLively(made.Exact):
        name = "too-lively"
        order = 1.0

        def prepare(self, scene, dt):
            # The note's error of first order on top, so that the fault is not the only one.
            restitution = more * scene.floor.restitution + 0.5 * 9.8 * dt / math.sqrt(2 * 9.8)
            floor = scene.floor.model_copy(update={"restitution": restitution})
            return made.ExactSimulation(scene.model_copy(update={"floor": floor}), dt)

    found = run("drop-ball", TooLively(), ds.DEFAULT_DTS)
    limit = study(found, "bounce_height_error", "asymptotic_error")
    assert (limit["cause"], limit["verdict"]) == ("model", "failed")
    assert limit["lower"] <= 0.25 * (more**2 - 1) <= limit["upper"]
    assert limit["upper"] - limit["lower"] < 1e-4  # measured 5.5e-5, with two steps added to the three


def test_error_that_a_finer_step_removes_is_no_model_error():
    """A contact solver that is unstable above 0.8 ms has the same error at 4, 2 and 1 ms; half of the finest is tried."""

    class Unstable(made.Exact):
        name = "unstable"
        order = 1.0

        def prepare(self, scene, dt):
            restitution = scene.floor.restitution * (1.0 if dt < 0.8e-3 else 1.1) + 1e-2 * dt
            floor = scene.floor.model_copy(update={"restitution": restitution})
            return made.ExactSimulation(scene.model_copy(update={"floor": floor}), dt)

    found = run("drop-ball", Unstable(), ds.DEFAULT_DTS)
    limit = study(found, "bounce_height_error", "asymptotic_error")
    assert limit["cause"] == "unresolved"
    assert limit["reason"].endswith("(with 0.0005 s added)")
    assert limit["verdict"] == "measured"


def test_restitution_that_vanishes_with_dt_is_a_model_error():
    """An engine that loses its bounce as the step shrinks."""

    class Vanishing(made.Exact):
        name = "vanishing"

        def prepare(self, scene, dt):
            floor = scene.floor.model_copy(update={"restitution": 0.5 * min(1.0, dt / 32e-3)})
            return made.ExactSimulation(scene.model_copy(update={"floor": floor}), dt)

    limit = study(run("drop-ball", Vanishing()), "bounce_height_error", "asymptotic_error")
    assert limit["verdict"] == "failed"


class WithError(made.Exact):
    """Exact except for an attitude error that depends on the time step."""

    name = "with-error"
    error = staticmethod(lambda dt: 0.0)

    def prepare(self, scene, dt):
        return made.ExactSimulation(scene, dt, made.turned_by(type(self).error(dt)))


def with_error(order, error):
    return type("Made", (WithError,), {"order": order, "error": staticmethod(error), "__doc__": "made"})()


@pytest.mark.extended
@pytest.mark.parametrize(
    ("claimed", "error", "verdict"),
    [
        (1.0, lambda dt: dt, "passed"),
        (4.0, lambda dt: dt, "failed"),
        (2.0, lambda dt: dt, "failed"),
        (1.0, lambda dt: dt * dt, "passed"),
        (math.inf, lambda dt: dt, "failed"),
        (None, lambda dt: dt, "measured"),
    ],
)
def test_order_below_the_claimed_one_fails(claimed, error, verdict):
    """First order fails where second, fourth or exactness is claimed; without a claim any order passes."""
    scene = ds.load("spin-principal").model_copy(update={"duration": 0.4})
    found = run(scene, with_error(claimed, error))
    assert study(found, "orientation_error", "order")["verdict"] == verdict


@pytest.mark.parametrize(("power", "verdict"), [(8, "passed"), (6, "failed"), (3, "failed")])
def test_claim_of_a_higher_order_than_those_of_intervals_is_compared_with_the_fitted_one(power, verdict):
    series = [SeriesPoint(dt, 100, average([[1e3 * (25.0 * dt) ** power * (1.0 - dt)]]), None, 0.0) for dt in (0.04, 0.02, 0.01)]
    claim, metric = Claim("made", 8.0, np.float64), ds.METRICS["energy_error"]
    assert judge_order(claim, metric, convergence(ds.load("spin-principal"), claim, metric, series)).verdict == verdict


def test_claim_of_exactness_fails_where_an_error_has_no_order():
    """It vanishes and changes its sign, so that no power of the time step can be fitted."""
    parts = [np.array([[value]]) for value in (1e-2, 1e-5, -1e-6)]
    series = [SeriesPoint(dt, 100, Average(part, 0.0 * part, 0.0 * part), None, 0.0) for dt, part in zip(STEPS, parts, strict=True)]
    claim, metric = Claim("made", math.inf, np.float64), ds.METRICS["energy_error"]
    order = judge_order(claim, metric, convergence(ds.load("spin-principal"), claim, metric, series))
    assert order.verdict == "failed"
    assert math.isnan(order.tolerance)


def test_tolerance_of_an_order_about_a_model_error():
    """The largest change of the slope of the errors minus the asymptotic error, of which one error passes 0."""
    steps, errors, change = [16e-3, 8e-3, 4e-3, 2e-3, 1e-3], np.array([0.03, 0.01, 0.0, -0.005, -0.0075]), 1e-6
    series = [SeriesPoint(dt, 100, average([[value]]), None, change) for dt, value in zip(steps, errors, strict=True)]
    found = convergence(ds.load("spin-principal"), Claim("made", None, np.float64), ds.METRICS["energy_error"], series)
    assert (found.budget.cause, found.budget.dts) == ("model", tuple(steps[-3:]))

    def slope(signs):
        rest = errors[-3:] - found.budget.asymptotic_error + change * np.array(signs)
        return np.polyfit(np.log(steps[-3:]), np.log(rest), 1)[0]

    largest = max(abs(slope(signs) - slope([0.0])) for signs in product((-1, 1), repeat=3))
    assert found.order_tolerance == pytest.approx(largest, rel=1e-3)


def test_exact_engine_has_rounding_errors_only():
    """Errors within rounding have no order, and a claim of exactness passes."""
    found = run("spin-principal", made.Exact())
    assert study(found, "orientation_error", "order") is None
    assert study(found, "orientation_error", "asymptotic_error")["cause"] == "rounding"
    assert found.exit_code() == 0


def test_known_fault_is_allowed_for_the_named_engine_only(core_run):
    """The plateau is expected of `wang`; the same plateau of another engine fails."""
    table = ds.load_results(core_run, arrays=False).table.query("scene == 'spin-asymmetric' and engine == 'wang'")
    [known] = table.query("metric == 'angular_momentum_direction_error' and kind == 'asymptotic_error'").to_dict("records")
    assert (known["cause"], known["verdict"]) == ("model", "known")
    assert "fault of Wang's method" in known["reason"]
    scene = ds.load("spin-asymmetric").model_copy(update={"duration": 2.0})
    other = run(scene, with_error(None, lambda dt: 0.7))
    assert study(other, "orientation_error", "asymptotic_error")["verdict"] == "failed"
    assert other.exit_code() == 1


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("scene", "engine"),
    [
        ("spin-asymmetric", "wang[rotation=rk4]"),
        ("spin-dzhanibekov", "wang[rotation=rk4]"),
        ("spin-damped", "wang[rotation=rk4]"),
    ],
)
def test_method_of_the_project_raises_no_false_alarm(scene, engine):
    """An order of 3.62 fitted through an error of 5e-14 and one of 3.75 are within the interval of fourth order."""
    assert ds.run(scene, engine).exit_code() == 0


def test_lost_attitude_is_a_known_fault_and_does_not_pass():
    table = ds.run("spin-principal-500", "wang").table
    [row] = table[(table["metric"] == "orientation_error") & (table["kind"] == "truth") & (table["dt"] == 1e-3)].to_dict("records")
    assert row["value"] == pytest.approx(math.pi, abs=1e-3)
    assert row["verdict"] == "known"


def test_residuals_of_contact_solvers_are_no_model_errors():
    """A drift of 5e-7 m does not matter to a box that slides by 1.5 m, whatever the engine."""

    def distort(state, time):
        return state + 5e-7 * np.eye(13)[0]

    assert run("slide-box", made.engine_with("drifting", distort)).exit_code() == 0
