"""The output of `dropspin tradeoff`: the Pareto front, and the cheapest configuration within each tolerance."""

import math
from collections.abc import Iterator, Sequence
from typing import Any, Literal

import numpy as np

from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.tradeoff.ladder import Ladder
from dropspin.comparisons.tradeoff.pareto import LEVEL, CostPoint, TradeOff, spread
from dropspin.reports.document import Charts, Document, Heading, Part, Rows, Sentences, Table
from dropspin.reports.plots.run_charts import tradeoff_charts
from dropspin.reports.stories.numbers import duration, formatted, grouped, in_ms, left_out, with_unit
from dropspin.reports.stories.study import Records, Study
from dropspin.scenarios.text import counted, rounded

BUSY = 0.5
"""Number of other running threads per processor from which a machine counts as busy: one thread on two processors."""


class TradeOffs(Study):
    """The results of `dropspin tradeoff` in each scene, and the tolerances that were given."""

    study: Literal["tradeoff"] = "tradeoff"
    scenes: list[TradeOff]
    within: list[float]

    def rows(self) -> Records:
        """A row for each engine and time step tried."""
        return [row for study in self.scenes for row in rows(study)]

    def document(self) -> Document:
        """The Pareto front of each scene, and the cheapest configuration within each tolerance."""
        parts: list[Part] = []
        for study in self.scenes:
            left_out_first = [*map(_per_world, study.worlds), "on the Pareto front"]
            parts += [Heading(study.scene.name), Charts(study.scene.name, tradeoff_charts(study))]
            parts += [Table(pareto_front_rows(study), left_out_first), Sentences(sentences(study, self.within), numbered=True)]
        return Document("What accuracy costs", parts)


def _per_world(worlds: int) -> str:
    return f"per world (batch of {worlds})"


def rows(study: TradeOff) -> Records:
    """A row for every engine and time step tried, and a row without a time step for each engine that was not run.

    A row has the error; the median, minimum, quartiles and spread, over the rounds, of the wall time per simulated second [s]; and the
    reason why no smaller time step was tried. `on_pareto_front` is None if the rounds do not decide it.
    """
    points = {(point.engine, point.dt): point for point in study.points}
    front, undecided = ([(point.engine, point.dt) for point in points] for points in (study.pareto_front, study.undecided))
    dominated_by = {point.engine: other.engine for point, other in study.dominated.items()}
    return [
        {
            "scene": study.scene.name,
            "metric": study.metric,
            "engine": ladder.engine,
            "dt": dt,
            "error": error,
            **_costs(points.get((ladder.engine, dt)), study.worlds),
            "memory_per_world": study.memory_per_world.get(ladder.engine),
            "on_pareto_front": None if (ladder.engine, dt) in undecided else (ladder.engine, dt) in front,
            "dominated_by": dominated_by.get(ladder.engine),
            "ladder_ended": ladder.ended,
            "ladder_reason": ladder.reason,
            "left_out": ladder.left_out or None,
            "no_error_reason": ladder.undefined or None,
            "no_batch_cost_reason": ladder.no_batch_cost or None,
        }
        for ladder in study.ladders
        for dt, error in ladder.steps or [(math.nan, math.nan)]
    ]


def _costs(point: CostPoint | None, worlds: Sequence[int]) -> dict[str, Any]:
    names = ["cost", "cost_best", "cost_quartiles", "cost_spread"]
    names += [f"{quantity}_per_world_{size}" for quantity in ("cost", "spread") for size in worlds]
    if point is None:
        return dict.fromkeys(names)
    quartiles = np.quantile(point.cost, [0.25, 0.75]).tolist()
    per_world = [costs.get(size) for costs in (point.costs_per_world, point.spreads_per_world) for size in worlds]
    return dict(zip(names, [point.typical_cost, float(point.cost.min()), quartiles, spread(point.cost), *per_world], strict=True))


def pareto_front_rows(study: TradeOff) -> Rows:
    """The Pareto front, cheapest first, then the most accurate time step of each dominated engine, then the engines left out."""
    undecided = study.undecided
    shown = sorted({*study.pareto_front, *undecided}, key=lambda point: point.typical_cost)
    placed = [(point, "undecided" if point in undecided else "yes") for point in shown]
    placed += [(point, f"dominated by {other.engine}") for point, other in study.dominated.items() if point not in undecided]
    error, worlds = f"error [{METRICS[study.metric].unit}]", {_per_world(size): size for size in study.worlds}
    rows = [
        {
            "engine": point.engine,
            "step [ms]": f"{1e3 * point.dt:.4g}",
            error: formatted(point.error),
            "per simulated second": duration(point.typical_cost),
            **{name: duration(point.costs_per_world[size]) if size in point.costs_per_world else "–" for name, size in worlds.items()},
            "on the Pareto front": place,
        }
        for point, place in placed
    ]
    absent = dict.fromkeys(rows[0], "–") | {"on the Pareto front": "left out, see below"}
    return rows + [absent | {"engine": label} for label in study.left_out]


