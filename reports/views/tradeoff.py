"""`dropspin tradeoff` in words: the Pareto front, and the cheapest configuration within each tolerance."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from comparisons.measuring.metrics import METRICS
from comparisons.tradeoff.costs import BATCH
from comparisons.tradeoff.points import CostPoint, TradeOff

COLUMNS = ("scene", "metric", "engine", "dt", "error", "cost", "cost_best", "cost_quartiles", "cost_per_world", "on_pareto_front")


def rows(found: TradeOff) -> list[dict[str, Any]]:
    """Every point: its error, and the time per simulated second as median, best and quartiles of the rounds [s]."""
    front = found.pareto_front
    return [
        {
            "scene": found.scene.name,
            "metric": found.metric,
            "engine": point.engine,
            "dt": point.dt,
            "error": point.error,
            "cost": point.typical_cost,
            "cost_best": float(point.cost.min()),
            "cost_quartiles": [float(value) for value in np.quantile(point.cost, [0.25, 0.75])],
            "cost_per_world": None if math.isnan(point.cost_per_world) else point.cost_per_world,
            "on_pareto_front": point in front,
        }
        for point in found.points
    ]


def pareto_front_rows(found: TradeOff) -> list[dict[str, str]]:
    """The Pareto front in words, from the cheapest to the most accurate."""
    unit = _unit(found)
    return [
        {
            "engine": point.engine,
            "step": f"{1e3 * point.dt:.4g} ms",
            "error": f"{point.error:.2e}{unit}",
            "per simulated second": _time(point.typical_cost),
            "best": _time(float(point.cost.min())),
            f"per world (batch of {BATCH})": "–" if math.isnan(point.cost_per_world) else _time(point.cost_per_world),
        }
        for point in found.pareto_front
    ]


def sentences(found: TradeOff, within: Sequence[float]) -> list[str]:
    """The cheapest configuration within each tolerance, then the engines that are dominated and those that are left out."""
    listed = [_recommendation(found, tolerance) for tolerance in within]
    if found.dominated:
        listed.append(f"Dominated, less accurate or slower than another engine at every time step: {', '.join(found.dominated)}.")
    return listed + [f"Left out: {label}, {why}." for label, why in found.left_out.items()]


def _recommendation(found: TradeOff, tolerance: float) -> str:
    """The cheapest configuration within a tolerance, the next best, and the best for a batch."""
    unit = _unit(found)
    goal = f"{found.scene.name}, {found.metric.replace('_', ' ')} within {tolerance:g}{unit}"
    advice = found.recommendation(tolerance)
    if advice is None:
        nearest = min(found.points, key=lambda point: point.error)
        return f"{goal}: no tested configuration reaches it; the most accurate is {_named(nearest)} with {nearest.error:.2e}{unit}."
    sentence = f"{goal}: {_named(advice.best)}, {_time(advice.best.typical_cost)} per simulated second"
    if advice.next_best is None:
        sentence += "; no other engine reaches it."
    elif advice.level:
        sentence += f"; {_named(advice.next_best)} takes about as long, {advice.ratio:.2f} times that."
    else:
        sentence += f"; the next best, {_named(advice.next_best)}, takes {advice.ratio:.1f} times that."
    batched = found.best_in_batch(tolerance)
    if batched is not None:
        sentence += f" In a batch of {BATCH}, {_named(batched)}: {_time(batched.cost_per_world)} per world."
    return sentence


def _named(point: CostPoint) -> str:
    return f"{point.engine} at {1e3 * point.dt:.4g} ms"


def _unit(found: TradeOff) -> str:
    unit = METRICS[found.metric].unit
    return "" if unit == "1" else f" {unit}"


def _time(seconds: float) -> str:
    scale, unit = next((scale, unit) for scale, unit in ((1e3, "ms"), (1e6, "µs"), (1e9, "ns")) if seconds * scale >= 1.0 or unit == "ns")
    return f"{seconds * scale:.3g} {unit}"
