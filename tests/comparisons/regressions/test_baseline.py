"""Baselines: the text file, what accepting changes in it, and what is refused."""

import datetime
import re
import subprocess
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from support.releases import SCENES, TODAY, WITH_FLOOR, Broken, Candidate, Euler, TooLively, failing, part

from dropspin.comparisons.regressions.baseline import Baseline, load_baseline, write_baseline
from dropspin.comparisons.regressions.changes import KEY
from dropspin.comparisons.regressions.checking import accept, check, redefined
from dropspin.reports.stories.check import accepted_sentences
from dropspin.scenarios import DropspinError


@pytest.fixture(scope="module")
def text(accepted, tmp_path_factory):
    """The baseline as it is written."""
    path = tmp_path_factory.mktemp("baseline") / "accepted.toml"
    write_baseline(accepted, path)
    return path.read_text()


def test_baseline_is_read_as_it_was_written(before, accepted, text, tmp_path):
    """Value, tolerance and acceptance of each result; date, reason, versions and processor of each acceptance."""
    [acceptance] = tomllib.loads(text)["accepted"].values()
    assert acceptance["date"] == TODAY
    assert acceptance["reason"] == "first measured"
    assert acceptance["versions"]["candidate"] == "1.0"
    assert acceptance["cpu"] == before.provenance["cpu"]
    assert {"dropspin", "numpy", "mujoco", "python"} <= set(acceptance["versions"])
    line = r' = \{value = [-0-9.e]+, tolerance = [0-9.e-]+, by = "[0-9a-f]{7}"\}$'
    for name in (
        r'"0\.004"\.restitution_error',
        r'"0\.008, 0\.004, 0\.002"\.restitution_error_order',
        r'"0\.008, 0\.004, 0\.002"\.restitution_error_asymptotic_error',
    ):
        assert re.search(rf"^results\.drop-ball\.mujoco\.{name}{line}", text, re.MULTILINE), name
    (tmp_path / "accepted.toml").write_text(text)
    again = load_baseline(tmp_path / "accepted.toml")
    both = accepted.results.merge(again.results, on=KEY, how="outer", suffixes=("", "_read"))
    assert len(both) == len(accepted.results) == len(again.results)
    assert (abs(both["value"] - both["value_read"]) <= 1e-2 * both["tolerance"]).all()
    np.testing.assert_allclose(both["tolerance_read"], both["tolerance"], rtol=0.051)
    assert (both["unit"] == both["unit_read"]).all()
    write_baseline(again, tmp_path / "again.toml")
    assert (tmp_path / "again.toml").read_text() == text


def test_file_is_taken_in_place_of_a_baseline_and_a_wrong_reason_is_named(release, text, tmp_path):
    path = tmp_path / "accepted.toml"
    path.write_text(text)
    assert check(release(Candidate), str(path)).changes.equals(check(release(Candidate), load_baseline(path)).changes)
    for reason, problem in (("", "must have at least 1 item, has 0"), ("two\nlines", "must be one line of printable text")):
        with pytest.raises(DropspinError, match=f"reason: got .*{problem}"):
            accept(release(Candidate), Baseline(), reason, TODAY)


def test_example_in_the_documentation_is_read(tmp_path):
    page = Path(__file__).parents[3] / "docs" / "gate.md"
    (tmp_path / "example.toml").write_text(page.read_text(encoding="utf-8").split("```toml\n")[1].split("```")[0])
    example = load_baseline(tmp_path / "example.toml")
    [result] = example.results.to_dict("records")
    assert (result["scene"], result["engine"], result["steps"], result["metric"]) == ("drop-ball", "mujoco", "0.001", "restitution_error")
    assert example.acceptances[result["by"]].reason == "first measured"


def test_byte_order_mark_and_windows_line_ends_are_read(text, tmp_path):
    (tmp_path / "accepted.toml").write_text(text)
    (tmp_path / "edited.toml").write_bytes(("\ufeff" + text.replace("\n", "\r\n")).encode())
    pd.testing.assert_frame_equal(load_baseline(tmp_path / "edited.toml").results, load_baseline(tmp_path / "accepted.toml").results)


def test_only_results_that_moved_are_replaced(before, release, accepted):
    """The others keep value, tolerance and acceptance; results that the run does not cover stay; unused acceptances are removed."""
    moved, found = accept(release(TooLively), accepted, "livelier on purpose", TODAY + datetime.timedelta(days=1))
    both = accepted.results.merge(moved.results, on=KEY, suffixes=("", "_now"))
    [first] = accepted.acceptances
    same = both["by_now"] == first
    assert (both.loc[same, "value"] == both.loc[same, "value_now"]).all()
    assert set(both.loc[~same, "scene"]) <= WITH_FLOOR
    assert (both.loc[both["engine"] == "mujoco", "by_now"] == first).all()  # which was not run
    assert int((~same).sum()) == int(found["change"].isin(["worse", "better", "moved"]).sum()) > 10
    assert failing(check(release(TooLively), moved)).empty
    # Going back is worse only where the wrong restitution had offset other errors.
    assert set(failing(check(before, moved))["scene"]) == {"drop-ball", "drop-box-corner"}
    back, _ = accept(before, moved, "a mistake", TODAY + datetime.timedelta(days=2))
    assert [one.reason for one in back.acceptances.values()].count("a mistake") == 1


