"""The run folder and what stands in it."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pytest

import comparisons
import reports
import scenarios
from comparisons.results.store import restore
from reports.views.findings import finding_sentences, profile_comparisons
from reports.views.numbers import written
from scenarios import DropspinError

NASTY = "<script>alert(1)</script>$x_{"


@pytest.fixture(scope="module")
def results():
    """Two catalogue scenes and one with a hostile name and text, two engines, two steps."""
    content = scenarios.load("spin-principal").model_dump(exclude_none=True, exclude={"expect"})
    hostile = scenarios.load(content | {"name": NASTY, "summary": "<img src=x onerror=alert(2)>", "source": "[bold]&"})
    scenes = [scenarios.load("drop-ball"), scenarios.load("drop-box-corner"), hostile]
    return comparisons.run(scenes, ["document", "mujoco"], [4e-3, 2e-3])


@pytest.fixture(scope="module")
def folder(results, tmp_path_factory):
    """The run, written."""
    return reports.write(results, tmp_path_factory.mktemp("out") / "run").parent


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


def test_folder_holds_everything(results, folder):
    """The documented files, and none that are not."""
    found = {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}
    expected = {"run.json", "results.parquet", "tolerances.parquet", "results.csv", "report.html", "report.md", "junit.xml"}
    assert expected <= found
    others = found - expected
    assert all(re.fullmatch(r"plots/\d\d-(time|flight|bounces|convergence)\.svg|trajectories/[\w.=-]+\.npz", name) for name in others), (
        others
    )
    assert len([name for name in others if name.endswith(".npz")]) == 3 * 2 * 2
    assert sum(name.startswith("plots/") for name in others) == 8


def test_page_is_whole_and_offline(folder):
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
    assert page.tags.count("svg") == 8


def test_names_with_markup_are_inert(folder):
    """Shown as they are, run as nothing; in the Markdown no table is broken."""
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert "<script>alert" not in text
    assert "<img" not in text
    data = re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', text)
    assert [json.loads(one)["scene"] for one in data] == ["drop-ball", "drop-box-corner", NASTY]
    assert "&lt;script&gt;alert(1)&lt;/script&gt;$x_{" in text
    markdown = (folder / "report.md").read_text(encoding="utf-8")
    assert not re.search(r"(?<!\\)<", markdown)


def test_page_says_the_verdict_first(results, folder):
    """The sentence before any table, one chip for each scene and engine, the colours of each engine."""
    text = (folder / "report.html").read_text(encoding="utf-8")
    held = (results.table["verdict"] == "passed").sum()
    assert f"All {held} checks hold:" in text
    assert text.index("checks hold") < text.index("<table")
    assert len(re.findall(r'class="chip (passed|measured)"', text)) == 6
    assert "stays as the step goes to 0" in text


def test_failures_come_first(tmp_path):
    """With value, bound, reason."""
    ball = scenarios.load("drop-ball")
    harsh = ball.model_dump(exclude_none=True, exclude={"expect"}) | {
        "expect": [{"metric": "bounce_height_error", "below": 1e-9, "reason": "too much to ask"}]
    }
    found = comparisons.run([scenarios.load(harsh)], ["mujoco"], [4e-3])
    text = reports.write(found, tmp_path / "run").read_text(encoding="utf-8")
    assert "1 of 1 checks fail." in text
    assert text.index("What failed") < text.index("Against the truth")
    assert "too much to ask" in text
    assert "± 1e-09" in text


def test_data_comes_back_as_it_was(results, folder):
    """Table, trajectories, scenes: equal to the bit."""
    again = restore(folder)
    pd.testing.assert_frame_equal(again.table, results.table)
    assert set(again.trajectories) == set(results.trajectories)
    for key, motion in results.trajectories.items():
        np.testing.assert_array_equal(again.trajectories[key].states, motion.states)
        assert again.trajectories[key].velocity_lag == motion.velocity_lag
    assert [scene.digest for scene in again.scenes.values()] == [scene.digest for scene in results.scenes.values()]
    assert again.engines == results.engines
    csv = pd.read_csv(folder / "results.csv")
    assert len(csv) == len(results.table)
    assert list(csv.columns) == list(results.table.columns)


def test_provenance(folder):
    """Versions, machine, what was asked, settings of every engine in every scene at every step."""
    content = json.loads((folder / "run.json").read_text())
    stamped = content["provenance"]
    assert stamped["asked"]["dts"] == [4e-3, 2e-3]
    assert stamped["versions"]["mujoco"]
    assert stamped["cpu"]
    assert stamped["settings"]["mujoco"]["drop-ball dt=0.004"]["solref"] == [0.0, -1.5 / 4e-3]


def test_an_earlier_run_is_replaced_and_nothing_else_is_touched(results, tmp_path):
    """A run replaces a run; a folder of something else, or a file, is refused and stays whole."""
    target = tmp_path / "run"
    reports.write(results, target)
    reports.write(results, target)
    assert not [path for path in tmp_path.iterdir() if path.name != "run"]
    precious = tmp_path / "thesis"
    precious.mkdir()
    (precious / "chapter1.tex").write_text("x")
    with pytest.raises(DropspinError, match="holds files that are no run of dropspin"):
        reports.write(results, precious)
    assert (precious / "chapter1.tex").read_text() == "x"
    with pytest.raises(DropspinError, match="is a file; choose a folder"):
        reports.write(results, precious / "chapter1.tex")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run", "thesis"]


def test_a_write_that_fails_leaves_the_old_run(results, tmp_path, monkeypatch):
    """Killed half-way, the old folder stands and no temporary one is left."""
    import reports.run_folder as writing

    target = tmp_path / "run"
    reports.write(results, target)
    before = (target / "report.html").read_bytes()

    def interrupted(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(writing, "html_report", interrupted)
    with pytest.raises(KeyboardInterrupt):
        reports.write(results, target)
    assert (target / "report.html").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_what_is_not_ours_is_never_deleted(results, tmp_path, monkeypatch):
    """A path that goes up again, a stranger's run.json, notes beside a run, the working directory: all stay whole."""
    keep = tmp_path / "precious" / "keep"
    keep.mkdir(parents=True)
    (keep / "thesis.txt").write_text("x")
    with pytest.raises(DropspinError, match=r"holds files that are no run"):
        reports.write(results, tmp_path / "precious" / "new" / "..")
    (keep / "run.json").write_text("{}")
    with pytest.raises(DropspinError, match=r"'run\.json' for one"):
        reports.write(results, keep)
    (keep / "thesis.txt").rename(tmp_path / "thesis.txt")
    with pytest.raises(DropspinError, match=r"holds files that are no run"):
        reports.write(results, keep)
    run = tmp_path / "run"
    reports.write(results, run)
    (run / "my-notes.txt").write_text("x")
    with pytest.raises(DropspinError, match=r"'my-notes\.txt' for one"):
        reports.write(results, run)
    (run / "my-notes.txt").unlink()
    (run / "plots" / "mine.svg").write_text("x")
    with pytest.raises(DropspinError, match=r"'plots/mine\.svg' for one"):
        reports.write(results, run)
    (run / "plots" / "mine.svg").unlink()
    run.chmod(0o700)
    reports.write(results, run)
    assert run.stat().st_mode & 0o777 == 0o700
    monkeypatch.chdir(run)
    with pytest.raises(DropspinError, match="the working directory, or a mount point"):
        reports.write(results, ".")
    assert (keep / "run.json").read_text() == "{}"
    assert (tmp_path / "thesis.txt").read_text() == "x"


