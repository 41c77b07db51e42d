"""The main job: bad engines cost their own row, known faults are seen, and the figures are the ones theory predicts."""

import math
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support import engines as made

import comparisons
import scenarios
from comparisons.results.results import COLUMNS, KEY
from scenarios import DropspinError, SceneError

BALL = scenarios.load("drop-ball")


@pytest.fixture(scope="module")
def core():
    """The core catalogue through the three engines at the default steps: what `dropspin run` does."""
    return comparisons.run([scenarios.load(name) for name in made.QUICK], ["document", "mujoco", "pybullet"])


def value(results, scene, engine, metric, dt=1e-3):
    frame = results.measurements
    own = frame[(frame["scene"] == scene) & (frame["engine"] == engine)]
    [found] = own[(own["metric"] == metric) & np.isclose(own["dt"], dt)]["value"]
    return found


def test_the_shipped_catalogue_passes(core):
    """No expectation fails, nothing breaks down, the exit code is 0, and most rows are judged."""
    assert core.table[core.table["verdict"].isin(["failed", "crashed", "diverged", "no_truth"])].empty, failures_of(core)
    declined = core.table[core.table["verdict"] == "declined"]
    rough = {(scene, "document") for scene in ("slide-box", "turn-box-rough")}
    assert set(zip(declined["scene"], declined["engine"], strict=True)) == rough
    limited = core.table[core.table["verdict"] == "limited"]
    assert {("slide-box", "mujoco"), ("turn-box-rough", "mujoco")} <= set(zip(limited["scene"], limited["engine"], strict=True))
    assert core.exit_code() == 0
    assert (core.table["verdict"] == "passed").sum() > 200


@pytest.mark.slow
@pytest.mark.parametrize("name", made.SLOW)
def test_the_slow_scenes_pass_too(name):
    """As above, one at a time; a thousand seconds in steps of the size that games take."""
    dts = [1 / 60, 1 / 120, 1 / 240] if name == "rest-long" else [4e-3, 2e-3, 1e-3]
    found = comparisons.run([scenarios.load(name)], ["document", "mujoco", "pybullet"], dts)
    assert set(found.table["verdict"]) <= {"passed", "measured"}, failures_of(found)
    assert (found.table["verdict"] == "passed").sum() > 30


def failures_of(results):
    return results.table[results.table["verdict"] == "failed"].to_string()


def test_table(core):
    """The columns are the documented ones, with no missing or double key."""
    assert list(core.table.columns) == list(COLUMNS)
    assert not core.table.duplicated(KEY).any()
    assert (core.measurements["steps"] > 0).all()
    assert (core.measurements["time_per_step"] > 0).all()
    assert core.measurements["dt"].notna().all()
    studies = core.table[core.table["kind"].isin(["order", "asymptotic_error"])]
    assert studies["dt"].isna().all()
    assert set(core.measurements["cause"]) <= {"discretisation", "model", "rounding", "unresolved", ""}


@pytest.mark.parametrize("restitution", [0.5, 0.9])
@pytest.mark.parametrize("dt", [4e-3, 2e-3, 1e-3])
def test_mean_apex_bias_has_the_predicted_sign_and_size(core, restitution, dt):
    """Over 32 start phases: -(1 - e)/2 u dt for the calibrated engines, +(2e - 1)(1 + e)/2 u dt for the note.

    32 equally spaced phases average the depth at detection, anything from 0 to u dt, to a 64th of it; (1 - e²) of that enters.
    """
    e, u = restitution, math.sqrt(2 * 9.8)
    scene = "drop-ball" if e == 0.5 else "drop-ball-lively"
    resolution = ((1 - e**2) / 64 + 3 * dt) * u * dt  # and terms of second order
    assert value(core, scene, "mujoco", "bounce_height_error", dt) == pytest.approx(-(1 - e) / 2 * u * dt, abs=resolution)
    assert value(core, scene, "pybullet", "bounce_height_error", dt) == pytest.approx(-(1 - e) / 2 * u * dt, abs=resolution)
    note = (2 * e - 1) * (1 + e) / 2 * u * dt
    assert value(core, scene, "document", "bounce_height_error", dt) == pytest.approx(note, abs=resolution)


