"""The verdicts on a measured value, and what they are based on."""

import math
from dataclasses import dataclass
from typing import Literal, get_args

Verdict = Literal[
    "broken", "crashed", "timed_out", "diverged", "failed", "missing", "declined", "known", "limited", "no_truth", "passed", "measured"
]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
"""Worst first: the first verdict represents a scene and an engine."""
Outcome = Literal["passed", "failed", "known fault", "not judged"]
OUTCOMES: dict[str, tuple[Outcome, str]] = {
    "passed": ("passed", ""),
    "failed": ("failed", ""),
    "diverged": ("failed", "diverged"),
    "crashed": ("failed", "crashed"),
    "timed_out": ("failed", "timed out"),
    "broken": ("failed", "broken"),
    "known": ("known fault", ""),
    "limited": ("not judged", "limited"),
    "measured": ("not judged", "measured"),
    "no_truth": ("not judged", "no exact solution"),
    "declined": ("not judged", "declined"),
    "missing": ("not judged", "missing"),
}
"""The outcome that readers see of each verdict, and its reason; the reason is empty where the outcome has one verdict."""
MARKS: dict[str, str] = dict(zip(VERDICTS, "✗✗⏱∞✗?–†!·✓·", strict=True))
"""Verdicts as one character."""
FAILURES = frozenset({"failed"})
BREAKDOWNS = frozenset({"broken", "diverged", "crashed", "timed_out"})
Basis = Literal[
    "",
    "fault_absent",
    "few_starts",
    "uncertain_recording",
    "same_method",
    "accepted_failure",
    "scene_changed",
    "not_repeated",
    "since_accepted",
]
"""What a verdict is based on, beside value and bounds: the known fault that is expected does not occur; the few starts of a quick run do
not decide it, or the uncertainty of the recording does not; two engines agree because they use the same discretisation; a failure was
accepted; the scene is not the accepted one; the engine does not repeat its own motion; a share is of the change since acceptance."""
WITHIN_UNCERTAINTY, COMBINED = "within uncertainty", "model, setting or start"
"""Causes of a difference from a recording: the recording does not tell it from 0; what contributes to it is not known."""
Cause = str
"""The cause to which an error is attributed: discretisation, model, setting, rounding, chaotic, unresolved, an option of the engine that
sets its accuracy, or one of those of a difference from a recording; empty if the error was not attributed."""


@dataclass(frozen=True)
class Judgement:
    """A value and the verdict on it.

    Attributes:
        value: The value; NaN where there is none.
        verdict: The verdict.
        lower: Smallest allowed value, or the lower end of the 95 % interval of an order or an asymptotic error; NaN if there is none.
        upper: Largest allowed value, or the upper end of that interval; NaN if there is none.
        cause: The cause to which the error is attributed.
        reason: The reason for the verdict.
        tolerance: The largest difference between two runs that does not count as a change; NaN if the value is not compared.
        basis: What the verdict is based on, beside value and bounds.
    """

    value: float
    verdict: Verdict
    lower: float = math.nan
    upper: float = math.nan
    cause: Cause = ""
    reason: str = ""
    tolerance: float = math.nan
    basis: Basis = ""


def with_reason(outcome: str, reason: str) -> str:
    """An outcome with its reason, such as `failed (diverged)`."""
    return f"{outcome} ({reason})" if reason else outcome
