"""The gate: what is planted is found and named first, what has not changed never fails, and each change is put down to what changed."""

import datetime
import os
import re
import subprocess
import sys
import tomllib
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support import engines as made

import comparisons
import scenarios
from comparisons.engines.base import Engine
from comparisons.engines.registry import engine
from comparisons.measuring.metrics import Average
from comparisons.measuring.tolerances import tolerance
from comparisons.regressions.attribution import blame
from comparisons.regressions.baseline import Baseline, accept, load_baseline, write_baseline
from comparisons.regressions.checking import check
from comparisons.regressions.comparing import compare
from comparisons.regressions.history import history
from comparisons.regressions.speed import speed_changes
from comparisons.regressions.values import KEY, changes, figures
from scenarios import DropspinError

TODAY = datetime.date(2026, 3, 1)
SCENES = [scenarios.load(name) for name in ("drop-ball", "drop-ball-backspin", "drop-box-corner", "fall-spin", "spin-asymmetric")]
WITH_FLOOR = {"drop-ball", "drop-ball-backspin", "drop-box-corner"}
TURNING = {"drop-box-corner", "fall-spin", "spin-asymmetric"}


class Candidate(Engine):
    """An engine of a library under test, whose insides change from release to release while its name stays."""

    name = "candidate"
    inner = "document[rotation=rk4]"
    release = "1.0"

    def order_in(self, scene):
        return None

    def declines(self, scene):
        return engine(self.inner).declines(scene)

    def prepare(self, scene, dt):
        simulation = engine(self.inner).prepare(self.changed(scene), dt)
        simulation.settings = {"version": self.release, "rotation": self.inner}
        return simulation

    def changed(self, scene):
        return scene


class TooLively(Candidate):
    """1 % more restitution."""

    def changed(self, scene):
        if scene.floor is None:
            return scene
        return scene.model_copy(update={"floor": scene.floor.model_copy(update={"restitution": 1.01 * scene.floor.restitution})})


class WithoutGyroscopicTerm(Candidate):
    """The note's ω, which forgets the gyroscopic torque."""

    inner = "document"


class Euler(Candidate):
    """Semi-implicit Euler where there was Runge-Kutta."""

    inner = "document[rotation=gyroscopic]"


class NextRelease(Candidate):
    """The same, under another version."""

    release = "1.1"


class OnAnotherMachine(Candidate):
    """Rounds otherwise: the start, which everything follows from, is some ulp off."""

    def changed(self, scene):
        state = scene.initial_state
        return scene.starting_at(state * (1.0 + np.finfo(float).eps * np.where(np.arange(13) % 2, 1.0, -2.0)))

    def prepare(self, scene, dt):
        simulation = super().prepare(scene, dt)
        first, moved = scene.initial_state, simulation.record
        simulation.record = lambda steps, every=1: np.vstack([first, moved(steps, every)[1:]])
        simulation.state = lambda: first
        return simulation


@pytest.fixture(scope="module")
def before():
    """What was measured before anything was planted, by the engine under test and one beside it."""
    return comparisons.run(SCENES, [Candidate(), "mujoco"])


@pytest.fixture(scope="module")
def accepted(before):
    """Its figures, accepted."""
    return accept(before, Baseline(), "as it should be", TODAY)[0]


@cache
def rerun(kind, *others):
    return comparisons.run(SCENES, [kind(), *others])


def failing(checked):
    rows = checked.results.table
    return rows[(rows["kind"] == "baseline") & (rows["verdict"] == "failed")]


