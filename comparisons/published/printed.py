"""Printed digits: whether a value, rounded to as many digits as a source prints, has the digits that it prints."""

import math
import re
from decimal import Decimal
from typing import NamedTuple

BOUND = re.compile(r"([<>≤]) (.+)")
TOLERANCE = "±"
ABSENT = "–"
"""The text of a value that a source does not have."""
SHOWN = 6
"""Significant digits of a value that is compared with a bound or within a tolerance."""


class Agreement(NamedTuple):
    """A value beside printed digits.

    Attributes:
        here: The value, to the digits of the source.
        difference: The value less the printed one; NaN for a bound.
        agrees: Whether the digits are equal, or the value is within the bound or the tolerance that the source states.
    """

    here: str
    difference: float
    agrees: bool


def agreement(printed: str, value: float, significant: int = 0) -> Agreement:
    """Compare a value with printed digits.

    Args:
        printed: The digits, or a bound such as `< 1.01`, or a value with the source's tolerance such as `0.25±0.0025`.
        value: The value.
        significant: Number of significant digits of the source, if it drops trailing zeros.
    """
    shown = f"{value:.{SHOWN}g}"
    if bound := BOUND.fullmatch(printed):
        limit = float(bound[2])
        return Agreement(shown, math.nan, {"<": value < limit, ">": value > limit, "≤": value <= limit}[bound[1]])
    if TOLERANCE in printed:
        expected, tolerance = map(float, printed.split(TOLERANCE))
        return Agreement(shown, value - expected, abs(value - expected) <= tolerance)
    here = f"{value:.{significant}g}" if significant else _rounded(printed, value)
    return Agreement(here, value - float(printed), here == printed)


def _rounded(printed: str, value: float) -> str:
    """A value with the digits, and in the notation, of a printed one."""
    digits = Decimal(printed).as_tuple()
    if "e" in printed:
        mantissa, _, exponent = f"{value:.{len(digits.digits) - 1}e}".partition("e")
        return f"{mantissa}e{int(exponent)}"
    return f"{value:.{max(-int(digits.exponent), 0)}f}"
