"""Each error taken apart: what of it is the step's, the model's, a setting's."""

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

from comparisons import Results
from comparisons.convergence import PLATEAU
from comparisons.studies import ARTEFACTS, LOST
from reports.findings import NEGLIGIBLE
from reports.numbers import written

Parts = tuple[float, float, float]
UNTOLD: Parts = (math.nan, math.nan, math.nan)
OF = ["metric", "engine"]


@dataclass(frozen=True)
class Apart:
    """An error of an engine in a scene at its finest step.

    Attributes:
        engine: Label of the engine.
        metric: The metric.
        unit: Of the figures.
        dt: The step [s].
        value: The error.
        of_step: What of it the step makes; NaN where that cannot be told, as the next two.
        of_model: What of it is left as the step goes to 0.
        of_setting: The same, where the calibrated profile of the engine does not have it.
        uncertainty: Of these parts; NaN where there are none.
        words: All of it in a sentence.
    """

    engine: str
    metric: str
    unit: str
    dt: float
    value: float
    of_step: float
    of_model: float
    of_setting: float
    uncertainty: float
    words: str


def taken_apart(results: Results, scene_name: str) -> list[Apart]:
    """The errors of a scene that are worth a word, of engines that were studied at several steps; metric by metric."""
    frame = results.frame[results.frame["scene"] == scene_name]
    errors = frame[frame["kind"].isin(["truth", "invariant"]) & ~frame["metric"].isin(ARTEFACTS)]
    limits, orders = (frame[frame["kind"] == kind][[*OF, "value", "upper", "cause", "reason"]] for kind in ("model_error", "order"))
    worth = (errors["dt"] == errors["dt"].min()) & (errors["value"].abs() > NEGLIGIBLE) & errors["engine"].isin(limits["engine"])
    both = errors[worth].merge(limits, on=OF, how="left", suffixes=("", "_of_limit"))
    both = both.merge(orders, on=OF, how="left", suffixes=("", "_of_order"))
    places = {metric: number for number, metric in enumerate(dict.fromkeys(errors["metric"]))}
    ordered = both.sort_values("metric", key=lambda metrics: metrics.map(places), kind="stable")
    return [_apart(row) for row in ordered.to_dict("records")]


def _apart(row: Mapping[Hashable, Any]) -> Apart:
    value, limit, uncertainty, order = (float(row[name]) for name in ("value", "value_of_limit", "upper_of_limit", "value_of_order"))
    cause = row["cause_of_limit"]
    if math.isnan(limit) or cause == "unresolved":
        parts, uncertainty, words = UNTOLD, math.nan, _why_not(row)
    elif cause == "rounding":
        parts, words = (0.0, 0.0, 0.0), "As small as rounding makes it."
    elif cause == "discretisation":
        parts, words = _vanishing(value, uncertainty, order)
    else:
        parts, words = _lasting(value, limit, uncertainty, order, cause == "setting")
    return Apart(row["engine"], row["metric"], row["unit"], row["dt"], value, *parts, uncertainty, words)


def _why_not(row: Mapping[Hashable, Any]) -> str:
    if row["unit"] == "rad" and abs(row["value"]) > LOST:
        return "Near half a turn, where an angle cannot grow on."
    if math.isnan(row["value_of_limit"]):
        return "Too few of these steps tell it."
    return f"Cannot be taken apart: {row['reason_of_limit']}."


def _vanishing(value: float, uncertainty: float, order: float) -> tuple[Parts, str]:
    if math.isnan(order):
        return UNTOLD, f"Nothing says that it stays: it goes to 0, to ± {written(uncertainty)}, but at no clear order."
    return (value, 0.0, 0.0), f"All of it is the step's, at order {order:.2f}: half the step leaves some {written(value * 0.5**order)}."


def _lasting(value: float, limit: float, uncertainty: float, order: float, is_setting: bool) -> tuple[Parts, str]:
    whose = "a setting's: the calibrated profile does not have it" if is_setting else "the model's: no step cures it"
    stays = (0.0, limit) if is_setting else (limit, 0.0)
    step, is_flat = value - limit, 0.0 < uncertainty <= PLATEAU * abs(limit)
    if math.isnan(order) and not is_flat:
        return (math.nan, *stays), f"It stays, and is {whose}; what of it is the step's cannot be told."
    if abs(step) <= uncertainty:
        return (step, *stays), f"All of it is {whose}."
    rest = "the rest is the step's" + (f", at order {order:.2f}" if math.isfinite(order) else "")
    return (step, *stays), f"{100.0 * abs(limit) / (abs(limit) + abs(step)):.3g} % is {whose}; {rest}."