def test_note_adds_a_step_of_gravity_to_its_restitution(core):
    """+ e g dt / u, to second order."""
    for dt in (4e-3, 2e-3, 1e-3):
        predicted = 0.5 * 9.8 * dt / math.sqrt(2 * 9.8)
        assert value(core, "drop-ball", "document", "restitution_error", dt) == pytest.approx(predicted, rel=3 * dt + 1e-3)


def test_note_s_direction_of_momentum_is_a_plateau(core):
    """Twice the angle between ω and L at every step, to 1e-4; MuJoCo's halves with the step."""
    scene = scenarios.load("spin-asymmetric")
    w = np.array(scene.start.angular_velocity)
    L = scene.body.inertia_tensor @ w
    swing = 2 * math.atan2(np.linalg.norm(np.cross(w, L)), w @ L)
    for dt in (4e-3, 2e-3, 1e-3):
        assert value(core, "spin-asymmetric", "document", "angular_momentum_direction_error", dt) == pytest.approx(swing, rel=1e-4)
    coarse, fine = (value(core, "spin-asymmetric", "mujoco", "angular_momentum_direction_error", dt) for dt in (4e-3, 1e-3))
    assert coarse / fine == pytest.approx(4, rel=0.02)


def test_rk4_is_at_rounding():
    """MuJoCo's RK4 keeps the direction of L to 1e-9 (measured 2e-14)."""
    found = comparisons.run([scenarios.load("spin-asymmetric")], ["mujoco[integrator=rk4]"], [1e-3])
    assert value(found, "spin-asymmetric", "mujoco[integrator=rk4]", "angular_momentum_direction_error") <= 1e-9


def test_note_pushes_sideways_on_a_smooth_floor(core):
    """Eq 11 keeps the tangential velocity, so its impulse is not normal; MuJoCo and PyBullet push straight up."""
    assert value(core, "drop-box-corner", "document", "horizontal_momentum_error") > 0.2
    for engine in ("mujoco", "pybullet"):
        assert value(core, "drop-box-corner", engine, "horizontal_momentum_error") <= 1e-12


def test_trajectories_are_what_simulate_gives(core):
    """The run's own arrays, bit for bit."""
    for engine in core.engines:
        again = comparisons.simulate(scenarios.load("drop-box-corner"), engine, 2e-3)
        kept = core.trajectories["drop-box-corner", engine, 2e-3]
        np.testing.assert_array_equal(kept.states, again.states)
        np.testing.assert_array_equal(kept.t, again.t)
        assert kept.velocity_lag == again.velocity_lag == 1e-3


def test_engines_are_held_against_each_other(core):
    """Each pair once, by energy, apex and angular momentum; MuJoCo and PyBullet bounce alike."""
    pairs = core.table[core.table["kind"] == "agreement"]
    assert set(zip(pairs["engine"], pairs["truth"], strict=True)) == {
        ("document", "mujoco"), ("document", "pybullet"), ("mujoco", "pybullet"),
    }  # fmt: skip
    of_ensembles = pairs["metric"].isin(list(comparisons.ENSEMBLE_METRICS))
    assert set(pairs.loc[~of_ensembles, "metric"]) == {"energy_error", "bounce_height_error", "angular_momentum_error"}
    assert set(pairs.loc[of_ensembles, "scene"]) == {"drop-box-anyhow"}
    alike = pairs[(pairs["scene"] == "drop-ball") & (pairs["engine"] == "mujoco") & (pairs["metric"] == "bounce_height_error")]
    assert alike["value"].abs().max() < 1e-5


