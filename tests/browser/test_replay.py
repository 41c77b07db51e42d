"""The replay in a browser: its controls, and what it shows compared with the data of the run."""

import base64
import io

import numpy as np
import pytest
from axe_playwright_python.sync_playwright import Axe
from PIL import Image
from support.cli import dropspin

import dropspin as ds
from dropspin.reports.plots.colours import engine_styles, human_label
from dropspin.scenarios.rotations import angle_between_orientations, rotate

ENGINES = ["wang", "mujoco", "pybullet"]
SCENES = ["drop-box-corner", "drop-box-anyhow", "spin-asymmetric", "spin-principal-500"]
DT = 4e-3
WEIGHT = 9.8 * DT
"""Impulse of the weight of 1 kg in a step [N s]."""
PROJECT = """([points, time, number]) => {
    const viewer = document.querySelectorAll("[data-replay]")[number].viewer, canvas = viewer.canvas;
    viewer.seek(time);
    const view = viewer.camera.view({ left: 0, top: 0, width: canvas.clientWidth, height: canvas.clientHeight });
    return { eye: view.eye, places: points.map(view.seen).map(({ x, y }) => [x, y]) };
}"""


@pytest.fixture(scope="module")
def folder(shared):
    """The folder of a run with its page of replays."""

    def make(place):
        made = ds.write_report(ds.run(SCENES, ENGINES, dt=[DT]), place / "run").parent
        assert dropspin("replay", made, "--no-open", cwd=place).returncode == 0

    return shared("replays", make) / "run"


@pytest.fixture(scope="module")
def results(folder):
    return ds.load_results(folder)


class Replay:
    """The replay of a scene on the page of replays."""

    def __init__(self, page, scene):
        self.number = SCENES.index(scene)
        self.home = page.tab.locator("[data-replay]").nth(self.number)
        self.home.scroll_into_view_if_needed()
        self.canvas = self.home.locator("canvas")
        self.canvas.wait_for()

    def get(self, expression):
        return self.home.evaluate(f"home => (viewer => {expression})(home.viewer)")

    def picture(self):
        """The pixels of the view, shape (height, width, 3)."""
        data = base64.b64decode(self.canvas.evaluate("canvas => canvas.toDataURL()").partition(",")[2])
        picture = Image.open(io.BytesIO(data)).convert("RGBA")
        return np.asarray(Image.alpha_composite(Image.new("RGBA", picture.size), picture).convert("RGB")).astype(int)

    def cell(self, engine):
        """The last cell of an engine's row: its held impulse."""
        return self.home.get_by_role("row").filter(has_text=human_label(engine)).locator("td").last.inner_text()


@pytest.fixture
def replay(opened):
    def open_(scene, **settings):
        return Replay(opened("replay.html", **settings), scene)

    return open_


def step_impulses(results, scene, engine):
    """Size of the impulse of the floor in each step [N s]; the bodies have a mass of 1 kg."""
    assert results.scenes[scene].body.mass == 1.0
    changes = np.diff(results.trajectories[scene, engine, DT].velocity, axis=0)
    return np.linalg.norm(changes + np.array([0.0, WEIGHT, 0.0]), axis=1)


def test_jumps_go_to_the_times_of_impacts(replay, results):
    shown = replay("drop-box-anyhow")
    J = step_impulses(results, "drop-box-anyhow", "pybullet")
    times = results.trajectories["drop-box-anyhow", "pybullet", DT].t[1:][J > 4.0 * WEIGHT]
    assert len(times) > 5
    shown.home.get_by_role("radio", name="PyBullet").check()
    for time in times:
        shown.home.get_by_role("button", name="next impact").click()
        assert shown.get("viewer.time") == pytest.approx(time, abs=1e-8)
    for time in times[-2::-1]:
        shown.canvas.press("p")
        assert shown.get("viewer.time") == pytest.approx(time, abs=1e-8)
    shown.canvas.press("n")
    assert shown.get("viewer.time") == pytest.approx(times[1], abs=1e-8)


def test_held_impulse_is_the_largest_of_the_last_quarter_of_a_second(replay, results):
    """As in the states of the run, also where smaller contacts follow."""
    shown = replay("drop-box-anyhow")
    held = 0
    for engine in ENGINES:
        J = step_impulses(results, "drop-box-anyhow", engine)
        t = results.trajectories["drop-box-anyhow", engine, DT].t[1:]
        for time in np.arange(0.1, 2.0, 0.084):
            shown.get(f"viewer.seek({time})")
            recent = (t <= time + 1e-9) & (t >= time - 0.25 - 1e-9) & (J > 4.0 * WEIGHT)
            text = shown.cell(engine)
            if not recent.any():
                assert text == "–"
                continue
            largest = np.argmax(np.where(recent, J, 0.0))
            impulse, at = text.removesuffix(" s").split(" at ")
            assert float(impulse) == pytest.approx(J[largest], rel=6e-3)
            assert float(at) == pytest.approx(t[largest], abs=6e-4)
            held += J[recent][-1] < J[largest]
    assert held > 5


