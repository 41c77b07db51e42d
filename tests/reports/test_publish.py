"""The site of a record: its pages, links and badges, and the folder that it replaces."""

import json
import re
from datetime import date
from html.parser import HTMLParser

import pytest
from support.cli import assert_refused, dropspin
from support.small_record import HOSTILE, SCENES, rows, write_record

from dropspin.comparisons.record.store import Record, machine


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    write_record(folder / "record")
    done = dropspin("record", "publish", cwd=folder)
    assert (done.returncode, done.stdout) == (0, "Site: out/site-record/index.html\n"), done.stderr
    return folder / "out/site-record"


class Page(HTMLParser):
    """The links, the ids and the text of a page."""

    def __init__(self, file):
        super().__init__()
        self.links, self.ids, self.texts = [], [], []
        self.feed(file.read_text(encoding="utf-8"))
        self.text = " ".join(" ".join(self.texts).split())

    def handle_starttag(self, tag, attributes):
        assert tag != "img"
        given = dict(attributes)
        self.links += [given["href"]] if "href" in given else []
        self.ids += [given["id"]] if "id" in given else []

    def handle_data(self, data):
        self.texts.append(data)


def test_every_link_leads_to_a_page_and_ids_are_unique(site):
    pages = {file.name: Page(file) for file in site.glob("*.html")}
    engines, scenes = ("engine-mujoco.html", "engine-pybullet.html"), tuple(f"scene-{scene}.html" for scene in SCENES)
    releases = [f"release-{name}.html" for name in ("mujoco-3.9.0", "mujoco-3.10.0", "mujoco-3.11.0", "pybullet-3.2.7")]
    assert sorted(pages) == sorted(["index.html", *engines, *scenes, *releases])
    for name, page in pages.items():
        assert len(set(page.ids)) == len(page.ids)
        for link in page.links:
            file, _, place = link.partition("#")
            assert (site / (file or name)).is_file(), link
            assert not place or place in pages[file or name].ids, link


def test_page_of_an_engine_says_what_changed_in_which_release(site):
    """12.7 dt before and 0.001 dt from 3.11.0 on; 3.10.1 could not be installed and is passed over."""
    text = Page(site / "engine-mujoco.html").text
    both = "with MuJoCo, MuJoCo (default settings)"
    newest, older = text[text.index("3.11.0 after 3.10.0; 8 values changed") :].split("3.10.0 after 3.9.0; 4 values changed")
    assert f"spin-asymmetric {both}: orientation error 0.0127 → 1.00e-06 rad at dt = 1 ms" in newest
    assert f"drop-ball {both}: declined → measured (before: {HOSTILE})" in older
    assert f"3.10.1 could not be measured: not installable: {HOSTILE}" in older
    assert "unchanged since" in text
    assert "3.10.0 3.11.0" in text  # the columns of releases
    page = (site / "engine-mujoco.html").read_text(encoding="utf-8")
    start = "orientation error 1.00e-06 rad, 2 ms per simulated second, 20 times that of Wang&#39;s method, mujoco 3.11.0"
    [title] = set(re.findall(f'title="({start}[^"]*)"', page))
    assert title.endswith("to repeat it: dropspin record rerun mujoco 3.11.0 spin-asymmetric")


def test_page_of_a_release_says_what_changed_in_it_and_has_the_command_of_each_cell(site):
    text = Page(site / "release-mujoco-3.11.0.html").text
    assert "over all metrics and time steps, that differ from those of 3.10.0 by more than rounding: 8." in text
    assert "drop-ball with MuJoCo, MuJoCo (default settings): bounce height error 0.0127 → 1.00e-06 at dt = 1 ms" in text
    for label in ("mujoco", "'mujoco[profile=default]'"):
        assert f"To repeat a result: dropspin record rerun {label} 3.11.0 SCENE" in text
    assert "drop-ball bounce height error 4.00e-06 2.00e-06 to 8.00e-06 1.00e-06 5.00e-07 to 2.00e-06 6.0 2 ms" in text
    assert "This is the first release that was measured." in Page(site / "release-mujoco-3.9.0.html").text
    assert "declined" in Page(site / "release-mujoco-3.9.0.html").text