def test_an_exact_engine_passes_everywhere():
    """A stranger without any error fails no expectation."""
    found = comparisons.run([scenarios.load(name) for name in made.QUICK], [made.Exact()], [2e-3])
    failed = found.table[found.table["verdict"] == "failed"]
    assert failed.empty, failed.to_string()


@pytest.mark.parametrize(
    ("engine", "verdict", "reason", "code"),
    [
        (made.Crashing(), "crashed", "RuntimeError: no such thing as a floor", 3),
        (made.GivingUp(), "diverged", "step 3: a number beyond 1e10", 3),
        (made.Declining(), "declined", "I do not bounce", 0),
        (made.engine_with("nan", made.nan_after_half_a_second), "diverged", "the state is not finite at t = 0.50", 3),
        (made.HeavyInertia(), "crashed", "BuildMismatch: inertia is", 3),
        (made.WrongStart(), "crashed", "BuildMismatch: position at the start is", 3),
    ],
    ids=lambda case: getattr(case, "label", ""),
)
def test_a_bad_engine_costs_its_own_rows(engine, verdict, reason, code):
    """The reason is told, and the engine beside it is measured as ever."""
    found = comparisons.run([BALL], [engine, "pybullet"], [4e-3])
    [row] = found.table[found.table["engine"] == engine.label].to_dict("records")
    assert row["verdict"] == verdict
    assert row["reason"].startswith(reason)
    assert found.exit_code() == code
    assert found.table[found.table["engine"] == "pybullet"]["value"].notna().all()


