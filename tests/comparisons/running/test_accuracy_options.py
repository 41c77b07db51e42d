"""Engines whose accuracy is not set by the time step alone raise no alarm, and their faults do."""

import math
from typing import ClassVar

import pytest
from support.accuracy_options import Adaptive, InnerStep, Substeps
from support.sampled import Sampled

from dropspin.comparisons.conformance.checks import conform
from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.engines.options import NumericOption
from dropspin.comparisons.engines.wang import Wang
from dropspin.comparisons.running.run import run
from dropspin.scenarios import load
from dropspin.scenarios.errors import DropspinError, UnknownName

SOUND = (Adaptive, InnerStep, Substeps)
SPIN = load(
    {
        "name": "fast-spin",
        "duration": 0.4,
        "body": {"shape": "box", "half_extents": [0.1, 0.15, 0.25], "mass": 1.0},
        "start": {"angular_velocity": [0.0, 40.0, 0.0]},
    }
)


def failures(table):
    return table[table["verdict"].isin(["failed", "crashed", "diverged", "timed_out"])]


@pytest.mark.extended
@pytest.mark.parametrize("engine", SOUND)
def test_sound_engine_raises_no_alarm(engine):
    table = run(["drop-ball", SPIN], engine()).table
    assert failures(table).empty


@pytest.mark.extended
@pytest.mark.parametrize(
    ("engine", "starts"), [(Adaptive, "few_start_phases"), *((one, "all_start_phases") for one in (InnerStep, Substeps))]
)
def test_restitution_fault_is_detected_in_an_engine_with_an_accuracy_option(engine, starts, request):
    """The adaptive integrator is as exact from each start."""
    request.getfixturevalue(starts)
    faulty = type("Faulty", (engine,), {"restitution_factor": 1.01})()
    found = failures(run("drop-ball", faulty).table)
    assert "asymptotic_error" in set(found["kind"])


def test_cause_is_the_accuracy_option():
    """With an inner step of a fixed length the error does not change with the time step; it falls with the inner step."""
    table = run("fall-spin", InnerStep()).table
    [row] = table[(table["kind"] == "asymptotic_error") & (table["metric"] == "position_error")].to_dict("records")
    assert (row["cause"], row["verdict"]) == ("inner_step", "passed")
    steps = "0.00416667, 0.00208333, 0.00104167, with dt = 0.004, 0.002, 0.001 s"
    assert row["reason"] == f"falls with finer inner_step; up to 0.0049 may remain ({steps})"
    assert row["lower"] <= 0.0 <= row["upper"]


class Planted(Engine):
    """The exact motion beside an error of the position that is known: a function of the time step and of the option, over 1 m."""

    name = "planted"
    numbers: ClassVar = {"tol": NumericOption(1e-3, 0.0, 1.0)}
    levels = (1e-3, 1e-4, 1e-5, 1e-6)

    @property
    def accuracy(self):
        return {"tol": self.levels}

    def error(self, dt, tol):
        return 0.05 + 2.0 * dt

    def prepare(self, scene, dt):
        error = self.error(dt, float(self.option("tol")))

        def distorted(rows, times, dt, truth):
            rows[:, 0] += error * times / scene.duration
            return rows

        return Sampled(scene, dt, scene, distorted)


class OfOption(Planted):
    def error(self, dt, tol):
        return 20.0 * tol + 2.0 * dt


class OfThree(Planted):
    levels = (1e-3, 1e-5, 1e-7)


class Kinked(OfThree):
    def error(self, dt, tol):
        return 500.0 * dt**2 if dt < 5e-3 else 0.012


class FinestByDefault(OfThree):
    """The coarser values of the option make an error that falls as steeply as none of the time step does."""

    numbers: ClassVar = {"tol": NumericOption(1e-7, 0.0, 1.0)}

    def error(self, dt, tol):
        return 0.0043 + 20.0 * tol + 0.5 * dt


class LittleOfOption(OfThree):
    """The engine's own value is between the others; the finest takes little of the error away."""

    numbers: ClassVar = {"tol": NumericOption(1e-5, 0.0, 1.0)}

    def error(self, dt, tol):
        return 0.05 + 20.0 * tol + 0.5 * dt


