"""Calibrated and default profiles: errors of the defaults are setting errors, errors of both are model errors."""

import math

import numpy as np
import pytest

from dropspin.comparisons.engines.options import calibrated_label
from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.running.driving import record, simulate
from dropspin.comparisons.running.run import run
from dropspin.scenarios import DropspinError, Trajectory, load, truth_for
from dropspin.scenarios.mechanics import kinetic_energy

SPIN = load("spin-asymmetric").model_copy(update={"duration": 2.0})


def ball(e):
    return load(
        {
            "name": "ball",
            "duration": 1.0,
            "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0},
            "start": {"position": [0.0, 1.1, 0.0]},
            "gravity": {"acceleration": [0.0, -9.81, 0.0]},
            "floor": {"restitution": e, "friction": "none"},
        }
    )


def apparent(name, e, dt):
    """√(h₁/h₀) of a drop from 1 m: the apparent restitution."""
    motion = simulate(ball(e), name, dt)
    after = int(np.argmin(motion.velocity[:, 1])) + 1
    return math.sqrt(max(motion.position[after:, 1].max() - 0.1, 0.0))


@pytest.mark.parametrize("e", [0.0, 0.3, 0.5, 0.8, 0.95])
@pytest.mark.parametrize("dt", [1 / 60, 1 / 240, 1e-3, 1 / 4000])
def test_multibody_restitution_includes_a_step_of_gravity(e, dt):
    """Bullet's multibody collides after gravity, as Wang's method does: e (1 + g dt/u); measured .5185 at e = .5, 1/60 s."""
    motion = simulate(ball(e), "pybullet[coordinates=multibody]", dt)
    last = int(np.argmin(motion.velocity[:, 1]))
    down, up = motion.velocity[last : last + 2, 1]
    assert -up / down == pytest.approx(e * (1 - 9.81 * dt / down), abs=1e-12)


def test_default_restitution_of_pybullet_vanishes_with_the_step():
    """Published for e = .5: up to .512 at 1/240 s, .1081 at 1 ms, up to .02 at 1/4000 s; for e = .95, .0319 at 1/4000 s."""
    found = [apparent("pybullet[profile=default]", 0.5, dt) for dt in (1 / 60, 1 / 240, 1e-3, 1 / 4000)]
    np.testing.assert_allclose(found[:3], [0.5143, 0.4963, 0.1081], atol=5e-5)
    assert found[3] < 0.03
    assert apparent("pybullet[profile=default]", 0.95, 1 / 4000) < 0.04


@pytest.mark.parametrize("name", ["mujoco", "pybullet"])
@pytest.mark.parametrize("friction", ["none", "infinite"])
def test_tilted_box_keeps_the_energy_of_a_rigid_impact(name, friction):
    """Kinetic energy just after the first impact over that of the exact solution: 1 to .2 % at 1/4000 s (measured 1.0002 to 1.0006)."""
    scene = load(
        {
            "name": "tilted",
            "duration": 0.5,
            "body": {"shape": "box", "half_extents": [0.1, 0.15, 0.25], "mass": 1.0},
            "start": {"position": [0.0, 1.2, 0.0], "orientation": [0.2, 0.1, 0.3, 0.9]},
            "gravity": {"acceleration": [0.0, -9.81, 0.0]},
            "floor": {"restitution": 0.5, "friction": friction},
        }
    )
    impact = truth_for(scene).events[0]
    dt = 1 / 4000
    motion = simulate(scene, name, dt)
    after = math.ceil(impact.time / dt)
    exact = kinetic_energy(scene, Trajectory.from_states(np.zeros(1), impact.after[None]))[0]
    assert kinetic_energy(scene, motion[after : after + 1])[0] == pytest.approx(exact, rel=2e-3)
    assert kinetic_energy(scene, motion)[after - 1] > 1.4 * exact


def test_mujoco_has_no_restitution_by_default():
    """The same for every restitution of the scene, and below 0.05."""
    for dt in (1 / 240, 1e-3):
        assert len({apparent("mujoco[profile=default]", e, dt) for e in (0.0, 0.5, 0.95)}) == 1
        assert apparent("mujoco[profile=default]", 0.95, dt) < 0.05


