"""Draw the pictures of pages: run the Python blocks of each page one after another; a block draws the picture below it."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGES = [Path(__file__).parents[1] / name for name in ("examples.md", "measured.md", "note.md")]
BLOCK = re.compile(r"^```python\n(?P<lines>.*?)^```\n(?:\n!\[[^]]+\]\((?P<picture>[^)]+)\)$)?", re.DOTALL | re.MULTILINE)


def drawn(page: Path) -> "Iterator[tuple[Path, Figure]]":
    """The file of each picture of a page, and the figure that its block draws."""
    import matplotlib.pyplot as plt

    names: dict[str, Any] = {}
    for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
        exec(block["lines"], names)
        if block["picture"]:
            yield page.parent / block["picture"], plt.gcf()
            plt.close("all")


def draw(page: Path) -> None:
    """Write every picture of a page."""
    from matplotlib import rc_context

    style: Any = {"backend": "agg", "figure.figsize": (5.5, 3.4), "figure.constrained_layout.use": True}
    style |= {"font.size": 9.0, "savefig.bbox": "tight", "svg.hashsalt": "dropspin"}
    with rc_context(style):
        for path, figure in drawn(page):
            path.parent.mkdir(exist_ok=True)
            figure.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    for page in PAGES:
        draw(page)