def test_a_link_leads_to_the_folder_that_is_replaced(results, tmp_path):
    """Existing or dangling, the link stays a link."""
    for name in ("there", "not-yet"):
        (tmp_path / name).symlink_to(tmp_path / f"{name}-run")
    (tmp_path / "there-run").mkdir()
    for name in ("there", "not-yet"):
        reports.write(results, tmp_path / name)
        assert (tmp_path / name).is_symlink()
        assert (tmp_path / f"{name}-run" / "report.html").is_file()


@pytest.mark.parametrize("failing", [1, 2])
def test_a_swap_that_fails_brings_the_old_run_back(results, tmp_path, monkeypatch, failing):
    """Whichever of the two renames does not work, the old run is there afterwards and nothing else is."""
    from pathlib import Path

    target = tmp_path / "run"
    reports.write(results, target)
    before = (target / "results.csv").read_bytes()
    rename, calls = Path.rename, []

    def fails_once(self, to):
        calls.append(to)
        if len(calls) == failing:
            raise OSError(16, "Device or resource busy")
        return rename(self, to)

    monkeypatch.setattr(Path, "rename", fails_once)
    with pytest.raises(DropspinError, match="Device or resource busy; the folder is as it was"):
        reports.write(results, target)
    assert (target / "results.csv").read_bytes() == before
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_markdown_cells_hold_anything(tmp_path):
    """Bars, line breaks and stars in names and reasons stay within their cells."""
    scene = scenarios.load("spin-principal").model_dump(exclude_none=True, exclude={"expect"}) | {
        "name": "a|b`c`*d*",
        "expect": [{"metric": "energy_error", "within": [1.0, 2.0], "reason": "has | pipe and\nnewline"}],
    }
    found = comparisons.run([scenarios.load(scene)], ["mujoco"], [4e-3])
    markdown = (reports.write(found, tmp_path / "run").parent / "report.md").read_text(encoding="utf-8")
    tables = [line for line in markdown.splitlines() if line.startswith("|")]
    assert {len(re.findall(r"(?<!\\)\|", line)) for line in tables} == {3}
    [failed] = [line for line in markdown.splitlines() if line.startswith("- ✗")]
    assert "has \\| pipe and newline" in failed
    assert failed.endswith("<br>`` comparisons.run([<scene 'a|b`c`*d*'>], ['mujoco'], [0.004]) ``"), failed
    assert markdown.endswith("\n")
    assert "&#39;" not in markdown


