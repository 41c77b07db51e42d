"""Pages with plots: their lines run as they stand, and draw."""

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest

DOCS = Path(__file__).parents[2] / "docs"
PAGES = {"examples": 12, "note": 4}
"""With how many pictures."""


@pytest.fixture(scope="module")
def drawer():
    """The program behind `make examples`."""
    described = importlib.util.spec_from_file_location("draw", DOCS / "examples" / "draw.py")
    program = importlib.util.module_from_spec(described)
    described.loader.exec_module(program)
    return program


@pytest.mark.parametrize("name", PAGES)
def test_every_block_runs_and_draws(drawer, name):
    """As in a notebook, one after another; each picture's axes have labels, a legend and data that are numbers."""
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
            assert axes.name == "3d" or (axes.get_xlabel() and axes.get_ylabel()), path
            found[path.name] = figure
    assert len(found) == PAGES[name]


@pytest.mark.parametrize("name", PAGES)
def test_pictures_and_page_belong_together(drawer, name):
    """Each block but the imports is followed by its picture, which is there and small; no other picture is."""
    text = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    blocks = list(drawer.BLOCK.finditer(text))
    assert len(blocks) == text.count("```python")
    assert not blocks[0]["picture"]
    assert all(block["picture"] for block in blocks[1:])
    assert all(block["lines"].count("\n") <= 3 for block in blocks[1:])
    pictures = {DOCS / block["picture"] for block in blocks[1:]}
    assert set((DOCS / name).glob("*.svg")) == pictures
    assert max(picture.stat().st_size for picture in pictures) < 150_000


def test_page_shows_every_plot():
    """Each public function that draws into axes stands on it."""
    from reports import plots

    drawing = [name for name in plots.__all__ if name.startswith("plot_")]
    assert set(drawing) == set(re.findall(r"plots\.(plot_\w+)\(", (DOCS / "examples.md").read_text(encoding="utf-8")))
