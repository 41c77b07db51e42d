"""The output of `dropspin calibrate`: the settings, and the values measured with them."""

import math
from typing import Any

from dropspin.comparisons.calibration import Calibration, Measured
from dropspin.reports.document import Document, Table
from dropspin.reports.stories.numbers import with_unit
from dropspin.scenarios import DropspinError


def friction(text: str) -> str | float:
    """The value of the option `--friction` as the friction of a floor.

    Raises:
        DropspinError: The value is not a valid friction.
    """
    if text in ("none", "infinite"):
        return text
    try:
        return float(text)
    except ValueError:
        raise DropspinError(f"friction: got {text!r}; give none, infinite or a coefficient.") from None


def document(calibration: Calibration) -> Document:
    """A table of the values measured with the calibrated settings, and a table of these settings with their reasons."""
    measured = [{"measured": result.name, "value": _value(result), "how": result.how} for result in calibration.measured]
    settings = [{"set": name, "to": str(value), "why": calibration.reasons.get(name, "")} for name, value in calibration.settings.items()]
    return Document(calibration.engine, [Table(measured), Table(settings)])


def _value(result: Measured) -> str:
    return "–" if math.isnan(result.value) else with_unit(f"{result.value:.4g}", result.unit)


def as_data(calibration: Calibration) -> dict[str, Any]:
    """A calibration for JSON."""
    return {name: getattr(calibration, name) for name in ("engine", "measured", "settings", "programs")}
