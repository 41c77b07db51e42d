"""Runs compared with a baseline: planted faults fail and are listed first, and unchanged engines never fail."""

import os
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from support import engines as made
from support.releases import (
    DTS,
    SCENES,
    TODAY,
    TURNING,
    WITH_FLOOR,
    Broken,
    Candidate,
    Euler,
    OnAnotherMachine,
    OneBadStart,
    TooLively,
    WithoutGyroscopicTerm,
    failing,
    part,
    relabelled,
    released,
)

from dropspin import scenarios
from dropspin.comparisons.engines import mujoco_simulation
from dropspin.comparisons.regressions.baseline import Baseline
from dropspin.comparisons.regressions.changes import KEY, comparable_results
from dropspin.comparisons.regressions.checking import NothingAccepted, accept, check
from dropspin.comparisons.running.run import run


@pytest.mark.parametrize(
    ("planted", "scenes", "metrics"),
    [
        (TooLively, WITH_FLOOR, {"restitution_error"}),
        (WithoutGyroscopicTerm, TURNING, {"orientation_error", "angular_momentum_direction_error"}),
        (Euler, TURNING, {"orientation_error"}),
    ],
    ids=["1 % restitution", "no gyroscopic term", "Euler instead of RK4"],
)
def test_planted_faults_fail_and_are_listed_first(release, accepted, planted, scenes, metrics):
    """In the scenes that they change and in no other; the metric that shows them comes first.

    Measured at 4, 2 and 1 ms: the first is off by 1e5 (restitution), 1e9 (no term) and 1e9 (Euler) tolerances.
    """
    checked = check(release(planted), accepted)
    failed = failing(checked)
    assert set(failed["scene"]) == scenes
    assert set(failed["engine"]) == {"candidate"}
    assert failed["metric"].iloc[0] in metrics
    assert checked.changes["in_tolerances"].iloc[0] > 1e4
    assert checked.results.exit_code() == 1
    assert re.match(r"accepted \S+ ± \S+ on 2026-03-01, first measured; worse by \S+, \S+ times its tolerance", failed["reason"].iloc[0])


def test_missing_gyroscopic_term_is_listed_first_in_the_tumble(release, accepted):
    """Of the scenes in which it matters, the one that is about it."""
    for planted in (WithoutGyroscopicTerm, Euler):
        assert failing(check(release(planted), accepted))["scene"].iloc[0] == "spin-asymmetric"


def test_repeated_run_has_the_same_bits(before):
    """A box that tumbles after an impact, and a tumble in flight."""
    names = ["drop-box-corner", "spin-asymmetric"]
    again = run([scene for scene in SCENES if scene.name in names], [Candidate(), "mujoco"], DTS)
    pd.testing.assert_frame_equal(comparable_results(part(before, *names)), comparable_results(again), check_exact=True)


def test_unchanged_engine_does_not_fail_on_a_machine_that_rounds_differently(before, release, accepted):
    for found in (before, release(OnAnotherMachine)):
        checked = check(found, accepted)
        assert failing(checked).empty, failing(checked).to_string()
        assert set(checked.changes["change"]) == {"same"}
    elsewhere = comparable_results(release(OnAnotherMachine)).merge(comparable_results(before), on=KEY)
    assert (elsewhere["value_x"] != elsewhere["value_y"]).mean() > 0.3  # it does round differently


@pytest.fixture(scope="module")
def block():
    """A block on its corner, and its accepted results."""
    scene = scenarios.load("rock-block")
    return scene, accept(run(scene, "mujoco", 2e-3), Baseline(), "first", TODAY)[0]


@pytest.mark.extended
@pytest.mark.parametrize("seed", [0, 1])
def test_corner_whose_contact_depends_on_rounding_does_not_fail(block, seed, monkeypatch):
    """All starts an eps away: rounding decides for all of them whether they touch; measured 1.4 times what one phase may do."""
    scene, accepted = block
    from_world, moved = mujoco_simulation.from_world, 1.0 + np.finfo(float).eps * np.random.default_rng(seed).uniform(-1.0, 1.0, 13)
    monkeypatch.setattr(mujoco_simulation, "from_world", lambda states, *axes: from_world(states * moved, *axes))
    checked = check(run(scene, "mujoco", 2e-3), accepted)
    assert failing(checked).empty, failing(checked).to_string()
    assert checked.changes["in_tolerances"].abs().max() > 0.2  # rounding did decide


