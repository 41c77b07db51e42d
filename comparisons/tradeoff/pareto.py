"""The results of a trade-off study: the error and cost of each configuration, the Pareto front, and the recommendation."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field, PlainSerializer, PlainValidator

from dropspin.comparisons.tradeoff.costs import WORLDS
from dropspin.comparisons.tradeoff.ladder import Ladder
from dropspin.scenarios import Scenario
from dropspin.scenarios.state import Array


def _costs(values: Any) -> Array:
    costs: Array = np.asarray(values, dtype=float)
    if costs.ndim != 1 or not len(costs) or not (costs > 0.0).all():
        raise ValueError("must be numbers above 0")
    return costs


Costs = Annotated[Array, PlainValidator(_costs), PlainSerializer(lambda costs: costs.tolist())]
"""An array that a stored study has as a list of numbers."""

LEVEL = 1.25
"""Two costs count as equal if their ratio is below this, or if their order differs between rounds."""


NEAR = 0.249
"""Share of a time step down to which smaller ones count with it: a quarter, with the rounding of a division."""


def spread(costs: Array) -> float:
    """How far timings of the same work differ: the median over the least, 1 without other load on the machine."""
    return float(np.median(costs) / np.min(costs))


@dataclass(frozen=True, eq=False)
class CostPoint:
    """A configuration: an engine at a time step, with its error and its cost.

    Attributes:
        engine: Label of the engine.
        dt: Time step [s].
        error: Absolute value of the metric.
        cost: Wall time per simulated second in each round [s/s], shape (rounds,).
        costs_per_world: For each number of worlds in a batch, the smallest wall time per simulated second and world [s/s]; empty if the
            engine cannot simulate batches.
        spreads_per_world: For each number of worlds, the median of these timings divided by the smallest.
    """

    engine: str
    dt: Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
    error: Annotated[float, Field(ge=0.0, allow_inf_nan=False)]
    cost: Costs
    costs_per_world: Mapping[int, float] = field(default_factory=dict)
    spreads_per_world: Mapping[int, float] = field(default_factory=dict)

    @property
    def typical_cost(self) -> float:
        """The median of the costs of all rounds [s/s]."""
        return float(np.median(self.cost))


class Recommendation(NamedTuple):
    """The cheapest configuration within a tolerance, and the cheapest one of another engine or method.

    Attributes:
        within: The tolerance.
        best: The cheapest configuration.
        next_best: The cheapest configuration of another engine or method; None if none reaches the tolerance at a tested time step.
        ratio: The cost of `next_best` divided by that of `best`, the median over the rounds.
        level: Whether the two costs count as equal.
    """

    within: float
    best: CostPoint
    next_best: CostPoint | None
    ratio: float
    level: bool


@dataclass(frozen=True)
class TradeOff:
    """Error and cost of engines on a scene.

    Attributes:
        scene: The scene.
        metric: The metric of the error.
        points: The configurations with a measured error and cost.
        ladders: The time steps tried for every requested engine, and the reason why no smaller one was tried.
        worlds: The numbers of worlds in a batch.
        memory_per_world: For each engine, the memory per world in the largest batch [bytes]; empty if this batch has fewer than 1,024
            worlds.
        load: Average number of threads per processor that ran or waited for a processor, besides the timed one; NaN if not known.
    """

    scene: Scenario
    metric: str
    points: tuple[CostPoint, ...]
    ladders: tuple[Ladder, ...]
    worlds: tuple[int, ...] = WORLDS
    memory_per_world: Mapping[str, float] = field(default_factory=dict)
    load: float = math.nan

    @property
    def spread(self) -> float:
        """The median, over all configurations, of the spread of the timings: the median timing divided by the smallest."""
        return float(np.median([spread(point.cost) for point in self.points]))

    @property
    def left_out(self) -> dict[str, str]:
        """The engines that are left out of the comparison, with the reason."""
        return {ladder.engine: ladder.left_out for ladder in self.ladders if ladder.left_out}

    @property
    def pareto_front(self) -> list[CostPoint]:
        """The configurations for which no other one is both more accurate and cheaper, by `reached`; cheapest first."""
        return self._pareto_front(self.points, lambda point: point.typical_cost)

    @property
    def undecided(self) -> list[CostPoint]:
        """The configurations for which the smallest, median and upper-quartile costs disagree on the Pareto front; cheapest first."""
        costs = [lambda point, share=share: float(np.quantile(point.cost, share)) for share in (0.0, 0.5, 0.75)]
        fronts = [frozenset(self._pareto_front(self.points, cost)) for cost in costs]
        differing = frozenset().union(*fronts) - fronts[0].intersection(*fronts)
        return sorted(differing, key=lambda point: point.typical_cost)

    def batch_pareto_front(self, worlds: int) -> list[CostPoint]:
        """The Pareto front by cost per world in batches of a size, for engines that can simulate them."""
        points = [point for point in self.points if worlds in point.costs_per_world]
        return self._pareto_front(points, lambda point: point.costs_per_world[worlds])

    @property
    def dominated(self) -> dict[CostPoint, CostPoint]:
        """For each engine that is not on the Pareto front, its most accurate configuration and the cheapest one at least as accurate."""
        front = self.pareto_front
        finite = [point for point in self.points if math.isfinite(self.reached(point))]
        best = {point.engine: point for point in sorted(finite, key=lambda point: (self.reached(point), point.error), reverse=True)}
        on_front = {point.engine for point in front}
        inside = [best[ladder.engine] for ladder in self.ladders if ladder.engine in best.keys() - on_front]
        return {point: next(other for other in front if self.reached(other) <= self.reached(point)) for point in inside}

    def recommendation(self, within: float) -> Recommendation | None:
        """The cheapest configuration within a tolerance; None if there is none.

        Args:
            within: The tolerance, in the metric's unit, for `reached`.
        """
        cheapest = {point.engine: point for point in sorted(self._within(within), key=lambda point: point.typical_cost, reverse=True)}
        if not cheapest:
            return None
        best, *others = sorted(cheapest.values(), key=lambda point: point.typical_cost)
        if not others:
            return Recommendation(within, best, None, math.nan, False)
        ratios = others[0].cost / best.cost
        ratio = float(np.median(ratios))
        level = ratio < LEVEL or float(np.quantile(ratios, 0.25)) <= 1.0
        return Recommendation(within, best, others[0], ratio, level)

    def best_in_batch(self, within: float, worlds: int) -> CostPoint | None:
        """The configuration with the smallest cost per world within a tolerance; None if no engine with batches reaches the tolerance.

        Args:
            within: The tolerance, in the metric's unit.
            worlds: Number of worlds in a batch.
        """
        batched = [point for point in self._within(within) if worlds in point.costs_per_world]
        return min(batched, key=lambda point: point.costs_per_world[worlds], default=None)

    def reached(self, point: CostPoint) -> float:
        """The largest error of an engine at a time step and at those down to a quarter of it; infinite if one of them is not finite.

        The error at one time step may be small by chance, because it changes sign near this step. It may grow at much smaller time steps,
        by rounding, which nobody uses in place of this one.
        """
        mine = [step for ladder in self.ladders if ladder.engine == point.engine for step in ladder.completed]
        errors = [error for dt, error in mine if NEAR * point.dt <= dt <= point.dt]
        return max(errors) if np.isfinite(errors).all() else math.inf

    def _within(self, within: float) -> list[CostPoint]:
        return [point for point in self.points if self.reached(point) <= within]

    def _pareto_front(self, points: Sequence[CostPoint], cost: Callable[[CostPoint], float]) -> list[CostPoint]:
        front: list[CostPoint] = []
        finite = [point for point in points if math.isfinite(self.reached(point))]
        for point in sorted(finite or points, key=lambda point: (cost(point), self.reached(point))):
            if not front or self.reached(point) < self.reached(front[-1]):
                front.append(point)
        return front
