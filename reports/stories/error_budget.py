"""The error budgets of a scene: for each error the asymptotic error with its interval, the cause, and a sentence."""

from collections.abc import Hashable
from typing import Any

from dropspin.comparisons.judging.convergence import ARTEFACTS, SATURATION
from dropspin.comparisons.judging.verdicts import COMBINED, WITHIN_UNCERTAINTY
from dropspin.comparisons.results.results import SMALLEST_STATED, Results
from dropspin.reports.stories.numbers import Row, formatted, observed_order

EXPLAINED = {"known": "Expected", "limited": "Known limitation"}
"""The words before the reason of an expected model error, by verdict."""
LASTING = {
    "setting": "setting error, of which calibrated settings remove more than half",
    "model": "model error, which no time step removes",
}
"""The words for an error that does not vanish as dt → 0, by cause."""
STATED = ("value", "lower", "upper", "cause", "verdict", "reason")
"""The columns that a budget has of the asymptotic error, and of the order."""


def error_budgets(results: Results) -> list[dict[Hashable, Any]]:
    """The errors of a run of one scene at the finest time step, by metric, for engines that ran at enough time steps.

    Negligible errors that vanish as dt → 0 are left out. A row has the columns of the error, of its asymptotic error (names that end in
    `_of_limit`) and of its order (`_of_order`), which are NaN if undefined; the cause to which the error is attributed; whether it is
    undecided; and a sentence.
    """
    table, pair = results.table, ["metric", "engine"]
    errors = table.assign(undecided=results.undecided.groupby([table[name] for name in pair]).transform("any"))
    errors = errors[table["kind"].isin(["truth", "invariant"]) & ~table["metric"].isin(ARTEFACTS)]
    for kind, of in (("asymptotic_error", "limit"), ("order", "order")):
        study = table.loc[table["kind"] == kind, [*pair, *STATED]]
        errors = errors.merge(study, "left", pair, suffixes=("", f"_of_{of}"))
    judged = table.loc[table["kind"] == "asymptotic_error", "engine"]
    is_worth_it = (errors["value"].abs() > SMALLEST_STATED) | errors["undecided"]
    found = errors[is_worth_it & (errors["dt"] == errors["dt"].min()) & errors["engine"].isin(judged)]
    found = found.assign(cause=found["cause_of_limit"].where(found["value_of_limit"].notna(), "unresolved"))
    order = list(errors["metric"].unique())
    budgets = found.sort_values("metric", key=lambda names: names.map(order.index), kind="stable").to_dict("records")
    return [budget | {"sentence": _sentence(budget)} for budget in budgets]


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
    if cause not in LASTING:
        return f"Due to {cause}, an option of the engine: the error {row['reason_of_limit']}."
    kind, rest = LASTING[cause], value - limit
    because = f" {EXPLAINED[row['verdict_of_limit']]}: {row['reason_of_limit']}." if row["verdict_of_limit"] in EXPLAINED else ""
    if abs(rest) <= 0.5 * (float(row["upper_of_limit"]) - float(row["lower_of_limit"])):
        return f"A {kind}.{because}"
    return f"{formatted(limit)} is a {kind}; the remaining {formatted(rest)} is discretisation error.{because}"
