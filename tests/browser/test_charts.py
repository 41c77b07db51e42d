"""The plots of a report in a browser: values, zoom, legends, switches and filters, compared with the data of the run."""

import numpy as np
import pytest

import dropspin as ds
from dropspin.scenarios.mechanics import energy

ENGINES = ["wang", "mujoco"]
DT = 4e-3


@pytest.fixture(scope="module")
def results():
    return ds.run(["drop-box-corner", "spin-principal-500"], ENGINES, dt=[DT, 2e-3, 1e-3])


@pytest.fixture(scope="module")
def folder(results, tmp_path_factory):
    return ds.write_report(results, tmp_path_factory.mktemp("out") / "run").parent


class Chart:
    """A plot of a scene in an opened report."""

    def __init__(self, page, scene, y_label):
        page.tab.locator(f"details[data-scene={scene}]").evaluate("details => { details.open = true; }")
        charts = page.tab.locator(f"details[data-scene={scene}] .chart")
        labels = charts.evaluate_all("all => all.map(one => one.chart.raw.yLabel)")
        self.home = charts.nth(labels.index(y_label))
        self.home.scroll_into_view_if_needed()
        self.mouse = page.tab.mouse

    def get(self, expression, argument=None):
        return self.home.evaluate(f"(home, given) => (chart => {expression})(home.chart)", argument)

    def at(self, x, y):
        """Position on the screen of a point of the plot."""
        box = self.home.locator(".plot").bounding_box()
        place = self.get("[chart.toX(given[0]), chart.toY(given[1])]", [x, y])
        return box["x"] + place[0], box["y"] + place[1]

    def lines(self):
        return set(self.home.locator(".plot path[data-label]").evaluate_all("all => all.map(one => one.dataset.label)"))

    def press(self, name, **options):
        self.home.get_by_role("button", name=name, exact=True).click(**options)

    def path(self, label):
        """The points of a line on the screen, shape (n, 2)."""
        text = self.home.locator(f".plot path[data-label='{label}']").first.get_attribute("d")
        return np.array([pair.split(",") for pair in text[1:].replace("M", "L").split("L")], dtype=float)


@pytest.fixture
def chart(opened):
    return lambda scene, y_label: Chart(opened("report.html", viewport={"width": 1600, "height": 900}), scene, y_label)


def test_hover_shows_the_value_of_the_run(chart, results):
    """The tip has time and energy of the nearest state of the run, with three digits; the spot is on it to a pixel."""
    one = chart("drop-box-corner", "energy [J]")
    motion = results.trajectories["drop-box-corner", "mujoco", DT]
    values = energy(results.scenes["drop-box-corner"], motion)
    row = 100
    one.press("Wang's method")
    one.press("exact solution")
    x, y = one.at(motion.t[row], values[row])
    one.mouse.move(x + 1, y + 2)
    tip = one.home.locator(".tip").inner_text()
    assert f"MuJoCo: {values[row]:.4g}" in tip
    assert f"time {motion.t[row]:.4g}" in tip
    spot = one.home.locator(".spot circle").bounding_box()
    centre = (spot["x"] + spot["width"] / 2, spot["y"] + spot["height"] / 2)
    np.testing.assert_allclose(centre, one.at(motion.t[row], values[row]), atol=1.0)


def test_drag_zooms_and_double_click_shows_the_whole_plot(chart):
    one = chart("drop-box-corner", "height [m]")
    whole = one.get("chart.ranges()")
    one.mouse.move(*one.at(0.1, 0.6))
    one.mouse.down()
    one.mouse.move(*one.at(0.3, 0.4), steps=4)
    one.mouse.up()
    np.testing.assert_allclose(one.get("chart.zoomed"), [[0.1, 0.3], [0.4, 0.6]], atol=5e-3)
    assert one.home.get_by_role("button", name="Whole plot").is_visible()
    one.mouse.dblclick(*one.at(0.2, 0.5))
    assert one.get("chart.zoomed") is None
    np.testing.assert_allclose(one.get("chart.ranges()"), whole)


def test_legend_hides_and_isolates(chart):
    """A click hides a line, a second one shows it again; with Shift all others are hidden, and shown again."""
    one = chart("drop-box-corner", "height [m]")
    every = {*ENGINES, "exact solution"}
    assert one.lines() == every
    one.press("MuJoCo")
    assert one.lines() == every - {"mujoco"}
    one.press("MuJoCo")
    one.press("Wang's method", modifiers=["Shift"])
    assert one.lines() == {"wang"}
    one.press("Wang's method", modifiers=["Shift"])
    assert one.lines() == every


def test_difference_from_the_exact_solution(chart, results):
    """The line is engine minus exact solution at each time, to 1e-6 of it and within a pixel on the screen; the exact solution is 0."""
    one = chart("drop-box-corner", "height [m]")
    one.press("Difference from exact")
    motion = results.trajectories["drop-box-corner", "wang", DT]
    expected = motion.position[:, 1] - ds.truth_for(results.scenes["drop-box-corner"])(motion.t).position[:, 1]
    drawn = one.get("chart.lines.find((line) => line.label === 'wang').difference")
    np.testing.assert_allclose(drawn, expected, rtol=1e-6, atol=1e-12)
    scale = np.polyfit(expected, one.path("wang")[:, 1], 1)
    assert np.abs(np.polyval(scale, expected) - one.path("wang")[:, 1]).max() < 1.0
    assert np.ptp(one.path("exact solution")[:, 1]) < 0.2


def test_logarithmic_axis_can_be_switched(chart):
    """Errors over the step: equal ratios have equal distances on a logarithmic axis, equal differences on a linear one."""
    one = chart("drop-box-corner", "bounce height error")
    one.press("MuJoCo", modifiers=["Shift"])
    errors = one.get("Array.from(chart.lines.find((line) => line.label === 'mujoco').y)")
    for function in (np.log10, np.asarray):
        screen = one.path("mujoco")[:, 1]
        assert np.ptp(screen) > 10
        scale = np.polyfit(function(errors), screen, 1)
        np.testing.assert_allclose(np.polyval(scale, function(errors)), screen, atol=0.2)
        one.press("Log")


def test_filter_of_engines_acts_on_plots_and_replay(opened):
    page = opened("report.html", viewport={"width": 1600, "height": 900})
    one = Chart(page, "drop-box-corner", "height [m]")
    page.start_replays()
    page.tab.get_by_role("checkbox", name="MuJoCo", exact=True).first.uncheck()
    assert "mujoco" not in one.lines()
    assert not one.home.get_by_role("button", name="MuJoCo", exact=True).is_visible()
    shown = page.tab.evaluate(
        "document.querySelector('[data-scene=drop-box-corner] [data-replay]').viewer.motions.map((motion) => [motion.label, motion.shown])"
    )
    assert dict(shown) == {"wang": True, "mujoco": False, "exact solution": True}
    page.tab.get_by_role("checkbox", name="MuJoCo", exact=True).first.check()
    assert "mujoco" in one.lines()


def test_a_constant_is_shown_as_one_and_its_rounding_named(chart):
    """The energy of a free spin: the axis begins at 0, and the tip says that the difference is rounding."""
    one = chart("spin-principal-500", "energy [J]")
    low, high = one.get("chart.ranges()[1]")
    assert low <= 0 < high
    one.press("Difference from exact")
    x, y = one.get("[chart.lines[1].x[50], chart.values(chart.lines[1])[50]]")
    one.mouse.move(*one.at(x, y))
    assert "≈ 0 (rounding)" in one.home.locator(".tip").inner_text()
