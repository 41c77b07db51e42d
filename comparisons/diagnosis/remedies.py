"""Remedies of findings: what removes them, tried on the body."""

import math
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, lru_cache
from itertools import combinations
from typing import NamedTuple

from dropspin.comparisons.diagnosis.answers import COEFFICIENT, DECAY_TIME, NOTEWORTHY, REBOUND, Answer, Finding, Kind, Remedy
from dropspin.comparisons.diagnosis.landing import IMPACTS, rebound
from dropspin.comparisons.diagnosis.loose_body import LooseBody
from dropspin.comparisons.engines.base import Diverged
from dropspin.comparisons.running.ablation import shares

HALVINGS = (1.0, 0.5, 0.25)
SAFE = 0.85
"""Factor on the time step at which an error of first order would be as large as a finding."""
MOST = 0.5
"""Share of an error that is left at most if what was changed is named as its cause."""
SHORTEST = 0.01
"""The shortest time step that is tried, relative to that of the file: nobody would run a hundred times as many steps."""
OF_RESTITUTION = (1.0, 1.0 / 8.0, 1.0 / 32.0)
"""Time steps at which settings for a restitution are tried, relative to that of the file."""
KEPT = 32
"""Results of trying whether a restitution stays, which several questions ask for."""
Question = Callable[[LooseBody, Sequence[float]], list[Answer]]
"""A function of a body and of time steps, of which the first is judged."""


class Targets(NamedTuple):
    """What the user wants of a body: a coefficient of restitution and of friction; None for no target."""

    restitution: float | None = None
    friction: float | None = None

    @property
    def wanted(self) -> dict[str, float]:
        """The targets by the quantities that have them."""
        return {name: value for name, value in ((REBOUND, self.restitution), (COEFFICIENT, self.friction)) if value is not None}

    def judged(self, body: LooseBody, answers: Sequence[Answer]) -> Iterator[Answer]:
        """The answers, those that miss a target with a finding; and one for each target that nothing was measured for.

        A contact with a plane that is added in place of what the file has is not judged.
        """
        is_of_file = not (body.missed or body.left_out)
        missing = [answer for answer in answers if is_of_file and not self.meets(answer)]
        missed = {answer.quantity for answer in missing}
        remedies = self._remedies(body, answers, missed) or self._remedies(body, answers, missed - {REBOUND})
        for answer in answers:
            finding = Finding("target", (), remedies.get(answer, ()), f"the target is {self.wanted.get(answer.quantity, math.nan):g}")
            yield replace(answer, findings=(*answer.findings, finding)) if answer in missing else answer
        measured = {answer.quantity for answer in answers if is_of_file}
        for quantity in (name for name in self.wanted if name not in measured):
            question = "impact" if quantity == REBOUND else "friction"
            finding = Finding("target", detail=f"the target is {self.wanted[quantity]:g}, but {_why_unmeasured(body)}")
            yield Answer(question, quantity, "1", detail="not measured", findings=(finding,))

    def meets(self, answer: Answer) -> bool:
        """Whether an answer has no target, or is within 0.01 of it."""
        wanted = self.wanted.get(answer.quantity)
        return wanted is None or abs(answer.measured - wanted) <= NOTEWORTHY

    def _remedies(self, body: LooseBody, answers: Sequence[Answer], missed: Collection[str]) -> dict[Answer, tuple[Remedy]]:
        """Settings for the quantities that miss their targets, at the largest time step at which all answers of these meet theirs.

        Empty if they do at none, the next one of which is tried if they come nearer to the target than before.
        """
        restitution, friction = (self.wanted[name] if name in missed else None for name in (REBOUND, COEFFICIENT))
        tried, nearest = [answer for answer in answers if answer.quantity in missed], math.inf
        for share in OF_RESTITUTION if tried else ():
            step = _rounded(share * body.dt) if REBOUND in missed else body.dt
            changes = body.for_contact(restitution, friction, step)
            other = body.changed(changes)
            found = {
                answer: _rebound(other, step, answer.speed) if answer.quantity == REBOUND else replace(answer, measured=other.friction)
                for answer in tried
            }
            if all(map(self.meets, found.values())):
                text, elsewhere = body.patch(changes, step), body.elsewhere(step, changes)
                return {answer: (Remedy(text, one.measured, one.unit, *elsewhere),) for answer, one in found.items()}
            error = max(abs(one.measured - self.wanted[one.quantity]) for one in found.values())
            if not error < nearest:
                break
            nearest = error
        return {}