class HalfOfOption(Planted):
    """The finest value takes half of the error away; what remains with still finer ones is not known."""

    def error(self, dt, tol):
        return 0.025 * (1.0 + math.log10(tol / 1e-6) / 3.0) + 2.0 * dt


class BreaksDown(Planted):
    def error(self, dt, tol):
        return super().error(dt, tol) / float(tol > 2e-6)


FIVE, FOUR = (0.016, 0.008, 0.004, 0.002, 0.001), (0.004, 0.003, 0.002, 0.001)


@pytest.mark.parametrize(
    ("engine", "dts", "cause"),
    [
        (OfOption, FIVE, "tol"),
        (Planted, FIVE, "model"),
        (OfThree, FOUR, "model"),  # the three finest steps span a factor of 3, too little to extrapolate with finer options
        (BreaksDown, FIVE, "model"),
        (FinestByDefault, FIVE, "model"),
        (LittleOfOption, FIVE, "model"),
        (HalfOfOption, FIVE, "unresolved"),
        (Kinked, FIVE, "unresolved"),  # the finest steps alone would give an error that vanishes
    ],
)
def test_option_that_changes_nothing_is_no_cause(engine, dts, cause):
    table = run("fall-spin", engine(), dts).table
    [row] = table[(table["kind"] == "asymptotic_error") & (table["metric"] == "position_error")].to_dict("records")
    assert row["cause"] == cause
    assert (row["verdict"] == "failed") == (cause == "model")


def test_refinement_too_coarse_to_be_compared_leaves_the_cause_open():
    """At inner steps of 4 ms and 500 rad/s the attitude saturates."""
    table = run("spin-principal-500", InnerStep()).table
    [row] = table[(table["kind"] == "asymptotic_error") & (table["metric"] == "orientation_error")].to_dict("records")
    assert (row["cause"], row["verdict"]) == ("unresolved", "measured")


def test_options_are_refined_together_with_the_finest_time_steps():
    path = Adaptive().refined([1e-3, 8e-3, 4e-3, 2e-3])
    assert [(dt, engine.option("rtol")) for dt, engine in path] == [(4e-3, "0.0001"), (2e-3, "1e-06"), (1e-3, "1e-08")]


@pytest.mark.parametrize(("accuracy", "error", "text"), [
    ({"rtl": (1e-4, 1e-6, 1e-8)}, UnknownName, "rtl"),
    ({"rtol": (1e-4, 1e-8)}, DropspinError, "give at least 3 values, coarsest first"),
])  # fmt: skip
def test_accuracy_is_checked(accuracy, error, text):
    engine = type("Wrong", (Adaptive,), {"numbers": {"rtol": NumericOption(1e-6, 1e-12, 1e-2)}, "accuracy": accuracy})
    with pytest.raises(error, match=text):
        engine()


def test_substeps_conform_with_the_lag_of_a_substep():
    """Half of a sub-step of an eighth; without it the check says what to set."""
    [result] = conform(Substeps(), ["velocity lag"])
    assert result.outcome == "passed"

    class Unstated(Substeps):
        def prepare(self, scene, dt):
            simulation = super().prepare(scene, dt)
            simulation.velocity_lag = 0.0
            return simulation

    [result] = conform(Unstated(), ["velocity lag"])
    assert result.outcome == "failed"
    assert result.message.endswith("set self.velocity_lag = 0.5 * dt / 8")


@pytest.mark.parametrize("lag", [True, "half", math.nan, 1.0])
def test_lag_that_is_no_time_of_at_most_a_step_is_refused(lag):
    class Wrong(Wang):
        name = "wrong"

        def prepare(self, scene, dt):
            simulation = super().prepare(scene, dt)
            simulation.velocity_lag = lag
            return simulation

    [row] = run("spin-principal", Wrong(), 1e-3).table.to_dict("records")
    assert row["verdict"] == "crashed"
    assert "it is a time in seconds of at most one step, 0.001 s" in row["reason"]
