"""Runs: the catalogue passes, the values are those that theory predicts, requests are checked."""

import math
import re

import numpy as np
import pytest
from support import engines as made
from support.scenes import standing, with_few_members

import dropspin as ds
from dropspin import scenarios
from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS
from dropspin.comparisons.results.table import COLUMNS
from dropspin.comparisons.running.engine_entries import engine_entries
from dropspin.scenarios import DropspinError, SceneError

BALL = ds.load("drop-ball")


@pytest.fixture(scope="module")
def core(core_run):
    """The core catalogue with the three engines at the default time steps."""
    return ds.load_results(core_run)


def value(results, scene, engine, metric, dt=1e-3):
    rows = results.measurements
    own = rows[(rows["scene"] == scene) & (rows["engine"] == engine)]
    [found] = own[(own["metric"] == metric) & np.isclose(own["dt"], dt)]["value"]
    return found


def test_catalogue_passes(core):
    """No expectation fails, no engine breaks down, the exit code is 0, and most rows are judged."""
    assert core.table[core.table["verdict"].isin(["failed", "crashed", "diverged", "no_truth"])].empty, failures_of(core)
    declined = core.table[core.table["verdict"] == "declined"]
    rough = {name for name, scene in core.scenes.items() if has_coulomb_friction(scene)}
    assert {"slide-box", "turn-box-rough"} < rough
    assert set(zip(declined["scene"], declined["engine"], strict=True)) == {(name, "wang") for name in rough}
    limited = core.table[core.table["verdict"] == "limited"]
    assert {("slide-box", "mujoco"), ("turn-box-rough", "mujoco")} <= set(zip(limited["scene"], limited["engine"], strict=True))
    assert core.exit_code() == 0
    assert (core.table["verdict"] == "passed").sum() > 200


@pytest.mark.sample(1)
@pytest.mark.parametrize("name", [name for name in made.QUICK if name not in made.CORE])
def test_scenes_beyond_the_core_catalogue_pass(name):
    found = ds.run(with_few_members(name), ["wang", "mujoco", "pybullet"])
    declined = set(found.table.loc[found.table["verdict"] == "declined", "engine"])
    assert found.exit_code() == 0, failures_of(found)
    assert ("wang" in declined) == has_coulomb_friction(found.scenes[name])
    assert ("mujoco" in declined) == (name == "bounce-threshold")


def has_coulomb_friction(scene):
    return scene.floor is not None and not isinstance(scene.floor.friction, str)


def test_long_rest_after_the_bounces_is_no_flight():
    """The bounce height of a ball that lies on the floor for most of the scene is the same as in a scene that ends with the bounces."""
    short = ds.load("drop-ball")
    heights = [
        table.loc[(table["metric"] == "bounce_height_error") & (table["kind"] == "truth"), "value"].item()
        for scene in (short, short.model_copy(update={"duration": 12.0}))
        for table in [ds.run(scene, ["wang"], 1e-3).table]
    ]
    assert heights[0] == heights[1] == pytest.approx(1.9e-5, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in made.SLOW if name != "laboratory"])  # of which no exact solution is known
def test_slow_scenes_pass_too(name):
    """One slow scene at a time; the one of a thousand seconds at time steps that games use."""
    dts = [1 / 60, 1 / 120, 1 / 240] if name == "rest-long" else [4e-3, 2e-3, 1e-3]
    found = ds.run(name, ["wang", "mujoco", "pybullet"], dts)
    assert set(found.table["verdict"]) <= {"passed", "measured", "known"}, failures_of(found)
    assert (found.table["verdict"] == "passed").sum() > 30


def failures_of(results):
    return results.table[results.table["verdict"] == "failed"].to_string()


