"""Printable text: one line, without control characters, bidirectional marks, or lone surrogates."""

import json
from typing import Annotated

from pydantic import AfterValidator, BeforeValidator


def printable(text: str) -> str:
    r"""A text with an escape in place of each character that is not printable, such as \u001b or \n. The text of JSON stays valid."""
    return "".join(one if one.isprintable() else json.dumps(one)[1:-1] for one in text)


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


Text = Annotated[str, AfterValidator(verify_line)]
"""A field of a model whose value is printable text."""
Prose = Annotated[Text, BeforeValidator(joined)]
"""A field of a model whose value may be written over several lines, which are joined to one."""