def hues(colours):
    """In degrees, of sRGB colours, shape (..., 3); NaN for greys."""
    r, g, b = np.moveaxis(np.asarray(colours, dtype=float), -1, 0)
    high, spread = np.maximum(np.maximum(r, g), b), np.ptp(colours, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        sectors = np.where(high == r, (g - b) / spread, np.where(high == g, 2 + (b - r) / spread, 4 + (r - g) / spread))
    return np.where(spread < 60, np.nan, 60.0 * sectors % 360.0)


def test_chosen_body_is_filled_and_no_other(replay):
    """By pointer and by keyboard: most coloured pixels have the hue of its engine."""
    shown = replay("spin-asymmetric")
    colours = [[int(style.colour[i : i + 2], 16) for i in (1, 3, 5)] for style in engine_styles(ENGINES).values()]
    radios = [shown.home.get_by_role("radio", name=human_label(engine)) for engine in ENGINES]
    for number, choose in enumerate([radios[0].check, lambda: radios[0].press("ArrowDown"), radios[2].check]):
        choose()
        assert radios[number].is_checked()
        found = hues(shown.picture())
        found = found[~np.isnan(found)]
        away = np.abs((found[:, None] - hues(np.array(colours)) + 180.0) % 360.0 - 180.0)
        counts = np.bincount(np.argmin(away, axis=1), minlength=3)
        assert counts[number] > 3 * (counts.sum() - counts[number])


def test_marked_face_has_the_attitude_of_the_run(replay, results):
    """Six of eight points on the face along the body's axis z are light, where it is seen; on no other face is one."""
    shown = replay("spin-asymmetric")
    shown.home.get_by_role("radio", name="MuJoCo").check()
    for label in ("Wang's method", "PyBullet", "exact solution"):
        shown.home.get_by_label(f"show {label}").uncheck()
    motion = results.trajectories["spin-asymmetric", "mujoco", DT]
    half = np.array(results.scenes["spin-asymmetric"].body.half_extents)
    ring = np.array([[0.55 * np.cos(a), 0.55 * np.sin(a), 1.0] for a in np.arange(8) * np.pi / 4])
    faces = np.array([np.roll(ring * [1, 1, side], axis + 1, axis=1) for axis in range(3) for side in (1, -1)]) * half
    marked, seen = 4, []
    for row in range(0, len(motion), 60):
        x, q = motion.position[row], motion.orientation[row]
        points = x + rotate(q, faces.reshape(-1, 3))
        found = shown.home.page.evaluate(PROJECT, [points.tolist(), float(motion.t[row]), shown.number])
        places = np.rint(found["places"]).astype(int)
        light = shown.picture()[places[:, 1], places[:, 0]].min(axis=1).reshape(6, 8) > 150
        towards = (np.array(found["eye"]) - x) / np.linalg.norm(np.array(found["eye"]) - x)
        for face, normal in enumerate(rotate(q, np.sign(faces.mean(axis=1).round(9)))):
            if normal @ towards > 0.4:
                assert light[face].sum() >= 6 if face == marked else not light[face].any()
                seen += [q] * (face == marked)
    assert max(angle_between_orientations(seen[0], other) for other in seen) > 1.0


def test_fast_spin_is_played_slowly_and_faster_play_is_announced(replay):
    """500 rad/s: at a fiftieth a turn takes 2π 60 50 / 500 = 38 frames, at real time less than one."""
    shown = replay("spin-principal-500")
    speed, note = shown.home.get_by_label("speed"), shown.home.locator("p[role=status]")
    assert speed.input_value() == "0.02"
    assert note.inner_text() == "The body turns 80 times a second; at speed 1/50 a turn takes 38 frames of a 60 Hz screen."
    speed.select_option("1")
    assert "too few to show it" in note.inner_text()
    slow = replay("drop-box-anyhow")
    assert not slow.home.locator("p[role=status]").is_visible()


def test_view_turns_moves_zooms_and_resets(replay):
    shown = replay("drop-box-corner")
    box = shown.canvas.bounding_box()
    mouse = shown.home.page.mouse

    def camera():
        return shown.get("[viewer.camera.azimuth, viewer.camera.elevation, [...viewer.camera.offset], viewer.camera.zoomFactor]")

    def drag(button="left"):
        mouse.move(box["x"] + 200, box["y"] + 200)
        mouse.down(button=button)
        mouse.move(box["x"] + 240, box["y"] + 230)
        mouse.up(button=button)

    first = camera()
    drag()
    turned = camera()
    assert turned[:2] == pytest.approx([first[0] - 0.32, first[1] + 0.24])
    assert turned[2:] == first[2:]
    point = "viewer.camera.view({ left: 0, top: 0, width: 600, height: 400 }).seen([0, 0, 0])"
    before = shown.get(point)
    drag(button="right")
    moved = camera()
    assert moved[:2] == turned[:2]
    assert moved[2] != turned[2]
    after = shown.get(point)
    assert (after["x"] - before["x"]) * (after["y"] - before["y"]) > 0.0  # to the right and down, as the pointer
    shown.home.page.keyboard.down("Shift")
    drag()
    shown.home.page.keyboard.up("Shift")
    assert camera()[2] != moved[2]
    assert camera()[:2] == moved[:2]
    for key in ("Shift+ArrowLeft", "ArrowUp", "+"):
        earlier = camera()
        shown.canvas.press(key)
        assert camera() != earlier
    shown.canvas.press("0")
    assert camera() == first
    drag()
    shown.home.get_by_role("button", name="Reset view").click()
    assert camera() == first


def test_steps_loop_and_speed(replay):
    shown = replay("drop-box-corner")
    interval = shown.get("viewer.interval")
    shown.home.get_by_role("button", name="one frame on").click()
    shown.canvas.press(".")
    assert shown.get("viewer.time") == pytest.approx(2 * interval)
    shown.canvas.press(",")
    assert shown.get("viewer.time") == pytest.approx(interval)
    shown.home.get_by_label("speed").select_option("2")
    shown.home.get_by_label("loop").check()
    shown.get("viewer.seek(viewer.duration - 1e-3)")
    shown.canvas.press(" ")
    shown.home.page.wait_for_function(
        "() => (viewer => viewer.running && viewer.time < 0.5 * viewer.duration)(document.querySelector('[data-replay]').viewer)"
    )
    shown.canvas.press(" ")
    assert shown.get("viewer.running") == 0


def test_click_into_the_strip_goes_to_the_nearest_impact(replay, results):
    shown = replay("drop-box-anyhow")
    J = step_impulses(results, "drop-box-anyhow", "mujoco")
    times = results.trajectories["drop-box-anyhow", "mujoco", DT].t[1:][J > 4.0 * WEIGHT]
    strip = shown.home.get_by_role("img", name="impacts of MuJoCo")
    width, duration = strip.bounding_box()["width"], shown.get("viewer.duration")
    for at in (0.1, 0.3, 0.6, 0.95):
        strip.click(position={"x": at * width, "y": 10})
        time = shown.get("viewer.time")
        assert np.abs(times - time).min() < 1e-8
        assert abs(time - at * duration) <= np.abs(times - at * duration).min() + duration / width


def test_body_fills_the_view_at_any_width(replay):
    """A body that falls twice its size: its corners span more than a third of the height, all of them inside."""
    for width in (400, 1600):
        shown = replay("drop-box-corner", viewport={"width": width, "height": 900})
        for time in (0.0, 0.3, 0.6):
            corners = shown.get(
                f"""(viewer.go({time}), viewer.body.corners(viewer.chosen.at({time})).map(viewer.camera.view(
                {{left: 0, top: 0, width: viewer.canvas.clientWidth, height: viewer.canvas.clientHeight}},
                viewer.camera.around(viewer.motions.map(motion => motion.at({time}).position))).seen).map(place => [place.x, place.y]))"""
            )
            size = shown.get("[viewer.canvas.clientWidth, viewer.canvas.clientHeight]")
            corners = np.array(corners)
            assert np.ptp(corners[:, 1]) > size[1] / 3
            assert (corners > 0.0).all()
            assert (corners < size).all()
        boxes = shown.home.locator(".controls").evaluate_all("all => all.map(one => one.getBoundingClientRect().toJSON())")
        assert max(box["right"] for box in boxes) <= width


def test_slow_motion_around_an_impact(replay):
    """Key S: within a quarter of a second on the screen before and after an impact, a fifth of the speed."""
    shown = replay("drop-box-corner")
    shown.home.get_by_label("speed").select_option("0.5")
    impact = shown.get("viewer.chosen.impacts[0].time")
    paces = f"[{impact} - 0.2, {impact} - 0.1, {impact} + 0.1].map(time => (viewer.go(time), viewer.pace()))"
    assert shown.get(paces) == [0.5, 0.5, 0.5]
    shown.canvas.press("s")
    assert shown.home.get_by_label("slow at impacts").is_checked()
    assert shown.get(paces) == [0.5, 0.1, 0.1]


def test_nothing_moves_by_itself(replay):
    shown = replay("drop-box-corner", reduced_motion="reduce")
    waited = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done([viewer.time, viewer.running]))))"
    assert shown.get(waited) == [0, 0]
    assert not shown.home.get_by_label("loop").is_checked()


def test_only_scenes_near_the_window_build_their_view(opened):
    page = opened("replay.html", viewport={"width": 900, "height": 600})
    built = "() => [...document.querySelectorAll('[data-replay]')].map(home => home.viewer !== undefined)"
    page.tab.locator("canvas").first.wait_for()
    assert page.tab.evaluate(built) == [True, False, False, False]
    page.tab.locator("[data-replay]").last.scroll_into_view_if_needed()
    page.tab.locator("[data-replay] canvas").nth(1).wait_for()
    assert page.tab.evaluate(built)[3]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_no_violation_while_an_impulse_is_held(replay, scheme):
    shown = replay("drop-box-corner", color_scheme=scheme)
    shown.home.get_by_role("button", name="next impact").click()
    replay("spin-principal-500")
    found = Axe().run(shown.home.page)
    assert found.violations_count == 0, found.generate_report()
