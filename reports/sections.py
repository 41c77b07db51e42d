"""The section of a study: a separate Markdown page, which is also a part of the report of a run."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, ValidationError

from dropspin.comparisons.results.folder import SECTION, file_name, read_stored
from dropspin.reports.plots.chart import Chart, figure_of
from dropspin.reports.plots.chart_data import chart_data
from dropspin.reports.plots.stored_chart import StoredChart, StoredData
from dropspin.reports.plots.svg import save_svg
from dropspin.scenarios import DropspinError
from dropspin.scenarios.text import Text
from dropspin.scenarios.validation import first_problem

Part = dict[str, Any]


@dataclass(frozen=True)
class Section:
    """A title and the parts below it, in order.

    Attributes:
        title: The title.
        parts: Mappings with a `kind` and the keys of this kind: `heading` and `text` have `content`, `list` has `items`, `table` has `rows`
            (texts by column), and `charts` has `name` and `charts` (the data of each chart).
        pictures: The charts of each picture, by name; empty for a section that was read from a file.
    """

    title: str
    parts: list[Part] = field(default_factory=list)
    pictures: dict[str, Sequence[Chart]] = field(default_factory=dict)

    def add_heading(self, content: str) -> None:
        """Add a heading."""
        self.parts.append({"kind": "heading", "content": content})

    def add_text(self, content: str) -> None:
        """Add a paragraph."""
        self.parts.append({"kind": "text", "content": content})

    def add_list(self, items: Sequence[str]) -> None:
        """Add a list of sentences, unless it is empty."""
        if items:
            self.parts.append({"kind": "list", "items": list(items)})

    def add_table(self, rows: Sequence[Mapping[str, str]]) -> None:
        """Add a table, unless it has no rows."""
        if rows:
            self.parts.append({"kind": "table", "rows": [dict(row) for row in rows]})

    def add_charts(self, name: str, charts: Sequence[Chart]) -> None:
        """Add a picture of charts."""
        self.parts.append({"kind": "charts", "name": name, "charts": [chart_data(chart) for chart in charts]})
        self.pictures[name] = charts

    def write(self, folder: Path, stem: str) -> None:
        """Write the Markdown page, its pictures, and `section.json`, from which a report reads the section."""
        (folder / SECTION).write_text(json.dumps({"title": self.title, "parts": self.parts}, indent=1), encoding="utf-8")
        for name, charts in self.pictures.items():
            save_svg(figure_of(charts), folder / f"{file_name(name)}.svg")
        page = "\n\n".join([f"# {self.title}", *map(_markdown, self.parts)])
        (folder / f"{stem}.md").write_text(f"{page}\n", encoding="utf-8")


class _Prose(StoredData):
    kind: Literal["heading", "text"]
    content: Text


class _List(StoredData):
    kind: Literal["list"]
    items: list[Text]


def _same_columns(rows: list[dict[str, str]]) -> list[dict[str, str]]:
    if any(list(row) != list(rows[0]) for row in rows):
        raise ValueError("rows have different columns")
    return rows


class _Table(StoredData):
    kind: Literal["table"]
    rows: Annotated[list[dict[Text, Text]], Field(min_length=1), AfterValidator(_same_columns)]


class _Charts(StoredData):
    kind: Literal["charts"]
    name: Text
    charts: list[StoredChart]


class _File(StoredData):
    title: Text
    parts: list[Annotated[_Prose | _List | _Table | _Charts, Field(discriminator="kind")]]


def read_section(folder: str) -> Section:
    """The section that a study wrote to its folder: texts, which a page escapes, and the data of charts, from which they are drawn.

    Raises:
        DropspinError: The folder has no section, or its section is damaged.
    """
    try:
        found = _File.model_validate_json(read_stored(Path(folder), SECTION))
    except (OSError, ValueError) as error:
        detail = first_problem(_File, error) if isinstance(error, ValidationError) else getattr(error, "strerror", None) or str(error)
        raise DropspinError(
            f"{folder}: has no study, or a damaged one ({SECTION}: {detail.removesuffix('.')}); "
            "give a folder that dropspin tradeoff, limits, symmetries or reproduce wrote."
        ) from None
    return Section(**found.model_dump(by_alias=True, exclude_unset=True))


def _markdown(part: Part) -> str:
    if part["kind"] == "heading":
        return f"## {part['content']}"
    if part["kind"] == "list":
        return "\n".join(f"{number}. {item}" for number, item in enumerate(part["items"], 1))
    if part["kind"] == "table":
        heads = list(part["rows"][0])
        lines = [heads, ["---"] * len(heads), *([cell.replace("|", "\\|") for cell in row.values()] for row in part["rows"])]
        return "\n".join(f"| {' | '.join(line)} |" for line in lines)
    if part["kind"] == "charts":
        return f"![{part['name']}]({file_name(part['name'])}.svg)"
    return str(part["content"])
