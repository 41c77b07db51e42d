"""A metric and its average over start phases.

Errors are stored for each flight. They are averaged over the start phases first; the metric is the largest of the averages.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from dropspin.comparisons.measuring.comparison import Comparison, Unresolved
from dropspin.scenarios import Scenario, Truth
from dropspin.scenarios.state import Array

Measure = Callable[[Comparison], float | Array]
Components = Callable[[Comparison], Array]
PHASES_OF_TOSS = 4
"""Start phases of each toss of a recording, one for each quarter."""
Applies = Callable[[Scenario, Truth | None], bool]


@dataclass(frozen=True)
class Metric:
    """One metric.

    Attributes:
        name: The name in the results.
        unit: SI unit; '1' for a ratio.
        kind: The reference of the metric: an exact solution (`truth`) or a conservation law (`invariant`).
        definition: The definition in a sentence.
        needs: The properties that a scene must have, in words.
        applies: Whether a scene, with its exact solution, has these properties.
        measure: The function from a comparison to the value, or to the values of each flight; it raises `Unresolved` if the time step is
            too coarse.
        signed: Whether the sign of the value has a meaning.
        components: If the value is the length of a vector, the function from a comparison to this vector at the end of the middle half of
            each flight, shape (flights, 3); otherwise None.
        agreement: Whether the metric is also used to compare two engines with each other.
        first_flight: Whether the value depends only on the first impact and the flight after it.
    """

    name: str
    unit: str
    kind: Literal["truth", "invariant"]
    definition: str
    needs: str
    applies: Applies
    measure: Measure
    signed: bool = False
    components: Components | None = None
    agreement: bool = False
    first_flight: bool = False

    def average(self, cases: Sequence[Comparison]) -> "Average":
        """The average of the metric over start phases.

        Raises:
            Unresolved: The time step is too coarse.
        """
        return self._average(self.measure, cases)

    def average_components(self, cases: Sequence[Comparison]) -> "Average | None":
        """The average of the components over start phases, parts of shape (flights, 3); None for a metric without components.

        So is that of a measured motion.

        Raises:
            Unresolved: The time step is too coarse.
        """
        if self.components is None or cases[0].measured is not None:  # a recording does not say where its flights end
            return None
        return self._average(self.components, cases)

    @np.errstate(all="ignore")  # an engine may return 0 or 1e300; the inf or NaN that follows is judged as such
    def _average(self, measure: Measure, cases: Sequence[Comparison]) -> "Average":
        phases = self._of_each(measure, cases)
        flights = phases.shape[1]
        # Each quarter of the phases, which are evenly spread too, gives a mean.
        quarters = [phases[first::4].mean(axis=0) for first in range(min(4, len(phases)))]
        resolutions = 0.5 * np.ptp(quarters, axis=0)
        # The phases are even at the first impact only; at later ones they are correlated, hardly better than one draw.
        later = 2 if flights > 1 or self.first_flight or len(cases[0].impacts) < 2 else 0
        resolutions[later:] = phases[:, later:].std(axis=0)
        if len(cases) == 1 and any(impact > 0.0 for impact in cases[0].impacts[:1]):
            resolutions = np.abs(phases[0])  # of a single start, the whole value may depend on where in a step its first impact falls
        ranges = np.ptp(phases, axis=0)
        if cases[0].measured is not None and len(cases) > 1:
            ranges = np.ptp(phases.reshape(-1, PHASES_OF_TOSS, *phases.shape[1:]), axis=1).max(axis=0)
        return Average(phases.mean(axis=0), resolutions, ranges / len(phases))

    @np.errstate(all="ignore")
    def value(self, cases: Sequence[Comparison]) -> float:
        """The value of the average.

        Raises:
            Unresolved: The time step is too coarse.
        """
        return _largest(self._of_each(self.measure, cases).mean(axis=0))

    @np.errstate(all="ignore")
    def root_mean_square(self, cases: Sequence[Comparison]) -> float:
        """The root mean square over start phases, of the flight where it is largest: the error of one start, without its sign.

        Raises:
            Unresolved: The time step is too coarse.
        """
        return float(np.sqrt((self._of_each(self.measure, cases) ** 2).mean(axis=0)).max())

    def value_or_nan(self, cases: Sequence[Comparison]) -> float:
        """The value of the average; NaN if the time step is too coarse."""
        with suppress(Unresolved):
            return self.value(cases)
        return float("nan")

    def _of_each(self, measure: Measure, cases: Sequence[Comparison]) -> Array:
        """The values from each start phase, over the flights that all of them have, shape (phases, flights, …)."""
        measured = [np.atleast_1d(measure(case)) for case in cases]
        flights = min(map(len, measured))
        return np.array([values[:flights] for values in measured])


class Average(NamedTuple):
    """The means of a metric over start phases, their sampling noise, and the effect of a single start phase on them.

    There is one mean for each flight, shape (flights,), or one for the largest and one for the smallest value of each flight, shape
    (flights, 2), or one for each component, shape (flights, 3).
    """

    parts: Array
    resolutions: Array
    jumps: Array

    @property
    def jump(self) -> float:
        """The change of the value if the impact of one start phase moves to the neighbouring time step; 0 for a single start."""
        return float(np.max(np.abs(self.parts) + self.jumps)) - abs(self.value)

    def less_certain(self, factor: float) -> "Average":
        """The same means with larger sampling noise."""
        return self._replace(resolutions=factor * self.resolutions, jumps=factor * self.jumps)

    @property
    def noise(self) -> float:
        """The largest change of the value by the sampling noise of its parts, or of the impact of one start phase."""
        return float(np.max(np.abs(self.parts) + np.maximum(self.resolutions, self.jumps))) - abs(self.value)

    @property
    def value(self) -> float:
        """The part with the largest absolute value, with its sign."""
        return _largest(self.parts)


def _largest(parts: Array) -> float:
    """The part with the largest absolute value, with its sign."""
    return float(parts.flat[np.argmax(np.abs(parts))])
