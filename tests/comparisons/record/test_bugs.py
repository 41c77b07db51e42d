"""The public reports: their list, the verdict from rows, and one case as a process."""

import json
import sys
from itertools import pairwise
from pathlib import Path
from threading import Event
from types import SimpleNamespace

import pandas as pd
import pytest
from support.cli import dropspin

from dropspin.comparisons.engines.packages import numbers_of, version
from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.record.bugs import FILE, Bug, Outcome, Verdict, load_bugs, measure, prepare, state_of, verdict
from dropspin.comparisons.record.environments import run
from dropspin.comparisons.record.plan import load_plan
from dropspin.reports.document import Paragraph
from dropspin.reports.stories.bugs import KnownBugs
from dropspin.scenarios import UnknownName, load

BUG = Bug(name="a", reference="", year=2020, kind="", symptom="", label="wang", fault=(-0.97, -0.95), sound=1e-3, releases=("1.0", "1.1"))


def outcomes(*states):
    return [Outcome(release=f"1.{number}", state=state) for number, state in enumerate(states)]


@pytest.mark.parametrize(
    ("value", "state"),
    [
        (-0.96, "shown"),
        (0.96, "another value"),
        (-0.9, "another value"),
        (5e-4, "not shown"),
        (-5e-4, "not shown"),
        (float("nan"), "another value"),
    ],
)
def test_a_value_shows_the_fault_only_within_its_closed_form(value, state):
    assert state_of(BUG, value) == state


@pytest.mark.parametrize(
    ("value", "right", "state"),
    [(0.184, 1.5e-3, "shown"), (0.170, 0.170, "another value"), (0.184, float("nan"), "another value"), (1.5e-3, 1.5e-3, "not shown")],
)
def test_friction_that_is_too_weak_in_every_direction_does_not_depend_on_the_direction(value, right, state):
    """With 0.9 times the friction both boxes slide 1.53 m (1/0.9 - 1) = 0.17 m too far, and one value alone is within the range."""
    assert state_of(*load_bugs(["pybullet-friction-by-direction"]), value, right) == state


@pytest.mark.parametrize(
    ("states", "expected"),
    [
        (["shown"], Verdict("shown")),
        (["not shown", "shown"], Verdict("shown")),
        (["shown", "shown", "not shown"], Verdict("fixed", "1.2")),
        (["shown", "not shown", "not shown"], Verdict("fixed", "1.1")),
        (["shown", "another value"], Verdict("not shown")),
        (["not shown", "shown", "another value", "not shown"], Verdict("fixed", "1.3")),
        (["not shown"], Verdict("not shown")),
        (["another value"], Verdict("not shown")),
        (["shown", "not run"], Verdict("not run")),
        ([], Verdict("not run")),
    ],
)
def test_the_verdict_is_made_of_what_the_releases_did(states, expected):
    assert verdict(BUG, outcomes(*states)) == expected


def test_a_report_that_no_scene_can_show_says_why():
    bug = BUG.model_copy(update={"why_not": "no adapter"})
    assert verdict(bug, []).kind == "not expressible"


def test_the_list_has_links_scenes_metrics_and_releases_that_exist():
    bugs, plan = load_bugs(), load_plan()
    page = (Path(__file__).parents[3] / "docs/known-bugs.md").read_text(encoding="utf-8")
    assert [bug.name for bug in bugs if f"## {bug.name}: {bug.kind}\n" not in page] == []
    assert len({bug.reference for bug in bugs}) == len(bugs)
    for bug in bugs:
        assert bug.reference.startswith("https://"), bug.name
        assert 2015 <= bug.year <= 2026, bug.name
        assert bool(bug.label) != bool(bug.why_not), bug.name
        if bug.label:
            load(bug.arguments[1])
            assert bug.metric in METRICS
            assert bug.engine in plan.engines
            assert all(numbers_of(one) < numbers_of(other) for one, other in pairwise(bug.releases)), bug.name
            assert state_of(bug, sum(bug.fault) / 2, right=0.0) == "shown", bug.name
            assert state_of(bug, 0.0, right=0.0) == "not shown", bug.name
            least, most = bug.fault
            shown = page.partition(f"## {bug.name}: ")[2].partition("\n## ")[0]
            assert f" | {least:g} to {most:g} | ± {bug.sound:g} | " in shown, bug.name
            assert f"`{bug.command}`" in shown, bug.name
            assert bug.is_of_catalogue or bug.silent, bug.name
    used = {bug.scene for bug in bugs if bug.label and not bug.is_of_catalogue}
    assert {path.name for path in FILE.with_name("bugs").iterdir()} == used
    with pytest.raises(UnknownName, match="pybullet-speed-limit"):
        load_bugs(["pybullet-sped-limit"])


