"""The outcome of a conformance check, the exceptions by which a check ends early, and numbers and what an adapter raised as text."""

import math
import os
import sys
import traceback
from typing import Literal, NamedTuple

from dropspin.comparisons.engines import exceptions
from dropspin.comparisons.engines.base import Engine
from dropspin.comparisons.running.adapter_output import BuildMismatch
from dropspin.scenarios.text import rounded

CheckOutcome = Literal["passed", "failed", "noted", "declined", "crashed", "timed_out"]
"""`noted` is a peculiarity of the engine: the adapter is right."""


class CheckResult(NamedTuple):
    """The outcome of one check.

    Attributes:
        check: Name of the check.
        outcome: `passed`, `failed`, `noted` for a peculiarity of the engine, `declined`, `crashed` or `timed_out`.
        message: The finding in words.
        traceback: The traceback if the adapter raised an exception, else empty.
    """

    check: str
    outcome: CheckOutcome
    message: str
    traceback: str = ""


class CheckFailed(Exception):
    """A check ends, because the adapter is wrong; the text says what is wrong, and what is expected."""


class Noted(Exception):
    """A check ends, because the engine has a peculiarity, which the text states; the adapter is right."""


class Declined(Exception):
    """A check ends, because the engine declines all scenes that it needs."""


OUTCOMES: dict[type[Exception], CheckOutcome] = {CheckFailed: "failed", BuildMismatch: "failed", Noted: "noted", Declined: "declined"}
"""By the exception that ends a check; a check that passes returns what was found."""


def described(error: Exception, engine: Engine) -> str:
    """The type and the text of an exception, and the innermost line of the adapter's file that it passed through, if any."""
    file = getattr(sys.modules.get(type(engine).__module__), "__file__", None)
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename == file]
    where = f" ({os.path.relpath(frames[-1].filename)}:{frames[-1].lineno}, in {frames[-1].name})" if frames else ""
    return exceptions.described(error) + where


def whole_traceback(error: Exception) -> str:
    """The traceback of an exception, or of its cause if it has one."""
    return "".join(traceback.format_exception(error.__cause__ or error))


def instead(got: float, expected: float, unit: str = "") -> str:
    """Two numbers with so many digits that they differ, and the difference as a share of the expected one."""
    value = f"{got:.{digits_that_differ(got, expected)}g}{f' {unit}' if unit else ''} instead of {rounded(expected, 6)}"
    if expected == 0.0:
        return value
    if got * expected < 0.0:
        return f"{value} (of the opposite sign)"
    return f"{value} ({rounded(100.0 * abs(got / expected - 1.0), 2)} % too {'high' if abs(got) > abs(expected) else 'low'})"


def digits_that_differ(got: float, expected: float) -> int:
    """Significant digits in which two numbers differ."""
    return 2 + max(0, math.ceil(math.log10(abs(expected / (got - expected))))) if expected and got != expected else 3