@pytest.mark.extended
def test_error_of_the_defaults_alone_is_a_setting_error(monkeypatch):
    """It does not vanish as dt → 0 and the calibrated profile does not have it; without that profile in the run it is a model error."""
    monkeypatch.setattr("dropspin.comparisons.running.start_phases.QUICK_START_PHASES", 2)
    ball = load("drop-ball").model_copy(update={"duration": 0.8})
    steps = [5e-4, 2.5e-4, 1.25e-4]  # by default no ball bounces at such steps; at coarser ones some do
    both = run(ball, ["pybullet", "pybullet[profile=default]"], steps, quick=True)
    lasting = both.asymptotic_errors("setting")
    assert set(lasting["engine"]) == {"pybullet[profile=default]"}
    assert {"energy_error", "bounce_height_error"} <= set(lasting["metric"])
    assert both.asymptotic_errors("model").empty
    assert lasting["reason"].str.contains("it is a setting").all()
    alone = run(ball, ["pybullet[profile=default]"], steps, quick=True)
    assert not alone.asymptotic_errors("model").empty
    assert alone.asymptotic_errors("setting").empty


def test_engine_without_profiles_keeps_its_model_errors():
    found = run(SPIN, ["wang", "mujoco", "mujoco[profile=default]"])
    assert set(found.asymptotic_errors("model")["engine"]) == {"wang"}
    assert found.asymptotic_errors("setting").empty  # free spin has no settings to get wrong in MuJoCo


def test_profiles_and_coordinates():
    """Labels, the label of the calibrated profile, and options that exclude each other."""
    assert calibrated_label("pybullet[profile=default]") == "pybullet"
    assert calibrated_label("mujoco[integrator=implicitfast,profile=default]") == "mujoco[integrator=implicitfast]"
    assert calibrated_label("mujoco") is calibrated_label("mujoco[kappa=0.002]") is None
    assert engine("pybullet[profile=calibrated]").label == "pybullet"
    with pytest.raises(DropspinError, match="profile=default sets coordinates and velocity_clamp"):
        engine("pybullet[coordinates=multibody,profile=default]")
    with pytest.raises(DropspinError, match="only multibodies clamp speeds"):
        engine("pybullet[velocity_clamp=kept]")
    assert "damp by another law" in engine("pybullet[coordinates=multibody]").declines(load("fall-damped"))
    for name in ("mujoco", "pybullet"):
        with engine(f"{name}[profile=default]").prepare(ball(0.5), 1e-3) as simulation:
            assert simulation.settings["profile"] == "default"


def test_bullet_tumbles_as_mujoco_with_the_same_discretisation():
    """Multibodies as MuJoCo's Euler, maximal coordinates as its implicitfast, to 1e-9 of the angular momentum after a second."""
    scene = load("spin-dzhanibekov")
    scene = scene.model_copy(update={"duration": 1.0})
    for one, other in (("pybullet[coordinates=multibody]", "mujoco"), ("pybullet", "mujoco[integrator=implicitfast]")):
        assert engine(one).discretisation(scene) == engine(other).discretisation(scene)
        first, second = (simulate(scene, name, 1e-3).angular_velocity for name in (one, other))
        np.testing.assert_allclose(first, second, atol=1e-9 * 5)


@pytest.mark.extended
def test_bullet_reports_short_rotations_and_clamped_friction():
    """Rotations are too small beyond π/4 rad a step; a contact slips that needs friction above 10 times its normal force."""

    def limits_of(scene, dt):
        return [limitation.message for limitation in record(engine("pybullet"), scene, dt).limitations]

    def limited_in_a_run(scene, dt):
        found = run(scene, "pybullet", dt).table
        return list(found.loc[found["verdict"] == "limited", "reason"])

    fast = load("spin-principal-500")
    assert limits_of(fast, 1.5e-3) == []  # .75 rad
    [message] = limits_of(fast, 1.6e-3)
    assert "turns by up to 0.8 rad a step" in message
    assert limited_in_a_run(fast, 1.6e-3) == [message]
    gripping = ball(0.5).model_copy(update={"floor": ball(0.5).floor.model_copy(update={"friction": "infinite"})})
    u = 1.0 + 9.81 * 1e-3

    def spinning(ratio):  # stopping the contact takes 2/7 of its speed; the normal impulse is 1.5 u
        spin = ratio * 1.5 * u * 3.5 / 0.1
        return gripping.starting_at(np.array([0, 0.1 + 1e-9, 0, 0, 0, 0, 1, 0, -1.0, 0, 0, 0, spin]))

    assert not [message for message in limits_of(spinning(9.9), 1e-4) if "slips" in message]
    [message] = [message for message in limits_of(spinning(10.5), 1e-4) if "slips" in message]
    assert message in limited_in_a_run(spinning(10.5), 1e-4)
    assert limits_of(load("rock-block"), 2e-3) == []