def sentences(study: TradeOff, within: Sequence[float]) -> list[str]:
    """Sentences: the cheapest configuration within each tolerance, memory, the end of each ladder, and engines left out."""
    ended = grouped([ladder for ladder in study.ladders if ladder.steps], _reason)
    ends = {reason: ", ".join(f"{ladder.engine} at {in_ms(ladder.steps[-1][0])}" for ladder in alike) for reason, alike in ended.items()}
    memory = ", ".join(f"{label} {rounded(value / 1e3, 2)} kB" for label, value in study.memory_per_world.items())
    return [
        *(_recommendation(study, tolerance) for tolerance in within),
        *_timings(study),
        *([f"Memory per world in a batch of {study.worlds[-1]}: {memory}."] if memory else []),
        *_undefined(study),
        *(f"No smaller time steps than these were tried, because {reason}: {engines}." for reason, engines in ends.items()),
        *left_out(study.left_out),
        *(f"Batches without a cost: {one.engine}, {one.no_batch_cost.removesuffix('.')}." for one in study.ladders if one.no_batch_cost),
    ]


def _undefined(study: TradeOff) -> list[str]:
    """Sentences on the engines that are compared and have no error at time steps below one at which they have one, or that fail at any."""
    causes: dict[str, list[str]] = {}
    for ladder in study.ladders:
        coarsest = max((dt for dt, error in ladder.completed if math.isfinite(error)), default=0.0)
        without = [dt for dt, error in ladder.completed if not math.isfinite(error) and (ladder.verdict or dt < coarsest)]
        if without and not ladder.left_out:
            steps = f"{len(without)} of {counted(len(ladder.completed), 'time step', 'time steps')}, down to {in_ms(without[-1])}"
            causes.setdefault(f"No error at {steps}, because {ladder.undefined}", []).append(ladder.engine)
    return [f"{cause}: {', '.join(engines)}." for cause, engines in causes.items()]


def _recommendation(study: TradeOff, tolerance: float) -> str:
    """A sentence with the cheapest configuration within a tolerance, the next best, and the best one in a batch."""
    unit = METRICS[study.metric].unit
    goal = f"{study.scene.name}, {study.metric.replace('_', ' ')} within {with_unit(f'{tolerance:g}', unit)}"
    advice = study.recommendation(tolerance)
    if advice is None:
        nearest = min(study.points, key=lambda point: point.error)
        ladder = next(ladder for ladder in study.ladders if ladder.engine == nearest.engine)
        error = with_unit(formatted(nearest.error), unit)
        if nearest.error <= tolerance:
            none = "no tested configuration is within this tolerance at its time step and at those down to a quarter of it"
            larger = "a larger one" if math.isfinite(study.reached(nearest)) else "none"
            outcome = f"{none}; {_named(nearest)} has an error of {error}, but {larger} at a smaller time step"
        else:
            outcome = f"no tested configuration reaches this tolerance; the most accurate is {_named(nearest)} with an error of {error}"
        tried = f"With this engine, no time step below {in_ms(ladder.steps[-1][0])} was tried"
        return f"{goal}: {outcome}. {tried}, because {_reason(ladder)}."
    sentence, ratio = f"{goal}: {_named(advice.best)}, {duration(advice.best.typical_cost)} per simulated second", advice.ratio
    if advice.next_best is None:
        others = [point for point in study.points if point.engine != advice.best.engine]
        reach = "reaches this tolerance"
        if any(point.error <= tolerance for point in others):
            reach = "is within this tolerance at a tested time step and at those down to a quarter of it"
        sentence += f"; no other engine that was compared {reach}." if others else "."
    elif not advice.level:
        sentence += f"; the next best, {_named(advice.next_best)}, takes {_times(ratio)} as long."
    else:
        less = f"{_times(ratio)} as long, but less time in a quarter of the rounds"
        sentence += f"; {_named(advice.next_best)} takes {less if ratio >= LEVEL else f'about as long ({ratio:.2f} times)'}."
    for size in study.worlds:
        if batched := study.best_in_batch(tolerance, size):
            cost = duration(batched.costs_per_world[size])
            sentence += f" In a batch of {size}, the cheapest is {_named(batched)}: {cost} per world and simulated second."
    return sentence


def _times(ratio: float) -> str:
    """A ratio of costs with a decimal, or with two digits if it is large."""
    return f"{ratio:.1f} times" if ratio < 10.0 else f"{rounded(ratio, 2)} times"


def _timings(study: TradeOff) -> Iterator[str]:
    """Sentences on timings that differ between rounds, what they leave undecided, and other load on the machine."""
    if undecided := study.undecided:
        are = counted(len(undecided), "configuration is", "configurations are")
        those = ", ".join(map(_named, undecided))
        yield f"{are} on the Pareto front in only some of the rounds, so the timings are not decisive: {those}."
    if study.spread >= LEVEL:
        yield f"Timings vary: the median over the rounds is typically {study.spread:.2g} times the shortest (column cost_spread)."
    batches = [(value, size, point) for point in study.points for size, value in point.spreads_per_world.items() if value >= LEVEL]
    if batches:
        value, size, point = max(batches, key=lambda batch: batch[0])
        yield f"Timings of batches vary by a factor of up to {value:.2g}, for {_named(point)} in a batch of {size}."
    if study.load >= BUSY:
        yield (
            f"The machine was busy while costs were measured: {study.load:.1f} other threads per processor were running, on average; "
            "measure again on an idle machine."
        )


def _reason(ladder: Ladder) -> str:
    return ladder.reason + (" (option --budget)" if ladder.ended == "budget" else "")


def _named(point: CostPoint) -> str:
    return f"{point.engine} at {in_ms(point.dt)}"