def test_accepting_the_same_results_changes_nothing(before, accepted):
    """Not even the date."""
    again, found = accept(before, accepted, "out of habit", TODAY + datetime.timedelta(days=9))
    assert set(found["change"]) == {"same"}
    assert again.acceptances == accepted.acceptances
    pd.testing.assert_frame_equal(again.results.sort_values(KEY, ignore_index=True), accepted.results.sort_values(KEY, ignore_index=True))


def test_results_of_engines_that_broke_down_stay(release, accepted):
    """So that the check does not pass for them from then on."""
    kept, _ = accept(release(Broken), accepted, "a bad day", TODAY)
    assert set(kept.results["scene"]) == set(accepted.results["scene"])
    assert len(kept.results) == len(accepted.results)


def test_results_of_a_changed_scene_are_replaced_for_every_engine(longer_fall, accepted):
    """The results of other engines in this scene are removed, and this is said."""
    alone = part(longer_fall, engines=["candidate"])
    assert redefined(alone, accepted) == ["fall-spin"]
    moved, found = accept(alone, accepted, "longer", TODAY)
    of_scene = moved.results[moved.results["scene"] == "fall-spin"]
    assert set(of_scene["engine"]) == {"candidate"}
    assert {moved.acceptances[by].reason for by in of_scene["by"]} == {"longer"}
    removed = accepted.results.query("scene == 'fall-spin' and engine != 'candidate'")
    [said] = [sentence for sentence in accepted_sentences(alone, found, known_failures=False) if "removed" in sentence]
    assert said.startswith(f"{len(removed)} accepted results are removed, because the scene has changed and this run does not cover them: ")
    assert "fall-spin with mujoco" in said
    [other] = [text for text in accepted_sentences(alone, found, False, redefined(alone, accepted)) if "definition" in text]
    assert other == "The definition has changed of fall-spin: the results accepted before are replaced, not compared."
    assert redefined(alone, moved) == []


def test_result_that_another_definition_does_not_have_is_gone(longer_fall, accepted):
    """An engine and a metric that were accepted with the earlier one, and that the run covers."""
    less = replace(longer_fall, table=longer_fall.table[longer_fall.table["metric"] != "energy_drift"])
    _, found = accept(less, accepted, "longer", TODAY)
    gone = found[found["change"] == "gone"]
    assert set(gone["metric"]) == {"energy_drift"}
    assert set(gone["scene"]) == {"fall-spin"}


def test_scenes_of_older_files_are_those_of_every_acceptance(accepted, tmp_path):
    write_baseline(accepted, tmp_path / "new.toml")
    older = re.sub(r"^scenes\.\w+\.", "scenes.", (tmp_path / "new.toml").read_text(), flags=re.MULTILINE)
    (tmp_path / "old.toml").write_text(older)
    assert load_baseline(tmp_path / "old.toml").scenes == load_baseline(tmp_path / "new.toml").scenes


def test_merge_of_two_definitions_of_a_scene_is_seen(before, longer_fall, tmp_path):
    """One branch accepts another engine, the other branch changes the scene: the results of each are compared with their own scene."""
    base = accept(part(before, engines=["candidate"]), Baseline(), "first", TODAY)[0]
    mine = accept(part(before, engines=["mujoco"]), base, "MuJoCo too", TODAY)[0]
    theirs = accept(part(longer_fall, engines=["candidate"]), base, "longer", TODAY)[0]
    added = mine.results[mine.results["engine"] == "mujoco"]
    table = pd.concat([theirs.results, added], ignore_index=True)
    merged = Baseline({**mine.acceptances, **theirs.acceptances}, {}, {**mine.scenes, **theirs.scenes}, {}, table)
    write_baseline(merged, tmp_path / "merged.toml")
    judged = check(longer_fall, tmp_path / "merged.toml").results.table.query("kind == 'baseline'")
    assert set(judged.query("engine == 'candidate'")["verdict"]) == {"passed"}
    assert [*judged.query("engine == 'mujoco'")["basis"]] == ["scene_changed"]


def with_reasons(baseline):
    return [(row, baseline.acceptances[row["by"]].reason) for row in baseline.results.to_dict("records")]


