"""How numbers are written, everywhere."""

import math

from comparisons.regressions.checking import ACCEPTED

ACCEPTED_KINDS = {said: kind for kind, said in ACCEPTED.items()}
MARKS = {
    "passed": "✓",
    "failed": "✗",
    "measured": "·",
    "limited": "!",
    "diverged": "∞",
    "crashed": "✗",
    "timed_out": "⏱",
    "declined": "–",
    "missing": "?",
    "no_truth": "·",
}
WORDS = {"timed_out": "timed out", "no_truth": "no truth"}


def written(value: float) -> str:
    """Three digits; exact zero is 0, no value is –."""
    if math.isnan(value):
        return "–"
    return "0" if value == 0.0 else f"{value:.2e}"


def bound(lower: float, upper: float) -> str:
    """A bound as an inequality, or nothing."""
    if math.isnan(lower) and math.isnan(upper):
        return ""
    if math.isnan(lower):
        return f"≤ {upper:.3g}"
    if math.isnan(upper):
        return f"≥ {lower:.3g}"
    return f"± {upper:.3g}" if lower == -upper else f"{lower:.3g} … {upper:.3g}"


def word(verdict: str) -> str:
    """A verdict as people write it."""
    return WORDS.get(verdict, verdict)


def step(dt: float) -> str:
    """A step in seconds; what several steps say together belongs to none, but to their limit."""
    return "→ 0" if math.isnan(dt) else f"{dt:g}"


def in_ms(dt: float) -> str:
    """A step in milliseconds, or the limit."""
    return "→ 0" if math.isnan(dt) else f"{1e3 * dt:g} ms"


def unit(of: str) -> str:
    """A unit, as it stands behind what is measured in it; nothing for a ratio."""
    return "" if of == "1" else f" [{of}]"


def subject(metric: str, kind: str, truth: str = "") -> str:
    """What a row is about; what one of kind `baseline` is about, stands in its column `truth`."""
    words = metric.replace("_", " ")
    told = {"order": f"order of {words}", "model_error": f"limit of {words}", "ensemble": f"mean {words}"}
    return told.get(ACCEPTED_KINDS.get(truth, kind), words)


def trend(order: float, limit: float, cause: str) -> str:
    """What becomes of an error as the step goes to 0."""
    if cause == "discretisation":
        return "→ 0" if math.isnan(order) else f"order {order:.2f}"
    return {"model": f"→ {written(limit)}", "setting": f"→ {written(limit)}, a setting"}.get(cause, cause)
