"""A matplotlib figure as SVG: small, deterministic, in the colours of the page it stands in."""

import io
import re
from typing import TYPE_CHECKING

from reports.plots import FAINT, INK

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def svg(figure: "Figure", identifier: str) -> str:
    """A figure as an `<svg>` element whose ids start with `identifier`, so that many can stand in one page."""
    from matplotlib import rc_context

    buffer = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": identifier}):
        figure.savefig(buffer, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = text.replace(INK, "currentColor").replace(FAINT, "currentColor")
    text = re.sub(r'\bid="([^"]+)"', rf'id="{identifier}-\1"', text)
    text = re.sub(r'(url\(#|href="#)([^")]+)', rf"\1{identifier}-\2", text)
    return re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL).strip()
