"""`calibrate`: pasted programs run without dropspin and do what was measured."""

import math
import re
import subprocess
import sys

import numpy as np
import pytest

from dropspin.comparisons import calibration
from dropspin.comparisons.calibration import calibrate, drop
from dropspin.comparisons.engines.mujoco_model import damping_ratio
from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.running.driving import simulate
from dropspin.scenarios import DropspinError, load

RESTITUTIONS = (0.0, 0.3, 0.5, 0.8, 0.95)
STEPS = (1 / 60, 1 / 240, 1e-3)
# Each restitution at one step, each step at one or more restitutions; the rest of the grid is slow.
CASES = [
    pytest.param(name, e, dt, marks=[] if number % len(STEPS) == place else [pytest.mark.slow])
    for name in ("mujoco", "pybullet")
    for number, e in enumerate(RESTITUTIONS)
    for place, dt in enumerate(STEPS)
]
WITHOUT_DROPSPIN = "import sys\nassert 'dropspin' not in sys.modules\n"
PRINTED = re.compile(r"restitution (\S+)\n")


def value(found, name):
    return next(one.value for one in found.measured if one.name == name)


def programs(name, restitution, dt, **given):
    """The programs of a calibration, which take no measurement."""
    return engine(name).programs(drop(restitution, **given), dt)


@pytest.fixture
def without_step_search(monkeypatch):
    """Leave out the search for the largest stable step, which takes hundreds of drops and which not every test is about."""
    monkeypatch.setattr(calibration, "_largest_step", lambda motion, dt: (dt, "not searched"))


@pytest.mark.sample(1)
@pytest.mark.parametrize(("name", "e", "dt"), CASES)
@pytest.mark.usefixtures("without_step_search")
def test_pasted_program_has_the_measured_restitution(name, e, dt, capsys):
    """Asked, measured and obtained are equal to 2e-4 (1e-4 at 1/60 s, by the impedance)."""
    found = calibrate(engine(name), e, dt)
    assert value(found, "restitution") == pytest.approx(e, abs=2e-4)
    exec(found.programs["python"], {"__name__": "__main__"})
    got = float(PRINTED.fullmatch(capsys.readouterr().out)[1])
    assert got == pytest.approx(value(found, "restitution"), abs=2e-4)


