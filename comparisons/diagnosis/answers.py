"""The answers of a diagnosis: measured values beside exact ones, with findings and remedies."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from dropspin.comparisons.diagnosis.loose_body import LooseBody
from dropspin.comparisons.judging.error_budget import error_budget, is_sufficient
from dropspin.scenarios.state import Array

Finding = Literal["", "impossible", "changed", "time step", "setting", "model", "target"]
NOTEWORTHY = 0.01
"""Share from which a difference is a finding."""
WATCHED, SETTLED = 0.3, 3.0  # s
UNTURNED = 0.05  # rad
FRICTIONAL = ("cone", "impratio", "timestep")


class Remedy(NamedTuple):
    """A change that removes a finding.

    Attributes:
        text: What to write.
        value: The value measured with it; NaN if it was not tried.
        others: The number of other bodies of the model that it applies to as well.
        runs: Whether the whole model runs with it.
    """

    text: str
    value: float = math.nan
    others: int = 0
    runs: bool = True


@dataclass(frozen=True)
class Answer:
    """A measured value of a body, beside the exact ones.

    Attributes:
        question: What it is about, such as `fall`.
        quantity: What was measured.
        unit: Its unit.
        measured: The value at the file's time step; NaN if it is computed alone.
        in_force: The exact value with the settings in force; NaN if it is not known.
        physical: The exact value without damping, armature and margin; NaN if it is not known.
        limit: The value as dt → 0, extrapolated; NaN if it is not determined.
        least: The least value over start phases; NaN if there is one start.
        most: The largest.
        finding: The kind of finding; empty if it is none.
        settings: The names of the settings that cause it.
        remedies: What removes the finding.
        detail: A sentence's part that explains the value, or replaces one that is not a number.
    """

    question: str
    quantity: str
    unit: str
    measured: float = math.nan
    in_force: float = math.nan
    physical: float = math.nan
    limit: float = math.nan
    least: float = math.nan
    most: float = math.nan
    finding: Finding = ""
    settings: tuple[str, ...] = ()
    remedies: tuple[Remedy, ...] = ()
    detail: str = ""


def judged(
    body: LooseBody,
    question: str,
    quantity: str,
    unit: str,
    dts: Sequence[float],
    values: Sequence[float],
    exact: Sequence[float],
    free: float,
) -> Answer:
    """A value at each time step beside the exact ones: a finding if settings, time step or engine change it by more than 1 %."""
    facts = body.facts
    scale = 100.0 if unit == "%" else max(abs(exact[0]), 1e-300)
    errors = [value - truth for value, truth in zip(values, exact, strict=True)]
    finding: Finding = ""
    settings: tuple[str, ...] = ()
    limit = math.nan
    if facts.unknown:
        exact = [math.nan] * len(values)
        if abs(values[0] - free) > NOTEWORTHY * (100.0 if unit == "%" else abs(free)):
            finding, settings = "setting", (*facts.unknown, *(FRICTIONAL if question == "slide" else ()))
        return Answer(question, quantity, unit, values[0], physical=free, finding=finding, settings=settings)
    if all(map(math.isfinite, values)) and is_sufficient(dts):
        limit = error_budget(dts, errors, negligible=0.1 * NOTEWORTHY * scale).asymptotic_error if any(errors) else 0.0
    if (not math.isfinite(free) and math.isfinite(exact[0])) or abs(exact[0] - free) > NOTEWORTHY * scale:
        finding, settings = "setting", tuple(name for name in ("damping", "armature", "gravcomp") if _acts(body, name))
    elif abs(errors[0]) > NOTEWORTHY * scale * (1.0 + 1e-6):
        vanishes = abs(errors[-1]) < 0.6 * abs(errors[0])
        finding, settings = ("time step", ("integrator", "timestep")) if vanishes else ("model", ())
    return Answer(question, quantity, unit, values[0], exact[0], free, exact[0] + limit, finding=finding, settings=settings)


def _acts(body: LooseBody, setting: str) -> bool:
    facts = body.facts
    return bool({"damping": any(facts.falls), "armature": facts.armature, "gravcomp": facts.lifted}[setting])


def vector_text(axis: Array) -> str:
    """The components of a direction with three digits."""
    return f"({', '.join(f'{value:.3g}' for value in axis)})"