@pytest.mark.parametrize(
    ("planted", "scenes", "metrics"),
    [
        (TooLively, WITH_FLOOR, {"restitution_error"}),
        (WithoutGyroscopicTerm, TURNING, {"orientation_error"}),
        (Euler, TURNING, {"orientation_error"}),
    ],
    ids=["1 % restitution", "no gyroscopic term", "RK4 turned to Euler"],
)
def test_planted_regressions_fail_and_are_named_first(accepted, planted, scenes, metrics):
    """In the scenes that they are in and in no other; what is told first is what they are.

    Measured: the first is off by 1e5 (restitution), 1e9 (no term) and 1e9 (Euler) tolerances.
    """
    checked = check(rerun(planted), accepted)
    failed = failing(checked)
    assert set(failed["scene"]) == scenes
    assert set(failed["engine"]) == {"candidate"}
    assert failed["metric"].iloc[0] in metrics
    assert checked.changes["in_tolerances"].iloc[0] > 1e4
    assert checked.results.exit_code() == 1
    assert failed["reason"].iloc[0].startswith("accepted ")
    assert "2026-03-01, as it should be" in failed["reason"].iloc[0]


def test_gyroscopic_term_dropped_is_named_in_the_tumble_first(accepted):
    """Of two scenes in which it matters, the one that is about it."""
    for planted in (WithoutGyroscopicTerm, Euler):
        assert failing(check(rerun(planted), accepted))["scene"].iloc[0] == "spin-asymmetric"


def test_unchanged_engines_fail_nothing(before, accepted):
    """Run again: every figure the same to the last bit. On a machine that rounds otherwise: none beyond its tolerance."""
    again = rerun(Candidate, "mujoco")
    pd.testing.assert_frame_equal(figures(before), figures(again), check_exact=True)
    for found in (again, rerun(OnAnotherMachine)):
        checked = check(found, accepted)
        assert failing(checked).empty, failing(checked).to_string()
        assert set(checked.changes["change"]) == {"same"}
    elsewhere = figures(rerun(OnAnotherMachine)).merge(figures(before), on=KEY)
    assert (elsewhere["value_x"] != elsewhere["value_y"]).mean() > 0.3  # it does round otherwise


@pytest.mark.parametrize("seed", [0, 1])
def test_whether_a_corner_touches_fails_nothing(seed, monkeypatch):
    """A block on its corner, all starts an ulp away: rounding says of all whether they touch; measured 1.4 times what one phase may do."""
    block = scenarios.load("rock-block")
    accepted, _ = accept(comparisons.run([block], ["mujoco"], [2e-3]), Baseline(), "first", TODAY)
    exact = scenarios.Scenario.initial_state.fget
    moved = 1.0 + np.finfo(float).eps * np.random.default_rng(seed).uniform(-1.0, 1.0, 13)
    monkeypatch.setattr(scenarios.Scenario, "initial_state", property(lambda scene: exact(scene) * moved))
    checked = check(comparisons.run([block], ["mujoco"], [2e-3]), accepted)
    assert failing(checked).empty, failing(checked).to_string()
    assert checked.changes["in_tolerances"].abs().max() > 0.2  # it did say


@pytest.mark.slow
def test_twenty_repeats_on_a_loaded_machine_fail_nothing():
    """The default catalogue through MuJoCo and PyBullet, beside twice as many other processes at work as there are processors."""
    scenes = [scene for scene in map(scenarios.load, scenarios.names()) if "core" in scene.tags]
    engines = ["mujoco", "pybullet"]
    accepted, _ = accept(comparisons.run(scenes, engines), Baseline(), "first", TODAY)
    burners = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2 * (os.cpu_count() or 1))]
    try:
        for _ in range(20):
            checked = check(comparisons.run(scenes, engines), accepted)
            assert set(checked.changes["change"]) == {"same"}
            assert checked.results.exit_code() == 0
    finally:
        for burner in burners:
            burner.kill()
            burner.wait()


