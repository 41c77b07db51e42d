"""Settings of Sphinx, which builds the documentation: `make docs`."""

from importlib import metadata
from pathlib import Path
from typing import Any

import dropspin

project = "dropspin"
release = metadata.version(project)
author = copyright = "The dropspin authors"

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_click", "sphinx_copybutton"]
myst_heading_anchors = 3
napoleon_custom_sections = ["Source", "Valid for"]
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_format = "short"
html_theme = "furo"  # its pages load nothing from other servers
html_title = project
exclude_patterns = ["out"]
nitpicky = False

CATALOGUE = Path(__file__).parent / "reference" / "catalogue.md"


def table(rows: list[dict[str, Any]]) -> str:
    """Rows as a Markdown table."""
    columns = list(rows[0])
    cells = [[str(row[column]).replace("|", "\\|") for column in columns] for row in rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in [columns, ["---"] * len(columns), *cells])


def write_catalogue(_: Any) -> None:
    """Write the page with the lists of `dropspin list`, and of `dropspin show` for installed engines whose settings can be given."""
    from dropspin.comparisons.engines.registry import engine
    from dropspin.reports.stories import listings
    from dropspin.reports.stories.show import setting_rows

    listed = {"Scenes": listings.scene_rows(), "Engines": listings.engine_rows(), "Metrics": listings.metric_rows()}
    names = [row["engine"] for row in listed["Engines"] if row["installed"] == "yes" and engine(row["engine"]).settings]
    listed |= {f"Settings of {name}": setting_rows(name) for name in names}
    parts = ["# Scenes, engines, metrics", *(f"## {title}\n\n{table(rows)}" for title, rows in listed.items())]
    CATALOGUE.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def setup(app: Any) -> None:
    """Write the page of the catalogue before Sphinx reads the pages."""
    for name in dropspin.__all__:  # autodoc imports with typing.TYPE_CHECKING set, which pydantic's models do not bear
        getattr(dropspin, name)
    app.connect("builder-inited", write_catalogue)