@lru_cache(KEPT)
def _is_kept(targets: Targets, body: LooseBody, other: LooseBody, dt: float) -> bool:
    """Whether a body with other settings, at a time step [s], rebounds as is wanted where the body does."""
    return targets.restitution is None or all(targets.meets(_rebound(other, dt, speed)) for speed in _met_speeds(targets, body))


@lru_cache(1)
def _met_speeds(targets: Targets, body: LooseBody) -> list[float]:
    """The speeds of impacts at which a body rebounds as is wanted [m/s]."""
    return [speed for speed in IMPACTS if body.lands and targets.meets(_rebound(body, body.dt, speed))]


def _rebound(body: LooseBody, dt: float, speed: float) -> Answer:
    """The rebound of a body at the speed of an impact [m/s]; NaN if its simulation breaks down."""
    with suppress(Diverged):
        return rebound(body, [dt], speed, REBOUND)
    return Answer("impact", REBOUND, "1", speed=speed)


def _why_unmeasured(body: LooseBody) -> str:
    """Why nothing was measured for a target."""
    if body.missed or not body.surface:
        return body.missed or "the body lands on no surface"
    if not body.lands:
        return "gravity does not hold the body on a surface"
    if body.left_out:
        return f"the simulation leaves out {body.left_out}"
    return "the geometries that touch the surface differ in it" if math.isnan(body.friction) else "the simulation broke down"


NO_TARGETS = Targets()


def answers_to(question: Question, body: LooseBody, targets: Targets = NO_TARGETS) -> Iterator[Answer]:
    """The answers to a question, each finding with the remedies that remove it and miss no target that was met; of a breakdown, why."""
    dt = body.dt
    try:
        answers = question(body, [dt * factor for factor in HALVINGS])
    except Diverged as error:
        yield Answer(question.__name__, "breakdown", "", findings=(Finding("time step", ("timestep",), detail=str(error)),))
        return

    @cache
    def again(settings: tuple[str, ...] | frozenset[str], step: float) -> list[Answer]:
        """The answers with the remedies of settings, or with a set of them reverted alone, at a time step [s]; none of a breakdown."""
        with suppress(Diverged):
            if isinstance(settings, tuple):
                return question(body.tried(settings, step), [step])
            return question(body.changed({name: body.remedies[name][name] for name in settings}), [step])
        return []

    for number, answer in enumerate(answers):

        def effect(reverted: frozenset[str], n: int = number) -> float:
            return next((other.effect for other in again(reverted, dt)[n : n + 1]), math.nan)

        explained = [_explained(body, finding, effect) for finding in answer.findings]

        def suitable(settings: tuple[str, ...], step: float, n: int = number, before: Answer = answer) -> list[Answer]:
            return [other for other in again(settings, step)[n : n + 1] if targets.meets(other) or not targets.meets(before)]

        findings = [_remedied(body, answer, finding, suitable, targets) for finding in explained]
        yield replace(answer, findings=tuple(findings))


def _explained(body: LooseBody, finding: Finding, effect: Callable[[frozenset[str]], float]) -> Finding:
    """A finding of several settings with the one or two that explain it, if any do."""
    known = [name for name in finding.settings if name in body.remedies]
    explaining = shares(effect, known) if finding.kind == "setting" and len(known) > 1 else {}
    if not explaining:
        return finding
    settings = tuple(dict.fromkeys(name for names in explaining for name in names))
    return finding._replace(settings=settings, shares=tuple((", ".join(names), share) for names, share in explaining.items()))