@given(
    st.floats(-1e3, 1e3),
    st.floats(-1e3, 1e3),
    st.floats(1e-12, 1.0),
    st.sampled_from(["truth", "invariant", "asymptotic_error", "order", "ensemble"]),
)
def test_what_counts_as_worse(old, new, tolerance, kind):
    """An error farther from 0, a lower order; moved is one on the other side of 0, or a mean; each by more than the tolerance."""

    def one(value):
        return pd.DataFrame([dict.fromkeys(KEY, "x") | {"kind": kind, "value": value, "tolerance": tolerance, "unit": "1"}])

    [change] = changes(one(old), one(new))["change"]
    if kind == "order":
        expected = "worse" if new < old - tolerance else "better" if new > old + tolerance else "same"
    elif kind == "ensemble":
        expected = "same" if old - tolerance <= new <= old + tolerance else "moved"
    elif not min(0.0, old) - tolerance <= new <= max(0.0, old) + tolerance:
        expected = "worse" if abs(new) > abs(old) + tolerance else "moved"
    else:
        expected = "better" if abs(new) < abs(old) - tolerance else "same"
    assert change == expected


def test_tolerances_come_from_how_a_figure_was_measured():
    """One start phase of four in the neighbouring step; rounding by steps and scale; nothing that is a share of the figure."""
    phases = np.array([[1.0, 5.0], [1.0, 5.4], [1.0, 5.4], [1.0, 5.4]])
    average = Average(phases.mean(axis=0), np.zeros(2), np.ptp(phases, axis=0) / 4)
    assert average.jump == pytest.approx(0.1)
    free, ball = scenarios.load("spin-asymmetric"), scenarios.load("drop-ball")
    eps = np.finfo(float).eps
    assert tolerance(free, "rad", np.float64, 900, 0.0) == pytest.approx(1e-12 + 16 * eps * 30, rel=1e-15)
    assert tolerance(free, "rad", np.float32, 900, 0.0) == pytest.approx(1e-12 + 16 * np.finfo(np.float32).eps * 30, rel=1e-15)
    assert tolerance(ball, "1", np.float64, 900, 0.25) == pytest.approx(0.25 + 3e-8 + 1e-12 + 16 * eps * 30, rel=1e-15)
    length = ball.body.size + np.linalg.norm(ball.start.position)
    assert tolerance(ball, "m", np.float64, 0, 0.0) == pytest.approx((3e-8 + 1e-12) * length, rel=1e-15)


def test_a_figure_from_one_start_is_held_to_what_rounding_makes_of_it(before):
    """The tumble's tolerance is what a start some ulp off leads to: far below its error, above rounding alone."""
    held = figures(before)
    tumble = held[(held["scene"] == "spin-asymmetric") & (held["metric"] == "orientation_error") & (held["kind"] == "truth")]
    assert (tumble["tolerance"] < 1e-9).all()  # measured 1e-11 to 1e-10
    assert (tumble["tolerance"] > 1e-12).all()


def test_accepted_figures_are_a_text_that_says_it_all(accepted, tmp_path):
    """Figure, tolerance, which acceptance; date, reason, versions; and read back it is the same."""
    write_baseline(accepted, tmp_path / "accepted.toml")
    text = (tmp_path / "accepted.toml").read_text()
    [acceptance] = tomllib.loads(text)["accepted"].values()
    assert acceptance["date"] == TODAY
    assert acceptance["reason"] == "as it should be"
    assert acceptance["versions"]["candidate"] == "1.0"
    assert {"dropspin", "numpy", "mujoco", "python"} <= set(acceptance["versions"])
    assert re.search(
        r'^figures\.drop-ball\.candidate\."0\.004"\.restitution_error = \{value = [-0-9.e]+, tolerance = [0-9.e-]+, by = "[0-9a-f]{7}"\}$',
        text,
        re.MULTILINE,
    )
    again = load_baseline(tmp_path / "accepted.toml")
    both = accepted.figures.merge(again.figures, on=KEY, how="outer", suffixes=("", "_read"))
    assert len(both) == len(accepted.figures) == len(again.figures)
    assert (abs(both["value"] - both["value_read"]) <= 1e-2 * both["tolerance"]).all()
    np.testing.assert_allclose(both["tolerance_read"], both["tolerance"], rtol=0.051)
    assert (both["unit"] == both["unit_read"]).all()
    write_baseline(again, tmp_path / "again.toml")
    assert (tmp_path / "again.toml").read_text() == text


