"""The format of numbers, bounds and verdicts in all output."""

import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from functools import cache
from typing import Any, TypeVar

from dropspin.comparisons.judging.error_budget import is_determined
from dropspin.comparisons.judging.verdicts import COMBINED, OUTCOMES, with_reason
from dropspin.comparisons.measuring.symmetries import kind_of
from dropspin.scenarios.text import counted, rounded

MOST_NAMED = 3
"""Largest number of scenes, metrics or engines that a sentence names; if there are more, it gives their number."""
SEVERAL = 1.02
"""Sum of shares above which the shares belong to alternative explanations."""
EACH = 0.9
"""Least share of each of these."""
Row = Mapping[Hashable, Any]
"""A row of the table of a run, by column."""
Item = TypeVar("Item")
Key = TypeVar("Key")


def formatted(value: float) -> str:
    """Three significant digits, with an exponent below 0.01 and from 1000 on; an exact zero is 0, an undefined value is –."""
    if math.isnan(value):
        return "–"
    if value == 0.0:
        return "0"
    rounded = f"{value:#.3g}".removesuffix(".")
    return rounded if "e" not in rounded and abs(float(rounded)) >= 0.01 else f"{value:.2e}"


def bound(lower: float, upper: float) -> str:
    """Bounds as an inequality; empty if there are none."""
    if math.isnan(lower):
        return "" if math.isnan(upper) else f"≤ {upper:.3g}"
    if math.isnan(upper):
        return f"≥ {lower:.3g}"
    return f"± {upper:.3g}" if lower == -upper else f"{lower:.3g} … {upper:.3g}"


def word(verdict: str) -> str:
    """A verdict in words: the reason of its outcome, or the outcome; other words, such as `not measured` of a record, are not changed."""
    outcome, reason = OUTCOMES.get(verdict, (verdict, ""))
    return reason or outcome


def outcome(verdict: str) -> str:
    """The outcome of a verdict with its reason, such as `not judged (declined)`."""
    return with_reason(*OUTCOMES[verdict])


def quantity(metric: str) -> str:
    """The quantity whose error a metric is, in words; for a metric that is not an error, its name in words."""
    return metric.replace("_", " ").removesuffix(" error")


def short(value: float) -> str:
    """Two significant digits, or an integer from 10 to 10,000; with an exponent below 0.01 and from 10,000 on; an exact zero is 0."""
    if value == 0.0 or not math.isfinite(value):
        return formatted(value)
    if 9.95 <= value < 1e4:
        return f"{value:.0f}"
    digits = f"{value:#.2g}"
    if 0.01 <= value < 9.95:
        return digits
    mantissa, exponent = f"{value:.1e}".split("e")
    return f"{mantissa}e{int(exponent)}"


def duration(seconds: float) -> str:
    """A time in s, ms, µs or ns, to three significant digits."""
    units = ((1.0, "s"), (1e3, "ms"), (1e6, "µs"), (1e9, "ns"))
    seconds = float(f"{seconds:.3g}")
    scale, unit = next((scale, unit) for scale, unit in units if seconds * scale >= 1.0 or unit == "ns")
    return f"{rounded(seconds * scale, 3)} {unit}"


def failing(count: int, total: int, what: str) -> str:
    """The number that fail out of all, as a sentence: `1 of 2 checks fails`."""
    return f"{count:,} of {counted(total, what)} {'fails' if count == 1 else 'fail'}"


def capitalized(sentence: str) -> str:
    """A sentence with a capital first letter."""
    return sentence[:1].upper() + sentence[1:]


def listed(names: Sequence[str], most: int = 4) -> str:
    """The first names, separated by commas, and the number of the others."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def named(names: Sequence[str], kind: str, most: int = MOST_NAMED) -> str:
    """Names if they are few, otherwise their number."""
    if len(names) > most:
        return f"{len(names)} {kind}s"
    *others, last = names
    return f"{', '.join(others)} and {last}" if others else last


def grouped(items: Iterable[Item], key: Callable[[Item], Key]) -> dict[Key, list[Item]]:
    """Items by a key, in the order in which they occur."""
    groups: dict[Key, list[Item]] = {}
    for item in items:
        groups.setdefault(key(item), []).append(item)
    return groups


def left_out(reasons: Mapping[str, str]) -> list[str]:
    """A sentence for each engine that is left out of a study; a reason may be a sentence that begins with the engine's name."""
    return [f"Left out: {'' if why.startswith(label) else f'{label}, '}{why.removesuffix('.')}." for label, why in reasons.items()]


def explained_by(shares: Mapping[str, float], error: str) -> str:
    """The settings that explain an error, with their shares of it; a name such as `a, b` is two settings that explain it together."""
    names, sizes = [name.replace(", ", " and ") for name in shares], [f"{rounded(100.0 * share, 3)} %" for share in shares.values()]
    are_together = any(", " in name for name in shares)
    explain = "explain" if are_together else "explains"
    if len(shares) > 1 and sum(shares.values()) > SEVERAL and min(shares.values()) >= EACH:
        return f"either {', or '.join(names)} {explain} {sizes[0]} {error}"
    if are_together:
        return f"{names[0]} together explain {sizes[0]} {error}; neither alone explains 90 %"
    others = zip(names[1:], sizes[1:], strict=True)
    return f"{names[0]} explains {sizes[0]} {error}" + "".join(f", and {name} {size}" for name, size in others)


def step(dt: float) -> str:
    """A time step in seconds; → 0 for an extrapolation of several."""
    return "→ 0" if math.isnan(dt) else f"{dt:g}"


def in_ms(dt: float) -> str:
    """A time step in milliseconds, with four digits; → 0 for an extrapolation of several."""
    return "→ 0" if math.isnan(dt) else f"{1e3 * dt:.4g} ms"


def unit(of: str) -> str:
    """A unit in brackets, to follow a name; empty for a ratio."""
    return "" if of == "1" else f" [{of}]"


def with_unit(value: str, of: str) -> str:
    """A formatted value with its unit, unless it is a ratio."""
    return value if of == "1" else f"{value} {of}"


def sized(value: float, of: str) -> str:
    """The size of an error with its unit; that of a ratio in percent."""
    return f"{formatted(100.0 * value)} %" if of == "1" else f"{formatted(value)} {of}"


def subject(metric: str, kind: str, truth: str = "") -> str:
    """The subject of a row in words, such as `order of orientation error`; for a row of kind `baseline`, that of the accepted result."""
    words = metric.replace("_", " ")
    before = {"order": "order of", "asymptotic_error": "asymptotic", "ensemble": "mean", "uncertainty": "uncertainty of"}
    if kind_of(metric) is not None:
        return f"difference of the motion {words}"
    return f"{before.get(_accepted_kinds().get(truth, kind), '')} {words}".lstrip()


@cache
def _accepted_kinds() -> dict[str, str]:
    from dropspin.comparisons.regressions.checking import ACCEPTED

    return {text: kind for kind, text in ACCEPTED.items()}


def observed_order(order: float, lower: float, upper: float) -> str:
    """An order with its interval; empty if the time steps do not determine it."""
    return f"order {order:.2f} ({lower:.2f} to {upper:.2f})" if is_determined(lower, upper) else ""


def trend(asymptotic_error: float, cause: str, order: str = "") -> str:
    """The behaviour of an error as dt → 0, in a few words; the order is that of `observed_order`."""
    if cause == "discretisation":
        return order or "→ 0"
    value = f"→ {formatted(asymptotic_error)}"
    return {"model": value, "setting": f"{value}: setting error", COMBINED: f"{value}: {COMBINED}"}.get(cause, cause)
