"""The factors of Algorithm 1: velocities after n steps compared with c^n v₀ in 50 digits, at the factors' time step and at others."""

import numpy as np
import pytest
from mpmath import mp, mpf
from scipy.spatial.transform import Rotation

import dropspin as ds
from dropspin.comparisons.measuring.batch_quantities import motions_side_by_side
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.motion_quantities import Setup
from dropspin.comparisons.sweeps.parts import run_jobs
from dropspin.comparisons.sweeps.spec import load_sweep
from dropspin.scenarios import Trajectory, truth_for
from dropspin.scenarios.field_names import with_fields
from dropspin.scenarios.variations import in_units

V, W, C, K, DT = 5.0, 3.0, 0.999, 0.98, 0.015  # m/s, rad/s, factors of a step of DT
EPS = np.finfo(float).eps  # the factor and its product are rounded by half of it in each step; measured 0.4 of that, in PyBullet


def thrown(**changed):
    body = {"shape": "box", "half_extents": [0.1, 0.2, 0.3], "mass": 2.0}
    start = {"velocity": [V, 0.0, 0.0], "angular_velocity": [0.0, 0.0, W]}
    damping = {"linear_factor": C, "angular_factor": K, "factor_dt": DT}
    return ds.load({"name": "thrown", "duration": 6.0, "body": body, "start": start, "damping": damping} | changed)


def decayed(n, steps_of_c):
    """Velocities after n steps of which each multiplies by the factors to a power, from 50 digits."""
    with mp.workdps(50):
        return [float(start * mpf(factor) ** (n * mpf(steps_of_c))) for start, factor in ((V, C), (W, K))]


@pytest.mark.parametrize("dt", [DT, 2 * DT, DT / 2])
@pytest.mark.parametrize("engine", ["wang", "mujoco", "mujoco[integrator=implicitfast]", "pybullet"])
def test_velocities_decay_by_the_factors(engine, dt):
    """Per step of any size in Wang's method, which says so, and per time in the exact solution and the other engines."""
    scene, n = thrown(), round(6.0 / dt)
    simulation = ds.engine(engine).prepare(scene, dt)
    last = simulation.record(n)[-1]
    own, exact = decayed(n, 1), decayed(n, dt / DT)
    np.testing.assert_allclose(truth_for(scene)([n * dt]).states[0][[7, 12]], exact, rtol=n * EPS)
    np.testing.assert_allclose(last[[7, 12]], own if engine == "wang" else exact, rtol=n * EPS)
    assert len(simulation.known_limitations) == (engine == "wang" and dt != DT)
    for limitation in simulation.known_limitations:
        assert f"damp {DT / dt:.3g} times" in limitation.message
        assert limitation.explained_errors["angular_momentum_error"] == pytest.approx(1.1 / 4.0, rel=1e-3)  # of K^n - K^2n, where K^n = ½


@pytest.mark.extended
def test_limitation_of_factors_explains_the_error_of_steps_of_another_size():
    """Expectations that it fails with half the time step are `limited`, for each rotation; at the factors' own step, they fail."""
    expected = [
        {"metric": metric, "dt": DT / 2, "below": 1e-3, "reason": "too strict"}
        for metric in ("orientation_error", "angular_momentum_error")
    ]
    table = ds.run(thrown(expect=expected), ["wang", "wang[rotation=exact]"], dt=[DT / 2]).table
    judged = table[table["metric"].isin(["orientation_error", "angular_momentum_error"]) & (table["kind"] != "asymptotic_error")]
    assert set(judged["verdict"]) == {"limited"}
    assert judged["reason"].str.contains("damp 2 times as much").all()
    [expected] = [one | {"dt": DT} for one in expected if one["metric"] == "orientation_error"]
    table = ds.run(thrown(expect=[expected], duration=60.0, start={"angular_velocity": [0.0, 0.0, 60.0]}), "wang", dt=[DT]).table
    assert table.set_index("metric").loc["orientation_error", "verdict"] == "failed"  # (60 rad/s 15 ms)²/12 of the angle, by eq 6


def test_batch_and_single_simulations_have_the_same_bits_and_limitations():
    scene = thrown()
    members = [scene, with_fields(scene, [("damping.linear_factor", 0.99), ("damping.factor_dt", 0.02)])]
    batch = ds.engine("wang").prepare_batch(members, 0.01)
    rows = batch.record(20)
    for member, row in zip(members, rows, strict=True):
        single = ds.engine("wang").prepare(member, 0.01)
        np.testing.assert_array_equal(single.record(20), row)
        assert batch.limitations_of(member, row) == single.known_limitations


