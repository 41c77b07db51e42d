"""The error budget of each error in words: its discretisation, model and setting parts."""

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

from comparisons.judging.convergence import ARTEFACTS, SATURATION
from comparisons.judging.error_budget import PLATEAU
from comparisons.results.results import NEGLIGIBLE, Results
from reports.views.numbers import formatted

Parts = tuple[float, float, float]
UNDEFINED: Parts = (math.nan, math.nan, math.nan)
OF = ["metric", "engine"]


@dataclass(frozen=True)
class ErrorParts:
    """An error of an engine in a scene at its finest step.

    Attributes:
        engine: Label of the engine.
        metric: The metric.
        unit: Unit of the values.
        dt: Time step [s].
        value: The error.
        discretisation: The part that vanishes as dt → 0; NaN where the parts are undefined, as the next two.
        model: The part that does not vanish as dt → 0.
        setting: The same, where the calibrated profile of the engine does not have it.
        uncertainty: Uncertainty of these parts; NaN where there are none.
        sentence: The budget in a sentence.
    """

    engine: str
    metric: str
    unit: str
    dt: float
    value: float
    discretisation: float
    model: float
    setting: float
    uncertainty: float
    sentence: str


def error_budgets(results: Results, scene_name: str) -> list[ErrorParts]:
    """The error budgets of a scene, metric by metric, of engines that ran at enough time steps; negligible errors are left out."""
    table = results.table[results.table["scene"] == scene_name]
    errors = table[table["kind"].isin(["truth", "invariant"]) & ~table["metric"].isin(ARTEFACTS)]
    limits, orders = (table[table["kind"] == kind][[*OF, "value", "upper", "cause", "reason"]] for kind in ("asymptotic_error", "order"))
    worth = (errors["dt"] == errors["dt"].min()) & (errors["value"].abs() > NEGLIGIBLE) & errors["engine"].isin(limits["engine"])
    both = errors[worth].merge(limits, on=OF, how="left", suffixes=("", "_of_limit"))
    both = both.merge(orders, on=OF, how="left", suffixes=("", "_of_order"))
    places = {metric: number for number, metric in enumerate(dict.fromkeys(errors["metric"]))}
    ordered = both.sort_values("metric", key=lambda metrics: metrics.map(places), kind="stable")
    return [_parts(row) for row in ordered.to_dict("records")]


def _parts(row: Mapping[Hashable, Any]) -> ErrorParts:
    value, limit, uncertainty, order = (float(row[name]) for name in ("value", "value_of_limit", "upper_of_limit", "value_of_order"))
    cause = row["cause_of_limit"]
    if math.isnan(limit) or cause == "unresolved":
        parts, uncertainty, sentence = UNDEFINED, math.nan, _why_not(row)
    elif cause == "rounding":
        parts, sentence = (0.0, 0.0, 0.0), "Within rounding."
    elif cause == "discretisation":
        parts, sentence = _vanishing(value, uncertainty, order)
    else:
        parts, sentence = _asymptotic(value, limit, uncertainty, order, cause == "setting")
    return ErrorParts(row["engine"], row["metric"], row["unit"], row["dt"], value, *parts, uncertainty, sentence)


def _why_not(row: Mapping[Hashable, Any]) -> str:
    if row["unit"] == "rad" and abs(row["value"]) > SATURATION:
        return "The angle is near π, where it saturates."
    if math.isnan(row["value_of_limit"]):
        return "Too few usable time steps."
    return f"The parts are undefined: the error {row['reason_of_limit']}."


def _vanishing(value: float, uncertainty: float, order: float) -> tuple[Parts, str]:
    if math.isnan(order):
        return UNDEFINED, f"Vanishes as dt → 0 within ± {formatted(uncertainty)}, without a clear order."
    return (value, 0.0, 0.0), f"Discretisation error of order {order:.2f}: halving dt gives about {formatted(value * 0.5**order)}."


def _asymptotic(value: float, limit: float, uncertainty: float, order: float, is_setting: bool) -> tuple[Parts, str]:
    kind = "setting error, which the calibrated profile does not have" if is_setting else "model error, which no time step cures"
    stays = (0.0, limit) if is_setting else (limit, 0.0)
    step, is_flat = value - limit, 0.0 < uncertainty <= PLATEAU * abs(limit)
    if math.isnan(order) and not is_flat:
        return (math.nan, *stays), f"A {kind}; its discretisation part is undefined."
    if abs(step) <= uncertainty:
        return (step, *stays), f"A {kind}."
    rest = "the rest is discretisation error" + (f" of order {order:.2f}" if math.isfinite(order) else "")
    return (step, *stays), f"{100.0 * abs(limit) / (abs(limit) + abs(step)):.3g} % is a {kind}; {rest}."
