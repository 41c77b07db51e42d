"""Pages with plots: their Python blocks run as printed and draw the pictures."""

import importlib.util
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dropspin as ds

DOCS = Path(__file__).parents[2] / "docs"
PAGES = {"examples": 13, "measured": 1, "note": 4}
"""The number of pictures of each page."""


@pytest.fixture(scope="module")
def drawer():
    """The program behind `make examples`."""
    described = importlib.util.spec_from_file_location("draw", DOCS / "examples" / "draw.py")
    program = importlib.util.module_from_spec(described)
    described.loader.exec_module(program)
    return program


@pytest.fixture(scope="module")
def core_results(core_run):
    return ds.load_results(core_run)


@pytest.fixture
def _shared_runs(core_results, monkeypatch):
    """Let `ds.run` return the part of the core run that has these scenes, engines and time steps, if there is one."""
    run = ds.run

    def run_or_share(scene, engines, dt=ds.DEFAULT_DTS):
        dts = set(np.atleast_1d(dt).tolist())
        is_shared = scene in core_results.scenes and {*engines} <= {*core_results.engines} and dts <= {*ds.DEFAULT_DTS}
        return part(core_results, scene, engines, dts) if is_shared else run(scene, engines, dt)

    monkeypatch.setattr(ds, "run", run_or_share)


def part(results, scene, engines, dts):
    """The results of a run with one scene, some engines and some time steps of another run."""
    tables = {}
    for name in ("table", "predictions", "agreements"):
        rows = getattr(results, name)
        at_these = rows["dt"].isin(dts) | (rows["dt"].isna() & (len(dts) == len(ds.DEFAULT_DTS)))
        tables[name] = rows[(rows["scene"] == scene) & rows["engine"].isin(engines) & at_these]
    kept = [
        {key: value for key, value in of_each.items() if key[0] == scene and key[1] in engines and key[2] in dts}
        for of_each in (results.trajectories, results.ensembles)
    ]
    chosen = {scene: results.scenes[scene]}
    return replace(results, **tables, scenes=chosen, engines=tuple(engines), trajectories=kept[0], ensembles=kept[1])


@pytest.mark.extended
@pytest.mark.usefixtures("_shared_runs", "two_rounds")
@pytest.mark.parametrize("name", PAGES)
def test_every_block_runs_and_draws(drawer, name):
    """One after another, as in a notebook; the axes of each picture have labels, a legend and finite data."""
    import matplotlib as mpl

    with mpl.rc_context({"backend": "agg"}):
        found = {}
        for path, figure in drawer.drawn(DOCS / f"{name}.md"):
            [axes] = figure.axes
            lines = [line for line in axes.get_lines() if len(line.get_xdata())]
            assert len(lines) + len(axes.patches) >= 3, path
            assert all(np.isfinite(np.asarray(line.get_ydata(), dtype=float)).any() for line in lines), path
            assert all(np.isfinite(patch.get_bbox().extents).all() and patch.get_width() >= 0.0 for patch in axes.patches), path
            assert len(axes.get_legend().get_texts()) >= 3
            assert not axes.axison or (axes.get_xlabel() and axes.get_ylabel()), path
            found[path.name] = figure
    assert len(found) == PAGES[name]


@pytest.mark.parametrize("name", PAGES)
def test_every_block_has_its_picture_and_no_picture_is_left_over(drawer, name):
    """Each block but the imports is short and followed by a small picture that exists."""
    text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    blocks = list(drawer.BLOCK.finditer(text))
    assert len(blocks) == text.count("```python")
    assert not blocks[0]["picture"]
    assert all(block["picture"] for block in blocks[1:])
    assert all(block["lines"].count("\n") <= 3 for block in blocks[1:])
    pictures = {DOCS / block["picture"] for block in blocks[1:]}
    assert set((DOCS / name).glob("*.svg")) == pictures
    assert max(picture.stat().st_size for picture in pictures) < 150_000


def test_examples_page_shows_every_plot_function():
    from dropspin.reports import plots

    drawing = [name for name in vars(plots) if name.startswith("plot_")]
    assert set(drawing) == set(re.findall(r"plots\.(plot_\w+)\(", (DOCS / "examples.md").read_text(encoding="utf-8")))
