"""A document on the terminal: tables as wide as it is, sentences broken between words; elsewhere, one line for each row and sentence."""

import re
from collections.abc import Iterable, Mapping, Sequence

from rich import box, table
from rich.cells import cell_len
from rich.console import Console

from dropspin.reports.document import Document, Heading, Paragraph, Sentences, Table
from dropspin.reports.output import json_text
from dropspin.reports.terminal.safe_output import echo, styled

SPACES = re.compile(r"(?<=\s)(?!(?<=\d\s)(?:%|\S{1,4}\b))")
"""The places at which a sentence may be broken: spaces that are not between a number and its unit."""
PIECES = re.compile(rf"{SPACES.pattern}|(?:(?<=\w[\[=])|(?<=\w,))(?=[A-Za-z])")
"""The places at which a line of a cell may be broken: those of a sentence, and between options of an engine."""
GAP = 3
"""Number of characters between two columns of a table."""
NARROWEST = 24
"""Width in characters to which columns of text are narrowed before a column is left out."""


def print_json_or(json_output: bool, data: object, document: Document, written: str = "") -> None:
    """Print data as JSON; or a document, and where its page is."""
    if json_output:
        echo(json_text(data))
        return
    print_document(document)
    if written:
        echo(f"Written: {written}")


def print_document(document: Document, console: Console | None = None) -> None:
    """Print a document without its title and its charts, the summary last."""
    console = console or Console()
    for number, part in enumerate(part for part in (*document.parts, *document.summary) if part.on_terminal):
        match part:
            case Heading(text):
                print_sentence(f"\n{text}" if number else text, console)
            case Paragraph(text, command, style):
                if command:
                    console.print(styled(f"{text} {command}".strip(), style), soft_wrap=True)
                else:
                    print_sentence(text, console, style)
            case Sentences(items, style=style):
                for sentence in items:
                    print_sentence(sentence, console, style)
            case Table(rows, left_out_first) if rows:
                print_rows(rows, left_out_first, console)


def print_rows(rows: Sequence[Mapping[str, str]], left_out_first: Sequence[str] = (), console: Console | None = None) -> None:
    """Print rows with the same keys, as a table as wide as the terminal, or as one line per row if the output is no terminal.

    Args:
        rows: The rows.
        left_out_first: The columns to leave out, in this order, if the table is wider than the terminal.
        console: Rich's console to print to; None means standard output.
    """
    console, columns = console or Console(), {key: [key, *(row[key] for row in rows)] for key in rows[0]}
    has_head = list(columns) not in (["what", "is"], ["what", "found"])
    if not console.is_terminal:
        for line in aligned(list(zip(*columns.values(), strict=True))[not has_head :]):
            print_sentence(line, console)
        return
    # The smallest width at which a column is readable: that of its cells, or `NARROWEST` for text.
    least = {key: max(min(max(map(cell_len, cells)), NARROWEST), _longest_piece([key, *cells])) for key, (_, *cells) in columns.items()}
    left_out: list[str] = []
    for key in left_out_first:
        if key in columns and sum(least[name] + GAP for name in columns) - 1 > console.width:
            left_out.append(key)
            del columns[key]
    widths = _widths(list(columns.values()), console.width)
    shown = table.Table(box=box.SIMPLE_HEAD, pad_edge=False, show_header=has_head)
    for key, width in zip(columns, widths, strict=True):
        shown.add_column(styled(_wrapped(key, width)), overflow="fold")
    for cells in list(zip(*columns.values(), strict=True))[1:]:
        shown.add_row(*(styled(_wrapped(cell, width)) for cell, width in zip(cells, widths, strict=True)))
    console.print(shown)
    if left_out:
        print_sentence(f"Columns not shown at this width: {', '.join(left_out)}; use a wider terminal or --json.", console)


def aligned(cells: Sequence[Sequence[str]]) -> list[str]:
    """Rows as lines with aligned columns, one line per row."""
    flat = [[" ".join(cell.split()) for cell in row] for row in cells]
    widths = [max(map(cell_len, column)) for column in zip(*flat, strict=True)]
    return ["  ".join(cell + " " * (width - cell_len(cell)) for cell, width in zip(row, widths, strict=True)).rstrip() for row in flat]


def print_row(cells: Sequence[str], widths: Sequence[int], console: Console) -> None:
    """Print one row of a table whose other rows are not yet known; the last cell has no fixed width and is wrapped on a terminal."""
    head = "  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=False)) + "  "
    text = " ".join(cells[-1].split())
    if console.is_terminal:
        text = _wrapped(text, max(console.width - len(head), NARROWEST)).replace("\n", "\n" + " " * len(head))
    console.print(styled(head + text), soft_wrap=True)


def print_sentence(sentence: str, console: Console, style: str = "") -> None:
    """Print a sentence, on a terminal with line breaks between words, but not between a number and its unit; elsewhere as one line."""
    text = _wrapped(sentence, console.width, SPACES) if console.is_terminal else sentence
    console.print(styled(text, style=style), soft_wrap=not console.is_terminal)  # which breaks long words


def _longest_piece(cells: Iterable[str]) -> int:
    """The length of the longest part of some cells that cannot be broken."""
    return max(cell_len(piece.rstrip()) for cell in cells for piece in PIECES.split(cell))


def _widths(columns: Sequence[Sequence[str]], available: int) -> list[int]:
    """The width of each column: that of its cells if the table fits, otherwise the widest columns are narrowed.

    Words are kept whole if possible. The first column, which has the names, is narrowed last.
    """
    widths = [max(cell_len(line) for cell in column for line in cell.splitlines() or [""]) for column in columns]
    longest = list(map(_longest_piece, columns))
    while sum(widths) + GAP * len(widths) - 1 > available and max(widths) > 1:
        ranks = [(widths[number] > longest[number], number > 0 or len(widths) == 2, widths[number]) for number in range(len(widths))]
        widths[ranks.index(max(ranks))] -= 1
    return widths


def _wrapped(text: str, width: int, places: re.Pattern[str] = PIECES) -> str:
    """A text with line breaks, so that no line is wider than the width unless a single word is."""
    lines = [""]
    for piece in places.split(text):
        if lines[-1] and cell_len(lines[-1] + piece.rstrip()) > width:
            lines.append("")
        lines[-1] += piece
    return "\n".join(line.rstrip() for line in lines)