def test_editors_of_other_systems(accepted, tmp_path):
    """A byte order mark, and lines that end as on Windows."""
    write_baseline(accepted, tmp_path / "accepted.toml")
    text = (tmp_path / "accepted.toml").read_text()
    (tmp_path / "edited.toml").write_bytes(("\ufeff" + text.replace("\n", "\r\n")).encode())
    pd.testing.assert_frame_equal(load_baseline(tmp_path / "edited.toml").figures, load_baseline(tmp_path / "accepted.toml").figures)


def test_only_what_has_moved_is_accepted_anew(before, accepted):
    """The rest keeps its value, its tolerance and its acceptance; figures that a run is not of stay; what is not used any more goes."""
    lively = rerun(TooLively)
    moved, found = accept(lively, accepted, "livelier on purpose", TODAY + datetime.timedelta(days=1))
    both = accepted.figures.merge(moved.figures, on=KEY, suffixes=("", "_now"))
    [first] = accepted.acceptances
    same = both["by_now"] == first
    assert (both.loc[same, "value"] == both.loc[same, "value_now"]).all()
    assert set(both.loc[~same, "scene"]) <= WITH_FLOOR
    assert (both.loc[both["engine"] == "mujoco", "by_now"] == first).all()  # which was not run
    assert int((~same).sum()) == int(found["change"].isin(["worse", "better", "moved"]).sum()) > 10
    assert failing(check(lively, moved)).empty
    # Going back is worse only where the wrong restitution had offset other errors.
    assert set(failing(check(before, moved))["scene"]) == {"drop-ball", "drop-box-corner"}
    back, _ = accept(before, moved, "a mistake", TODAY + datetime.timedelta(days=2))
    assert [one.reason for one in back.acceptances.values()].count("a mistake") == 1


def with_reasons(baseline):
    return [(row, baseline.acceptances[row["by"]].reason) for row in baseline.figures.to_dict("records")]


@pytest.mark.parametrize("numpy", ["1.0", "2.0", "3.0"])
def test_two_branches_may_each_accept_something(numpy, tmp_path):
    """Scenes, engines and moves; whatever git finds at one place, both sides stay, and each figure has its own reason."""

    def run(scenes, *engines):
        found = comparisons.run(scenes, engines, [4e-3])
        return replace(found, provenance={**found.provenance, "versions": {**found.provenance["versions"], "numpy": numpy}})

    ball, backspin, _, fall, tumble = SCENES
    base = accept(run([ball, fall], Candidate()), Baseline(), "base", TODAY)[0]
    ours = accept(run([ball, backspin], TooLively()), base, "livelier", TODAY)[0]
    theirs = accept(run([fall, tumble], Euler(), "mujoco"), base, "cheaper", TODAY)[0]
    for baseline, name in ((base, "base"), (ours, "ours"), (theirs, "theirs")):
        write_baseline(baseline, tmp_path / name)
    reasons = {}
    for one in (base, ours, theirs):  # what neither has moved is the base's in all three
        reasons |= {tuple(row[name] for name in KEY): by for row, by in with_reasons(one) if by != "base" or one is base}
    for mine, other in (("ours", "theirs"), ("theirs", "ours")):
        both = subprocess.run(["git", "merge-file", "-p", "--union", mine, "base", other], cwd=tmp_path, capture_output=True, check=True)
        (tmp_path / "merged").write_bytes(both.stdout)
        merged = load_baseline(tmp_path / "merged")
        assert {tuple(row[name] for name in KEY): by for row, by in with_reasons(merged)} == reasons
    assert set(reasons.values()) == {"base", "livelier", "cheaper"}


