"""Rows as a table on a terminal, or as JSON."""

import json
import math
from typing import TYPE_CHECKING

import click
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    import pandas as pd


def print_rows(rows: list[dict[str, str]], json_output: bool) -> None:
    """Print rows with the same keys as a table, or as JSON."""
    if json_output:
        click.echo(json.dumps(rows, indent=1, ensure_ascii=False))
        return
    table = Table(box=SIMPLE_HEAD, pad_edge=False, show_header=list(rows[0]) not in (["what", "is"], ["what", "found"]))
    for number, column in enumerate(rows[0]):
        table.add_column(column, overflow="fold", no_wrap=number == 0 and len(rows[0]) > 2)
    for row in rows:
        table.add_row(*(Text(value) for value in row.values()))
    Console().print(table)


def json_rows(frame: "pd.DataFrame") -> str:
    """A table as JSON with all digits; a number that is not finite is null."""
    rows = [
        {key: None if isinstance(value, float) and not math.isfinite(value) else value for key, value in row.items()}
        for row in frame.to_dict("records")
    ]
    return json.dumps(rows, indent=1, ensure_ascii=False, allow_nan=False)
