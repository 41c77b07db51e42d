"""The folder of a run: its files, the report, and how it replaces an earlier run.

The file is longer than 300 lines because its tests share one written folder.
"""

import base64
import hashlib
import json
import re
import shutil
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dropspin.comparisons.results.run_file import signed
from dropspin.comparisons.results.store import load_results
from dropspin.comparisons.running.run import run
from dropspin.reports import run_folder
from dropspin.reports.html.replay import replay_page
from dropspin.reports.html.report import html_report
from dropspin.reports.markdown import markdown
from dropspin.reports.plots import run_charts
from dropspin.reports.plots.run_charts import report_charts
from dropspin.reports.replay import replay_of
from dropspin.reports.run_folder import write_report
from dropspin.reports.stories.findings import ProfileComparison, profile_comparisons
from dropspin.reports.stories.matrix import MEANINGS
from dropspin.reports.stories.numbers import formatted
from dropspin.reports.stories.run import document, overview
from dropspin.reports.terminal.run_table import print_table
from dropspin.scenarios import DropspinError, load

NASTY = "<script>alert(1)</script>$x_{"


@pytest.fixture(scope="module")
def results():
    """Two catalogue scenes and one with a hostile name and text, two engines, two time steps."""
    content = load("spin-principal").model_dump(exclude_none=True, exclude={"expect"})
    hostile = load(content | {"name": NASTY, "summary": "<img src=x onerror=alert(2)>", "source": "[bold]&"})
    return run([load("drop-ball"), load("drop-box-corner"), hostile], ["mujoco", "pybullet"], [8e-3, 4e-3])


@pytest.fixture(scope="module")
def folder(results, tmp_path_factory):
    """The run, written."""
    return write_report(results, tmp_path_factory.mktemp("out") / "run").parent


@pytest.fixture(scope="module")
def small():
    """A run of one scene with one engine at one time step, for tests of writing."""
    return run("spin-principal", "mujoco", 1e-2)