@pytest.mark.extended
@pytest.mark.parametrize("numpy", ["1.0", "2.0", "3.0"])
def test_union_merge_keeps_what_two_branches_accepted(release, numpy, tmp_path):
    """Scenes, engines and moves: wherever git finds a conflict both sides stay, and each result keeps its own reason."""

    def run(kind, scenes, *others):
        found = part(release(kind, *others), *scenes, dt=4e-3)
        return replace(found, provenance={**found.provenance, "versions": {**found.provenance["versions"], "numpy": numpy}})

    ball, backspin, _, fall, tumble = (scene.name for scene in SCENES)
    base = accept(run(Candidate, [ball, fall]), Baseline(), "base", TODAY)[0]
    ours = accept(run(TooLively, [ball, backspin]), base, "livelier", TODAY)[0]
    theirs = accept(run(Euler, [fall, tumble], "mujoco"), base, "cheaper", TODAY)[0]
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


def test_equal_lines_below_different_headings_are_different_results(accepted, tmp_path):
    write_baseline(accepted, tmp_path / "flat.toml")
    lines = [line for line in (tmp_path / "flat.toml").read_text().splitlines() if line and line[0] != "#"]
    headed = [line for line in lines if not line.startswith("results.")]
    for line in lines:
        if line.startswith("results."):
            path, value = line.split(" = ", 1)
            table, _, metric = path.rpartition(".")
            headed += [f"[{table}.{metric}]", *re.sub(r"^\{|\}$", "", value).split(", ")]
    (tmp_path / "headed.toml").write_text("\n".join(headed))
    assert len(load_baseline(tmp_path / "headed.toml").results) == len(accepted.results)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: re.sub(r'by = "\w+"', 'by = "7"', text, count=1), "by: got '7'; accepted are "),
        (lambda text: text.replace(".restitution_error =", ".restitution_eror =", 1), "Did you mean 'restitution_error'?"),
        (lambda text: text.replace("tolerance = ", "tolerance = -", 1), "tolerance: got -"),
        (lambda text: text.replace("value = ", "valeu = ", 1), "valeu: unknown key. Allowed: "),
        (lambda text: re.sub(r"value = [^,]+,", "value = nan,", text, count=1), "value: got nan"),
        (lambda text: text.replace('"0.004"', '"4e-3"', 1), "write it as '0.004'"),
        (lambda text: text.replace('"0.004"', '"fast"', 1), "'fast' is not a time step or a list of them; write seconds, such as '0.004'."),
        (
            lambda text: re.sub(r"^scenes(\.\w+\.drop-ball) =", r"scene\1 =", text, flags=re.MULTILINE),
            "scene: unknown key. Allowed: format, accepted, engines, scenes, motions, results",
        ),
        (lambda text: re.sub(r"(?m)^scenes\.\w+\.drop-ball =.*$", "", text), "scenes.KEY: 'drop-ball' has results, but no hash"),
        (lambda text: text.replace(", versions = ", ", version = ", 1), "accepted.KEY: version: unknown key. "),
        (
            lambda text: text + text.splitlines()[-1].replace("tolerance = ", "tolerance = 1"),
            "accepted.toml: not TOML: Cannot overwrite a value",
        ),
        (lambda text: text[: len(text) // 2], "accepted.toml: "),
        (lambda text: text.replace("results.", "results..", 1), "accepted.toml: "),
        (lambda text: "", "format: missing"),
    ],
    ids=[
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
def test_invalid_baselines_are_refused(accepted, text, change, message, tmp_path):
    """In one line, with the file, the place in it, what was given, and what is allowed."""
    (tmp_path / "accepted.toml").write_text(change(text))
    with pytest.raises(DropspinError) as error:
        load_baseline(tmp_path / "accepted.toml")
    [key] = accepted.acceptances  # a hash, of the versions of libraries too
    assert message.replace("KEY", key) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("content", "writer"),
    [
        ('format = 2\n[accepted]\na.versions = {dropspin = "0.0.9"}\nb.versions = {dropspin = "0.0.8"}', "dropspin 0.0.8, dropspin 0.0.9"),
        ('format = 2\nfigures.drop-ball.mujoco."0.004".energy_error = {value = 1.0}', "another version of dropspin"),
        ("format = 2\naccepted = 7", "another version of dropspin"),
        ("format = 2\naccepted.a = 7", "another version of dropspin"),
    ],
)
def test_other_formats_are_refused_with_the_version_that_wrote_them(content, writer, tmp_path):
    (tmp_path / "old.toml").write_text(content)
    with pytest.raises(DropspinError) as error:
        load_baseline(tmp_path / "old.toml")
    assert str(error.value) == (
        f"{tmp_path / 'old.toml'}: format 2, written by {writer}, cannot be read; this version reads format 3. "
        "Accept the results again into a new file."
    )
