"""What `conform` says of motions that no known fault explains: what differs and by how much, and nothing that is right."""

from dataclasses import replace

import numpy as np
import pytest
from support import engines as made
from support.bouncing import Bouncing, bounced, coulomb, pyramid, with_restitution
from support.fault_suite import FAULTS, fault, with_damping
from support.sampled import Sampled
from support.students import Solver, student

from dropspin.comparisons.conformance.checks import run_check
from dropspin.comparisons.conformance.impacts import explain_impact
from dropspin.comparisons.conformance.probes import DT, PROBES
from dropspin.comparisons.conformance.symptoms import symptoms
from dropspin.comparisons.conformance.timing import NO_LAG
from dropspin.comparisons.faults.mistakes import Mistake
from dropspin.comparisons.running.arguments import EngineEntry
from dropspin.scenarios import Trajectory, truth_for
from dropspin.scenarios.rotations import cross, rotate, unrotate
from dropspin.scenarios.state import POSITION, VELOCITY
from dropspin.scenarios.truths import exact_solution
from dropspin.scenarios.variations import with_values

BALLS = tuple(probe.name for probe in PROBES if probe.name.endswith(" ball") or probe.name.endswith(" floor"))
SQUARED = "restitution appears to be squared; an engine that multiplies the values of two bodies needs 1 for the floor"


def failed(engine, *checks):
    """The message of each check that fails."""
    found = [run_check(EngineEntry(engine.label, engine), check) for check in checks or BALLS]
    return {one.check: one.message for one in found if one.outcome == "failed"}


def test_ball_by_the_law_of_the_exact_solution_passes():
    """The planted laws below differ from this one alone."""
    engine = Bouncing(title="exact ball")
    assert failed(engine) == {}
    assert not any(engine.declines(probe.scene) for probe in PROBES if probe.name in BALLS)


@pytest.mark.extended
@pytest.mark.parametrize(
    ("law", "check", "message"),
    [
        (
            pyramid,
            "slippery floor",
            "the ratio of the friction impulse to the normal impulse is 0.17 instead of 0.12 (41 % too high); "
            "friction acts 14° from its exact direction; position is off by ",
        ),
        (
            lambda *impact: coulomb(*impact, factor=0.9),
            "slippery floor",
            "the ratio of the friction impulse to the normal impulse is 0.108 instead of 0.12 (10 % too low); position is off by ",
        ),
        (with_restitution(lambda e, speed: min(1.0, 1.01 * e)), "bouncing ball", "restitution is 0.606 instead of 0.6 (1 % too high); pos"),
        (with_restitution(lambda e, speed: e / (1.0 + 0.1 * speed)), "lively ball", "restitution is 0.83 instead of 1 (17 % too low); pos"),
        (
            with_restitution(lambda e, speed: e / (1.0 + 0.1 * speed)),
            "dull ball",
            "restitution is 0.249 instead of 0.3 (17 % too low); pos",
        ),
    ],
    ids=["pyramid", "friction 0.9", "restitution 1.01", "restitution by speed, lively", "restitution by speed, dull"],
)
def test_symptom_states_what_is_wrong_and_by_how_much(law, check, message):
    found = failed(Bouncing(title="planted", law=law), check)
    assert found[check].startswith(message)


@pytest.mark.extended
def test_errors_are_stated_only_where_they_exceed_what_is_allowed():
    found = failed(Bouncing(title="planted", law=with_restitution(lambda e, speed: min(1.0, 1.01 * e))), "bouncing ball")["bouncing ball"]
    assert "position is off by 0.0025 m (allowed: 0.0008 m); velocity is off by 0.0123 m/s (allowed: 0.007 m/s)" in found
    assert "attitude" not in found
    assert "height" not in found


