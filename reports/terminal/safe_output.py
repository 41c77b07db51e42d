"""Output of texts that may come from a file or an engine: no character of theirs controls the terminal."""

from typing import TYPE_CHECKING

import click

from dropspin.scenarios.text import printable

if TYPE_CHECKING:
    from rich.text import Text


def safe(text: str) -> str:
    """A text of one or more lines, each of which is printable."""
    return "\n".join(map(printable, text.split("\n")))


def echo(text: str, *, err: bool = False, nl: bool = True) -> None:
    """Print a text."""
    click.echo(safe(text), err=err, nl=nl)


def styled(text: str, style: str = "") -> "Text":
    """A text for Rich, in a style."""
    from rich.text import Text

    return Text(safe(text), style=style)