def test_page_of_a_scene_has_error_range_over_starts_and_cost(site):
    text = Page(site / "scene-drop-ball.html").text
    assert "MuJoCo 3.11.0 4.00e-06 2.00e-06 to 8.00e-06 500 µs 1.00e-06 5.00e-07 to 2.00e-06 2 ms" in text


def test_index_has_the_digits_of_the_newest_releases(site):
    """1e-3 ms: 6 digits; PyBullet's error of 0: 15. PyBullet has no default settings in the record."""
    page = (site / "index.html").read_text(encoding="utf-8")
    calibrated, default = page.split('id="default"')[0], page.split('id="default"')[1].split("<section")[0]
    found = re.findall(r'data-engine="(\d)" data-status="measured"><a href="([^"]*)">([\d.]+)</a>', calibrated)
    mujoco, pybullet = ("0", "engine-mujoco.html#options-1", "6.0"), ("2", "engine-pybullet.html#options-1", "15.0")
    assert found == [mujoco, pybullet, mujoco, pybullet]
    assert re.findall(r'data-engine="(\d)" data-status', default) == ["1", "1"]


def test_index_counts_releases_with_results_and_tells_results_from_scenes_that_were_declined_before(site):
    text = Page(site / "index.html").text
    assert "MuJoCo : 3 of 4 releases have results; results changed in 3.11.0; scenes gained or lost results in 3.10.0 ( badge" in text


def test_page_of_an_engine_counts_the_results_of_others_that_are_the_same(site):
    """Of eight, the four with default settings differ, and one of the others was declined here."""
    text = Page(site / "engine-mujoco.html").text
    machine = f"another {HOSTILE}"
    assert f"the same 3.9.0 {date.today()} {machine}" in text
    assert "mujoco 3.9.0 2 of 8 results" in text


def test_badges_are_those_of_shields_io(site):
    assert {file.name: json.loads(file.read_text()) for file in (site / "badges").iterdir()} == {
        "mujoco.json": {
            "schemaVersion": 1,
            "label": "mujoco 3.11.0",
            "message": "median 6.0 digits in 2 of 2 scenes",
            "color": "blue",
        },
        "pybullet.json": {
            "schemaVersion": 1,
            "label": "pybullet 3.2.7",
            "message": "median 15.0 digits in 2 of 2 scenes",
            "color": "blue",
        },
    }


def test_site_replaces_an_earlier_site_and_nothing_else(site):
    before = {file: file.read_bytes() for file in site.rglob("*.html")}
    stale = site / "engine-gone.html"
    stale.write_text("")
    assert dropspin("record", "publish", cwd=site.parents[1]).returncode == 0
    assert {file: file.read_bytes() for file in site.rglob("*.html")} == before
    other = site.parents[1] / "other"
    other.mkdir()
    (other / "index.html").write_text("mine")
    assert_refused(
        dropspin("record", "publish", "-o", "other", cwd=site.parents[1]), "has files that dropspin record publish did not write"
    )
    assert (other / "index.html").read_text() == "mine"


def test_site_within_the_documentation_links_to_it(site):
    folder = site.parents[1]
    (folder / "docs").mkdir()
    (folder / "docs/problems.html").write_text("")
    assert dropspin("record", "publish", "record", "-o", "docs/record", cwd=folder).returncode == 0
    assert "../problems/DS-008.html" in Page(folder / "docs/record/scene-spin-asymmetric.html").links
    assert "../index.html" in Page(folder / "docs/record/index.html").links


def test_releases_of_another_machine_are_left_out_with_a_word(tmp_path):
    """A new release that another machine measured is on no page."""
    write_record(tmp_path / "record")
    here = Record(tmp_path / "record")
    here.write("pybullet", "3.2.7", [*rows("pybullet", 0.0)], {**machine(), "processor": "another", "versions": "pybullet 3.2.7"})
    here.write("mujoco", "3.12.0", [*rows("mujoco", 0.0)], {**machine(), "processor": "another", "versions": "mujoco 3.12.0"})
    done = dropspin("record", "publish", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stderr == "left out: mujoco 3.12.0, measured on another machine than most releases of mujoco\n"


def test_folder_without_a_record_is_refused(tmp_path):
    assert_refused(dropspin("record", "publish", "nothing", cwd=tmp_path), "nothing: has no release that was measured here")
