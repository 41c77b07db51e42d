"""Ensembles: the same starts for all engines, means with valid intervals, and a broken member that costs its row."""

from itertools import combinations

import numpy as np
import pytest
from scipy import stats
from support import engines as made

import dropspin as ds
from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.engines.registry import engine
from dropspin.comparisons.results.ensembles import ENSEMBLE_METRICS, EnsembleOutcome
from dropspin.comparisons.results.store import load_results, save
from dropspin.comparisons.running.driving import record_batch
from dropspin.comparisons.running.ensembles import judge_differences, judge_means, run_ensemble
from dropspin.scenarios import load, members

SCENE = load("drop-box-anyhow")
FEW = SCENE.model_copy(update={"ensemble": SCENE.ensemble.model_copy(update={"size": 5}), "expect": (), "duration": 0.6})


def outcome(values):
    """An ensemble in which every quantity is the value given for each member."""
    values = np.asarray(values)
    energy = np.tile(values[:, None], 41)
    return EnsembleOutcome(np.linspace(0, 1, 41), energy, values, values, energy)


class Alone(Engine):
    """An engine without its batches."""

    name = "alone"

    def __init__(self, name):
        object.__setattr__(self, "options", {})
        object.__setattr__(self, "_engine", engine(name))

    def prepare(self, scene, dt):
        return self._engine.prepare(scene, dt)


@pytest.mark.parametrize("name", ["wang", "wang[contact=sequential,law=coulomb]", "mujoco", "mujoco[profile=default]"])
def test_batch_equals_single_runs_bit_for_bit(name):
    drawn = members(FEW)
    together, alone = (record_batch(chosen, drawn, 1e-3) for chosen in (engine(name), Alone(name)))
    for one, other in zip(together, alone, strict=True):
        np.testing.assert_array_equal(one.motion.states, other.motion.states)


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", ["wang", "wang[rotation=exact]", "mujoco", "mujoco[profile=default]"])
def test_timed_batch_ends_where_single_runs_end(name):
    """Each member of a batch ends where it ends alone; MuJoCo restarts its solver cold after a stop."""
    drawn, chosen = members(FEW), engine(name)
    together = chosen.prepare_batch(drawn, 1e-3)
    together.advance(400)
    together.advance(200)
    alone = [recording.motion.states[-1] for recording in record_batch(Alone(name), drawn, 1e-3)]
    np.testing.assert_allclose(together.states(), alone, rtol=0, atol=0.0 if name.startswith("wang") else 1e-6)


def test_ball_bounces_alike_from_every_orientation():
    """Energy e^2k after k bounces, rebound e² H, and no spread."""
    ball = load("drop-ball").model_dump(exclude_none=True, exclude={"expect", "origin"}) | {"ensemble": {"size": 4, "seed": 1}}
    found = run_ensemble(engine("wang"), load(ball), 1e-4)
    assert np.ptp(found.energy, axis=0).max() <= 1e-16
    at = np.searchsorted(found.t, 0.6)
    assert found.energy[0, at] == pytest.approx(0.25, abs=1e-3)
    assert found.rebound[0] == pytest.approx((0.1 + 0.25) / 1.1, abs=2e-4)
    assert found.rest_time[0] == pytest.approx(1.355262, abs=0.01)


def test_interval_covers_the_mean():
    """Means of 20 draws from a skew distribution: between 90 and 97 % of a thousand intervals hold its mean (measured 92 %)."""
    draws = np.random.default_rng(1).exponential(size=(1000, 20))
    covered = 0
    for values in draws:
        _, mean = next(judge_means(SCENE, 1e-3, outcome(values)))
        covered += mean.lower <= 1.0 <= mean.upper
    assert 900 <= covered <= 970