def test_fault_that_another_probe_excludes_is_not_named():
    """A dull ball that rebounds with e² has stopped at both times of comparison, as one that does not rebound has; the others rebound."""
    found = failed(Bouncing(title="squared", law=with_restitution(lambda e, speed: e * e)))
    assert set(found) == set(BALLS) - {"lively ball"}
    assert set(found.values()) == {SQUARED}


@pytest.mark.extended
def test_ball_whose_rebounds_end_early_is_not_said_to_sleep():
    [message] = failed(Bouncing(title="dead", law=with_restitution(lambda e, speed: e if speed > 1.0 else 0.0)), "dull ball").values()
    assert "sleep" not in message
    assert "restitution is 0" not in message


class Quick(Bouncing):
    """Each step is four times as long as asked for."""

    def prepare(self, scene, dt):
        moved = (lambda rows, times, dt, truth: truth(4.0 * times).states) if scene.floor is None else None
        return Sampled(scene, dt, scene, moved or (lambda rows, times, dt, truth: bounced(scene, coulomb, 4.0 * times)))


def test_pair_of_faults_that_most_probes_contradict_is_not_named():
    """With steps that are too long a dull ball is at rest at both times of comparison, as with many pairs of faults."""
    assert failed(Quick(title="quick"), "dull ball")["dull ball"].startswith("position is off by 0.081 m")


@pytest.mark.extended
def test_restitution_of_the_opposite_sign_is_not_too_high():
    """A turn the wrong way in the first impact drives the corner into the floor."""

    def reversed_turn(self):
        before = self.w
        Solver.collide(self)
        self.w = 2.0 * before - self.w

    assert "restitution is -3 instead of 0.6 (of the opposite sign)" in failed(student(collide=reversed_turn), "corner")["corner"]


def test_height_of_the_first_contact_is_stated_only_if_it_is_wrong():
    """A floor 5 mm too high."""
    ball = next(probe for probe in PROBES if probe.name == "bouncing ball")

    class High(made.Exact):
        name = "high"

        def prepare(self, scene, dt):
            lower = scene.initial_state - 0.005 * np.eye(13)[1]
            simulation = made.ExactSimulation(scene.starting_at(lower), dt, lambda row, time: row + 0.005 * np.eye(13)[1])
            simulation._start = scene.initial_state
            return simulation

    [message] = failed(High(), "bouncing ball").values()
    assert message.startswith("the first contact begins at a height of 0.105")
    assert " instead of 0.1" in message
    assert "restitution" not in message
    assert truth_for(ball.scene).events[0].before[1] == pytest.approx(0.1)


@pytest.mark.extended
@pytest.mark.parametrize(
    ("title", "check", "message"),
    [
        (
            "gravity acts twice in the first time step",
            "time",
            "velocity and position of a fall run ahead by 1 step: gravity acts in more steps than",
        ),
        ("positions reported one time step late", "time", "position is 1 step late: it does not belong to the time of its row"),
        ("velocities reported one time step late", "time", "velocity is 1 step late: it does not belong to the time of its row"),
        ("time steps that vary at random by up to 20 %", "time", "rows are not uniform in time"),
        (
            "state rounded once to half precision, after 0.1 s",
            "velocity lag",
            "gravity, the time step or the precision of the state is wrong",
        ),
        ("time runs 0.1 % too fast", "velocity lag", "gravity, the time step or the precision of the state is wrong"),
        (
            "additional angular damping about one axis of the body",
            "turning",
            "damping or a clamp that the scene does not have: the final angular velocity is ",
        ),
        ("restitution of balls that decreases with the impact speed", "lively ball", "restitution is 0.9606 instead of 1 (3.9 % too low)"),
        (
            "friction on balls doubled in the first impact",
            "slippery floor",
            "the ratio of the friction impulse to the normal impulse is 0.24 instead of",
        ),
        (
            "friction pyramid instead of the friction cone in impacts of balls",
            "slippery floor",
            "friction acts 14° from its exact direction",
        ),
        (
            "impulse at another vertex than the one that strikes",
            "corner",
            "an impulse at the contact point does not explain the change of the velocities in the first contact",
        ),
        ("initial velocity 1 mm/s larger in each further simulation", "repeats", "keeps state between simulations"),
    ],
)
def test_fault_of_a_step_or_an_impact_is_named(title, check, message):
    [fault] = [one for one in FAULTS if one.title == title]
    assert message in failed(fault, check)[check]


