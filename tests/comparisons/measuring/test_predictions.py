"""Predicted errors compared with measured ones: in flight to six digits, in a flat bounce to the resolution of the start phases."""

import numpy as np
import pandas as pd
import pytest
from mpmath import mp, mpf
from support.brief_runs import few_starts, phases_of
from support.engines import CORE, QUICK

import dropspin as ds
from dropspin import scenarios
from dropspin.scenarios import discrete_flight, load
from dropspin.scenarios.state import PARTS

ENGINES = ["wang", "wang[rotation=exact]", "mujoco", "pybullet"]
FREE = [name for name in QUICK if load(name).floor is None]


@pytest.fixture(scope="module")
def flat():
    """The scenes of bounces that do not turn the body."""
    return [name for name in QUICK if scenarios.truth_for(load(name)).name == "bounce-ladder" and load(name).starts_above_floor]


@pytest.fixture(scope="module")
def rows_of(core_run):
    """Call it with scenes and time steps: the measurements and predictions of these, or of more, with the three engines."""
    core = ds.load_results(core_run, arrays=False)

    def rows(names, dts, *others):
        with few_starts():
            beyond = ds.run([name for name in names if name not in CORE], ["wang", "mujoco", "pybullet"], dts)
        return tuple(pd.concat([getattr(one, kind) for one in (core, beyond, *others)]) for kind in ("measurements", "predictions"))

    return rows


def measured_and_predicted(rows, names, dts):
    keys = ["scene", "engine", "dt", "metric"]
    measured, predicted = (found[found["scene"].isin(names) & found["dt"].isin(dts)].set_index(keys)["value"] for found in rows)
    return measured.loc[predicted.index], predicted


@pytest.mark.extended
def test_errors_in_flight_are_the_predicted_ones(rows_of):
    """All errors of `wang`, and of the others where the spin is steady, to a relative 1e-6 or to 1e-9 (measured 2e-10): 250 values."""
    dts = [4e-3, 1e-3]
    measured, predicted = measured_and_predicted(rows_of(FREE, dts, ds.run(FREE, "wang[rotation=exact]", dts)), FREE, dts)
    assert len(predicted) > 250
    assert set(predicted.index.get_level_values("engine")) == set(ENGINES)
    np.testing.assert_allclose(measured, predicted, rtol=1e-6, atol=1e-9)
    note = predicted.xs(("spin-asymmetric", "wang", 1e-3), level=("scene", "engine", "dt"))
    assert note["angular_momentum_direction_error"] == pytest.approx(0.7532, abs=1e-4)  # a model error, predicted like any other


@pytest.mark.sample(1)
@pytest.mark.parametrize("dt", [2e-3, 1e-3])
def test_errors_of_flat_bounces_are_the_predicted_ones(rows_of, flat, dt):
    """To what n phases leave of the speed at detection, g dt/(2n), and of the depth there, (1 - e²) u dt/(2n); and to the next order."""
    measured, predicted = measured_and_predicted(rows_of(flat, [dt]), flat, [dt])
    assert len(flat) >= 5
    for key, value in predicted.items():
        scene, share = load(key[0]), 1 / (2 * phases_of(key[0]))
        u, e = np.sqrt(2 * 9.8 * scene.clearance), scene.floor.restitution
        if key[3] == "restitution_error":
            change = 9.8 * dt / u
            assert measured[key] == pytest.approx(value, rel=change * (share + change), abs=1e-10), key
        else:
            allowed = (1 - e**2) * u * dt * share / scene.clearance + 4 * dt**2 * u**2
            assert measured[key] == pytest.approx(value, abs=allowed), key


def test_discrete_flight_equals_the_recursion():
    """Eq 1 and eq 6 stepped 200 times with 40 digits, to 1e-13."""
    scene = load("fall-spin")
    found = discrete_flight(scene, 5e-3)
    with mp.workdps(40):
        h, start = mpf(5e-3), scene.initial_state
        x, q, v, w = ([mpf(c) for c in start[part]] for part in PARTS.values())
        for _ in range(200):
            v = [v[i] + h * mpf(scene.acceleration[i]) for i in range(3)]
            x = [x[i] + h * v[i] for i in range(3)]
            a, b, c, s = q
            rate = [
                w[0] * s + w[1] * c - w[2] * b,
                w[1] * s + w[2] * a - w[0] * c,
                w[2] * s + w[0] * b - w[1] * a,
                -w[0] * a - w[1] * b - w[2] * c,
            ]
            q = [q[i] + h / 2 * rate[i] for i in range(4)]
            length = mp.sqrt(sum(component**2 for component in q))
            q = [component / length for component in q]
    expected = [float(value) for value in (*x, *q, *v, *w)]
    np.testing.assert_allclose(found.states[200], expected, rtol=0, atol=1e-13 * 5)
    with pytest.raises(ValueError, match="scene 'drop-ball' is not an undamped free flight"):
        discrete_flight(load("drop-ball"), 1e-3)


def test_no_prediction_without_theory():
    """A tumbling body (except with `wang`), oblique impacts, Runge-Kutta, and steps in which Bullet limits the rotation."""
    tumble, corner, fast = load("spin-asymmetric"), load("drop-box-corner"), load("spin-principal-500")
    for name in ("wang[rotation=exact]", "mujoco", "pybullet"):
        assert ds.engine(name).predicted_error(tumble, scenarios.truth_for(tumble), "orientation_error", 1e-3) is None
    for name in ENGINES:
        assert ds.engine(name).predicted_error(corner, scenarios.truth_for(corner), "restitution_error", 1e-3) is None
    rk4 = ds.engine("mujoco[integrator=rk4]")
    assert rk4.predicted_error(fast, scenarios.truth_for(fast), "position_error", 1e-3) is None
    bullet = ds.engine("pybullet")
    assert bullet.predicted_error(fast, scenarios.truth_for(fast), "orientation_error", 1e-3) is not None
    assert bullet.predicted_error(fast, scenarios.truth_for(fast), "orientation_error", 2e-3) is None