def test_scene_keeps_its_factors_where_it_is_stored_or_changed():
    """In a run's folder as rates with their time step; a sweep changes a factor, and units change the time step."""
    scene = thrown()
    assert ds.load(scene.model_dump(exclude={"origin"}, exclude_none=True)).digest == scene.digest
    changed = with_fields(scene, [("damping.angular_factor", 0.5)]).damping
    assert changed.factors == pytest.approx({"linear_factor": C, "angular_factor": 0.5}, rel=1e-15)
    minutes = in_units(scene, time=1.0 / 60.0).damping
    assert minutes.factor_dt == pytest.approx(DT / 60.0)
    assert minutes.factors == pytest.approx(scene.damping.factors, rel=1e-15)


def test_loss_per_step_is_no_contact():
    """A flight by Wang's method at a fifteenth of the time step, whose loss of speed no rate explains, touches no floor."""
    scene, dt = thrown(gravity={"acceleration": [0.0, -9.8, 0.0]}), DT / 15
    motion = Trajectory.from_states(dt * np.arange(1001.0), ds.engine("wang").prepare(scene, dt).record(1000), 0.5 * dt)
    assert motion.velocity[-1, 0] == pytest.approx(V * C**1000)
    assert not Comparison(scene, motion).states.touching.any()
    times = np.array([dt])
    many, _ = motions_side_by_side(Setup.of_starts([scene]), motion.states[None], times, 0.5 * times, np.array([1000]), 1e-9)
    assert not many.states.touching.any()


def test_sweep_over_factors_and_time_steps_has_the_closed_form(tmp_path):
    """The jobs of Wang's method, side by side: c^n v₀ for each factor, whatever the time step."""
    (tmp_path / "thrown.toml").write_text(
        'duration = 1.0\n[body]\nshape = "sphere"\nradius = 0.1\nmass = 1.0\n[start]\nvelocity = [5.0, 0.0, 0.0]\n'
        "[damping]\nlinear_factor = 0.999\nfactor_dt = 0.015\n"
    )
    grid = {"dt": [0.01, 0.02], "damping.linear_factor": [0.9, 0.99], "damping.factor_dt": [0.01, 0.03]}
    sweep = load_sweep({"scenes": [str(tmp_path / "thrown.toml")], "engines": ["wang"], "grid": grid})
    outcomes, [jobs] = run_jobs(sweep, 0, sweep.size), sweep.jobs(0, sweep.size)
    expected = V * jobs.values["damping.linear_factor"] ** outcomes.steps
    np.testing.assert_allclose(outcomes.state[:, 7], expected, rtol=100 * EPS)


@pytest.mark.parametrize(
    ("floor", "tolerance"), [({}, 1e-12), ({"floor": {"restitution": 0.5, "friction": 0.3}}, 1e-5)], ids=["flight", "impacts"]
)
def test_mujoco_damps_a_body_of_any_axes_as_by_its_principal_axes(floor, tolerance):
    """One body, by its principal axes and by others: the same motion; MuJoCo's meshes have vertices in single precision, which is 1e-6."""
    points = np.array([[0.2, 0.0, 0.1], [-0.1, 0.3, 0.0], [0.0, -0.2, 0.25], [0.1, 0.1, -0.3]])
    points -= points.mean(axis=0)
    turn = Rotation.from_rotvec([0.4, -0.9, 0.7])
    starts = Rotation.from_rotvec([0.3, 0.2, -0.5]), turn.as_matrix()
    tables = {"duration": 1.0, "gravity": {"acceleration": [0.0, -9.8, 0.0]}, "damping": {"linear": 0.3, "angular": 2.0}} | floor
    motions = []
    for orientation, axes in ((starts[0], np.eye(3)), (starts[0] * turn.inv(), starts[1])):
        body = {"shape": "vertices", "points": (points @ axes.T).tolist(), "mass": 2.0}
        body["inertia"] = (axes @ np.diag([0.025, 0.02, 0.015]) @ axes.T).tolist()
        start = {"position": [0.0, 0.8, 0.0], "orientation": orientation.as_quat().tolist(), "angular_velocity": [3.0, -4.0, 5.0]}
        scene = ds.load(tables | {"body": body, "start": start})
        with ds.engine("mujoco").prepare(scene, 1e-3) as simulation:
            motions.append(simulation.record(600))
            np.testing.assert_allclose(simulation.as_built().inertia, scene.body.inertia_tensor, atol=1e-15)
        np.testing.assert_array_equal(simulation.state(), motions[-1][-1])
        batch = ds.engine("mujoco").prepare_batch([scene, scene], 1e-3)
        np.testing.assert_array_equal(batch.record(600)[1], motions[-1])
    own, other = motions
    other[:, 3:7] = (Rotation.from_quat(other[:, 3:7]) * turn).as_quat(canonical=True)
    own[:, 3:7] = Rotation.from_quat(own[:, 3:7]).as_quat(canonical=True)
    np.testing.assert_allclose(other, own, atol=tolerance)
