"""One status for each engine in each scene, and known faults in every count."""

import re
from dataclasses import replace

import numpy as np
import pytest
from support import engines as made

import dropspin as ds
from dropspin.comparisons.judging.verdicts import OUTCOMES, VERDICTS
from dropspin.comparisons.results.results import MODEL_ERROR, UNDECIDED, Status
from dropspin.reports.junit import junit_xml
from dropspin.reports.plots.colours import human_label
from dropspin.reports.stories.findings import counts
from dropspin.reports.stories.matrix import MEANINGS, explanations, leading_errors, shown_scenes, step_times
from dropspin.reports.stories.run import overview


@pytest.fixture(scope="module")
def core(core_run):
    return ds.load_results(core_run, arrays=False)


@pytest.fixture(scope="module")
def summary(core):
    return overview(core)


@pytest.fixture(scope="module")
def explained(core):
    return explanations(core, core.statuses())


@pytest.mark.sample(2)
@pytest.mark.parametrize(
    ("scene", "engine", "verdict", "reason", "words"),
    [
        ("spin-asymmetric", "wang", "known", "model error", "known fault (model error)"),
        ("spin-principal-500", "wang", "known", "", "known fault"),
        ("spin-asymmetric", "mujoco", "passed", "", "passed"),
        ("slide-box", "wang", "declined", "declined", "not judged (declined)"),
        ("slide-box", "mujoco", "limited", "limited", "not judged (limited)"),
        ("turn-box-flat", "pybullet", "passed", "", "passed"),  # undecided, with an error of 1.7e-12 at the finest time step
    ],
)
def test_engine_has_one_status_in_a_scene(summary, scene, engine, verdict, reason, words):
    status = summary.statuses[scene][engine]
    assert (*status, status.words) == (verdict, reason, words)


def test_large_error_that_passes_has_its_bound_beside_it(core):
    leading = leading_errors(core)
    assert (leading["fall-damped"].sizes["pybullet"], leading["fall-damped"].bounds["pybullet"]) == ("17", "≤ 30")
    assert leading["slip-stick"].bounds == {}  # a known fault, and errors below 1 %


def test_small_error_is_not_shown_of_an_engine_that_fails_in_another_metric(core):
    """The row shows the orientation, which is the known fault of Wang's method; MuJoCo's, which is right, is no cell of a failure."""
    table, scene = core.table.copy(), "spin-principal-500"
    fails = (table["scene"] == scene) & (table["engine"] == "mujoco") & (table["metric"] == "energy_error") & (table["dt"] == 1e-3)
    table.loc[fails, ["verdict", "value"]] = "failed", 0.05
    before, after = (leading_errors(results)[scene] for results in (core, replace(core, table=table)))
    assert (before.metric, after.metric, before.sizes["pybullet"]) == ("orientation_error", "orientation_error", after.sizes["pybullet"])
    assert ("mujoco" in before.sizes, "mujoco" in after.sizes, after.levels["mujoco"]) == (True, False, None)
    assert after.sizes["wang"] == before.sizes["wang"]


@pytest.mark.parametrize(("size", "shown_as"), [(0.05, "5.0"), (2e-5, "2.0e-3")])
def test_error_that_fails_as_dt_vanishes_alone_is_the_one_that_is_shown(core, size, shown_as):
    """However small, in a scene without a larger fault."""
    table, scene = core.table.copy(), "drop-ball-backspin"
    mine = (table["scene"] == scene) & (table["engine"] == "mujoco") & (table["metric"] == "energy_error")
    table.loc[mine & (table["kind"] == "asymptotic_error"), "verdict"] = "failed"
    table.loc[mine & (table["dt"] == 1e-3), "value"] = size
    shown = leading_errors(replace(core, table=table))[scene]
    assert (shown.metric, shown.sizes["mujoco"]) == ("energy_error", shown_as)


def test_scenes_that_every_engine_declines_are_counted():
    statuses = {f"s{number}": {"a": Status(*(("declined", "") if number < 3 else ("passed", "")))} for number in range(20)}
    assert shown_scenes(statuses)[1] == "Scenes not shown: 20 in which no engine has a finding, 3 of them declined."


@pytest.mark.extended
def test_scenes_have_the_property_with_which_the_conclusion_excepts_them(core):
    with_friction = [name for name, scene in core.scenes.items() if any(0.0 < one.coefficient < np.inf for one in scene.surfaces)]
    assert overview(core).tags == {"Coulomb friction": with_friction}
    assert any("with Coulomb friction" in sentence for sentence in overview(core).conclusion)


def test_every_status_has_a_meaning():
    statuses = [Status(verdict, reason) for verdict, (_, reason) in OUTCOMES.items()]
    statuses += [Status("passed", UNDECIDED), Status("measured", UNDECIDED), Status("known", MODEL_ERROR)]
    assert OUTCOMES.keys() == set(VERDICTS)
    assert {status.words for status in statuses} == MEANINGS.keys()