def test_accepting_the_same_again_changes_nothing(before, accepted):
    """Not even the date."""
    again, found = accept(before, accepted, "out of habit", TODAY + datetime.timedelta(days=9))
    assert set(found["change"]) == {"same"}
    assert again.acceptances == accepted.acceptances
    pd.testing.assert_frame_equal(again.figures.sort_values(KEY, ignore_index=True), accepted.figures.sort_values(KEY, ignore_index=True))


def test_a_changed_scene_is_said_once(before, accepted):
    """Its figures are not held against those of another scene."""
    higher = [scene.model_copy(update={"duration": 1.1 * scene.duration}) if scene.name == "fall-spin" else scene for scene in SCENES]
    checked = check(comparisons.run(higher, [Candidate()]), accepted)
    failed = failing(checked)
    assert list(failed["scene"]) == ["fall-spin"]
    assert "simulates something else" in failed["reason"].iloc[0]


class Broken(Candidate):
    """Crashes where there is a floor."""

    def changed(self, scene):
        if scene.floor is not None:
            raise RuntimeError("no floor today")
        return scene


class OneBadStart(Candidate):
    """Loses its restitution in one of 32 starts."""

    def changed(self, scene):
        if scene.floor is None or not 1.0e-3 < abs(scene.start.velocity[1]) < 1.3e-3:
            return scene
        return scene.model_copy(update={"floor": scene.floor.model_copy(update={"restitution": 0.1})})


def test_what_goes_wrong_does_not_widen_its_own_tolerance(accepted):
    """One start of 32 spreads the starts widely; what it is held to is how they were spread before."""
    checked = check(comparisons.run(SCENES[:1], [OneBadStart()]), accepted)
    assert "bounce_height_error" in set(failing(checked)["metric"])


def test_a_run_that_was_never_accepted_does_not_pass(accepted):
    """A gate that looks at nothing must not stay open; nor does a comparison of nothing say that nothing is worse."""
    elsewhere = comparisons.run(SCENES[:1], [Candidate()], [5e-3])
    with pytest.raises(DropspinError, match=r"none of the .* accepted figures is of this run"):
        check(elsewhere, accepted)
    with pytest.raises(DropspinError, match="no figure in common"):
        compare(rerun(Candidate, "mujoco"), elsewhere)


def test_what_broke_down_is_nothing_to_accept(accepted):
    """Its figures stay, so that the gate does not open for it; those of a scene that was changed go, for every engine."""
    kept, _ = accept(rerun(Broken), accepted, "a bad day", TODAY)
    assert set(kept.figures["scene"]) == set(accepted.figures["scene"])
    assert len(kept.figures) == len(accepted.figures)
    longer = [scene.model_copy(update={"duration": 1.1 * scene.duration}) for scene in SCENES if scene.name == "fall-spin"]
    moved, _ = accept(comparisons.run(longer, [Candidate()]), accepted, "longer", TODAY)
    of_scene = moved.figures[moved.figures["scene"] == "fall-spin"]
    assert set(of_scene["engine"]) == {"candidate"}
    assert {moved.acceptances[by].reason for by in of_scene["by"]} == {"longer"}


def test_figures_that_are_gone_fail(accepted):
    """One line for all that an engine did not measure, and the crash itself: exit code 3."""
    checked = check(rerun(Broken), accepted)
    failed = failing(checked)
    assert set(failed["scene"]) == WITH_FLOOR
    assert len(failed) == 3 * len(WITH_FLOOR)  # one for each step; what all steps together give is told with them
    assert failed["reason"].str.contains("accepted figures are gone, crashed: RuntimeError: no floor today").all()
    assert checked.results.exit_code() == 3


def named(results, **names):
    return replace(results, provenance={**results.provenance, "names": names, "named": list(names.values())})


class Renamed(TooLively):
    """Calls itself otherwise."""

    name = "renamed"


