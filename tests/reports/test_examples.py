"""The page of plots: its lines run as they stand, and draw."""

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "examples.md"


@pytest.fixture(scope="module")
def drawer():
    """The program behind `make examples`."""
    described = importlib.util.spec_from_file_location("draw", DOCS / "examples" / "draw.py")
    program = importlib.util.module_from_spec(described)
    described.loader.exec_module(program)
    return program


def test_every_block_runs_and_draws(drawer):
    """As in a notebook, one after another; each picture's axes have labels, a legend and data that are numbers."""
    import matplotlib as mpl

    with mpl.rc_context({"backend": "agg"}):
        found = {}
        for path, figure in drawer.drawn(PAGE):
            [axes] = figure.axes
            lines = [line for line in axes.get_lines() if len(line.get_xdata())]
            assert len(lines) + len(axes.patches) >= 3, path
            assert all(np.isfinite(np.asarray(line.get_ydata(), dtype=float)).any() for line in lines), path
            assert all(np.isfinite(patch.get_bbox().extents).all() and patch.get_width() >= 0.0 for patch in axes.patches), path
            assert len(axes.get_legend().get_texts()) >= 3
            assert axes.name == "3d" or (axes.get_xlabel() and axes.get_ylabel()), path
            found[path.name] = figure
    assert len(found) == 12


def test_pictures_and_page_belong_together(drawer):
    """Each block but the imports is followed by its picture, which is there and small; no other picture is."""
    blocks = list(drawer.BLOCK.finditer(PAGE.read_text(encoding="utf-8")))
    assert len(blocks) == PAGE.read_text(encoding="utf-8").count("```python")
    assert not blocks[0]["picture"]
    assert all(block["picture"] for block in blocks[1:])
    assert all(block["lines"].count("\n") <= 3 for block in blocks[1:])
    pictures = {DOCS / block["picture"] for block in blocks[1:]}
    assert set((DOCS / "examples").glob("*.svg")) == pictures
    assert max(picture.stat().st_size for picture in pictures) < 150_000


def test_page_shows_every_plot():
    """Each public function that draws into axes stands on it."""
    from reports import plots

    drawing = [name for name in plots.__all__ if name.startswith("plot_")]
    assert set(drawing) == set(re.findall(r"plots\.(plot_\w+)\(", PAGE.read_text(encoding="utf-8")))