def test_a_release_without_an_environment_costs_its_own_row(tmp_path):
    bug = load_bugs(["pybullet-speed-limit"])[0].model_copy(update={"releases": ("0.0.1",)})
    done = []
    found = measure([bug], tmp_path, jobs=1, on_done=lambda *one: done.append(one))
    assert [outcome.state for outcome in found[bug.name]] == ["not run"]
    assert "dropspin bugs pybullet-speed-limit --prepare" in found[bug.name][0].said
    assert len(done) == 1


def test_an_environment_that_cannot_be_made_is_named_and_not_kept(tmp_path, monkeypatch):
    monkeypatch.setattr("dropspin.comparisons.record.environments.run", lambda command, stopping: (1, "ERROR: no such release"))
    bug, messages = load_bugs(["mujoco-rk4-second-order"])[0].model_copy(update={"releases": ("0.0.1",)}), []
    prepare([bug], tmp_path, messages.append)
    assert messages == ["mujoco 0.0.1: not installable: no such release"]
    assert measure([bug], tmp_path, jobs=1, on_done=lambda *one: None)[bug.name][0].state == "not run"


@pytest.mark.parametrize(("broken", "other"), [("slide-box-askew", "slide-box"), ("slide-box", "slide-box-askew")])
def test_a_breakdown_in_either_scene_is_no_other_value(broken, other, tmp_path, monkeypatch):
    """The reason is that of the scene that broke down, beside one that has a value."""
    [bug] = load_bugs(["pybullet-friction-by-direction"])
    rows = [
        {"scene": other, "metric": bug.metric, "kind": "truth", "value": 1e-3, "reason": "of the other scene"},
        {"scene": broken, "metric": "", "kind": "", "value": float("nan"), "reason": "crashed: no such option"},
    ]
    monkeypatch.setattr("dropspin.comparisons.record.bugs._python", lambda *release: "python")
    monkeypatch.setattr("dropspin.comparisons.record.bugs.run", lambda command, stopping: (3, ""))
    monkeypatch.setattr("dropspin.comparisons.record.bugs.load_results", lambda *where, arrays: SimpleNamespace(table=pd.DataFrame(rows)))
    for outcome in measure([bug], tmp_path, jobs=1, on_done=lambda *one: None)[bug.name]:
        assert (outcome.state, outcome.said) == ("not run", "crashed: no such option")


def test_output_that_is_parsed_has_no_colours_and_all_characters(monkeypatch):
    """Workflows of GitHub often force colours; the failures of a run begin with a mark that ASCII lacks."""
    for name, value in {"FORCE_COLOR": "1", "PYTHONIOENCODING": "ascii:replace", "TTY_COMPATIBLE": "1"}.items():
        monkeypatch.setenv(name, value)
    program = "from rich.console import Console; Console().print('✗ failed', style='bold red')"
    assert run([sys.executable, "-c", program], Event()) == (0, "✗ failed\n")


@pytest.mark.extended
def test_a_bug_is_shown_by_the_installed_release(tmp_path):
    """The release that is installed needs no environment."""
    assert version("pybullet") in load_bugs(["pybullet-speed-limit"])[0].releases
    done = dropspin("bugs", "pybullet-speed-limit", "avian-gyroscopic-explosion", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    first, second = json.loads(done.stdout)
    assert first["value"] == pytest.approx(-0.96, abs=1e-9)
    assert (first["verdict"], first["state"]) == ("shown", "shown")
    assert first["said"].startswith("spin-principal-500 · pybullet")
    assert second["verdict"].startswith("not expressible: ")
    page = (tmp_path / "out/bugs/bugs.md").read_text(encoding="utf-8")
    assert "issues/1890" in page


@pytest.mark.extended
def test_a_case_has_the_value_of_the_scene_that_the_fault_leaves_right(tmp_path):
    done = dropspin("bugs", "pybullet-friction-by-direction", "--json", cwd=tmp_path)
    [row] = json.loads(done.stdout)
    assert row["state"] == "shown"
    assert row["value"] == pytest.approx(0.184, abs=5e-4)
    assert row["right"] == pytest.approx(1.5e-3, rel=0.01)
    page = (tmp_path / "out/bugs/bugs.md").read_text(encoding="utf-8")
    assert "| 0.184 | 0.1 to 0.3 | ± 0.01 | 1.50e-03 | shown |" in page


def test_report_of_which_some_releases_were_run_tells_what_they_show():
    page = KnownBugs(bugs=[BUG.model_copy(update={"metric": "energy_error"})], outcomes={"a": outcomes("shown", "not run")})
    [row, *_] = page.rows()
    assert row["verdict"] == "1.0 shown; 1.1 not run"
    assert page.document().parts[-1] == Paragraph(
        "1 case: 0 shown (of these, 0 fixed in a later release and 0 detected by a check of the catalogue's scenes), 1 not run. "
        "A release without an environment is not run; --prepare makes it."
    )
