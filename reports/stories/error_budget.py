"""The error budgets of a scene: for each error the asymptotic error with its interval, the cause, and a sentence."""

import math
from collections.abc import Hashable, Mapping
from typing import Any

import numpy as np

from dropspin.comparisons.judging.convergence import ARTEFACTS, SATURATION
from dropspin.comparisons.judging.verdicts import COMBINED, WITHIN_UNCERTAINTY
from dropspin.comparisons.results.results import SMALLEST_STATED, Results
from dropspin.reports.stories.numbers import Row, formatted, observed_order

EXPLAINED = {"known": "Expected", "limited": "Known limitation"}
"""The words before the reason of an expected model error, by verdict."""


def error_budgets(results: Results) -> list[dict[Hashable, Any]]:
    """The errors of a run of one scene at the finest time step, by metric, for engines that ran at enough time steps.

    Negligible errors that vanish as dt → 0 are left out. A row has the columns of the error, of its asymptotic error (names that end in
    `_of_limit`) and of its order (`_of_order`), which are NaN if undefined; the cause to which the error is attributed; and a sentence.
    """
    rows = results.table.to_dict("records")
    errors = [row for row in rows if row["kind"] in ("truth", "invariant") and row["metric"] not in ARTEFACTS]
    limits, orders = ({_pair(row): row for row in rows if row["kind"] == kind} for kind in ("asymptotic_error", "order"))
    undecided, judged = {_pair(rows[n]) for n in np.flatnonzero(results.undecided)}, {engine for _, engine in limits}
    finest = min((row["dt"] for row in errors), default=math.nan)
    places = {metric: number for number, metric in enumerate(dict.fromkeys(row["metric"] for row in errors))}
    budgets = []
    for row in sorted(errors, key=lambda row: places[row["metric"]]):
        is_worth_it = abs(row["value"]) > SMALLEST_STATED or _pair(row) in undecided
        if is_worth_it and row["dt"] == finest and row["engine"] in judged:
            budget = row | _suffixed(limits, row, "limit") | _suffixed(orders, row, "order")
            budget["cause"] = "unresolved" if math.isnan(budget["value_of_limit"]) else budget["cause_of_limit"]
            budgets.append(budget | {"sentence": _sentence(budget)})
    return budgets


def _pair(row: Row) -> tuple[str, str]:
    return row["metric"], row["engine"]


def _suffixed(studies: Mapping[tuple[str, str], Row], row: Row, of: str) -> dict[Hashable, Any]:
    """The columns of the row that a study has for an error, NaN without one, by names that end in what they are of."""
    study = studies.get(_pair(row), {})
    return {f"{column}_of_{of}": study.get(column, math.nan) for column in ("value", "lower", "upper", "cause", "verdict", "reason")}


def _sentence(row: Row) -> str:
    value, limit, cause = float(row["value"]), float(row["value_of_limit"]), row["cause"]
    if cause == "unresolved":
        if row["unit"] == "rad" and abs(value) > SATURATION:
            return "Undecided: the angle is near π, where it saturates."
        return f"Undecided: {row['reason_of_limit'] if isinstance(row['reason_of_limit'], str) else 'too few usable time steps'}."
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
