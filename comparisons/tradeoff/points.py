"""The results of a trade-off study: error and cost of engines at time steps, the Pareto front, and the cheapest within a tolerance."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from comparisons.tradeoff.ladder import Ladder
from scenarios import Scenario

Array = NDArray[np.float64]

LEVEL = 1.25
"""Two costs with a smaller ratio than this, or whose order differs between rounds, are level."""


@dataclass(frozen=True, eq=False)
class CostPoint:
    """An engine at a time step.

    Attributes:
        engine: Label of the engine.
        dt: Time step [s].
        error: Absolute value of the metric.
        cost: Wall time per simulated second in each round [s/s], shape (rounds,).
        cost_per_world: The least wall time per simulated second and world in a batch [s/s]; NaN if the engine cannot step batches.
    """

    engine: str
    dt: float
    error: float
    cost: Array
    cost_per_world: float = math.nan

    @property
    def typical_cost(self) -> float:
        """The median cost of the rounds [s/s]."""
        return float(np.median(self.cost))


@dataclass(frozen=True)
class Recommendation:
    """The cheapest point within a tolerance, and the next best of another engine or method.

    Attributes:
        within: The tolerance.
        best: The cheapest point.
        next_best: The next best; None if no other engine reaches the tolerance at a step tried.
        ratio: The cost of the next best over the best's, median of the rounds.
        level: Whether the difference between the two is too small to rely on.
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
        points: Engines at time steps.
        ladders: Of every engine that was asked for, the time steps tried and why no smaller one was.
    """

    scene: Scenario
    metric: str
    points: tuple[CostPoint, ...]
    ladders: tuple[Ladder, ...]

    @property
    def left_out(self) -> dict[str, str]:
        """Engines without points, and why."""
        return {ladder.engine: ladder.left_out for ladder in self.ladders if ladder.left_out}

    @property
    def pareto_front(self) -> list[CostPoint]:
        """The points than which no other is both more accurate and cheaper; cheapest first."""
        return _pareto_front(self.points, lambda point: point.typical_cost)

    @property
    def batch_pareto_front(self) -> list[CostPoint]:
        """The Pareto front by cost per world, of the engines that can step batches."""
        return _pareto_front([point for point in self.points if np.isfinite(point.cost_per_world)], lambda point: point.cost_per_world)

    @property
    def dominated(self) -> dict[CostPoint, CostPoint]:
        """Of each engine without a point on the Pareto front, its most accurate point, and the cheapest that is as accurate."""
        front = self.pareto_front
        best: dict[str, CostPoint] = {}
        for point in sorted(self.points, key=lambda one: one.error, reverse=True):
            best[point.engine] = point
        on_front = {point.engine for point in front}
        inside = [best[ladder.engine] for ladder in self.ladders if ladder.engine in best.keys() - on_front]
        return {point: next(one for one in front if one.error <= point.error) for point in inside}

    def recommendation(self, within: float) -> Recommendation | None:
        """The cheapest point within a tolerance; None if no point is.

        Args:
            within: The tolerance, in the metric's unit.

        Of each engine, the coarsest time step counts that is within the tolerance together with all finer ones: at a coarser one the error
        may be small by chance, where it crosses 0.
        """
        coarsest = self._coarsest(within)
        if not coarsest:
            return None
        best, *others = sorted(coarsest, key=lambda one: one.typical_cost)
        if not others:
            return Recommendation(within, best, None, math.nan, False)
        ratios = others[0].cost / best.cost
        ratio = float(np.median(ratios))
        level = ratio < LEVEL or float(np.quantile(ratios, 0.25)) <= 1.0
        return Recommendation(within, best, others[0], ratio, level)

    def best_in_batch(self, within: float) -> CostPoint | None:
        """The point with the least cost per world within a tolerance; None if no engine that can step batches reaches it.

        Args:
            within: The tolerance, in the metric's unit.
        """
        batched = [point for point in self._coarsest(within) if np.isfinite(point.cost_per_world)]
        return min(batched, key=lambda point: point.cost_per_world, default=None)

    def _coarsest(self, within: float) -> list[CostPoint]:
        """Of each engine, the coarsest time step that is within a tolerance together with all finer ones."""
        coarsest: dict[str, CostPoint] = {}
        exceeded: set[str] = set()
        for point in sorted(self.points, key=lambda one: one.dt):
            if point.error > within:
                exceeded.add(point.engine)
            if point.engine not in exceeded:
                coarsest[point.engine] = point
        return list(coarsest.values())


def _pareto_front(points: Sequence[CostPoint], cost: Callable[[CostPoint], float]) -> list[CostPoint]:
    front: list[CostPoint] = []
    for point in sorted(points, key=lambda one: (cost(one), one.error)):
        if not front or point.error < front[-1].error:
            front.append(point)
    return front
