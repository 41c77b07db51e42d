"""The outcome of a conformance check, and the exceptions by which a check ends early."""

from typing import Literal, NamedTuple

CheckOutcome = Literal["passed", "failed", "noted", "declined", "crashed", "timed_out"]
"""`noted` is a peculiarity of the engine: the adapter is right."""


class CheckResult(NamedTuple):
    """The outcome of one check.

    Attributes:
        check: Name of the check.
        outcome: `passed`, `failed`, `noted` for a peculiarity of the engine, `declined`, `crashed` or `timed_out`.
        message: What was found, in words.
        traceback: Of an exception of the adapter, if there was one.
    """

    check: str
    outcome: CheckOutcome
    message: str
    traceback: str = ""


class CheckFailed(Exception):
    """The adapter is wrong; the text says what is wrong, and what is expected."""


class Declined(Exception):
    """The engine declines all scenes that a check needs."""