def _remedied(
    body: LooseBody, answer: Answer, finding: Finding, again: Callable[[tuple[str, ...], float], list[Answer]], targets: Targets
) -> Finding:
    """A finding with the changes that remove it, each with the value measured; the finding is then of what the first one changes."""
    found: dict[tuple[str, ...], Remedy] = {}
    changed: set[str] = set()
    for settings, step in _tries(body, answer, finding):
        changes = body.changes(settings)
        if settings in found or (len(settings) > 1 and found) or body.patch(changes, step) in {one.text for one in found.values()}:
            continue
        may_stay = not finding.is_error or (finding.kind == "time step" and not settings)
        for other in again(settings, step):
            if math.isnan(other.measured):
                continue  # nothing was measured, such as of a body that now tips
            if finding.is_error and abs(other.measured - answer.exact) > abs(answer.measured - answer.exact):
                continue  # a finding may also end because a smaller step is judged by another one
            stays = abs(other.measured - other.in_force) > MOST * abs(answer.measured - answer.in_force)
            # At rest, an error at one time step alone is not known to be one of the step.
            is_wrong = answer.question == "rest" and any(one.settings != ("margin",) for one in other.findings)
            remains = is_wrong or any(one.is_error == finding.is_error or body.unknown for one in other.findings)
            if answer.quantity == DECAY_TIME and math.isnan(answer.measured):  # of a spin that did not decay
                remains = math.isinf(other.measured)
            if (may_stay or not stays) and not remains and _is_kept(targets, body, body.tried(settings, step), step):
                found[settings] = Remedy(body.patch(changes, step), other.measured, other.unit, *body.elsewhere(step, changes))
                changed = changed or {*changes, *["timestep"] * (step != body.dt)}
    if not found and finding.is_error:
        is_step = finding.kind == "time step"
        return finding._replace(settings=("timestep",)) if is_step else finding._replace(settings=(), tried=finding.settings)
    if not found:
        return finding
    kind: Kind = "setting" if finding.kind == "model" and () not in found else finding.kind
    unchanged = tuple(name for name in finding.settings if name not in (*body.remedies, "timestep"))
    settings = tuple(name for name in finding.settings if name in changed)
    if not finding.is_error:
        settings = finding.settings if finding.shares else settings + unchanged
    removes = finding.is_error and kind == "setting"
    return finding._replace(kind=kind, settings=settings, remedies=tuple(found.values()), removes_error=removes)


def _tries(body: LooseBody, answer: Answer, finding: Finding) -> Iterator[tuple[tuple[str, ...], float]]:
    """The settings whose effect to take away, one by one, those of the file first, then together, and the time step [s]."""
    dt, written = body.dt, {name for name, setting in body.settings.items() if setting.file}
    known = sorted((name for name in finding.settings if name in body.remedies), key=lambda name: name not in written)
    for name in known:
        yield (name,), dt
        if finding.kind == "model":
            yield (name,), _rounded(0.125 * dt)
    if "timestep" in finding.settings:
        scale = 100.0 if answer.unit == "%" else abs(answer.in_force) or 1.0
        excess = math.inf if answer.question == "rest" else abs(answer.measured - answer.in_force) / scale / NOTEWORTHY
        yield (), _rounded(dt * (max(SAFE / excess, SHORTEST) if 1.0 < excess < math.inf else 0.25))
    if finding.kind == "model":
        yield from ((pair, dt) for pair in combinations(known, 2))
    together = tuple(name for name in known if name not in body.causes.get(answer.question, ()))
    if len(together) > 1 and not finding.is_error:
        yield together, dt


def _rounded(step: float) -> float:
    """A time step [s] with two digits."""
    return float(f"{step:.2g}")