@pytest.mark.slow
def test_twenty_repeats_on_a_loaded_machine_do_not_fail():
    """The core catalogue with MuJoCo and PyBullet, beside twice as many busy processes as there are processors."""
    scenes = [scene for scene in map(scenarios.load, scenarios.names()) if "core" in scene.tags]
    engines = ["mujoco", "pybullet"]
    accepted, _ = accept(run(scenes, engines), Baseline(), "first", TODAY)
    burners = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2 * (os.cpu_count() or 1))]
    try:
        for _ in range(20):
            checked = check(run(scenes, engines), accepted)
            assert set(checked.changes["change"]) == {"same"}
            assert checked.results.exit_code() == 0
    finally:
        for burner in burners:
            burner.kill()
            burner.wait()


def test_changed_scene_fails_once(before, longer_fall, accepted):
    """Its results are not compared with those of another scene."""
    others = part(before, *(scene.name for scene in SCENES if scene.name != "fall-spin"), engines=["candidate"])
    now = part(longer_fall, engines=["candidate"])
    both = replace(others, table=pd.concat([others.table, now.table], ignore_index=True), scenes={**others.scenes, **now.scenes})
    failed = failing(check(both, accepted))
    assert list(failed["scene"]) == ["fall-spin"]
    assert failed["reason"].iloc[0] == "the scene has changed since its results were accepted; accept them again"


@pytest.mark.extended
def test_bad_start_does_not_widen_its_own_tolerance(accepted):
    """One start of 32 spreads the starts widely; the tolerance is that of the accepted results."""
    checked = check(run(SCENES[0], OneBadStart(), DTS), accepted)
    assert "bounce_height_error" in set(failing(checked)["metric"])


def test_run_without_accepted_results_is_refused(accepted):
    """A check that compares nothing must not pass."""
    elsewhere = run("fall-spin", Candidate(), 5e-3)
    with pytest.raises(NothingAccepted) as error:
        check(elsewhere, accepted)
    assert str(error.value) == (
        f"none of the {len(accepted.results):,} accepted results is covered by this run's scenes, engines and time steps; "
        "run the accepted scenes, engines and time steps, or accept this run."
    )


def test_lost_results_fail(release, accepted):
    """One row for all that an engine did not measure at a time step, with the crash itself; exit code 3."""
    checked = check(release(Broken), accepted)
    failed = failing(checked)
    assert set(failed["scene"]) == WITH_FLOOR
    assert len(failed) == 3 * len(WITH_FLOOR)  # one for each time step, which cover what all steps give together
    assert failed["reason"].str.match(r"[0-9]+ accepted results are gone, crashed: RuntimeError: no floor today").all()
    assert checked.results.exit_code() == 3


def named(results, **names):
    return replace(results, provenance={**results.provenance, "names": names, "named": list(names.values())})


def test_renamed_engine_is_compared_by_the_name_it_was_asked_for_by(release):
    """A new label does not escape the accepted results, until results with it are accepted."""
    base = accept(named(part(release(Candidate), "drop-ball"), candidate="m:C"), Baseline(), "first", TODAY)[0]
    assert base.engines == {"candidate": "m:C"}
    renamed = named(relabelled(released(part(release(TooLively), "drop-ball"), "1.1"), "candidate", "renamed"), renamed="m:C")
    worse = failing(check(renamed, base))
    assert set(worse["engine"]) == {"renamed"}
    assert "restitution_error" in set(worse["metric"])
    accepted, found = accept(renamed, base, "so it is called", TODAY)
    assert failing(check(renamed, accepted)).empty
    assert {"same", "worse"} <= set(found["change"])
    assert set(accepted.results["engine"]) == {"renamed"}
    [(engine, cause)] = check(renamed, base).attributions
    assert (engine, cause.origin) == ("renamed", "engine")
    assert "renamed 1.0 → 1.1" in cause.message