def test_an_engine_is_known_by_what_it_is_asked_for_by(tmp_path, monkeypatch):
    """One that cannot be imported any more has lost its figures, and one that calls itself otherwise has not got rid of them."""
    ball = SCENES[:1]
    base = accept(named(comparisons.run(ball, [Candidate()], [4e-3]), candidate="m:C"), Baseline(), "first", TODAY)[0]
    assert base.engines == {"candidate": "m:C"}
    renamed = named(comparisons.run(ball, [Renamed()], [4e-3]), renamed="m:C")
    worse = failing(check(renamed, base))
    assert set(worse["engine"]) == {"renamed"}
    assert "restitution_error" in set(worse["metric"])
    assert failing(check(renamed, accept(renamed, base, "so it is called", TODAY)[0])).empty
    (tmp_path / "lost_engine.py").write_text("import no_such_library")
    monkeypatch.syspath_prepend(tmp_path)
    missing = comparisons.run(ball, ["lost_engine:C"], [4e-3])
    lost = check(missing, replace(base, engines={"candidate": "lost_engine:C"}))
    assert failing(lost)["reason"].str.match("^[0-9]+ accepted figures are gone, missing: ").all()
    assert lost.not_run.empty
    with pytest.raises(DropspinError, match="none of the"):
        check(missing, base)
    assert check(named(missing, **{"lost_engine:C": "lost_engine:C"}), base).results.exit_code() == 3


def test_what_was_not_run_is_neither_passed_nor_failed(accepted):
    """But counted."""
    checked = check(comparisons.run(SCENES[:1], ["mujoco"]), accepted)
    assert set(checked.changes["scene"]) == {"drop-ball"}
    assert failing(checked).empty
    assert len(checked.not_run) + len(checked.changes) == len(accepted.figures)


def test_known_failures_do_not_fail_until_they_get_worse():
    """A check that fails is accepted as known; then only a figure that gets worse fails it."""
    harsh = {"metric": "penetration", "below": 1e-9, "reason": "none is that stiff"}
    scene = scenarios.load(scenarios.load("drop-ball").model_dump(exclude={"expect"}, exclude_none=True) | {"expect": [harsh]})
    found = comparisons.run([scene], [Candidate()])
    assert found.exit_code() == 1
    plain, _ = accept(found, Baseline(), "first", TODAY)
    assert check(found, plain).results.exit_code() == 1
    known, _ = accept(found, plain, "first", TODAY, known_failures=True)
    checked = check(found, known)
    assert checked.results.exit_code() == 0
    [row] = checked.results.table.query("verdict == 'limited' and dt == 0.001").to_dict("records")
    assert row["reason"] == "accepted as a known failure; none is that stiff"
    worse = replace(found, table=found.table.assign(value=found.table["value"].where(found.table["metric"] != "penetration", 0.5)))
    assert check(worse, known).results.exit_code() == 1
    crashed, lost = accept(comparisons.run([scene], [Broken()]), known, "a bad day", TODAY, known_failures=True)
    assert lost.empty
    assert check(found, crashed).results.exit_code() == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("format = 2", "format = 1"), "format: got 1"),
        (lambda text: re.sub(r'by = "\w+"', 'by = "7"', text, count=1), "by: got '7'; accepted are "),
        (lambda text: text.replace(".restitution_error =", ".restitution_eror =", 1), "Did you mean 'restitution_error'?"),
        (lambda text: text.replace("tolerance = ", "tolerance = -", 1), "tolerance: got -"),
        (lambda text: text.replace("value = ", "valeu = ", 1), "missing; it has no default"),
        (lambda text: re.sub(r"value = [^,]+,", "value = nan,", text, count=1), "value: got nan"),
        (lambda text: text.replace('"0.004"', '"4e-3"', 1), "write it as '0.004'"),
        (lambda text: text.replace('"0.004"', '"fast"', 1), "'fast' is no step"),
        (
            lambda text: text.replace("scenes.drop-ball =", "scene.drop-ball ="),
            "scene: unknown key. Allowed: format, accepted, engines, scenes",
        ),
        (lambda text: re.sub("^scenes.drop-ball.*$", "", text, flags=re.MULTILINE), "scenes: 'drop-ball' has figures, but no digest"),
        (lambda text: text.replace(", versions = ", ", version = ", 1), "accepted.KEY: versions: missing"),
        (lambda text: text + text.splitlines()[-1], "accepted.toml: not TOML: Cannot overwrite a value"),
        (lambda text: text[: len(text) // 2], "accepted.toml: "),
        (lambda text: text.replace("figures.", "figures..", 1), "accepted.toml: "),
        (lambda text: "", "missing"),
    ],
    ids=[
        "format",
        "acceptance",
        "metric",
        "tolerance",
        "key",
        "nan",
        "step",
        "no step",
        "scene",
        "digest",
        "versions",
        "twice",
        "cut",
        "dots",
        "empty",
    ],
)
def test_bad_baselines_are_refused(accepted, change, message, tmp_path):
    """With the file, the place in it, what was given, and what is allowed."""
    write_baseline(accepted, tmp_path / "accepted.toml")
    (tmp_path / "accepted.toml").write_text(change((tmp_path / "accepted.toml").read_text()))
    with pytest.raises(DropspinError) as told:
        load_baseline(tmp_path / "accepted.toml")
    [key] = accepted.acceptances  # a hash, of the versions of libraries too
    assert message.replace("KEY", key) in str(told.value)
    assert "\n" not in str(told.value)


