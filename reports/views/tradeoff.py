"""The output of `dropspin tradeoff`: the Pareto front, and the cheapest configuration within each tolerance."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.tradeoff.ladder import Ladder
from dropspin.comparisons.tradeoff.points import LEVEL, CostPoint, TradeOff, spread
from dropspin.reports.views.numbers import duration, formatted, left_out
from dropspin.scenarios.text import counted, rounded

BUSY = 0.5
"""Other threads per processor from which on a machine counts as busy: on one with two processors, one other thread."""


def columns(found: Sequence[TradeOff]) -> list[str]:
    """The columns of the table."""
    return list(dict.fromkeys(column for one in found for row in rows(one) for column in row))


def left_out_first(found: TradeOff) -> tuple[str, ...]:
    """The columns of the table of the Pareto front that are left out on a narrow terminal."""
    return (*(_per_world(worlds) for worlds in found.worlds), "on the Pareto front")


def _per_world(worlds: int) -> str:
    return f"per world (batch of {worlds})"


def rows(found: TradeOff) -> list[dict[str, Any]]:
    """A row for every engine and time step tried, and a row without a time step for each engine that was not run.

    A row has the error, the median, minimum, quartiles and spread over the rounds of the wall time per simulated second [s], and the reason
    why the engine's ladder ended. Where the rounds do not decide whether a configuration is on the Pareto front, that is None.
    """
    points = {(point.engine, point.dt): point for point in found.points}
    front, undecided = ([(point.engine, point.dt) for point in points] for points in (found.pareto_front, found.undecided))
    dominated_by = {point.engine: other.engine for point, other in found.dominated.items()}
    return [
        {
            "scene": found.scene.name,
            "metric": found.metric,
            "engine": ladder.engine,
            "dt": _finite(dt),
            "error": _finite(error),
            **_costs(points.get((ladder.engine, dt)), found.worlds),
            "memory_per_world": found.memory_per_world.get(ladder.engine),
            "on_pareto_front": None if (ladder.engine, dt) in undecided else (ladder.engine, dt) in front,
            "dominated_by": dominated_by.get(ladder.engine),
            "ladder_ended": ladder.ended,
            "ladder_reason": ladder.reason,
            "left_out": ladder.left_out or None,
        }
        for ladder in found.ladders
        for dt, error in ladder.steps or [(math.nan, math.nan)]
    ]


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _costs(point: CostPoint | None, worlds: Sequence[int]) -> dict[str, Any]:
    per_world = {f"cost_per_world_{size}": None if point is None else point.costs_per_world.get(size) for size in worlds}
    per_world |= {f"spread_per_world_{size}": None if point is None else point.spreads_per_world.get(size) for size in worlds}
    if point is None:
        return dict.fromkeys(("cost", "cost_best", "cost_quartiles", "cost_spread")) | per_world
    return {
        "cost": point.typical_cost,
        "cost_best": float(point.cost.min()),
        "cost_quartiles": [float(value) for value in np.quantile(point.cost, [0.25, 0.75])],
        "cost_spread": spread(point.cost),
        **per_world,
    }


def pareto_front_rows(found: TradeOff) -> list[dict[str, str]]:
    """The Pareto front, cheapest first, then the most accurate time step of each dominated engine, then the engines left out."""
    undecided = found.undecided
    shown = sorted({*found.pareto_front, *undecided}, key=lambda point: point.typical_cost)
    on_front = [_row(found, point, "undecided" if point in undecided else "yes") for point in shown]
    dominated = [_row(found, point, f"dominated by {other.engine}") for point, other in found.dominated.items() if point not in undecided]
    left_out = [
        dict(zip(on_front[0], (label, *["–"] * (len(on_front[0]) - 2), "left out, see below"), strict=True)) for label in found.left_out
    ]
    return on_front + dominated + left_out


def _row(found: TradeOff, point: CostPoint, on_front: str) -> dict[str, str]:
    return {
        "engine": point.engine,
        "step [ms]": f"{1e3 * point.dt:.4g}",
        f"error [{METRICS[found.metric].unit}]": formatted(point.error),
        "per simulated second": duration(point.typical_cost),
        **{_per_world(size): duration(point.costs_per_world[size]) if size in point.costs_per_world else "–" for size in found.worlds},
        "on the Pareto front": on_front,
    }


def sentences(found: TradeOff, within: Sequence[float]) -> list[str]:
    """Sentences: the cheapest configuration within each tolerance, memory, the end of each ladder, and engines left out."""
    ended: dict[str, list[str]] = {}
    for ladder in found.ladders:
        if ladder.steps:
            ended.setdefault(_reason(ladder), []).append(f"{ladder.engine} at {_step(ladder.steps[-1][0])}")
    return [
        *(_recommendation(found, tolerance) for tolerance in within),
        *_timings(found),
        *_memory(found),
        *(f"No smaller time step was tried because {reason}: {', '.join(labels)}." for reason, labels in ended.items()),
        *left_out(found.left_out),
    ]


def _recommendation(found: TradeOff, tolerance: float) -> str:
    """A sentence with the cheapest configuration within a tolerance, the next best, and the best one in a batch."""
    unit = _unit(found)
    goal = f"{found.scene.name}, {found.metric.replace('_', ' ')} within {tolerance:g}{unit}"
    advice = found.recommendation(tolerance)
    if advice is None:
        nearest = min(found.points, key=lambda point: point.error)
        ladder = next(one for one in found.ladders if one.engine == nearest.engine)
        last = ladder.steps[-1][0]
        if nearest.error <= tolerance:
            return (
                f"{goal}: no configuration is within it at its time step and at all smaller ones; {_named(nearest)} has "
                f"{formatted(nearest.error)}{unit}, but more at smaller time steps; its ladder of time steps ended at {_step(last)} "
                f"because {_reason(ladder)}."
            )
        where = "where its ladder of time steps ended" if nearest.dt == last else f"and its ladder of time steps ended at {_step(last)}"
        return (
            f"{goal}: no tested configuration reaches it; the most accurate is {_named(nearest)} with {formatted(nearest.error)}{unit}, "
            f"{where} because {_reason(ladder)}."
        )
    sentence = f"{goal}: {_named(advice.best)}, {duration(advice.best.typical_cost)} per simulated second"
    if advice.next_best is None:
        sentence += "; no other engine reaches it." if len(found.ladders) > 1 else "."
    elif advice.level and advice.ratio >= LEVEL:
        sentence += f"; {_named(advice.next_best)} takes {advice.ratio:.1f} times that, but less in a quarter of the rounds."
    elif advice.level:
        sentence += f"; {_named(advice.next_best)} takes about as long, {advice.ratio:.2f} times that."
    else:
        sentence += f"; the next best, {_named(advice.next_best)}, takes {advice.ratio:.1f} times that."
    for size in found.worlds:
        batched = found.best_in_batch(tolerance, size)
        if batched is not None:
            sentence += (
                f" In a batch of {size}, {_named(batched)}: {duration(batched.costs_per_world[size])} per world and simulated second."
            )
    return sentence


def _timings(found: TradeOff) -> list[str]:
    """Sentences on timings that differ between rounds, what they leave undecided, and other load on the machine."""
    listed = []
    undecided = found.undecided
    if undecided:
        are = counted(len(undecided), "configuration is", "configurations are")
        those = ", ".join(map(_named, undecided))
        listed.append(f"{are} on the Pareto front in some of the rounds only, so that the timings do not decide it: {those}.")
    batches = [(value, size, point) for point in found.points for size, value in point.spreads_per_world.items()]
    typical = found.spread
    if typical >= LEVEL:
        listed.append(f"Timings vary: the median of the rounds is typically {typical:.2g} times the least (column cost_spread).")
    if batches and (worst := max(batches, key=lambda one: one[0]))[0] >= LEVEL:
        value, size, point = worst
        listed.append(f"Timings of batches vary by a factor of up to {value:.2g}, that of {_named(point)} in a batch of {size}.")
    if found.load >= BUSY:
        listed.append(
            f"The machine was busy while costs were measured: {found.load:.1f} other threads per processor were running, on average; "
            "measure again on an idle machine."
        )
    return listed


def _memory(found: TradeOff) -> list[str]:
    """A sentence with the memory per world of each engine, where it was measured."""
    memory = ", ".join(f"{label} {rounded(value / 1e3, 2)} kB" for label, value in found.memory_per_world.items())
    return [f"Memory per world in a batch of {found.worlds[-1]}: {memory}."] if memory else []


def _reason(ladder: Ladder) -> str:
    return ladder.reason + (" (option --budget)" if ladder.ended == "budget" else "")


def _step(dt: float) -> str:
    return f"{1e3 * dt:.4g} ms"


def _named(point: CostPoint) -> str:
    return f"{point.engine} at {_step(point.dt)}"


def _unit(found: TradeOff) -> str:
    unit = METRICS[found.metric].unit
    return "" if unit == "1" else f" {unit}"
