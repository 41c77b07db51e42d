"""Two runs compared: the changes, their causes, and speed."""

from dataclasses import replace

import numpy as np
import pytest
from support.releases import DTS, SCENES, TURNING, Broken, Candidate, WithoutGyroscopicTerm, part, released

from dropspin.comparisons.regressions.changes import speed_changes
from dropspin.comparisons.regressions.comparing import compare
from dropspin.comparisons.running.run import run
from dropspin.reports.stories.compare import document
from dropspin.scenarios import DropspinError


def test_new_release_without_changes(before, release):
    found = compare(before, released(release(Candidate, "mujoco"), "1.1"))
    assert set(found.results["change"]) == {"same"}
    assert not found.attributions
    assert found.regressions.empty


def test_changes_of_a_faulty_release_are_attributed_to_it(before, release):
    """A release that drops the gyroscopic term: what got worse, and the version; going back is better; the engine beside it is unmoved."""
    faulty = released(release(WithoutGyroscopicTerm, "mujoco"), "1.1")
    found = compare(before, faulty)
    assert set(found.attributions) == {"candidate"}
    assert found.attributions["candidate"].origin == "engine"
    assert "candidate 1.0 → 1.1" in found.attributions["candidate"].message
    assert set(found.regressions["scene"]) == TURNING
    back = compare(faulty, before)
    assert set(back.of("better")["engine"]) == {"candidate"}


def test_results_of_a_breakdown_are_gone_and_their_orders_undefined(before, release):
    """So that those that are gone are those that fail."""
    found = compare(before, release(Broken, "mujoco"))
    assert found.of("gone").equals(found.regressions)
    assert set(found.of("undefined")["kind"]) == {"order", "asymptotic_error"}


def test_what_one_run_was_not_asked_for_is_neither_new_nor_gone(before):
    """It is listed."""
    found = compare(before, run(SCENES[3], Candidate(), [*DTS, 1e-3]))
    assert set(found.results["change"]) == {"same"}
    assert found.in_one_only == [
        "scene drop-ball (gone)",
        "scene drop-ball-backspin (gone)",
        "scene drop-box-corner (gone)",
        "scene spin-asymmetric (gone)",
        "engine mujoco (gone)",
        "step 0.001 s (new)",
    ]


def test_results_with_the_same_values_that_are_judged_otherwise_are_counted(before):
    """Such as those that a limitation explained which the engine no longer declares: no value is worse, but checks fail now."""
    table = before.table
    fails = (table["metric"] == "energy_error") & (table["engine"] == "candidate") & (table["kind"] == "truth")
    limited, failed = (replace(before, table=table.assign(verdict=table["verdict"].mask(fails, to))) for to in ("limited", "failed"))
    found, count = compare(limited, failed), int(fails.sum())
    assert found.judged_otherwise == {("candidate", "limited", "failed"): count}
    [sentence] = [text for text in document(found, failed).summary[0].items if "instead" in text]
    assert sentence == f"candidate: {count} results with the same values are now failed instead of limited."
    assert compare(failed, limited).judged_otherwise == {("candidate", "failed", "limited"): count}
    assert not compare(failed, failed).judged_otherwise


def test_runs_without_a_common_result_are_refused(before, longer_fall):
    with pytest.raises(DropspinError, match=r"^the runs have no result in common: no scene, engine and time step was requested in both\.$"):
        compare(part(before, "drop-ball"), part(before, "fall-spin"))
    with pytest.raises(DropspinError, match=r"^the runs have no result in common: fall-spin changed between them\.$"):
        compare(part(before, "fall-spin"), longer_fall)
    broken = replace(before, table=before.table.assign(value=np.nan))
    with pytest.raises(DropspinError, match=r": of what was requested in both, one of them at least has no results\.$"):
        compare(broken, broken)


def with_times(results, factors, noise=0.0):
    """The run, with the times of each engine's steps multiplied by its factor."""
    draw = np.random.default_rng(0)
    table = results.table.copy()
    table["time_per_step"] *= table["engine"].map(factors).fillna(1.0) * np.exp(noise * draw.normal(size=len(table)))
    return replace(results, table=table)


def test_speed_changes_are_ratios_between_engines(before):
    """A slower machine slows all engines and changes no ratio; one slower engine is found; noise widens the interval."""
    base = with_times(before, {})
    for factor in (0.5, 1.0, 3.0):
        found = speed_changes(base, with_times(base, dict.fromkeys(base.engines, factor)))
        assert [change.engine for change in found] == ["candidate", "mujoco"]
        assert all(change.ratio == pytest.approx(1.0) for change in found)
    changed = {one.engine: one for one in compare(base, with_times(base, {"mujoco": 1.5}, noise=0.02)).speed}
    assert 1.2 < changed["mujoco"].least < changed["mujoco"].ratio < changed["mujoco"].most < 1.6
    assert changed["candidate"].most < 1.0
    noisy = compare(base, with_times(base, {}, noise=0.5)).speed
    assert all(change.least < 1.2 and change.most > 1.0 for change in noisy)
