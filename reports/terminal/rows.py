"""Rows as a table on a terminal, or as JSON."""

import json
import math
import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import click
from rich.box import SIMPLE_HEAD
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    import pandas as pd

PIECES = re.compile(r"(?<=\s)(?!(?<=\d\s)\S{1,4}\b)|(?:(?<=\w[\[=])|(?<=\w,))(?=[A-Za-z])")
"""Where a line of a cell may end: at a space, but not between a number and its unit; and between the options of an engine."""
GAP = 3
"""Characters between two columns of a table."""


def print_rows(rows: list[dict[str, str]], json_output: bool) -> None:
    """Print rows with the same keys as a table, or as JSON."""
    if json_output:
        click.echo(json.dumps(rows, indent=1, ensure_ascii=False))
        return
    console = Console()
    cells = [list(rows[0]), *(list(row.values()) for row in rows)]
    widths = _widths(cells, console.width)
    table = Table(box=SIMPLE_HEAD, pad_edge=False, show_header=cells[0] not in (["what", "is"], ["what", "found"]))
    for column, width in zip(cells[0], widths, strict=True):
        table.add_column(Text(_wrapped(column, width)), overflow="fold")
    for row in cells[1:]:
        table.add_row(*(Text(_wrapped(value, width)) for value, width in zip(row, widths, strict=True)))
    console.print(table)


def print_sentences(sentences: Iterable[str]) -> None:
    """Print sentences, one after the other, with line breaks between words."""
    console = Console()
    for sentence in sentences:
        console.print(Text(sentence))


def _widths(cells: Sequence[Sequence[str]], available: int) -> list[int]:
    """The width of each column: as wide as its cells if all fit, else the widest are narrowed.

    Words are kept whole if possible; the first of several columns, which has the names, is narrowed last.
    """
    columns = list(zip(*cells, strict=True))
    widths = [max(cell_len(line) for cell in column for line in cell.splitlines() or [""]) for column in columns]
    longest = [max(cell_len(piece.rstrip()) for cell in column for piece in PIECES.split(cell)) for column in columns]
    while sum(widths) + GAP * len(widths) - 1 > available and max(widths) > 1:
        widest = max(
            range(len(widths)), key=lambda number: (widths[number] > longest[number], number > 0 or len(widths) == 2, widths[number])
        )
        widths[widest] -= 1
    return widths


def _wrapped(text: str, width: int) -> str:
    """A text with line breaks between its pieces, so that no line is wider unless a piece is."""
    lines = [""]
    for piece in PIECES.split(text):
        if lines[-1] and cell_len(lines[-1] + piece.rstrip()) > width:
            lines.append("")
        lines[-1] += piece
    return "\n".join(line.rstrip() for line in lines)


def json_rows(frame: "pd.DataFrame") -> str:
    """A table as JSON with all digits; a number that is not finite is null."""
    rows = [
        {key: None if isinstance(value, float) and not math.isfinite(value) else value for key, value in row.items()}
        for row in frame.to_dict("records")
    ]
    return json.dumps(rows, indent=1, ensure_ascii=False, allow_nan=False)
