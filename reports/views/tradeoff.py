"""`dropspin tradeoff` in words: rows of points, the Pareto front, and sentences of advice."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from comparisons.measuring.metrics import METRICS
from comparisons.tradeoff.costs import BATCH
from comparisons.tradeoff.points import CostPoint, TradeOff

COLUMNS = ("scene", "metric", "engine", "dt", "error", "cost", "cost_best", "cost_quartiles", "cost_per_world", "on_pareto_front")


def rows(found: TradeOff) -> list[dict[str, Any]]:
    """All points: error, and time per simulated second as median, best and quartiles of the rounds [s]."""
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
    """The Pareto front as text, from the cheapest to the most accurate point."""
    unit = _unit(found)
    return [
        {
            "engine": point.engine,
            "step": f"{1e3 * point.dt:.4g} ms",
            "error": f"{point.error:.2e}{unit}",
            "time per simulated second": _time(point.typical_cost),
            "best": _time(float(point.cost.min())),
            f"per world (batch of {BATCH})": "–" if math.isnan(point.cost_per_world) else _time(point.cost_per_world),
        }
        for point in found.pareto_front
    ]


def sentences(found: TradeOff, within: Sequence[float]) -> list[str]:
    """The cheapest configuration within each tolerance and the next best; then what is dominated or left out."""
    unit = _unit(found)
    name = found.metric.replace("_", " ")
    lines = []
    for tolerance in within:
        goal = f"{found.scene.name}, {name} within {tolerance:g}{unit}"
        advice = found.recommendation(tolerance)
        if advice is None:
            nearest = min(found.points, key=lambda point: point.error)
            lines.append(f"{goal}: no tested configuration reaches it; the nearest is {_named(nearest)} with {nearest.error:.2e}{unit}.")
            continue
        sentence = f"{goal}: {_named(advice.best)}, {_time(advice.best.typical_cost)} per simulated second"
        if advice.next_best is None:
            sentence += "; no other engine or method reaches it."
        elif advice.level:
            sentence += f"; level with {_named(advice.next_best)}, {advice.ratio:.2f} times as long."
        else:
            sentence += f"; the next best is {_named(advice.next_best)}, {advice.ratio:.1f} times as long."
        batched = found.best_in_batch(tolerance)
        if batched is not None:
            sentence += f" In a batch of {BATCH}: {_named(batched)}, {_time(batched.cost_per_world)} per world."
        lines.append(sentence)
    if found.dominated:
        lines.append(f"Dominated (less accurate or slower than another configuration at every step): {', '.join(found.dominated)}.")
    return lines + [f"Left out: {label}, {why}." for label, why in found.left_out.items()]


def _named(point: CostPoint) -> str:
    return f"{point.engine} at {1e3 * point.dt:.4g} ms"


def _unit(found: TradeOff) -> str:
    unit = METRICS[found.metric].unit
    return "" if unit == "1" else f" {unit}"


def _time(seconds: float) -> str:
    scale, unit = next((scale, unit) for scale, unit in ((1e3, "ms"), (1e6, "µs"), (1e9, "ns")) if seconds * scale >= 1.0 or unit == "ns")
    return f"{seconds * scale:.3g} {unit}"
