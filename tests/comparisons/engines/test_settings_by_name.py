"""Settings of an engine's library as options: what may be given, what is in force, and motions with a closed form."""

import math
from typing import ClassVar

import numpy as np
import pytest
from support.settings import verify_defaults_are_in_force, verify_settings_are_in_force

from dropspin.comparisons.engines.mujoco_settings import SETTINGS, in_force
from dropspin.comparisons.engines.options import Configured
from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.engines.settings import Setting, spelled
from dropspin.comparisons.running.adapter_output import verify_build
from dropspin.comparisons.running.driving import simulate
from dropspin.reports.stories.show import built_rows, setting_rows
from dropspin.scenarios import DropspinError, load

BALL = {"shape": "sphere", "radius": 0.1, "mass": 2.0}
GRAVITY = {"acceleration": [0.0, -9.81, 0.0]}
FLOOR = {"restitution": 0.6, "friction": 0.4}


def scene(duration=1.0, **tables):
    return load({"name": "a ball", "duration": duration, "body": BALL, **tables})


def falling(duration=1.0, floor=FLOOR):
    start = {"position": [0.0, 0.3, 0.0], "velocity": [0.7, -2.0, 0.3], "angular_velocity": [3.0, 5.0, 2.0]}
    return scene(duration, start=start, floor=floor, gravity=GRAVITY)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("mujoco[solreff=1 2]", "Did you mean 'solref'"),
        ("pybullet[linear_dampin=1]", "Did you mean 'linearDamping'"),
        ("mujoco[solref=1]", "solref: got '1'; it is 2 numbers, by default 0.02 1"),
        ("mujoco[solref=nan 1]", "it is 2 numbers"),
        ("mujoco[solimp=0.9 0.95 -1 0.5 2]", "it is 5 numbers from 0"),
        ("mujoco[cone=round]", "it is one of pyramidal, elliptic"),
        ("mujoco[condim=2]", "it is one of 1, 3, 4, 6"),
        ("mujoco[island=maybe]", "it is one of disable, enable"),
        ("mujoco[iterations=1.5]", "a whole number from 0, by default 100"),
        ("pybullet[useSplitImpulse=2]", "a whole number from 0 to 1"),
        ("mujoco[kappa=0.002,solref=0.02 1]", "solref has no effect with kappa=0.002; it needs kappa=0"),
        ("mujoco[override=enable,solref=0.1 1]", "solref has no effect with override=enable; it needs override=disable"),
        ("mujoco[solver=PGS,ls_iterations=3]", "ls_iterations has no effect with solver=PGS; it needs solver=CG or solver=Newton"),
        ("mujoco[profile=default,solreffriction=0 -100]", "solreffriction has no effect with profile=default"),
        ("mujoco[o_solref=0.02 1]", "it needs override=enable"),
        ("pybullet[maxJointVelocity=100]", "maxJointVelocity has no effect with coordinates=maximal"),
        ("pybullet[coordinates=multibody,maxJointVelocity=9,velocity_clamp=kept]", "it needs velocity_clamp=lifted"),
        ("pybullet[contactStiffness=1e4]", "contactStiffness and contactDamping go together"),
        ("pybullet[linearDamping=0,linear_damping=1]", "an option is given twice"),
        ("mujoco[timestep=0.01]", "timestep is the time step of the run; give it with --dt"),
        ("wang[profile=default]", "wang has no profiles; dropspin show SCENE -e wang prints the settings"),
        ("pybullet[mass=2]", "mass is the scene's: change the table body"),
    ],
)
def test_what_cannot_be_given_is_said_in_one_message(given, message):
    with pytest.raises(DropspinError, match=r"^[^\n]*$") as refused:
        engine(given)
    assert message in str(refused.value)


class Solved(Configured):
    name = "solved"
    choices: ClassVar = {"solver": ("xpbd", "springs", "mujoco")}
    settings: ClassVar = {"stiffness": Setting(1.0, "of a contact", needs=(("solver", "springs", "mujoco"),))}


def test_setting_may_need_one_of_several_values_of_an_option():
    for solver in ("springs", "mujoco"):
        assert Solved({"solver": solver, "stiffness": "2"}).given == {"stiffness": 2.0}
    with pytest.raises(DropspinError, match="no effect with solver=xpbd; it needs solver=springs or solver=mujoco"):
        Solved({"stiffness": "2"})
    assert Solved({"solver": "mujoco", "stiffness": "2"}).without(["solver"]).options == {}


class Chained(Configured):
    name = "chained"
    settings: ClassVar = {
        "friction": Setting(0.0, "of a contact", needs=(("contact", "on"),)),
        "contact": Setting("off", "whether there is any", values=("off", "on"), needs=(("floor", "on"),)),
        "floor": Setting("off", "whether there is any", values=("off", "on")),
    }


