"""Runs of scenes with a recording: what is measured, how uncertain it is, and what is caught."""

import datetime
from dataclasses import replace

import numpy as np
import pytest
from support import log_fits

from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.judging.convergence import Convergence, beside_recording
from dropspin.comparisons.judging.error_budget import ErrorBudget
from dropspin.comparisons.logs.continued_tosses import measured_scene
from dropspin.comparisons.measuring.metric import PHASES_OF_TOSS
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.regressions.baseline import Baseline
from dropspin.comparisons.regressions.checking import accept, check
from dropspin.comparisons.running.driving import record_batch, simulate
from dropspin.comparisons.running.run import measure, run
from dropspin.comparisons.running.start_phases import compare, start_phases
from dropspin.comparisons.running.uncertainty import uncertainties
from dropspin.scenarios import Scenario, load, reference_for
from dropspin.scenarios.variations import with_values

DT = 1e-4
"""So small that errors of the time steps are below the uncertainty."""
STEPS = (4e-3, 2e-3, 1e-3)
ERRORS = ("position_error", "orientation_error")


def made(seed: int, count: int, friction: float = 0.2, restitution: float = 0.4, frames: int = 20) -> Scenario:
    """The scene of synthetic tosses of a cube, with the coefficients by which they were made."""
    flights = log_fits.tosses(np.random.default_rng(seed), count, log_fits.WANG, friction, restitution, frames, dt=DT)
    return with_values(measured_scene(flights), "floor", friction=friction, restitution=restitution)


def within(scene: Scenario, label: str) -> list[bool]:
    """Whether each error of an engine is within the uncertainty of the recording."""
    found = engine(label)
    phases = start_phases(scene, reference_for(scene), DT)
    cases = compare([recording.motion for recording in record_batch(found, [phase.scene for phase in phases], DT)], phases)
    reach = uncertainties(found, scene, DT, len(scene.recording.tosses), lambda done: None)
    return [METRICS[name].average(cases).value <= reach[name] for name in ERRORS]


@pytest.mark.extended
def test_engine_that_made_the_tosses_is_within_their_uncertainty_and_with_another_friction_it_is_not():
    scenes = [made(seed, 5) for seed in range(8)]
    inside = np.array([within(scene, log_fits.WANG) for scene in scenes])
    changed = np.array([within(with_values(scene, "floor", friction=0.35), log_fits.WANG) for scene in scenes])
    assert inside.sum() >= 13  # of 16 with a probability of 95 % each
    assert changed.sum() <= 1


@pytest.fixture(scope="module")
def results():
    """Eight tosses by the engine that made them, and by it with a bound on the position."""
    scene = made(1, 8)
    bounded = {"metric": "position_error", "below": 0.008, "reason": "the noise"}
    return run(load(scene.model_dump(exclude={"origin"}) | {"expect": [bounded]}), log_fits.WANG, STEPS)


def test_positions_and_orientations_alone_are_compared_with_the_recording(results):
    table = results.table
    assert set(table.loc[table["kind"] == "truth", "metric"]) == set(ERRORS)
    assert set(table.loc[table["kind"].isin(["truth", "uncertainty"]), "truth"]) == {"measured"}
    assert {"penetration", "contact_gap"} <= set(table.loc[table["kind"] == "invariant", "metric"])
    assert not set(table.loc[table["kind"] == "order", "metric"]) & set(ERRORS)
    assert results.predictions.empty
    uncertain = table[table["kind"] == "uncertainty"]
    assert len(uncertain) == 6
    assert (uncertain["value"] > 0.0).all()


def test_remaining_difference_is_measured_and_no_engine_converges(results):
    table = results.table
    remaining = table[(table["kind"] == "asymptotic_error") & table["metric"].isin(ERRORS)]
    assert set(remaining["verdict"]) == {"measured"}
    assert set(remaining["cause"]) <= {"within uncertainty", "unresolved"}
    assert (remaining["lower"] == 0.0).all()
    [[status]] = [list(of_scene.values()) for of_scene in results.statuses().values()]
    assert status.words == "passed"
    [[plain]] = [list(of.values()) for of in run(made(1, 2), log_fits.WANG, 4e-3).statuses().values()]
    assert plain.words == "not judged (measured)"


def test_bound_within_the_uncertainty_is_not_decided():
    bounded = {"metric": "position_error", "below": 5e-4, "reason": "too tight"}
    found = run(load(made(3, 4).model_dump(exclude={"origin"}) | {"expect": [bounded]}), log_fits.WANG, DT).table
    [row] = found[(found["kind"] == "truth") & (found["metric"] == "position_error")].to_dict("records")
    assert (row["verdict"], row["basis"]) == ("measured", "uncertain_recording")
    assert row["reason"].startswith("not decided by the recording (± ")


@pytest.mark.extended
def test_another_friction_fails_the_bound_and_the_baseline(results):
    """As an engine would whose friction is another one in the next version: the baseline compares equal starts, without uncertainty."""
    [scene] = results.scenes.values()
    other = run(with_values(scene, "floor", friction=0.5), log_fits.WANG, STEPS)
    baseline, _ = accept(results, Baseline(), "as made", datetime.date(2026, 11, 27))
    assert check(results, baseline).results.exit_code() == 0
    little = run(with_values(scene, "floor", friction=0.21), log_fits.WANG, STEPS)
    checked = check(replace(little, scenes=results.scenes), baseline).results
    changed = checked.table[(checked.table["kind"] == "baseline") & (checked.table["verdict"] == "failed")]
    assert set(changed["metric"]) >= {"orientation_error"}
    assert little.exit_code() == 0
    rows = other.table[(other.table["kind"] == "truth") & (other.table["metric"] == "position_error")]
    assert set(rows["verdict"]) == {"failed"}
    assert other.exit_code() == 1


def test_motion_of_ones_own_is_measured_beside_the_first_toss():
    scene = made(5, 2)
    truth, motion = reference_for(scene), simulate(scene, log_fits.WANG, DT)
    found = measure(scene, motion)
    recorded = truth(truth.frames)
    rows = np.rint(truth.frames / DT).astype(int)
    distances = np.linalg.norm(motion.position[rows] - recorded.position, axis=1)
    assert found["position_error"] == pytest.approx(distances.max(), abs=2e-4)  # the frames are up to half a step from a row
    assert "energy_error" not in found
    assert len(start_phases(scene, truth, DT)) == 2 * PHASES_OF_TOSS


@pytest.mark.parametrize(
    ("before", "lower", "upper", "value", "cause"),
    [
        ("model", 0.010, 0.020, 0.015, "model, setting or start"),
        ("model", 0.004, 0.009, 0.004, "within uncertainty"),
        ("model", 0.002, 0.020, 0.015, "unresolved"),
        ("unresolved", 0.0, 0.034, 0.003, "unresolved"),  # the estimate of so few time steps says nothing
        ("unresolved", 0.0, 0.004, 0.003, "within uncertainty"),
    ],
)
def test_interval_of_the_remaining_difference_contains_the_uncertainty(before, lower, upper, value, cause):
    found = beside_recording(Convergence(ErrorBudget(before, "approaches", value, lower, upper, 1.0), 1e-3), 0.005)
    assert found.budget.cause == cause
    assert (found.budget.lower, found.budget.upper) == pytest.approx((max(lower - 0.005, 0.0), upper + 0.005))
    assert np.isnan(found.budget.order)
