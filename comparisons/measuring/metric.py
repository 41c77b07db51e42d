"""A metric and its average over start phases.

Flights are kept separate, so that errors are averaged over start phases before the largest is taken, not after.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from comparisons.measuring.comparison import Comparison, Unresolved
from scenarios import Scenario, Truth

Array = NDArray[np.float64]
Measure = Callable[[Comparison], float | Array]
Components = Callable[[Comparison], Array]
Applies = Callable[[Scenario, Truth | None], bool]


@dataclass(frozen=True)
class Metric:
    """One metric.

    Attributes:
        name: Its name in the results.
        unit: SI unit; '1' for a ratio.
        kind: What a motion is compared with: an exact solution (`truth`), or a conservation law (`invariant`).
        signed: Whether its sign has a meaning.
        definition: Its definition in a sentence.
        needs: What a scene must have, in words.
        applies: Whether a scene, with its exact solution, has that.
        measure: The function from a comparison to the value, or to those of each flight; it raises `Unresolved` where the time step is too
            coarse.
        components: Where the value is the length of a vector, the function from a comparison to that vector at the end of the inner half
            of each flight, shape (flights, 3); else None.
        agreement: Whether two engines are compared with each other by it.
        first_flight: Whether it depends only on the first impact and the flight after it.
    """

    name: str
    unit: str
    kind: Literal["truth", "invariant"]
    signed: bool
    definition: str
    needs: str
    applies: Callable[[Scenario, Truth | None], bool]
    measure: Measure
    components: Components | None = None
    agreement: bool = False
    first_flight: bool = False

    def average(self, cases: Sequence[Comparison]) -> "Average":
        """The average over start phases.

        Raises:
            Unresolved: The time step is too coarse.
        """
        return self._average(self.measure, cases)

    def average_components(self, cases: Sequence[Comparison]) -> "Average | None":
        """The average of the components over start phases, parts of shape (flights, 3); None for a metric that has none.

        Raises:
            Unresolved: The time step is too coarse.
        """
        return None if self.components is None else self._average(self.components, cases)

    def _average(self, measure: Measure, cases: Sequence[Comparison]) -> "Average":
        measured = [np.atleast_1d(measure(case)) for case in cases]
        flights = min(map(len, measured))
        phases = np.array([values[:flights] for values in measured])
        # Each quarter of the phases, which are evenly spread too, gives a mean.
        quarters = [phases[first::4].mean(axis=0) for first in range(min(4, len(phases)))]
        resolutions = 0.5 * np.ptp(quarters, axis=0)
        # The phases are even at the first impact only; at later ones they are correlated, hardly better than one draw.
        later = 2 if flights > 1 or self.first_flight or len(cases[0].impacts) < 2 else 0
        resolutions[later:] = phases[:, later:].std(axis=0)
        if len(cases) == 1 and cases[0].has_impact_to_come:
            resolutions = np.abs(phases[0])  # the whole value of a single start may be sampling noise
        return Average(phases.mean(axis=0), resolutions, np.ptp(phases, axis=0) / len(phases))

    def value_or_nan(self, cases: Sequence[Comparison]) -> float:
        """The average's value; NaN where the time step is too coarse for it."""
        try:
            return self.average(cases).value
        except Unresolved:
            return float("nan")


class Average(NamedTuple):
    """A metric's means over start phases, their sampling noise, and how far one phase may move them.

    One for each flight, shape (flights,), or the largest and the least of each, (flights, 2), or the components at its end, (flights, 3).
    """

    parts: Array
    resolutions: Array
    jumps: Array

    @property
    def jump(self) -> float:
        """How far the value may move if one of the starts falls into the neighbouring step; 0 for a single start."""
        return float(np.max(np.abs(self.parts) + self.jumps)) - abs(self.value)

    @property
    def value(self) -> float:
        """The part with the largest absolute value, with its sign."""
        return float(self.parts.flat[np.argmax(np.abs(self.parts))])