# The fault, the scene that must notice and one metric that must fail; each distortion acts on the exact motion.
FAULTS = {
    "restitution vanishes": (
        "drop-ball", "restitution_error",
        lambda s, t: np.concatenate([[0, 0.1, 0], s[3:7], np.zeros(6)]) if t > 0.452 else s,
    ),
    "swapped components of the quaternion": (
        "spin-asymmetric", "orientation_error", lambda s, t: s[[0, 1, 2, 4, 3, 5, 6, 7, 8, 9, 10, 11, 12]],
    ),
    "wxyz for xyzw": ("spin-asymmetric", "orientation_error", lambda s, t: s[[0, 1, 2, 6, 3, 4, 5, 7, 8, 9, 10, 11, 12]]),
    "attitude 2 degrees off": ("spin-asymmetric", "orientation_error", made.turned_by(math.radians(2))),
    "sideways push": ("drop-box-corner", "horizontal_momentum_error", lambda s, t: s + 1e-5 * np.eye(13)[7]),
    "1 % less spin": (
        "spin-dzhanibekov", "angular_momentum_error", lambda s, t: np.concatenate([s[:10], 0.99 * s[10:]]),
    ),
    "frozen attitude": ("spin-principal", "orientation_error", lambda s, t: np.concatenate([s[:3], [0, 0, 0, 1], s[7:]])),
    "sinks a centimetre": ("drop-box-flat", "penetration", lambda s, t: s - 0.01 * np.eye(13)[1]),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_are_caught(fault):
    """Each fault, planted in an exact engine, fails the metric it is about."""
    scene, metric, distort = FAULTS[fault]
    engine = made.engine_with("planted", distort)
    found = comparisons.run([scenarios.load(scene)], [engine], [1e-3])
    failed = found.table[found.table["verdict"] == "failed"]
    assert metric in set(failed["metric"]), found.table[["metric", "value", "verdict"]].to_string()
    assert found.exit_code() == 1


def test_one_per_cent_more_restitution_is_caught():
    """The exact motion of a ball that bounces 1 % better than the scene says: 2 e² of it in the apex, 5e-3."""
    found = comparisons.run([BALL], [made.TooLively()], [1e-3])
    failed = found.table[found.table["verdict"] == "failed"]
    assert {"bounce_height_error", "energy_error"} <= set(failed["metric"])


@pytest.mark.parametrize("package", ["mujoco", "pybullet"])
def test_missing_engine(package):
    """Not importable at all: its rows say how to install it, the rest runs, and it fails the run only if it was named."""
    program = (
        f"import sys; sys.modules[{package!r}] = None\n"
        "from dataclasses import replace\n"
        "import comparisons, scenarios\n"
        f"found = comparisons.run([scenarios.load('drop-ball')], ['document', {package!r}], [4e-3])\n"
        f"[row] = found.table[found.table['engine'] == {package!r}].to_dict('records')\n"
        "print(row['verdict'], row['reason'])\n"
        f"print(found.exit_code(), replace(found, provenance={{**found.provenance, 'named': [{package!r}]}}).exit_code())\n"
        "print((found.table['engine'] == 'document').sum())\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    first, codes, rows = done.stdout.splitlines()
    assert first.startswith(f"missing {package} is not installed: pip install {package}")
    assert codes == "0 3"
    assert int(rows) > 5


def test_a_scene_without_truth():
    """It is measured by what is conserved, says so, and engines are still held against each other."""
    scene = scenarios.load("drop-box-flat")
    scene = scene.model_copy(update={"floor": scene.floor.model_copy(update={"friction": 0.3})})
    scene = scene.starting_at(scene.initial_state + np.eye(13)[7])  # sideways
    found = comparisons.run([scene.model_copy(update={"expect": ()})], ["document[law=coulomb]", "pybullet"], [2e-3])
    own = found.table[found.table["kind"] != "agreement"]
    assert set(own["verdict"]) == {"measured", "no_truth"}
    assert set(own[own["verdict"] == "measured"]["metric"]) == {"energy_drift", "energy_gain", "penetration"}
    pairs = found.table[found.table["kind"] == "agreement"]
    assert set(pairs["metric"]) == {"energy_error"}
    assert (pairs["value"].abs() < 1e-12).all()  # up to the first contact both fall freely


class Short(made.Exact):
    """Stops after five rows."""

    name = "short"

    def prepare(self, scene, dt):
        simulation = made.ExactSimulation(scene, dt)
        simulation.record = lambda steps, every=1: made.ExactSimulation(scene, dt).record(4)
        return simulation


class Narrow(made.Exact):
    """Forgets a column."""

    name = "narrow"

    def prepare(self, scene, dt):
        simulation = made.ExactSimulation(scene, dt)
        whole = simulation.record
        simulation.record = lambda steps, every=1: whole(steps, every)[:, :12]
        return simulation


@pytest.mark.parametrize(
    ("engine", "reason"),
    [
        (Short(), r"the record has shape \(5, 13\); 2501 states"),
        (Narrow(), r"the record has shape \(2501, 12\)"),
        (made.engine_with("zero-q", lambda s, t: np.concatenate([s[:3], np.zeros(4), s[7:]])), "has length 0; an orientation has length 1"),
        (made.engine_with("long-q", lambda s, t: np.concatenate([s[:3], 1.05 * s[3:7], s[7:]])), "has length 1.05"),
        (made.engine_with("complex", lambda s, t: s + 0j), "complex numbers"),
    ],
    ids=lambda case: getattr(case, "label", ""),
)
def test_records_that_are_none(engine, reason):
    """Too few rows, too few columns, no orientation: told, and nothing passes."""
    found = comparisons.run([scenarios.load("spin-principal")], [engine], [4e-3])
    [row] = found.table.to_dict("records")
    assert row["verdict"] == "crashed"
    assert re.search(reason, row["reason"])


@pytest.mark.parametrize("dt", [4e-3, 2e-3, 1e-3])
@pytest.mark.parametrize("scene", ["drop-ball", "drop-ball-lively", "drop-box-flat", "drop-box-corner", "drop-box-sticking"])
def test_falling_through_the_floor_fails_at_every_step(scene, dt):
    """An engine that knows no floor."""

    class NoFloor(made.Exact):
        name = "no-floor"

        def prepare(self, scene, dt):
            return made.ExactSimulation(scene.model_copy(update={"floor": None}), dt)

    found = comparisons.run([scenarios.load(scene)], [NoFloor()], [dt])
    failed = set(found.table[found.table["verdict"] == "failed"]["metric"])
    assert failed & {"penetration", "bounce_height_error"}
    assert "restitution_error" in failed
    assert found.exit_code() == 1


@pytest.mark.parametrize("engine", [made.Frozen(), "document", "pybullet", "mujoco"])
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
def test_scenes_in_which_nothing_happens(engine, change):
    """Nothing to measure by is no reason to break down; what is measured is nothing."""
    content = {key: value for key, value in (BALL.model_dump(exclude_none=True, exclude={"expect"}) | change).items() if value is not None}
    found = comparisons.run([scenarios.load(content)], [engine], [1e-2])
    assert set(found.table["verdict"]) <= {"measured", "no_truth"}, found.table.to_string()
    if not (engine == "document" and change.get("floor") and change["floor"]["restitution"] == 1.0):  # which gains energy, as known
        assert (found.table["value"].dropna().abs() < 1e-2).all()


def test_an_engine_that_never_moves_is_found_wanting():
    """It has no impact to measure restitution by: that fails, and costs nobody else."""
    found = comparisons.run([BALL], [made.Frozen(), "pybullet"], [4e-3])
    [row] = found.table[(found.table["engine"] == "frozen") & (found.table["metric"] == "restitution_error")].to_dict("records")
    assert (row["verdict"], row["reason"]) == ("failed", "not a number: what is measured here never happened")
    assert found.table[found.table["engine"] == "pybullet"]["value"].notna().all()


def test_restitution_near_the_end_and_below_the_rest_speed():
    """An impact in the last steps is not judged; below rest_speed the floor's restitution is 0, and right engines are right."""
    ends = BALL.model_copy(update={"duration": 0.4525, "expect": ()})
    found = comparisons.run([ends], [made.Exact()], [1e-3])
    [row] = found.table[found.table["metric"] == "restitution_error"].to_dict("records")
    assert (row["verdict"], row["cause"]) == ("measured", "unresolved")
    dead = BALL.model_copy(update={"floor": BALL.floor.model_copy(update={"rest_speed": 10.0}), "expect": ()})
    found = comparisons.run([dead], ["document", "pybullet"], [1e-3])
    assert (found.table[found.table["metric"] == "restitution_error"]["value"].abs() <= 1e-12).all()


def test_what_is_asked_is_checked():
    """Before anything runs: steps, names, expectations."""
    for dt in (0.0, -1e-3, math.nan, math.inf, 1.0):
        with pytest.raises(DropspinError, match=r"dt: got .* s; scene 'drop-ball' lasts 1\.5 s"):
            comparisons.run([BALL], ["document"], [dt])
    with pytest.raises(DropspinError, match="two scenes have the same name"):
        comparisons.run([BALL, BALL], ["document"])
    with pytest.raises(DropspinError, match="an engine is named twice"):
        comparisons.run([BALL], ["mujoco", "mujoco[integrator=euler]"])
    typo = scenarios.load(
        BALL.model_dump(exclude_none=True, exclude={"expect"}) | {"expect": [{"metric": "energy_eror", "below": 1, "reason": "typo"}]}
    )
    with pytest.raises(SceneError, match=r"expect\[0\]\.metric: got 'energy_eror'.*Did you mean 'energy_error'"):
        comparisons.run([typo], ["document"])


def test_unsolved_contacts_are_told():
    """The reference implementation's sequential contact may not settle: a row says in how many steps, and nothing else is lost."""
    scene = scenarios.load("drop-box-sticking").model_copy(update={"duration": 2.0, "expect": ()})
    found = comparisons.run([scene], ["document[contact=sequential,law=coulomb]"], [1e-3])
    limited = found.table[found.table["verdict"] == "limited"]
    assert len(limited) == 1
    assert re.fullmatch(r"the contact was not solved in \d+ of 2000 steps", limited["reason"].iloc[0])
    assert found.exit_code() == 0


@pytest.mark.parametrize(
    ("scene", "first", "second", "same"),
    [
        ("spin-asymmetric", "mujoco[integrator=implicitfast]", "pybullet", True),
        ("spin-asymmetric", "mujoco", "document[rotation=gyroscopic]", True),
        ("spin-asymmetric", "mujoco", "pybullet", False),
        ("spin-asymmetric", "document", "pybullet", False),
        ("spin-asymmetric", "mujoco[integrator=rk4]", "document[rotation=rk4]", False),
        ("fall-spin", "mujoco", "pybullet", True),
        ("drop-box-corner", "mujoco", "pybullet", False),
        ("drop-ball", "mujoco", "pybullet", True),
        ("drop-ball", "document", "pybullet", False),
        ("drop-ball", "mujoco[profile=default]", "pybullet", False),
    ],
)
def test_agreement_of_one_discretisation_is_no_evidence(scene, first, second, same):
    """Pairs that solve the same difference equations are marked; where they are, they agree far better than either with the truth."""
    found = comparisons.run([scenarios.load(scene)], [first, second], [8e-3])
    pairs = found.table[found.table["kind"] == "agreement"]
    assert pairs["reason"].str.startswith("no evidence: both are").all() == same
    if same:
        apart = pairs[pairs["metric"] == "energy_error"]["value"].abs().max()
        wrong = found.measurements[found.measurements["metric"] == "energy_error"]["value"].abs().min()
        assert apart < 0.05 * wrong


def test_scenes_at_the_edges():
    """A fall that ends above the floor; a start with the quaternion's other sign; a truth that ends within a few steps."""
    short = BALL.model_copy(update={"duration": 0.3, "expect": ()})
    turned = BALL.model_copy(update={"name": "turned", "expect": ()}).starting_at(
        np.array([0, 1.1, 0, 0.1, 0.2, 0.3, -np.sqrt(0.86), *[0] * 6])
    )
    found = comparisons.run([short, turned], ["document", "mujoco", "pybullet", "pybullet[coordinates=multibody]"]).table
    assert set(found["verdict"]) <= {"passed", "measured"}
    angle, half = 1e-5, np.array([0.2, 0.2, 0.2])
    corner = np.array([0.2 * (np.cos(angle) - np.sin(angle)), 0.2 * (np.cos(angle) + np.sin(angle))])
    content = BALL.model_dump(exclude_none=True, exclude={"expect", "origin"}) | {
        "name": "nearly-flat",
        "body": {"shape": "box", "half_extents": half.tolist(), "mass": 1.0},
        "start": {"position": [0.0, float(corner[1]), 0.0], "orientation": [0.0, 0.0, float(np.sin(angle / 2)), float(np.cos(angle / 2))]},
        "floor": {"restitution": 0.5, "friction": "infinite"},
    }
    scene = scenarios.load(content)
    assert scenarios.truth_for(scene).horizon < 2e-3
    found = comparisons.run([scene], [made.Frozen()]).table
    judged = found[found["kind"] == "truth"]
    assert (judged["cause"] == "unresolved").all()
    assert judged["reason"].str.contains("the truth is known for [01] steps of").all()


def test_sound_engines_are_not_accused_of_what_is_desynchronised():
    """A block that rocks by little, and a slipping box that lands: no model error of MuJoCo or PyBullet."""
    import sys

    sys.path.insert(0, str(Path(__file__).parents[1] / "scenarios"))
    from test_standing_on_an_edge import standing

    rocks = standing(lean=0.9 * math.atan(0.4), duration=2.0)
    slips = standing(half=(0.2, 0.2), lean=0.5 * math.pi / 4, friction="none", duration=1.0).model_copy(update={"name": "slips"})
    found = comparisons.run([rocks, slips], ["mujoco", "pybullet"])
    assert found.lasting_errors("model").empty, found.lasting_errors("model").to_string()