def test_table_has_the_documented_columns_and_unique_keys(core):
    """Every measurement has its steps, its time per step and its time step."""
    assert list(core.table.columns) == list(COLUMNS)
    assert not core.table.duplicated(["scene", "engine", "dt", "metric", "kind", "truth", "reason"]).any()
    assert not core.table[core.table["metric"] != ""].duplicated(["scene", "engine", "dt", "metric", "kind", "truth"]).any()
    for others, kind in ((core.predictions, "prediction"), (core.agreements, "agreement")):
        assert list(others.columns) == list(COLUMNS)
        assert set(others["kind"]) == {kind}
        assert not others.duplicated(["scene", "engine", "dt", "metric", "truth"]).any()
    assert not core.table["kind"].isin(["prediction", "agreement"]).any()
    assert (core.measurements["steps"] > 0).all()
    assert (core.measurements["time_per_step"] > 0).all()
    assert core.measurements["dt"].notna().all()
    studies = core.table[core.table["kind"].isin(["order", "asymptotic_error"])]
    assert studies["dt"].isna().all()
    assert set(core.measurements["cause"]) <= {"discretisation", "model", "rounding", "unresolved", ""}


@pytest.mark.parametrize("restitution", [0.5, 0.9])
@pytest.mark.parametrize("dt", [4e-3, 2e-3, 1e-3])
def test_bias_of_the_mean_apex_is_the_predicted_one(core, restitution, dt):
    """Over 32 start phases: -(1 - e)/2 u dt for the calibrated engines, +(2e - 1)(1 + e)/2 u dt for the note.

    32 equally spaced phases average the depth at detection, anything from 0 to u dt, to a 64th of it; (1 - e²) of that enters.
    """
    e, u = restitution, math.sqrt(2 * 9.8)
    scene = "drop-ball" if e == 0.5 else "drop-ball-lively"
    resolution = ((1 - e**2) / 64 + 3 * dt) * u * dt  # and terms of second order
    assert value(core, scene, "mujoco", "bounce_height_error", dt) == pytest.approx(-(1 - e) / 2 * u * dt, abs=resolution)
    assert value(core, scene, "pybullet", "bounce_height_error", dt) == pytest.approx(-(1 - e) / 2 * u * dt, abs=resolution)
    note = (2 * e - 1) * (1 + e) / 2 * u * dt
    assert value(core, scene, "wang", "bounce_height_error", dt) == pytest.approx(note, abs=resolution)


def test_document_adds_a_step_of_gravity_to_restitution(core):
    """The restitution error is + e g dt / u, to second order."""
    for dt in (4e-3, 2e-3, 1e-3):
        predicted = 0.5 * 9.8 * dt / math.sqrt(2 * 9.8)
        assert value(core, "drop-ball", "wang", "restitution_error", dt) == pytest.approx(predicted, rel=3 * dt + 1e-3)


def test_document_direction_of_angular_momentum_is_a_plateau(core):
    """The error is twice the angle between ω and L at every step, to 1e-4; MuJoCo's halves with the step."""
    scene = ds.load("spin-asymmetric")
    w = np.array(scene.start.angular_velocity)
    L = scene.body.inertia_tensor @ w
    swing = 2 * math.atan2(np.linalg.norm(np.cross(w, L)), w @ L)
    for dt in (4e-3, 2e-3, 1e-3):
        assert value(core, "spin-asymmetric", "wang", "angular_momentum_direction_error", dt) == pytest.approx(swing, rel=1e-4)
    coarse, fine = (value(core, "spin-asymmetric", "mujoco", "angular_momentum_direction_error", dt) for dt in (4e-3, 1e-3))
    assert coarse / fine == pytest.approx(4, rel=0.02)


def test_mujoco_rk4_keeps_the_direction_of_angular_momentum():
    """To 1e-9 rad."""
    found = ds.run("spin-asymmetric", "mujoco[integrator=rk4]", 2e-3)
    assert value(found, "spin-asymmetric", "mujoco[integrator=rk4]", "angular_momentum_direction_error", 2e-3) <= 1e-9