def test_settings_that_need_each_other_are_left_out_together():
    assert Chained({"friction": "1", "contact": "on", "floor": "on"}).without(["floor"]).options == {}


def test_reported_switch_is_no_word_of_another_setting():
    """False may mean either word; of a switch it means off."""
    kinds = {"grip": Setting("soft", "of a contact", values=("soft", "hard")), "sleep": Setting("off", "of a body", values=("off", "on"))}
    engine_ = type("Worded", (Configured,), {"name": "worded", "settings": kinds})()
    assert [engine_.allows(*one) for one in (("grip", "hard"), ("grip", "false"), ("sleep", "false"), ("sleep", "7"))] == [
        True,
        False,
        True,
        False,
    ]


def test_labels_have_settings_as_they_are_documented():
    assert engine("pybullet[linear_damping=.040,floor_restitution=0]").label == "pybullet[floor_restitution=0,linearDamping=0.04]"
    assert engine("mujoco[solref=-1e3 0,island=on]").label == "mujoco[island=enable,solref=-1000 0]"
    assert engine("pybullet[profile=default,maxJointVelocity=1e9]").calibrated.label == "pybullet"


def test_mujocos_defaults_are_those_of_the_library():
    """Of a body on a plane without any setting."""
    import mujoco

    spec = mujoco.MjSpec()
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[1, 1, 1])
    body = spec.worldbody.add_body()
    body.add_freejoint()
    body.add_geom(size=[0.1, 0, 0])
    found = in_force(spec.compile(), 0)
    assert found == {name: value for name, value in found.items() if SETTINGS[name].is_computed}
    assert {name: spelled(value) for name, value in found.items()} == {name: spelled(SETTINGS[name].default) for name in found}


@pytest.mark.parametrize("name", ["mujoco", "rapier", "dart", "drake"])
def test_engine_has_what_was_given(name):
    """Another value of each setting, in force as read from the model."""
    verify_settings_are_in_force(name, load("slide-box"))
    verify_defaults_are_in_force(name, load("slide-box"))


def test_pybullets_defaults_are_those_of_the_library():
    """Each, given, leaves the motion as it is without it, bit for bit; Bullet's own damping is 0.04 in single precision."""
    plain = simulate(falling(), "pybullet[profile=default]", 1 / 240).states
    chosen = engine("pybullet[profile=default]")
    for name, setting in chosen.settings.items():
        if name not in ("restitution", "lateralFriction", "floor_restitution", "floor_lateralFriction") and not chosen.unmet_need(name):
            given = f"{name}={spelled(setting.default)}"
            pair = {"contactDamping": "contactStiffness", "contactStiffness": "contactDamping"}
            given += "".join(f",{name.replace(one, other)}=-1" for one, other in pair.items() if name.endswith(one))
            found = simulate(falling(), f"pybullet[profile=default,{given}]", 1 / 240).states
            np.testing.assert_allclose(found, plain, rtol=0.0, atol=1e-5 if name.endswith("Damping") else 0.0, err_msg=name)


@pytest.mark.parametrize(
    "given",
    [
        *("numSubSteps=2", "contactERP=0.5", "contactSlop=1e-3", "restitutionVelocityThreshold=5", "globalCFM=0.1", "restitution=0.2"),
        *("lateralFriction=0.01", "rollingFriction=0.1", "spinningFriction=0.1", "anisotropicFriction=1 0.01 0.01", "linearDamping=0.5"),
        *("angularDamping=0.5", "contactProcessingThreshold=0", "maxJointVelocity=1", "floor_restitution=0", "floor_lateralFriction=0.01"),
    ],
)
def test_pybullet_moves_with_what_was_given(given):
    plain, changed = (simulate(falling(), f"pybullet[profile=default{more}]", 1 / 240).states for more in ("", f",{given}"))
    assert np.abs(plain - changed).max() > 1e-6
    np.testing.assert_array_equal(plain, simulate(falling(), "pybullet[profile=default]", 1 / 240).states)  # nothing stays behind


def test_pybullet_returns_what_it_has():
    """Friction and iterations of all bodies, restitution of a multibody: read back, and not what was passed."""
    with engine("pybullet[coordinates=multibody,numSolverIterations=7,rolling_friction=0.25]").prepare(falling(), 1e-3) as simulation:
        simulation._bullet.setPhysicsEngineParameter(numSolverIterations=9)
        assert simulation.settings["numSolverIterations"] == 7
        assert simulation.settings["rollingFriction"] == 0.25
        assert (simulation.settings["restitution"], simulation.settings["floor_restitution"]) == (0.6, 1.0)


