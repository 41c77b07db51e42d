"""How numbers are written, everywhere."""

import math

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