def rotating(factors=(1.0, 1.0, 1.0), decay=lambda speed: 0.0):
    """The first symptom of a body whose gyroscopic term has a factor about each axis, and whose angular velocity decays by the speed."""

    def acceleration(q, w, inertia):
        spin = unrotate(q, w)
        return rotate(q, np.array(factors) * np.linalg.solve(inertia, cross(inertia @ spin, spin))) - decay(np.linalg.norm(w)) * w

    [probe] = [one for one in PROBES if one.name == "tumbling"]
    times = DT * np.arange(1 + probe.rows[1])
    return next(symptoms(probe, Trajectory.from_states(times, Mistake("planted", acceleration).motion(probe.scene, times))))


def test_acceleration_of_a_fall_is_stated():
    """9.8 instead of 9.81: 1e-3 too low; positions without the velocities that belong to them show none."""
    [probe] = [one for one in PROBES if one.name == "falling straight"]
    times = DT * np.arange(1 + probe.rows[1])
    slower = exact_solution(with_values(probe.scene, "gravity", acceleration=(0.0, -7.0 * 9.8 / 9.81, 0.0)))(times)
    first, *_ = symptoms(probe, slower)
    assert first == "the acceleration is 6.9929 m/s² instead of 7 (0.1 % too low)"
    first, *_ = symptoms(probe, replace(exact_solution(probe.scene)(times), velocity=slower.velocity))
    assert first.startswith("velocity is off by 0.0")


DAMPED = "damping or a clamp that the scene does not have: the final angular momentum is "


@pytest.mark.parametrize(
    ("planted", "message"),
    [
        (
            {"factors": (1.0, 0.5, 1.0)},
            "damping, a clamp or a wrong gyroscopic term: the final angular momentum is 0.393 kg m²/s instead of ",
        ),
        ({"factors": (1.0, -1.0, 1.0)}, "the final angular momentum is 1.2 kg m²/s instead of 0.450444 (170 % too high)"),
        ({"factors": (0.5, 0.7, 1.0)}, "the final angular momentum is 0.438 kg m²/s instead of 0.450444 (2.8 % too low)"),
        ({"factors": (0.5, 0.5, 0.5)}, "attitude is off by 0.53 rad"),
        ({"decay": lambda speed: 0.5}, f"{DAMPED}0.351 kg m²/s instead of 0.450444 (22 % too low)"),
        ({"decay": lambda speed: 0.02}, f"{DAMPED}0.44596 kg m²/s instead of 0.450444 (1 % too low)"),
        ({"decay": lambda speed: 50.0 * max(speed - 6.0, 0.0)}, f"{DAMPED}0.40"),
    ],
    ids=["gyroscopic term halved", "reversed", "energy gained", "halved about all axes", "damping", "weak damping", "clamp at 6 rad/s"],
)
def test_damping_is_named_only_where_angular_momentum_is_lost_without_turning(planted, message):
    """The angular speed of a body with unequal moments varies, and a wrong gyroscopic term about one axis changes the energy too."""
    assert rotating(**planted).startswith(message)


def test_ball_that_a_floor_supports_from_the_first_step_on_has_no_wrong_restitution():
    """A floor 1 mm too high: the approach speed in the first step is g dt, and the square of it nothing."""
    [probe] = [one for one in PROBES if one.name == "slow ball"]
    times = DT * np.arange(1 + probe.rows[1])
    motion = Trajectory.from_states(times, np.tile(probe.scene.initial_state, (len(times), 1)))
    assert explain_impact(probe.scene, motion) is None
    assert next(symptoms(probe, motion)) == "the body does not fall: gravity is missing, or the floor supports it from the first step on"


