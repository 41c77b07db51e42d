"""How the documentation is built: `make docs`."""

from importlib import metadata
from pathlib import Path
from typing import Any

project = "dropspin"
release = metadata.version(project)
author = copyright = "The dropspin authors"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_click", "sphinx_copybutton"]
myst_heading_anchors = 3
napoleon_custom_sections = ["Source", "Valid for"]
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_format = "short"
html_theme = "furo"  # which asks for nothing from elsewhere
html_title = project
exclude_patterns = ["out"]
nitpicky = False

CATALOGUE = Path(__file__).parent / "reference" / "catalogue.md"


def table(rows: list[dict[str, Any]]) -> str:
    """Rows as a Markdown table."""
    heads = list(rows[0])
    processes = [[str(row[head]).replace("|", "\\|") for head in heads] for row in rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in [heads, ["---"] * len(heads), *processes])


def write_catalogue(_: Any) -> None:
    """Write the page of what `dropspin list` lists."""
    from reports.views import listings as look

    listed = {"Scenes": look.scene_rows(), "Engines": look.engine_rows(), "Metrics": look.metric_rows()}
    parts = ["# Scenes, engines, metrics", *(f"## {title}\n\n{table(rows)}" for title, rows in listed.items())]
    CATALOGUE.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def setup(app: Any) -> None:
    """Have the catalogue's page written before pages are read."""
    app.connect("builder-inited", write_catalogue)