@pytest.fixture(scope="module")
def studied(tmp_path_factory):
    """A run at three steps, with an engine whose errors stay, and its page."""
    found = comparisons.run([scenarios.load("spin-asymmetric")], ["document", "mujoco"], [8e-3, 4e-3, 2e-3])
    page = reports.write(found, tmp_path_factory.mktemp("studied") / "run")
    return found, page.read_text(encoding="utf-8")


def test_page_says_what_becomes_of_each_error_as_the_step_goes_to_zero(studied):
    """Orders in a column of their own, with window and limit; model errors named above and on a chip."""
    _, text = studied
    assert "document: model error in 1 of 1 scenes (spin-asymmetric)" in text
    assert "mujoco: no error above 0.0001 stays as the step goes to 0." in text
    assert text.count("model error</a>") == 1
    assert len(re.findall(r">order 1\.0[012]</td>", text)) >= 4
    assert ">→ 7.53e-01</td>" in text
    assert "fitted at 0.008, 0.004, 0.002 s; claimed 1" in text
    assert ">rounding</td>" in text


def test_terminal_says_what_becomes_of_the_errors(studied, capsys):
    """A line for each engine below the scene's table."""
    from rich.console import Console

    reports.print_table(studied[0], Console(width=200, no_color=True))
    text = capsys.readouterr().out
    assert "as dt → 0, document: angular momentum error → 7.36e-01" in text
    assert re.search(r"as dt → 0, mujoco: orders 0\.99 to 1\.02|as dt → 0, mujoco: orders? 1\.0", text)


def test_two_steps_say_nothing_about_limits():
    """No study, no sentence."""
    from reports.views.findings import finding_sentences

    found = comparisons.run([scenarios.load("spin-asymmetric")], ["document"], [8e-3, 4e-3])
    assert not found.table["kind"].isin(["order", "asymptotic_error"]).any()
    assert finding_sentences(found) == []


def test_folder_that_is_no_run(tmp_path):
    """One line that says what to give."""
    with pytest.raises(DropspinError, match="not the folder of a run"):
        restore(tmp_path)


def test_plots_are_the_same_every_time(results):
    """A report that changes without reason does not review."""
    from reports.html.report import figures
    from reports.plots.svg import svg

    once, again = ({name: svg(figure, name) for name, figure in figures(results)} for _ in range(2))
    assert once == again


def test_terminal_table(results, capsys):
    """Readable in 80 columns: no number is cut, markup is text."""
    from rich.console import Console

    reports.print_table(results, Console(width=80, no_color=True))
    text = capsys.readouterr().out
    assert "…" not in text
    assert NASTY in text
    assert "checks hold:" in text
    assert max(map(len, text.splitlines())) <= 80


def test_many_engines_break_the_table_and_no_number(capsys):
    """Engines whose names begin alike stay apart, and the last column is there, in 80 columns."""
    from rich.console import Console

    every = ["document", "document[rotation=rk4]", "document[rotation=exact,law=normal]", "mujoco", "mujoco[integrator=implicit]"]
    found = comparisons.run([scenarios.load("spin-principal")], every, [1e-2])
    apart = found.table[(found.table["kind"] == "agreement") & (found.table["metric"] == "energy_error")]["value"].abs().max()
    for engines in (found.engines, found.engines[:3], found.engines[1:2]):
        for width in (60, 80, 90, 200):
            reports.print_table(replace(found, engines=engines), Console(width=width, no_color=True))
            text = capsys.readouterr().out
            assert "…" not in text
            assert max(map(len, text.splitlines())) <= width
            errors = found.measurements[(found.measurements["metric"] == "orientation_error") & found.measurements["engine"].isin(engines)]
            assert len(errors) == len(engines)
            for value in [*errors["value"], apart]:
                assert written(value) in text


def test_how_much_of_an_error_is_the_setting(tmp_path):
    """Beside its calibrated profile a default one is told, error by error, what the settings make of it; in page, table and sentence."""
    found = comparisons.run([scenarios.load("drop-ball")], ["pybullet", "pybullet[profile=default]"], [4e-3, 2e-3])
    [comparison] = profile_comparisons(found)
    assert (comparison.engine, comparison.calibrated) == ("pybullet[profile=default]", "pybullet")
    errors = found.measurements.set_index(["engine", "metric", "dt"])["value"]
    for row in comparison.rows:
        default, calibrated = (errors[label, row["metric"], 2e-3] for label in ("pybullet[profile=default]", "pybullet"))
        assert (row["default"], row["calibrated"]) == (default, calibrated)
        assert row["part"] == max(0.0, 1 - abs(calibrated) / abs(default))
    height = next(row for row in comparison.rows if row["metric"] == "bounce_height_error")
    assert height["part"] > 0.95  # measured .965; the rest is the step's
    page = reports.write(found, tmp_path / "run").read_text(encoding="utf-8")
    assert "How much of the error is the setting" in page
    assert comparison.sentence in finding_sentences(found)
    assert profile_comparisons(comparisons.run([scenarios.load("drop-ball")], ["pybullet[profile=default]"], [4e-3])) == []
