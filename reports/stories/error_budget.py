"""The error budget of each error in words: the asymptotic error with its interval, and the cause."""

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

import pandas as pd

from dropspin.comparisons.judging.convergence import ARTEFACTS, SATURATION
from dropspin.comparisons.results.results import SMALLEST_STATED, Results, is_undecided
from dropspin.reports.stories.numbers import formatted, observed_order

OF = ["metric", "engine"]
EXPLAINED = {"known": "Expected", "limited": "Known limitation"}
"""How the reason of an expected model error begins, by verdict."""


@dataclass(frozen=True)
class BudgetRow:
    """An error of an engine in a scene at the finest time step.

    Attributes:
        engine: Label of the engine.
        metric: The metric.
        unit: Unit of the values.
        dt: Time step [s].
        value: The error.
        asymptotic: The asymptotic error; `asymptotic`, `lower` and `upper` are NaN where it is undefined.
        lower: Lower end of the 95 % interval of the asymptotic error.
        upper: Upper end of that interval.
        cause: The cause to which the error is attributed.
        sentence: The error budget in a sentence.
    """

    engine: str
    metric: str
    unit: str
    dt: float
    value: float
    asymptotic: float
    lower: float
    upper: float
    cause: str
    sentence: str


def error_budgets(results: Results, scene_name: str) -> list[BudgetRow]:
    """The error budgets of a scene, by metric, for engines that ran at enough time steps; negligible errors that vanish are left out."""
    table = results.table[results.table["scene"] == scene_name]
    errors = table[table["kind"].isin(["truth", "invariant"]) & ~table["metric"].isin(ARTEFACTS)]
    columns = [*OF, "value", "lower", "upper", "cause", "verdict", "reason"]
    limits, orders = (table[table["kind"] == kind][columns] for kind in ("asymptotic_error", "order"))
    undecided = pd.MultiIndex.from_frame(table.loc[is_undecided(table), OF])
    worth = (errors["value"].abs() > SMALLEST_STATED) | pd.MultiIndex.from_frame(errors[OF]).isin(undecided)
    worth &= (errors["dt"] == errors["dt"].min()) & errors["engine"].isin(limits["engine"])
    both = errors[worth].merge(limits, on=OF, how="left", suffixes=("", "_of_limit"))
    both = both.merge(orders, on=OF, how="left", suffixes=("", "_of_order"))
    places = {metric: number for number, metric in enumerate(dict.fromkeys(errors["metric"]))}
    ordered = both.sort_values("metric", key=lambda metrics: metrics.map(places), kind="stable")
    return [_row(row) for row in ordered.to_dict("records")]


def _row(row: Mapping[Hashable, Any]) -> BudgetRow:
    limit, lower, upper = (float(row[f"{name}_of_limit"]) for name in ("value", "lower", "upper"))
    cause = "unresolved" if math.isnan(limit) else str(row["cause_of_limit"])
    sentence = _sentence(row, cause)
    return BudgetRow(row["engine"], row["metric"], row["unit"], row["dt"], float(row["value"]), limit, lower, upper, cause, sentence)


def _sentence(row: Mapping[Hashable, Any], cause: str) -> str:
    value, limit = float(row["value"]), float(row["value_of_limit"])
    if cause == "unresolved":
        return _why_undecided(row)
    if cause == "rounding":
        return "Within rounding."
    if cause == "discretisation":
        reach = max(-float(row["lower_of_limit"]), float(row["upper_of_limit"]))
        if reach > abs(value):
            return f"Discretisation error down to {formatted(reach)}; the time steps do not resolve smaller ones."
        ends = (float(row[f"{end}_of_order"]) for end in ("lower", "upper"))
        order = observed_order(float(row["value_of_order"]), *ends)
        halved = f" of {order}: halving dt gives about {formatted(value * 0.5 ** row['value_of_order'])}" if order else ""
        return f"Discretisation error{halved}."
    if cause not in ("model", "setting"):
        return f"Set by {cause}, which is the engine's own: it {row['reason_of_limit']}."
    a_setting, a_model = "setting error: the calibrated profile has none or a smaller one", "model error, which no time step removes"
    kind = a_setting if cause == "setting" else a_model
    rest = value - limit
    because = f" {EXPLAINED[row['verdict_of_limit']]}: {row['reason_of_limit']}." if row["verdict_of_limit"] in EXPLAINED else ""
    if abs(rest) <= 0.5 * (float(row["upper_of_limit"]) - float(row["lower_of_limit"])):
        return f"A {kind}.{because}"
    return f"{formatted(limit)} is a {kind}; the remaining {formatted(rest)} is discretisation error.{because}"


def _why_undecided(row: Mapping[Hashable, Any]) -> str:
    if row["unit"] == "rad" and abs(row["value"]) > SATURATION:
        return "Undecided: the angle is near π, where it saturates."
    if math.isnan(row["value_of_limit"]):
        return "Undecided: too few usable time steps."
    return f"Undecided: {row['reason_of_limit']}."
