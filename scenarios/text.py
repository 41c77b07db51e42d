"""Printable text: without control characters, bidirectional marks, or lone surrogates."""

from typing import Annotated

from pydantic import AfterValidator

_LAYOUT = frozenset("\n\t")


def printable(text: str) -> str:
    """A text with a backslash escape in place of each character that is not printable; line ends and tabs stay."""
    return "".join(one if one.isprintable() or one in _LAYOUT else one.encode("unicode_escape").decode() for one in text)


def verify_printable(text: str) -> str:
    """Return the text unchanged.

    Raises:
        ValueError: The text is not printable.
    """
    if printable(text) != text:
        raise ValueError("must be printable text, without control characters")
    return text


Text = Annotated[str, AfterValidator(verify_printable)]
"""A field of a model whose value is printable text."""