def test_engine_accepted_with_the_libraries_of_the_run_does_not_exclude_them(release):
    """MuJoCo's results are the same, but were accepted with the NumPy of the run, and those of the candidate with another one."""
    first, both = part(release(Candidate), "drop-ball"), part(release(TooLively, "mujoco"), "drop-ball")
    stamp = first.provenance | {"versions": first.provenance["versions"] | {"numpy": "1.0"}}
    base = accept(replace(first, provenance=stamp), Baseline(), "first", TODAY)[0]
    base = accept(part(both, engines=["mujoco"]), base, "beside it", TODAY)[0]
    [(_, cause)] = check(both, base).attributions
    assert "numpy 1.0 → " in cause.message
    assert "the results of mujoco are the same" not in cause.message


def test_engine_that_cannot_be_imported_has_lost_its_results(release, tmp_path, monkeypatch):
    """If it is the one that was accepted, by its name; exit code 3 if it was asked for on the command line."""
    base = accept(named(part(release(Candidate), "drop-ball"), candidate="m:C"), Baseline(), "first", TODAY)[0]
    (tmp_path / "lost_engine.py").write_text("import no_such_library")
    monkeypatch.syspath_prepend(tmp_path)
    missing = run(SCENES[0], "lost_engine:C", DTS)
    lost = check(missing, replace(base, engines={"candidate": "lost_engine:C"}))
    assert failing(lost)["reason"].str.match("^[0-9]+ accepted results are gone, missing: ").all()
    assert len(failing(lost))
    assert lost.not_run.empty
    with pytest.raises(NothingAccepted, match=r"^none of the "):
        check(missing, base)
    assert check(named(missing, **{"lost_engine:C": "lost_engine:C"}), base).results.exit_code() == 3


def test_results_that_were_not_run_neither_pass_nor_fail(before, accepted):
    """They are counted."""
    checked = check(part(before, "drop-ball", engines=["mujoco"]), accepted)
    assert set(checked.changes["scene"]) == {"drop-ball"}
    assert failing(checked).empty
    assert len(checked.not_run) + len(checked.changes) == len(accepted.results)


def test_known_failures_do_not_fail_until_they_get_worse():
    """A failing check is accepted as known; from then on only a worse result fails."""
    harsh = {"metric": "penetration", "below": 1e-9, "reason": "no contact is that stiff"}
    scene = scenarios.load(SCENES[0].model_dump(exclude={"expect"}, exclude_none=True) | {"expect": [harsh]})
    found = run(scene, Candidate(), 2e-3)
    assert found.exit_code() == 1
    plain, _ = accept(found, Baseline(), "first", TODAY)
    assert check(found, plain).results.exit_code() == 1
    known, _ = accept(found, plain, "first", TODAY, known_failures=True)
    checked = check(found, known)
    assert checked.results.exit_code() == 0
    [row] = checked.results.table.query("verdict == 'known'").to_dict("records")
    assert row["reason"] == "accepted as a known failure; reason of the bound: no contact is that stiff"
    worse = replace(found, table=found.table.assign(value=found.table["value"].where(found.table["metric"] != "penetration", 0.5)))
    assert check(worse, known).results.exit_code() == 1
    assert accept(found, known, "again", TODAY)[0].results["known_failure"].any()
    fixed = replace(found, table=found.table.assign(verdict=found.table["verdict"].replace("failed", "passed")))
    assert not accept(fixed, known, "fixed", TODAY)[0].results["known_failure"].any()
    broken = relabelled(run(scene, Broken(), 2e-3), "broken", "candidate")
    crashed, lost = accept(broken, known, "a bad day", TODAY, known_failures=True)
    assert lost.empty
    assert check(found, crashed).results.exit_code() == 0


def test_exact_engines_have_tolerances_of_rounding():
    """An attitude that is wrong by 1e-10 rad fails the accepted results of an engine that is exact."""
    exact, _ = accept(run("spin-principal", made.engine_with("made", lambda state, time: state), 4e-3), Baseline(), "exact", TODAY)
    off = check(run("spin-principal", made.engine_with("made", made.turned_by(1e-10)), 4e-3), exact)
    assert set(failing(off)["metric"]) == {"orientation_error"}
