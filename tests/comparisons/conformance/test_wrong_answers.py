"""Adapters that answer something else than the protocol has: each check that cannot run fails with what was given and what is expected."""

import pytest
from support import engines as made

import dropspin as ds
from dropspin.comparisons.conformance.checks import conform
from dropspin.comparisons.running.driving import try_record


class ShortState(made.ExactSimulation):
    record = ds.Simulation.record

    def state(self):
        return super().state()[:12]


class ListedState(made.ExactSimulation):
    def state(self):
        return super().state().tolist()


class NamedLag(made.ExactSimulation):
    velocity_lag = "half"


NOT_PREPARED = "prepare() returns None; it must return a dropspin.Simulation"
STATE = "it must return a NumPy array of 13 real numbers, shape (13,)"
WRONG = [
    (lambda scene, dt: None, "turning", NOT_PREPARED),
    (lambda scene, dt: None, "compilation", NOT_PREPARED),
    (ShortState, "turning", f"state() returns an array of float64, shape (12,); {STATE}"),
    (ListedState, "waiting", f"state() returns a list; {STATE}"),
    (NamedLag, "velocity lag", "velocity_lag is 'half'; it is a time in seconds of at most one step, 0.00025 s"),
]


def answering(prepare):
    return type("Answering", (made.Exact,), {"prepare": lambda self, scene, dt: prepare(scene, dt)})()


@pytest.mark.parametrize(("prepare", "check", "message"), WRONG)
def test_wrong_answer_fails_the_check_with_what_is_expected(prepare, check, message):
    found = conform(answering(prepare), ["builds what is meant", check])
    assert [(one.outcome, one.message) for one in found] == [("failed", f"{message} (in the scene tumbling)"), ("failed", message)]


def test_engine_that_prepares_nothing_breaks_down_with_what_is_expected():
    found = try_record(answering(lambda scene, dt: None), ds.load("fall-spin"), 0.01)
    assert (found.verdict, found.reason) == ("crashed", NOT_PREPARED)
