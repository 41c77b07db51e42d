"""The error budgets of a scene: for each error the asymptotic error with its interval, the cause, and a sentence."""

import math
from collections.abc import Hashable
from typing import Any

import pandas as pd

from dropspin.comparisons.judging.convergence import ARTEFACTS, SATURATION
from dropspin.comparisons.judging.verdicts import COMBINED, WITHIN_UNCERTAINTY
from dropspin.comparisons.results.results import SMALLEST_STATED, Results, is_undecided
from dropspin.reports.stories.numbers import Row, formatted, observed_order

OF = ["metric", "engine"]
EXPLAINED = {"known": "Expected", "limited": "Known limitation"}
"""The words before the reason of an expected model error, by verdict."""


def error_budgets(results: Results, scene_name: str) -> list[dict[Hashable, Any]]:
    """The errors of a scene at the finest time step, by metric, for engines that ran at enough time steps.

    Negligible errors that vanish as dt → 0 are left out. A row has the columns of the error, of its asymptotic error (names that end in
    `_of_limit`) and of its order (`_of_order`), which are NaN if undefined; the cause to which the error is attributed; and a sentence.
    """
    table = results.table[results.table["scene"] == scene_name]
    errors = table[table["kind"].isin(["truth", "invariant"]) & ~table["metric"].isin(ARTEFACTS)]
    columns = [*OF, "value", "lower", "upper", "cause", "verdict", "reason"]
    limits, orders = (table[table["kind"] == kind][columns] for kind in ("asymptotic_error", "order"))
    undecided = pd.MultiIndex.from_frame(table.loc[is_undecided(table), OF])
    worth = (errors["value"].abs() > SMALLEST_STATED) | pd.MultiIndex.from_frame(errors[OF]).isin(undecided)
    worth &= (errors["dt"] == errors["dt"].min()) & errors["engine"].isin(limits["engine"])
    both = errors[worth].merge(limits, on=OF, how="left", suffixes=("", "_of_limit"))
    both = both.merge(orders, on=OF, how="left", suffixes=("", "_of_order"))
    both["cause"] = both["cause_of_limit"].where(both["value_of_limit"].notna(), "unresolved")
    places = {metric: number for number, metric in enumerate(dict.fromkeys(errors["metric"]))}
    ordered = both.sort_values("metric", key=lambda metrics: metrics.map(places), kind="stable")
    return [row | {"sentence": _sentence(row)} for row in ordered.to_dict("records")]


def _sentence(row: Row) -> str:
    value, limit, cause = float(row["value"]), float(row["value_of_limit"]), row["cause"]
    if cause == "unresolved":
        if row["unit"] == "rad" and abs(value) > SATURATION:
            return "Undecided: the angle is near π, where it saturates."
        return "Undecided: too few usable time steps." if math.isnan(limit) else f"Undecided: {row['reason_of_limit']}."
    if cause == "rounding":
        return "Within rounding error."
    if cause == "discretisation":
        reach = max(-float(row["lower_of_limit"]), float(row["upper_of_limit"]))
        if reach > abs(value):
            return f"Attributed to discretisation, although the time steps bound the asymptotic error only by {formatted(reach)}."
        ends = (float(row[f"{end}_of_order"]) for end in ("lower", "upper"))
        order = observed_order(float(row["value_of_order"]), *ends)
        halved = f" of {order}: halving dt gives about {formatted(value * 0.5 ** row['value_of_order'])}" if order else ""
        return f"Discretisation error{halved}."
    if cause == WITHIN_UNCERTAINTY:
        return "Within the uncertainty of the recording."
    if cause == COMBINED:
        return f"At least {formatted(row['lower_of_limit'])} is due to the model, the settings and the initial state together."
    if cause not in ("model", "setting"):
        return f"Due to {cause}, an option of the engine: the error {row['reason_of_limit']}."
    a_setting, a_model = "setting error, which calibrated settings reduce or remove", "model error, which no time step removes"
    kind = a_setting if cause == "setting" else a_model
    rest = value - limit
    because = f" {EXPLAINED[row['verdict_of_limit']]}: {row['reason_of_limit']}." if row["verdict_of_limit"] in EXPLAINED else ""
    if abs(rest) <= 0.5 * (float(row["upper_of_limit"]) - float(row["lower_of_limit"])):
        return f"A {kind}.{because}"
    return f"{formatted(limit)} is a {kind}; the remaining {formatted(rest)} is discretisation error.{because}"
