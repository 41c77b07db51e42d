"""The output of `dropspin calibrate`: the settings, and the values measured with them."""

import math
from dataclasses import asdict
from typing import Any

from dropspin.comparisons.calibration import Calibration, Measured
from dropspin.scenarios import DropspinError

Rows = list[dict[str, str]]


def friction(text: str) -> str | float:
    """The value of the option `--friction` as a floor's friction.

    Raises:
        DropspinError: The value is not a valid friction.
    """
    if text in ("none", "infinite"):
        return text
    try:
        return float(text)
    except ValueError:
        raise DropspinError(f"friction: got {text!r}; give none, infinite or a coefficient.") from None


def measured_rows(found: Calibration) -> Rows:
    """The values that were measured with the calibrated settings."""
    return [{"measured": one.name, "value": _with_unit(one), "how": one.how} for one in found.measured]


def _with_unit(one: Measured) -> str:
    if math.isnan(one.value):
        return "–"
    return f"{one.value:.4g}" if one.unit == "1" else f"{one.value:.4g} {one.unit}"


def setting_rows(found: Calibration) -> Rows:
    """The settings and the reasons for them."""
    return [{"set": name, "to": str(value), "why": found.reasons.get(name, "")} for name, value in found.settings.items()]


def as_data(found: Calibration) -> dict[str, Any]:
    """A calibration for JSON."""
    return {
        "engine": found.engine,
        "measured": [asdict(one) | {"value": None if math.isnan(one.value) else one.value} for one in found.measured],
        "settings": dict(found.settings),
        "programs": dict(found.programs),
    }
