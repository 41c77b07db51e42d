"""`dropspin tradeoff` in words, files and tables."""

import csv
import json

import numpy as np
import pytest
from support.cli import TERMINAL

from dropspin.comparisons.tradeoff.ladder import Ladder
from dropspin.comparisons.tradeoff.pareto import CostPoint, TradeOff
from dropspin.reports.stories import tradeoff
from dropspin.reports.study_files import write_study
from dropspin.reports.terminal.rows import print_rows
from dropspin.scenarios import load

SPENT = "the budget of 2 s of processor time was spent"


@pytest.fixture
def found():
    """Ladders that end by the budget, by their errors and by the longest run, of which the last dominates; and two that are left out."""
    ladders = (
        Ladder("mujoco[integrator=implicitfast]", ((0.033, 0.1), (0.01, 5.2e-3)), "budget", SPENT),
        Ladder(
            "wang[rotation=implicit-gyroscopic]",
            ((0.033, 2e-2), (0.01, np.nan), (0.005, 7e-3)),
            "error_stopped_falling",
            "it stays",
            undefined="x",
        ),
        Ladder("accurate", ((0.033, 1e-2), (0.01, 4e-3)), "longest_run", "a run would be too long"),
        Ladder("other", ((0.033, 2.0),), "budget", SPENT, "no convergence observed"),
        Ladder("missing", (), "not_run", "not installed", "not installed"),
    )
    costs = {"mujoco[integrator=implicitfast]": 5e-6, "wang[rotation=implicit-gyroscopic]": 2e-6, "accurate": 1e-6}
    points = tuple(
        CostPoint(one.engine, dt, error, np.full(3, costs[one.engine] / dt), {256: 1e-7 / dt})
        for one in ladders
        if not one.left_out
        for dt, error in one.steps
        if np.isfinite(error)
    )
    return TradeOff(load("spin-asymmetric"), "orientation_error", points, ladders)


def test_nearest_configuration_has_the_reason_why_no_smaller_step_was_tried(found):
    """The conclusion is about the tested steps; a ladder that its budget ended names the option that continues it."""
    [sentence, *_] = tradeoff.sentences(found, [1e-3])
    assert sentence == (
        "spin-asymmetric, orientation error within 0.001 rad: no tested configuration reaches this tolerance; "
        "the most accurate is accurate at 10 ms "
        "with an error of 4.00e-03 rad. With this engine, no time step below 10 ms was tried, because a run would be too long."
    )
    budgeted = TradeOff(found.scene, found.metric, found.points[:2], found.ladders[:1])
    assert tradeoff.sentences(budgeted, [1e-3])[0].endswith(
        "the most accurate is mujoco[integrator=implicitfast] at 10 ms with an error of 5.20e-03 rad. "
        f"With this engine, no time step below 10 ms was tried, because {SPENT} (option --budget)."
    )
    earlier = Ladder("accurate", (*found.ladders[2].steps, (0.005, 5e-3)), "error_stopped_falling", "it stays")
    stays = TradeOff(found.scene, found.metric, found.points, (*found.ladders[:2], earlier))
    sentence = tradeoff.sentences(stays, [1e-3])[0]
    assert "at 10 ms with an error of 4.00e-03 rad. With this engine, no time step below 5 ms was tried, because it stays." in sentence


def test_ladders_are_listed_with_their_ends_and_reasons(found):
    none = "No error at 1 of 3 time steps, down to 10 ms, because x: wang[rotation=implicit-gyroscopic]."
    assert tradeoff.sentences(found, [])[:4] == [
        none,
        f"No smaller time steps than these were tried, because {SPENT} (option --budget): "
        "mujoco[integrator=implicitfast] at 10 ms, other at 33 ms.",
        "No smaller time steps than these were tried, because it stays: wang[rotation=implicit-gyroscopic] at 5 ms.",
        "No smaller time steps than these were tried, because a run would be too long: accurate at 10 ms.",
    ]
    assert tradeoff.sentences(found, [])[4:] == ["Left out: other, no convergence observed.", "Left out: missing, not installed."]


def test_time_step_that_is_too_coarse_for_an_error_is_not_listed(found):
    coarse = Ladder("accurate", ((0.066, np.nan), *found.ladders[2].steps), "longest_run", "a run would be too long", undefined="x")
    study = TradeOff(found.scene, found.metric, found.points, (*found.ladders[:2], coarse))
    assert [sentence for sentence in tradeoff.sentences(study, []) if sentence.startswith("No error") and "accurate" in sentence] == []


def test_only_engine_within_a_tolerance_is_compared_with_tested_ones(found):
    assert "; no other engine that was compared reaches this tolerance." in tradeoff.sentences(found, [4.5e-3])[0]
    alone = TradeOff(found.scene, found.metric, found.points[-2:], found.ladders[2:3])
    assert ": accurate at 10 ms, 100 µs per simulated second. In a batch" in tradeoff.sentences(alone, [4.5e-3])[0]


def test_error_that_is_small_at_a_coarse_step_alone_is_no_recommendation(found):
    """Where it crosses 0."""
    crossing = Ladder("accurate", ((0.033, 5e-4), (0.01, 3e-3)), "budget", SPENT)
    points = tuple(CostPoint("accurate", dt, error, np.full(3, 1e-6 / dt), {}) for dt, error in crossing.steps)
    [sentence] = tradeoff.sentences(TradeOff(found.scene, found.metric, points, (crossing,)), [1e-3])[:1]
    none = "no tested configuration is within this tolerance at its time step and at those down to a quarter of it"
    assert f"{none}; accurate at 33 ms has an error of 5.00e-04 rad, but a larger one at a smaller time step." in sentence