def test_bullets_damping_follows_its_law():
    """In maximal coordinates v (1 - k)^t; a multibody's dv/dt = -k v (1 + |v|) has v/(1 + v) = v₀/(1 + v₀) exp(-k t)."""
    flying = scene(start={"velocity": [4.0, 0.0, 0.0]})
    maximal = simulate(flying, "pybullet[linear_damping=0.3]", 1e-3).velocity[-1, 0]
    assert maximal == pytest.approx(4.0 * 0.7, rel=1e-12)
    u = 0.8 * math.exp(-0.3)
    multibody = simulate(flying, "pybullet[profile=default,linear_damping=0.3]", 1e-4).velocity[-1, 0]
    assert multibody == pytest.approx(u / (1.0 - u), rel=2e-4)


def test_mujocos_spring_has_its_depth():
    """Without gravity and damping: v/√k, for a stiffness k per unit of mass and an impedance of 1, to (1 - d) and the step."""
    drop = scene(0.3, start={"position": [0.0, 0.101, 0.0], "velocity": [0.0, -2.0, 0.0]}, floor={"restitution": 0.5, "friction": "none"})
    heights = simulate(drop, "mujoco[solref=-10000 0]", 1e-5).position[:, 1]
    assert 0.1 - heights.min() == pytest.approx(2.0 / 100.0, rel=1e-3)


def test_show_lists_settings_with_sources_and_marks():
    listed = {row["name"]: row for row in setting_rows("pybullet")}
    assert (listed["linearDamping"]["default"], listed["linearDamping"]["calibrated"]) == ("0.04", "computed")
    assert listed["contactERP"]["allowed"] == "a number from 0 to 1"
    rows = {row["what"]: row for row in built_rows(falling(), "pybullet[linear_damping=0.04,floor_restitution=0]", 1e-3)}
    marked = {name: (row["is"], row["source"], row["calibrated"]) for name, row in rows.items() if row["calibrated"]}
    assert marked == {"linearDamping": ("0.04", "given", "0"), "floor_restitution": ("0", "given", "1")}
    assert [rows[name]["source"] for name in ("contactERP", "restitution", "globalCFM")] == ["calibrated", "computed", "engine's default"]
    rows = {row["what"]: row for row in built_rows(falling(), "mujoco[profile=default]", 1e-3)}
    assert (rows["solref"]["is"], rows["solref"]["source"], rows["solref"]["calibrated"]) == ("0.02 1", "engine's default", "0 -1600")
    rows = {row["what"]: row for row in built_rows(falling(), "pybullet[profile=default]", 1e-3)}
    damping = rows["linearDamping"]  # of a multibody, in force without being given
    assert (damping["is"], damping["source"], damping["calibrated"]) == ("0.04", "engine's default", "0")
    assert "o_solref" not in rows  # without override it has no effect


@pytest.mark.parametrize("name", ["rapier", "dart", "drake"])
def test_default_profile_of_other_engines_is_not_the_calibrated_one(name):
    """The body and its start are the same; the motion is another one where it slides."""
    sliding = load("slide-box").model_copy(update={"duration": 0.2})
    default, calibrated = engine(f"{name}[profile=default]"), engine(name)
    with default.prepare(sliding, 2e-3) as simulation:
        verify_build(default, sliding, simulation, 2e-3)
        assert simulation.settings["profile"] == "default"
    moved = simulate(sliding, default, 2e-3).position - simulate(sliding, calibrated, 2e-3).position
    assert 1e-6 < np.abs(moved).max() < 0.1


@pytest.mark.parametrize("name", ["dart", "drake"])
def test_friction_that_is_given_stops_a_box(name):
    """DART takes the smaller coefficient of 0.3 and 0.1; Drake 2 · 0.3 · 0.1 / (0.3 + 0.1)."""
    sliding = load("slide-box").model_copy(update={"duration": 0.2})
    speeds = np.linalg.norm(simulate(sliding, f"{name}[floor_friction=0.1]", 1e-3).velocity[[0, -1]], axis=1)
    assert (speeds[0] - speeds[1]) / (9.8 * 0.2) == pytest.approx({"dart": 0.1, "drake": 0.15}[name], rel=1e-3)


def test_rapiers_default_has_four_substeps_and_averages_restitutions():
    """Velocity lags by half a substep; a ball of restitution 0.6 on a floor of 0.2 rebounds with 0.4, to single precision and a step."""
    smooth = {"restitution": 0.6, "friction": "none"}
    drop = scene(0.2, start={"position": [0.0, 0.15, 0.0], "velocity": [0.0, -2.0, 0.0]}, floor=smooth)
    with engine("rapier[profile=default]").prepare(drop, 2e-3) as simulation:
        assert simulation.velocity_lag == 0.5 * 2e-3 / 4
    speeds = simulate(drop, "rapier[floor_restitution=0.2]", 1e-3).velocity[:, 1]
    assert speeds.max() == pytest.approx(0.8, abs=2e-3)
