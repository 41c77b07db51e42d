"""The result of one comparison with a published value."""

import math
from dataclasses import dataclass
from typing import Literal

from dropspin.comparisons.judging.verdicts import Verdict

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


def compared(agrees: bool) -> Status:
    """The status of a value that is claimed to be reproducible."""
    return "reproduced" if agrees else "differs"
