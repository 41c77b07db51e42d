"""What a trade-off between error and cost says: rows, sentences, files."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from comparisons.measuring.metrics import METRICS
from comparisons.tradeoff import SIDE_BY_SIDE, Point, TradeOff

COLUMNS = ("scene", "metric", "engine", "dt", "error", "cost", "cost_best", "cost_quartiles", "side_by_side", "on_front")


def rows(found: TradeOff) -> list[dict[str, Any]]:
    """All points: error, and time per simulated second as median, best and quartiles of the rounds [s]."""
    front = found.front
    return [
        {
            "scene": found.scene.name,
            "metric": found.metric,
            "engine": point.engine,
            "dt": point.dt,
            "error": point.error,
            "cost": point.typical,
            "cost_best": float(point.cost.min()),
            "cost_quartiles": [float(value) for value in np.quantile(point.cost, [0.25, 0.75])],
            "side_by_side": None if math.isnan(point.side_by_side) else point.side_by_side,
            "on_front": point in front,
        }
        for point in found.points
    ]


def front_rows(found: TradeOff) -> list[dict[str, str]]:
    """The front, in words: from the cheapest to the most accurate."""
    unit = _unit(found)
    return [
        {
            "engine": point.engine,
            "step": f"{1e3 * point.dt:.4g} ms",
            "error": f"{point.error:.2e}{unit}",
            "a simulated second": _time(point.typical),
            "best": _time(float(point.cost.min())),
            f"each of {SIDE_BY_SIDE}": "–" if math.isnan(point.side_by_side) else _time(point.side_by_side),
        }
        for point in found.front
    ]


def sentences(found: TradeOff, within: Sequence[float]) -> list[str]:
    """What to take within each tolerance, by how much, what is next best; and what is never worth its time."""
    unit = _unit(found)
    name = found.metric.replace("_", " ")
    told = []
    for tolerance in within:
        goal = f"{found.scene.name}, {name} within {tolerance:g}{unit}"
        advice = found.recommendation(tolerance)
        if advice is None:
            nearest = min(found.points, key=lambda point: point.error)
            told.append(f"{goal}: nothing gets there; the nearest is {_named(nearest)} with {nearest.error:.2e}{unit}.")
            continue
        sentence = f"{goal}: {_named(advice.best)}, {_time(advice.best.typical)} a simulated second"
        if advice.next_best is None:
            sentence += "; nothing else gets there."
        elif advice.level:
            sentence += f"; level with {_named(advice.next_best)}, {advice.ratio:.2f} times that."
        else:
            sentence += f"; next best {_named(advice.next_best)}, {advice.ratio:.1f} times that."
        together = found.best_side_by_side(tolerance)
        if together is not None:
            sentence += f" Of {SIDE_BY_SIDE} side by side, {_named(together)}: {_time(together.side_by_side)} each."
        told.append(sentence)
    if found.dominated:
        told.append(f"Dominated, less accurate or slower than something else at every step: {', '.join(found.dominated)}.")
    told += [f"Left out: {label}, {why}." for label, why in found.left_out.items()]
    return told


def _named(point: Point) -> str:
    return f"{point.engine} at {1e3 * point.dt:.4g} ms"


def _unit(found: TradeOff) -> str:
    unit = METRICS[found.metric].unit
    return "" if unit == "1" else f" {unit}"


def _time(seconds: float) -> str:
    scale, unit = next((scale, unit) for scale, unit in ((1e3, "ms"), (1e6, "µs"), (1e9, "ns")) if seconds * scale >= 1.0 or unit == "ns")
    return f"{seconds * scale:.3g} {unit}"