def test_body_that_is_held_above_the_floor_has_not_passed_it():
    """An engine that takes every speed of a step for rest lets it creep."""
    [probe] = [one for one in PROBES if one.name == "bouncing ball"]
    steps = np.arange(1 + probe.rows[1])
    rows = np.tile(probe.scene.initial_state, (len(steps), 1))
    rows[:, 1] += steps * DT**2 * probe.scene.acceleration[1]
    found = list(symptoms(probe, Trajectory.from_states(DT * steps, rows)))
    assert found[0] == "the body stays above the floor: the engine puts it to sleep or holds it, or gravity is too weak"


def test_body_that_is_put_to_sleep_in_the_air_has_no_first_contact():
    """After five steps, in which it has gained no more than the speed below which the engine takes it for one at rest."""
    [probe] = [one for one in PROBES if one.name == "bouncing ball"]
    steps = np.minimum(np.arange(1 + probe.rows[1]), 5)
    rows = np.tile(probe.scene.initial_state, (len(steps), 1))
    rows[:, 1] += (steps * DT) ** 2 / 2.0 * probe.scene.acceleration[1]
    rows[:5, 8] = steps[:5] * DT * probe.scene.acceleration[1]
    found = list(symptoms(probe, Trajectory.from_states(DT * np.arange(len(rows)), rows)))
    assert found[0] == "the body stops 0.3 m above the floor: the engine puts it to sleep, or holds it"
    assert not any("contact" in text or "restitution" in text for text in found)


def test_restitution_that_is_right_is_not_wrong_by_the_phase_of_the_impact():
    """Semi-implicit Euler with damping, and an impulse of exactly e times the speed."""
    [probe] = [one for one in PROBES if one.name == "lively ball"]
    rows = [probe.scene.initial_state]
    for _ in range(probe.rows[1]):
        row = rows[-1].copy()
        row[VELOCITY] = (row[VELOCITY] + DT * probe.scene.acceleration) * (1.0 - 0.04 * DT)
        if row[1] <= probe.scene.body.radius and row[8] < 0.0:
            row[8] *= -probe.scene.floor.restitution
        row[POSITION] += DT * row[VELOCITY]
        rows.append(row)
    found = list(symptoms(probe, Trajectory.from_states(DT * np.arange(len(rows)), np.array(rows))))
    assert found
    assert not any("restitution" in symptom for symptom in found)


@pytest.mark.sample(1)
@pytest.mark.parametrize("number", [1, 8], ids=["position", "velocity"])
def test_constant_error_of_a_state_is_not_one_of_time(number):
    """In the first row too; `builds what is meant` states it."""

    class Offset(made.ExactSimulation):
        def _states(self, steps):
            return super()._states(steps) - 0.05 * np.eye(13)[number]

    engine = type("Shifted", (made.Exact,), {"prepare": lambda self, scene, dt: Offset(scene, dt)})()
    assert failed(engine, "time") == {}
    assert " at the start is " in failed(engine, "builds what is meant")["builds what is meant"]


def test_damping_is_among_the_causes_of_a_wrong_time():
    found = failed(fault("damped", change=with_damping(linear=0.5)), "time", "velocity lag")
    assert found["time"].startswith("a free ball slows down, as with damping, or rows are not uniform in time: ")
    assert found["velocity lag"].endswith("or the fall is damped")


def test_lag_that_drifts_has_no_number():
    """Steps of at most 5 ms: displacements are half of those that velocity gives."""
    engine = type("Short", (made.Exact,), {"prepare": lambda self, scene, dt: made.ExactSimulation(scene, min(dt, 0.005))})()
    assert failed(engine, "velocity lag") == {"velocity lag": NO_LAG}