def test_document_pushes_sideways_on_a_frictionless_floor(core):
    """Eq 11 keeps the tangential velocity, so its impulse is not normal; MuJoCo and PyBullet push straight up."""
    assert value(core, "drop-box-corner", "wang", "horizontal_momentum_error") > 0.2
    for engine in ("mujoco", "pybullet"):
        assert value(core, "drop-box-corner", engine, "horizontal_momentum_error") <= 1e-12


def test_run_and_simulate_give_the_same_trajectory(core):
    """Bit for bit."""
    for engine in core.engines:
        again = ds.simulate("drop-box-corner", engine, 2e-3)
        kept = core.trajectories["drop-box-corner", engine, 2e-3]
        np.testing.assert_array_equal(kept.states, again.states)
        np.testing.assert_array_equal(kept.t, again.t)
        assert kept.velocity_lag == again.velocity_lag == 1e-3


def test_each_pair_of_engines_is_compared_once(core):
    """By energy, apex and angular momentum; MuJoCo and PyBullet bounce alike."""
    pairs = core.agreements
    assert set(zip(pairs["engine"], pairs["truth"], strict=True)) == {
        ("wang", "mujoco"), ("wang", "pybullet"), ("mujoco", "pybullet"),
    }  # fmt: skip
    of_ensembles = pairs["metric"].isin(list(ENSEMBLE_METRICS))
    assert set(pairs.loc[~of_ensembles, "metric"]) == {"energy_error", "bounce_height_error", "angular_momentum_error"}
    assert set(pairs.loc[of_ensembles, "scene"]) == {"drop-box-anyhow"}
    alike = pairs[(pairs["scene"] == "drop-ball") & (pairs["engine"] == "mujoco") & (pairs["metric"] == "bounce_height_error")]
    assert alike["value"].abs().max() < 1e-5


@pytest.mark.usefixtures("few_start_phases")
@pytest.mark.slow
def test_exact_engine_passes_everywhere():
    """An engine without any error fails no expectation."""
    # The means over an ensemble have no exact value to compare with, and its exact motions take most of the time.
    scenes = [ds.load(name).model_copy(update={"ensemble": None}) for name in made.QUICK]
    found = ds.run(scenes, made.Exact(), 2e-3)
    failed = found.table[found.table["verdict"] == "failed"]
    assert failed.empty, failed.to_string()


def test_scene_without_truth_is_measured_by_invariants():
    """A row says so, and engines are still compared with each other."""
    scene = ds.load("drop-box-flat")
    scene = scene.model_copy(update={"floor": scene.floor.model_copy(update={"friction": 0.3})})
    scene = scene.starting_at(scene.initial_state + np.eye(13)[7])  # sideways
    found = ds.run([scene.model_copy(update={"expect": ()})], ["wang[law=coulomb]", "pybullet"], [2e-3])
    own, pairs = found.table, found.agreements
    assert set(own["verdict"]) == {"measured", "no_truth"}
    assert set(own[own["verdict"] == "measured"]["metric"]) == {
        *("energy_drift", "energy_gain", "penetration"),
        *("contact_pull", "friction_cone_excess", "friction_push", "contact_gap"),
    }
    assert set(pairs["metric"]) == {"energy_error"}
    assert (pairs["value"].abs() < 1e-12).all()  # up to the first contact both fall freely


@pytest.mark.sample(7)
@pytest.mark.parametrize("engine", [made.Frozen(), "wang", "pybullet", "mujoco"])
@pytest.mark.parametrize(
    "change",
    [
        {"start": {"position": [0, 0.1, 0]}},
        {"start": {"position": [0, 0.5, 0]}, "gravity": None},
        {"start": {}, "gravity": None, "floor": None},
        {"start": {"position": [0, 0.1, 0]}, "floor": {"restitution": 1.0, "friction": "none"}},
    ],
    ids=["at rest on the floor", "hovering", "at rest in space", "at rest on an elastic floor"],
)
def test_scene_without_motion_does_not_break(engine, change):
    """Without energy or motion to measure, the values are 0 or undefined."""
    content = {key: value for key, value in (BALL.model_dump(exclude_none=True, exclude={"expect"}) | change).items() if value is not None}
    found = ds.run([ds.load(content)], [engine], [1e-2])
    assert set(found.table["verdict"]) <= {"measured", "no_truth"}, found.table.to_string()
    if not (engine == "wang" and change.get("floor") and change["floor"]["restitution"] == 1.0):  # which gains energy, as known
        assert (found.table["value"].dropna().abs() < 1e-2).all()


