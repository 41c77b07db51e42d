"""A matplotlib figure as a file: deterministic SVG, or PNG."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure


def save_svg(figure: "Figure", file: "Path") -> None:
    """Save a figure as SVG with text as text, on white; equal figures give equal files."""
    from matplotlib import rc_context

    with rc_context({"svg.fonttype": "none", "svg.hashsalt": file.stem}):
        figure.savefig(file, facecolor="white", metadata={"Date": None, "Creator": None})


def save_png(figure: "Figure", file: "Path") -> None:
    """Save a figure as PNG, on white."""
    figure.savefig(file, dpi=200, facecolor="white", metadata={"Software": None})