def test_differences_are_taken_start_by_start():
    """A difference of 0.01 in every member is significant beside a spread of 1; independent members show none."""
    random = np.random.default_rng(2)
    values = random.normal(size=50)
    shifted = judge_differences(outcome(values + 0.01 + 1e-4 * random.normal(size=50)), outcome(values))
    assert all("the difference is significant" in one.reason for _, one in shifted)
    other = judge_differences(outcome(values), outcome(random.normal(size=50)))
    assert all("the difference is not significant" in one.reason for _, one in other)
    expected = stats.ttest_rel(values, values * 1.1).confidence_interval(1.0 - 0.05 / len(ENSEMBLE_METRICS))
    _, found = next(judge_differences(outcome(values), outcome(values * 1.1)))
    assert (found.lower, found.upper) == pytest.approx((expected.low, expected.high), rel=1e-12)


def test_engines_without_a_difference_rarely_differ():
    """At least one difference of three engines is significant in 1 to 7 % of 400 ensembles: in 4 %, or 41 % if each were judged alone."""
    random, wrong = np.random.default_rng(3), 0
    for _ in range(400):
        drawn = random.normal(size=(3, 50, 43))
        outcomes = [EnsembleOutcome(np.arange(41.0), each[:, :41], each[:, 41], each[:, 42], each[:, :41]) for each in drawn]
        judged = [one for pair in combinations(outcomes, 2) for _, one in judge_differences(*pair, pairs=3)]
        wrong += any("the difference is significant" in one.reason for one in judged)
    assert 4 <= wrong <= 28


def test_run_and_its_folder_keep_the_ensemble(tmp_path):
    """There are rows for each engine and each pair, and the outcome of each member is loaded unchanged."""
    found = ds.run(FEW, ["wang", "pybullet"], [4e-3])
    rows = found.table[found.table["kind"] == "ensemble"]
    assert list(rows["metric"]) == 2 * list(ENSEMBLE_METRICS)
    assert (rows["cause"] == "chaotic").all()
    assert ((rows["lower"] <= rows["value"]) & (rows["value"] <= rows["upper"])).all()
    pairs = found.agreements[found.agreements["metric"].isin(list(ENSEMBLE_METRICS))]
    assert len(pairs) == len(ENSEMBLE_METRICS)
    save(found, tmp_path)
    again = load_results(tmp_path)
    assert again.ensembles.keys() == found.ensembles.keys()
    for key, kept in found.ensembles.items():
        for name in ("t", "energy", "rebound", "rest_time", "angular_momentum"):
            np.testing.assert_array_equal(getattr(again.ensembles[key], name), getattr(kept, name))


def test_member_that_is_not_finite_costs_the_engines_row():
    """The engine diverged; the other engine's ensemble is complete."""

    def failing(motions):
        motions[-1, 70:] = np.nan
        return motions

    found = ds.run(FEW, [made.in_batches("fails", failing, made.Exact), "wang"], [4e-3])
    [row] = found.table[found.table["engine"] == "fails"].to_dict("records")
    assert row["verdict"] == "diverged"
    assert "a start of the ensemble is not finite at t = 0.28 s" in row["reason"]
    assert len(found.table[(found.table["engine"] == "wang") & (found.table["kind"] == "ensemble")]) == 4


def test_ensemble_without_contact_has_no_rebound():
    """No start reaches the floor in time, and no difference is significant."""
    short = FEW.model_copy(update={"duration": 0.2})
    found = ds.run(short, ["wang", "pybullet"], [4e-3])
    means, differences = (rows[rows["metric"] == "rebound_height"] for rows in (found.table, found.agreements))
    assert list(means["value"]) == [0.0, 0.0]
    assert list(differences["value"]) == [0.0]
    assert differences["reason"].str.contains("is not significant").all()


def test_members_must_start_where_they_were_placed():
    """An engine that returns one motion for all members is refused."""
    copies = made.in_batches("copies", lambda motions: np.repeat(motions[:1], len(motions), axis=0))
    found = ds.run(FEW, [copies], [4e-3]).table
    assert list(found["verdict"]) == ["crashed"]
    assert "at the start" in found["reason"].iloc[0]


def test_batch_of_wrong_shape_costs_the_engines_row():
    """The message says what was returned and what was asked for."""
    found = ds.run(FEW, [made.in_batches("short", lambda motions: motions[..., :12])], [4e-3]).table
    assert list(found["verdict"]) == ["crashed"]
    assert "states of 13 numbers were asked for" in found["reason"].iloc[0]