STAMP = {
    "versions": {"dropspin": "1", "numpy": "2", "numba": "3", "scipy": "4"},
    "python": "3.11.7",
    "cpu": "A",
    "platform": "Linux",
    "code": "c",
    "adapters": {"candidate": "a"},
    "settings": {"candidate": {"drop-ball dt=0.001": {"version": "1.0", "solref": 1}}},
}


@pytest.mark.parametrize(
    ("now", "unmoved", "culprit", "said"),
    [
        ({}, [], "nothing", "not deterministic"),
        (
            {"settings": {"candidate": {"drop-ball dt=0.001": {"version": "1.1", "solref": 1}}}},
            [],
            "engine",
            "the engine's: candidate 1.0 → 1.1",
        ),
        ({"settings": {"candidate": {"drop-ball dt=0.001": {"version": "1.0", "solref": 2}}}}, [], "settings", "its settings (solref)"),
        ({"adapters": {"candidate": "b"}}, [], "adapter", "the code of candidate's adapter"),
        ({"cpu": "B"}, [], "surroundings", "not the engine's: processor A → B"),
        ({"code": "d"}, [], "surroundings", "dropspin's own code"),
        ({"cpu": "B", "adapters": {"candidate": "b"}}, ["other"], "adapter", "the figures of other are the same"),
        ({"cpu": "B", "adapters": {"candidate": "b"}}, [], "either", "cannot be told"),
    ],
)
def test_changes_are_put_down_to_what_differs(now, unmoved, culprit, said):
    """To the engine before its adapter before its settings; to surroundings only where no witness speaks against it."""
    found = blame(STAMP, STAMP | now, "candidate", unmoved)
    assert found.culprit == culprit
    assert said in found.said


def test_comparing_two_runs(before):
    """A new release that changes nothing; one that drops a term: whose it is, what got worse, and the engine beside it unmoved."""
    same = compare(before, rerun(NextRelease, "mujoco"))
    assert set(same.figures["change"]) == {"same"}
    assert not same.blames
    dropped = type("NextRelease", (NextRelease,), {"inner": WithoutGyroscopicTerm.inner})
    found = compare(before, rerun(dropped, "mujoco"))
    assert set(found.blames) == {"candidate"}
    assert found.blames["candidate"].culprit == "engine"
    assert "candidate 1.0 → 1.1" in found.blames["candidate"].said
    assert set(found.regressions["scene"]) == TURNING
    back = compare(rerun(dropped, "mujoco"), before)
    assert set(back.of("better")["engine"]) == {"candidate"}


