"""A document as data: what a story makes of results, and what the terminal, HTML pages and Markdown show.

A page begins with the summary; a terminal, on which the last lines are read first, ends with it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from dropspin.reports.plots.chart import Chart


Rows = list[dict[str, str]]
"""The rows of a table, by column."""


@dataclass(frozen=True, kw_only=True)
class Part:
    """A part of a document.

    Attributes:
        on_page: Whether a page shows it.
        on_terminal: Whether a terminal shows it.
    """

    on_page: bool = True
    on_terminal: bool = True

    @property
    def kind(self) -> str:
        """The name of its class in lower case."""
        return type(self).__name__.lower()


@dataclass(frozen=True)
class Heading(Part):
    """A heading within a page; a terminal shows it as a sentence, or not at all."""

    text: str
    on_terminal: bool = field(default=False, kw_only=True)


@dataclass(frozen=True)
class Paragraph(Part):
    """A text, followed by a command as code if there is one; `style` is that of a terminal, and bold is bold on a page too."""

    text: str
    command: str = ""
    style: str = ""


@dataclass(frozen=True)
class Sentences(Part):
    """A list of sentences, on a page each with a command below it if there are any; `style` is that of a terminal."""

    items: Sequence[str]
    numbered: bool = False
    style: str = ""
    commands: Sequence[str] = ()


@dataclass(frozen=True)
class Table(Part):
    """Rows of texts by column; a narrow terminal leaves out the columns in `left_out_first`, in this order.

    An HTML page colours the cells for which `levels` has the decade of an error, from 0 to 8, by row and column.
    """

    rows: Sequence[Mapping[str, str]]
    left_out_first: Sequence[str] = ()
    levels: Sequence[Mapping[str, int | None]] = ()


@dataclass(frozen=True)
class Charts(Part):
    """A picture of charts; a terminal does not show it."""

    name: str
    charts: "Sequence[Chart]" = ()


class Document(NamedTuple):
    """A document. Lists and tables without content are not shown.

    Attributes:
        title: The title of the page; a terminal does not show it.
        parts: The parts, in order.
        summary: The parts that a page shows first and a terminal last.
    """

    title: str
    parts: Sequence[Part]
    summary: Sequence[Part] = ()