def test_slower_engine_that_is_faster_in_some_rounds_is_said_to_be(found):
    rounds = {"accurate": np.ones(5), "other": np.array([0.9, 0.9, 2.0, 2.0, 2.0])}
    ladders = tuple(Ladder(engine, ((0.01, 1e-3),), "budget", SPENT) for engine in rounds)
    points = tuple(CostPoint(engine, 0.01, 1e-3, cost, {}) for engine, cost in rounds.items())
    sentence = tradeoff.sentences(TradeOff(found.scene, found.metric, points, ladders), [1e-2])[0]
    assert sentence.endswith("; other at 10 ms takes 2.0 times as long, but less time in a quarter of the rounds.")


def test_timings_that_decide_no_front_and_a_busy_machine_are_said(found):
    """And in the table: a front is undecided, not guessed, and each cost has its spread."""
    rounds = {"accurate": np.full(9, 2.0), "other": np.array([1.0] * 4 + [3.0] * 5)}
    ladders = tuple(Ladder(engine, ((0.01, 1e-3),), "budget", SPENT) for engine in rounds)
    points = tuple(CostPoint(engine, 0.01, 1e-3, cost, {256: 1e-3}, {256: 2.5}) for engine, cost in rounds.items())
    disturbed = TradeOff(found.scene, found.metric, points, ladders, load=2.5)
    listed = tradeoff.sentences(disturbed, [1e-2])
    assert listed[1:5] == [
        "2 configurations are on the Pareto front in only some of the rounds, so the timings are not decisive: "
        "accurate at 10 ms, other at 10 ms.",
        "Timings vary: the median over the rounds is typically 2 times the shortest (column cost_spread).",
        "Timings of batches vary by a factor of up to 2.5, for accurate at 10 ms in a batch of 256.",
        "The machine was busy while costs were measured: 2.5 other threads per processor were running, on average; "
        "measure again on an idle machine.",
    ]
    assert {row["on the Pareto front"] for row in tradeoff.pareto_front_rows(disturbed)} == {"undecided"}
    rows = {row["engine"]: row for row in tradeoff.rows(disturbed)}
    assert [rows["other"][name] for name in ("on_pareto_front", "cost", "cost_best", "cost_spread", "spread_per_world_256")] == [
        *(None, 3.0, 1.0, 3.0, 2.5)
    ]
    assert not any("vary" in sentence or "busy" in sentence for sentence in tradeoff.sentences(found, [1e-2]))


def test_every_engine_has_a_row_with_its_place(found):
    """The Pareto front, the most accurate step of each dominated engine, and those left out."""
    rows = tradeoff.pareto_front_rows(found)
    assert [(row["engine"], row["step [ms]"], row["error [rad]"], row["on the Pareto front"]) for row in rows] == [
        ("accurate", "33", "0.0100", "yes"),
        ("accurate", "10", "4.00e-03", "yes"),
        ("mujoco[integrator=implicitfast]", "10", "5.20e-03", "dominated by accurate"),
        ("wang[rotation=implicit-gyroscopic]", "5", "7.00e-03", "dominated by accurate"),
        ("other", "–", "–", "left out, see below"),
        ("missing", "–", "–", "left out, see below"),
    ]


def test_table_of_80_columns_keeps_words_and_numbers_whole(found, capsys, monkeypatch):
    for name, value in TERMINAL.items():
        monkeypatch.setenv(name, value)
    print_rows(tradeoff.pareto_front_rows(found))
    output = capsys.readouterr().out
    assert max(map(len, output.splitlines())) <= 80
    words = output.split()
    for word in (
        "[ms]",
        "[rad]",
        "simulated",
        "second",
        "(batch",
        "dominated",
        "5.20e-03",
        "mujoco[integrator=",
        "implicitfast]",
        "implicit-gyroscopic]",
    ):
        assert word in words
    assert "500 µs" in output  # a number and its unit are on one line


def test_files_hold_every_step_tried_and_why_the_ladder_ended(found, tmp_path):
    write_study(tradeoff.TradeOffs(scenes=[found], within=[1e-3]), tmp_path)
    rows = json.loads((tmp_path / "tradeoff.json").read_text(encoding="utf-8"))
    assert [(row["engine"], row["dt"], row["error"]) for row in rows] == [
        (ladder.engine, dt, None if error is None or np.isnan(error) else error)
        for ladder in found.ladders
        for dt, error in ladder.steps or [(None, None)]
    ]
    first, last = rows[0], rows[-1]
    assert (first["ladder_ended"], first["ladder_reason"], first["dominated_by"], first["left_out"]) == ("budget", SPENT, "accurate", None)
    assert (last["ladder_ended"], last["left_out"], last["cost"]) == ("not_run", "not installed", None)
    assert [row["on_pareto_front"] for row in rows if row["engine"] == "accurate"] == [True, True]
    with (tmp_path / "tradeoff.csv").open(encoding="utf-8") as file:
        assert [row["ladder_reason"] for row in csv.DictReader(file)] == [row["ladder_reason"] for row in rows]
    page = (tmp_path / "tradeoff.md").read_text(encoding="utf-8")
    assert "dominated by accurate" in page
    assert SPENT in page
