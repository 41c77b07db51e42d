"""What `conform` says of motions that no known fault explains: what differs and by how much, and nothing that is right."""

import numpy as np
import pytest
from support import engines as made
from support.bouncing import Bouncing, coulomb, pyramid, with_restitution
from support.fault_suite import FAULTS
from support.students import Solver, student

from dropspin.comparisons.conformance.checks import run_check
from dropspin.comparisons.conformance.probes import PROBES
from dropspin.comparisons.running.inputs import EngineEntry
from dropspin.scenarios import truth_for

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
