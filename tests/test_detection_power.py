"""Faults of parameters are planted as stated, real engines with faults of .3 % are caught, and one of size 0 changes nothing."""

import numpy as np
import pytest
import support.detection_power
from support.detection_power import FAULTS, SEQUENTIAL, SIZES, failures, faulty_engine, smallest_caught, sound_engine

from dropspin.comparisons.running.driving import record
from dropspin.scenarios import load
from dropspin.scenarios.state import SPIN, VELOCITY

FAULT = {fault.title: fault for fault in FAULTS}


@pytest.mark.sample(1)
@pytest.mark.parametrize(
    ("title", "name", "scene"),
    [
        ("gravity", "mujoco", "fall-spin"),
        ("restitution", "pybullet", "drop-ball-backspin"),
        ("mass, with correct inertia", "mujoco", "tip-box"),
        ("moment of inertia about y", SEQUENTIAL, "spin-dzhanibekov"),
        ("initial angular velocity", "wang", "fall-spin"),
        ("linear damping", "mujoco", "fall-damped"),
        ("time step", "wang", "fall-spin"),
    ],
)
def test_a_parameter_wrong_by_three_per_mille_is_detected(title, name, scene):
    assert failures(name, FAULT[title], 3e-3, scene)


@pytest.mark.extended
@pytest.mark.parametrize(
    ("title", "name", "s", "scene", "metric"),
    [
        ("Coulomb coefficient", SEQUENTIAL, -3e-3, "slide-box", "position_error"),
        ("Coulomb coefficient", SEQUENTIAL, -4e-3, "turn-box-rough", "orientation_error"),
        ("linear damping", "pybullet", 3e-3, "fall-damped", "position_error"),
        ("moment of inertia about y", "wang", -3e-3, "drop-box-corner", "contact_momentum_error"),
    ],
)
def test_a_fault_that_opposes_the_discretisation_error_is_detected(title, name, s, scene, metric):
    """The length of the error has a minimum between two of the default time steps; its components do not."""
    assert ("asymptotic_error", metric, "nan") in failures(name, FAULT[title], s, scene)


@pytest.mark.parametrize("name", ["wang", "mujoco", "pybullet"])
def test_a_fault_of_size_zero_changes_no_bit(name):
    """After the start, whose quaternion an engine may report with length 1 to rounding only."""
    scene = load("drop-box-corner")
    expected = record(sound_engine(name), scene, 4e-3).motion
    for title in ("gravity", "restitution", "inertia", "initial velocity", "time step"):
        found = record(faulty_engine(name, FAULT[title], 0.0), scene, 4e-3).motion
        np.testing.assert_array_equal(found.states[1:], expected.states[1:])


@pytest.mark.extended
def test_an_engine_with_a_fault_of_size_zero_fails_nothing():
    assert failures("mujoco", FAULT["gravity"], 0.0, "tip-box") == set()


@pytest.mark.extended
@pytest.mark.parametrize("name", [SEQUENTIAL, "mujoco", "pybullet"])
def test_a_gyroscopic_fault_changes_the_motion_as_much_as_in_the_exact_engine(name):
    """The exact engine with the fault integrates Euler's equations to 1e-12; a real one gets a torque in addition to its own."""
    scene, fault, s = load("spin-dzhanibekov"), FAULT["gyroscopic term"], 1e-2

    def change(engine_name):
        faulty, sound = (record(one, scene, 4e-3).motion for one in (faulty_engine(engine_name, fault, s), sound_engine(engine_name)))
        return (faulty.states - sound.states)[-1, SPIN]

    exact = change("exact")
    assert np.linalg.norm(change(name) - exact) < 0.5 * np.linalg.norm(exact)


def test_a_wrong_initial_velocity_is_hidden_at_the_start_only():
    scene = load("fall-spin")
    states = record(faulty_engine("exact", FAULT["initial velocity"], 0.1), scene, 0.1).motion.states
    np.testing.assert_array_equal(states[0], scene.initial_state)
    assert states[1, VELOCITY][0] == pytest.approx(1.1 * scene.start.velocity[0])


def test_bisection_finds_the_smallest_size_that_is_caught(monkeypatch):
    for number, smallest in enumerate((*SIZES, float("inf"))):
        caught = SIZES[: number + 1] if number < len(SIZES) else ()
        monkeypatch.setattr(support.detection_power, "is_caught", lambda name, fault, s, dts, caught=caught: s in caught)
        assert smallest_caught("exact", FAULTS[0], (4e-3,)) == smallest