class Page(HTMLParser):
    """Tags, ids, links and balance of a page."""

    VOID = frozenset({"meta", "link", "br", "img", "hr", "input"})

    def __init__(self, text):
        super().__init__()
        self.tags, self.ids, self.references, self.open = [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attributes:
            if name == "id":
                self.ids.append(value)
            if name in ("href", "src", "xlink:href"):
                self.references.append(value)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_the_folder_holds_the_documented_files(folder):
    """Those and no others."""
    found = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    expected = {"run.json", "results.parquet", "results.csv", "report.html", "report.md", "junit.xml"}
    assert expected <= found
    others = found - expected
    assert all(re.fullmatch(r"trajectories/[\w.=-]+\.npz", name) for name in others), others
    assert len([name for name in others if name.endswith(".npz")]) == 3 * 2 * 2


def test_the_page_is_valid_and_needs_no_network(folder):
    """Balanced tags, unique ids, links that lead somewhere inside, nothing from elsewhere, under 3 MB."""
    text = (folder / "report.html").read_text(encoding="utf-8")
    page = Page(text)
    assert page.open == []
    assert len(page.ids) == len(set(page.ids))
    assert page.references
    for reference in page.references:
        assert reference.startswith("#")
        assert reference[1:] in page.ids
    assert not re.search(r"url\((?!#)", text)
    assert not re.search(r"@import|<script[^>]*src|<link", text)
    assert len(text) < 3_000_000


def test_names_with_markup_are_inert(folder):
    """Shown as they are, run as nothing; in the Markdown no table is broken."""
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert "<script>alert" not in text
    assert "<img" not in text
    data = re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', text)
    scenes = [one["scene"] for one in map(json.loads, data) if "motions" in one]
    assert scenes == ["drop-ball", "drop-box-corner", NASTY]
    assert "&lt;script&gt;alert(1)&lt;/script&gt;$x_{" in text
    markdown = (folder / "report.md").read_text(encoding="utf-8")
    assert not re.search(r"(?<!\\)<", markdown)


def test_the_heading_of_a_scene_has_the_identifier_of_its_problem(folder):
    assert '<h2>drop-ball <span class="quiet">DS-012.1: A ball dropped' in (folder / "report.html").read_text(encoding="utf-8")


def test_the_policy_allows_the_script_of_the_page_alone(results, folder):
    """By its hash; markup that got into a page could not run one."""
    replays = [replay_of(results, scene) for scene in results.scenes]
    for text in ((folder / "report.html").read_text(encoding="utf-8"), replay_page(replays, [[]] * len(replays))):
        [script] = re.findall(r"<script>(.*?)</script>", text, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
        assert f"default-src 'none'; script-src 'sha256-{digest}'; style-src" in text


def test_the_page_states_the_verdict_before_any_table(results, folder):
    """The sentence before any table, one chip for each scene and engine, the colours of each engine."""
    text = (folder / "report.html").read_text(encoding="utf-8")
    passed = (results.table["verdict"] == "passed").sum()
    assert f"All {passed} checks pass." in text
    assert text.index("checks pass") < text.index("<table")
    assert len(re.findall(r'class="chip (passed|measured)"', text)) == 6
    for by_engine in results.statuses().values():
        assert all(MEANINGS[status.words] in text for status in by_engine.values())


def test_failures_come_before_the_comparison():
    """With value, bound and reason."""
    ball = load("drop-ball")
    harsh = ball.model_dump(exclude_none=True, exclude={"expect"}) | {
        "expect": [{"metric": "bounce_height_error", "below": 1e-9, "reason": "too much to ask"}]
    }
    found = run(load(harsh), "mujoco", 1e-2)
    text = html_report(found, overview(found), report_charts(found))
    assert "1 of 1 check fails." in text
    assert text.index("Failures") < text.index("<h3>Errors</h3>")
    assert "too much to ask" in text
    assert "± 1e-09" in text


def test_a_loaded_run_equals_the_one_that_was_saved(results, folder):
    """Tables, trajectories, scenes: equal to the bit."""
    again = load_results(folder)
    assert len(results.predictions)
    assert len(results.agreements)
    for name in ("table", "predictions", "agreements"):
        pd.testing.assert_frame_equal(getattr(again, name), getattr(results, name))
    assert set(again.trajectories) == set(results.trajectories)
    for key, motion in results.trajectories.items():
        np.testing.assert_array_equal(again.trajectories[key].states, motion.states)
        assert again.trajectories[key].velocity_lag == motion.velocity_lag
    assert [scene.digest for scene in again.scenes.values()] == [scene.digest for scene in results.scenes.values()]
    assert again.engines == results.engines
    csv = pd.read_csv(folder / "results.csv")
    assert len(csv) == len(results.table)
    assert list(csv.columns) == list(results.table.columns)


@pytest.mark.extended
def test_a_run_of_the_earlier_format_is_read(tmp_path):
    """Format 5 had no column for the basis of a verdict, which was the beginning of its reason, and another name for the engine `wang`."""
    folder = write_report(run("spin-asymmetric", ["wang[rotation=rk4]", "wang"], [8e-3, 4e-3]), tmp_path / "run").parent
    old = shutil.copytree(folder, tmp_path / "old")
    rows = pd.read_parquet(old / "results.parquet").drop(columns="basis")
    rows.loc[0, ["verdict", "reason"]] = "passed", "the known fault does not occur; its expectation can be removed: why"
    rows[["engine", "truth"]] = rows[["engine", "truth"]].replace({"wang": "document", "wang[rotation=rk4]": "document[rotation=rk4]"})
    rows.to_parquet(old / "results.parquet", index=False)
    content = json.loads((old / "run.json").read_text(encoding="utf-8").replace('"wang', '"document'))
    content["sha256"]["results.parquet"] = hashlib.sha256((old / "results.parquet").read_bytes()).hexdigest()
    del content["sha256"]["run.json"]
    (old / "run.json").write_text(signed(content | {"format": 5}), encoding="utf-8")
    again, other, judged = load_results(old), load_results(folder), ["basis", "verdict", "reason"]
    assert again.table.loc[0, "basis"] == "fault_absent"
    assert "the method of a lecture note by Huamin Wang" in (folder / "report.html").read_text(encoding="utf-8")
    assert again.engines == other.engines
    assert again.trajectories.keys() == other.trajectories.keys()
    for name in ("table", "agreements"):
        pd.testing.assert_frame_equal(getattr(again, name).drop(columns=judged), getattr(other, name).drop(columns=judged))


def test_a_run_of_an_older_format_is_refused_with_the_version_that_wrote_it(folder, tmp_path):
    old = shutil.copytree(folder, tmp_path / "old")
    content = json.loads((old / "run.json").read_text(encoding="utf-8"))
    content["provenance"]["versions"]["dropspin"] = "0.0.9"
    (old / "run.json").write_text(json.dumps(content | {"format": 4}), encoding="utf-8")
    with pytest.raises(DropspinError, match=r"old: has a format of dropspin 0\.0\.9, which this version cannot read; run it again\.$"):
        load_results(old)


def test_run_json_holds_the_provenance(folder):
    """Versions, machine, what was asked, settings of every engine in every scene at every step."""
    content = json.loads((folder / "run.json").read_text())
    stamped = content["provenance"]
    assert stamped["asked"]["dts"] == [8e-3, 4e-3]
    assert stamped["versions"]["mujoco"]
    assert stamped["cpu"]
    assert stamped["settings"]["mujoco"]["drop-ball dt=0.004"]["solref"] == [0.0, -1.5 / 4e-3]


@pytest.mark.extended
def test_a_run_replaces_an_earlier_run_and_nothing_else(small, tmp_path):
    """A run replaces a run; a folder of something else, or a file, is refused and stays whole."""
    target = tmp_path / "run"
    write_report(small, target)
    write_report(small, target)
    assert not [path for path in tmp_path.iterdir() if path.name != "run"]
    precious = tmp_path / "thesis"
    precious.mkdir()
    (precious / "chapter1.tex").write_text("x")
    with pytest.raises(DropspinError, match="has files that dropspin run did not write"):
        write_report(small, precious)
    assert (precious / "chapter1.tex").read_text() == "x"
    with pytest.raises(DropspinError, match="is a file; choose a folder"):
        write_report(small, precious / "chapter1.tex")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run", "thesis"]


def test_a_write_that_fails_leaves_the_old_run(small, tmp_path, monkeypatch):
    """Killed half-way, the old folder stands and no temporary one is left."""
    target = tmp_path / "run"
    write_report(small, target)
    before = (target / "report.html").read_bytes()

    def interrupted(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(run_folder, "html_report", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_report(small, target)
    assert (target / "report.html").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_files_that_no_run_wrote_are_never_deleted(small, tmp_path, monkeypatch):
    """A path that goes up again, a stranger's run.json, notes beside a run, the working directory: all stay whole."""
    keep = tmp_path / "precious" / "keep"
    keep.mkdir(parents=True)
    (keep / "thesis.txt").write_text("x")
    with pytest.raises(DropspinError, match="has files that dropspin run did not write"):
        write_report(small, tmp_path / "precious" / "new" / "..")
    (keep / "run.json").write_text("{}")
    with pytest.raises(DropspinError, match=r"'run\.json'; move"):
        write_report(small, keep)
    (keep / "thesis.txt").rename(tmp_path / "thesis.txt")
    with pytest.raises(DropspinError, match="has files that dropspin run did not write"):
        write_report(small, keep)
    run = tmp_path / "run"
    write_report(small, run)
    (run / "my-notes.txt").write_text("x")
    with pytest.raises(DropspinError, match=r"'my-notes\.txt'; move"):
        write_report(small, run)
    (run / "my-notes.txt").unlink()
    (run / "plots").mkdir()
    (run / "plots" / "mine.svg").write_text("x")
    with pytest.raises(DropspinError, match=r"'plots/mine\.svg'; move"):
        write_report(small, run)
    shutil.rmtree(run / "plots")
    run.chmod(0o700)
    write_report(small, run)
    assert run.stat().st_mode & 0o777 == 0o700
    monkeypatch.chdir(run)
    with pytest.raises(DropspinError, match="the working directory and mount points"):
        write_report(small, ".")
    assert (keep / "run.json").read_text() == "{}"
    assert (tmp_path / "thesis.txt").read_text() == "x"


def test_a_link_leads_to_the_folder_that_is_replaced(small, tmp_path):
    """Existing or dangling, the link stays a link."""
    for name in ("there", "not-yet"):
        (tmp_path / name).symlink_to(tmp_path / f"{name}-run")
    (tmp_path / "there-run").mkdir()
    for name in ("there", "not-yet"):
        write_report(small, tmp_path / name)
        assert (tmp_path / name).is_symlink()
        assert (tmp_path / f"{name}-run" / "report.html").is_file()


@pytest.mark.extended
@pytest.mark.parametrize("failing", [1, 2])
def test_a_swap_that_fails_brings_the_old_run_back(small, tmp_path, monkeypatch, failing):
    """Whichever of the two renames does not work, the old run is there afterwards and nothing else is."""
    target = tmp_path / "run"
    write_report(small, target)
    before = (target / "results.csv").read_bytes()
    rename, calls = Path.rename, []

    def fails_once(self, to):
        calls.append(to)
        if len(calls) == failing:
            raise OSError(16, "Device or resource busy")
        return rename(self, to)

    monkeypatch.setattr(Path, "rename", fails_once)
    with pytest.raises(DropspinError, match="Device or resource busy; the folder is unchanged"):
        write_report(small, target)
    assert (target / "results.csv").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_markdown_cells_hold_anything():
    """Bars, line breaks and asterisks in names and reasons stay within their cells."""
    scene = load("spin-principal").model_dump(exclude_none=True, exclude={"expect"}) | {
        "name": "a|b`c`*d*",
        "expect": [{"metric": "energy_error", "within": [1.0, 2.0], "reason": "has | pipe and\nnewline"}],
    }
    found = run(load(scene), "mujoco", 1e-2)
    page = markdown(document(found, overview(found)))
    tables = [line for line in page.splitlines() if line.startswith("|")]
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in tables} == {3}
    [failed] = [line for line in page.splitlines() if line.startswith("- ✗ a")]
    assert "has \\| pipe and newline" in failed
    assert failed.endswith("<br>`` dropspin.run(<scene 'a|b`c`*d*'>, 'mujoco', dt=[0.01]) ``"), failed
    assert page.endswith("\n")
    assert "&#39;" not in page


@pytest.fixture(scope="module")
def studied():
    """A run at three time steps, with an engine that has a model error, and its page."""
    found = run("spin-asymmetric", ["wang", "mujoco"], [8e-3, 4e-3, 2e-3])
    return found, html_report(found, overview(found), report_charts(found))


def test_the_page_shows_orders_and_asymptotic_errors(studied):
    """Orders in a column of their own, with window and limit; model errors named above and on a chip."""
    text = studied[1].replace("\xa0", " ")
    assert "known fault in 1 (model error) of 1 scene; largest error: orientation 2.67 rad at dt = 2 ms in spin-asymmetric; " in text
    assert "MuJoCo: passed in 1 of 1 scene; " in text
    assert len(re.findall(r'<span class="status known">†<span class="words">&nbsp;known fault</span></span>', text)) == 1
    assert len(re.findall(r">order 1\.0[012] ", text)) >= 4
    assert ">→ 0.753</td>" in text
    assert "fitted at 0.008, 0.004, 0.002 s; claimed 1" in text
    assert ">rounding</td>" in text


def test_the_terminal_shows_orders_and_asymptotic_errors(studied, capsys):
    """A line for each engine below the scene's table."""
    from rich.console import Console

    print_table(studied[0], Console(width=200, no_color=True))
    text = capsys.readouterr().out
    assert "as dt → 0, wang: angular momentum error → 0.736" in text
    assert re.search(r"as dt → 0, mujoco: orders 0\.99 to 1\.02|as dt → 0, mujoco: orders? 1\.0", text)


def test_two_time_steps_give_no_asymptotic_errors():
    found = run("spin-asymmetric", "mujoco", [8e-3, 4e-3])
    assert not found.table["kind"].isin(["order", "asymptotic_error"]).any()
    [sentence] = overview(found).findings
    assert sentence.startswith(
        "MuJoCo: not judged in 1 (measured) of 1 scene; no asymptotic errors, which need three time steps that span a factor of four; "
    )


def test_an_empty_folder_is_not_a_run(tmp_path):
    with pytest.raises(DropspinError, match="not the folder of a run"):
        load_results(tmp_path)


@pytest.mark.extended
def test_plots_are_written_on_request_and_reproducible_byte_for_byte(results, tmp_path):
    """`fill` with SVG writes one file for each group of charts, twice the same."""
    files = []
    for name in ("once", "twice"):
        (tmp_path / name).mkdir()
        run_folder.fill(results, tmp_path / name, plots=["svg"])
        files.append({file.name: file.read_bytes() for file in (tmp_path / name / "plots").iterdir()})
    assert files[0] == files[1]
    assert len(files[0]) == 7
    assert all(re.fullmatch(r"\d\d-(time|flight|bounces|convergence)\.svg", name) for name in files[0])


def test_the_terminal_table_fits_80_columns(results, capsys):
    """Readable in 80 columns: no number is cut, markup is text."""
    from rich.console import Console

    print_table(results, Console(width=80, force_terminal=True, color_system=None))
    text = capsys.readouterr().out
    assert "…" not in text
    assert NASTY in text
    assert "checks pass." in text
    assert max(map(len, text.splitlines())) <= 80


@pytest.mark.extended
def test_table_of_many_engines_cuts_no_number(capsys):
    """Engines whose names begin alike can be distinguished; those that do not fit are named."""
    from rich.console import Console

    multibody = "pybullet[coordinates=multibody"
    every = ["pybullet", f"{multibody}]", f"{multibody},velocity_clamp=kept]", "mujoco", "mujoco[integrator=implicit]"]
    found = run("spin-principal", every, 1e-2)
    spread = found.agreements.loc[found.agreements["metric"] == "energy_error", "value"].abs().max()
    for engines in (found.engines, found.engines[:3], found.engines[1:2]):
        for width in (60, 80, 200):
            print_table(replace(found, engines=engines), Console(width=width, force_terminal=True, color_system=None))
            text = capsys.readouterr().out
            assert "…" not in text
            assert max(map(len, text.splitlines())) <= width
            errors = found.measurements[(found.measurements["metric"] == "orientation_error") & found.measurements["engine"].isin(engines)]
            assert len(errors) == len(engines)
            left_out = text.partition("Columns not shown at this width: ")[2].split(";")[0].replace("\n", "")
            for engine, value in [*zip(errors["engine"], errors["value"], strict=True), ("spread", spread)]:
                assert formatted(value) in text or engine in left_out


@pytest.mark.extended
@pytest.mark.usefixtures("all_start_phases")
def test_setting_errors_are_compared_with_the_calibrated_profile():
    """Beside its calibrated profile a default one gets the share of each error that is due to settings: in page, table and sentence."""
    found = run("drop-ball", ["pybullet", "pybullet[profile=default]"], [4e-3, 2e-3])
    [comparison] = profile_comparisons(found)
    assert (comparison.engine, comparison.calibrated) == ("pybullet[profile=default]", "pybullet")
    errors = found.measurements.set_index(["engine", "metric", "dt"])["value"]
    for row in comparison.rows:
        default, calibrated = (errors[label, row["metric"], 2e-3] for label in ("pybullet[profile=default]", "pybullet"))
        assert (row["default"], row["calibrated"]) == (default, calibrated)
        assert row["part"] == max(0.0, 1 - abs(calibrated) / abs(default))
    height = next(row for row in comparison.rows if row["metric"] == "bounce_height_error")
    assert height["part"] > 0.95  # measured .965; the rest is discretisation error
    page = html_report(found, overview(found), report_charts(found))
    assert "Setting errors of" in page
    assert comparison.sentence in overview(found).conclusion
    assert profile_comparisons(run("drop-ball", "pybullet[profile=default]", 1e-2)) == []


def test_setting_that_is_given_in_both_profiles_is_no_setting_error_of_the_default_one():
    """An option that makes the whole error is in the calibrated engine too."""
    row = {"part": 0.0}
    sentences = [
        ProfileComparison(f"pybullet[{options}profile=default]", f"pybullet{calibrated}", [row, row]).sentence
        for options, calibrated in (("", ""), ("floor_restitution=0,", "[floor_restitution=0]"))
    ]
    assert "are mostly setting errors (median" in sentences[0]
    assert "are mostly due to settings other than those given (median" in sentences[1]


@pytest.mark.extended
def test_a_run_of_many_scenes_has_plots_of_those_that_fail(results, monkeypatch):
    """The first of these; the page says of how many."""
    last = list(results.scenes)[-1]
    failing = replace(results, table=results.table.assign(verdict=np.where(results.table["scene"] == last, "failed", "passed")))
    assert list(report_charts(failing)) == list(results.scenes)
    assert "scenes have plots" not in html_report(failing, overview(failing), report_charts(failing))
    monkeypatch.setattr(run_charts, "MOST_SCENES", 1)
    assert list(report_charts(failing)) == [last]
    assert "1 of 3 scenes have plots" in html_report(failing, overview(failing), report_charts(failing))
