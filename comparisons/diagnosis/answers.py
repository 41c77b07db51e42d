"""The answers of a diagnosis: measured values beside exact ones, with findings and remedies."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

from dropspin.comparisons.diagnosis.loose_body import LooseBody
from dropspin.comparisons.judging.error_budget import error_budget, is_sufficient
from dropspin.scenarios.state import Array

Kind = Literal["impossible", "changed", "time step", "setting", "model", "target"]
NOTEWORTHY = 0.01
"""Share from which a difference is a finding."""
WATCHED = 0.3  # s
UNTURNED = 0.05  # rad
TIPS, MOVES = "tips or rolls", "does not come to rest"
REBOUND, COEFFICIENT = "rebound / impact speed", "coefficient of the contact"
"""The quantities that have targets."""
DECAY_TIME, KEPT = "1/e time", "fraction kept in 1 s"
"""The quantities of a decay."""
OF_WEIGHT = ("fall", "slide")
"""Questions whose exact solution depends on the weight."""


class Remedy(NamedTuple):
    """A change that removes a finding.

    Attributes:
        text: The text to write into the file, and where.
        value: The value measured with the remedy; NaN if it was not tried.
        unit: The unit of the value.
        others: The number of other bodies of the model to which the remedy also applies.
        runs: Whether the whole model can be simulated with the remedy.
    """

    text: str
    value: float = math.nan
    unit: str = ""
    others: int = 0
    runs: bool = True


class Finding(NamedTuple):
    """An error or an effect of settings that exceeds a threshold.

    Attributes:
        kind: The kind of finding.
        settings: The names of the settings that cause the finding.
        remedies: The changes that remove the finding.
        detail: Part of a sentence that explains the finding.
        tried: The names of settings that were each changed, and none of which removes an error of the engine.
        shares: If several settings act, the share of each in the effect; settings that act only together have one share, as `a, b`.
        removes_error: Whether changes of settings remove an error, not an effect of settings on the exact solution.
    """

    kind: Kind
    settings: tuple[str, ...] = ()
    remedies: tuple[Remedy, ...] = ()
    detail: str = ""
    tried: tuple[str, ...] = ()
    shares: tuple[tuple[str, float], ...] = ()
    removes_error: bool = False

    @property
    def is_error(self) -> bool:
        """Whether the finding is a difference from the exact solution with the settings of the file."""
        return self.kind in ("time step", "model")


@dataclass(frozen=True)
class Answer:
    """A measured value of a body, with the exact values.

    Attributes:
        question: The kind of motion, such as `fall`.
        quantity: The measured quantity.
        unit: The unit of the values.
        direction: The initial direction: a body axis of a spin, or the angle of a slide to an axis of the surface.
        speed: The initial speed [m/s]; NaN if there is none.
        measured: The value at the file's time step; NaN if the quantity is only computed.
        in_force: The exact value with the settings of the file; NaN if it is not known.
        physical: The exact value without damping, armature and margin; NaN if it is not known.
        limit: The value extrapolated to dt → 0; NaN if it is not determined.
        least: The smallest value over the start phases; NaN if there is only one initial state.
        most: The largest value over the start phases; NaN if there is only one initial state.
        findings: The findings on this value.
        detail: The text that is shown if the value is not a number.
    """

    question: str
    quantity: str
    unit: str
    direction: str = ""
    speed: float = math.nan
    measured: float = math.nan
    in_force: float = math.nan
    physical: float = math.nan
    limit: float = math.nan
    least: float = math.nan
    most: float = math.nan
    findings: tuple[Finding, ...] = ()
    detail: str = ""

    @property
    def exact(self) -> float:
        """The exact value with the settings of the file, or without damping, armature and margin if that one is not known."""
        return self.physical if math.isnan(self.in_force) else self.in_force

    @property
    def effect(self) -> float:
        """The measured value, and of a decay its rate [1/s]: quantities to which settings contribute in proportion."""
        if self.quantity == DECAY_TIME:
            return 1.0 / self.measured
        if self.quantity == KEPT:
            return -math.log(self.measured) if self.measured > 0.0 else math.inf
        return self.measured


def judged(body: LooseBody, answer: Answer, dts: Sequence[float], values: Sequence[float], exact: Sequence[float]) -> Answer:
    """An answer with a value at each time step: findings if settings, time step or engine change it by more than 1 %.

    Args:
        body: The body.
        answer: What was measured, and the exact value without the settings.
        dts: Time steps [s].
        values: The value at each.
        exact: The exact value with the settings in force, at each.
    """
    unknown, causes, free = body.unknown, body.causes.get(answer.question, ()), answer.physical
    is_acting = {"damping": any(body.falls), "armature": body.armature}
    is_acting["gravcomp"] = body.lifted and answer.question in OF_WEIGHT
    acting = tuple(name for name, acts in is_acting.items() if acts)
    if unknown:
        scale = 100.0 if answer.unit == "%" else abs(free) if math.isfinite(free) else 0.0
        differs = bool(abs(values[0] - free) > NOTEWORTHY * scale)
        return replace(answer, measured=values[0], findings=(Finding("setting", (*unknown, *acting, *causes)),) * differs)
    scale = 100.0 if answer.unit == "%" else max(abs(exact[0]), 1e-300)
    errors, limit = [value - truth for value, truth in zip(values, exact, strict=True)], math.nan
    findings: list[Finding] = []
    if all(map(math.isfinite, values)) and is_sufficient(dts):
        budget = error_budget(dts, errors, negligible=0.1 * NOTEWORTHY * scale)
        limit = math.nan if budget.cause == "unresolved" else budget.asymptotic_error
    if values[0] != free and ((not math.isfinite(free) and math.isfinite(exact[0])) or abs(exact[0] - free) > NOTEWORTHY * scale):
        findings.append(Finding("setting", acting))
    if abs(errors[0]) > NOTEWORTHY * scale * (1.0 + 1e-6):
        vanishes = abs(errors[-1]) < 0.6 * abs(errors[0])
        findings.append(Finding("time step" if vanishes else "model", (*causes, "timestep")))
    return replace(answer, measured=values[0], in_force=exact[0], limit=exact[0] + limit, findings=tuple(findings))


def vector_text(axis: Array) -> str:
    """The components of a unit vector with three decimals, or the name of the axis of the body."""
    rounded = [round(value, 3) + 0.0 for value in axis.tolist()]
    names = [name for name, value in zip("xyz", rounded, strict=True) if value]
    return names[0] if len(names) == 1 else f"({', '.join(f'{value:g}' for value in rounded)})"


def digits(values: Iterable[float]) -> str:
    """Numbers with three digits."""
    return ", ".join(f"{value:.3g}" for value in values)
