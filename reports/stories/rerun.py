"""The output of `dropspin record rerun`: a row for each time step, and the differences from the record."""

import math
from typing import Any

from dropspin.comparisons.measuring.metrics import METRICS
from dropspin.comparisons.record.findings import Case, leading
from dropspin.comparisons.record.rerun import Again
from dropspin.reports.document import Document, Sentences, Table
from dropspin.reports.stories.numbers import in_ms, quantity, unit, word
from dropspin.scenarios.text import counted


def document(again: Again, scene: str) -> Document:
    """A row for each time step: the leading error of the scene in the record and now, and whether the motion is the same."""
    metric = leading(scene)
    error = f"{quantity(metric)} error{unit(METRICS[metric].unit)}"
    rows = [
        {"dt": in_ms(dt), f"{error}, recorded": _value(was, metric), "now": _value(now, metric), "motion": _motion(was, now)}
        for dt, (was, now) in again.cases.items()
    ]
    return Document(f"{scene}, measured again", [Table(rows), Sentences(_sentences(again))])


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
    moved, count = len(again.moved), len(again.cases)
    differ = f"{moved} of {counted(count, 'result')} {'differs' if moved == 1 else 'differ'} from the record."
    result = differ if moved else "Every result equals that of the record, bit for bit."
    others = "; ".join(f"{name} {now} (in the record: {was})" for name, (was, now) in again.differing.items())
    surroundings = f"Different from the record: {others}." if others else "Adapter, versions and machine are those of the record."
    return [*dict.fromkeys(reasons), result, surroundings]


def as_data(again: Again) -> dict[str, Any]:
    """The results with all digits, for JSON."""
    cases = [{"dt": dt, "same": dt not in again.moved, "recorded": _case(was), "now": _case(now)} for dt, (was, now) in again.cases.items()]
    return {"cases": cases, "differing": {name: {"recorded": was, "now": now} for name, (was, now) in again.differing.items()}}


def _case(case: Case) -> dict[str, Any]:
    return {name: getattr(case, name) for name in ("verdict", "reason", "trajectory", "values")}
