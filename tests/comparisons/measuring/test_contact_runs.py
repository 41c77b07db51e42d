"""Contacts are distinguished from wrong accelerations in flight, in one motion and in many, and at any height."""

import numpy as np
import pytest

import dropspin as ds
from dropspin.comparisons.measuring.batch_quantities import motions_side_by_side
from dropspin.comparisons.measuring.comparison import Comparison
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.measuring.motion_quantities import Motions, Setup
from dropspin.comparisons.running.run import measure
from dropspin.scenarios import Trajectory, load, truth_for

G, R, H, E = 9.8, 0.1, 1.0, 0.5
BALL = load(
    {
        "name": "ball",
        "duration": 1.2,
        "body": {"shape": "sphere", "radius": R, "mass": 2.0},
        "start": {"position": [0.0, R + H, 0.0]},
        "gravity": {"acceleration": [0.0, -G, 0.0]},
        "floor": {"restitution": E, "friction": "none"},
    }
)


def rounded_once(position, velocity, step, dt):
    """The state goes through half precision at a quarter of the fall."""
    if step == int(0.11 / dt):
        return velocity.astype(np.float16).astype(float) - velocity
    return np.zeros(3)


def constant(x=0.0, y=0.0):
    return lambda position, velocity, step, dt: dt * np.array([x, y, 0.0])


def jitter(position, velocity, step, dt):
    return np.array([0.0, 0.3 * G * dt * np.random.default_rng(step).uniform(-1.0, 1.0), 0.0])


def noise(position, velocity, step, dt):
    return 1e-6 * np.random.default_rng(step).uniform(-1.0, 1.0, 3)


WRONG_IN_FLIGHT = {
    "none": constant(),
    "gravity tilted by 0.1 degrees": constant(x=G * np.sin(np.radians(0.1))),
    "gravity 5 % too low": constant(y=0.05 * G),
    "half of gravity": constant(y=0.5 * G),
    "gravity 2 % too high": constant(y=-0.02 * G),
    "gravity twice in the first step": lambda position, velocity, step, dt: np.array([0.0, -G * dt * (step == 0), 0.0]),
    "no gravity in the first step": lambda position, velocity, step, dt: np.array([0.0, G * dt * (step == 0), 0.0]),
    "gravity upwards in the first step": lambda position, velocity, step, dt: np.array([0.0, 2.0 * G * dt * (step == 0), 0.0]),
    "steps of varying length": jitter,
    "half precision once": rounded_once,
    "noise": noise,
    "linear drag": lambda position, velocity, step, dt: -0.4 * dt * velocity,
    "quadratic drag": lambda position, velocity, step, dt: -0.2 * dt * np.linalg.norm(velocity) * velocity,
    "wind": constant(x=5.0),
}


def bouncing(dt, wrong):
    """Semi-implicit Euler with an acceleration that is wrong in flight, and the exact restitution in the step after the floor is passed."""
    states = np.tile(BALL.initial_state, (1 + BALL.steps(dt), 1))
    position, velocity = states[0, :3].copy(), np.zeros(3)
    for step in range(len(states) - 1):
        if position[1] <= R and velocity[1] < 0.0:
            velocity = velocity * [1.0, -E, 1.0]
        else:
            velocity = velocity + dt * BALL.acceleration + wrong(position, velocity, step, dt)
        position = position + dt * velocity
        states[step + 1, :3], states[step + 1, 7:10] = position, velocity
    return Trajectory.from_states(dt * np.arange(len(states)), states, 0.5 * dt)


@pytest.mark.extended
@pytest.mark.parametrize("dt", [4e-3, 1e-3, 2.5e-4])
@pytest.mark.parametrize("name", WRONG_IN_FLIGHT)
def test_impact_is_told_from_an_acceleration_that_is_wrong_in_flight(name, dt):
    """Restitution to the velocity of three steps; a gap of the distance fallen in a step; the batch finds the same rows."""
    motion = bouncing(dt, WRONG_IN_FLIGHT[name])
    found, speed = measure(BALL, motion), np.abs(motion.velocity[:, 1]).max()
    assert abs(found["restitution_error"]) <= 3.0 * G * dt / speed
    assert found["contact_gap"] <= speed * dt
    below = int(np.argmax(motion.position[:, 1] <= R))
    case = Comparison(BALL, motion)
    assert below - 1 <= case.first_contact[0] <= below
    assert case.first_contact[1] <= below + 3
    beside = np.array([motion.states[::-1], motion.states])
    last = np.full(2, len(motion) - 1)
    both, _ = motions_side_by_side(Setup.of_starts([BALL]), beside, np.full(2, dt), np.full(2, 0.5 * dt), last, 1e-5)
    assert (both.first_contact[0][1], both.first_contact[1][1]) == case.first_contact
    np.testing.assert_array_equal(both.in_contact[1], case.motions.in_contact)


