"""Findings on symmetries as rows of a run: their verdicts, a stored run, baselines, and the commands that reproduce them."""

import dataclasses
import datetime
import itertools

import numpy as np
import pytest
from support import engines as made

import dropspin as ds
from dropspin.comparisons.measuring.symmetries import AGAIN, BITWISE, NAMES
from dropspin.comparisons.symmetries.findings import Finding, with_symmetries
from dropspin.comparisons.symmetries.study import symmetries
from dropspin.reports.stories.failures import failures

SCENE, DTS = "spin-asymmetric", (8e-3, 4e-3)


def measured(engine):
    found = ds.run(SCENE, engine, DTS)
    return with_symmetries(found, symmetries(SCENE, engine, dt=min(DTS)), min(DTS))


def rows_of(results):
    return results.table[results.table["kind"].isin(["symmetry", "determinism"])].set_index("metric")


def one_ulp_more(ulps):
    """Each simulation has another number of ulps more."""

    class Noisy(made.Exact):
        name = "noisy"

        def prepare(self, scene, dt):
            share = 1.0 + next(ulps) * np.finfo(float).eps
            return made.ExactSimulation(scene, dt, lambda state, time: state * share if time > 0.0 else state)

    return Noisy()


def test_exact_solution_passes_every_symmetry_and_gives_the_same_bits():
    rows = rows_of(measured(made.Exact()))
    assert set(rows.index) == set(NAMES)
    assert set(rows["verdict"]) == {"passed"}
    assert (rows.loc[list(BITWISE), "value"] == 0.0).all()
    assert set(rows["kind"]) == {"symmetry", "determinism"}


@pytest.mark.extended
def test_noise_of_one_ulp_fails_the_check_of_repeated_runs():
    rows = rows_of(measured(one_ulp_more(itertools.count())))
    assert rows.loc[AGAIN, "verdict"] == "failed"
    assert 0.0 < rows.loc[AGAIN, "value"] < 1e-12
    assert rows.loc[AGAIN, "upper"] == 0.0
    assert rows.loc["turned by 90°", "verdict"] == "passed"


def test_lost_symmetry_fails_the_run_and_is_reproduced_with_the_option():
    def along_x(state, time):
        state = state.copy()
        state[0] += 1e-3 * time**2
        return state

    results = measured(made.engine_with("pushed", along_x))
    assert rows_of(results).loc["turned by 90°", "verdict"] == "failed"
    assert results.exit_code() == 1
    assert results.statuses()[SCENE]["pushed"].verdict == "failed"
    [found] = [one for one in failures(results) if one.result == "difference of the motion turned by 90°"]
    assert "expected ≤ 1e-05" in found.what
    assert found.of_symmetry


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    results = with_symmetries(ds.run(SCENE, "mujoco", DTS), symmetries(SCENE, "mujoco", dt=min(DTS)), min(DTS))
    folder = tmp_path_factory.mktemp("symmetric") / "run"
    ds.write_report(results, folder)
    return folder


@pytest.mark.extended
def test_stored_run_has_the_rows_and_its_report_shows_them(stored):
    rows = rows_of(ds.load_results(stored))
    assert {"turned by 1 rad", AGAIN, "with body=child"} <= set(rows.index)
    assert "difference of the motion turned by 1 rad" in (stored / "report.html").read_text(encoding="utf-8")


@pytest.mark.extended
def test_baseline_holds_them_and_finds_a_lost_one(stored, tmp_path):
    results = ds.load_results(stored)
    accepted, _ = ds.accept(results, ds.Baseline(), "first", datetime.date(2026, 11, 24))
    ds.write_baseline(accepted, tmp_path / "baseline.toml")
    baseline = ds.load_baseline(tmp_path / "baseline.toml")
    assert set(baseline.results.loc[baseline.results["kind"] == "determinism", "metric"]) >= set(BITWISE)
    assert ds.check(results, baseline).results.exit_code() == 0
    lost = Finding(SCENE, "mujoco", "turned by 1 rad", "lost", 0.5, 1, 4e-3)
    unsound = with_symmetries(ds.run(SCENE, "mujoco", DTS), [lost], min(DTS))
    checked = ds.check(unsound, baseline).results
    reasons = checked.table.loc[(checked.table["kind"] == "baseline") & (checked.table["metric"] == "turned by 1 rad"), "verdict"]
    assert list(reasons) == ["failed"]


def test_rounding_has_a_tolerance_of_its_size():
    """A chaotic motion gives a difference of another size on another machine."""
    found = [Finding(SCENE, "mujoco", "turned by 1 rad", "rounding", 0.1), Finding(SCENE, "mujoco", "mirrored", "kept", 1e-12)]
    rows = rows_of(with_symmetries(ds.run(SCENE, "mujoco", DTS[0]), found, DTS[0]))
    assert rows.loc["turned by 1 rad", "tolerance"] == pytest.approx(0.3)
    assert rows.loc["mirrored", "tolerance"] == 1e-5
    assert set(rows["verdict"]) == {"passed"}


@pytest.mark.extended
def test_batch_that_breaks_down_costs_its_own_rows():
    def broken(motions):
        if len(motions) == 3:
            raise ValueError("no batches of three")
        return motions

    results = measured(made.in_batches("batchless", broken))
    rows = rows_of(results)
    assert set(rows.loc[rows["verdict"] != "passed"].index) <= {"in a batch", "on one core"}
    assert rows.loc["in a batch", "verdict"] == "crashed"
    assert "no batches of three" in rows.loc["in a batch", "reason"]
    assert rows.loc["turned by 1 rad", "verdict"] == "passed"
    assert results.exit_code() == 3


@pytest.mark.extended
def test_engine_that_returns_nan_has_a_row_for_its_run_alone(tmp_path):
    results = measured(made.engine_with("undefined", lambda state, time: state * (np.nan if time > 0.1 else 1.0)))
    assert rows_of(results).empty
    assert set(results.table["verdict"]) == {"diverged"}
    ds.write_report(results, tmp_path / "run")
    assert len(ds.load_results(tmp_path / "run").table) == len(results.table)


@pytest.mark.extended
def test_run_without_symmetries_is_not_compared_with_accepted_ones(stored):
    accepted, _ = ds.accept(ds.load_results(stored), ds.Baseline(), "first", datetime.date(2026, 11, 24))
    checked = ds.check(ds.run(SCENE, "mujoco", DTS), accepted).results
    assert checked.exit_code() == 0
    assert not checked.table.loc[checked.table["kind"] == "baseline", "metric"].isin(NAMES).any()


@pytest.mark.extended
@pytest.mark.parametrize("name", ["evil", "position_error", "with <b>=1"])
def test_stored_run_with_another_name_of_a_symmetry_is_refused(stored, tmp_path, name):
    results = ds.load_results(stored)
    table = results.table.assign(metric=results.table["metric"].replace({"mirrored": name}))
    ds.write_report(dataclasses.replace(results, table=table), tmp_path / "run")
    with pytest.raises(ds.DropspinError, match=r"results\.parquet"):
        ds.load_results(tmp_path / "run")
