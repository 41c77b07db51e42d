"""Quick runs: few starts, verdicts that do not depend on which, and results that are not compared with other runs."""

import datetime

import numpy as np
import pytest
from support import engines as made
from support.cli import assert_refused, dropspin
from support.engines import Exact, ExactSimulation

import dropspin as ds
from dropspin.comparisons.results.ensembles import QUICK_MEMBERS
from dropspin.comparisons.running.run import what_changed
from dropspin.comparisons.running.start_phases import QUICK_START_PHASES, START_PHASES

DT = 8e-3
BALL = ds.load("drop-ball").model_dump(exclude={"expect"}, exclude_none=True)
METRIC = "restitution_error"


def row(below, quick):
    """The restitution of Wang's method, which detects an impact at the end of a step, with an expectation."""
    scene = {**BALL, "expect": [{"metric": METRIC, "below": below, "reason": "a bound"}]}
    table = ds.run(scene, "wang", DT, quick=quick).table
    [found] = table[(table["metric"] == METRIC) & (table["kind"] == "truth")].to_dict("records")
    return found


@pytest.mark.extended
def test_bound_that_the_choice_of_starts_may_decide_is_not_judged():
    full = abs(row(1.0, quick=False)["value"])
    for share, verdict in ((1.02, "passed"), (0.98, "failed")):
        assert row(share * full, quick=False)["verdict"] == row(share * full, quick=True)["verdict"] == verdict
    for share, verdict in ((1.0001, "passed"), (0.9999, "failed")):
        assert row(share * full, quick=False)["verdict"] == verdict
        near = row(share * full, quick=True)
        assert near["verdict"] == "measured"
        assert near["basis"] == "few_starts"
        assert np.isnan(near["tolerance"])


class Single(made.Exact):
    """States in single precision, whose verdicts need the effect of rounding."""

    name = "single"
    precision = np.float32


@pytest.mark.usefixtures("all_start_phases")
@pytest.mark.parametrize(
    ("scene", "engine", "full", "quick"),
    [
        ("drop-ball", made.Exact(), 1 + START_PHASES, 1 + QUICK_START_PHASES),
        ("spin-principal", made.Exact(), 1 + 4, 1),
        ("spin-principal", Single(), 1 + 4, 1 + 4),
    ],
)
def test_number_of_simulations(scene, engine, full, quick, monkeypatch):
    monkeypatch.setattr("dropspin.comparisons.running.processes.POLL", 1e-3)
    for expected, is_quick in ((full, False), (quick, True)):
        totals = set()
        ds.run(scene, engine, DT, on_progress=lambda progress, totals=totals: totals.add(progress.total), quick=is_quick)
        assert totals == {0, expected}


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """A quick run of an ensemble, and its folder."""
    results = ds.run("drop-box-anyhow", "wang", DT, quick=True)
    folder = tmp_path_factory.mktemp("quick") / "run"
    ds.write_report(results, folder)
    return results, folder


@pytest.mark.extended
def test_stored_quick_run_says_what_was_left_out(stored):
    _, folder = stored
    loaded = ds.load_results(folder)
    assert loaded.provenance["asked"]["quick"]
    [outcome] = loaded.ensembles.values()
    assert len(outcome.rebound) == QUICK_MEMBERS
    said = f"Quick run: {QUICK_START_PHASES} start phases instead of {START_PHASES}"
    assert said in (folder / "report.md").read_text(encoding="utf-8")
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert said in page
    assert f"each result is the mean over {QUICK_START_PHASES} start phases" in page


def test_quick_run_is_not_compared_with_other_runs(stored):
    results, folder = stored
    assert ds.check(results).not_run.empty  # the expectations of its scene alone
    works = [
        lambda: ds.accept(results, ds.Baseline(), "measured", datetime.date(2026, 1, 1)),
        lambda: ds.check(results, ds.Baseline()),
        lambda: ds.compare(results, results),
        lambda: ds.history({"a": results, "b": results}),
    ]
    for work in works:
        with pytest.raises(ds.DropspinError, match="a quick run has too few starts to be compared with other runs or accepted"):
            work()
    assert_refused(dropspin("accept", folder, "--reason", "measured", cwd=folder.parent), "run it again without --quick")
    done = dropspin("run", "fall-spin", "--quick", "--baseline", "baseline.toml", cwd=folder.parent)
    assert (done.returncode, "leave out --quick or --baseline" in done.stderr) == (2, True)


def test_results_of_a_quick_run_do_not_resume_a_full_one():
    calls = []
    quick = ds.run("spin-principal", "wang", DT, quick=True)
    ds.run("spin-principal", "wang", DT, done=[quick], keep=calls.append)
    assert len(calls) == 1


def test_results_of_another_version_of_an_engine_are_measured_again():
    """Which is known once the engine has simulated a scene; a reported version that changes from scene to scene ends nothing."""

    def run(scenes, version, done=()):
        calls = []
        engine = engine_of_version(version)
        results = ds.run(scenes, engine, DT, quick=True, done=done, keep=lambda part: calls.append(next(iter(part.scenes))))
        return results, calls

    def engine_of_version(version):
        def prepare(self, scene, dt):
            simulation = ExactSimulation(scene, dt)
            simulation.settings = {"version": version or scene.name}
            return simulation

        return type("Versioned", (Exact,), {"name": "versioned", "prepare": prepare})()

    first, second = ("spin-principal", "fall-spin")
    old, _ = run([first], "1.0")
    assert run([first, second], "1.0", [old])[1] == [second]
    results, calls = run([first, second], "2.0", [old])
    assert (calls[0], sorted(calls[1:])) == (second, sorted([first, second]))  # of which any may be finished first
    assert what_changed(old.provenance, results.provenance) == "the version of versioned"
    changing, _ = run([first], "")
    assert sorted(run([first, second], "", [changing])[1]) == sorted([second, first, second])
