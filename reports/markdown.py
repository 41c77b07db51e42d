"""A document as Markdown."""

import re

from dropspin.comparisons.results.complete_folders import file_name
from dropspin.reports.document import Charts, Document, Heading, Paragraph, Part, Sentences, Table


def markdown(document: Document, level: int = 1) -> str:
    """The page, whose title is a heading of a level."""
    parts = [_block(part, level + 1) for part in (*document.summary, *document.parts) if part.on_page]
    return "\n\n".join(filter(None, [_block(Heading(document.title), level), *parts])) + "\n"


def escaped(text: str) -> str:
    """Text without markup, in one line."""
    return re.sub(r"([\\|`*_\[\]<>#])", r"\\\1", " ".join(text.split()))


def code(text: str) -> str:
    """Text as code; the fence is longer than any sequence of backticks in the text."""
    fence = "`" * (1 + max(map(len, re.findall("`+", text)), default=0))
    room = " " if len(fence) > 1 else ""
    return f"{fence}{room}{text}{room}{fence}"


def _block(part: Part, level: int) -> str:
    match part:
        case Heading(text):
            return f"{'#' * level} {escaped(text)}"
        case Paragraph(text, command, style):
            content = f"**{escaped(text)}**" if style == "bold" else escaped(text)
            return f"{content} {code(command)}" if command else content
        case Sentences(items, numbered, commands=commands):
            below = [f"<br>{code(command)}" for command in commands] or [""] * len(items)
            entries = map(str.__add__, map(escaped, items), below)
            return "\n".join(f"{f'{number}.' if numbered else '-'} {entry}" for number, entry in enumerate(entries, 1))
        case Charts(name):
            return f"![{escaped(name)}]({file_name(name)}.svg)"
        case Table(rows) if rows:
            head, *lines = [f"| {' | '.join(map(escaped, cells))} |" for cells in (rows[0], *(row.values() for row in rows))]
            return "\n".join([head, f"|{'---|' * len(rows[0])}", *lines])
    return ""
