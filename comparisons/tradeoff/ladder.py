"""The ladder of time steps at which an engine was tried, and the reason why no smaller one was tried."""

from dataclasses import dataclass
from typing import Literal

Ending = Literal["budget", "longest_run", "error_stopped_falling", "failed", "not_run"]


@dataclass(frozen=True)
class Ladder:
    """The time steps at which an engine was tried.

    Attributes:
        engine: Label of the engine.
        steps: Each time step tried [s], from the coarsest, and the absolute value of the metric at it; NaN if it is undefined.
        ended: The kind of reason why no smaller time step was tried.
        reason: The reason why no smaller time step was tried, as a clause.
        left_out: The reason why the engine is left out of the comparison; empty if it is not.
    """

    engine: str
    steps: tuple[tuple[float, float], ...]
    ended: Ending
    reason: str
    left_out: str = ""
