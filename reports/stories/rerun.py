"""The output of `dropspin record rerun`: a row for each time step, and the differences from the record."""

import math
from typing import Any

from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.record.findings import Case, leading
from dropspin.comparisons.record.rerun import Again
from dropspin.reports.document import Document, Sentences, Table
from dropspin.reports.stories.numbers import in_ms, quantity, unit, word
from dropspin.scenarios.text import counted


def document(again: Again) -> Document:
    """The leading error of the scene and whether the motion is the same, by time step; and other values of the same motions."""
    metric = leading(again.scene)
    error = f"{quantity(metric)} error{unit(METRICS[metric].unit)}"
    rows = [
        {"dt": in_ms(dt), f"{error}, recorded": _value(was, metric), "now": _value(now, metric), "motion": _motion(was, now)}
        for dt, (was, now) in again.cases.items()
    ]
    others = [
        {"dt": in_ms(one.dt), "metric": one.metric + unit(METRICS[one.metric].unit), "recorded": repr(one.was), "now": repr(one.now)}
        for one in again.recomputed
    ]
    tables = [Table(rows), Table(others)] if others else [Table(rows)]
    return Document(f"{again.scene}, measured again", [*tables, Sentences(_sentences(again))])


def _value(case: Case, metric: str) -> str:
    """A value with all digits, or the verdict if there is no value."""
    return word(case.verdict) if case.verdict != "measured" else repr(case.values.get(metric, math.nan))


def _motion(was: Case, now: Case) -> str:
    if not (was.trajectory or now.trajectory):
        return "none"
    return "the same bits" if was.trajectory == now.trajectory else "differs"


def _sentences(again: Again) -> list[str]:
    """Sentences: why there is no motion, whether the record was reproduced, and what differs from the record."""
    reasons = []
    for was, now in again.cases.values():
        if was.verdict != "measured" and was.reason != now.reason:
            reasons.append(f"In the record, {word(was.verdict)}: {was.reason}.")
        if now.verdict != "measured":
            reasons.append(f"{word(now.verdict).capitalize()}: {now.reason or 'the plan of the record no longer has this time step'}.")
    others = "; ".join(f"{name} {now} (in the record: {was})" for name, (was, now) in again.differing.items())
    surroundings = f"Different from the record: {others}." if others else "Adapter, versions and machine are those of the record."
    return [*dict.fromkeys(reasons), *_differences(again), surroundings]


def _differences(again: Again) -> list[str]:
    """Sentences: whether verdicts and motions are those of the record, and how many values of equal motions are not."""
    moved, others, recomputed = again.moved, again.other_values, again.recomputed
    if not (moved or others):
        return ["Every verdict, motion and value equals that of the record, bit for bit."]
    differ = f"At {len(moved)} of {counted(len(again.cases), 'time step')}, the motion or the verdict differs from the record."
    sentences = [differ if moved else "Every verdict and motion equals that of the record, bit for bit."]
    of_all = counted(sum(len(was.values) for dt, (was, _) in again.cases.items() if dt not in moved), "value")
    otherwise = "by more than rounding: dropspin computes these metrics otherwise than when the record was measured"
    for count, how in ((len(recomputed), otherwise), (len(others) - len(recomputed), "by rounding alone")):
        sentences += [f"{count} of {of_all} of equal motions {'differs' if count == 1 else 'differ'} {how}."] * bool(count)
    return sentences


def as_data(again: Again) -> dict[str, Any]:
    """The results with all digits, for JSON."""
    moved, recomputed = again.moved, again.recomputed
    cases = [
        {
            "dt": dt,
            "same": dt not in moved,
            "recomputed": [value.metric for value in recomputed if value.dt == dt],
            "recorded": _case(was),
            "now": _case(now),
        }
        for dt, (was, now) in again.cases.items()
    ]
    return {"cases": cases, "differing": {name: {"recorded": was, "now": now} for name, (was, now) in again.differing.items()}}


def _case(case: Case) -> dict[str, Any]:
    return {name: getattr(case, name) for name in ("verdict", "reason", "trajectory", "values")}