@pytest.mark.extended
@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
def test_pasted_program_needs_the_engine_alone(name, tmp_path):
    """In an interpreter of its own; it leaves no file."""
    script = tmp_path / "pasted.py"
    script.write_text(programs(name, 0.5, 1 / 60)["python"] + WITHOUT_DROPSPIN)
    done = subprocess.run([sys.executable, script.name], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert PRINTED.fullmatch(done.stdout)
    assert [path.name for path in tmp_path.iterdir()] == ["pasted.py"]


@pytest.mark.extended
@pytest.mark.usefixtures("without_step_search")
@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
def test_calibration_of_a_box_with_friction(name):
    """It rests, and rebounds with the restitution asked for."""
    found = calibrate(engine(name), 0.7, 4e-3, friction=0.4, shape="box")
    assert value(found, "restitution") == pytest.approx(0.7, abs=2e-4)
    assert value(found, "jitter at rest") < 1e-3


@pytest.mark.parametrize("shape", ["ball", "box"])
@pytest.mark.parametrize(
    "name", ["mujoco", "mujoco[kappa=0.002]", "mujoco[spring_steps=20]", "pybullet", "pybullet[coordinates=multibody]"]
)
def test_program_moves_as_the_adapter_does(name, shape):
    """Over 2 s with several bounces, to 1e-7 m (measured: Bullet's box 1.2e-8, others 1e-12)."""
    names = {"__name__": "pasted"}
    exec(programs(name, 0.7, 2e-3, friction="infinite", shape=shape)["python"], names)
    heights, speeds = names["motion"](1.0, 1000)
    body = {"shape": "sphere", "radius": 0.1} if shape == "ball" else {"shape": "box", "half_extents": [0.15, 0.1, 0.25]}
    scene = load(
        {
            "duration": 2.0,
            "body": body | {"mass": 1.0},
            "start": {"position": [0.0, 1.1, 0.0]},
            "gravity": {"acceleration": [0.0, -9.81, 0.0]},
            "floor": {"restitution": 0.7, "friction": "infinite"},
        }
    )
    motion = simulate(scene, name, 2e-3)
    np.testing.assert_allclose(heights, motion.position[:, 1] - 0.1, atol=1e-7)
    np.testing.assert_allclose(speeds, motion.velocity[:, 1], atol=1e-6)


@pytest.mark.parametrize(
    "name", ["mujoco", "mujoco[kappa=0.002]", "mujoco[integrator=rk4,spring_steps=20]", "mujoco[integrator=implicitfast]"]
)
@pytest.mark.parametrize("friction", ["none", "infinite", 0.4])
def test_mjcf_steps_as_the_program_to_the_last_bit(name, friction):
    import mujoco

    found = programs(name, 0.7, 2e-3, friction=friction)
    names = {"__name__": "pasted"}
    exec(found["python"], names)
    model = mujoco.MjModel.from_xml_string(found["mjcf"])
    data = mujoco.MjData(model)
    heights = [1.0]
    for _ in range(500):
        mujoco.mj_step(model, data)
        heights.append(data.qpos[2] - 0.1)
    np.testing.assert_array_equal(heights, names["motion"](1.0, 500)[0])


@pytest.mark.parametrize("shape", ["ball", "box"])
def test_urdf_moves_as_the_body_of_the_program(shape, tmp_path):
    """Loaded into the world of the Python program, it has the same moments of inertia and rebounds alike."""
    import pybullet

    found = programs("pybullet", 0.7, 2e-3, shape=shape)
    names = {"__name__": "pasted"}
    exec(found["python"], names)
    (tmp_path / "body.urdf").write_text(found["urdf"])
    client = pybullet.connect(pybullet.DIRECT)
    try:
        original = names["build"](client, 1.0)
        loaded = pybullet.loadURDF(str(tmp_path / "body.urdf"), [5, 0, 1.1], useMaximalCoordinates=True, physicsClientId=client)
        pybullet.changeDynamics(
            loaded, -1, contactProcessingThreshold=0, linearDamping=0, angularDamping=0, activationState=2, physicsClientId=client
        )
        speeds = []
        for _ in range(500):
            pybullet.stepSimulation(client)
            speeds.append([pybullet.getBaseVelocity(one, client)[0][2] for one in (original, loaded)])
        moments = [pybullet.getDynamicsInfo(one, -1, client)[2] for one in (original, loaded)]
    finally:
        pybullet.disconnect(client)
    np.testing.assert_allclose(speeds, np.array(speeds)[:, [0, 0]], atol=1e-9)
    np.testing.assert_allclose(moments[0], moments[1], rtol=1e-12)


@pytest.mark.extended
@pytest.mark.parametrize("e", [0.3, pytest.param(0.5, marks=pytest.mark.slow), pytest.param(0.8, marks=pytest.mark.slow), 0.95])
def test_damper_holds_for_its_step_only(e):
    """v+ = v (1 - b h): at another step h than dt, e becomes (1 + e) h/dt - 1; at least 0, and 1 at the largest stable step."""
    found = calibrate(engine("mujoco"), e, 2e-3)
    assert value(found, "restitution at half the step") == pytest.approx(0.0, abs=1e-3)  # (e - 1)/2 < 0: the ball keeps moving down
    assert value(found, "largest stable step") == pytest.approx(2 * 2e-3 / (1 + e), rel=0.012)
    assert value(found, "penetration") == pytest.approx(math.sqrt(2 * 9.81) * 2e-3 * 63.5 / 64, rel=0.02)


@pytest.mark.extended
@pytest.mark.usefixtures("without_step_search")
@pytest.mark.parametrize("e", [0.3, pytest.param(0.5, marks=pytest.mark.slow), pytest.param(0.8, marks=pytest.mark.slow), 0.95])
def test_restitution_of_bullet_does_not_depend_on_the_step(e):
    assert value(calibrate(engine("pybullet"), e, 2e-3), "restitution at half the step") == pytest.approx(e, abs=1e-12)


def elastic(drop, steps, dt):
    """The exact heights of a body that falls freely and rebounds from springs half a metre deep."""
    fall, rate = math.sqrt(2.0 * drop / calibration.GRAVITY), math.sqrt(2.0 * calibration.GRAVITY * drop) / 0.5
    since = (dt * np.arange(steps + 1) + fall) % (2.0 * fall + math.pi / rate)  # the last apex was half a flight earlier
    flying = drop - calibration.GRAVITY * (since - fall) ** 2 / 2.0
    return np.where(since < 2.0 * fall, flying, -0.5 * np.sin(rate * (since - 2.0 * fall))), None


def sinking(drop, steps, dt):
    """The exact heights of a body that lands and sinks at 5 cm/s."""
    t = dt * np.arange(steps + 1)
    fall = math.sqrt(2.0 * drop / calibration.GRAVITY)
    return np.where(t < fall, drop - calibration.GRAVITY * t**2 / 2.0, -0.05 * (t - fall)), None


def test_body_deep_in_an_impact_has_not_sunk():
    """At whatever time the motion ends; one that sinks slowly has."""
    assert (elastic(1.0, 300, 0.01)[0][-60:] < -calibration.SUNK).any()
    assert calibration._largest_step(elastic, 0.01)[0] == calibration.LARGEST_STEP
    assert math.isnan(calibration._largest_step(lambda *given: (sinking(*given)[0] - 0.05, None), 0.01)[0])


@pytest.mark.extended
def test_largest_stable_step_of_bullet_is_the_largest_tested():
    """Restitution at any step: no step up to 0.1 s gains energy."""
    assert value(calibrate(engine("pybullet"), 0.5, 1 / 30), "largest stable step") == calibration.LARGEST_STEP


@pytest.mark.parametrize("e", [0.05, 0.3, 0.5, 0.8, 0.95, 0.99])
def test_spring_pushes_until_its_force_ends(e):
    """Where k r + b v = 0. Without gravity, over 1,000 steps of RK4: e to 2e-4 (measured 1.2e-4), unlike the textbook formula."""
    free = load(
        {
            "duration": 0.8,
            "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0},
            "start": {"position": [0.0, 0.3, 0.0], "velocity": [0.0, -1.0, 0.0]},
            "floor": {"restitution": e, "friction": "none"},
        }
    )
    rebound = simulate(free, "mujoco[integrator=rk4,spring_steps=1000]", 2.5e-4).velocity[-1, 1]
    assert rebound == pytest.approx(e, abs=2e-4)
    z = damping_ratio(e)
    if e in (0.3, 0.5, 0.8):
        assert abs(math.exp(-math.pi * z / math.sqrt(1 - z * z)) - e) > 0.005


def test_damping_ratios_of_the_spring_are_the_published_ones():
    """Damping ratios of seven restitutions, to the four digits they were published with."""
    found = [damping_ratio(e) for e in (0.05, 0.1, 0.3, 0.5, 0.8, 0.95, 0.99)]
    np.testing.assert_allclose(found, [1.945, 1.243, 0.497, 0.255, 0.0744, 0.0165, 0.0032], rtol=2e-2, atol=5e-4)


@pytest.mark.extended
def test_spring_over_n_steps_has_the_depth_of_a_half_wave():
    """Over 40 steps u N dt/pi, less the damping; it is stable well beyond its step."""
    found = calibrate(engine("mujoco[spring_steps=40]"), 0.95, 1e-3)
    assert value(found, "restitution") == pytest.approx(0.95, abs=0.02)
    assert value(found, "penetration") == pytest.approx(math.sqrt(2 * 9.81) * 40e-3 / math.pi, rel=0.05)
    assert value(found, "largest stable step") > 5e-3


def test_calibration_at_a_time_step_that_is_unstable_is_an_error():
    """At 0.5 s a ball is 4.9 m below the floor in some steps, although the speeds of its impact have the restitution."""
    with pytest.raises(DropspinError, match=r"mujoco has no usable settings for this time step: at 0\.5 s the body gains 2 %"):
        calibrate(engine("mujoco"), 0.7, 0.5)


@pytest.mark.usefixtures("without_step_search")
def test_sinking_on_a_damper_is_told_from_jitter():
    """A damper (1 + e)/dt holds a ball up that sinks by g dt²/(1 + e) (1 - d)/d in a step, with an impedance d of 0.9999."""
    found = calibrate(engine("mujoco"), 0.7, 2e-3)
    assert value(found, "sinking at rest") == pytest.approx(9.81 * 2e-3 / 1.7 * 1e-4, rel=1e-3)
    assert value(found, "jitter at rest") < 1e-12


@pytest.mark.usefixtures("without_step_search")
def test_sinking_is_that_of_a_line_through_all_positions():
    """Of a body that sinks by 1e-4 m/s with a jitter of 5e-4 m, which two positions alone would tell wrongly by as much."""

    def motion(drop, steps, dt):
        times = dt * np.arange(steps + 1)
        if drop == calibration.LOW_DROP:
            heights = -1e-4 * times - 2.5e-4 * np.cos(1.001 * np.pi * np.arange(steps + 1))
            return list(heights), list(np.zeros(steps + 1))
        impact = math.sqrt(2.0 * drop / 9.81)
        falls, after = times < impact, times - impact
        heights = np.where(falls, drop - 0.5 * 9.81 * times**2, 0.5 * 9.81 * impact * after - 0.5 * 9.81 * after**2)
        return list(heights), list(np.where(falls, -9.81 * times, 0.5 * 9.81 * impact - 9.81 * after))

    found = {one.name: one.value for one in calibration.measurements(motion, 2e-3)}
    assert found["sinking at rest"] == pytest.approx(1e-4, rel=0.05)
    assert found["jitter at rest"] == pytest.approx(5e-4, rel=0.01)


@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("wang", {}, "wang has no settings to calibrate"),
        ("mujoco[integrator=rk4]", {}, "RK4 the adapter's one-step damper acts in all stages"),
        ("mujoco[spring_steps=20]", {"restitution": 0.0}, "a restitution of at least 0.01"),
        ("mujoco", {"restitution": 1.5}, "restitution"),
        ("mujoco", {"dt": -1.0}, "dt: got -1.0 s"),
        ("mujoco", {"dt": float("nan")}, "dt: got nan s"),
        ("pybullet", {"friction": 11.0}, "caps friction at 10"),
        ("pybullet", {"friction": -1.0}, "friction"),
    ],
)
def test_calibration_that_is_not_possible_is_an_error(name, given, message):
    with pytest.raises(DropspinError, match=re.escape(message)):
        calibrate(engine(name), **{"restitution": 0.5, "dt": 1e-3} | given)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("mujoco[kappa=2]", "kappa: got '2'; it is a number from 0 to 1"),
        ("mujoco[kappa=nan]", "kappa: got 'nan'"),
        ("mujoco[spring_steps=2]", "a spring takes at least 5 steps"),
        ("mujoco[kappa=a]", "kappa: got 'a'"),
        ("mujoco[kappa=0.002,spring_steps=20]", "do not go together"),
        ("mujoco[kappa=0.002,profile=default]", "do not go together"),
    ],
)
def test_invalid_numeric_options_are_errors(name, message):
    with pytest.raises(DropspinError, match=re.escape(message)):
        engine(name)


def test_equal_numeric_options_have_equal_labels():
    assert engine("mujoco[kappa=2e-3]").label == engine("mujoco[kappa=0.0020]").label == "mujoco[kappa=0.002]"
    assert engine("mujoco[kappa=0.0]").label == "mujoco"
    assert engine("mujoco[spring_steps=20.0]").label == "mujoco[spring_steps=20]"