def test_runs_that_were_asked_for_different_things(before):
    """What only one of them has is said, and is neither new nor gone."""
    part = comparisons.run(SCENES[:2], [Candidate()], [4e-3, 2e-3, 1e-3, 5e-4])
    found = compare(before, part)
    assert set(found.figures["change"]) == {"same"}
    assert found.in_one_only == [
        "scene drop-box-corner (gone)",
        "scene fall-spin (gone)",
        "scene spin-asymmetric (gone)",
        "engine mujoco (gone)",
        "step 0.0005 s (new)",
    ]


def with_times(results, factors, noise=0.0):
    """The run, each engine's steps longer by its factor."""
    draw = np.random.default_rng(0)
    frame = results.table.copy()
    frame["time_per_step"] *= frame["engine"].map(factors).fillna(1.0) * np.exp(noise * draw.normal(size=len(frame)))
    return replace(results, table=frame)


def test_speed_is_told_by_ratios(before):
    """A slower machine slows all alike and is nobody's fault; one slower engine is named, and not the one beside it."""
    base = with_times(before, {})
    for factor in (0.5, 1.0, 3.0):
        assert all(
            change.ratio == pytest.approx(1.0) for change in speed_changes(base, with_times(base, dict.fromkeys(base.engines, factor)))
        )
    found = compare(base, with_times(base, {"mujoco": 1.5}, noise=0.02))
    assert [change.engine for change in found.slower(0.2)] == ["mujoco"]
    assert not found.slower(0.6)
    noisy = compare(base, with_times(base, {}, noise=0.5))
    assert not noisy.slower(0.2)


def test_history_finds_the_run_in_which_figures_moved(before):
    """And what for; engines that did not run in between are followed past it."""
    later = [
        rerun(NextRelease),
        comparisons.run(SCENES[:1], ["mujoco", Broken()]),
        rerun(type("Changed", (NextRelease,), {"inner": Euler.inner, "release": "2.0"})),
    ]
    runs = {
        name: replace(one, provenance={**one.provenance, "started": f"2026-01-0{day}"})
        for day, (name, one) in enumerate(zip(["a", "b", "c", "d"], [before, *later], strict=True), start=1)
    }
    found = history(dict(reversed(runs.items())))
    assert found.names == ["a", "b", "c", "d"]
    [move] = found.moves
    assert (move.engine, move.before, move.run) == ("candidate", 1, 3)
    assert move.blame.culprit == "engine"
    assert "candidate 1.1 → 2.0" in move.blame.said
    assert set(move.figures["scene"]) >= TURNING
    with pytest.raises(DropspinError, match="takes two runs"):
        history({"a": before})


def test_a_scene_that_was_changed_while_an_engine_was_away_moves_nothing():
    """The figures of what it was before are no one's any more."""
    scene = scenarios.load("fall-spin")
    longer = scene.model_copy(update={"duration": 1.1 * scene.duration})
    runs = [
        comparisons.run([one], engines, [4e-3])
        for one, engines in ((scene, [Candidate(), "mujoco"]), (longer, ["mujoco"]), (longer, [Candidate(), "mujoco"]))
    ]
    assert not history(
        {str(day): replace(one, provenance={**one.provenance, "started": f"2026-01-0{day}"}) for day, one in enumerate(runs, 1)}
    ).moves
    with pytest.raises(DropspinError, match="fall-spin: another scene now, of the same name"):
        compare(runs[0], runs[1])


def test_engines_that_are_exact_are_held_to_rounding():
    """An attitude that is wrong by 1e-11 rad fails what was accepted of one that is exact."""
    scene = [scenarios.load("spin-principal")]
    exact, _ = accept(comparisons.run(scene, [made.engine_with("made", lambda state, time: state)]), Baseline(), "exact", TODAY)
    off = check(comparisons.run(scene, [made.engine_with("made", made.turned_by(1e-10))]), exact)
    assert set(failing(off)["metric"]) == {"orientation_error"}