def test_restitution_near_the_end_and_below_the_rest_speed():
    """An impact in the last steps is not judged; below rest_speed the floor's restitution is 0."""
    ends = BALL.model_copy(update={"duration": 0.4525, "expect": ()})
    found = ds.run([ends], [made.Exact()], [1e-3])
    [row] = found.table[found.table["metric"] == "restitution_error"].to_dict("records")
    assert (row["verdict"], row["cause"]) == ("measured", "unresolved")
    dead = BALL.model_copy(update={"floor": BALL.floor.model_copy(update={"rest_speed": 10.0}), "expect": ()})
    found = ds.run([dead], ["wang", "pybullet"], [1e-3])
    assert (found.table[found.table["metric"] == "restitution_error"]["value"].abs() <= 1e-12).all()


def test_request_is_checked_before_anything_runs():
    """Time steps, names, expectations."""
    for dt in (0.0, -1e-3, math.nan, math.inf, 1.0):
        with pytest.raises(DropspinError, match=r"dt: got .* s; scene 'drop-ball' lasts 1\.5 s"):
            ds.run([BALL], ["wang"], [dt])
    with pytest.raises(DropspinError, match="two scenes have the same name"):
        ds.run([BALL, BALL], ["wang"])
    with pytest.raises(DropspinError, match=r"mujoco and mujoco\[integrator=euler\] both have the name mujoco; name one of them"):
        ds.run([BALL], ["mujoco", "mujoco[integrator=euler]"])
    typo = ds.load(
        BALL.model_dump(exclude_none=True, exclude={"expect"}) | {"expect": [{"metric": "energy_eror", "below": 1, "reason": "typo"}]}
    )
    with pytest.raises(SceneError, match=r"^scene\['expect'\]\[0\]\['metric'\]: got 'energy_eror'.*Did you mean 'energy_error'"):
        ds.run([typo], ["wang"])


def test_two_engines_of_one_name_are_refused_by_studies_too():
    """Such as two versions of an adapter, or an option that is the default: the results of one would take the place of the other's."""
    other = type("Other", (made.Exact,), {})
    both = r"support\.engines:Exact and .*:Other both have the name exact"
    with pytest.raises(DropspinError, match=f"engines: {both}; name one of them, or give one another name"):
        engine_entries([made.Exact(), other()])
    with pytest.raises(DropspinError, match="both have the name exact"):  # of one class, which may have different parameters
        engine_entries([made.Exact(), made.Exact()])
    with pytest.raises(DropspinError, match=r"engines: mujoco and mujoco\[integrator=euler\] both have the name mujoco"):
        engine_entries(["mujoco", "mujoco[integrator=euler]"])


