"""A matplotlib figure as small, deterministic SVG in the colours of its page; and as PNG."""

import io
import json
import re
from typing import TYPE_CHECKING

from markupsafe import escape

from reports.plots.style import FAINT, INK, TIME

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure


def svg(figure: "Figure", identifier: str) -> str:
    """A figure as an `<svg>` element whose ids start with `identifier`, so that a page can have many."""
    from matplotlib import rc_context

    buffer = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": identifier}):
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = text.replace(INK, "currentColor").replace(FAINT, "currentColor")
    text = with_ids_of(text, identifier)
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL).strip()
    wanted = set(re.findall(r'(?:url\(#|href="#)([^")]+)', text))
    text = re.sub(r' id="([^"]+)"', lambda found: found.group() if found[1] in wanted else "", text)
    # A hundredth of a point is finer than can be seen.
    text = re.sub(r'\b(?:d|x|y|transform)="[^"]*"', lambda found: re.sub(r"(\.\d\d)\d+", r"\1", found.group()), text)
    panels = over_time(figure)
    return text.replace("<svg ", f'<svg data-over-time="{escape(json.dumps(panels))}" ', 1) if panels else text


def with_shared_styles(drawings: dict[str, str]) -> tuple[str, dict[str, str]]:
    """CSS rules, and the SVG elements with classes instead of styles: the plots share few styles, which make up half of their size."""
    classes: dict[str, str] = {}

    def shared(found: re.Match[str]) -> str:
        name = classes.setdefault(found[1], f"p{len(classes)}")
        return f' class="{name}"'

    drawn = {name: re.sub(r' style="([^"]*)"', shared, text) for name, text in drawings.items()}
    return "\n".join(f".{name} {{ {style} }}" for style, name in classes.items()), drawn


def with_ids_of(svg_element: str, prefix: str) -> str:
    """An SVG element with a prefix to its ids: two studies may have drawn pictures of one name."""
    return re.sub(r'(\bid="|url\(#|href="#)', rf"\1{prefix}-", svg_element)


def save_png(figure: "Figure", file: "Path") -> None:
    """Save a figure as PNG, on white."""
    figure.savefig(file, dpi=200, facecolor="white", metadata={"Software": None})


def over_time(figure: "Figure") -> list[dict[str, float]]:
    """The panels over time of a drawn figure: edges in points from the upper left, and the first and last time shown [s]."""
    width, height = 72.0 * figure.get_size_inches()
    found = []
    for axes in figure.axes:
        if axes.get_xlabel() == TIME:
            box, (first, last) = axes.get_position(), axes.get_xlim()
            edges = {"left": box.x0 * width, "right": box.x1 * width, "top": (1.0 - box.y1) * height, "bottom": (1.0 - box.y0) * height}
            found.append({name: round(float(value), 6) for name, value in {**edges, "from": first, "to": last}.items()})
    return found
