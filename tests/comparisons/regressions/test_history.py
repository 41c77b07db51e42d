"""Results over runs: the run in which they moved."""

from dataclasses import replace

import pytest
from support.releases import TURNING, Broken, Candidate, Euler, part, released

from dropspin.comparisons.regressions.history import history
from dropspin.reports.plots.history import result_over_runs, run_labels
from dropspin.reports.stories.history import document
from dropspin.scenarios import DropspinError


def dated(*runs):
    """Runs by name, each a day after the one before."""
    return {
        name: replace(one, provenance={**one.provenance, "started": f"2026-01-0{day}"})
        for day, (name, one) in enumerate(zip("abcde", runs, strict=False), start=1)
    }


def test_history_finds_the_run_in_which_results_moved(before, release):
    """Runs are sorted by time; of an engine that broke down in between, results are gone once, and it is followed past that run."""
    runs = dated(
        before,
        released(release(Candidate), "1.1"),
        part(release(Broken, "mujoco"), "drop-ball"),
        replace(part(release(Broken, "mujoco"), "drop-ball")),
        released(release(Euler), "2.0"),
    )
    found = history(dict(reversed(runs.items())))
    assert found.names == ["a", "b", "c", "d", "e"]
    lost, move = found.moves
    assert (lost.engine, lost.before, lost.run, {*lost.results["change"]}) == ("candidate", 1, 2, {"gone"})
    assert {*lost.results["scene"]} == {"drop-ball"}
    assert (move.engine, move.before, move.run) == ("candidate", 1, 4)
    assert move.attribution.origin == "engine"
    assert "candidate 1.1 → 2.0" in move.attribution.message
    assert set(move.results["scene"]) >= TURNING


def test_change_of_a_scene_that_the_run_between_did_not_have_is_attributed_to_the_run_that_had_it(before, release):
    runs = dated(before, part(released(release(Candidate, "mujoco"), "2.0"), "drop-ball"), released(release(Euler, "mujoco"), "2.0"))
    [move] = history(runs).moves
    assert (move.before, move.run, {*move.results["scene"]}) == (0, 2, TURNING)
    assert move.attribution.message == "attributed to the engine: candidate 1.0 → 2.0, its settings (rotation)"


def drifted(results, tolerances):
    """A run in which one result of the candidate is some of its tolerances worse."""
    table = results.table.copy()
    one = (table[["engine", "scene", "metric", "dt"]] == ["candidate", "fall-spin", "orientation_error", 4e-3]).all(axis=1)
    table.loc[one, "value"] += tolerances * table.loc[one, "tolerance"]
    return replace(results, table=table)


def test_drift_is_attributed_to_the_last_run_that_differs_by_more_than_the_tolerance(before, release):
    """A jump to the run before it."""
    drifts = [released(drifted(before, step), f"1.{number}") for number, step in enumerate((0.0, 0.5, 0.9, 1.4, 7.0))]
    moves = history(dated(*drifts)).moves
    assert [(move.before, move.run, *move.results["in_tolerances"].round(6)) for move in moves] == [(0, 3, 1.4), (3, 4, 5.6)]
    assert [move.attribution.message[-9:] for move in moves] == ["1.0 → 1.3", "1.3 → 1.4"]


def test_history_of_one_run_is_refused(before):
    with pytest.raises(DropspinError, match=r"^a history needs two or more runs, got 1; give more, or a folder of runs\.$"):
        history({"a": before})


def test_scene_that_changed_while_an_engine_was_absent_moves_nothing(before, longer_fall):
    """Results of the scene before its change are not compared with later ones; the figure's label of the run names the absent engine."""
    runs = history(dated(part(before, "fall-spin"), part(longer_fall, engines=["mujoco"]), longer_fall))
    assert not runs.moves
    assert run_labels(runs) == ["candidate 1.0", "no candidate", "candidate 1.0"]


def test_scene_that_returns_to_a_definition_is_compared_with_the_last_run_of_it(before, longer_fall):
    """The result of the last run is 7 tolerances worse than that of the first one; the run between simulated something else."""
    runs = history(dated(part(before, "fall-spin"), longer_fall, part(drifted(before, 7.0), "fall-spin")))
    [move] = runs.moves
    assert (move.before, move.run, *move.results["metric"], *move.results["in_tolerances"].round(6)) == (0, 2, "orientation_error", 7.0)
    chart = result_over_runs(runs, "fall-spin", "position_error")
    assert [[*line.x] for line in chart.lines if line.label == "candidate"] == [[0, 2], [1]]
    attributed, redefined = document(runs).parts[1].items
    assert attributed.startswith("candidate: 1 result changed from a to c.")
    assert redefined == "fall-spin has another definition in b, c than in the run before: only runs with the same one are compared."


def test_results_with_the_same_values_that_are_judged_otherwise_are_named_with_the_run(before):
    """In the second run a bound is narrower: no result changed, but its checks fail."""
    table = before.table
    fails = (table["metric"] == "energy_error") & (table["engine"] == "candidate") & (table["kind"] == "truth")
    passed, failed = (replace(before, table=table.assign(verdict=table["verdict"].mask(fails, to))) for to in ("passed", "failed"))
    runs = history(dated(passed, failed, failed))
    assert runs.judged_otherwise == [{("candidate", "passed", "failed"): fails.sum()}, {}]
    unchanged, judged = document(runs).parts[1].items
    assert unchanged.startswith("No result changed")
    assert judged == f"candidate: {fails.sum()} results with the same values are in b failed instead of passed."


def test_history_without_two_runs_of_one_definition_does_not_say_that_nothing_changed(before, longer_fall):
    first, _ = document(history(dated(part(before, "fall-spin"), longer_fall))).parts[1].items
    assert first == "No result was compared, because no two runs have one in common."