@pytest.mark.extended
def test_unsolved_contacts_are_reported():
    """The sequential contact may not converge: a row says in how many steps, and the rest is measured."""
    scene = ds.load("drop-box-sticking").model_copy(update={"duration": 2.0, "expect": ()})
    found = ds.run([scene], ["wang[contact=sequential,law=coulomb]"], [1e-3])
    limited = found.table[found.table["verdict"] == "limited"]
    assert len(limited) == 1
    assert re.fullmatch(r"the contact was not solved in \d+ of 2000 steps", limited["reason"].iloc[0])
    assert found.exit_code() == 0


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ("scene", "first", "second", "same"),
    [
        ("spin-asymmetric", "mujoco[integrator=implicitfast]", "pybullet", True),
        ("spin-asymmetric", "mujoco", "wang[rotation=gyroscopic]", True),
        ("spin-asymmetric", "mujoco", "pybullet", False),
        ("spin-asymmetric", "wang", "pybullet", False),
        ("spin-asymmetric", "mujoco[integrator=rk4]", "wang[rotation=rk4]", False),
        ("fall-spin", "mujoco", "pybullet", True),
        ("drop-box-corner", "mujoco", "pybullet", False),
        ("drop-ball", "mujoco", "pybullet", True),
        ("drop-ball", "wang", "pybullet", False),
        ("drop-ball", "mujoco[profile=default]", "pybullet", False),
    ],
)
def test_agreement_of_one_discretisation_is_no_evidence(scene, first, second, same):
    """Pairs that solve the same difference equations are marked; they agree far better than either does with the exact solution."""
    found = ds.run(scene, [first, second], 8e-3)
    pairs = found.agreements
    assert pairs["reason"].str.startswith("no evidence: both are").all() == same
    if same:
        difference = pairs[pairs["metric"] == "energy_error"]["value"].abs().max()
        wrong = found.measurements[found.measurements["metric"] == "energy_error"]["value"].abs().min()
        assert difference < 0.05 * wrong


@pytest.mark.extended
def test_scenes_at_the_limits_of_what_can_be_measured():
    """A fall that ends above the floor; a start with the quaternion's other sign; an exact solution that ends within a few steps."""
    short = BALL.model_copy(update={"duration": 0.3, "expect": ()})
    turned = BALL.model_copy(update={"name": "turned", "expect": ()}).starting_at(
        np.array([0, 1.1, 0, 0.1, 0.2, 0.3, -np.sqrt(0.86), *[0] * 6])
    )
    found = ds.run([short, turned], ["wang", "mujoco", "pybullet", "pybullet[coordinates=multibody]"]).table
    assert set(found["verdict"]) <= {"passed", "measured"}
    angle, half = 1e-5, np.array([0.2, 0.2, 0.2])
    corner = np.array([0.2 * (np.cos(angle) - np.sin(angle)), 0.2 * (np.cos(angle) + np.sin(angle))])
    content = BALL.model_dump(exclude_none=True, exclude={"expect", "origin"}) | {
        "name": "nearly-flat",
        "body": {"shape": "box", "half_extents": half.tolist(), "mass": 1.0},
        "start": {"position": [0.0, float(corner[1]), 0.0], "orientation": [0.0, 0.0, float(np.sin(angle / 2)), float(np.cos(angle / 2))]},
        "floor": {"restitution": 0.5, "friction": "infinite"},
    }
    scene = ds.load(content)
    assert scenarios.truth_for(scene).horizon < 2e-3
    found = ds.run([scene], [made.Frozen()]).table
    judged = found[found["kind"] == "truth"]
    assert (judged["cause"] == "unresolved").all()
    assert judged["reason"].str.contains("the exact solution is known for [01] steps of").all()


@pytest.mark.slow
def test_desynchronised_motion_is_no_model_error():
    """A block that rocks slightly, and a slipping box that lands: no model error of MuJoCo or PyBullet."""
    rocks = standing(lean=0.9 * math.atan(0.4), duration=2.0)
    slips = standing(half=(0.2, 0.2), lean=0.5 * math.pi / 4, friction="none", duration=1.0).model_copy(update={"name": "slips"})
    found = ds.run([rocks, slips], ["mujoco", "pybullet"])
    assert found.asymptotic_errors("model").empty, found.asymptotic_errors("model").to_string()


@pytest.mark.slow
def test_best_method_of_the_project_passes_the_tumbling_box():
    """Its errors shrink with the step in each flight; a metric over more and more flights would not."""
    engine = "wang[contact=sequential,law=coulomb,rotation=rk4]"
    assert ds.run("drop-box-anyhow", engine).exit_code() == 0
