"""The ladder of time steps at which an engine was tried, and why no smaller step was."""

from dataclasses import dataclass
from typing import Literal

Ending = Literal["budget", "longest_run", "error_stopped_falling", "failed", "not_run"]


@dataclass(frozen=True)
class Ladder:
    """The time steps at which an engine was tried.

    Attributes:
        engine: Label of the engine.
        steps: Each time step tried [s], from the coarsest, and the absolute value of the metric there; NaN where it has none.
        ended: Why no smaller step was tried.
        reason: The same in words: a clause.
        left_out: Why the engine takes no part in the comparison; empty if it does.
    """

    engine: str
    steps: tuple[tuple[float, float], ...]
    ended: Ending
    reason: str
    left_out: str = ""
