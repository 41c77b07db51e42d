"""A run beside a recording says what it is compared with, in every output, and shows it in plots and the replay."""

import re

import numpy as np
import pytest

from dropspin.comparisons.running.run import run
from dropspin.reports.html.report import html_report
from dropspin.reports.markdown import markdown
from dropspin.reports.plots.run_charts import report_charts
from dropspin.reports.replay import as_data, replay_of
from dropspin.reports.stories.run import document, overview
from dropspin.reports.stories.show import scene_rows
from dropspin.reports.terminal.run_table import print_table
from dropspin.scenarios import load
from dropspin.scenarios.loading import CATALOGUE


@pytest.fixture(scope="module")
def results():
    """Two engines beside one toss of the cube."""
    content = load("toss-cube").model_dump(exclude={"origin", "recording", "start", "name", "expect"}, exclude_none=True)
    scene = load(content | {"name": "one-toss", "recording": {"file": str(CATALOGUE / "toss-cube.json"), "toss": "53"}})
    return run(scene, ["mujoco", "wang[contact=sequential,law=coulomb]"], [4e-3, 2e-3, 1e-3])


@pytest.mark.extended
def test_page_names_the_recording_and_no_exact_solution(results):
    summary = overview(results)
    page = html_report(results, summary, report_charts(results))
    own = page.partition('id="metrics"')[0]
    assert "Rigid-body engines compared with recordings" in own
    assert "<dt>recording</dt><dd>toss 53 of the recording toss-cube: " in own
    assert re.search(r"<td data-engine=\"0\" class=\"[^\"]*\">[0-9.e-]+ ± [0-9.e-]+ ", own)
    for text in (re.sub(r"<script.*?</script>", "", own, flags=re.DOTALL), markdown(document(results, summary))):
        assert "exact solution" not in text
    assert "converges in" not in own


def test_terminal_shows_the_uncertainty(results, capsys):
    print_table(results)
    text = capsys.readouterr().out
    assert re.search(r"uncertainty of the recording, position error: mujoco \S+ m, wang\[", text)
    assert re.search(r"MuJoCo: the position differs from the recording in one-toss by \S+ ± \S+ m\.", text)
    assert "exact" not in text


def test_replay_and_plots_have_the_recording_as_an_outline(results):
    scene = results.scenes["one-toss"]
    replay = replay_of(results, "one-toss")
    ghost = replay.motions[-1]
    assert (ghost.label, ghost.colour) == ("recording", "")
    [toss] = scene.recording.tosses
    between = [np.interp(ghost.frames.t, [0.0, *toss.t], [toss.starts[0, axis], *toss.position[:, axis]]) for axis in range(3)]
    np.testing.assert_allclose(ghost.frames.position.T, between)
    assert [motion["isExact"] for motion in as_data(replay)["motions"]] == [False, False, True]
    charts = report_charts(results)["one-toss"]["time"]
    assert [chart.lines[-1].label for chart in charts] == ["recording"] * len(charts)
    assert [chart.reference for chart in charts] == [""] * len(charts)
    np.testing.assert_allclose(charts[0].lines[-1].y, toss.position[:, 1])


def test_scene_is_shown_with_its_tosses():
    rows = {row["what"]: row["is"] for row in scene_rows(load("toss-cube"))}
    assert rows["truth"].startswith("toss 4 of the recording toss-cube, the first of 20: ")
    assert "20 measured tosses" in rows["modelled"]
    assert not {"impacts", "valid until", "other laws"} & set(rows)
