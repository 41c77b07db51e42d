"""Each error taken apart: what of it is the step's, the model's, a setting's."""

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

from comparisons import Results
from reports.findings import NEGLIGIBLE
from reports.numbers import written

LASTING = ("model", "setting")
"""Causes of what stays as the step goes to 0."""
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
        of_step: What of it the step makes; NaN where that cannot be told.
        of_model: What of it is left as the step goes to 0.
        of_setting: The same, where the calibrated profile of the engine does not have it.
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
    words: str


def taken_apart(results: Results, scene_name: str) -> list[Apart]:
    """The errors of a scene that are worth a word and were studied at several steps, metric by metric."""
    frame = results.frame[results.frame["scene"] == scene_name]
    errors = frame[frame["kind"].isin(["truth", "invariant"])]
    finest = errors[(errors["dt"] == errors["dt"].min()) & (errors["value"].abs() > NEGLIGIBLE)]
    limits, orders = (frame[frame["kind"] == kind][[*OF, "value", "cause", "reason"]] for kind in ("model_error", "order"))
    both = finest.merge(limits, on=OF, suffixes=("", "_of_limit")).merge(orders, on=OF, how="left", suffixes=("", "_of_order"))
    places = {metric: number for number, metric in enumerate(dict.fromkeys(errors["metric"]))}
    ordered = both.sort_values("metric", key=lambda metrics: metrics.map(places), kind="stable")
    return [_apart(row) for row in ordered.to_dict("records")]


def _apart(row: Mapping[Hashable, Any]) -> Apart:
    value, cause = row["value"], row["cause_of_limit"]
    lasting = row["value_of_limit"] if cause in LASTING else 0.0
    step = value - lasting if cause in (*LASTING, "discretisation") else math.nan
    return Apart(
        row["engine"],
        row["metric"],
        row["unit"],
        row["dt"],
        value,
        step,
        lasting if cause == "model" else 0.0,
        lasting if cause == "setting" else 0.0,
        _words(value, step, lasting, cause, row["value_of_order"], row["reason_of_limit"]),
    )


def _words(value: float, step: float, lasting: float, cause: str, order: float, reason: str) -> str:
    if cause == "discretisation":
        if math.isnan(order):
            return "All of it is the step's; it shrinks with it, at no clear order."
        return f"All of it is the step's, at order {order:.2f}: half the step leaves some {written(value * 0.5**order)}."
    if cause in LASTING:
        whose = "the model's: no step cures it" if cause == "model" else "a setting's: the calibrated profile does not have it"
        share = 100.0 * min(1.0, abs(lasting) / (abs(lasting) + abs(step)))
        rest = (
            "" if abs(step) < 1e-3 * abs(lasting) else "; the rest is the step's" + ("" if math.isnan(order) else f", at order {order:.2f}")
        )
        return f"{share:.3g} % is {whose}{rest}."
    if cause == "rounding":
        return "As small as rounding makes it."
    return f"Cannot be taken apart: {reason}."