@pytest.mark.extended
@pytest.mark.parametrize(
    ("scene", "engine", "pattern"),
    [
        ("rock-block", "pybullet", r"Angular momentum 3\.\d+ % at 1 ms, .*; passed \(trend undecided\): .*; .*: only 2 of 3 time steps .*"),
        ("fall-damped", "pybullet", r"Position 0\.0171 m at 1 ms, bound ≤ 0\.03 m; every check of the scene is within its bound.*"),
        ("drop-ball-slipping", "pybullet", r"Bounce height 0\.\d+ % at 1 ms, no bound at this time step; every check .*; as dt → 0: .*"),
        (
            "drop-box-turning",
            "pybullet",
            r"Bounce height 0\.\d+ % at 1 ms, .*; not judged \(limited\): .*; friction cone excess: .*",
        ),
        (
            "spin-asymmetric",
            "wang",
            r"Orientation 2\.67 rad at 1 ms, bound 2\.6 … 2\.75 rad; known fault \(model error\): .*; orient.*",
        ),
        ("rock-block", "mujoco", r"Angular momentum 3\.\d+ % at 1 ms, bound ≤ 10 %; passed \(trend undecided\): .*; .*: .*"),
        ("slide-box", "wang", r"Not judged \(declined\): the engine or its adapter cannot run the scene; law=note has no Coulomb .*"),
    ],
)
def test_explanation_has_the_error_its_bound_and_the_reason(explained, scene, engine, pattern):
    """Also where the check that decides is of another metric than the error shown."""
    assert re.fullmatch(pattern, explained[scene][engine]), explained[scene][engine]


def test_undecided_trends_of_the_conclusion_are_the_marks_of_the_matrix(core, summary):
    marked = {(scene, engine) for scene, of in core.statuses().items() for engine, status in of.items() if status.mark == "~"}
    [sentence] = [sentence for sentence in summary.conclusion if sentence.startswith("Trend as dt → 0 undecided")]
    clauses = dict(clause.split(" in ") for clause in sentence.partition("(~): ")[2].removesuffix(".").split("; "))
    for engine in core.engines:
        scenes = [scene for scene, of in marked if of == engine]
        named = clauses.get(human_label(engine), "")
        assert bool(scenes) == bool(named)
        assert all(scene in named for scene in scenes) or named == f"{len(scenes)} scenes"


@pytest.mark.extended
def test_failure_is_the_status_of_its_scene():
    results = ds.run("spin-principal", made.engine_with("drifting", made.turned_by(0.1)))
    assert overview(results).statuses["spin-principal"]["drifting"] == ("failed", "")


def test_run_in_which_nothing_was_simulated_says_so():
    class Declining(made.Exact):
        name = "declining"

        def declines(self, scene):
            return "no"

    assert overview(ds.run("spin-principal", Declining())).verdict == "No check was made, because no scene was simulated."


@pytest.mark.extended
def test_error_that_overflows_is_reported(tmp_path):
    """Finite states, whose energy is infinite."""
    faster = np.repeat([1.0, 1e200], [10, 3])
    results = ds.run("spin-principal", made.engine_with("fast", lambda state, time: state * faster))
    assert any("largest error: energy inf % at dt = 1 ms in spin-principal" in sentence for sentence in overview(results).findings)
    assert ds.write_report(results, tmp_path / "run").is_file()


def test_known_faults_are_counted_apart_and_in_the_headline(core, summary):
    """They are neither passed nor failed; in JUnit they are skipped, with the reason. Negligible ones are not in the headline."""
    judged, tally = core.table[core.table["verdict"] == "known"], counts(core)
    known = judged[judged["value"].abs() > 1e-4]
    assert len(judged) > len(tally.known) == len(known) > 100
    assert tally.passed == (core.table["verdict"] == "passed").sum()
    assert f"{len(known)} values are known faults: Wang's method in {known['scene'].nunique()} scenes" in summary.verdict
    [sentence] = [one for one in summary.findings if one.startswith("Wang's method: ")]
    faults = sum(by_engine["wang"].outcome == "known fault" for by_engine in summary.statuses.values())
    assert faults > 0
    assert f"known fault in {faults}" in sentence
    assert junit_xml(core).decode().count("known fault: ") == len(judged)


def test_an_engine_that_breaks_down_everywhere_has_no_time_per_step():
    """It takes none of the others' time either."""
    times = step_times(ds.run("spin-principal", [made.engine_with("lost", made.nan_after_half_a_second), "wang"], dt=4e-3))
    assert "lost" not in times
    assert times["wang"] > 0.0
