"""Printable text: one line, without control characters, bidirectional marks, or lone surrogates."""

import json
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator


def printable(text: str) -> str:
    r"""A text with an escape in place of each character that is not printable, such as \u001b or \n. The text of JSON stays valid."""
    return "".join(char if char.isprintable() else json.dumps(char)[1:-1] for char in text)


def verify_line(text: str) -> str:
    """Return the text unchanged.

    Raises:
        ValueError: The text is not printable.
    """
    if not text.isprintable():
        raise ValueError("must be one line of printable text, without control characters")
    return text


def joined(text: object) -> object:
    """A text with its lines joined to one; anything else unchanged."""
    return " ".join(text.split()) if isinstance(text, str) else text


def counted(count: int, singular: str, plural: str = "") -> str:
    """A number of things, such as 1 scene or 2 scenes."""
    return f"{count:,} {singular if count == 1 else plural or f'{singular}s'}"


def rounded(value: float, digits: int) -> str:
    """A number to some significant digits, without an exponent up to a million."""
    return f"{float(f'{value:.{digits}g}'):g}"


def with_few_digits(value: str) -> str:
    """An option's value; numbers with six digits."""
    try:
        return f"{float(value):g}"
    except ValueError:
        return value


Text = Annotated[str, AfterValidator(verify_line)]
"""A field of a model whose value is printable text."""
Prose = Annotated[Text, BeforeValidator(joined)]
"""A field of a model whose value may be written over several lines, which are joined to one."""
