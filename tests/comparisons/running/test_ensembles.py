"""Ensembles through engines: the same starts for all, means with honest intervals, and a bad member that costs its row."""

import numpy as np
import pytest
from scipy import stats
from support import engines as made

import comparisons
from comparisons.engines.base import Engine
from comparisons.engines.registry import engine
from comparisons.results.store import restore, save
from comparisons.running.ensembles import ENSEMBLE_METRICS, Outcome, difference_rows, ensemble_rows, outcome_of
from scenarios import load, members

SCENE = load("drop-box-anyhow")
FEW = SCENE.model_copy(update={"ensemble": SCENE.ensemble.model_copy(update={"size": 5}), "expect": (), "duration": 0.6})


def outcome(values):
    """An ensemble of which every figure is the value given for each member."""
    return Outcome(np.linspace(0, 1, 41), np.tile(np.asarray(values)[:, None], 41), np.asarray(values), np.asarray(values))


def test_side_by_side_is_one_by_one():
    """What the reference implementation does with all members at once is what it does with each, bit for bit."""
    drawn, document = members(FEW), engine("document")
    np.testing.assert_array_equal(document.record_ensemble(drawn, 1e-3, 600), Engine.record_ensemble(document, drawn, 1e-3, 600))


@pytest.mark.parametrize("name", ["document", "document[rotation=exact]", "mujoco", "mujoco[profile=default]"])
def test_what_is_timed_of_an_ensemble_is_its_motion(name):
    """Each of many that an engine takes side by side ends where it ends alone; MuJoCo sets out with a cold solver after a stop."""
    drawn, chosen = members(FEW), engine(name)
    together = chosen.prepare_batch(drawn, 1e-3)
    together.advance(400)
    together.advance(200)
    alone = Engine.record_ensemble(chosen, drawn, 1e-3, 600)[:, -1]
    np.testing.assert_allclose(together.states(), alone, rtol=0, atol=0.0 if name.startswith("document") else 1e-6)


def test_a_ball_s_ensemble_is_its_one_motion():
    """Whatever way a ball is turned it bounces alike: energy e^2k after k bounces, rebound e² H, and no spread."""
    ball = load("drop-ball").model_dump(exclude_none=True, exclude={"expect", "origin"}) | {"ensemble": {"size": 4, "seed": 1}}
    found = outcome_of(engine("document"), load(ball), 1e-4)
    assert np.ptp(found.energy, axis=0).max() <= 1e-16
    at = np.searchsorted(found.t, 0.6)
    assert found.energy[0, at] == pytest.approx(0.25, abs=1e-3)
    assert found.rebound[0] == pytest.approx((0.1 + 0.25) / 1.1, abs=2e-4)
    assert found.rest_time[0] == pytest.approx(1.355262, abs=0.01)


def test_the_interval_holds_the_mean_in_95_of_100_draws():
    """Means of 20 draws from a skew distribution: between 90 and 97 % of a thousand intervals hold its mean (measured 92 %)."""
    draws = np.random.default_rng(1).exponential(size=(1000, 20))
    held = 0
    for values in draws:
        row = ensemble_rows(SCENE, "made", 1e-3, outcome(values))[0]
        held += row["lower"] <= 1.0 <= row["upper"]
    assert 900 <= held <= 970


def test_differences_are_taken_start_by_start():
    """A difference of 0.01 in every member stands out from a spread of 1; independent members show none."""
    random = np.random.default_rng(2)
    values = random.normal(size=50)
    shifted = difference_rows(SCENE, 1e-3, ("a", "b"), (outcome(values + 0.01 + 1e-4 * random.normal(size=50)), outcome(values)))
    assert all("more than chance" in row["reason"] for row in shifted)
    other = difference_rows(SCENE, 1e-3, ("a", "b"), (outcome(values), outcome(random.normal(size=50))))
    assert all("cannot be told" in row["reason"] for row in other)
    expected = stats.ttest_rel(values, values * 1.1).confidence_interval()
    row = difference_rows(SCENE, 1e-3, ("a", "b"), (outcome(values), outcome(values * 1.1)))[0]
    assert (row["lower"], row["upper"]) == pytest.approx((expected.low, expected.high), rel=1e-12)


def test_a_run_holds_it_and_its_folder_too(tmp_path):
    """Rows of each engine and each pair, and what became of each member, as it was."""
    found = comparisons.run([FEW], ["document", "pybullet"], [4e-3])
    rows = found.table[found.table["kind"] == "ensemble"]
    assert list(rows["metric"]) == 2 * list(ENSEMBLE_METRICS)
    assert (rows["cause"] == "chaotic").all()
    assert ((rows["lower"] <= rows["value"]) & (rows["value"] <= rows["upper"])).all()
    pairs = found.table[(found.table["kind"] == "agreement") & found.table["metric"].isin(list(ENSEMBLE_METRICS))]
    assert len(pairs) == len(ENSEMBLE_METRICS)
    save(found, tmp_path)
    again = restore(tmp_path)
    assert again.ensembles.keys() == found.ensembles.keys()
    for key, kept in found.ensembles.items():
        for name in ("t", "energy", "rebound", "rest_time"):
            np.testing.assert_array_equal(getattr(again.ensembles[key], name), getattr(kept, name))


def test_a_member_that_is_not_finite_costs_its_row():
    """The engine's ensemble is told to diverge; the other engine's is whole."""

    class Fails(made.Exact):
        name = "fails"

        def record_ensemble(self, drawn, dt, steps):
            rows = engine("document").record_ensemble(drawn, dt, steps)
            rows[-1, 70:] = np.nan
            return rows

    found = comparisons.run([FEW], [Fails(), "document"], [4e-3])
    [row] = found.table[found.table["engine"] == "fails"].to_dict("records")
    assert row["verdict"] == "diverged"
    assert "a start of the ensemble is not finite at t = 0.28 s" in row["reason"]
    assert len(found.table[(found.table["engine"] == "document") & (found.table["kind"] == "ensemble")]) == 4


def test_an_ensemble_that_touches_nothing():
    """No start comes to the floor in time: nothing rebounds, and nothing differs by more than chance."""
    short = FEW.model_copy(update={"duration": 0.2})
    found = comparisons.run([short], ["document", "pybullet"], [4e-3]).table
    rebounds = found[(found["metric"] == "rebound_height")]
    assert (rebounds["value"] == 0.0).all()
    assert not rebounds["reason"].str.contains("differ by more").any()


def test_members_must_start_where_they_were_put():
    """An engine that gives one motion for all of them has not run them."""

    class Copies(made.Exact):
        name = "copies"

        def record_ensemble(self, drawn, dt, steps):
            one = engine("document").record_ensemble(drawn[:1], dt, steps)
            return np.repeat(one, len(drawn), axis=0)

    found = comparisons.run([FEW], [Copies()], [4e-3]).table
    assert list(found["verdict"]) == ["crashed"]
    assert "at the start" in found["reason"].iloc[0]