def test_tilted_gravity_has_the_contacts_of_level_gravity():
    tilted, level = (ds.contacts(BALL, bouncing(1e-3, WRONG_IN_FLIGHT[name])) for name in ("gravity tilted by 0.1 degrees", "none"))
    assert len(tilted) == len(level)
    np.testing.assert_allclose(tilted[["start", "impulse"]], level[["start", "impulse"]], atol=2e-3)
    assert tilted["cone_excess"].max() < 1e-5


@pytest.mark.parametrize("gap", [0.05, 0.5])
@pytest.mark.parametrize("name", ["drop-ball", "drop-box-corner"])
def test_body_that_turns_back_above_the_floor_has_this_gap(name, gap):
    """And its restitution, which is right, is defined."""
    scene, dt = load(name), 1e-3
    exact = truth_for(scene)(dt * np.arange(1 + scene.steps(dt)))
    states = exact.states.copy()
    states[:, 1] += gap
    case = Comparison.with_truth(scene, Trajectory.from_states(exact.t, states), truth_for(scene))
    assert METRICS["contact_gap"].measure(case) == pytest.approx(gap, abs=5.0 * dt)
    assert abs(METRICS["restitution_error"].measure(case)) <= 3.0 * G * dt / 4.0


def spring(stiffness, damping, dt, margin=0.0, later_gain=1.0):
    """A ball on a spring and a damper of 1 kg that begin at a height; `later_gain` multiplies the speed after the second contact."""
    states = np.tile(BALL.initial_state, (1 + BALL.steps(dt), 1))
    height, velocity, was_inside, contacts = states[0, 1], 0.0, False, 0
    for step in range(len(states) - 1):
        depth = R + margin - height
        if was_inside and depth <= 0.0:
            contacts += 1
            velocity *= later_gain if contacts == 2 else 1.0
        was_inside = depth > 0.0
        force = max(0.0, stiffness * depth - damping * velocity) if was_inside else 0.0
        velocity += dt * (force / BALL.body.mass - G)
        height += dt * velocity
        states[step + 1, 1], states[step + 1, 8] = height, velocity
    return Trajectory.from_states(dt * np.arange(len(states)), states, 0.5 * dt)


@pytest.mark.parametrize("margin", [0.005, 0.02])
def test_spring_that_begins_above_the_floor_has_this_gap(margin):
    """To the distance fallen in two steps, and the depth at which the spring carries the ball."""
    stiffness, dt = 2e5, 1e-4
    gap = measure(BALL, spring(stiffness, 40.0, dt, margin))["contact_gap"]
    assert margin - 1.2 * BALL.body.mass * G / stiffness - 9.0 * dt <= gap <= margin


@pytest.mark.parametrize("dt", [2e-3, 2e-4])
@pytest.mark.parametrize(("stiffness", "damping"), [(2e3, 0.0), (2e3, 60.0), (2e4, 30.0), (2e4, 400.0)])
def test_energy_that_a_soft_contact_gives_back_is_not_gained(stiffness, damping, dt):
    """The energy never exceeds that of the start, nor that before any contact, to the error of the integration."""
    motion = spring(stiffness, damping, dt)
    assert measure(BALL, motion)["energy_gain"] < 1e-4


@pytest.mark.parametrize(("stiffness", "damping"), [(2e3, 30.0), (2e4, 100.0), (2e5, 100.0)])
def test_energy_gained_in_a_second_soft_contact_is_measured(stiffness, damping):
    """The speed after it is 10 % too large, which adds 21 % of the kinetic energy, less than the first contact takes."""
    motion, sound = (spring(stiffness, damping, 2e-4, later_gain=gain) for gain in (1.1, 1.0))
    first = int(np.argmax(np.any(motion.states != sound.states, axis=1)))
    gained = 0.21 * 0.5 * sound.velocity[first, 1] ** 2 / (G * H)
    energy = Comparison(BALL, motion).states.energy
    assert energy[first:].max() < 0.9 * energy[0]
    assert 0.7 * gained <= measure(BALL, motion)["energy_gain"] <= 1.02 * gained


@pytest.mark.parametrize("factor", [1.02, 1.3])
def test_energy_gained_in_a_contact_that_lasts_is_measured(factor):
    """A block that rocks never leaves the floor; each landing is rigid and gives back no energy."""
    scene, dt = load("rock-block"), 1e-3
    exact = truth_for(scene)(dt * np.arange(1 + scene.steps(dt)))
    states = exact.states.copy()
    states[exact.t > 0.7, 10:] *= factor
    states[exact.t > 0.7, 7:10] *= factor
    motion = Trajectory.from_states(exact.t, states)
    energy = Comparison(scene, motion).states.energy
    plain = (energy - np.minimum.accumulate(energy)).max() / float(Motions.of(scene, motion).energy_scale)
    assert plain > 1e-3
    assert measure(scene, motion)["energy_gain"] == plain
