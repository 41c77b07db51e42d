"""`measure` refuses a motion that is not the scene's and says why; motions with any error of an engine are measured."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dropspin.comparisons.engines.registry import engine as engine_named
from dropspin.comparisons.running.driving import record
from dropspin.comparisons.running.run import measure
from dropspin.scenarios import DropspinError, Trajectory, load, truth_for

DT = 1e-3
BALL = load(
    {
        "duration": 1.0,
        "body": {"shape": "sphere", "radius": 0.1, "mass": 1.0},
        "start": {"position": [0.0, 1.1, 0.0]},
        "gravity": {"acceleration": [0.0, -9.8, 0.0]},
        "floor": {"restitution": 0.5, "friction": "none"},
    }
)
FLIGHT = load("spin-asymmetric").model_copy(update={"duration": 1.0})


def times_and_states(scene):
    times = DT * np.arange(scene.steps(DT) + 1)
    return times, truth_for(scene)(times).states


def with_part(part, change):
    def changed(t, rows):
        rows[:, part] = change(rows[:, part])
        return t, rows

    return changed


def jittered(t, rows):
    return t + 0.2 * DT * np.random.default_rng(0).uniform(-1.0, 1.0, len(t)) * (t > 0.0), rows


MISMATCHES = {
    "z up": (BALL, lambda t, rows: (t, rows[:, [0, 2, 1, 3, 5, 4, 6, 7, 9, 8, 10, 12, 11]]), "y and z appear to be swapped; y is up"),
    "wxyz": (BALL, with_part(slice(3, 7), lambda q: np.roll(q, 1, axis=1)), "the quaternion appears to be ordered [w, x, y, z]"),
    "millimetres": (BALL, with_part(slice(0, 3), lambda x: 1e3 * x), "lengths appear to be in millimetres; a state has m"),
    "degrees": (FLIGHT, with_part(slice(10, 13), np.rad2deg), "angular velocity appears to be in degrees per second"),
    "opposite velocity": (BALL, with_part(slice(7, 10), np.negative), "velocity has the opposite sign"),
    "higher": (
        BALL,
        with_part(1, lambda y: y + 0.01),
        "it begins at (0, 1.11, 0) m with velocity (0, 0, 0) m/s and angular velocity (0, 0, 0) rad/s, the scene at (0, 1.1, 0) m",
    ),
    "late": (BALL, lambda t, rows: (t[:-100], rows[100:]), "it begins at (0, 1.051, 0) m with velocity (0, -0.98, 0) m/s"),
    "late times": (BALL, lambda t, rows: (t[100:], rows[100:]), "the times begin at 0.1 s; give the motion from the scene's start on"),
    "milliseconds": (BALL, lambda t, rows: (1e3 * t, rows), "the times appear to be in ms"),
    "microseconds": (FLIGHT.model_copy(update={"start": BALL.start.model_copy(update={"velocity": (1.0, 0.0, 0.0)})}), None, "µs"),
    "milliseconds of a spin": (FLIGHT, lambda t, rows: (1e3 * t, rows), "the times appear to be in ms, by the angular velocities"),
    "jitter": (BALL, jittered, "the times are not equally spaced: steps are 0.000"),
    "gap": (
        BALL,
        lambda t, rows: (np.delete(t, [300, 301, 500]), np.delete(rows, [300, 301, 500], axis=0)),
        "3 states are missing between equal steps, the first after 0.299 s",
    ),
    "backwards": (BALL, lambda t, rows: (t[::-1], rows), "the times do not increase"),
    "revolutions per minute": (FLIGHT, with_part(slice(10, 13), lambda w: w * 30.0 / np.pi), "and angular velocity ("),
    "long quaternions": (FLIGHT, with_part(slice(3, 7), lambda q: 1.01 * q), "the quaternion at 0 s has length 1.01"),
    "no number": (BALL, lambda t, rows: (t, np.where(t[:, None] > 0.5, np.nan, rows)), "the state at 0.501 s is not finite"),
    "kilometres per hour": (BALL, with_part(slice(7, 10), lambda v: 3.6 * v), "velocities are 3.6 times the change of the position"),
    "no velocities": (BALL, with_part(slice(7, 10), np.zeros_like), "velocities are 0 while the position changes"),
}


@pytest.mark.parametrize("name", MISMATCHES)
def test_motion_that_is_not_the_scenes_is_named(name):
    scene, change, message = MISMATCHES[name]
    t, rows = (change or (lambda t, rows: (1e6 * t, rows)))(*times_and_states(scene))
    with pytest.raises(DropspinError) as error:
        measure(scene, Trajectory.from_states(t, rows))
    assert str(error.value).startswith("motion: ")
    assert message in str(error.value)


@pytest.mark.parametrize("every", [1, 10])
@pytest.mark.parametrize("scene", [BALL, FLIGHT], ids=["ball", "flight"])
def test_sound_motion_is_measured(scene, every):
    t, rows = times_and_states(scene)
    found = measure(scene, Trajectory.from_states(t[::every], rows[::every]))
    assert found["position_error"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.extended
@pytest.mark.parametrize("engine", ["wang[law=coulomb]", "mujoco", "mujoco[profile=default]", "pybullet", "pybullet[profile=default]"])
@pytest.mark.parametrize(
    "scene", ["drop-ball", "drop-box-corner", "spin-dzhanibekov", "fall-spin", "drop-ball-backspin", "slide-box", "rock-block"]
)
def test_motion_with_errors_of_an_engine_is_measured(engine, scene):
    """Also at a step that is far too coarse."""
    brief = load(scene).model_copy(update={"duration": 1.0})
    for dt in (1e-3, 2e-2):
        assert "position_error" in measure(brief, record(engine_named(engine), brief, dt).motion)


def test_fields_of_other_shapes_are_named():
    t, rows = times_and_states(BALL)
    whole = Trajectory.from_states(t, rows)
    for position, given in ((whole.position.tolist(), "list of shape (1001, 3)"), (whole.position[:7], "ndarray of shape (7, 3)")):
        with pytest.raises(DropspinError, match=re.escape(f"position is {given}; give an array of shape (1001, 3)")):
            measure(BALL, replace(whole, position=position))


def test_motion_of_a_spin_that_grows_is_measured_and_not_taken_for_degrees():
    scene = load("spin-principal")
    t = DT * np.arange(scene.steps(DT) + 1)
    rows = np.tile(scene.initial_state, (len(t), 1))
    spin = rows[0, 10:] / 3.0
    turned = Rotation.from_rotvec(np.outer(np.expm1(3.0 * t), spin)) * Rotation.from_quat(rows[0, 3:7])
    rows[:, 3:7], rows[:, 10:] = turned.as_quat(), np.exp(3.0 * t)[:, None] * rows[0, 10:]
    assert measure(scene, Trajectory.from_states(t, rows))["energy_error"] > 100.0


def test_frozen_motion_is_measured():
    t, rows = times_and_states(BALL)
    frozen = np.tile(rows[0], (len(rows), 1))
    assert measure(BALL, Trajectory.from_states(t, frozen))["position_error"] > 0.5


def test_body_that_stays_up_to_rounding_is_measured():
    """Its velocities, whose squares are 0, tell nothing of the unit of the times."""
    t, rows = times_and_states(FLIGHT)
    rows[1:, :3] += 1e-16 * np.random.default_rng(0).normal(size=(len(rows) - 1, 3))
    rows[1:, 7:10] = 1e-170
    assert measure(FLIGHT, Trajectory.from_states(t, rows))["orientation_error"] < 1e-12
