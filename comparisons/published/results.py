"""Comparisons with published values: whether a value, rounded to as many digits as a source prints, has the digits that it prints."""

import math
import re
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Literal

from dropspin.comparisons.judging.verdicts import Verdict
from dropspin.comparisons.running.driving import Breakdown

Status = Literal["reproduced", "differs", "error of the source", "not reproducible", "for comparison", "not run"]
"""Reproduced: the digits are equal, or the value is within the bound or tolerance that the source states. Differs: they are not, although
they are claimed to be. Error of the source: the published value is the result of a tool or of an approximation, and its error is measured
here. Not reproducible: the reason is given. For comparison: the source has no such value. Not run: the engine is missing or broke down.
"""
EXACT = "exact solution"


@dataclass(frozen=True)
class Result:
    """A published value and the one found here.

    Attributes:
        source: Name of the source.
        tool: The tool or the formula to which the published value belongs.
        quantity: The quantity, and the run.
        published: The digits that the source prints.
        here: The value found here, to these digits; empty if there is none.
        by: The engine, or the exact solution, that gave the value.
        status: One of `Status`.
        reason: Why there is no value, or why it differs.
        difference: The value less the published one; for an error of the source, the published one less the exact one; NaN without one.
        verdict: The verdict on an engine that gave no value, such as `missing` or `crashed`; otherwise empty.
    """

    source: str
    tool: str
    quantity: str
    published: str
    here: str
    by: str
    status: Status
    reason: str = ""
    difference: float = math.nan
    verdict: Verdict | Literal[""] = ""


BOUND = re.compile(r"([<>≤]) (.+)")
TOLERANCE = "±"
ROUNDING = 1e-12
"""Relative difference up to which a value equals a bound."""
ABSENT = "–"
"""The text of a value that a source does not have."""
SHOWN = 6
"""Significant digits of a value that is compared with a bound or within a tolerance."""


def compared(result: Result, value: float, significant: int = 0) -> Result:
    """A result with the value that was found, which is claimed to have the published digits, or to be within the bound or the tolerance.

    Args:
        result: The result without a value; published are digits, a bound such as `< 1.01`, or a value with the source's tolerance such as
            `0.25±0.0025`.
        value: The value.
        significant: Number of significant digits of the source, if it drops trailing zeros.
    """
    printed, here = result.published, f"{value:.{SHOWN}g}"
    if bound := BOUND.fullmatch(printed):
        expected = float(bound[2])
        at_most = value <= expected or math.isclose(value, expected, rel_tol=ROUNDING)
        agrees = {"<": value < expected, ">": value > expected, "≤": at_most}[bound[1]]
    elif TOLERANCE in printed:
        expected, tolerance = map(float, printed.split(TOLERANCE))
        agrees = abs(value - expected) <= tolerance + ROUNDING * abs(expected)
    else:
        expected, agrees = float(printed), False
        if not math.isnan(value):
            here = f"{value:.{significant}g}" if significant else _rounded(printed, value)
            agrees = Decimal(here) == Decimal(printed)
    return replace(result, here=here, difference=value - expected, status="reproduced" if agrees else "differs")


def with_value(result: Result, value: float | Breakdown, why_not: str, significant: int = 0) -> Result:
    """A result with the value that an engine gave, or with why it gave none.

    Args:
        result: The result without a value.
        value: The value.
        why_not: Why no engine can give the published value here; empty if one can.
        significant: As in `compared`.
    """
    if isinstance(value, Breakdown):
        if not result.by or value.verdict == "declined":
            return replace(result, status="not reproducible", reason=value.reason)
        return replace(result, reason=value.reason, verdict=value.verdict)
    if result.published == ABSENT:
        return replace(result, here=f"{value:.{SHOWN}g}", status="for comparison")
    result = compared(result, value, significant)
    return replace(result, status="not reproducible", reason=why_not) if why_not and result.status == "differs" else result


def _rounded(printed: str, value: float) -> str:
    """A value with the digits, and in the notation, of a printed one."""
    digits = Decimal(printed).as_tuple()
    if "e" in printed:
        mantissa, _, exponent = f"{value:.{len(digits.digits) - 1}e}".partition("e")
        return f"{mantissa}e{int(exponent)}"
    return f"{value:.{max(-int(digits.exponent), 0)}f}"
