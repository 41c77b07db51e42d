"""What several steps say together: of each error the observed order, the limit as the step goes to 0, and the cause.

Any engine is held to this, whatever a scene expects besides: its limit is the truth, within the limit's uncertainty, and its order is not
below the one it claims. A fault that is known, and expected of this engine by name, passes as long as the limit is what is expected.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from comparisons.convergence import Convergence, says_something, take_apart
from comparisons.engines.base import Limit
from comparisons.metrics import METRICS, Average
from comparisons.tolerances import rounding
from comparisons.verdicts import Verdict, excused, known_fault
from scenarios import Scenario

Row = dict[str, Any]
Array = NDArray[np.float64]

STUDIES = ("order", "model_error")
"""Kinds of rows that several steps together give."""
ARTEFACTS = frozenset({"energy_error_raw"})
"""Metrics that show how a state is sampled rather than how wrong it is."""
JUMPING = frozenset({"out_of_step"})
"""Metrics that go from flight to flight."""
SHORT_OF_ORDER = 0.25
"""How far three steps may find an order below the one claimed."""
LOST = 0.9 * math.pi
"""An angle that has come near half a turn cannot grow on: how wrong it is can no longer be told."""
OUT_OF_STEP = 0.5
"""Of the height of the drop: a bouncing body that is so far off is in another flight, and how wrong that is can no longer be told."""


class Claim(NamedTuple):
    """What an engine says of itself in a scene: its order of accuracy, or None, the precision of its state, and limits it has met."""

    label: str
    order: float | None
    precision: type
    limits: tuple[Limit, ...] = ()


def study_rows(scene: Scenario, claim: Claim, rows: Sequence[Row]) -> list[Row]:
    """Rows of kind `order` and `model_error` from an engine's measurements of a scene at several steps.

    Puts the cause into the measurements that have none yet.
    """
    studies: list[Row] = []
    if not says_something(sorted({row["dt"] for row in rows})):
        return studies
    for metric in _metrics(rows):
        measured = [row for row in rows if row.get("metric") == metric]
        dts, errors, resolutions, rounded = _series(scene, claim, metric, measured)
        apart = partial(take_apart, claimed=claim.order, signed=METRICS[metric].signed, jumps=metric in JUMPING)
        found = apart(dts, errors, resolutions, rounded)
        for row in measured:
            row["cause"] = row["cause"] or found.cause
        shared: Row = {name: measured[0][name] for name in ("scene", "engine", "metric", "unit", "truth") if name in measured[0]}
        tolerances = np.array([row["tolerance"] for row in measured])
        moves = _moves(found, lambda moved: apart(dts, moved, resolutions, rounded), errors, tolerances)  # noqa: B023 - called here
        judged = _order_row(scene, claim, shared, found) + _limit_row(scene, claim, shared, found, [row["dt"] for row in measured])
        for row in judged:
            row["tolerance"] = moves[row["kind"]]
        studies += [excused(row, claim.limits) if row["kind"] == "model_error" else row for row in judged]
    return studies


def blame_settings(rows: Sequence[Row], calibrated: Sequence[Row]) -> None:
    """Say that an error is a setting's where it stays as the step goes to 0, and the same engine, calibrated, does not have it.

    Args:
        rows: Measurements and studies of an engine with its default settings; their causes are changed.
        calibrated: Studies of the calibrated engine.
    """
    cured = {row["metric"] for row in calibrated if row["kind"] == "model_error" and row["cause"] in ("discretisation", "rounding")}
    for row in rows:
        if row.get("cause") == "model" and row["metric"] in cured:
            row["cause"] = "setting"
            if row["kind"] == "model_error" and row["verdict"] == "failed":
                row["reason"] += ", but the calibrated profile does: it is a setting"


def _metrics(rows: Iterable[Row]) -> list[str]:
    return list(
        dict.fromkeys(row["metric"] for row in rows if row.get("kind") in ("truth", "invariant") and row["metric"] not in ARTEFACTS)
    )


def _series(scene: Scenario, claim: Claim, metric: str, measured: Sequence[Row]) -> tuple[Array, Array, Array, Array]:
    """Steps, errors, how finely these are resolved and what rounding may do; of the part that is worst at the finest step."""
    dts, steps = (np.array([row[name] for row in measured], dtype=float) for name in ("dt", "steps"))
    averages: list[Average] = [row["average"] for row in measured]
    told = [average for average in averages if np.isfinite(average.parts).all()]
    shape = min((average.parts.shape for average in told), default=(1,))
    finest = averages[int(np.argmin(dts))].parts[: shape[0]]
    worst = np.unravel_index(np.argmax(np.abs(finest)), finest.shape)
    errors, resolutions = (
        np.array([values[worst] if values.shape[1:] == shape[1:] else math.nan for values in both])
        for both in zip(*(average[:2] for average in averages), strict=True)
    )
    rounded = rounding(scene, METRICS[metric].unit, claim.precision, steps)
    if METRICS[metric].unit == "rad":
        errors[np.abs(errors) > LOST] = math.nan
    if metric == "position_error" and scene.starts_above_floor:
        errors[np.abs(errors) > OUT_OF_STEP * scene.clearance] = math.nan
    return dts, errors, resolutions, rounded


def _moves(found: Convergence, again: Callable[[Array], Convergence], errors: Array, tolerances: Array) -> dict[str, float]:
    """How far order and limit move when each error does by its tolerance; NaN if they cannot be told then."""
    orders, limits = [], []
    for nth in np.flatnonzero(np.isfinite(errors)):
        moved = [again(np.where(np.arange(len(errors)) == nth, errors + sign * tolerances, errors)) for sign in (-1.0, 1.0)]
        orders.append(np.max(np.abs([one.order - found.order for one in moved])))
        limits.append(np.max(np.abs([one.limit - found.limit for one in moved])))
    return {"order": float(np.sum(orders)), "model_error": float(np.maximum(np.sum(limits), found.uncertainty))}


def _order_row(scene: Scenario, claim: Claim, shared: Row, found: Convergence) -> list[Row]:
    claimed = claim.order if found.cause == "discretisation" else None
    if math.isnan(found.order) and claimed != math.inf:
        return []
    lower = math.nan if claimed is None else claimed - SHORT_OF_ORDER
    verdict: Verdict = "measured" if claimed is None else "passed" if found.order >= lower else "failed"
    if verdict == "failed" and not found.is_asymptotic:
        verdict = "measured"
    steps = ", ".join(f"{dt:g}" for dt in found.window)
    left_out = "".join(f"; {dt:g} s left out: {why}" for dt, why in found.left_out)
    said = "" if claimed is None else f"; claimed {'exactness' if claimed == math.inf else f'{claimed:g}'}"
    reason = f"fitted at {steps} s{left_out}{said}" if steps else f"{found.reason}{said}"
    return [
        shared
        | {"kind": "order", "unit": "1", "value": found.order, "lower": lower, "verdict": verdict, "cause": found.cause, "reason": reason}
    ]


def _limit_row(scene: Scenario, claim: Claim, shared: Row, found: Convergence, dts: Sequence[float]) -> list[Row]:
    if math.isnan(found.limit):
        return []
    reason, verdict = found.reason, "passed"
    if found.cause == "unresolved":
        verdict = "measured"
    if found.cause == "model":
        fault = known_fault(scene, claim.label, min(dts), METRICS[shared["metric"]], found.limit, found.uncertainty)
        verdict, reason = ("failed", f"{reason}; no step cures it") if fault is None else ("passed", fault)
    bounds = {"lower": -found.uncertainty, "upper": found.uncertainty}
    return [shared | bounds | {"kind": "model_error", "value": found.limit, "verdict": verdict, "cause": found.cause, "reason": reason}]
